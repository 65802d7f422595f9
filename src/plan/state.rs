//! Everything that a solver holds: what the host handed over, and what was derived from it, each derived thing present
//! or absent. A setter drops what it invalidates; `prepare` makes what is missing.

use super::choices::Promise;
use super::input::Energy;
pub use super::input::Input;
use super::known::Known;
use super::preconditioner::Preconditioning;
use super::report::{Progress, Timers};
use super::{Choices, Facts, rules};
use crate::error::{Error, Result};
use crate::integrator::{Range, Work};
use crate::memory;
use crate::model::conductivity::Law;
use crate::model::fields::{self, INPUTS, Slot};
use crate::model::heat::Callback;
use crate::model::surface::Surface;
use crate::operator::normalise::Normals;
use crate::operator::{Matrix, Mean, Multigrid, Normalise, Sym, Twice};
use crate::pool::Pool;
use crate::space::{Cloud, Domain, density, facing};
use crate::sum;

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
    /// What they are still to be joined and normalised by, as long as they are being made.
    pub normals: Option<Normals>,
    /// What operators of two sweeps hold beside the weights of pairs.
    pub twice: Option<Twice>,
    /// K_a before normalisation.
    pub moments: Vec<f64>,
    /// How wrong projected weights still conduct, root mean square.
    pub defect: Option<f64>,
    /// Some rows of consistent weights are normalised pairs, beside free surfaces.
    pub paired: bool,
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

pub struct State {
    pub choices: Choices,
    pub pool: Pool,
    pub domain: Domain,
    pub time: f64,
    pub sigma_sb: f64,
    pub cloud: Option<Cloud>,
    pub inputs: [Input; INPUTS],
    /// What was given per particle before their number changed, and was not given again.
    pub lost: [bool; INPUTS],
    pub energy: Energy,
    pub law: Option<Law>,
    pub kappa_host: Option<Callback>,
    pub source_host: Option<Callback>,
    pub progress: Option<Progress>,

    /// Made from the inputs of a tensor, where there are any.
    pub directions: Option<Directions>,
    pub geometry: Option<Geometry>,
    /// The smoothing lengths found at the last place where a step or a rate was done, in the host's order: where particles
    /// move a little, the next are near. Whatever fails, or is only looked at, leaves them as they are.
    pub last_h: Vec<f64>,
    /// Those found at this place, which become the last ones when it is left, if something `was_done_here`.
    pub found_h: Vec<f64>,
    pub was_done_here: bool,
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
            lost: [false; INPUTS],
            energy: Energy::default(),
            law: None,
            kappa_host: None,
            source_host: None,
            progress: None,
            directions: None,
            geometry: None,
            last_h: Vec::new(),
            found_h: Vec::new(),
            was_done_here: false,
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

    /// The shortest distance that a search will reach, as far as that is known before smoothing lengths are: the same for the same
    /// particles, whatever was asked before.
    pub fn reach(&self, domain: &Domain, n: usize, extent: impl Fn(usize) -> f64) -> f64 {
        let radius = self.choices.kernel.radius();
        if self.last_h.len() == n && n > 0 {
            return radius * least(&self.last_h);
        }
        let length = |axis: usize| if domain.periodic[axis] { domain.length(axis) } else { extent(axis).max(0.0) };
        let volume: f64 = (0..self.dim()).map(length).product();
        radius * self.choices.h_fac * (volume / n.max(1) as f64).powf(1.0 / self.dim() as f64)
    }

    /// How far the particles lie apart along an axis.
    pub fn extent(&self, axis: usize) -> f64 {
        let x = self.cloud.as_ref().map_or(&[][..], |c| &c.x[axis]);
        sum::max(&self.pool, x.len(), |i| x[i]) - sum::min(&self.pool, x.len(), |i| x[i])
    }

