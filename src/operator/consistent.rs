//! Moment-consistent weights: on any particles exact for polynomials up to an order, by a weighted least-squares fit
//! around each particle (generalised moving least squares; DC-PSE, Schrader, Reboux & Sbalzarini 2010; LABFM, King, Lind &
//! Nasar 2020). Not symmetric, so energy is kept only as well as the field is resolved, and not positive.
//!
//! With monomials p of degree 1 to `order` in d/(R h), the weights V_b w_ab = W_ab p_ab·c solve
//! (Σ_b W p pᵀ) c = ∇² p (0): a Laplacian of order − 1 in h at least, of `order` where particles are regular.
//!
//! Where neighbours are on one side, at a free surface, or too few for the order, such weights have growing modes: a
//! one-sided second difference has the wrong sign on its own particle. There a lower order is taken, and beside a surface
//! the kernel itself, for which insulation is the natural boundary.

use super::once::{Assembly, Buffers};
use crate::error::Result;
use crate::memory;
use crate::pool::Pool;
use crate::space::Row;
use nalgebra::{Cholesky, Const, SMatrix, SVector};

/// Below this ratio of the smallest to the largest pivot neighbours do not tell the monomials apart.
const FLAT: f64 = 1e-6;

/// A row is stable enough if Σ w is at least this share of Σ |w|. In 96 scenes (2-D and 3-D, periodic and open, 20 and 40 %
/// jitter, three orders, four supports) modes grew in 30 at 0, in 3 at 0.1, and in none at 0.2.
const DOMINANT: f64 = 0.2;

/// Neighbours that are summed over side by side: as many as an AVX2 register holds, on any machine, for the same bits.
const LANES: usize = 4;
type Lanes = [f64; LANES];

/// Powers 0 to 12 of each coordinate: the products of two monomials of degree 6 need them.
type Powers = [[Lanes; 13]; 3];

/// Turns the values of the kernel in `w` into weights; answers the order reached: lower than the one asked for where
/// neighbours are too few, lie in a line or plane, or are on one side, 0 (and weights of the kernel itself) where even 2
/// cannot be had. `factor` has as many elements as `w`, of any value.
pub fn fit(assembly: &Assembly, row: &Row, w: &mut [f64], factor: &mut [f64]) -> u32 {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: this processor has AVX2.
        return unsafe { fit_avx2(assembly, row, w, factor) };
    }
    fit_anywhere(assembly, row, w, factor)
}

/// The order that [`fit`] reaches for each particle.
///
/// # Errors
/// `NoMemory`.
pub fn reached(assembly: &Assembly, pool: &Pool) -> Result<Vec<f64>> {
    let mut out = memory::filled("orders", assembly.volume.len(), 0.0)?;
    assembly.rows.map(pool, &mut out, |buffers: &mut Buffers, row: Row| {
        assembly.weights(&row, buffers)?;
        Ok(buffers.order.into())
    })?;
    Ok(out)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn fit_avx2(assembly: &Assembly, row: &Row, w: &mut [f64], factor: &mut [f64]) -> u32 {
    fit_anywhere(assembly, row, w, factor)
}

#[inline(always)]
fn fit_anywhere(assembly: &Assembly, row: &Row, w: &mut [f64], factor: &mut [f64]) -> u32 {
    let scale = 1.0 / (assembly.kernel.radius() * assembly.rows.h[row.i]);
    let fit = Fit { row, scale, largest: w.iter().copied().fold(0.0, f64::max) };
    let mut order = assembly.order;
    while order > 0 && !(fit.solve_order(assembly.kernel.dim(), order, w, factor) && assembly.accepts(w, factor)) {
        order -= 2;
    }
    if order > 0 {
        let to_volume = |j: u32| scale * scale / assembly.volume[j as usize];
        w.iter_mut().zip(factor).zip(row.j).for_each(|((w, factor), &j)| *w *= *factor * to_volume(j));
    } else {
        let itself = assembly.kernel.laplacian_factor() * (assembly.kernel.radius() * scale).powi(2);
        w.iter_mut().for_each(|w| *w *= itself);
    }
    order
}

impl Assembly<'_> {
    /// Whether weights are to be used, stable or not.
    fn accepts(&self, w: &[f64], factor: &[f64]) -> bool {
        let terms = || w.iter().zip(factor).map(|(w, factor)| w * factor);
        self.any_row || terms().sum::<f64>() >= DOMINANT * terms().map(f64::abs).sum::<f64>()
    }
}

