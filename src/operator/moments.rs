//! How good stored weights are where a particle stands: their second moments, which are those of a Laplacian where they
//! are right.

use super::Matrix;
use super::assembly::Assembly;
use super::normalise::{self, Normals};
use super::tensor;
use crate::error::Result;
use crate::memory;
use crate::pool::Pool;
use crate::space::Row;
use crate::sum;

/// K_a = Σ_b V_b r² w_ab / (2 nu) of each particle, and what it is normalised by, from stored coefficients
/// g_ab = V_a V_b w_ab.
pub fn normals(assembly: &Assembly, matrix: &Matrix, pool: &Pool) -> Result<Normals> {
    let n = assembly.volume.len();
    let mut moments = memory::filled("second moments", n, 0.0)?;
    let nu = assembly.kernel.dim() as f64;
    assembly.rows.map(pool, &mut moments, |_: &mut (), row: Row| {
        Ok(of_row(matrix.coefficients(row.i), row.r) / (2.0 * nu * assembly.volume[row.i]))
    })?;
    let mut tensors = memory::filled("second moments", if assembly.turns_pairs() { n } else { 0 }, [0.0; 6])?;
    if assembly.turns_pairs() {
        let tensor = |_: &mut (), row: Row| Ok(normalise::tensor_of(assembly, &row, matrix.coefficients(row.i)));
        assembly.rows.map(pool, &mut tensors, tensor)?;
    }
    Ok(Normals { moments, tensors, ..Normals::default() })
}

/// How wrong each particle conducts: |Σ_b V_b w_ab d dᵀ/2 − S|/√nu, S being I unless the operator takes a tensor kappa, from
/// stored coefficients; 0 for a perfect Laplacian.
pub fn conduction(assembly: &Assembly, matrix: &Matrix, pool: &Pool) -> Result<Vec<f64>> {
    let mut out = memory::filled("second moments", assembly.volume.len(), 0.0)?;
    let nu = assembly.kernel.dim();
    assembly.rows.map(pool, &mut out, |_: &mut (), row: Row| {
        let (g, scale) = (matrix.coefficients(row.i), 0.5 / assembly.volume[row.i]);
        let wanted = normalise::wanted(assembly, row.i);
        let squares = tensor::AXES.iter().zip(wanted).filter(|([_, l], _)| *l < nu).map(|(&[k, l], wanted)| {
            let off = scale * sum::product(g, row.d[k], row.d[l]) - wanted;
            off * off * if k == l { 1.0 } else { 2.0 }
        });
        Ok((squares.sum::<f64>() / nu as f64).sqrt())
    })?;
    Ok(out)
}

/// Σ_b g_ab r².
pub fn of_row(g: &[f64], r: &[f64]) -> f64 {
    sum::product(g, r, r)
}
