//! Moment-consistent weights: on any particles exact for polynomials up to an order, by a weighted least-squares fit
//! around each particle (generalised moving least squares; DC-PSE, Schrader, Reboux & Sbalzarini 2010; LABFM, King, Lind &
//! Nasar 2020). Not symmetric, so energy is kept only as well as the field is resolved, and not positive.
//!
//! With monomials p of degree 1 to `order` in d/(R h), the weights V_b w_ab = W_ab p_ab·c solve
//! (Σ_b W p pᵀ) c = ∇² p (0): a Laplacian of order − 1 in h at least, of `order` where particles are regular.
//!
//! Where neighbours are too few for the order, or too much on one side, such weights have growing modes: a one-sided second
//! difference has the wrong sign on its own particle. There a lower order is taken. Beside a free surface they know
//! nothing of insulation and lose or make energy; there and where even order 2 is not safe rows are left to normalised
//! pairs, for which insulation is the natural boundary.

use super::assembly::Assembly;
use super::ldl::{LANES, Lanes, Ldl};
use super::polynomials::{Powers, add, monomials};
use crate::error::Result;
use crate::memory;
use crate::space::Row;

/// Below this ratio of a pivot to the spread of its monomial neighbours do not tell the monomials apart.
const FLAT: f64 = 1e-6;

/// A row is stable enough if Σ w is at least this share of Σ |w|. In 96 scenes (2-D and 3-D, periodic and open, 20 and 40 %
/// jitter, three orders, four supports) modes grew in 30 at 0, in 3 at 0.1, and in none at 0.2.
const DOMINANT: f64 = 0.2;

/// |Σ W d² d|² / (Σ W d² Σ W d⁴) above which a particle counts as being beside a surface. Half a spacing from a plane it is
/// 0.3, a third of the support from it 0.05; inside, where 40 % jitter is all the disorder, at most 0.04, and among random
/// particles above 0.1 for 7 % in 2-D and 1 % in 3-D (C2, 40 and 76 neighbours). From 0.02 to 0.2 errors and energy of
/// a jittered open square are the same to a third.
const ONE_SIDED: f64 = 0.1;

/// Room for the moments, 455 at most, and behind them a 0 and a 1. A power of two, so that a place in it needs no check.
const MOMENTS: usize = 512;
const ZERO: usize = MOMENTS - 2;
const ONE: usize = MOMENTS - 1;

/// Turns the values of the kernel in `w` into weights; answers the order reached: lower than the one asked for where
/// neighbours are too few, lie in a line or plane, or are on one side, 0 (and weights of the kernel itself, to be replaced)
/// where even 2 cannot be had, or beside a surface.
///
/// # Errors
/// `NoMemory`.
pub fn fit(assembly: &Assembly, row: &Row, w: &mut [f64], space: &mut Space) -> Result<u32> {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: this processor has AVX2.
        return unsafe { fit_avx2(assembly, row, w, space) };
    }
    fit_anywhere(assembly, row, w, space)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn fit_avx2(assembly: &Assembly, row: &Row, w: &mut [f64], space: &mut Space) -> Result<u32> {
    fit_anywhere(assembly, row, w, space)
}

#[inline(always)]
fn fit_anywhere(assembly: &Assembly, row: &Row, w: &mut [f64], space: &mut Space) -> Result<u32> {
    let dim = assembly.kernel.dim();
    let scale = 1.0 / (assembly.kernel.radius() * assembly.rows.h[row.i]);
    let mut order = if !assembly.any_row && is_one_sided(row, w) { 0 } else { assembly.order };
    while order > 0 {
        if space.solve(dim, order, row, scale, w)? && (assembly.any_row || dominant(&space.terms)) {
            // Volumes are fetched first, so that divisions are made side by side.
            w.iter_mut().zip(row.j).for_each(|(w, &j)| *w = assembly.volume[j as usize]);
            w.iter_mut().zip(space.terms.as_flattened()).for_each(|(w, term)| *w = term * (scale * scale) / *w);
            return Ok(order);
        }
        order -= 2;
    }
    let itself = assembly.kernel.laplacian_factor() * (assembly.kernel.radius() * scale).powi(2);
    w.iter_mut().for_each(|w| *w *= itself);
    Ok(0)
}

