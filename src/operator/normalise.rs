//! What the weights of pairs are scaled by, so that particles which are not a lattice conduct as much as they should.
//!
//! `pair`: by the mean of 1/K_a and 1/K_b, K_a = Σ_b V_b w_ab r²/(2 nu), so that the mean over all directions is right.
//!
//! `tensor`: by the mean of φ_a and φ_b, φ_a(r̂) = r̂·B_a r̂ with the symmetric B_a for which
//!
//! ```text
//! Σ_b V_b w_ab (r²/2) φ_a(r̂) r̂ r̂ᵀ = I        (S_a, where kappa is a tensor)
//! ```
//!
//! so that every direction is right: in squeezed lattices, in thin bodies and beside surfaces as well. Either is the same
//! from both sides of a pair. Pairs that `tensor` would make negative are cut. Where neighbours differ, the mean of two
//! particles' φ meets the condition of neither exactly.
//!
//! A direction in which a particle has no neighbours cannot conduct, and asking for it would spoil the others: asked for
//! are those that are there ([`Asked`]), and half of those that have neighbours on one side only ([`sides`]).

use super::Matrix;
use super::assembly::Assembly;
use super::sides;
use super::table::Normalise;
use super::tensor::{self, AXES, Sym};
use crate::error::Result;
use crate::memory;
use crate::pool::Pool;
use crate::space::Row;
use crate::sum;
use nalgebra::{Matrix3, Matrix6, Vector6};
use std::f64::consts::SQRT_2;

/// K_a below which a particle counts as having too few neighbours for its weights to be normalised: scaling them up
/// by more than this would make a lone pair as stiff as it is meaningless.
const LEAST_MOMENT: f64 = 0.1;

/// Eigenvalues of the conditions that are less than this of the largest are solved for less and less. At a tenth of it
/// lattices squeezed 6:1 are right with more kernels, and the pairs of disorder stiffer.
const FLAT: f64 = 1e-2;

/// What is known of each particle before pairs are scaled.
#[derive(Default)]
pub struct Normals {
    /// K_a
    pub moments: Vec<f64>,
    /// B_a; empty where none is wanted.
    pub tensors: Vec<Sym>,
    /// Rows of consistent weights that take normalised pairs instead; empty for other operators.
    pub paired: Vec<bool>,
    /// Of projected weights, the root mean square of [`super::moments::conduction`].
    pub defect: Option<f64>,
}

/// Scales the pairs of a matrix as the assembly says.
///
/// # Errors
/// `NoMemory`.
pub fn scale(assembly: &Assembly, matrix: &mut Matrix, normals: &Normals, pool: &Pool) -> Result<()> {
    match (assembly.normalise, assembly.kernel.dim()) {
        (Normalise::No, _) => Ok(()),
        (Normalise::Tensor, 1) => by_tensor::<1, 1>(assembly, matrix, &normals.tensors, pool),
        (Normalise::Tensor, 2) => by_tensor::<2, 3>(assembly, matrix, &normals.tensors, pool),
        (Normalise::Tensor, _) => by_tensor::<3, 6>(assembly, matrix, &normals.tensors, pool),
        (Normalise::Pair, _) => {
            let half = normals.moments.iter().map(|&k| 0.5 / k.max(LEAST_MOMENT));
            let half = &memory::collected("normalisation", half)?[..];
            matrix.scale(pool, move |a, b| half[a] + half[b]);
            Ok(())
        }
    }
}

/// Which component of a [`Sym`] is number c of those that D dimensions have.
const fn component(dim: usize, c: usize) -> usize {
    if dim == 2 && c == 2 { 3 } else { c }
}

/// d_k d_l of each component.
#[inline(always)]
fn squares<const D: usize, const C: usize>(d: &[f64; D]) -> [f64; C] {
    std::array::from_fn(|c| {
        let [k, l] = AXES[component(D, c)];
        d[k] * d[l]
    })
}

