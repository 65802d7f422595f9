//! What the passes of set-up do: each makes something that stages need, where it is missing.

use super::motion::Motion;
use super::passes::{self, Pass};
use super::state::{Directions, Geometry, Input, State, Weights, least};
use super::{Choices, Plan, rules};
use crate::error::{Error, Result};
use crate::integrator::Range;
use crate::memory;
use crate::model::fields::{self, FIELDS, INPUTS, Slot};
use crate::model::heat::{Conductivity, Heat, Power, Release};
use crate::model::surface::{Exchange, Surface};
use crate::model::tensor::Tensor;
use crate::operator::normalise::Normals;
use crate::operator::table::{self, Fit, OPERATORS, Sweeps};
use crate::operator::twice::Recipe;
use crate::operator::walls::Walls;
use crate::operator::{Assembly, Engine, Matrix, Multigrid, Sym, Twice, bypass, tensor};
use crate::space::{density, rows::Rows};
use std::borrow::Cow;

/// How much thinner than wide a cloud is that has no thickness but rounding's.
const FLAT: f64 = 1e-12;

/// One block in this many is looked at to estimate the number of neighbours.
const SAMPLE: usize = 16;

/// Fewest particles of which the median K_d2 says anything.
const SAMPLED: usize = 10;
/// What it may be: lattices have 0.8 to 1.2, lines in 3-D 0.3; without neighbours it is 0.
const PLAUSIBLE: std::ops::RangeInclusive<f64> = 0.1..=10.0;

impl State {
    /// The plan of the scene as it stands.
    ///
    /// # Errors
    /// As [`State::prepare_geometry`].
    pub fn plan(&mut self) -> Result<Plan> {
        self.refuse_lost("plan", 0..INPUTS)?;
        self.prepare_geometry("plan")?;
        self.prepare_directions("plan")?;
        self.look_for_thin_layers()?;
        Ok(Plan::new(&self.choices, &self.facts()))
    }

    /// Everything that a right-hand side needs.
    ///
    /// # Errors
    /// `OutOfOrder` naming what is missing, `BoxTooSmall`, `NoMemory`, `BadElement` naming a particle.
    pub fn prepare(&mut self, call: &str) -> Result<Plan> {
        if self.geometry.is_none() {
            self.refuse_weights_without_room(self.fewest_neighbours())?;
        }
        let plan = self.prepare_fresh(call)?;
        self.make(&plan, |_| true)?;
        Ok(plan)
    }

    /// Runs the passes of the plan that make something.
    fn make(&mut self, plan: &Plan, wanted: impl Fn(&Pass) -> bool) -> Result<()> {
        for pass in plan.passes.iter().map(|line| line.pass).filter(|pass| wanted(pass)) {
            let start = std::time::Instant::now();
            if pass.make.map_or(Ok(false), |make| make(self, plan))? {
                self.timers.add(pass.name, start.elapsed());
            }
        }
        Ok(())
    }

    /// The same without stored weights: enough for one application.
    ///
    /// # Errors
    /// As [`State::prepare`].
    pub fn prepare_fresh(&mut self, call: &str) -> Result<Plan> {
        self.cloud(call)?;
        self.refuse_lost(call, 0..INPUTS)?;
        for slot in [fields::T, fields::M] {
            self.need(slot, call)?;
        }
        if !self.kappa_of_t() && !self.has_tensor() {
            self.need(fields::KAPPA, call)?;
        }
        let plan = self.plan()?;
        self.prepare_capacity()?;
        self.prepare_surface(&plan)?;
        Ok(plan)
    }

    fn need(&self, slot: Slot, call: &str) -> Result<()> {
        let set = self.inputs[slot] != Input::Unset || self.is_empty();
        let missing = || format!("{} ({})", FIELDS[slot].name, FIELDS[slot].about);
        if set { Ok(()) } else { Err(Error::OutOfOrder { call: call.into(), missing: missing() }) }
    }