    /// Stores an input and drops what depended on its old value.
    pub(super) fn store(&mut self, slot: Slot, input: Input) {
        self.lost[slot] = false;
        if slot == fields::T {
            self.energy = Energy::Follows;
        }
        if self.inputs[slot] == input {
            return;
        }
        let given = input != Input::Unset;
        if slot == fields::KAPPA && given {
            fields::TENSOR.for_each(|slot| (self.inputs[slot], self.lost[slot]) = (Input::Unset, false));
        }
        if fields::TENSOR.contains(&slot) && given {
            (self.inputs[fields::KAPPA], self.lost[fields::KAPPA]) = (Input::Unset, false);
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
        let found = std::mem::take(&mut self.found_h);
        if std::mem::take(&mut self.was_done_here) {
            self.last_h = found;
        }
        self.forget_geometry();
    }

    /// Makes what follows from positions, masses, densities and smoothing lengths missing.
    pub fn forget_geometry(&mut self) {
        (self.geometry, self.weights, self.inverse_capacity) = (None, None, None);
        (self.surface, self.bypassed) = (None, None);
        self.forget_operator();
    }

    /// What a step of particles that never moved does again where `without=at_rest` asks for it: sorts, and makes all that
    /// follows, as if the same positions had just been set.
    pub fn set_anew(&mut self) -> Result<()> {
        if self.choices.without(&rules::AT_REST) && !self.moves && self.steps + self.rates > 0 {
            let reach = self.reach(&self.domain, self.len(), |axis| self.extent(axis));
            self.sort_again(reach)?;
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
    /// `NoMemory`; `BadElement` where spacing differs by direction.
    pub fn areas(&self, wanted: impl Fn(usize) -> bool + Sync + Send) -> Result<Vec<f64>> {
        if self.inputs[fields::AREA] != Input::Unset {
            return self.each(fields::AREA);
        }
        let volume = self.geometry.as_ref().map_or(&[][..], |g| &g.volume);
        let host = |i: usize| self.host(i);
        self.with_rows(|rows| facing::areas(&self.choices.kernel, rows, volume, wanted, host, &self.pool))
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

    /// How many supports around a particle its rate depends on.
    pub fn ghost_supports(&self) -> f64 {
        let of_weights = self.choices.operator.supports(self.choices.normalise).map_or(f64::INFINITY, f64::from);
        // What is completed behind a wall is a sum over neighbours.
        of_weights + self.density_supports() + f64::from(self.has_walls())
    }

    /// How many supports around a particle its density depends on: where masses differ, which of two estimates is better
    /// is seen by how well the volumes of the neighbours' neighbours fill space.
    fn density_supports(&self) -> f64 {
        let equal = match &self.inputs[fields::M] {
            Input::Each(m) => density::are_equal(m),
            _ => true,
        };
        match (&self.inputs[fields::RHO], equal) {
            (Input::Unset, true) => 1.0,
            (Input::Unset, false) => 3.0,
            _ => 0.0,
        }
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
        let turned = choices.operator.has_angle() && !choices.allow.unstable;
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
            watched: choices.looks > 0 && (self.source_host.is_some() || self.kappa_host.is_some()),
            rate_only: self.rates > 0 && self.steps == 0,
            normalised: choices.normalise != Normalise::No,
            tensor: self.directions.as_ref().is_some_and(|d| !d.shape.is_empty()),
            twice: !choices.operator.is_one_matrix(),
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
        let inputs = self.inputs.iter().map(Input::bytes).sum::<u64>() + self.energy.bytes();
        let capacity = self.inverse_capacity.as_ref().map_or(0, memory::bytes);
        self.cloud.as_ref().map_or(0, Cloud::bytes)
            + geometry
            + weights
            + inputs
            + capacity
            + memory::bytes(&self.last_h)
            + memory::bytes(&self.found_h)
            + self.multigrid.bytes()
            + self.work.bytes()
    }
}

/// The shortest of some lengths.
pub(super) fn least(h: &[f64]) -> f64 {
    h.iter().copied().fold(f64::INFINITY, f64::min)
}
