//! What applies an operator: stored rows of weights, rows made on the way, or two sweeps. One door for whoever has something
//! that diffuses, and knows of what lies between particles by data.

use super::assembly::Assembly;
use super::matrix::Matrix;
use super::twice::Twice;
use super::{Kappa, Mean};
use crate::error::{Error, Result};
use crate::pool::Pool;

/// What lies between particles, and what a sum over them is multiplied by.
#[derive(Clone, Copy)]
pub struct Medium<'a> {
    pub mean: Mean,
    /// The conductivity of each particle; none where it is one for all, or in the coefficients.
    pub kappa: Option<&'a [f64]>,
    /// Of all sums.
    pub factor: f64,
    /// Of each particle's: what it takes to move it, 1/(m c_v) for heat; 0 where nothing can.
    pub scale: &'a [f64],
    /// Skip blocks in which nothing differs.
    pub quiet: bool,
}

impl Medium<'_> {
    /// The conductivity that pairs are to be multiplied by.
    pub fn kappa(&self) -> Kappa<'_> {
        self.kappa.map(|kappa| (self.mean, kappa))
    }
}

#[derive(Clone, Copy)]
pub enum Engine<'a> {
    Stored(&'a Matrix),
    Fresh(&'a Assembly<'a>),
    /// Two sweeps, over the pairs of a matrix.
    Twice(&'a Twice, &'a Matrix),
}

impl Engine<'_> {
    /// out_a = scale_a factor Σ_b kappa_ab V_a V_b w_ab (y_b − y_a), or what two sweeps make of the same.
    ///
    /// # Errors
    /// `NoMemory`; `Cancelled`.
    pub fn apply(&self, pool: &Pool, medium: &Medium, y: &[f64], out: &mut [f64]) -> Result<()> {
        pool.go_on()?;
        let finish = |i: usize, sum: f64| sum * medium.factor * medium.scale[i];
        match self {
            Engine::Fresh(assembly) => assembly.apply(pool, medium.kappa(), y, out, finish)?,
            Engine::Stored(matrix) => matrix.apply(pool, medium.kappa(), y, out, medium.quiet, finish),
            Engine::Twice(twice, matrix) => twice.apply(matrix, pool, medium.kappa(), y, out, finish)?,
        }
        Ok(())
    }

    /// For each particle the radius and the centre's size of its Gershgorin circle.
    ///
    /// # Errors
    /// `OutOfOrder` without stored weights; `NoMemory`.
    pub fn circles(&self, pool: &Pool, medium: &Medium) -> Result<Vec<(f64, f64)>> {
        let mut circles = match self {
            Engine::Stored(matrix) => matrix.circles(pool, medium.kappa())?,
            Engine::Twice(twice, matrix) => twice.circles(matrix, pool, medium.kappa())?,
            Engine::Fresh(_) => return Err(no_weights("a bound")),
        };
        for ((radius, centre), scale) in circles.iter_mut().zip(medium.scale) {
            let scale = medium.factor * scale;
            (*radius, *centre) = (*radius * scale, *centre * scale);
        }
        Ok(circles)
    }

    /// The stored weights of pairs.
    ///
    /// # Errors
    /// `OutOfOrder` where there are none.
    pub fn matrix(&self) -> Result<&Matrix> {
        match self {
            Engine::Stored(matrix) | Engine::Twice(_, matrix) => Ok(matrix),
            Engine::Fresh(_) => Err(no_weights("a look at weights")),
        }
    }

    /// Whether what comes out is a linear function of what goes in.
    pub fn is_linear(&self) -> bool {
        !matches!(self, Engine::Twice(twice, _) if twice.is_limited())
    }
}

fn no_weights(call: &str) -> Error {
    Error::OutOfOrder { call: call.into(), missing: "stored weights".into() }
}