    /// The tensor conductivity, where the host has given one, and whether the operator can take it.
    fn prepare_directions(&mut self, call: &str) -> Result<()> {
        if self.directions.is_some() || !self.has_tensor() {
            return Ok(());
        }
        let (n, dim, choices) = (self.cloud(call)?.len(), self.dim(), &self.choices);
        let set = |slot: Slot| self.inputs[slot] != Input::Unset;
        let at = |slot: Slot, i: usize| self.inputs[slot].at(i).unwrap_or(0.0);
        let Some(tensor) = Tensor::read(n, dim, set, at, |i| self.host(i))? else { return Ok(()) };
        let isotropic = tensor.is_isotropic(dim);
        match choices.operator.fit {
            _ if !isotropic && !choices.operator.takes_tensors => {
                let able = OPERATORS.iter().filter(|o| o.takes_tensors).map(|o| o.name);
                let rule = format!("it takes no tensor kappa; use {}", able.collect::<Vec<_>>().join(", "));
                return Err(Error::bad("operator", choices.operator.name, &rule));
            }
            Fit::Angle(_) if !choices.allow.unstable => {
                if let Some(i) = tensor.beyond_espanol_revenga(dim) {
                    let value = format!("{:?} times {}", tensor.shape[i], tensor.kappa[i]);
                    let rule = "more anisotropic than kappa_par = 3 kappa_perp, so weights of pairs across b are negative \
                                and modes may grow: use operator=limited, two-first or monotone, or insist with \
                                allow=unstable";
                    return Err(Error::bad_at("kappa", self.host(i), value, rule));
                }
            }
            _ => {}
        }
        let shape = if isotropic { Vec::new() } else { tensor.shape };
        self.directions = Some(Directions { kappa: Input::compressed(tensor.kappa), shape });
        Ok(())
    }

    /// Smoothing lengths, densities and volumes, given or computed, on cells that fit them: the same bits for the same
    /// particles, whatever was asked before.
    pub fn prepare_geometry(&mut self, call: &str) -> Result<()> {
        self.settle_ties()?;
        if self.geometry.is_some() {
            return Ok(());
        }
        self.cloud(call)?;
        self.refuse_lost(call, [fields::M, fields::RHO, fields::H])?;
        self.need(fields::M, call)?;
        // Along axes that are not periodic, whatever the reach.
        self.refuse_flat(f64::INFINITY)?;
        let start = std::time::Instant::now();
        if self.inputs[fields::H] == Input::Unset && self.inputs[fields::RHO] == Input::Unset {
            let h = self.find_lengths(call)?;
            self.inputs[fields::H] = Input::Each(h);
            let made = self.make_geometry(call, true);
            self.inputs[fields::H] = Input::Unset;
            self.geometry = Some(made?);
            self.timers.add(passes::DENSITY.name, start.elapsed());
        } else {
            self.geometry = Some(self.make_geometry(call, false)?);
            self.timers.add(passes::SORT.name, start.elapsed());
        }
        Ok(())
    }

    /// h together with rho, from the lengths found last where there are any.
    fn find_lengths(&mut self, call: &str) -> Result<Vec<f64>> {
        // The search for h reaches as far as it may be expected to be; what is found decides on the order that stays.
        let reach = self.reach(&self.domain, self.len(), |axis| self.extent(axis));
        self.sort_for(reach)?;
        let start = match self.last_h.len() == self.len() {
            true => memory::collected("h", self.cloud(call)?.host.iter().map(|&host| self.last_h[host as usize]))?,
            false => self.guessed_lengths(call)?,
        };
        let m = self.each(fields::M)?;
        let cloud = self.cloud(call)?;
        let h = density::smoothing_lengths(&self.choices.kernel, self.choices.h_fac, cloud, &m, start, &self.pool)?;
        let mut by_host = memory::filled("h", cloud.len(), 0.0)?;
        cloud.host.iter().zip(&h).for_each(|(&host, &h)| by_host[host as usize] = h);
        self.found_h = by_host;
        Ok(h)
    }

    /// A first guess of h, from cells that are not crowded by far: where one particle far away made them too long, from
    /// shorter ones.
    fn guessed_lengths(&mut self, call: &str) -> Result<Vec<f64>> {
        loop {
            let h = density::guess(self.cloud(call)?, self.choices.h_fac, &self.pool)?;
            let (reach, before) = (self.choices.kernel.radius() * least(&h), self.cloud(call)?.grid.edge);
            if !self.cloud(call)?.is_coarse_for(reach) {
                return Ok(h);
            }
            self.sort_again(reach)?;
            if self.cloud(call)?.grid.edge >= before {
                return density::guess(self.cloud(call)?, self.choices.h_fac, &self.pool);
            }
        }
    }

