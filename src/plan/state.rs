//! Everything that a solver holds: what the host handed over, and what was derived from it, each derived thing present
//! or absent. A setter drops what it invalidates; `prepare` makes what is missing.

use super::choices::Promise;
use super::motion::Known;
use super::preconditioner::Preconditioning;
use super::report::Timers;
use super::{Choices, Facts, rules};
use crate::array::Strided;
use crate::error::{Error, Result};
use crate::integrator::{Range, Work};
use crate::memory;
use crate::model::conductivity::Law;
use crate::model::fields::{self, Access, FIELDS, INPUTS, Slot};
use crate::model::heat::Callback;
use crate::model::surface::Surface;
use crate::operator::table::Tensor;
use crate::operator::{Matrix, Mean, Multigrid, Normalise, Sym, Twice};
use crate::pool::Pool;
use crate::space::{Cloud, Domain, facing};
use std::borrow::Cow;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// An input: one number for all, or one per particle in internal order.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Input {
    #[default]
    Unset,
    Number(f64),
    Each(Vec<f64>),
}

impl Input {
    fn default_of(slot: Slot) -> Input {
        match FIELDS[slot].access {
            Access::Input { default: Some(v), .. } => Input::Number(v),
            _ => Input::Unset,
        }
    }

    pub fn at(&self, i: usize) -> Option<f64> {
        match self {
            Input::Unset => None,
            Input::Number(v) => Some(*v),
            Input::Each(v) => v.get(i).copied(),
        }
    }

    /// As an array of n; one that is held is borrowed, a number is repeated.
    pub fn view(&self, n: usize) -> Result<Cow<'_, [f64]>> {
        match self {
            Input::Each(v) => Ok(Cow::Borrowed(v)),
            Input::Number(v) => Ok(Cow::Owned(memory::filled("particle data", n, *v)?)),
            Input::Unset => Ok(Cow::Owned(memory::filled("particle data", n, 0.0)?)),
        }
    }

    /// One number where all values are the same.
    pub fn compressed(values: Vec<f64>) -> Input {
        match values.first() {
            Some(&first) if values.iter().all(|&v| v == first) => Input::Number(first),
            _ => Input::Each(values),
        }
    }

    fn bytes(&self) -> u64 {
        if let Input::Each(v) = self { memory::bytes(v) } else { 0 }
    }
}

/// What follows from positions, masses, densities and smoothing lengths; internal order.
pub struct Geometry {
    pub h: Vec<f64>,
    pub rho: Vec<f64>,
    pub volume: Vec<f64>,
    pub same_h: bool,
    /// Mean number of neighbours, from a sample.
    pub neighbours: f64,
}

/// A tensor conductivity, as a number and a shape for each particle in internal order.
pub struct Directions {
    pub kappa: Input,
    /// Empty where all particles are isotropic.
    pub shape: Vec<Sym>,
}

/// The stored operator.
pub struct Weights {
    pub matrix: Matrix,
    /// What operators of two sweeps hold beside the weights of pairs.
    pub twice: Option<Twice>,
    /// K_a before normalisation.
    pub moments: Vec<f64>,
    /// How wrong projected weights still conduct, root mean square.
    pub defect: Option<f64>,
    /// The averages of kappa are in the coefficients.
    pub folded: bool,
}

/// What an operator that does not conserve has done.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Made {
    pub energy: f64,
    pub levelled: f64,
}

impl Made {
    /// Relative to what there was to level out.
    pub fn share(self) -> f64 {
        if self.levelled > 0.0 { self.energy.abs() / self.levelled } else { 0.0 }
    }
}

/// Called between sub-steps with the time reached and the share of the step done; not 0 cancels.
pub type Progress = Box<dyn FnMut(f64, f64) -> i32 + Send>;

pub struct State {
    pub choices: Choices,
    pub pool: Pool,
    pub domain: Domain,
    pub time: f64,
    pub sigma_sb: f64,
    pub cloud: Option<Cloud>,
    pub inputs: [Input; INPUTS],
    pub law: Option<Law>,
    pub kappa_host: Option<Callback>,
    pub source_host: Option<Callback>,
    pub progress: Option<Progress>,
    pub cancel: Arc<AtomicBool>,

