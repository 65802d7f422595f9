//! How good an operator is where a particle stands: the first moment of its weights, which is 0 for a perfect
//! Laplacian. (The second moment, K_d2, falls out of the assembly, [`super::once::Assembly::store`], unless weights are
//! symmetrised afterwards.)

use super::Matrix;
use super::once::{Assembly, Buffers};
use crate::error::Result;
use crate::memory;
use crate::pool::Pool;
use crate::space::{Axes, Row};

/// h_a Σ_b V_b w_ab (r_b − r_a) for each particle: dimensionless, one component per axis.
pub fn first(assembly: &Assembly, pool: &Pool) -> Result<Vec<Axes<f64>>> {
    let mut out = memory::filled("first moments", assembly.volume.len(), [0.0; 3])?;
    assembly.rows.map(pool, &mut out, |buffers: &mut Buffers, row: Row| {
        let w = assembly.weights(&row, buffers)?;
        let h = assembly.rows.h[row.i];
        let mut moment = [0.0; 3];
        for (axis, m) in moment.iter_mut().enumerate().take(assembly.kernel.dim()) {
            let terms = row.j.iter().zip(w).zip(row.d[axis]);
            *m = h * terms.map(|((&j, w), d)| assembly.volume[j as usize] * w * d).sum::<f64>();
        }
        Ok(moment)
    })?;
    Ok(out)
}

/// K_a = Σ_b V_b r² w_ab / (2 nu) of each particle, from stored coefficients g_ab = V_a V_b w_ab.
pub fn second(assembly: &Assembly, matrix: &Matrix, pool: &Pool) -> Result<Vec<f64>> {
    let mut out = memory::filled("second moments", assembly.volume.len(), 0.0)?;
    let nu = assembly.kernel.dim() as f64;
    assembly.rows.map(pool, &mut out, |_: &mut (), row: Row| {
        let sum: f64 = matrix.coefficients(row.i).iter().zip(row.r).map(|(g, r)| g * (r * r)).sum();
        Ok(sum / (2.0 * nu * assembly.volume[row.i]))
    })?;
    Ok(out)
}