/// Where a particle is, and half of its B.
#[derive(Clone, Copy)]
struct Place<const D: usize, const C: usize> {
    x: [f64; D],
    half: [f64; C],
}

fn by_tensor<const D: usize, const C: usize>(
    assembly: &Assembly,
    matrix: &mut Matrix,
    tensors: &[Sym],
    pool: &Pool,
) -> Result<()> {
    let x = &assembly.rows.cloud.x;
    let place = |(i, b): (usize, &Sym)| Place { x: std::array::from_fn(|a| x[a][i]), half: halved::<D, C>(b) };
    let places = memory::collected("normalisation", tensors.iter().enumerate().map(place))?;
    let places: &[Place<D, C>] = &places;
    match assembly.rows.nearest::<D>() {
        Some(nearest) => {
            matrix.update(pool, move |a, b, _, g| {
                let (a, b) = (&places[a], &places[b]);
                g * factor::<D, C>(&nearest.apart(&a.x, &b.x), &a.half, &b.half)
            });
            Ok(())
        }
        None => matrix.update_rows(
            assembly.rows,
            pool,
            |_| true,
            |_: &mut (), row, g| {
                scale_row::<D, C>(row, tensors, g);
                Ok(())
            },
        ),
    }
}

/// Scales the coefficients of one row by the tensors of all particles.
pub fn of_row(dim: usize, row: &Row, tensors: &[Sym], g: &mut [f64]) {
    match dim {
        1 => scale_row::<1, 1>(row, tensors, g),
        2 => scale_row::<2, 3>(row, tensors, g),
        _ => scale_row::<3, 6>(row, tensors, g),
    }
}

fn scale_row<const D: usize, const C: usize>(row: &Row, tensors: &[Sym], g: &mut [f64]) {
    let own = halved::<D, C>(&tensors[row.i]);
    for (k, (g, &j)) in g.iter_mut().zip(row.j).enumerate() {
        *g *= factor::<D, C>(&std::array::from_fn(|a| row.d[a][k]), &own, &halved::<D, C>(&tensors[j as usize]));
    }
}

/// Half of a tensor in the coefficients of dx², …, dx dy, …
#[inline(always)]
fn halved<const D: usize, const C: usize>(b: &Sym) -> [f64; C] {
    std::array::from_fn(|c| if c < D { 0.5 * b[c] } else { b[component(D, c)] })
}

/// (φ_a + φ_b)/2 in the direction of d, or 0: the same bits from both sides. Coincident particles, which have no direction,
/// take the mean over all.
#[inline(always)]
fn factor<const D: usize, const C: usize>(d: &[f64; D], a: &[f64; C], b: &[f64; C]) -> f64 {
    let all: [f64; C] = squares(d);
    let (mut r2, mut sum, mut mean) = (0.0, 0.0, 0.0);
    for c in 0..C {
        let half = a[c] + b[c];
        sum += half * all[c];
        if c < D {
            r2 += all[c];
            mean += half;
        }
    }
    let phi = if r2 > NEAREST * NEAREST { sum / r2 } else { mean / D as f64 };
    phi.max(0.0)
}

/// B of a particle from its coefficients g_ab = V_a V_b w_ab before they are scaled.
pub fn tensor_of(assembly: &Assembly, row: &Row, g: &[f64]) -> Sym {
    let wanted = sides::part_of(&wanted(assembly, row.i), assembly.kernel.dim(), row, g);
    tensor_for(&wanted, assembly, row, g)
}

/// What a particle's second moment is to be where neighbours are all around.
pub fn wanted(assembly: &Assembly, i: usize) -> Sym {
    let shape = assembly.shape.filter(|_| assembly.operator.turns_weights());
    shape.map_or(tensor::unit(assembly.kernel.dim()), |shape| shape[i])
}