    /// Made from the inputs of a tensor, where there are any.
    pub directions: Option<Directions>,
    pub geometry: Option<Geometry>,
    /// The smoothing lengths found last, in the host's order: where particles move a little, the next are near.
    pub last_h: Vec<f64>,
    /// For which reach positions were sorted when they were set.
    first_reach: f64,
    pub weights: Option<Weights>,
    pub inverse_capacity: Option<Vec<f64>>,
    pub surface: Option<Surface>,
    pub bounds: Option<Known>,
    /// Particles beside ones that conduct much better, and those of them that pairs reach over.
    pub bypassed: Option<(usize, usize)>,
    /// Between what temperatures the host has set T, until it sets something else; none before a step.
    pub span: Option<Range>,
    /// Which particles exchange with which; none where nobody has asked.
    pub parts: Option<Vec<u32>>,
    /// The preconditioner of implicit steps; empty where it is not needed or was not yet.
    pub multigrid: Multigrid,

    /// Energy that steps have made where nothing heats or cools, and the largest Σ m c_v |T − mean|, since T was set.
    pub made: Made,

    /// Steps taken and rates asked for, and whether particles or kappa changed after the first.
    pub steps: u64,
    pub rates: u64,
    pub moves: bool,
    pub kappa_changes: bool,
    pub timers: Timers,
    pub work: Work,
    pub applications: u64,
}

impl State {
    pub fn new(choices: Choices) -> Result<State> {
        Ok(State {
            pool: Pool::new(choices.threads)?,
            domain: Domain::open(choices.kernel.dim()),
            time: 0.0,
            sigma_sb: fields::SIGMA_SB,
            cloud: None,
            inputs: std::array::from_fn(Input::default_of),
            law: None,
            kappa_host: None,
            source_host: None,
            progress: None,
            cancel: Arc::default(),
            directions: None,
            geometry: None,
            last_h: Vec::new(),
            first_reach: 0.0,
            weights: None,
            inverse_capacity: None,
            surface: None,
            bounds: None,
            bypassed: None,
            span: None,
            parts: None,
            multigrid: Multigrid::default(),
            made: Made::default(),
            steps: 0,
            rates: 0,
            moves: false,
            kappa_changes: false,
            timers: Timers::default(),
            work: Work::default(),
            applications: 0,
            choices,
        })
    }