    /// `found`: h was found together with rho, and tells it.
    fn make_geometry(&mut self, call: &str, found: bool) -> Result<Geometry> {
        let (nu, radius) = (self.dim() as f64, self.choices.kernel.radius());
        let mut h = self.lengths(nu)?;
        let reach = radius * h.iter().copied().fold(0.0, f64::max);
        self.refuse_flat(reach)?;
        let shortest = radius * least(&h);
        if !self.cloud(call)?.suits(shortest) {
            self.sort_for(shortest)?;
            h = self.lengths(nu)?;
        }
        let m = self.each(fields::M)?;
        let cloud = self.cloud(call)?;
        let rows = Rows::new(cloud, &h, radius, &self.pool)?;
        let rho = match &self.inputs[fields::RHO] {
            Input::Unset if found => {
                let rho = |(m, h): (&f64, &f64)| m * (self.choices.h_fac / h).powf(nu);
                memory::collected("rho", m.iter().zip(&h).map(rho))?
            }
            Input::Unset => density::sum(&self.choices.kernel, &rows, &m, &self.pool)?,
            _ => self.each(fields::RHO)?,
        };
        let (same_h, neighbours) = (rows.same_h(), rows.mean_neighbours(&self.pool, SAMPLE)?);
        let volume = memory::collected("volumes", m.iter().zip(&rho).map(|(m, rho)| m / rho))?;
        Ok(Geometry { h, rho, volume, same_h, neighbours })
    }

    /// Refuses particles that leave an axis of their space empty: sums over neighbours would take a disc for a ball.
    /// Where the axis is periodic and images of the particles are among the neighbours, it is not empty.
    fn refuse_flat(&self, reach: f64) -> Result<()> {
        let thick = self.needs_thickness() && reach.is_finite();
        let Some(cloud) = self.cloud.as_ref().filter(|c| c.len() > c.dim() && (thick || !self.choices.allow.flat))
        else {
            return Ok(());
        };
        let dim = cloud.dim();
        let extents: Vec<f64> = (0..dim).map(|axis| self.extent(axis)).collect();
        let widest = extents.iter().copied().fold(0.0, f64::max);
        let imaged = |axis: usize| cloud.domain.periodic[axis] && reach >= cloud.domain.length(axis);
        let spacing = reach / (self.choices.kernel.radius() * self.choices.h_fac);
        let least = if thick { 0.5 * spacing } else { 0.0 };
        let empty: Vec<usize> = (0..dim).filter(|&a| extents[a] <= least.max(FLAT * widest) && !imaged(a)).collect();
        if empty.is_empty() || widest == 0.0 {
            return Ok(());
        }
        let axes: Vec<&str> = empty.iter().map(|&a| ["x", "y", "z"][a]).collect();
        let (axes, rest) = (axes.join(" and "), dim - empty.len());
        if thick {
            let rule = format!(
                "particles less than half a spacing thick along {axes} conduct wrong with it: use operator=brookshaw, kernel or \
                 projected, or fewer dimensions"
            );
            return Err(Error::bad("operator", self.choices.operator.name, &rule));
        }
        let value = format!("flat along {axes}: all {} particles have the same", cloud.len());
        let rule = format!(
            "particles that fill {rest} of {dim} dimensions need dim={rest} and their other coordinates alone; a sheet or a \
             row of one layer in {dim}-D space is had by insisting with allow=flat"
        );
        Err(Error::bad("x", value, &rule))
    }

    /// Whether the operator is wrong in sheets and strings of one layer: two gradients see noise across them, and weights
    /// that are scaled in the mean over directions conduct too well along them.
    fn needs_thickness(&self) -> bool {
        !self.choices.operator.is_one_matrix() || matches!(self.choices.operator.fit, Fit::Moments)
    }

    /// h as given, or h_fac (m/rho)^(1/nu).
    fn lengths(&self, nu: f64) -> Result<Vec<f64>> {
        if self.inputs[fields::H] != Input::Unset {
            return self.each(fields::H);
        }
        let h = |m: f64, rho: f64| self.choices.h_fac * (m / rho).powf(1.0 / nu);
        if let (Input::Number(m), Input::Number(rho)) = (&self.inputs[fields::M], &self.inputs[fields::RHO]) {
            return memory::filled("h", self.len(), h(*m, *rho));
        }
        let (m, rho) = (self.each(fields::M)?, self.each(fields::RHO)?);
        memory::collected("h", m.iter().zip(&rho).map(|(m, rho)| h(*m, *rho)))
    }

