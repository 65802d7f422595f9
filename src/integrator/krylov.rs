//! Conjugate gradients for (I − g A) x = b, matrix-free, preconditioned by the diagonal (Hestenes & Stiefel 1952).

use super::System;
use crate::error::{Error, Result};
use crate::pool::{BLOCK, Pool};
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
    pub g: f64,
    /// −diag A.
    pub diagonal: &'a [f64],
    pub weight: &'a [f64],
}

impl Equations<'_> {
    /// Sets `x`, starting from zero, so that no |residual| exceeds `target`; `r` is the right-hand side and becomes
    /// the residual, `p` and `q` hold nothing of use. Rows of weight zero must have r = 0 and stay x = 0.
    ///
    /// Returns the number of iterations.
    ///
    /// # Errors
    /// `NotConverged` after `most` iterations; any error of the system.
    pub fn solve(&mut self, target: f64, most: u64, [x, r, p, q]: [&mut [f64]; 4]) -> Result<u64> {
        let (g, pool, weight, diagonal, n) = (self.g, self.pool, self.weight, self.diagonal, r.len());
        let scaled = |r: &[f64], i: usize| r[i] / (1.0 + g * diagonal[i]);
        x.fill(0.0);
        p.fill(0.0);
        let (mut length, mut residual) = (f64::INFINITY, f64::INFINITY);
        for iteration in 0..=most {
            residual = sum::max(pool, n, |i| r[i].abs());
            if residual <= target {
                return Ok(iteration);
            }
            let before = length;
            length = sum::sum(pool, n, |i| weight[i] * r[i] * scaled(r, i));
            let again = length / before;
            pool.chunks(p, BLOCK, |start, part| {
                part.iter_mut().enumerate().for_each(|(k, p)| *p = scaled(r, start + k) + again * *p);
            });
            self.system.apply(p, q)?;
            pool.chunks(q, BLOCK, |start, part| {
                part.iter_mut().zip(&p[start..]).for_each(|(q, p)| *q = p - g * *q);
            });
            let curvature = sum::sum(pool, n, |i| weight[i] * p[i] * q[i]);
            let step = length / curvature;
            // Also where nothing is left but underflow, or an overflow: a step that is no number helps nobody.
            if !(curvature > 0.0 && step.is_finite()) {
                break;
            }
            add(pool, x, step, p);
            add(pool, r, -step, q);
        }
        Err(unsolved(most, residual, target))
    }
}

/// `to += factor * what`.
pub fn add(pool: &Pool, to: &mut [f64], factor: f64, what: &[f64]) {
    pool.chunks(to, BLOCK, |start, part| {
        part.iter_mut().zip(&what[start..]).for_each(|(to, what)| *to += factor * what);
    });
}

pub fn unsolved(iterations: u64, residual: f64, wanted: f64) -> Error {
    let what = "the solution of an implicit stage".to_string();
    let remedy = "nothing was changed: take a smaller dt, or raise max_iterations or solver_tolerance".to_string();
    Error::NotConverged { what, iterations, residual, wanted, remedy }
}