/// B for which the second moment is the wanted one.
pub fn tensor_for(wanted: &Sym, assembly: &Assembly, row: &Row, g: &[f64]) -> Sym {
    let scale = 0.5 / assembly.volume[row.i];
    match assembly.kernel.dim() {
        1 => {
            let moment = (scale * sum::product(g, row.r, row.r)).max(LEAST_MOMENT);
            [wanted[0] / moment, 0.0, 0.0, 0.0, 0.0, 0.0]
        }
        2 => Conditions::<2, 3>::of(scale, row, g).solve(wanted),
        _ => Conditions::<3, 6>::of(scale, row, g).solve(wanted),
    }
}

const LANES: usize = 4;
type Lanes = [f64; LANES];
/// Fours of pairs that are added up together.
const CHUNK: usize = 32;
/// Distance of which the square is a number, below which a pair has no direction.
const NEAREST: f64 = 1e-150;

/// Σ ω r̂_k r̂_k r̂_l r̂_m, ω = V_b w_ab r²/2: for each axis k and each component lm from kk on. All other products of four
/// are among these.
type Sums<const D: usize, const C: usize> = [[f64; C]; D];

#[inline(always)]
fn sums<const D: usize, const C: usize>(row: &Row, g: &[f64]) -> Sums<D, C> {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: this processor has AVX2.
        return unsafe { sums_avx2(row, g) };
    }
    sums_anywhere(row, g)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn sums_avx2<const D: usize, const C: usize>(row: &Row, g: &[f64]) -> Sums<D, C> {
    sums_anywhere(row, g)
}

/// Axis after axis, so that the running sums of one stay in registers.
#[inline(always)]
fn sums_anywhere<const D: usize, const C: usize>(row: &Row, g: &[f64]) -> Sums<D, C> {
    let mut sums = [[[0.0; LANES]; C]; D];
    let mut part = [[[0.0; LANES]; CHUNK]; 4];
    let (mut at, n) = (0, row.len());
    while at < n {
        let end = (at + LANES * CHUNK).min(n);
        let chunks = (end - at).div_ceil(LANES);
        let [over_r2, d @ ..] = &mut part;
        for (axis, d) in d.iter_mut().enumerate().take(D) {
            fill(d, &row.d[axis][at..end], chunks);
        }
        fill(over_r2, &g[at..end], chunks);
        let mut r = [[1.0; LANES]; CHUNK];
        fill(&mut r, &row.r[at..end], chunks);
        for chunk in 0..chunks {
            for k in 0..LANES {
                let r = r[chunk][k];
                over_r2[chunk][k] = if r > NEAREST { over_r2[chunk][k] / (r * r) } else { 0.0 };
            }
        }
        for axis in 0..D {
            let mut own = sums[axis];
            for chunk in 0..chunks {
                let mut carried = [0.0; LANES];
                for k in 0..LANES {
                    carried[k] = over_r2[chunk][k] * (d[axis][chunk][k] * d[axis][chunk][k]);
                }
                for c in axis..C {
                    let [l, m] = AXES[component(D, c)];
                    for k in 0..LANES {
                        own[c][k] += carried[k] * (d[l][chunk][k] * d[m][chunk][k]);
                    }
                }
            }
            sums[axis] = own;
        }
        at = end;
    }
    sums.map(|axis| axis.map(|[a, b, c, d]| (a + b) + (c + d)))
}

/// Copies a part of a row, with zeros to its end.
#[inline(always)]
fn fill(to: &mut [Lanes; CHUNK], from: &[f64], chunks: usize) {
    to[chunks - 1] = [0.0; LANES];
    to.as_flattened_mut()[..from.len()].copy_from_slice(from);
}

/// Where among the [`Sums`] the product of two mixed components is: of xy, yz and xz.
const MIXED: [[(usize, usize); 3]; 3] = [[(0, 1), (1, 5), (0, 4)], [(1, 5), (1, 2), (2, 3)], [(0, 4), (2, 3), (0, 2)]];