    pub fn len(&self) -> usize {
        self.cloud.as_ref().map_or(0, Cloud::len)
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub fn dim(&self) -> usize {
        self.domain.dim
    }

    /// The cloud, or the error that says what to call first.
    pub fn cloud(&self, call: &str) -> Result<&Cloud> {
        self.cloud.as_ref().ok_or_else(|| Error::OutOfOrder { call: call.into(), missing: "set_particles".into() })
    }

    /// Takes a new box; particles already here are wrapped into it.
    pub fn set_box(&mut self, domain: Domain) -> Result<()> {
        if domain == self.domain {
            return Ok(());
        }
        let old = std::mem::replace(&mut self.domain, domain);
        let moved = if self.cloud.is_some() { self.sort_again(0.0) } else { Ok(()) };
        if moved.is_err() {
            self.domain = old;
            return moved;
        }
        self.first_reach = 0.0;
        self.drop_geometry();
        Ok(())
    }

    /// Takes positions. Other quantities stay with their particles; they are dropped where the number changes.
    pub fn set_positions(&mut self, x: Strided) -> Result<()> {
        if self.cloud.as_ref().is_some_and(|c| c.domain == self.domain && c.is_at(x, &self.pool)) {
            return Ok(());
        }
        let reach = self.reach(x);
        let cloud = Cloud::sort(&self.domain, x, reach, &self.pool)?;
        self.place(cloud)?;
        self.first_reach = reach;
        self.drop_geometry();
        Ok(())
    }

    /// Sorts again for a search that reaches this far.
    pub fn sort_again(&mut self, reach: f64) -> Result<()> {
        let Some(cloud) = &self.cloud else { return Ok(()) };
        let (n, dim) = (cloud.len(), cloud.dim());
        let mut x = memory::filled("positions", n * dim, 0.0)?;
        for (i, &host) in cloud.host.iter().enumerate() {
            (0..dim).for_each(|a| x[host as usize * dim + a] = cloud.x[a][i]);
        }
        let x = Strided::new("x", &x, n, dim, dim)?;
        let cloud = Cloud::sort(&self.domain, x, reach, &self.pool)?;
        self.place(cloud)
    }

    /// Puts a newly sorted cloud in place and carries the inputs over to its order.
    fn place(&mut self, cloud: Cloud) -> Result<()> {
        let n = cloud.len();
        if let Some(old) = self.cloud.as_ref().filter(|old| old.len() == n) {
            let mut was = memory::filled("order", n, 0u32)?;
            old.host.iter().enumerate().for_each(|(i, &host)| was[host as usize] = i as u32);
            let mut moved = [const { None }; INPUTS];
            for (input, moved) in self.inputs.iter().zip(&mut moved) {
                if let Input::Each(v) = input {
                    let values = cloud.host.iter().map(|&host| v[was[host as usize] as usize]);
                    *moved = Some(Input::Each(memory::collected("particle data", values)?));
                }
            }
            for (input, moved) in self.inputs.iter_mut().zip(moved) {
                if let Some(moved) = moved {
                    *input = moved;
                }
            }
        } else {
            for (slot, input) in self.inputs.iter_mut().enumerate().filter(|(_, i)| matches!(i, Input::Each(_))) {
                *input = Input::default_of(slot);
            }
        }
        self.cloud = Some(cloud);
        (self.inverse_capacity, self.surface, self.directions) = (None, None, None);
        Ok(())
    }

    /// How far a search will reach, as far as that is known before density is.
    fn reach(&self, x: Strided) -> f64 {
        let radius = self.choices.kernel.radius();
        if let Some(g) = &self.geometry {
            return radius * g.h.iter().copied().fold(0.0, f64::max);
        }
        let mut volume = 1.0;
        for axis in 0..self.dim() {
            let range =
                (0..x.len()).map(|i| x.at(i, axis)).fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
            volume *= if self.domain.periodic[axis] { self.domain.length(axis) } else { (range.1 - range.0).max(0.0) };
        }
        radius * self.choices.h_fac * (volume / x.len().max(1) as f64).powf(1.0 / self.dim() as f64)
    }

    /// Stores an input and drops what depended on its old value.
    pub fn put(&mut self, slot: Slot, input: Input) {
        if self.inputs[slot] == input {
            return;
        }
        if slot == fields::KAPPA {
            fields::TENSOR.for_each(|slot| self.inputs[slot] = Input::Unset);
        }
        if fields::TENSOR.contains(&slot) {
            self.inputs[fields::KAPPA] = Input::Unset;
        }
        (self.inputs[slot], self.span) = (input, None);
        if [fields::T, fields::M, fields::C_V].contains(&slot) {
            self.made = Made::default();
        }
        match slot {
            fields::M | fields::RHO | fields::H => self.drop_geometry(),
            fields::KAPPA if self.directions.is_none() => self.drop_kappa(),
            slot if slot == fields::KAPPA || fields::TENSOR.contains(&slot) => self.drop_directions(),
            fields::C_V | fields::FIXED => {
                self.inverse_capacity = None;
                if slot == fields::FIXED {
                    // Exchanges with walls are in the weights.
                    self.weights = None;
                }
                self.forget_operator();
            }
            fields::FLUX_IN
            | fields::H_CONV
            | fields::EMISSIVITY
            | fields::T_AMBIENT
            | fields::AREA
            | fields::DEPTH => {
                self.surface = None;
                self.forget_operator();
            }
            _ => {}
        }
    }

    /// Positions, masses, densities or smoothing lengths changed.
    pub fn drop_geometry(&mut self) {
        self.moves |= self.steps + self.rates > 0;
        self.forget_geometry();
    }

    fn forget_geometry(&mut self) {
        (self.geometry, self.weights, self.inverse_capacity) = (None, None, None);
        (self.surface, self.bypassed) = (None, None);
        self.forget_operator();
    }

    /// What a step of particles that never moved does again where `without=at_rest` asks for it: sorts, and makes all that
    /// follows, as if the same positions had just been set.
    pub fn set_anew(&mut self) -> Result<()> {
        if self.choices.without(&rules::AT_REST) && !self.moves && self.steps + self.rates > 0 {
            self.sort_again(self.first_reach)?;
            self.last_h.clear();
            self.forget_geometry();
        }
        Ok(())
    }

    /// Makes the next step look at the operator anew.
    fn forget_operator(&mut self) {
        (self.bounds, self.parts, self.multigrid) = (None, None, Multigrid::default());
    }

    /// The conductivity changed.
    pub fn drop_kappa(&mut self) {
        self.kappa_changes |= self.steps + self.rates > 0;
        (self.surface, self.bypassed) = (None, None);
        self.forget_operator();
        if self.weights.as_ref().is_some_and(|w| w.folded) {
            self.weights = None;
        }
    }

    /// The tensor changed, and with it all weights.
    fn drop_directions(&mut self) {
        (self.directions, self.weights) = (None, None);
        self.drop_kappa();
    }

    /// kappa as one number for each particle: as given, or the mean over directions.
    pub fn kappa(&self) -> &Input {
        self.directions.as_ref().map_or(&self.inputs[fields::KAPPA], |d| &d.kappa)
    }

    /// Whether the host has given a tensor.
    pub fn has_tensor(&self) -> bool {
        fields::TENSOR.into_iter().any(|slot| self.inputs[slot] != Input::Unset)
    }

    /// kappa(T) by a law or by the host's function; neither goes back to the field.
    pub fn set_kappa_of_t(&mut self, law: Option<Law>, host: Option<Callback>) {
        (self.law, self.kappa_host) = (law, host);
        self.drop_kappa();
    }

    pub fn set_sigma_sb(&mut self, value: f64) {
        self.sigma_sb = value;
        self.surface = None;
        self.forget_operator();
    }

    /// The area of each particle that faces outside: as given, or what its neighbours leave open; the latter only where
    /// it is wanted. Needs the geometry.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn areas(&self, wanted: impl Fn(usize) -> bool + Sync + Send) -> Result<Vec<f64>> {
        if self.inputs[fields::AREA] != Input::Unset {
            return self.each(fields::AREA);
        }
        let volume = self.geometry.as_ref().map_or(&[][..], |g| &g.volume);
        self.with_rows(|rows| facing::areas(&self.choices.kernel, rows, volume, wanted, &self.pool))
    }

