//! Heat: the right-hand side dT/dt = (Σ_b g_ab kappa_ab (T_b − T_a) + surface + source) / (m c_v).
//!
//! A particle with fixed temperature is one with an infinite capacity: its 1/(m c_v) is 0 and nothing else is special.

use super::conductivity::Law;
use super::surface::Surface;
use crate::error::{Error, Result};
use crate::memory;
use crate::operator::aggregate::{self, Couplings};
use crate::operator::{Engine, Mean, Medium, Multigrid};
use crate::pool::Pool;
use crate::sum;

/// A host's function: fills the last slice for time t and temperatures T; the `u32`s are the host's particle numbers.
/// A code other than 0 stops the step.
pub type Callback = Box<dyn FnMut(f64, &[u32], &[f64], &mut [f64]) -> i32 + Send>;

/// By how much T is raised to see how a source of the host's depends on it, relative to the largest |T|: half of a
/// number's digits are left for the difference.
const RAISED: f64 = 1.5e-8;

/// Where the conductivity comes from.
pub enum Conductivity<'a> {
    /// One number for all pairs.
    Number(f64),
    /// Already in the stored coefficients.
    Folded,
    /// One number per particle, averaged for each pair.
    Field(&'a [f64]),
    /// A law in words, evaluated into a buffer for every right-hand side.
    Law(&'a Law, &'a mut [f64]),
    /// The host's function, likewise.
    Host(&'a mut Callback, &'a mut [f64]),
}

/// Heat released in the volume.
pub enum Release<'a> {
    None,
    /// W/m³ per particle.
    Field(&'a [f64]),
    /// The host's function, W/m³, evaluated into a buffer.
    Host(&'a mut Callback, &'a mut [f64]),
}

/// The right-hand side, with everything that the scene needs and nothing else.
pub struct Heat<'a> {
    pub pool: &'a Pool,
    pub engine: Engine<'a>,
    pub mean: Mean,
    /// 1/(m c_v), 0 where T is fixed.
    pub inverse_capacity: &'a [f64],
    pub conductivity: Conductivity<'a>,
    pub surface: Option<&'a Surface>,
    pub release: Release<'a>,
    pub volume: &'a [f64],
    /// The host's number of each particle.
    pub host: &'a [u32],
    /// Skip blocks in which nothing differs.
    pub quiet: bool,
    /// What exchange with the outside and a source take from dT/dt per kelvin, 1/s, as last linearised; empty where there
    /// is none.
    pub slopes: Vec<f64>,
    /// Which particles exchange with which, directly or by way of others; none until it is asked for.
    pub parts: &'a mut Option<Vec<u32>>,
    /// The preconditioner of implicit stages, empty until it is needed; none while it is at work.
    pub multigrid: Option<&'a mut Multigrid>,
    /// The least length of a stage, in explicit limits, for which it is used.
    pub stiff: f64,
    /// Applications of the operator so far.
    pub applications: u64,
    /// What a source and the surroundings brought in by the rate evaluated last, W; sources that are fields bring
    /// the same always.
    pub power: Power,
}

/// Heat that comes in per second, W; T is free where it does.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Power {
    pub source: f64,
    pub surface: f64,
}

