//! From what a host gave to a right-hand side that can be moved: the passes that make something are run where it is
//! missing. What they do is in [`super::geometry`] and [`super::weights`].

use super::motion::Motion;
use super::passes::{self, Pass};
use super::state::{Directions, Input, State, Weights};
use super::{Choices, Plan, rules};
use crate::error::{Error, Result};
use crate::integrator::Range;
use crate::memory;
use crate::model::fields::{self, FIELDS, INPUTS, Slot};
use crate::model::heat::{Conductivity, Heat, Power, Release};
use crate::model::surface::{Exchange, Surface};
use crate::model::tensor::Tensor;
use crate::operator::table::{Fit, OPERATORS};
use crate::operator::{Assembly, Engine, Multigrid, Sym, bypass, tensor};
use crate::space::rows::Rows;
use std::borrow::Cow;

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

    pub(super) fn need(&self, slot: Slot, call: &str) -> Result<()> {
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
    pub(super) fn each_kappa(&self) -> Result<Vec<f64>> {
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

    /// Weights as they are before kappa is folded into them.
    pub fn prepare_unfolded(&mut self, call: &str) -> Result<&Weights> {
        let plan = self.prepare_fresh(call)?;
        self.weights = self.weights.take().filter(|w| !w.folded);
        self.make(&plan, |pass| *pass != passes::FOLD)?;
        self.weights.as_ref().ok_or(Error::OutOfOrder { call: call.into(), missing: "set_particles".into() })
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
        if let Some((i, m, c_v)) = bad.and_then(|i| Some((i, m.at(i)?, c_v.at(i)?))) {
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
