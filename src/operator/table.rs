//! Every operator, a row each. Add an operator here.

use super::{Normalise, projected, twice};
use crate::error::{Error, Result};
use crate::kernel::Kernel;

/// A pair operator: one radial function w(q), the weight of a pair at r = q h in units of 1/h^(nu + 2).
pub struct Operator {
    pub name: &'static str,
    pub about: &'static str,
    /// w ≥ 0 for every pair, whatever kappa: the operator keeps a maximum principle and cannot have growing modes.
    pub positive: bool,
    /// The default of `normalise=`; of projected, what weights are scaled by before they are projected.
    pub normalise: Normalise,
    /// Symmetric and without growing modes on any particles: implicit integrators may solve with it.
    pub dissipative: bool,
    /// What it makes of a conductivity that is a tensor.
    pub tensor: Tensor,
    /// Fills `w` from distances `q`; `spare` is a buffer of the same length.
    pub weight: fn(kernel: &Kernel, q: &[f64], w: &mut [f64], spare: &mut [f64]),
}

/// Bytes of a stored matrix for each pair and for each particle: a column and a coefficient; a second moment.
const MATRIX: [f64; 2] = [12.0, 8.0];

/// How an operator takes a tensor kappa S, tr S = nu.
#[derive(Debug, Clone, Copy)]
pub enum Tensor {
    /// It does not.
    Scalar,
    /// The weight of a pair is multiplied by a function of r̂·S r̂ and nu, which is 1 for S = I.
    Angular(fn(along: f64, nu: f64) -> f64),
    /// It does not: weights are fitted, particle by particle, to be exact for polynomials.
    Consistent,
    /// It does not: positive weights are fitted to the moments of a Laplacian, all particles together.
    Projected,
    /// Positive weights fitted to S particle by particle.
    Stencils,
    /// Gradient, flux, divergence: two sweeps over the pairs. The weights of pairs serve its stabiliser. `limited`: no
    /// exchange may make a new extremum.
    Twice { limited: bool },
}

/// Brookshaw's weight, -2 F/r.
fn brookshaw(kernel: &Kernel, q: &[f64], w: &mut [f64], _: &mut [f64]) {
    kernel.slope_over_q(q, w);
    w.iter_mut().for_each(|w| *w *= -2.0);
}

/// The kernel itself, A W/h².
fn kernel_itself(kernel: &Kernel, q: &[f64], w: &mut [f64], _: &mut [f64]) {
    kernel.w(q, w);
    let a = kernel.laplacian_factor();
    w.iter_mut().for_each(|w| *w *= a);
}

/// ((nu + 2) r̂·S r̂ − tr S)/2: 1 for S = I.
fn espanol_revenga(along: f64, nu: f64) -> f64 {
    0.5 * ((nu + 2.0) * along - nu)
}

pub static OPERATORS: &[Operator] = &[
    Operator {
        name: "brookshaw",
        about: "w = -2 F/r, F = dW/dr (Brookshaw 1985); symmetric, conservative, positive",
        positive: true,
        dissipative: true,
        normalise: Normalise::Tensor,
        tensor: Tensor::Scalar,
        weight: brookshaw,
    },
    Operator {
        name: "kernel",
        about: "the kernel itself as its Laplacian, w = A W/h^2 with A = 2 nu / <r^2> (Biriukov & Price 2019); \
                symmetric, conservative, positive",
        positive: true,
        dissipative: true,
        normalise: Normalise::Tensor,
        tensor: Tensor::Scalar,
        weight: kernel_itself,
    },
    Operator {
        name: "direct",
        about: "the second derivative of the kernel, w = W'' + (nu - 1) F/r; symmetric and conservative but not \
                positive: has growing modes on disordered particles",
        positive: false,
        dissipative: false,
        normalise: Normalise::No,
        tensor: Tensor::Scalar,
        weight: |kernel, q, w, spare| {
            kernel.curvature(q, w);
            kernel.slope_over_q(q, spare);
            let other_axes = kernel.dim() as f64 - 1.0;
            w.iter_mut().zip(spare).for_each(|(w, slope)| *w += other_axes * *slope);
        },
    },
    Operator {
        name: "consistent",
        about: "weights that are exact for polynomials up to order=2, 4 or 6 on any particles, by local least squares, and \
                normalised pairs beside free surfaces; not symmetric, so conservative only as far as T is resolved; not \
                positive",
        positive: false,
        dissipative: false,
        normalise: Normalise::No,
        tensor: Tensor::Consistent,
        weight: |kernel, q, w, _| kernel.w(q, w),
    },
    Operator {
        name: "projected",
        about: "Brookshaw's weights moved as little as makes them exact for quadratic T at every particle at once, none of \
                them negative; symmetric, conservative, positive; takes time to make",
        positive: true,
        dissipative: true,
        normalise: Normalise::Tensor,
        tensor: Tensor::Projected,
        weight: brookshaw,
    },
    Operator {
        name: "espanol-revenga",
        about: "tensor kappa: w = -((nu + 2) r.kappa.r - tr kappa) F/r (Espanol & Revenga 2003); symmetric, conservative, \
                positive only while kappa_par <= 3 kappa_perp",
        positive: false,
        dissipative: false,
        normalise: Normalise::Tensor,
        tensor: Tensor::Angular(espanol_revenga),
        weight: brookshaw,
    },
    Operator {
        name: "espanol-revenga-kernel",
        about: "tensor kappa: Espanol & Revenga's angular factor on the kernel itself in place of -2 F/r (Biriukov & Price \
                2019); as espanol-revenga otherwise",
        positive: false,
        dissipative: false,
        normalise: Normalise::Tensor,
        tensor: Tensor::Angular(espanol_revenga),
        weight: kernel_itself,
    },
    Operator {
        name: "two-first",
        about: "tensor kappa: gradient, flux and its exact adjoint divergence, with a penalty theta on what the gradients \
                do not explain; symmetric, conservative, never grows, hardly leaks across b; not monotone",
        positive: false,
        dissipative: true,
        normalise: Normalise::Pair,
        tensor: Tensor::Twice { limited: false },
        weight: brookshaw,
    },
    Operator {
        name: "limited",
        about: "tensor kappa: two-first, its exchanges limited pair by pair so that no new extremum appears (nonlinear); \
                conservative, monotone, hardly leaks across b",
        positive: true,
        dissipative: false,
        normalise: Normalise::Pair,
        tensor: Tensor::Twice { limited: true },
        weight: brookshaw,
    },
    Operator {
        name: "monotone",
        about: "tensor kappa: positive pair weights nearest to Brookshaw's that have its moments, particle by particle and \
                then all together; symmetric, conservative, monotone at any anisotropy; takes time to make; leaks across b",
        positive: true,
        dissipative: true,
        normalise: Normalise::Pair,
        tensor: Tensor::Stencils,
        weight: brookshaw,
    },
];