    /// An input as an array; a number is repeated.
    pub fn each(&self, slot: Slot) -> Result<Vec<f64>> {
        self.refuse_lost(FIELDS[slot].name, [slot])?;
        self.repeated(FIELDS[slot].name, &self.inputs[slot])
    }

    fn repeated(&self, what: &str, input: &Input) -> Result<Vec<f64>> {
        match input.view(self.len())? {
            Cow::Borrowed(v) => memory::copied(what, v),
            Cow::Owned(v) => Ok(v),
        }
    }

    /// kappa as an array; a number is repeated.
    fn each_kappa(&self) -> Result<Vec<f64>> {
        self.repeated("kappa", self.kappa())
    }

    /// Calls `work` with the rows of neighbours. Needs the geometry.
    pub fn with_rows<T>(&self, work: impl FnOnce(&Rows) -> Result<T>) -> Result<T> {
        let cloud = self.cloud("a search")?;
        let h = self.geometry.as_ref().map_or(&[][..], |g| &g.h);
        work(&Rows::new(cloud, h, self.choices.kernel.radius(), &self.pool)?)
    }

    /// Calls `work` with the assembly of the operator. Needs the geometry.
    pub fn with_assembly<T>(&self, same_h: bool, work: impl FnOnce(&Assembly) -> Result<T>) -> Result<T> {
        let volume = self.geometry.as_ref().map_or(&[][..], |g| &g.volume);
        let units = self.unit_shape()?;
        let shape = shape_of(&self.directions, &units);
        self.with_rows(|rows| work(&assembly_of(&self.choices, rows, volume, same_h, shape)))
    }

    /// Shapes of isotropic particles, where `without=isotropic` asks for them; else empty.
    fn unit_shape(&self) -> Result<Vec<Sym>> {
        let wanted = self.choices.without(&rules::ISOTROPIC);
        memory::filled("shapes", if wanted { self.len() } else { 0 }, tensor::unit(self.dim()))
    }

    /// The conductivity of each particle at its temperature, the mean over directions.
    pub fn kappa_now(&mut self) -> Result<Vec<f64>> {
        if !self.kappa_of_t() {
            self.settle_ties()?;
            self.refuse_lost("get kappa", fields::TENSOR.chain([fields::KAPPA]))?;
            self.prepare_directions("get kappa")?;
            if self.directions.is_none() {
                self.need(fields::KAPPA, "get kappa")?;
            }
            return self.each_kappa();
        }
        let plan = self.prepare("get kappa")?;
        let (t, time) = (self.each(fields::T)?, self.time);
        self.with_motion(&plan, |motion| memory::copied("kappa", motion.heat.kappa_of_t(time, &t)?))
    }

    /// Counts the particles that pairs of better conductors reach over.
    fn look_for_thin_layers(&mut self) -> Result<()> {
        if self.bypassed.is_some() {
            return Ok(());
        }
        self.bypassed = Some(match self.kappa() {
            Input::Each(kappa) if !self.kappa_of_t() => {
                self.with_rows(|rows| bypass::count(rows, |i| kappa[i], &self.pool))?
            }
            _ => (0, 0),
        });
        Ok(())
    }

