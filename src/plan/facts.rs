//! What is known about a scene before it runs: the rules decide on these and on nothing else.

use super::Choices;
use super::preconditioner::Preconditioning;
use crate::operator::{Mean, Normalise};

#[derive(Debug, Clone, PartialEq)]
pub struct Facts {
    pub n: usize,
    pub dim: usize,
    /// Mean number of neighbours, from a sample.
    pub neighbours: f64,
    pub same_h: bool,
    /// h is found together with rho; or rho alone is summed.
    pub finds_h: bool,
    pub sums_rho: bool,
    /// The host moved particles (or changed m, rho or h) after the first step.
    pub moves: bool,
    pub uniform_kappa: bool,
    pub kappa_of_t: bool,
    /// The host has changed kappa since the weights were made.
    pub kappa_changes: bool,
    /// Of kappa between two particles.
    pub mean: Mean,
    /// Particles that exchange heat with the outside.
    pub exchanging: usize,
    pub heated: bool,
    /// Functions of the host's are looked at between stages.
    pub watched: bool,
    /// The host has asked for rates and never for a step.
    pub rate_only: bool,
    /// Weights are scaled by their own moments, which must be known first.
    pub normalised: bool,
    /// kappa is a tensor, not the same in all directions.
    pub tensor: bool,
    /// The operator takes a gradient and a divergence.
    pub twice: bool,
    /// A weight depends on more than the row that it is in.
    pub joined: bool,
    /// How wrong weights that were projected conduct, once they are made.
    pub defect: Option<f64>,
    /// Weights answer to particles of fixed T.
    pub walls: bool,
    /// Particles beside ones that conduct much better, and those of them that pairs reach over.
    pub bypassed: (usize, usize),
    /// Nothing about the operator rules out modes that grow, and they are refused.
    pub may_grow: bool,
    /// The operator has no negative weight.
    pub positive: bool,
    /// T stays where the maximum principle has it.
    pub keeps_bounds: bool,
    pub operator: &'static str,
    pub integrator: &'static str,
    /// What was chosen, and why, where the choice is ours.
    pub auto: Option<String>,
    /// Errors of sub-steps are estimated.
    pub controlled: bool,
    /// The integrator solves for its stages.
    pub implicit: bool,
    /// How the equations of its stages are preconditioned.
    pub preconditioning: Preconditioning,
    /// Arrays of n that the integrator holds.
    pub buffers: f64,
}

impl Facts {
    pub fn title(&self, choices: &Choices) -> String {
        let normalised = match choices.normalise {
            Normalise::No => "not normalised".to_string(),
            by => format!("{}-normalised", by.name()),
        };
        format!(
            "heat: {} particles in {}-D, {:.0} neighbours; {} (h_fac {}), {} {normalised}, {} kappa, {}",
            self.n,
            self.dim,
            self.neighbours,
            choices.kernel.name(),
            choices.h_fac,
            self.operator,
            self.mean.name(),
            self.integrator
        )
    }
}