impl Heat<'_> {
    /// dT/dt at time `time` for temperatures `t`.
    ///
    /// # Errors
    /// `Cancelled`; `CallbackFailed` with the host's code; `BadElement` when a callback gives a negative or non-finite kappa.
    pub fn rate(&mut self, time: f64, t: &[f64], rate: &mut [f64]) -> Result<()> {
        self.applications += 1;
        self.kappa_of_t(time, t)?;
        self.diffuse(t, rate)?;
        if let Some(surface) = self.surface {
            self.power.surface = surface.add(self.evaluated_kappa(), t, self.inverse_capacity, rate);
        }
        self.release(time, t, rate)?;
        if let Release::Host(_, source) = &self.release {
            self.power.source = self.power_of(source);
        }
        Ok(())
    }

    /// What a source heats per second, W, where T is free.
    pub fn power_of(&self, source: &[f64]) -> f64 {
        let (volume, inverse) = (self.volume, self.inverse_capacity);
        sum::sum(self.pool, source.len(), |i| if inverse[i] > 0.0 { source[i] * volume[i] } else { 0.0 })
    }

    /// Linearises the exchange with the outside and the source about these temperatures, for [`Heat::linear`]; answers the
    /// source's part of it.
    ///
    /// # Errors
    /// As [`Heat::cooling`].
    pub fn linearise_losses(&mut self, time: f64, t: &[f64]) -> Result<Vec<f64>> {
        let cooling = self.cooling(time, t)?;
        self.slopes = memory::copied("slopes", &cooling)?;
        let Some(surface) = self.surface else { return Ok(cooling) };
        let (mut slopes, inverse) = (std::mem::take(&mut self.slopes), self.inverse_capacity);
        memory::extended("slopes", &mut slopes, t.len(), 0.0)?;
        surface.slopes(self.evaluated_kappa(), t, |i, slope| slopes[i] += slope * inverse[i]);
        self.slopes = slopes;
        Ok(cooling)
    }

    /// m c_v of each particle; 0 where T is fixed.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn capacities(&self) -> Result<Vec<f64>> {
        memory::collected("capacities", self.inverse_capacity.iter().map(|&inverse| capacity(inverse)))
    }

    /// How much faster each particle would cool per kelvin by the host's source, 1/s, from a difference; 0 where it heats
    /// more when hotter, and empty where no function heats. A value is taken to depend on the T of its own particle.
    ///
    /// # Errors
    /// `CallbackFailed`; `NotFinite` naming a particle whose source is not; `NoMemory`.
    pub fn cooling(&mut self, time: f64, t: &[f64]) -> Result<Vec<f64>> {
        let Release::Host(host, buffer) = &mut self.release else { return Ok(Vec::new()) };
        let largest = sum::max(self.pool, t.len(), |i| t[i].abs());
        let raise = RAISED * if largest > 0.0 { largest } else { 1.0 };
        let raised = memory::collected("slopes", t.iter().map(|t| t + raise))?;
        source_of(host, (time, self.host), &raised, buffer, self.pool)?;
        let mut slopes = memory::copied("slopes", buffer)?;
        source_of(host, (time, self.host), t, buffer, self.pool)?;
        let (volume, inverse) = (self.volume, self.inverse_capacity);
        self.pool.update(&mut slopes, |start, part| {
            for (k, slope) in part.iter_mut().enumerate() {
                let i = start + k;
                *slope = ((buffer[i] - *slope) / (raised[i] - t[i]) * volume[i] * inverse[i]).max(0.0);
            }
        });
        Ok(slopes)
    }

    /// For each particle the first one of those that it exchanges with, directly or by way of others. Where kappa depends
    /// on T every pair counts.
    ///
    /// # Errors
    /// `NoMemory`; `OutOfOrder` without stored weights.
    pub fn parts(&mut self) -> Result<&[u32]> {
        if self.parts.is_none() {
            let (matrix, medium) = (self.engine.matrix()?, self.medium());
            let kappa = medium.kappa().filter(|_| self.operator_is_fixed());
            *self.parts = Some(aggregate::parts(&Couplings { matrix, kappa, factor: medium.factor })?);
        }
        Ok(self.parts.as_deref().unwrap_or(&[]))
    }

    /// Whether the rate depends on nothing but T: the host has lent no function, which may look at the time.
    pub fn is_autonomous(&self) -> bool {
        !matches!(self.release, Release::Host(..)) && !matches!(self.conductivity, Conductivity::Host(..))
    }

    /// The linear operator on x: the conductivity as evaluated last, the surface as linearised last.
    ///
    /// # Errors
    /// `Cancelled`; `NoMemory`.
    pub fn linear(&mut self, x: &[f64], out: &mut [f64]) -> Result<()> {
        self.applications += 1;
        self.diffuse(x, out)?;
        let slopes = &self.slopes;
        self.pool.update(&mut out[..slopes.len()], |start, part| {
            part.iter_mut().enumerate().for_each(|(k, y)| *y -= slopes[start + k] * x[start + k]);
        });
        Ok(())
    }

    /// Whether the rate is a linear function of T.
    pub fn is_linear(&self) -> bool {
        !matches!(self.release, Release::Host(..)) && self.has_spectrum()
    }

    /// Whether the operator is a linear one that stays the same while T changes.
    pub fn has_spectrum(&self) -> bool {
        self.engine.is_linear() && self.operator_is_fixed()
    }

    /// Whether the operator stays the same while T changes.
    pub fn operator_is_fixed(&self) -> bool {
        let kappa_of_t = matches!(self.conductivity, Conductivity::Law(..) | Conductivity::Host(..));
        !kappa_of_t && self.surface.is_none_or(Surface::is_linear)
    }

    /// The power that sources and the outside bring in, W: what is left of Σ m c_v dT/dt where exchanges between
    /// particles cancel. `None` where some T is fixed, for there heat comes and goes unseen.
    ///
    /// # Errors
    /// As [`Heat::rate`].
    pub fn supply(&mut self, time: f64, t: &[f64]) -> Result<Option<f64>> {
        if sum::first(self.pool, t.len(), |i| self.inverse_capacity[i] == 0.0).is_some() {
            return Ok(None);
        }
        if self.surface.is_none() && matches!(self.release, Release::None) {
            return Ok(Some(0.0));
        }
        let (rate, inverse) = (self.from_outside(time, t)?, self.inverse_capacity);
        Ok(Some(sum::sum(self.pool, t.len(), |i| capacity(inverse[i]) * rate[i])))
    }

    /// The part of dT/dt that sources and surroundings make; empty where there are none.
    ///
    /// # Errors
    /// As [`Heat::rate`].
    pub fn from_outside(&mut self, time: f64, t: &[f64]) -> Result<Vec<f64>> {
        if self.surface.is_none() && matches!(self.release, Release::None) {
            return Ok(Vec::new());
        }
        let mut rate = memory::filled("supply", t.len(), 0.0)?;
        if let Some(surface) = self.surface {
            self.kappa_of_t(time, t)?;
            surface.add(self.evaluated_kappa(), t, self.inverse_capacity, &mut rate);
        }
        self.release(time, t, &mut rate)?;
        Ok(rate)
    }

    /// The diffusive part of dT/dt alone, with the conductivity evaluated last.
    pub fn diffuse(&self, t: &[f64], rate: &mut [f64]) -> Result<()> {
        self.engine.apply(self.pool, &self.medium(), t, rate)
    }

    /// For each particle the radius and the centre's size of its Gershgorin circle, in 1/s. Needs stored weights.
    pub fn circles(&mut self, time: f64, t: &[f64]) -> Result<Vec<(f64, f64)>> {
        self.kappa_of_t(time, t)?;
        let mut circles = self.engine.circles(self.pool, &self.medium())?;
        if let Some(surface) = self.surface {
            let inverse = self.inverse_capacity;
            surface.slopes(self.evaluated_kappa(), t, |i, slope| circles[i].1 += slope * inverse[i]);
        }
        Ok(circles)
    }

    /// kappa(T) as evaluated last; empty where it does not depend on T.
    fn evaluated_kappa(&self) -> &[f64] {
        match &self.conductivity {
            Conductivity::Law(_, kappa) | Conductivity::Host(_, kappa) => kappa,
            _ => &[],
        }
    }

    /// What lies between particles, with the conductivity evaluated last.
    pub(super) fn medium(&self) -> Medium<'_> {
        let (factor, kappa) = match &self.conductivity {
            Conductivity::Number(kappa) => (*kappa, None),
            Conductivity::Folded => (1.0, None),
            Conductivity::Field(kappa) => (1.0, Some(*kappa)),
            Conductivity::Law(_, kappa) | Conductivity::Host(_, kappa) => (1.0, Some(&**kappa)),
        };
        Medium { mean: self.mean, kappa, factor, scale: self.inverse_capacity, quiet: self.quiet }
    }

    /// Evaluates kappa(T), where there is such a thing, for the pair sums to come; empty where there is not.
    ///
    /// # Errors
    /// As [`Heat::rate`].
    pub fn kappa_of_t(&mut self, time: f64, t: &[f64]) -> Result<&[f64]> {
        let kappa: &mut [f64] = match &mut self.conductivity {
            Conductivity::Law(law, kappa) => {
                law.evaluate(self.pool, t, kappa);
                kappa
            }
            Conductivity::Host(host, kappa) => {
                called("kappa", host(time, self.host, t, kappa))?;
                kappa
            }
            _ => return Ok(&[]),
        };
        let bad = sum::first(self.pool, kappa.len(), |i| !(kappa[i] >= 0.0 && kappa[i].is_finite()));
        if let Some(i) = bad {
            let value = format!("{} (at T = {})", kappa[i], t[i]);
            return Err(Error::bad_at("kappa", self.host[i] as usize, value, "it must be finite and not negative"));
        }
        Ok(kappa)
    }

    fn release(&mut self, time: f64, t: &[f64], rate: &mut [f64]) -> Result<()> {
        let source: &[f64] = match &mut self.release {
            Release::None => return Ok(()),
            Release::Field(source) => source,
            Release::Host(host, buffer) => {
                source_of(host, (time, self.host), t, buffer, self.pool)?;
                buffer
            }
        };
        let (volume, inverse) = (self.volume, self.inverse_capacity);
        self.pool.update(rate, |start, part| {
            for (k, rate) in part.iter_mut().enumerate() {
                let i = start + k;
                *rate += source[i] * volume[i] * inverse[i];
            }
        });
        Ok(())
    }
}

