//! Which particles are at a free surface: those whose neighbours all lie to one side.
//!
//! The measure is the length of the mean direction to the neighbours within about three spacings. It is 0 in a lattice and
//! 2/π or 1/2 at a flat surface in 2 or 3 dimensions; inside disordered particles it stays below 0.2, since close
//! pairs count no more than others. (The operator's first moment, whose weights grow for close pairs, does not tell a
//! strongly disordered interior from a surface.)

use super::rows::Rows;
use super::{Cloud, Domain, ONE_SIDED, Row, Scratch};
use crate::array::Strided;
use crate::error::Result;
use crate::memory;
use crate::pool::Pool;

/// Reach of the search, in spacings: between two shells of a lattice.
const REACH: f64 = 2.9;

/// Whether each particle is at a surface; `spacing` is (m/rho)^(1/nu) of each.
///
/// # Errors
/// `NoMemory`; `BoxTooSmall` where that reaches too many periodic images.
pub fn free(domain: &Domain, x: &[f64], spacing: &[f64]) -> Result<Vec<bool>> {
    let mut free = memory::filled("surface", spacing.len(), false)?;
    near(domain, x, spacing, |row, host, reach| {
        // A particle that has none around it is all surface.
        free[host[row.i] as usize] = row.one_sidedness(reach).unwrap_or(1.0) > ONE_SIDED[domain.dim - 1];
    })?;
    Ok(free)
}

/// The largest ratio of a positive quantity at a particle and at one of those around it; infinite where one of two is 0.
///
/// # Errors
/// As [`free`].
pub fn jump(domain: &Domain, x: &[f64], spacing: &[f64], values: &[f64]) -> Result<f64> {
    let mut most = 1.0f64;
    near(domain, x, spacing, |row, host, reach| {
        let own = values[host[row.i] as usize];
        // The next two shells of a lattice.
        for (&j, _) in row.j.iter().zip(row.r).filter(|(_, r)| **r < 0.6 * reach) {
            let other = values[host[j as usize] as usize];
            if own != other {
                most = most.max(own.max(other) / own.min(other));
            }
        }
    })?;
    Ok(most)
}

/// Visits every particle with those around it; the visitor gets host numbers and how far they reach.
fn near(domain: &Domain, x: &[f64], spacing: &[f64], mut visit: impl FnMut(&Row, &[u32], f64)) -> Result<()> {
    let (n, dim, pool) = (spacing.len(), domain.dim, Pool::new(1)?);
    let most = REACH * spacing.iter().copied().fold(0.0, f64::max);
    let cloud = Cloud::sort(domain, Strided::new("x", x, n, dim, dim)?, most, &pool)?;
    let reach = memory::collected("reach", cloud.host.iter().map(|&host| REACH * spacing[host as usize]))?;
    let rows = Rows::new(&cloud, &reach, 1.0, &pool)?;
    rows.visit(0..n, &mut Scratch::default(), |row| {
        visit(&row, &cloud.host, reach[row.i]);
        Ok(())
    })
}

#[cfg(all(test, feature = "cli"))]
mod tests {
    use super::*;
    use crate::study::lattice::{find, jitter};

    #[test]
    fn a_disordered_block_has_its_outermost_layer_as_surface() {
        for (dim, name, n) in [(1, "cubic", 40), (2, "square", 40), (3, "cubic", 14)] {
            for disorder in [0.0, 0.15, 0.3] {
                let (lo, hi) = (&[0.0; 3][..dim], &[1.0; 3][..dim]);
                let mut x = find(name, dim).unwrap().fill(lo, hi, n).unwrap();
                let layer = |p: &[f64]| ((p[0].min(1.0 - p[0])) * n as f64) as usize;
                let layers: Vec<usize> = x.chunks(dim).map(layer).collect();
                let d = 1.0 / n as f64;
                jitter(&mut x, disorder * d, 3);
                // Open along x only.
                let periodic: Vec<bool> = (0..dim).map(|a| a > 0).collect();
                let domain = Domain::new(lo, hi, &periodic).unwrap();
                let free = free(&domain, &x, &vec![d; layers.len()]).unwrap();
                for (layer, free) in layers.iter().zip(free) {
                    // The second layer of a strongly disordered block has gaps above it.
                    assert!(
                        (*layer == 1 && disorder > 0.2) || free == (*layer == 0),
                        "{dim}-D, disorder {disorder}, layer {layer}"
                    );
                }
            }
        }
    }
}
