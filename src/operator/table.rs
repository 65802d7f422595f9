//! Every operator, a row each. Add an operator here.

use crate::error::{Error, Result};
use crate::kernel::Kernel;

/// A pair operator: one radial function w(q), the weight of a pair at r = q h in units of 1/h^(nu + 2), and what becomes of
/// such weights. A row says what it promises, and what is not as in [`PAIRS`].
pub struct Operator {
    pub name: &'static str,
    pub about: &'static str,
    /// w ≥ 0 for every pair, whatever kappa: the operator keeps a maximum principle and cannot have growing modes.
    pub positive: bool,
    /// Symmetric and without growing modes on any particles: implicit integrators may solve with it.
    pub dissipative: bool,
    /// Exchanges are equal and opposite on any particles.
    pub conserves: bool,
    /// Takes a conductivity that is not the same in all directions.
    pub takes_tensors: bool,
    /// The default of `normalise=`; of projected, what weights are scaled by before they are projected.
    pub normalise: Normalise,
    /// What a row of weights is fitted to, by itself.
    pub fit: Fit,
    /// What is done to all rows together.
    pub join: Join,
    pub sweeps: Sweeps,
    /// Fills `w` from distances `q`; `spare` is a buffer of the same length.
    pub weight: fn(kernel: &Kernel, q: &[f64], w: &mut [f64], spare: &mut [f64]),
}

#[derive(Debug, Clone, Copy)]
pub enum Fit {
    None,
    /// For a conductivity kappa S, tr S = nu, the weight of a pair is multiplied by a function of r̂·S r̂ and nu, which is 1
    /// for S = I.
    Angle(fn(along: f64, nu: f64) -> f64),
    /// Exact for polynomials.
    Polynomials,
    /// Positive, with the moments of S.
    Moments,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Join {
    None,
    /// Rows beside free surfaces are replaced by normalised pairs.
    Pairs,
    /// Weights are projected to the moments of a Laplacian.
    Projection,
}

/// How weights of pairs are scaled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Normalise {
    No,
    Pair,
    Tensor,
}

pub static NORMALISATIONS: &[(&str, Normalise)] =
    &[("tensor", Normalise::Tensor), ("pair", Normalise::Pair), ("none", Normalise::No)];

impl Normalise {
    pub fn name(self) -> &'static str {
        NORMALISATIONS.iter().find(|(_, n)| *n == self).map_or("", |(name, _)| name)
    }

    /// What the pass does.
    pub fn about(self) -> &'static str {
        match self {
            Normalise::No => "",
            Normalise::Pair => "pairs scaled by the mean of 1/K_a and 1/K_b",
            Normalise::Tensor => "pairs scaled so that each particle conducts alike in all directions that it has",
        }
    }
}

/// How often a rate goes over the pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sweeps {
    One,
    /// Gradient, flux, divergence; the weights of pairs serve the stabiliser. `limited`: no exchange may make a new extremum.
    Two {
        limited: bool,
    },
}

