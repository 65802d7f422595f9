//! What has been found out about an operator, for as long as it stays the same.

use crate::integrator::Bounds;

/// Bounds on an operator.
#[derive(Debug, Clone, Copy)]
pub struct Known {
    /// Gershgorin's: what every step finds first, whatever steps were before it.
    pub proven: Bounds,
    /// The same, lowered by iterations, where that was needed.
    pub refined: Option<Bounds>,
    /// No bound on the spectrum can be less.
    pub floor: f64,
}