struct Fit<'a> {
    row: &'a Row<'a>,
    scale: f64,
    largest: f64,
}

impl Fit<'_> {
    /// Fills `factor` with p·c; answers false where the fit is not safe.
    #[inline(always)]
    fn solve_order(&self, dim: usize, order: u32, w: &[f64], factor: &mut [f64]) -> bool {
        // Numbers of monomials of degree 1 to the order, and of degree 0 to twice the order.
        match (dim, order) {
            (1, 2) => self.solve::<1, 2, 2, 5>(w, factor),
            (1, 4) => self.solve::<1, 4, 4, 9>(w, factor),
            (1, _) => self.solve::<1, 6, 6, 13>(w, factor),
            (2, 2) => self.solve::<2, 2, 5, 15>(w, factor),
            (2, 4) => self.solve::<2, 4, 14, 45>(w, factor),
            (2, _) => self.solve::<2, 6, 27, 91>(w, factor),
            (_, 2) => self.solve::<3, 2, 9, 35>(w, factor),
            (_, 4) => self.solve::<3, 4, 34, 165>(w, factor),
            _ => self.solve::<3, 6, 83, 455>(w, factor),
        }
    }

    #[inline(always)]
    fn solve<const D: usize, const ORDER: usize, const M: usize, const N: usize>(
        &self,
        w: &[f64],
        factor: &mut [f64],
    ) -> bool {
        if self.row.len() < M {
            return false;
        }
        let exponents = exponents::<D, M>(ORDER);
        let normal = normal::<D, M, N>(ORDER, &exponents, &self.moments::<D, N>(2 * ORDER, w));
        let spread = normal.diagonal();
        let Some(factors) = Cholesky::<f64, Const<M>>::new(normal) else { return false };
        // Pivots are square roots, in units of the spread of each monomial itself.
        if (0..M).any(|m| factors.l_dirty()[(m, m)].powi(2) < FLAT * spread[m]) {
            return false;
        }
        // The Laplacian of the monomials at 0: 2 for the pure squares.
        let is_square = |e: &[usize; 3]| e.iter().sum::<usize>() == 2 && e.contains(&2);
        let mut c = SVector::<f64, M>::from_fn(|at, _| if is_square(&exponents[at]) { 2.0 } else { 0.0 });
        factors.solve_mut(&mut c);
        self.weigh::<D, M>(ORDER, &c, factor);
        true
    }

    /// Σ w x^i y^j z^k for every monomial up to a degree, in units of the largest w.
    #[inline(always)]
    fn moments<const D: usize, const N: usize>(&self, degree: usize, w: &[f64]) -> [f64; N] {
        let mut sums = [[0.0; LANES]; N];
        let scale = [1.0 / self.largest; LANES];
        // Two groups at once: half as many sums are loaded and stored.
        for at in (0..w.len()).step_by(2 * LANES) {
            let (p, q) = (self.powers::<D>(degree, at), self.powers::<D>(degree, at + LANES));
            let (own_p, own_q) = (times(lanes(w, at), scale), times(lanes(w, at + LANES), scale));
            let mut m = 0;
            for i in 0..=degree {
                let (x_p, x_q) = (times(own_p, p[0][i]), times(own_q, q[0][i]));
                for j in 0..=if D > 1 { degree - i } else { 0 } {
                    let (xy_p, xy_q) = (times(x_p, p[1][j]), times(x_q, q[1][j]));
                    let last = if D > 2 { degree - i - j } else { 0 };
                    for ((z_p, z_q), sum) in p[2][..=last].iter().zip(&q[2][..=last]).zip(&mut sums[m..=m + last]) {
                        add(sum, times(xy_p, *z_p));
                        add(sum, times(xy_q, *z_q));
                    }
                    m += last + 1;
                }
            }
        }
        sums.map(|s| (s[0] + s[1]) + (s[2] + s[3]))
    }

    /// Σ_m c_m p_m of each neighbour.
    #[inline(always)]
    fn weigh<const D: usize, const M: usize>(&self, degree: usize, c: &SVector<f64, M>, factor: &mut [f64]) {
        for at in (0..factor.len()).step_by(LANES) {
            let powers = self.powers::<D>(degree, at);
            let mut sums = [0.0; LANES];
            // c has no constant, which comes first.
            let mut m = 0;
            for i in 0..=degree {
                for j in 0..=if D > 1 { degree - i } else { 0 } {
                    let mut along_z = [0.0; LANES];
                    for z in &powers[2][..=if D > 2 { degree - i - j } else { 0 }] {
                        if m > 0 {
                            add(&mut along_z, times([c[m - 1]; LANES], *z));
                        }
                        m += 1;
                    }
                    add(&mut sums, times(times(powers[0][i], powers[1][j]), along_z));
                }
            }
            factor[at..].iter_mut().zip(sums).for_each(|(factor, sum)| *factor = sum / self.largest);
        }
    }

    /// The powers of the coordinates of the neighbours from `at` on, in units of the support.
    #[inline(always)]
    fn powers<const D: usize>(&self, degree: usize, at: usize) -> Powers {
        let mut powers = [[[1.0; LANES]; 13]; 3];
        for (powers, d) in powers.iter_mut().zip(self.row.d).take(D) {
            let x = times(lanes(d, at), [self.scale; LANES]);
            for e in 1..=degree {
                powers[e] = times(powers[e - 1], x);
            }
        }
        powers
    }
}

