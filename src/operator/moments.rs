//! How good an operator is where a particle stands: the first moment of its weights, which is 0 for a perfect
//! Laplacian. (The second moment, K_d2, falls out of the assembly, [`super::once::Assembly::store`], unless rows have to
//! agree afterwards.)

use super::Matrix;
use super::once::{Assembly, Buffers};
use crate::error::Result;
use crate::memory;
use crate::pool::Pool;
use crate::space::{Axes, Row};
use crate::sum;

/// h_a Σ_b V_b w_ab (r_b − r_a) for each particle: dimensionless, one component per axis. `stored`: where coefficients are
/// not those that the assembly makes of a row.
pub fn first(assembly: &Assembly, stored: Option<&Matrix>, pool: &Pool) -> Result<Vec<Axes<f64>>> {
    let mut out = memory::filled("first moments", assembly.volume.len(), [0.0; 3])?;
    assembly.rows.map(pool, &mut out, |(buffers, made): &mut (Buffers, Vec<f64>), row: Row| {
        let g = match stored {
            Some(matrix) => matrix.coefficients(row.i),
            None => {
                made.clear();
                made.extend(assembly.coefficients(&row, assembly.weights(&row, buffers)?));
                made
            }
        };
        let scale = assembly.rows.h[row.i] / assembly.volume[row.i];
        let sum = |d: &[f64]| scale * g.iter().zip(d).map(|(g, d)| g * d).sum::<f64>();
        Ok(row.d.map(sum))
    })?;
    Ok(out)
}

/// K_a = Σ_b V_b r² w_ab / (2 nu) of each particle, from stored coefficients g_ab = V_a V_b w_ab.
pub fn second(assembly: &Assembly, matrix: &Matrix, pool: &Pool) -> Result<Vec<f64>> {
    let mut out = memory::filled("second moments", assembly.volume.len(), 0.0)?;
    let nu = assembly.kernel.dim() as f64;
    assembly.rows.map(pool, &mut out, |_: &mut (), row: Row| {
        Ok(of_row(matrix.coefficients(row.i), row.r) / (2.0 * nu * assembly.volume[row.i]))
    })?;
    Ok(out)
}

/// Σ_b g_ab r².
pub fn of_row(g: &[f64], r: &[f64]) -> f64 {
    sum::product(g, r, r)
}
