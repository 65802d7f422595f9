//! Every operator, a row each. Add an operator here.

use crate::error::{Error, Result};
use crate::kernel::Kernel;

/// A pair operator: one radial function w(q), the weight of a pair at r = q h in units of 1/h^(nu + 2).
pub struct Operator {
    pub name: &'static str,
    pub about: &'static str,
    /// w ≥ 0 for every pair: the operator keeps a maximum principle and cannot have growing modes.
    pub positive: bool,
    /// Whether `normalise=pair` is the default.
    pub normalise: bool,
    /// Fills `w` from distances `q`; `spare` is a buffer of the same length.
    pub weight: fn(kernel: &Kernel, q: &[f64], w: &mut [f64], spare: &mut [f64]),
}

pub static OPERATORS: &[Operator] = &[
    Operator {
        name: "brookshaw",
        about: "w = -2 F/r, F = dW/dr (Brookshaw 1985); symmetric, conservative, positive",
        positive: true,
        normalise: true,
        weight: |kernel, q, w, _| {
            kernel.slope_over_q(q, w);
            w.iter_mut().for_each(|w| *w *= -2.0);
        },
    },
    Operator {
        name: "kernel",
        about: "the kernel itself as its Laplacian, w = A W/h^2 with A = 2 nu / <r^2> (Biriukov & Price 2019); \
                symmetric, conservative, positive",
        positive: true,
        normalise: true,
        weight: |kernel, q, w, _| {
            kernel.w(q, w);
            let a = kernel.laplacian_factor();
            w.iter_mut().for_each(|w| *w *= a);
        },
    },
    Operator {
        name: "direct",
        about: "the second derivative of the kernel, w = W'' + (nu - 1) F/r; symmetric and conservative but not \
                positive: has growing modes on disordered particles",
        positive: false,
        normalise: false,
        weight: |kernel, q, w, spare| {
            kernel.curvature(q, w);
            kernel.slope_over_q(q, spare);
            let other_axes = kernel.dim() as f64 - 1.0;
            w.iter_mut().zip(spare).for_each(|(w, slope)| *w += other_axes * *slope);
        },
    },
];

/// The operator of this name, whatever its case.
pub fn find(name: &str) -> Result<&'static Operator> {
    let found = OPERATORS.iter().find(|o| o.name.eq_ignore_ascii_case(name));
    found.ok_or_else(|| Error::unknown("operator", name, OPERATORS.iter().map(|o| o.name)))
}