    /// How deep a particle's centre lies below its area: as given, or half a spacing. Needs the geometry.
    pub fn depth(&self, i: usize) -> f64 {
        let half = || self.geometry.as_ref().map_or(0.0, |g| 0.5 * g.volume[i].powf(1.0 / self.dim() as f64));
        self.inputs[fields::DEPTH].at(i).unwrap_or_else(half)
    }

    /// Whether some particles have a fixed T, to which the weights of their neighbours answer.
    pub fn has_walls(&self) -> bool {
        let fixed = match &self.inputs[fields::FIXED] {
            Input::Each(v) => v.iter().any(|&f| f != 0.0),
            other => !matches!(other, Input::Number(0.0) | Input::Unset),
        };
        fixed && self.choices.operator.completes_walls()
    }

    /// kappa depends on T.
    pub fn kappa_of_t(&self) -> bool {
        self.law.is_some() || self.kappa_host.is_some()
    }

    /// Of kappa between two particles.
    pub fn mean(&self) -> Mean {
        self.choices.mean(self.kappa_of_t())
    }

    /// Whether some particle exchanges heat with the outside.
    pub fn exchanging(&self) -> usize {
        let idle = |slot: Slot| matches!(&self.inputs[slot], Input::Number(0.0) | Input::Unset);
        if [fields::FLUX_IN, fields::H_CONV, fields::EMISSIVITY].into_iter().all(idle) {
            return 0;
        }
        let flows = |i: usize| {
            [fields::FLUX_IN, fields::H_CONV, fields::EMISSIVITY]
                .iter()
                .any(|&s| self.inputs[s].at(i).unwrap_or(0.0) != 0.0)
        };
        (0..self.len()).filter(|&i| flows(i)).count()
    }

