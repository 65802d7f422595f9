//! Conjugate gradients for (I − g A) x = b, matrix-free, preconditioned by what the system knows or by the
//! diagonal (Hestenes & Stiefel 1952).

use super::{Shifted, System};
use crate::error::{Error, Result};
use crate::pool::Pool;
use crate::sum;

/// How far a system of equations is solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Largest residual, relative to the change that the stage makes.
    pub tolerance: f64,
    /// Most iterations of a stage.
    pub iterations: u64,
}

impl Default for Limits {
    fn default() -> Limits {
        Limits { tolerance: 1e-10, iterations: 2000 }
    }
}

/// The matrix I − g A, where A is self-adjoint in the inner product Σ weight x y and has no positive eigenvalue.
pub struct Equations<'a> {
    pub system: &'a mut dyn System,
    pub pool: &'a Pool,
    pub shifted: Shifted<'a>,
}

impl Equations<'_> {
    /// Improves `x` until no |residual| exceeds `target`; `r` is the residual, `p` and `q` hold nothing of use. Rows of
    /// weight zero must have x = r = 0 and stay so.
    ///
    /// Returns the number of iterations.
    ///
    /// # Errors
    /// `NotConverged` after `most` iterations; any error of the system.
    pub fn solve(&mut self, target: f64, most: u64, [x, r, p, q]: [&mut [f64]; 4]) -> Result<u64> {
        let (Shifted { g, weight, .. }, pool, n) = (self.shifted, self.pool, r.len());
        p.fill(0.0);
        let (mut length, mut residual, mut done) = (f64::INFINITY, f64::INFINITY, most);
        let mut unit = None;
        for iteration in 0..=most {
            residual = sum::max(pool, n, |i| r[i].abs());
            if residual <= target {
                return Ok(iteration);
            }
            let unit = *unit.get_or_insert_with(|| unit_of(residual));
            let before = length;
            self.precondition(r, q)?;
            length = product(pool, unit, [weight, r, q]);
            let again = length / before;
            pool.update(p, |start, part| {
                part.iter_mut().enumerate().for_each(|(k, p)| *p = q[start + k] + again * *p);
            });
            self.system.apply(p, q)?;
            pool.update(q, |start, part| {
                part.iter_mut().zip(&p[start..]).for_each(|(q, p)| *q = p - g * *q);
            });
            let curvature = product(pool, unit, [weight, p, q]);
            let step = length / curvature;
            // Also where nothing is left but underflow, or an overflow: a step that is no number helps nobody.
            if !(curvature > 0.0 && step.is_finite()) {
                done = iteration;
                break;
            }
            add(pool, x, step, p);
            add(pool, r, -step, q);
        }
        Err(unsolved(done, most, residual, target))
    }

    /// Starts `x` for the right-hand side `r`, which becomes the residual: from zero; or, where a step is so long that
    /// the rate would carry y beyond its own spread, from what makes y + x uniform, if that leaves less to do.
    pub fn start(&mut self, y: &[f64], [x, r, q]: [&mut [f64]; 3]) -> Result<()> {
        let (g, pool, n) = (self.shifted.g, self.pool, r.len());
        let size = sum::max(pool, n, |i| r[i].abs());
        if self.system.flatten(self.shifted, y, x)? && size > sum::max(pool, n, |i| x[i].abs()) {
            self.system.apply(x, q)?;
            pool.update(q, |start, part| {
                part.iter_mut().enumerate().for_each(|(k, q)| *q = r[start + k] - (x[start + k] - g * *q));
            });
            if sum::max(pool, n, |i| q[i].abs()) < size {
                r.copy_from_slice(q);
                return Ok(());
            }
        }
        x.fill(0.0);
        Ok(())
    }

    fn precondition(&mut self, r: &[f64], z: &mut [f64]) -> Result<()> {
        let Shifted { g, diagonal, .. } = self.shifted;
        if !self.system.precondition(self.shifted, r, z)? {
            self.pool.update(z, |start, part| {
                part.iter_mut().enumerate().for_each(|(k, z)| *z = r[start + k] / (1.0 + g * diagonal[start + k]));
            });
        }
        Ok(())
    }
}

/// Sizes whose squares, times any weight that is likely, are numbers.
const PLAIN: std::ops::RangeInclusive<f64> = 1e-60..=1e60;

/// What numbers of this size are multiplied by so that their squares are numbers: 1, or a power of two, so that their
/// digits stay.
fn unit_of(size: f64) -> f64 {
    let unit = (-size.log2().round()).exp2();
    if unit.is_normal() && !PLAIN.contains(&size) { unit } else { 1.0 }
}

/// Σ w x y in this unit of x and y.
fn product(pool: &Pool, unit: f64, [w, x, y]: [&[f64]; 3]) -> f64 {
    match unit {
        1.0 => sum::sum(pool, w.len(), |i| w[i] * x[i] * y[i]),
        unit => sum::sum(pool, w.len(), |i| w[i] * (unit * x[i]) * (unit * y[i])),
    }
}

/// `to += factor * what`.
pub fn add(pool: &Pool, to: &mut [f64], factor: f64, what: &[f64]) {
    pool.update(to, |start, part| {
        part.iter_mut().zip(&what[start..]).for_each(|(to, what)| *to += factor * what);
    });
}

/// What was not solved, and what may help: more iterations only where all of them were used.
pub fn unsolved(iterations: u64, most: u64, residual: f64, wanted: f64) -> Error {
    let what = "the solution of an implicit stage".to_string();
    let remedy = match iterations < most {
        true => "rounding leaves no more of a step so long: take a smaller dt, or raise solver_tolerance",
        false => "take a smaller dt, or raise max_iterations or solver_tolerance",
    };
    let remedy = format!("nothing was changed: {remedy}");
    Error::NotConverged { what, iterations, residual, wanted, remedy }
}
