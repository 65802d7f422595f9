//! The passes that make weights, from rows by themselves to what stages apply.

use super::Plan;
use super::rules;
use super::state::{State, Weights};
use crate::error::{Error, Result};
use crate::memory;
use crate::model::fields;
use crate::operator::normalise::Normals;
use crate::operator::table::{self, Sweeps};
use crate::operator::twice::Recipe;
use crate::operator::walls::Walls;
use crate::operator::{Assembly, Matrix, Twice};
use crate::space::density;

/// Fewest particles of which the median K_d2 says anything.
const SAMPLED: usize = 10;
/// What it may be: lattices have 0.8 to 1.2, lines in 3-D 0.3; without neighbours it is 0.
const PLAUSIBLE: std::ops::RangeInclusive<f64> = 0.1..=10.0;

impl State {
    /// Rows of weights, each by itself.
    pub(super) fn make_weights(&mut self, plan: &Plan) -> Result<bool> {
        if self.weights.is_some() {
            return Ok(false);
        }
        self.refuse_weights_without_room(self.geometry.as_ref().map_or(0.0, |g| g.neighbours))?;
        let (matrix, normals) = self.with_assembly(plan.leaves_out(&rules::SAME_H), |a| a.rows(&self.pool))?;
        let (normals, moments) = (Some(normals), Vec::new());
        self.weights =
            Some(Weights { matrix, normals, twice: None, moments, defect: None, paired: false, folded: false });
        Ok(true)
    }

    pub(super) fn join_weights(&mut self, plan: &Plan) -> Result<bool> {
        self.change_weights(plan, |state, a, Weights { matrix, normals, .. }| match normals {
            Some(normals) => a.join(matrix, normals, &state.pool),
            None => Ok(()),
        })
    }

    pub(super) fn normalise_weights(&mut self, plan: &Plan) -> Result<bool> {
        self.change_weights(plan, |state, a, Weights { matrix, normals, .. }| {
            let Some(normals) = normals else { return Ok(()) };
            // Walls count for the scaling, and not in what a host gets as K_d2.
            let own = memory::copied("second moments", &normals.moments)?;
            state.at_walls(|walls| walls.complete_normals(a, matrix, normals))?;
            a.normalise(matrix, normals, &state.pool)?;
            normals.moments = own;
            Ok(())
        })
    }

    pub(super) fn complete_walls(&mut self, plan: &Plan) -> Result<bool> {
        self.change_weights(plan, |state, _, Weights { matrix, .. }| state.at_walls(|walls| walls.complete(matrix)))
    }

    /// What an operator of two sweeps holds beside the weights of pairs.
    pub(super) fn make_sweeps(&mut self, plan: &Plan) -> Result<bool> {
        self.change_weights(plan, |state, a, weights| {
            weights.twice = Some(state.twice(a)?);
            Ok(())
        })
    }

    /// Weights that are made are those of a step, if they are numbers and volumes fit distances.
    pub(super) fn trust_weights(&mut self, plan: &Plan) -> Result<bool> {
        self.change_weights(plan, |state, _, weights| {
            if let Some(i) = weights.matrix.first_bad(&state.pool) {
                return Err(state.odd_volume(weights.matrix.columns(i)));
            }
            let Some(Normals { moments, paired, defect, .. }) = weights.normals.take() else { return Ok(()) };
            (weights.moments, weights.paired, weights.defect) = (moments, paired.contains(&true), defect);
            state.refuse_wrong_volumes(&weights.matrix, &weights.moments)?;
            state.refuse_what_is_not_seen(&weights.matrix)
        })
    }

    /// What is wrong with a row of weights that are no numbers: the volume farthest from the others.
    fn odd_volume(&self, row: &[u32]) -> Error {
        let volume = |i: u32| self.geometry.as_ref().map_or(1.0, |g| g.volume[i as usize]);
        let mean = row.iter().map(|&i| volume(i).ln()).sum::<f64>() / row.len().max(1) as f64;
        let far = |i: u32| (volume(i).ln() - mean).abs();
        let i = row.iter().copied().max_by(|&a, &b| far(a).total_cmp(&far(b))).unwrap_or(0);
        let rule =
            "a volume m/rho so far from those around it makes weights that are no numbers: check m, rho and h there";
        Error::bad_at("rho", self.host(i as usize), format!("for a volume of {:e}", volume(i)), rule)
    }