/// The conditions on B as a symmetric matrix. Mixed components of tensors carry √2, so that no axes are preferred (Mandel
/// 1965).
struct Conditions<const D: usize, const C: usize> {
    a: [[f64; C]; C],
    /// Σ ω
    trace: f64,
}

impl<const D: usize, const C: usize> Conditions<D, C> {
    fn of(scale: f64, row: &Row, g: &[f64]) -> Self {
        let sums: Sums<D, C> = sums(row, g);
        let mut a = [[0.0; C]; C];
        for p in 0..C {
            for q in p..C {
                let (at, weight) = match (p < D, q < D) {
                    (true, true) => ((p, q), 1.0),
                    (true, false) => ((p, q), SQRT_2),
                    _ => (MIXED[p - D][q - D], 2.0),
                };
                a[p][q] = scale * weight * sums[at.0][at.1];
                a[q][p] = a[p][q];
            }
        }
        let trace = (0..D).map(|p| a[p][..D].iter().sum::<f64>()).sum();
        Conditions { a, trace }
    }

    /// B for which the second moment is the wanted one.
    fn solve(&self, wanted: &Sym) -> Sym {
        if !(self.trace > 0.0 && self.trace.is_finite()) {
            return tensor::unit(D).map(|u| u / LEAST_MOMENT);
        }
        let (x, moment) = match self.is_round() {
            true => (cholesky(&self.a, &mandel::<D, C>(wanted)).map(|(x, _)| x), self.trace / D as f64),
            false => (None, 0.0),
        };
        let (x, moment) = match x {
            Some(x) => (x, moment),
            None => self.solve_for_what_is_there(wanted),
        };
        let limit = (moment / LEAST_MOMENT).min(1.0);
        let mut b = [0.0; 6];
        for c in 0..C {
            b[component(D, c)] = limit * if c < D { x[c] } else { x[c] / SQRT_2 };
        }
        b
    }

    /// Whether the sums are so near to those of neighbours all around that all directions are there and the conditions
    /// are far from singular. For a unit vector e, ⟨(r̂·e)⁴⟩ − PRESENT ⟨(r̂·e)²⟩ is (e eᵀ)·A (e eᵀ − PRESENT I).
    fn is_round(&self) -> bool {
        let nu = D as f64;
        let round =
            |p: usize, q: usize| (2.0 * f64::from(p == q) + f64::from(p < D && q < D)) / (nu * (nu + 2.0)) * self.trace;
        let mut off = 0.0;
        for p in 0..C {
            for q in 0..C {
                off += (self.a[p][q] - round(p, q)).powi(2);
            }
        }
        let margin = (3.0 - PRESENT * (nu + 2.0)) / (nu * (nu + 2.0));
        off <= (margin * self.trace).powi(2) / (1.0 - 2.0 * PRESENT + nu * PRESENT * PRESENT)
    }

    /// B, and the moment K of the directions that are asked for.
    #[cold]
    fn solve_for_what_is_there(&self, wanted: &Sym) -> ([f64; C], f64) {
        let asked = Asked::of(self);
        let target = mandel::<D, C>(&asked.part_of(wanted));
        let moment = self.trace / asked.share.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        if asked.share.iter().filter(|share| **share == 1.0).count() == D
            && let Some((x, least)) = cholesky(&self.a, &target)
            && least >= FLAT * self.trace
        {
            return (x, moment);
        }
        // From the isotropic answer on, so that what cannot be told apart is treated alike.
        let start = target[..D].iter().sum::<f64>() / self.trace;
        let mut all = Matrix6::zeros();
        let mut lacks = Vector6::zeros();
        for p in 0..C {
            lacks[p] = target[p] - start * self.a[p][..D].iter().sum::<f64>();
            for q in 0..C {
                all[(p, q)] = self.a[p][q];
            }
        }
        let eigen = all.symmetric_eigen();
        let least = FLAT * eigen.eigenvalues.max();
        let inverse = |v: f64| if v >= least { 1.0 / v } else { v.max(0.0) / (least * least) };
        let along = eigen.eigenvectors.tr_mul(&lacks);
        let x = eigen.eigenvectors * along.zip_map(&eigen.eigenvalues, |along, v| along * inverse(v));
        (std::array::from_fn(|c| x[c] + if c < D { start } else { 0.0 }), moment)
    }
}

