//! The gradient of a field at each particle, exact for linear fields on any particles (Bonet & Lok 1999): the
//! difference gradient times the inverse of what it makes of the positions.

use crate::error::Result;
use crate::kernel::Kernel;
use crate::memory;
use crate::pool::Pool;
use crate::space::{Axes, Row, rows::Rows};
use nalgebra::{Matrix3, Vector3};

/// Directions in which the neighbours spread less than this, relative to the best one, carry no gradient.
const FLAT: f64 = 1e-8;

/// ∇f at each particle from the differences f_b − f_a = `rise(a, b)`, units of f per length; 0 along directions in which
/// a particle has no neighbours.
pub fn of(
    rise: impl Fn(usize, usize) -> f64 + Sync + Send,
    kernel: &Kernel,
    rows: &Rows,
    volume: &[f64],
    pool: &Pool,
) -> Result<Vec<Axes<f64>>> {
    let mut out = memory::filled("gradients", volume.len(), [0.0; 3])?;
    rows.map(pool, &mut out, |(q, slope): &mut (Vec<f64>, Vec<f64>), row: Row| {
        let inverse = 1.0 / rows.h[row.i];
        q.clear();
        q.extend(row.r.iter().map(|r| r * inverse));
        slope.resize(q.len(), 0.0);
        kernel.slope_over_q(q, slope);
        Ok(of_row(&rise, kernel.dim(), inverse, slope, volume, &row))
    })?;
    Ok(out)
}

/// Everything in units of h, so that the matrix is of order one in any system of units.
fn of_row(
    rise: impl Fn(usize, usize) -> f64,
    dim: usize,
    inverse: f64,
    slope: &[f64],
    volume: &[f64],
    row: &Row,
) -> Axes<f64> {
    let (mut spread, mut risen) = (Matrix3::zeros(), Vector3::zeros());
    let scale = inverse.powi(dim as i32);
    for (k, (&j, slope)) in row.j.iter().zip(slope).enumerate() {
        let mut d = Vector3::zeros();
        (0..dim).for_each(|a| d[a] = row.d[a][k] * inverse);
        let weight = -slope * scale * volume[j as usize];
        spread += weight * d * d.transpose();
        risen += weight * rise(row.i, j as usize) * d;
    }
    let gradient = pseudo_inverse(spread) * risen * inverse;
    [gradient[0], gradient[1], gradient[2]]
}

pub(super) fn pseudo_inverse(m: Matrix3<f64>) -> Matrix3<f64> {
    let eigen = m.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let inverse = eigen.eigenvalues.map(|v| if v > FLAT * largest { 1.0 / v } else { 0.0 });
    eigen.eigenvectors * Matrix3::from_diagonal(&inverse) * eigen.eigenvectors.transpose()
}