/// Whether neighbours are on one side.
#[inline(always)]
fn is_one_sided(row: &Row, w: &[f64]) -> bool {
    let mut skew = [0.0; 3];
    for (skew, d) in skew.iter_mut().zip(row.d) {
        *skew = w.iter().zip(row.r).zip(d).map(|((w, r), d)| w * (r * r) * d).sum();
    }
    let near: f64 = w.iter().zip(row.r).map(|(w, r)| w * (r * r)).sum();
    let far: f64 = w.iter().zip(row.r).map(|(w, r)| w * (r * r) * (r * r)).sum();
    skew.iter().map(|s| s * s).sum::<f64>() > ONE_SIDED * near * far
}

/// Whether a row is stable enough.
#[inline(always)]
fn dominant(terms: &[Lanes]) -> bool {
    let (mut sum, mut size) = (Lanes::default(), Lanes::default());
    for term in terms {
        add(&mut sum, *term);
        add(&mut size, term.map(f64::abs));
    }
    sum.iter().sum::<f64>() >= DOMINANT * size.iter().sum::<f64>()
}

/// What a worker fits rows in, kept from row to row.
#[derive(Default)]
pub struct Space {
    /// Those met so far.
    bases: Vec<Basis>,
    powers: Powers,
    normal: Ldl,
    unknowns: Vec<Lanes>,
    /// c, with that of the constant, which is 0.
    c: Vec<f64>,
    /// w p·c of each neighbour.
    terms: Vec<Lanes>,
}

impl Space {
    /// Fills `terms`; answers false where the fit is not safe.
    #[inline(always)]
    fn solve(&mut self, dim: usize, order: u32, row: &Row, scale: f64, w: &[f64]) -> Result<bool> {
        let Space { bases, powers, normal, unknowns, c, terms } = self;
        let basis = Basis::among(bases, dim, order as usize);
        if row.len() < basis.unknowns() {
            return Ok(false);
        }
        powers.raise(dim, 2 * basis.order, row, scale, w)?;
        let mut moments = [0.0; MOMENTS];
        powers.moments(&mut moments[..ZERO])?;
        moments[ONE] = 1.0;
        refill(unknowns, basis.unknowns().div_ceil(LANES))?;
        for (tile, places) in normal.reset(unknowns.len())?.iter_mut().zip(&basis.places) {
            let columns = tile.as_flattened_mut().iter_mut().zip(places.as_flattened());
            columns.for_each(|(element, &place)| *element = moments[usize::from(place) % MOMENTS]);
        }
        if !normal.factor(FLAT) {
            return Ok(false);
        }
        // The Laplacian of the monomials at 0.
        unknowns.as_flattened_mut()[basis.unknowns() - dim..basis.unknowns()].fill(2.0);
        normal.solve(unknowns);
        c.clear();
        c.push(0.0);
        c.extend(basis.rank.iter().map(|&rank| unknowns.as_flattened()[usize::from(rank)]));
        refill(terms, row.len().div_ceil(LANES))?;
        powers.combine(basis.order, c, terms);
        Ok(true)
    }
}

fn refill(lanes: &mut Vec<Lanes>, n: usize) -> Result<()> {
    lanes.clear();
    memory::extended("a fit", lanes, n, Lanes::default())
}

/// The monomials of degree 1 to an order as unknowns. The pure squares, which alone have a Laplacian, come last: so the
/// right-hand side begins with zeros.
struct Basis {
    dim: usize,
    order: usize,
    /// The place of each monomial among the unknowns.
    rank: Vec<u16>,
    /// For each tile of Σ w p pᵀ which moment stands where.
    places: Vec<[[u16; LANES]; LANES]>,
}

