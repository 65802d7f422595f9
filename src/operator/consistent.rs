//! Moment-consistent weights: on any particles exact for polynomials up to an order, by a weighted least-squares fit
//! around each particle (generalised moving least squares; DC-PSE, Schrader, Reboux & Sbalzarini 2010; LABFM, King, Lind &
//! Nasar 2020). Not symmetric, so energy is kept only as well as the field is resolved, and not positive.
//!
//! With monomials p of degree 1 to `order` in d/(R h), the weights V_b w_ab = W_ab p_ab·c solve
//! (Σ_b W p pᵀ) c = ∇² p (0): a Laplacian of order − 1 in h at least, of `order` where particles are regular.

use super::once::Assembly;
use crate::space::Row;
use nalgebra::{Cholesky, Const, SMatrix, SVector};

/// Below this ratio of the smallest to the largest pivot neighbours do not tell the monomials apart.
const FLAT: f64 = 1e-6;

/// Turns the values of the kernel in `w` into weights; answers the order reached: lower than the one asked for where
/// neighbours are too few or lie in a line or plane, 0 (and weights of the kernel itself) where even 2 cannot be had.
pub fn fit(assembly: &Assembly, row: &Row, w: &mut [f64]) -> u32 {
    let scale = 1.0 / (assembly.kernel.radius() * assembly.rows.h[row.i]);
    let order = (1..=assembly.order / 2).rev().map(|half| 2 * half).find(|&order| {
        let fit = Fit { row, scale, order, dim: assembly.kernel.dim() };
        match fit.unknowns() {
            2 => fit.solve::<2>(w),
            4 => fit.solve::<4>(w),
            5 => fit.solve::<5>(w),
            6 => fit.solve::<6>(w),
            9 => fit.solve::<9>(w),
            14 => fit.solve::<14>(w),
            27 => fit.solve::<27>(w),
            34 => fit.solve::<34>(w),
            _ => fit.solve::<83>(w),
        }
    });
    match order {
        Some(_) => w.iter_mut().zip(row.j).for_each(|(w, &j)| *w *= scale * scale / assembly.volume[j as usize]),
        None => {
            let factor = assembly.kernel.laplacian_factor() * (assembly.kernel.radius() * scale).powi(2);
            w.iter_mut().for_each(|w| *w *= factor);
        }
    }
    order.unwrap_or(0)
}

struct Fit<'a> {
    row: &'a Row<'a>,
    scale: f64,
    order: u32,
    dim: usize,
}

impl Fit<'_> {
    /// Monomials of degree 1 to `order`.
    fn unknowns(&self) -> usize {
        let (o, nu) = (self.order as usize, self.dim);
        (1..=nu).fold(1, |product, k| product * (o + k) / k) - 1
    }

    /// Multiplies `w` by p·c; leaves it as it was and answers false where the fit is not safe.
    fn solve<const M: usize>(&self, w: &mut [f64]) -> bool {
        if self.row.len() < M {
            return false;
        }
        let largest = w.iter().copied().fold(0.0, f64::max);
        let mut normal = SMatrix::<f64, M, M>::zeros();
        for (k, &w) in w.iter().enumerate().filter(|(_, w)| **w > 0.0) {
            let p = self.monomials::<M>(k);
            // The lower triangle, which is all that the factorisation reads.
            for column in 0..M {
                let factor = w / largest * p[column];
                for line in column..M {
                    normal[(line, column)] += factor * p[line];
                }
            }
        }
        let Some(factors) = Cholesky::<f64, Const<M>>::new(normal) else { return false };
        let pivots = factors.l_dirty().diagonal();
        // Pivots are square roots, in units of the spread of each monomial itself.
        let relative = pivots.zip_map(&normal.diagonal(), |pivot, own| pivot * pivot / own);
        if relative.min() < FLAT {
            return false;
        }
        let c = factors.solve(&self.laplacian::<M>());
        w.iter_mut().enumerate().for_each(|(k, w)| *w *= self.monomials::<M>(k).dot(&c) / largest);
        true
    }

    /// x^i y^j z^k in the order of [`Fit::powers`].
    fn monomials<const M: usize>(&self, k: usize) -> SVector<f64, M> {
        let order = self.order as usize;
        let mut table = [[1.0; 7]; 3];
        for (powers, d) in table.iter_mut().zip(self.row.d) {
            let x = d.get(k).map_or(0.0, |d| d * self.scale);
            (1..=order).for_each(|e| powers[e] = powers[e - 1] * x);
        }
        let mut p = SVector::zeros();
        self.powers(|at, [i, j, k]| p[at] = table[0][i] * table[1][j] * table[2][k]);
        p
    }

    /// ∇² of the monomials at 0: 2 for the pure squares.
    fn laplacian<const M: usize>(&self) -> SVector<f64, M> {
        let mut target = SVector::zeros();
        self.powers(|at, e| {
            if e.iter().sum::<usize>() == 2 && e.contains(&2) {
                target[at] = 2.0;
            }
        });
        target
    }

    /// Calls `visit` with the exponents of every monomial and its place.
    #[inline(always)]
    fn powers(&self, mut visit: impl FnMut(usize, [usize; 3])) {
        let order = self.order as usize;
        let most = |axis: usize, left: usize| if axis < self.dim { left } else { 0 };
        let mut at = 0;
        for i in 0..=order {
            for j in 0..=most(1, order - i) {
                for k in 0..=most(2, order - i - j) {
                    if i + j + k > 0 {
                        visit(at, [i, j, k]);
                        at += 1;
                    }
                }
            }
        }
    }
}