    /// Calls `change` with weights that are being made; they are given up where it fails.
    fn change_weights(
        &mut self,
        plan: &Plan,
        change: impl FnOnce(&State, &Assembly, &mut Weights) -> Result<()>,
    ) -> Result<bool> {
        let Some(mut weights) = self.weights.take_if(|w| w.normals.is_some()) else { return Ok(false) };
        self.with_assembly(plan.leaves_out(&rules::SAME_H), |a| change(self, a, &mut weights))?;
        self.weights = Some(weights);
        Ok(true)
    }

    /// Refuses particles whose volumes have nothing to do with their distances: nothing, or far too much, would flow
    /// between most of them. Few particles are no sample, and some may be anywhere.
    fn refuse_wrong_volumes(&self, matrix: &Matrix, moments: &[f64]) -> Result<()> {
        let n = moments.len();
        if n < SAMPLED || self.choices.allow.volumes {
            return Ok(());
        }
        let mut sorted = memory::copied("second moments", moments)?;
        let median = *sorted.select_nth_unstable_by(n / 2, f64::total_cmp).1;
        if PLAUSIBLE.contains(&median) {
            return Ok(());
        }
        let typical = (0..n).filter(|&i| moments[i] == median).map(|i| (self.host(i), i)).min();
        let (host, i) = typical.unwrap_or((0, 0));
        let rule = format!(
            "half of the particles are at or beyond this one, which has {} neighbours: m/rho should be the volume that a \
             particle has, and K_d2 is then near 1; check m, rho and their units, give h or a larger h_fac, or insist \
             with allow=volumes",
            matrix.neighbours(i)
        );
        Err(Error::bad_at("K_d2", host, format!("{median:.3e}"), &rule))
    }

    /// Calls `work` where some particles are walls.
    fn at_walls(&self, work: impl FnOnce(&Walls<&(dyn Fn(usize) -> bool + Sync + Send)>) -> Result<()>) -> Result<()> {
        if !self.has_walls() {
            return Ok(());
        }
        let (fixed, pool) = (&self.inputs[fields::FIXED], &self.pool);
        let fixed = |i: usize| fixed.at(i).is_some_and(|f| f != 0.0);
        let volume = self.geometry.as_ref().map_or(&[][..], |g| &g.volume);
        self.with_rows(|rows| work(&Walls { rows, volume, fixed: &fixed, pool }))
    }

    fn twice(&self, assembly: &Assembly) -> Result<Twice> {
        let (mass, choices) = (self.each(fields::M)?, &self.choices);
        let low = match choices.operator.sweeps {
            Sweeps::Two { limited: true } => Some(self.monotone_weights(assembly)?),
            _ => None,
        };
        let plain = if choices.corrected { None } else { Some(self.inverse_density(&mass)?) };
        let recipe = Recipe { mass: &mass, plain: plain.as_deref(), theta: choices.theta, low };
        Twice::store(assembly, recipe, &self.pool)
    }

    /// The operator `monotone` on these particles, whatever the one that was chosen.
    fn monotone_weights(&self, assembly: &Assembly) -> Result<Matrix> {
        let operator = table::find("monotone")?;
        let (matrix, _) = Assembly { operator, normalise: operator.normalise, ..*assembly }.store(&self.pool)?;
        Ok(matrix)
    }

    /// 1/(Omega rho)
    fn inverse_density(&self, mass: &[f64]) -> Result<Vec<f64>> {
        let omega = self.with_rows(|rows| density::omega(&self.choices.kernel, rows, mass, &self.pool))?;
        let rho = self.geometry.as_ref().map_or(&[][..], |g| &g.rho);
        memory::collected("densities", omega.iter().zip(rho).map(|(omega, rho)| 1.0 / (omega * rho)))
    }

    pub(super) fn fold_kappa(&mut self, _: &Plan) -> Result<bool> {
        if self.weights.as_ref().is_none_or(|w| w.folded) {
            return Ok(false);
        }
        let (kappa, mean) = (self.each_kappa()?, self.mean());
        if let Some(weights) = &mut self.weights {
            let kappa = &kappa[..];
            weights.matrix.scale(&self.pool, move |a, b| mean.of(kappa[a], kappa[b]));
            weights.folded = true;
        }
        Ok(true)
    }
}