/// The values from `at` on; zeros beyond the end.
#[inline(always)]
fn lanes(values: &[f64], at: usize) -> Lanes {
    let rest = values.get(at..).unwrap_or_default();
    if let Some(whole) = rest.first_chunk() {
        return *whole;
    }
    let mut out = [0.0; LANES];
    out.iter_mut().zip(rest).for_each(|(out, value)| *out = *value);
    out
}

#[inline(always)]
fn times(a: Lanes, b: Lanes) -> Lanes {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]]
}

#[inline(always)]
fn add(sum: &mut Lanes, by: Lanes) {
    *sum = [sum[0] + by[0], sum[1] + by[1], sum[2] + by[2], sum[3] + by[3]];
}

/// The exponents of the monomials of degree 1 to `order`, in the order of the sums.
#[inline(always)]
fn exponents<const D: usize, const M: usize>(order: usize) -> [[usize; 3]; M] {
    let (mut out, mut m) = ([[0; 3]; M], 0);
    for i in 0..=order {
        for j in 0..=if D > 1 { order - i } else { 0 } {
            for k in 0..=if D > 2 { order - i - j } else { 0 } {
                if i + j + k > 0 {
                    out[m] = [i, j, k];
                    m += 1;
                }
            }
        }
    }
    out
}

/// Σ w p pᵀ, whose elements are the moments of the products, each of them many times. The lower triangle, which is all
/// that the factorisation reads.
#[inline(always)]
fn normal<const D: usize, const M: usize, const N: usize>(
    order: usize,
    exponents: &[[usize; 3]; M],
    moments: &[f64; N],
) -> SMatrix<f64, M, M> {
    // Where the moments with x^i y^j begin.
    let (mut first, mut m) = ([[0; 13]; 13], 0);
    for (i, first) in first.iter_mut().enumerate().take(2 * order + 1) {
        for (j, first) in first.iter_mut().enumerate().take(if D > 1 { 2 * order - i + 1 } else { 1 }) {
            *first = m;
            m += if D > 2 { 2 * order - i - j + 1 } else { 1 };
        }
    }
    let mut normal = SMatrix::zeros();
    for (column, a) in exponents.iter().enumerate() {
        for (line, b) in exponents.iter().enumerate().skip(column) {
            normal[(line, column)] = moments[first[a[0] + b[0]][a[1] + b[1]] + a[2] + b[2]];
        }
    }
    normal
}