/// Brookshaw's pairs, which every row is a change of; no promise is inherited.
pub const PAIRS: Operator = Operator {
    name: "",
    about: "",
    positive: false,
    dissipative: false,
    conserves: false,
    takes_tensors: false,
    normalise: Normalise::Tensor,
    fit: Fit::None,
    join: Join::None,
    sweeps: Sweeps::One,
    weight: brookshaw,
};

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
        conserves: true,
        ..PAIRS
    },
    Operator {
        name: "kernel",
        about: "the kernel itself as its Laplacian, w = A W/h^2 with A = 2 nu / <r^2> (Biriukov & Price 2019); \
                symmetric, conservative, positive",
        positive: true,
        dissipative: true,
        conserves: true,
        weight: kernel_itself,
        ..PAIRS
    },
    Operator {
        name: "direct",
        about: "the second derivative of the kernel, w = W'' + (nu - 1) F/r; symmetric and conservative but not \
                positive: has growing modes on disordered particles",
        conserves: true,
        normalise: Normalise::No,
        weight: |kernel, q, w, spare| {
            kernel.curvature(q, w);
            kernel.slope_over_q(q, spare);
            let other_axes = kernel.dim() as f64 - 1.0;
            w.iter_mut().zip(spare).for_each(|(w, slope)| *w += other_axes * *slope);
        },
        ..PAIRS
    },
    Operator {
        name: "consistent",
        about: "weights that are exact for polynomials up to order=2, 4 or 6 on any particles, by local least squares, and \
                normalised pairs beside free surfaces; not symmetric, so conservative only as far as T is resolved; not \
                positive",
        normalise: Normalise::No,
        fit: Fit::Polynomials,
        join: Join::Pairs,
        weight: |kernel, q, w, _| kernel.w(q, w),
        ..PAIRS
    },
    Operator {
        name: "projected",
        about: "Brookshaw's weights moved as little as makes them exact for quadratic T at every particle at once, none of \
                them negative; symmetric, conservative, positive; takes time to make",
        positive: true,
        dissipative: true,
        conserves: true,
        join: Join::Projection,
        ..PAIRS
    },
    Operator {
        name: "espanol-revenga",
        about: "tensor kappa: w = -((nu + 2) r.kappa.r - tr kappa) F/r (Espanol & Revenga 2003); symmetric, conservative, \
                positive only while kappa_par <= 3 kappa_perp",
        conserves: true,
        takes_tensors: true,
        fit: Fit::Angle(espanol_revenga),
        ..PAIRS
    },
    Operator {
        name: "espanol-revenga-kernel",
        about: "tensor kappa: Espanol & Revenga's angular factor on the kernel itself in place of -2 F/r (Biriukov & Price \
                2019); as espanol-revenga otherwise",
        conserves: true,
        takes_tensors: true,
        fit: Fit::Angle(espanol_revenga),
        weight: kernel_itself,
        ..PAIRS
    },
    Operator {
        name: "two-first",
        about: "tensor kappa: gradient, flux and its exact adjoint divergence, with a penalty theta on what the gradients \
                do not explain; symmetric, conservative, never grows, hardly leaks across b; not monotone",
        dissipative: true,
        conserves: true,
        normalise: Normalise::Pair,
        takes_tensors: true,
        sweeps: Sweeps::Two { limited: false },
        ..PAIRS
    },
    Operator {
        name: "limited",
        about: "tensor kappa: two-first, its exchanges limited pair by pair so that no new extremum appears (nonlinear); \
                conservative, monotone, hardly leaks across b",
        positive: true,
        conserves: true,
        normalise: Normalise::Pair,
        takes_tensors: true,
        sweeps: Sweeps::Two { limited: true },
        ..PAIRS
    },
    Operator {
        name: "monotone",
        about: "tensor kappa: positive pair weights nearest to Brookshaw's that have its moments, particle by particle and \
                then all together; symmetric, conservative, monotone at any anisotropy; takes time to make; leaks across b",
        positive: true,
        dissipative: true,
        conserves: true,
        normalise: Normalise::Pair,
        takes_tensors: true,
        fit: Fit::Moments,
        join: Join::Projection,
        ..PAIRS
    },
];

impl Operator {
    /// Whether it turns a tensor into weights of pairs.
    pub fn turns_weights(&self) -> bool {
        self.takes_tensors && self.is_one_matrix()
    }

    /// Whether a weight depends on more than the row that it is in, so that all rows must be made before one is used.
    pub fn joins_rows(&self) -> bool {
        self.join != Join::None
    }

    /// Whether its stored weights are all of it.
    pub fn is_one_matrix(&self) -> bool {
        self.sweeps == Sweeps::One
    }

    /// Whether its weights are projected, which normalises them.
    pub fn is_projected(&self) -> bool {
        self.join == Join::Projection
    }

    /// Whether its weights are exact for polynomials.
    pub fn is_exact(&self) -> bool {
        matches!(self.fit, Fit::Polynomials)
    }

    /// Whether its weights are positive as long as directions do not differ by more than its angular factor bears.
    pub fn has_angle(&self) -> bool {
        matches!(self.fit, Fit::Angle(_))
    }

    /// Whether exchanges with particles of fixed T are completed by what lies behind them: weights are exchanges, and
    /// none is negative beside a wall.
    pub fn completes_walls(&self) -> bool {
        (self.positive || self.has_angle() || self.is_exact()) && self.is_one_matrix()
    }

    /// Over how many supports the rate of a particle reaches, densities being known; `None` where weights are made for all
    /// particles at once.
    pub fn supports(&self, normalise: Normalise) -> Option<u32> {
        match (self.sweeps, self.join) {
            (Sweeps::Two { limited: true }, _) | (_, Join::Projection) => None,
            // The flux of a neighbour takes the gradient of all its neighbours, and theirs its frame.
            (Sweeps::Two { limited: false }, _) => Some(3),
            _ if !self.is_exact() && normalise != Normalise::No => Some(2),
            _ => Some(1),
        }
    }
}

/// The operator of this name, whatever its case.
pub fn find(name: &str) -> Result<&'static Operator> {
    let found = OPERATORS.iter().find(|o| o.name.eq_ignore_ascii_case(name));
    found.ok_or_else(|| Error::unknown("operator", name, OPERATORS.iter().map(|o| o.name)))
}
