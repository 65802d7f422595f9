//! What the host's functions do between the stages of a sub-step: they are looked at a few times in each step, T being
//! what it is, and a sub-step within which they are far from straight is taken shorter.
//!
//! Stages of a sub-step may all lie before or after a burst of heat, and an estimate of errors knows no more than they do.

use super::motion::Motion;
use super::passes;
use crate::error::Result;
use crate::memory;
use crate::model::heat::{Conductivity, Release};
use crate::sum;
use std::time::Instant;

/// The largest effect on T of what a sub-step may not see, in units of the tolerance that errors have.
const UNTOLD: f64 = 1e-3;

/// The shortest sub-step for the sake of a jump, of the step: where it is is known to this.
const SHORTEST: f64 = 1.0 / 4096.0;

/// What is known of the host's functions in one step.
#[derive(Debug, Clone, Copy, Default)]
pub struct Watch {
    /// Looks per step; 0 where nothing depends on the time.
    looks: u32,
    /// Whether kappa does, and not a source alone.
    kappa: bool,
    dt: f64,
    /// Something was found that stages would not have seen.
    found: bool,
    /// By how much what a source does beyond what it does now will raise T, root mean square.
    pub raises: f64,
}

impl Watch {
    pub fn is_idle(&self) -> bool {
        self.looks == 0
    }

    fn looks_within(&self, part: f64) -> u32 {
        let apart = if self.found { self.looks } else { (f64::from(self.looks) * (part / self.dt)).ceil() as u32 };
        // Between two ends of which one is on, the middle tells that something changed.
        if self.looks == 0 { 0 } else { apart.max(2) }
    }
}

impl Motion<'_> {
    /// Looks at a step of `dt` as a whole.
    ///
    /// # Errors
    /// Any error of the host's functions; `NoMemory`.
    pub fn watch(&mut self, time: f64, dt: f64, t: &[f64]) -> Result<Watch> {
        let looks = self.choices.looks;
        if looks == 0 || self.heat.is_autonomous() {
            return Ok(Watch::default());
        }
        let start = Instant::now();
        let at = |k: u32| time + dt * (f64::from(k) / f64::from(looks));
        let kappa = self.kappa_varies(looks, at, t)?;
        let mut watch = Watch { looks, kappa, dt, ..Watch::default() };
        if !self.source_varies(looks, at, dt, t, &mut watch.raises)? && !kappa {
            watch.looks = 0;
        }
        self.timers.add(passes::WATCH.name, start.elapsed());
        Ok(watch)
    }

    /// The longest sub-step, no longer than `part`, within which nothing happens that would move T by more than errors may,
    /// in units of `reference`.
    ///
    /// # Errors
    /// As [`Motion::watch`].
    pub fn as_watched(&mut self, watch: &mut Watch, now: f64, part: f64, t: &[f64], reference: f64) -> Result<f64> {
        let allowed = self.choices.tolerance.unwrap_or(UNTOLD) * reference.max(watch.raises);
        let mut part = part;
        while part > SHORTEST * watch.dt && self.untold(watch, now, part, t, reference)? > allowed {
            watch.found = true;
            part *= 0.5;
        }
        Ok(part)
    }

    /// How far T may be from where a sub-step would take it in which rates went straight from the first to the last, or, for
    /// methods of first order, stayed at one of them, root mean square. Kappa can move T by no more than `reference`, its
    /// spread.
    fn untold(&mut self, watch: &Watch, now: f64, part: f64, t: &[f64], reference: f64) -> Result<f64> {
        let looks = watch.looks_within(part);
        if looks < 2 {
            return Ok(0.0);
        }
        let straight = self.choices.method.order > 1;
        let (first, last) = (self.look(watch, now, t)?, self.look(watch, now + part, t)?);
        let (mut most, mut fastest) = (0.0f64, self.rms(|i| first[i]).max(self.rms(|i| last[i])));
        for k in 1..looks {
            let share = f64::from(k) / f64::from(looks);
            let here = self.look(watch, now + share * part, t)?;
            let bent = self.rms(|i| here[i] - (first[i] + share * (last[i] - first[i])));
            let aside =
                if straight { 0.0 } else { self.rms(|i| here[i] - first[i]).max(self.rms(|i| here[i] - last[i])) };
            most = most.max(bent).max(aside);
            fastest = fastest.max(self.rms(|i| here[i]));
        }
        let moved = part * most;
        Ok(if watch.kappa && most > 0.0 { moved.min(reference.max(watch.raises) * (most / fastest)) } else { moved })
    }

    /// The rate at a time, or the part of it that sources and surroundings make.
    fn look(&mut self, watch: &Watch, time: f64, t: &[f64]) -> Result<Vec<f64>> {
        if !watch.kappa {
            return self.heat.from_outside(time, t);
        }
        let mut rate = memory::filled("rate", t.len(), 0.0)?;
        self.heat.rate(time, t, &mut rate)?;
        Ok(rate)
    }

    fn kappa_varies(&mut self, looks: u32, at: impl Fn(u32) -> f64, t: &[f64]) -> Result<bool> {
        if !matches!(self.heat.conductivity, Conductivity::Host(..)) {
            return Ok(false);
        }
        let first = memory::copied("kappa", self.heat.kappa_of_t(at(0), t)?)?;
        for k in 1..=looks {
            if self.heat.kappa_of_t(at(k), t)? != first {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Whether a source varies, and by how much what it does beyond what it does now raises T. A particle that it cools
    /// fast comes no further than where it relaxes to.
    fn source_varies(
        &mut self,
        looks: u32,
        at: impl Fn(u32) -> f64,
        dt: f64,
        t: &[f64],
        raises: &mut f64,
    ) -> Result<bool> {
        if !matches!(self.heat.release, Release::Host(..)) {
            return Ok(false);
        }
        let first = self.heat.from_outside(at(0), t)?;
        let cooling = self.heat.cooling(at(0), t)?;
        let mut varies = false;
        for k in 1..=looks {
            let here = self.heat.from_outside(at(k), t)?;
            if here != first {
                varies = true;
                *raises += self.rms(|i| (here[i] - first[i]) * (dt / f64::from(looks)) / (1.0 + dt * cooling[i]));
            }
        }
        Ok(varies)
    }

    /// Root mean square over the volume.
    pub fn rms(&self, value: impl Fn(usize) -> f64 + Sync + Send) -> f64 {
        let volume = self.heat.volume;
        sum::rms(self.pool, volume.len(), |i| volume[i], value)
    }
}