impl Operator {
    /// Whether it takes a conductivity that is not the same in all directions.
    pub fn takes_tensors(&self) -> bool {
        !matches!(self.tensor, Tensor::Scalar | Tensor::Consistent | Tensor::Projected)
    }

    /// Whether it turns a tensor into weights of pairs.
    pub fn turns_weights(&self) -> bool {
        matches!(self.tensor, Tensor::Angular(_) | Tensor::Stencils)
    }

    /// Whether a weight depends on more than the row that it is in, so that all rows must be made before one is used.
    pub fn joins_rows(&self) -> bool {
        matches!(self.tensor, Tensor::Stencils | Tensor::Projected | Tensor::Consistent)
    }

    /// Whether exchanges with particles of fixed T are completed by what lies behind them: weights are exchanges, and
    /// none is negative beside a wall.
    pub fn completes_walls(&self) -> bool {
        let weighs = self.positive || matches!(self.tensor, Tensor::Angular(_) | Tensor::Consistent);
        weighs && self.is_one_matrix()
    }

    /// Over how many supports the rate of a particle reaches, densities being known; `None` where weights are made for all
    /// particles at once.
    pub fn supports(&self, normalise: Normalise) -> Option<u32> {
        match self.tensor {
            Tensor::Projected | Tensor::Stencils | Tensor::Twice { limited: true } => None,
            // The flux of a neighbour takes the gradient of all its neighbours, and theirs its frame.
            Tensor::Twice { limited: false } => Some(3),
            Tensor::Scalar | Tensor::Angular(_) if normalise != Normalise::No => Some(2),
            _ => Some(1),
        }
    }

    /// Whether its weights are projected, which normalises them.
    pub fn is_projected(&self) -> bool {
        matches!(self.tensor, Tensor::Projected | Tensor::Stencils)
    }

    /// Bytes that stored weights take, for each pair and for each particle.
    pub fn bytes(&self) -> [f64; 2] {
        match self.tensor {
            Tensor::Twice { limited: false } => sum([MATRIX, twice::BYTES]),
            // The limit is another matrix.
            Tensor::Twice { limited: true } => sum([MATRIX, twice::BYTES, MATRIX]),
            _ => MATRIX,
        }
    }

    /// Bytes that projecting weights takes beside them while it lasts, where the operator does that.
    pub fn bytes_to_project(&self, dim: usize) -> [f64; 2] {
        match self.tensor {
            Tensor::Projected | Tensor::Stencils | Tensor::Twice { limited: true } => projected::bytes(dim),
            _ => [0.0; 2],
        }
    }

    /// Whether its stored weights are all of it.
    pub fn is_one_matrix(&self) -> bool {
        !matches!(self.tensor, Tensor::Twice { .. })
    }
}

fn sum<const N: usize>(parts: [[f64; 2]; N]) -> [f64; 2] {
    [0, 1].map(|k| parts.iter().map(|part| part[k]).sum())
}

/// The operator of this name, whatever its case.
pub fn find(name: &str) -> Result<&'static Operator> {
    let found = OPERATORS.iter().find(|o| o.name.eq_ignore_ascii_case(name));
    found.ok_or_else(|| Error::unknown("operator", name, OPERATORS.iter().map(|o| o.name)))
}