    pub fn heated(&self) -> bool {
        let cold = match &self.inputs[fields::SOURCE] {
            Input::Each(v) => v.iter().all(|&s| s == 0.0),
            other => matches!(other, Input::Number(0.0) | Input::Unset),
        };
        self.source_host.is_some() || !cold
    }

    /// Facts about the scene; needs the geometry.
    pub fn facts(&self) -> Facts {
        let choices = &self.choices;
        let (heated, exchanging) = (self.heated(), self.exchanging());
        // Espanol & Revenga's weights were checked, unless the host insists.
        let turned = matches!(choices.operator.tensor, Tensor::Angular(_)) && !choices.allow.unstable;
        let positive = choices.operator.positive || turned;
        Facts {
            n: self.len(),
            dim: self.dim(),
            neighbours: self.geometry.as_ref().map_or(0.0, |g| g.neighbours),
            same_h: self.geometry.as_ref().is_some_and(|g| g.same_h),
            finds_h: self.inputs[fields::H] == Input::Unset && self.inputs[fields::RHO] == Input::Unset,
            sums_rho: self.inputs[fields::RHO] == Input::Unset,
            moves: self.moves,
            uniform_kappa: !self.kappa_of_t() && matches!(self.kappa(), Input::Number(_)),
            kappa_of_t: self.kappa_of_t(),
            kappa_changes: self.kappa_changes,
            mean: self.mean(),
            exchanging,
            heated,
            rate_only: self.rates > 0 && self.steps == 0,
            normalised: choices.normalise != Normalise::No,
            tensor: self.directions.as_ref().is_some_and(|d| !d.shape.is_empty()),
            twice: matches!(choices.operator.tensor, Tensor::Twice { .. }),
            defect: self.weights.as_ref().and_then(|w| w.defect),
            may_grow: !positive && !choices.operator.dissipative && !choices.allow.unstable,
            joined: choices.operator.joins_rows(),
            walls: self.has_walls(),
            bypassed: self.bypassed.unwrap_or_default(),
            positive,
            keeps_bounds: choices.bounds == Promise::Kept && self.source_host.is_none(),
            operator: choices.operator.name,
            integrator: choices.method.name,
            auto: choices.auto.as_ref().map(|auto| auto.reason.clone()),
            controlled: choices.tolerance.is_some(),
            implicit: choices.method.is_implicit(),
            preconditioning: self.preconditioning(),
            buffers: self.work.bytes() as f64 / 8.0 / self.len().max(1) as f64,
        }
    }

    /// How the equations of implicit stages are preconditioned.
    pub fn preconditioning(&self) -> Preconditioning {
        let radiates = self.surface.as_ref().is_some_and(|s| !s.is_linear());
        let (choices, once) = (&self.choices, self.moves || self.kappa_of_t() || radiates);
        choices.preconditioner.settle(choices.operator.is_one_matrix(), once)
    }

    /// Bytes held for particles and weights.
    pub fn bytes(&self) -> u64 {
        let geometry = self.geometry.as_ref().map_or(0, |g| 8 * (g.h.len() + g.rho.len() + g.volume.len()) as u64);
        let weights = self
            .weights
            .as_ref()
            .map_or(0, |w| w.matrix.bytes() + memory::bytes(&w.moments) + w.twice.as_ref().map_or(0, Twice::bytes));
        let inputs: u64 = self.inputs.iter().map(Input::bytes).sum();
        let capacity = self.inverse_capacity.as_ref().map_or(0, memory::bytes);
        self.cloud.as_ref().map_or(0, Cloud::bytes)
            + geometry
            + weights
            + inputs
            + capacity
            + memory::bytes(&self.last_h)
            + self.multigrid.bytes()
            + self.work.bytes()
    }
}