/// A symmetric tensor as a vector whose products are those of tensors.
fn mandel<const D: usize, const C: usize>(s: &Sym) -> [f64; C] {
    std::array::from_fn(|c| if c < D { s[c] } else { SQRT_2 * s[component(D, c)] })
}

/// The solution of a x = b, and a bound from below on the eigenvalues of a; none where a is not positive.
fn cholesky<const C: usize>(a: &[[f64; C]; C], b: &[f64; C]) -> Option<([f64; C], f64)> {
    let mut l = *a;
    // L⁻¹, whose squares sum to the trace of a⁻¹.
    let mut inverse = [[0.0; C]; C];
    let (mut y, mut squares) = ([0.0; C], 0.0);
    for i in 0..C {
        for j in 0..i {
            let sum: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            l[i][j] = (l[i][j] - sum) * inverse[j][j];
        }
        let pivot = l[i][i] - (0..i).map(|k| l[i][k] * l[i][k]).sum::<f64>();
        if pivot.is_nan() || pivot <= 0.0 {
            return None;
        }
        inverse[i][i] = 1.0 / pivot.sqrt();
        for j in 0..i {
            let sum: f64 = (j..i).map(|k| l[i][k] * inverse[k][j]).sum();
            inverse[i][j] = -sum * inverse[i][i];
        }
        y[i] = (0..=i).map(|k| inverse[i][k] * b[k]).sum();
        squares += inverse[i][..=i].iter().map(|v| v * v).sum::<f64>();
    }
    let x = std::array::from_fn(|i| (i..C).map(|k| inverse[k][i] * y[k]).sum());
    Some((x, 1.0 / squares))
}

/// ⟨(r̂·e)⁴⟩/⟨(r̂·e)²⟩ between which a direction e comes to be asked for: 1 where neighbours are along it or across it and
/// nowhere else, 3/(nu + 2) where they are all around, 0 where they are only nearly across it. With these values sheets,
/// strings and rods of one and two layers with 40 % jitter conduct 0.96 to 1.03 along themselves; with half of them 1.06
/// to 1.34.
const ABSENT: f64 = 0.2;
const PRESENT: f64 = 0.4;
/// A direction is there as well where it carries this much of what the best one carries.
const UNEQUAL: f64 = 0.4;
const EQUAL: f64 = 0.8;
/// Of the best one, below which nothing is carried but rounding.
const NOTHING: f64 = 1e-12;

/// How much of each of three directions is asked for, from 0 to 1.
struct Asked {
    directions: Matrix3<f64>,
    share: [f64; 3],
}

impl Asked {
    fn of<const D: usize, const C: usize>(conditions: &Conditions<D, C>) -> Asked {
        let a = &conditions.a;
        let mut second = Matrix3::zeros();
        for c in 0..C {
            let [k, l] = AXES[component(D, c)];
            let m = a[c][..D].iter().sum::<f64>() / if c < D { 1.0 } else { SQRT_2 };
            (second[(k, l)], second[(l, k)]) = (m, m);
        }
        let eigen = second.symmetric_eigen();
        let best = eigen.eigenvalues.max();
        let share = std::array::from_fn(|k| {
            let carried = eigen.eigenvalues[k];
            if carried <= NOTHING * best {
                return 0.0;
            }
            let e = eigen.eigenvectors.column(k);
            let dyad: [f64; C] = mandel::<D, C>(&AXES.map(|[k, l]| e[k] * e[l]));
            let fourth: f64 = (0..C).map(|p| dyad[p] * (0..C).map(|q| a[p][q] * dyad[q]).sum::<f64>()).sum();
            rise(fourth / carried, ABSENT, PRESENT).max(rise(carried / best, UNEQUAL, EQUAL))
        });
        Asked { directions: eigen.eigenvectors, share }
    }

