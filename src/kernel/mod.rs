//! Smoothing kernels W(r, h) = sigma f(r/h) / h^dim and the facts that follow from their shape: norm, moments,
//! derivatives. [`table`] holds the shapes, nothing else; all else is derived.

mod form;
mod gaussian;
mod table;

use crate::error::{Error, Result};
use form::Form;
use std::f64::consts::PI;
use table::{KERNELS, Row, Shape};

/// A kernel in a dimension. Functions of q = r/h on slices include sigma, and no power of h: divide by h^dim for W,
/// by h^(dim+2) for W'/r and W''. They take any q >= 0, infinity too, and are zero beyond the support (and for a
/// NaN: check positions before).
#[derive(Debug, Clone)]
pub struct Kernel {
    row: &'static Row,
    dim: usize,
    sigma: f64,
    second: f64,
    fourth: f64,
    radius: f64,
    w: Form,
    slope_over_q: Form,
    curvature: Form,
}

impl Kernel {
    /// The kernel of this name, in either case, in 1, 2 or 3 dimensions. Errors: a name or a dimension it does not know.
    pub fn new(name: &str, dim: usize) -> Result<Kernel> {
        if !(1..=3).contains(&dim) {
            return Err(Error::bad("dim", dim, "the dimension is 1, 2 or 3"));
        }
        let row = KERNELS
            .iter()
            .find(|row| row.name.eq_ignore_ascii_case(name))
            .ok_or_else(|| Error::unknown("kernel", name, KERNELS.iter().map(|row| row.name)))?;
        Ok(Kernel::of(row, dim))
    }

    fn of(row: &'static Row, dim: usize) -> Kernel {
        let form = |factor| match if dim == 1 { row.line } else { row.space } {
            Shape::Pieces(pieces) => Form::sum(pieces, factor),
            Shape::Gaussian(radius) => Form::Gaussian { radius, a: factor, b: 0.0 },
        };
        let sphere = [2.0, 2.0 * PI, 4.0 * PI][dim - 1];
        let sigma = 1.0 / (sphere * form(1.0).integral(dim as u32 - 1));
        let w = form(sigma);
        // The mean over directions of cos² is 1/dim, of cos⁴ 3/(dim (dim + 2)).
        let n = dim as f64;
        let second = sphere * w.integral(dim as u32 + 1) / n;
        let fourth = sphere * w.integral(dim as u32 + 3) * 3.0 / (n * (n + 2.0));
        let (slope_over_q, curvature, radius) = (w.slope_over_q(), w.curvature(), w.radius());
        Kernel { row, dim, sigma, second, fourth, radius, w, slope_over_q, curvature }
    }

    pub fn name(&self) -> &'static str {
        self.row.name
    }

    /// Formula, support and source, in one line.
    pub fn about(&self) -> &'static str {
        self.row.about
    }

    pub fn dim(&self) -> usize {
        self.dim
    }

    /// The support, in units of h.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// The default smoothing length, in units of (m/rho)^(1/dim).
    pub fn h_fac(&self) -> f64 {
        self.row.h_fac
    }

    /// The norm: 1 / `∫ f dV`.
    pub fn sigma(&self) -> f64 {
        self.sigma
    }

    /// `∫ x² W dV / h²`, x one coordinate.
    pub fn second_moment(&self) -> f64 {
        self.second
    }

    /// `∫ x⁴ W dV / h⁴`, x one coordinate.
    pub fn fourth_moment(&self) -> f64 {
        self.fourth
    }

    /// A = 2 dim / <r²>, the factor that makes `A W / h²` the weight of a Laplacian: half its second moment is one.
    pub fn laplacian_factor(&self) -> f64 {
        2.0 / self.second
    }

    /// `sigma f(q)`
    pub fn w(&self, q: &[f64], out: &mut [f64]) {
        self.w.evaluate(q, out);
    }

    /// `sigma f'(q)/q`, and its limit `sigma f''(0)` at q = 0; nothing that vanishes is divided by.
    pub fn slope_over_q(&self, q: &[f64], out: &mut [f64]) {
        self.slope_over_q.evaluate(q, out);
    }

    /// `sigma f''(q)`
    pub fn curvature(&self, q: &[f64], out: &mut [f64]) {
        self.curvature.evaluate(q, out);
    }

    /// `sigma f(q)` at one q, with the bits of the slice form.
    pub fn w_at(&self, q: f64) -> f64 {
        let mut out = [0.0];
        self.w.evaluate(&[q], &mut out);
        out[0]
    }
}

/// Every kernel: its name, and formula, support and source in one line.
pub fn catalogue() -> impl Iterator<Item = (&'static str, &'static str)> {
    KERNELS.iter().map(|row| (row.name, row.about))
}

/// h over particle spacing of each kernel, unless told otherwise.
pub fn own_h_fac() -> impl Iterator<Item = (&'static str, f64)> {
    KERNELS.iter().map(|row| (row.name, row.h_fac))
}

#[cfg(test)]
mod tests;
