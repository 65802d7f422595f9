//! The preconditioner of implicit heat: multigrid on the stored weights.

use super::heat::Heat;
use crate::error::Result;
use crate::operator::Engine;
use crate::operator::aggregate::Couplings;
use crate::operator::multigrid::{Fine, Multigrid};
use crate::sum;

impl Heat<'_> {
    /// Writes z ≈ (I − g A)⁻¹ r, with the operator A as linearised last. False where the diagonal has to serve.
    ///
    /// # Errors
    /// As [`Heat::linear`].
    pub fn precondition(&mut self, fine: Fine, r: &[f64], z: &mut [f64]) -> Result<bool> {
        self.with_multigrid(fine, |heat, multigrid| {
            multigrid.set(fine.g);
            multigrid.cycle(fine, r, z, |x, y| heat.linear(x, y))
        })
    }

    /// Writes x such that y + x is the mean of y in each coupled part. False where the parts are not known.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn flatten(&mut self, fine: Fine, y: &[f64], x: &mut [f64]) -> Result<bool> {
        self.with_multigrid(fine, |_, multigrid| {
            multigrid.flatten(fine, y, x);
            Ok(())
        })
    }

    /// Calls `work` with the levels, made where they are missing; false where none are wanted.
    fn with_multigrid(
        &mut self,
        fine: Fine,
        work: impl FnOnce(&mut Self, &mut Multigrid) -> Result<()>,
    ) -> Result<bool> {
        let Engine::Stored(matrix) = self.engine else { return Ok(false) };
        if self.stiff.is_infinite() {
            return Ok(false);
        }
        // The explicit limit is 2 over the largest eigenvalue, which is little more than the largest diagonal element.
        let length = 0.5 * fine.g * sum::max(self.pool, fine.diagonal.len(), |i| fine.diagonal[i]);
        let Some(multigrid) = self.multigrid.take_if(|_| length >= self.stiff) else { return Ok(false) };
        if multigrid.is_empty() {
            let medium = self.medium();
            let couplings = Couplings { matrix, kappa: medium.kappa(), factor: medium.factor };
            *multigrid = Multigrid::build(fine, &couplings)?;
        }
        work(self, multigrid)?;
        self.multigrid = Some(multigrid);
        Ok(true)
    }
}
