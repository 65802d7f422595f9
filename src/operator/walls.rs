//! Particles of fixed temperature as walls. Where they are a single layer, what lies behind them is missing from the sums
//! of the particles in front, and rates are off by a gradient over a spacing: first order. Behind a wall T is taken to go
//! on as a straight line through the wall's own T at the wall's own place, as Morris, Fox & Zhu (1997) do for no-slip
//! walls: a neighbour that is missing at a distance d along the normal then counts as d/d_w times the difference to the
//! wall at d_w, so that all of them together only change how strong the exchanges with the wall are, until first moments
//! vanish along its normal. The operator stays symmetric among the particles that are free, and positive where it was.
//! Normalisation by second moments must not take a support that is cut off for one that is too weak: beside such a wall the
//! half that lies away from it counts twice.
//!
//! Where layers behind a wall fill the support, nothing changes.

use super::assembly::Assembly;
use super::normalise::{self, Normals};
use super::{Matrix, moments};
use crate::error::Result;
use crate::memory;
use crate::pool::Pool;
use crate::space::{Axes, Row, rows::Rows};

/// A wall's exchanges are not made weaker than this.
const LEAST: f64 = 0.25;
/// Spacings that the farthest neighbour towards a wall stays within the support where no layer is missing.
const LAYER: f64 = 1.25;

/// Particles, those of fixed T among them.
pub struct Walls<'a, F> {
    pub rows: &'a Rows<'a>,
    pub volume: &'a [f64],
    pub fixed: F,
    pub pool: &'a Pool,
}

impl<F: Fn(usize) -> bool + Sync + Send> Walls<'_, F> {
    /// Replaces what is known of particles beside walls that are cut off by what it would be if the wall went on.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn complete_normals(&self, assembly: &Assembly, matrix: &Matrix, normals: &mut Normals) -> Result<()> {
        let given = memory::copied("second moments", &normals.moments)?;
        let dim = self.rows.cloud.dim();
        self.rows.map(self.pool, &mut normals.moments, |g: &mut Vec<f64>, row: Row| {
            let complete = self.went_on(&row, matrix.coefficients(row.i), g)?;
            let moment = || moments::of_row(g, row.r) / (2.0 * dim as f64 * self.volume[row.i]);
            Ok(if complete { moment() } else { given[row.i] })
        })?;
        let given = memory::copied("second moments", &normals.tensors)?;
        self.rows.map(self.pool, &mut normals.tensors, |g: &mut Vec<f64>, row: Row| {
            let complete = self.went_on(&row, matrix.coefficients(row.i), g)?;
            let wanted = normalise::wanted(assembly, row.i);
            Ok(if complete { normalise::tensor_for(&wanted, assembly, &row, g) } else { given[row.i] })
        })
    }

    /// Fills `out` with the coefficients that a row counts with beside a wall that is cut off; answers whether it is.
    fn went_on(&self, row: &Row, g: &[f64], out: &mut Vec<f64>) -> Result<bool> {
        let Some(normal) = self.cut_off(row, g) else { return Ok(false) };
        let half = 0.5 * self.spacing(row.i);
        let twice = |k: usize| 1.0 - (along(row, k, normal) / half).clamp(-1.0, 1.0);
        out.clear();
        memory::extended("a row of weights", out, g.len(), 0.0)?;
        out.iter_mut().enumerate().for_each(|(k, out)| *out = g[k] * twice(k));
        Ok(true)
    }

    /// Completes the exchanges of free particles with fixed ones.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn complete(&self, matrix: &mut Matrix) -> Result<()> {
        let mut strength = memory::filled("walls", matrix.len(), 1.0)?;
        self.rows.map(self.pool, &mut strength, |_: &mut (), row: Row| {
            let g = matrix.coefficients(row.i);
            let normal = if (self.fixed)(row.i) { None } else { self.cut_off(&row, g) };
            Ok(normal.map_or(1.0, |normal| self.strength(&row, g, normal)))
        })?;
        let (strength, fixed) = (&strength[..], &self.fixed);
        matrix.scale(self.pool, move |a, b| match (fixed(a), fixed(b)) {
            (false, true) => strength[a],
            (true, false) => strength[b],
            _ => 1.0,
        });
        Ok(())
    }

    /// The direction into a wall whose last layer is too near for the support to be filled.
    fn cut_off(&self, row: &Row, g: &[f64]) -> Option<Axes<f64>> {
        let held = (self.fixed)(row.i);
        let mut normal = [0.0; 3];
        for (k, g) in g.iter().enumerate().filter(|(k, _)| (self.fixed)(row.j[*k] as usize) != held) {
            let towards = if held { -g } else { *g };
            normal.iter_mut().zip(row.d).filter(|(_, d)| !d.is_empty()).for_each(|(n, d)| *n += towards * d[k]);
        }
        let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        let normal = normal.map(|n| n / length);
        let last = (0..row.len()).map(|k| along(row, k, normal)).fold(0.0, f64::max);
        let support = self.rows.radius * self.rows.h[row.i];
        (last < support - LAYER * self.spacing(row.i)).then_some(normal)
    }

    /// What exchanges with a wall are to be multiplied by, so that Σ g d vanishes along its normal.
    fn strength(&self, row: &Row, g: &[f64], normal: Axes<f64>) -> f64 {
        let (mut free, mut wall) = (0.0, 0.0);
        for (k, (&j, g)) in row.j.iter().zip(g).enumerate() {
            let sum = if (self.fixed)(j as usize) { &mut wall } else { &mut free };
            *sum += g * along(row, k, normal);
        }
        let strength = -free / wall;
        if wall > 0.0 && strength > 0.0 && strength.is_finite() { strength.max(LEAST) } else { 1.0 }
    }

    fn spacing(&self, i: usize) -> f64 {
        self.volume[i].powf(1.0 / self.rows.cloud.dim() as f64)
    }
}

/// How far neighbour k lies along a direction.
fn along(row: &Row, k: usize, direction: Axes<f64>) -> f64 {
    row.d.iter().zip(direction).filter(|(d, _)| !d.is_empty()).map(|(d, n)| d[k] * n).sum()
}