    /// Rows of weights, each by itself.
    pub(super) fn make_weights(&mut self, plan: &Plan) -> Result<bool> {
        if self.weights.is_some() {
            return Ok(false);
        }
        self.refuse_weights_without_room(self.geometry.as_ref().map_or(0.0, |g| g.neighbours))?;
        let (matrix, normals) = self.with_assembly(plan.leaves_out(&rules::SAME_H), |a| a.rows(&self.pool))?;
        let moments = Vec::new();
        let normals = Some(normals);
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
        self.change_weights(plan, |state, a, Weights { matrix, normals, moments, .. }| {
            let Some(normals) = normals else { return Ok(()) };
            *moments = memory::copied("second moments", &normals.moments)?;
            state.at_walls(|walls| walls.complete_normals(a, matrix, normals))?;
            a.normalise(matrix, normals, &state.pool)
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
            if weights.moments.is_empty() {
                weights.moments = moments;
            }
            (weights.paired, weights.defect) = (paired.contains(&true), defect);
            state.refuse_wrong_volumes(&weights.matrix, &weights.moments)
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

    /// Weights as they are before kappa is folded into them.
    pub fn prepare_unfolded(&mut self, call: &str) -> Result<&Weights> {
        let plan = self.prepare_fresh(call)?;
        self.weights = self.weights.take().filter(|w| !w.folded);
        self.make(&plan, |pass| *pass != passes::FOLD)?;
        self.weights.as_ref().ok_or(Error::OutOfOrder { call: call.into(), missing: "set_particles".into() })
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
            weights.matrix.scale(&self.pool, |a, b| mean.of(kappa[a], kappa[b]));
            weights.folded = true;
        }
        Ok(true)
    }

    fn prepare_capacity(&mut self) -> Result<()> {
        if self.inverse_capacity.is_some() {
            return Ok(());
        }
        let (m, c_v, fixed) = (&self.inputs[fields::M], &self.inputs[fields::C_V], &self.inputs[fields::FIXED]);
        let inverse = |i: usize| match (m.at(i), c_v.at(i), fixed.at(i)) {
            (Some(m), Some(c_v), Some(0.0)) => 1.0 / (m * c_v),
            _ => 0.0,
        };
        let inverse = memory::collected("capacities", (0..self.len()).map(inverse))?;
        let moves = |i: usize| fixed.at(i) == Some(0.0);
        let bad = (0..inverse.len()).find(|&i| moves(i) && !(inverse[i] > 0.0 && inverse[i].is_finite()));
        if let (Some(i), Some(m), Some(c_v)) = (bad, bad.and_then(|i| m.at(i)), bad.and_then(|i| c_v.at(i))) {
            let rule = format!("its product with m = {m:e} is beyond all numbers: choose other units");
            return Err(Error::bad_at("c_v", self.host(i), format!("{c_v:e}"), &rule));
        }
        self.inverse_capacity = Some(inverse);
        Ok(())
    }

    fn prepare_surface(&mut self, plan: &Plan) -> Result<()> {
        if plan.leaves_out(&rules::NO_WALL) {
            self.surface = None;
        }
        if plan.leaves_out(&rules::NO_WALL) || self.surface.is_some() {
            return Ok(());
        }
        let value = |slot: Slot, i: usize| self.inputs[slot].at(i).unwrap_or(0.0);
        for i in (0..self.len()).filter(|&i| value(fields::EMISSIVITY, i) > 0.0) {
            if let Some(slot) = [fields::T, fields::T_AMBIENT].into_iter().find(|&slot| value(slot, i) < 0.0) {
                let rule = "radiation needs absolute temperatures; set emissivity = 0 or temperatures in kelvin";
                return Err(Error::bad_at(FIELDS[slot].name, self.host(i), value(slot, i), rule));
            }
        }
        let flows = |i: usize| {
            [fields::FLUX_IN, fields::H_CONV, fields::EMISSIVITY].into_iter().any(|slot| value(slot, i) != 0.0)
        };
        let areas = self.areas(flows)?;
        if let Some(i) = (0..self.len()).find(|&i| flows(i))
            && areas.iter().all(|&area| area == 0.0)
        {
            let rule = "no particle that exchanges heat with the outside faces it: exchange at a surface, or give area";
            return Err(Error::bad_at("area", self.host(i), 0.0, rule));
        }
        let kappa = |i: usize| self.kappa().at(i).unwrap_or(0.0);
        let exchange = |i: usize| Exchange {
            area: areas[i],
            depth: self.depth(i),
            flux_in: value(fields::FLUX_IN, i),
            h_conv: value(fields::H_CONV, i),
            emissivity: value(fields::EMISSIVITY, i),
            t_ambient: value(fields::T_AMBIENT, i),
        };
        let every = self.choices.without(&rules::NO_WALL);
        self.surface = Some(Surface::new(self.len(), self.sigma_sb, every, kappa, exchange)?);
        Ok(())
    }

    /// Calls `work` with the right-hand side and what it takes to move it. Needs [`State::prepare`].
    pub fn with_motion<T>(&mut self, plan: &Plan, work: impl FnOnce(&mut Motion) -> Result<T>) -> Result<T> {
        let n = self.len();
        let units = self.unit_shape()?;
        let (stiff, mean) = (self.preconditioning().stiff, self.mean());
        let uniform = plan.leaves_out(&rules::UNIFORM_KAPPA);
        let mut evaluated = memory::filled("kappa", if self.kappa_of_t() { n } else { 0 }, 0.0)?;
        let mut released = memory::filled("source", if self.source_host.is_some() { n } else { 0 }, 0.0)?;
        let (Some(g), Some(cloud), Some(inverse_capacity)) = (&self.geometry, &self.cloud, &self.inverse_capacity)
        else {
            return Err(Error::OutOfOrder { call: "rate".into(), missing: "set_particles".into() });
        };
        let each = |slot: Slot, wanted: bool| self.inputs[slot].view(if wanted { n } else { 0 });
        let folded = self.weights.as_ref().is_some_and(|w| w.folded);
        let by_pair = !uniform && self.law.is_none() && self.kappa_host.is_none() && !folded;
        let kappa_given = self.directions.as_ref().map_or(&self.inputs[fields::KAPPA], |d| &d.kappa);
        let kappa = kappa_given.view(if by_pair { n } else { 0 })?;
        let source = each(fields::SOURCE, !plan.leaves_out(&rules::NO_SOURCE))?;
        let conductivity = match (&mut self.kappa_host, &self.law, kappa_given) {
            (Some(host), ..) => Conductivity::Host(host, &mut evaluated),
            (None, Some(law), _) => Conductivity::Law(law, &mut evaluated),
            (None, None, Input::Number(k)) if uniform => Conductivity::Number(*k),
            _ if folded => Conductivity::Folded,
            _ => Conductivity::Field(&kappa),
        };
        let release = match &mut self.source_host {
            Some(host) => Release::Host(host, &mut released),
            None if plan.leaves_out(&rules::NO_SOURCE) => Release::None,
            None => Release::Field(&source),
        };
        let (rows, assembly);
        let engine = match &self.weights {
            Some(Weights { matrix, twice: Some(twice), .. }) => Engine::Twice(twice, matrix),
            Some(weights) => Engine::Stored(&weights.matrix),
            None => {
                rows = Rows::new(cloud, &g.h, self.choices.kernel.radius(), &self.pool)?;
                let (same_h, shape) = (plan.leaves_out(&rules::SAME_H), shape_of(&self.directions, &units));
                assembly = assembly_of(&self.choices, &rows, &g.volume, same_h, shape);
                Engine::Fresh(&assembly)
            }
        };
        let mut heat = Heat {
            pool: &self.pool,
            engine,
            mean,
            inverse_capacity,
            conductivity,
            surface: self.surface.as_ref(),
            release,
            volume: &g.volume,
            host: &cloud.host,
            quiet: plan.leaves_out(&rules::QUIET_ROWS),
            slopes: Vec::new(),
            parts: &mut self.parts,
            multigrid: Some(&mut self.multigrid),
            stiff,
            applications: 0,
            power: Power::default(),
        };
        if let Release::Field(source) = heat.release {
            heat.power.source = heat.power_of(source);
        }
        if !(plan.leaves_out(&rules::KEEP_MATRIX) && heat.operator_is_fixed()) {
            heat.multigrid.iter_mut().for_each(|m| **m = Multigrid::default());
        }
        let mut motion = Motion {
            heat,
            pool: &self.pool,
            choices: &self.choices,
            plan,
            work: &mut self.work,
            progress: &mut self.progress,
            timers: &mut self.timers,
            known: &mut self.bounds,
            range: Range::FINITE,
        };
        let result = work(&mut motion);
        self.applications += motion.heat.applications;
        result
    }
}

fn assembly_of<'a>(
    choices: &'a Choices,
    rows: &'a Rows,
    volume: &'a [f64],
    same_h: bool,
    shape: Option<&'a [Sym]>,
) -> Assembly<'a> {
    Assembly {
        operator: choices.operator,
        normalise: choices.normalise,
        kernel: &choices.kernel,
        rows,
        volume,
        same_h,
        order: choices.order,
        any_row: choices.allow.unstable,
        shape,
    }
}

/// The shapes of particles that are not isotropic, or those that are to be used all the same.
fn shape_of<'a>(directions: &'a Option<Directions>, units: &'a [Sym]) -> Option<&'a [Sym]> {
    let own = directions.as_ref().map_or(&[][..], |d| &d.shape);
    [own, units].into_iter().find(|s| !s.is_empty())
}