/// m c_v from its inverse; 0 where T is fixed.
pub fn capacity(inverse: f64) -> f64 {
    if inverse > 0.0 { 1.0 / inverse } else { 0.0 }
}

/// The host's source for temperatures `t`, all of it finite.
fn source_of(
    host: &mut Callback,
    (time, particles): (f64, &[u32]),
    t: &[f64],
    source: &mut [f64],
    pool: &Pool,
) -> Result<()> {
    called("source", host(time, particles, t, source))?;
    // Not an error that a shorter sub-step may mend: asked again, it could hide.
    refuse_what_is_not_finite(pool, particles, source, |i| format!("the source callback's value at T = {}", t[i]))
}

/// Refuses values of which one is no number, naming its particle; `what` says of which value it is.
///
/// # Errors
/// `NotFinite`.
pub fn refuse_what_is_not_finite(
    pool: &Pool,
    particles: &[u32],
    values: &[f64],
    what: impl Fn(usize) -> String,
) -> Result<()> {
    match sum::first(pool, values.len(), |i| !values[i].is_finite()) {
        None => Ok(()),
        Some(i) => Err(Error::NotFinite { what: what(i), index: particles[i] as usize, value: values[i] }),
    }
}

fn called(which: &str, code: i32) -> Result<()> {
    if code == 0 { Ok(()) } else { Err(Error::CallbackFailed { which: which.into(), code }) }
}