    /// What is asked for of a tensor.
    fn part_of(&self, s: &Sym) -> Sym {
        let root = self.share.map(f64::sqrt);
        let e = &self.directions;
        let kept = e * Matrix3::from_diagonal(&root.into()) * e.transpose();
        tensor::of_matrix(&(kept * tensor::matrix(s) * kept))
    }
}

/// From 0 at `low` to 1 at `high`, without a corner.
pub fn rise(v: f64, low: f64, high: f64) -> f64 {
    let t = ((v - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::super::table;
    use super::*;
    use crate::array::Strided;
    use crate::kernel::Kernel;
    use crate::space::{Cloud, Domain, rows::Rows};

    fn with<T>(dim: usize, n: usize, length: f64, work: impl Fn(&Assembly, &Pool) -> T) -> T {
        let pool = Pool::new(2).unwrap();
        let mut state = 7u64;
        let mut uniform = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let x: Vec<f64> = (0..n * dim).map(|_| length * uniform()).collect();
        let kernel = Kernel::new("M4", dim).unwrap();
        let domain = Domain::new(&[0.0; 3][..dim], &[length; 3][..dim], &[true; 3][..dim]).unwrap();
        let h: Vec<f64> = (0..n).map(|i| if i % 3 == 0 { 0.08 } else { 0.1 }).collect();
        let cloud = Cloud::sort(&domain, Strided::new("x", &x, n, dim, dim).unwrap(), 0.2, &pool).unwrap();
        let rows = Rows::new(&cloud, &h, kernel.radius(), &pool).unwrap();
        let volume = vec![length.powi(dim as i32) / n as f64; n];
        work(
            &Assembly {
                operator: table::find("brookshaw").unwrap(),
                normalise: Normalise::Tensor,
                kernel: &kernel,
                rows: &rows,
                volume: &volume,
                same_h: false,
                order: 4,
                any_row: false,
                shape: None,
            },
            &pool,
        )
    }

    fn coefficients(matrix: &Matrix) -> Vec<u64> {
        (0..matrix.len()).flat_map(|i| matrix.coefficients(i).iter().map(|g| g.to_bits())).collect()
    }

    #[test]
    fn directions_found_again_are_the_same_bits_as_those_of_a_search() {
        for (dim, n) in [(2, 300), (3, 700)] {
            with(dim, n, 0.5, |a, pool| {
                assert!(a.rows.nearest::<3>().is_some());
                let made = || a.store(pool).unwrap();
                let ((mut one, normals), (mut other, _)) = (made(), made());
                scale(a, &mut one, &normals, pool).unwrap();
                let every = |_: &mut (), row: &Row, g: &mut [f64]| {
                    of_row(dim, row, &normals.tensors, g);
                    Ok(())
                };
                let before = coefficients(&other);
                other.update_rows(a.rows, pool, |_| true, every).unwrap();
                assert!(before.len() > 10 * n && before != coefficients(&one));
                assert_eq!(coefficients(&one), coefficients(&other));
            });
        }
    }

    #[test]
    fn both_sides_of_a_pair_are_the_same_bits() {
        // In a box that shows some particles twice, too.
        for (dim, n, length) in [(2, 300, 0.5), (3, 700, 0.5), (2, 60, 0.15)] {
            with(dim, n, length, |a, pool| {
                let (mut matrix, normals) = a.store(pool).unwrap();
                scale(a, &mut matrix, &normals, pool).unwrap();
                let side = |i: usize, j: usize| {
                    let pairs = matrix.columns(i).iter().zip(matrix.coefficients(i)).filter(|(c, _)| **c as usize == j);
                    let mut bits: Vec<u64> = pairs.map(|(_, g)| g.to_bits()).collect();
                    bits.sort_unstable();
                    bits
                };
                for i in 0..n {
                    matrix.columns(i).iter().for_each(|&j| assert_eq!(side(i, j as usize), side(j as usize, i)));
                }
            });
        }
    }

    /// Σ ω φ r̂ r̂ᵀ of some pairs in the plane, with φ from the answer.
    fn met(pairs: &[(f64, f64)], wanted: &Sym) -> (Matrix3<f64>, Sym) {
        let (mut j, mut r, mut g) = (Vec::new(), Vec::new(), Vec::new());
        let mut d: [Vec<f64>; 3] = Default::default();
        for &(angle, omega) in pairs {
            j.push(0u32);
            r.push(2.0);
            g.push(omega / 2.0);
            d[0].push(2.0 * angle.cos());
            d[1].push(2.0 * angle.sin());
        }
        let row = Row { i: 0, j: &j, r: &r, d: [&d[0], &d[1], &[]] };
        let b = Conditions::<2, 3>::of(0.5, &row, &g).solve(wanted);
        let mut sum = Matrix3::zeros();
        for &(angle, omega) in pairs {
            let e = nalgebra::Vector3::new(angle.cos(), angle.sin(), 0.0);
            sum += e * e.transpose() * (omega * tensor::along(&b, e.into()));
        }
        (sum, b)
    }

    const PLANE: Sym = [1.0, 1.0, 0.0, 0.0, 0.0, 0.0];

    #[test]
    fn directions_that_are_there_are_met_and_others_left_alone() {
        let off = |m: Matrix3<f64>, xx: f64, xy: f64, yy: f64| {
            (m - Matrix3::new(xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, 0.0)).amax()
        };
        // All around, and squeezed to a tenth across.
        for squeezed in [1.0, 0.1] {
            let around: Vec<(f64, f64)> = (0..12)
                .map(|k| f64::from(k) * std::f64::consts::PI / 6.0 + 0.1)
                .map(|a| (a, 0.1 * if a.sin().abs() > 0.7 { squeezed } else { 1.0 }))
                .collect();
            assert!(off(met(&around, &PLANE).0, 1.0, 0.0, 1.0) < 1e-12);
            let shape = [1.5, 0.5, 0.0, 0.25, 0.0, 0.0];
            assert!(off(met(&around, &shape).0, 1.5, 0.25, 0.5) < 1e-12);
        }
        // On a line along any direction.
        for angle in [0.0, 0.4, 1.3] {
            let (m, _) = met(&[(angle, 0.3), (angle + std::f64::consts::PI, 0.2)], &PLANE);
            let (s, c) = f64::sin_cos(angle);
            assert!(off(m, c * c, c * s, s * s) < 1e-9, "{m}");
        }
        // A line with a little thickness is asked for nothing across, and nothing of it jumps on the way to a plane.
        let thick = |t: f64| [(t, 0.3), (-t, 0.3), (std::f64::consts::PI + t, 0.2), (std::f64::consts::PI - t, 0.2)];
        let (m, _) = met(&thick(0.05), &PLANE);
        assert!((m[(0, 0)] - 1.0).abs() < 0.02 && m[(1, 1)] < 0.02, "{m}");
        let mut last = met(&thick(0.0), &PLANE).0;
        for k in 1..=400 {
            let now = met(&thick(f64::from(k) * 0.785 / 400.0), &PLANE).0;
            assert!((now - last).amax() < 0.05, "{k}: {last} {now}");
            last = now;
        }
        // Nobody, and hardly anybody.
        assert_eq!(met(&[], &PLANE).1[0], 1.0 / LEAST_MOMENT);
        assert!(met(&[(0.3, 1e-9)], &PLANE).0.amax() < 1e-7);
    }
}