impl Basis {
    /// A basis of those met so far, or a new one.
    #[inline(never)]
    fn among(bases: &mut Vec<Basis>, dim: usize, order: usize) -> &Basis {
        let at = bases.iter().position(|basis| (basis.dim, basis.order) == (dim, order)).unwrap_or_else(|| {
            bases.push(Basis::new(dim, order));
            bases.len() - 1
        });
        &bases[at]
    }

    fn new(dim: usize, order: usize) -> Basis {
        // Where the moments are that begin with x^i y^j.
        let mut first = [[0; 13]; 13];
        for (at, [i, j, k]) in monomials(dim, 2 * order).enumerate() {
            first[i][j] = at - k;
        }
        let exponents: Vec<[usize; 3]> = monomials(dim, order).skip(1).collect();
        let is_square = |e: &[usize; 3]| e.iter().sum::<usize>() == 2 && e.contains(&2);
        let (squares, others): (Vec<_>, Vec<_>) = exponents.iter().copied().partition(is_square);
        let unknowns = [others, squares].concat();
        let place = |a: usize, b: usize| match (unknowns.get(a), unknowns.get(b)) {
            (Some(a), Some(b)) => first[a[0] + b[0]][a[1] + b[1]] + a[2] + b[2],
            _ if a == b => ONE,
            _ => ZERO,
        };
        let blocks = unknowns.len().div_ceil(LANES);
        let tile = |r: usize, c: usize| {
            std::array::from_fn(|k| std::array::from_fn(|l| place(LANES * c + k, LANES * r + l) as u16))
        };
        let rank = |e: &[usize; 3]| unknowns.iter().position(|u| u == e).unwrap_or_default() as u16;
        Basis {
            dim,
            order,
            rank: exponents.iter().map(rank).collect(),
            places: (0..blocks).flat_map(|r| (0..=r).map(move |c| (r, c))).map(|(r, c)| tile(r, c)).collect(),
        }
    }

    fn unknowns(&self) -> usize {
        self.rank.len()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Normalise, table};
    use super::*;
    use crate::array::Strided;
    use crate::kernel::Kernel;
    use crate::pool::Pool;
    use crate::space::{Cloud, Domain, Scratch, rows::Rows};

    #[test]
    fn the_bits_are_the_same_with_and_without_avx2() {
        let pool = Pool::new(1).unwrap();
        let mut state = 5u64;
        let mut uniform = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let mut met = [0; 7];
        for (dim, h) in [(1, 0.03), (2, 0.09), (3, 0.2)] {
            let n = 300;
            let x: Vec<f64> = (0..n * dim).map(|_| uniform()).collect();
            let kernel = Kernel::new("M4", dim).unwrap();
            let (h, volume) = (vec![h; n], vec![1.0 / n as f64; n]);
            let cloud =
                Cloud::sort(&Domain::open(dim), Strided::new("x", &x, n, dim, dim).unwrap(), 0.4, &pool).unwrap();
            let rows = Rows::new(&cloud, &h, kernel.radius(), &pool).unwrap();
            let operator = table::find("consistent").unwrap();
            let assembly = Assembly {
                operator,
                normalise: Normalise::No,
                kernel: &kernel,
                rows: &rows,
                volume: &volume,
                same_h: true,
                order: 6,
                any_row: false,
                shape: None,
            };
            let (mut space, mut plain) = (Space::default(), Space::default());
            rows.visit(0..n, &mut Scratch::default(), |row| {
                let mut w = vec![0.0; row.len()];
                kernel.w(&row.r.iter().map(|r| r / h[0]).collect::<Vec<_>>(), &mut w);
                let mut other = w.clone();
                let reached = fit(&assembly, &row, &mut w, &mut space).unwrap();
                assert_eq!(fit_anywhere(&assembly, &row, &mut other, &mut plain).unwrap(), reached);
                assert!(w.iter().zip(&other).all(|(a, b)| a.to_bits() == b.to_bits()), "{dim}-D order {reached}");
                met[reached as usize] += 1;
                Ok(())
            })
            .unwrap();
        }
        assert!([0, 2, 4, 6].iter().all(|&order| met[order] > 10), "{met:?}");
    }
}
