//! The stages of a step: bounds on the operator, the schedule that follows from them, sub-steps on a private copy of T.

use super::known::Known;
use super::report::{Progress, Report, Timers};
use super::{Choices, Plan, passes, rules};
use crate::error::{Error, Result};
use crate::integrator::{
    self, Adaptive, Bounds, Control, Linear, Method, Range, Schedule, Shifted, System, Tally, Work,
};
use crate::memory;
use crate::model::heat::{self, Heat};
use crate::operator::multigrid::Fine;
use crate::operator::{arnoldi, spectrum};
use crate::pool::Pool;
use crate::sum;
use std::time::Instant;

/// Growth, in units of the fastest rate, above which a mode is taken for real: Ritz values of operators that are not
/// symmetric scatter by less.
const GROWS: f64 = 1e-3;

/// How far beyond the largest Ritz value of Arnoldi's method an eigenvalue may be.
const BEYOND_ARNOLDI: f64 = 1.05;

/// Explicit limits from which it is worth one rate to see whether anything changes at all.
const WORTH_A_LOOK: f64 = 8.0;

/// A prepared right-hand side and what it takes to move it.
pub struct Motion<'a> {
    pub heat: Heat<'a>,
    pub pool: &'a Pool,
    pub choices: &'a Choices,
    pub plan: &'a Plan,
    pub work: &'a mut Work,
    pub progress: &'a mut Option<Progress>,
    pub timers: &'a mut Timers,
    /// What was found out about the operator as it still is.
    pub known: &'a mut Option<Known>,
    /// What T must not leave.
    pub range: Range,
}

impl System for Heat<'_> {
    fn rate(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<()> {
        Heat::rate(self, t, y, dy)
    }

    fn tally(&self) -> Tally {
        [self.power.source, self.power.surface]
    }

    fn linearise(&mut self, t: f64, y: &[f64], diagonal: &mut [f64], weight: &mut [f64]) -> Result<Linear> {
        let circles = self.circles(t, y)?;
        if let Some(i) = sum::first(self.pool, circles.len(), |i| !circles[i].1.is_finite()) {
            return Err(too_stiff(self.host[i] as usize));
        }
        diagonal.iter_mut().zip(&circles).for_each(|(d, circle)| *d = circle.1);
        weight.iter_mut().zip(self.inverse_capacity).for_each(|(w, &i)| *w = heat::capacity(i));
        // Losses at the surface are in the circles.
        let cooling = self.linearise_losses(t, y)?;
        diagonal.iter_mut().zip(&cooling).for_each(|(d, c)| *d += c);
        Ok(if self.is_linear() { Linear::Exact } else { Linear::Frozen })
    }

    fn is_linear(&self) -> bool {
        Heat::is_linear(self)
    }

    fn apply(&mut self, x: &[f64], ax: &mut [f64]) -> Result<()> {
        self.linear(x, ax)
    }

    fn precondition(&mut self, shifted: Shifted, r: &[f64], z: &mut [f64]) -> Result<bool> {
        Heat::precondition(self, fine(self.pool, shifted), r, z)
    }

    fn flatten(&mut self, shifted: Shifted, y: &[f64], x: &mut [f64]) -> Result<bool> {
        Heat::flatten(self, fine(self.pool, shifted), y, x)
    }

    fn confine(&mut self, range: Range, most: f64, y: &mut [f64]) -> Result<bool> {
        let capacities = self.capacities()?;
        range.confine(self.parts()?, &capacities, most, y)
    }

    fn supply(&mut self, t: f64, y: &[f64]) -> Result<Option<f64>> {
        Heat::supply(self, t, y)
    }
}

/// A rate that no number holds.
fn too_stiff(particle: usize) -> Error {
    let rule = "its product with pair weights, or h_conv, over m c_v exceeds all numbers: check kappa, m, c_v and h_conv there";
    Error::bad_at("kappa", particle, "too large", rule)
}

/// The equations of a stage as the preconditioner takes them.
fn fine<'a>(pool: &'a Pool, Shifted { g, diagonal, weight }: Shifted<'a>) -> Fine<'a> {
    Fine { pool, g, diagonal, weight }
}

/// The largest explicit Euler step that is stable under these bounds; infinite where nothing diffuses.
pub fn explicit_limit(bounds: Bounds) -> f64 {
    2.0 / bounds.spectral
}

/// Bounds on an operator to which a decay at this rate is added everywhere.
fn raised(bounds: Bounds, rate: f64) -> Bounds {
    Bounds { spectral: bounds.spectral + rate, diagonal: bounds.diagonal + rate }
}

impl Motion<'_> {
    /// Advances `t` by exactly `dt` from `time`. Where the operator changes with T, bounds and schedule are made anew
    /// for each sub-step.
    pub fn advance(&mut self, time: f64, dt: f64, t: &mut [f64], report: &mut Report) -> Result<()> {
        if dt == 0.0 || t.is_empty() {
            return Ok(());
        }
        let start = Instant::now();
        let method = self.choices.method;
        let in_range = !self.range.is_bound() || (method.ssp > 0.0 && self.is_fixed());
        match method.is_explicit() && self.choices.tolerance.is_none() && in_range {
            true => self.march(time, dt, t, report)?,
            false => self.adapt(time, dt, t, report)?,
        }
        self.timers.add(if method.is_implicit() { passes::SOLVE.name } else { passes::STAGES.name }, start.elapsed());
        Ok(())
    }

    /// Sub-steps of an explicit method that are as long as it is stable, and keeps bounds: none is ever rejected.
    fn march(&mut self, time: f64, dt: f64, t: &mut [f64], report: &mut Report) -> Result<()> {
        let (mut done, before, allowed) = (0.0, self.heat.applications, self.choices.options.max_applications);
        let mut watch = self.watch(time, dt, t)?;
        let spread = if watch.is_idle() { 0.0 } else { self.norm(|i| t[i]) };
        while done < dt {
            let needed = (self.heat.applications - before) as f64;
            if needed > allowed as f64 {
                return Err(Error::StepTooLarge {
                    dt,
                    needed: needed * (dt / done),
                    allowed,
                    remedy: self.choices.method.remedy().into(),
                });
            }
            let bounds = self.bounds(time + done, dt - done, t)?;
            if report.substeps == 0 {
                report.limit = explicit_limit(bounds);
                if dt > WORTH_A_LOOK * report.limit && self.is_still(time, t)? {
                    report.substeps = 1;
                    report.came_in(dt, self.heat.tally());
                    return self.tell(time, dt, dt);
                }
            }
            let mut schedule = self.choices.method.schedule(dt - done, bounds, &self.choices.options)?;
            let part = self.as_watched(&mut watch, time + done, schedule.dt, t, spread)?;
            if part < schedule.dt {
                schedule = self.choices.method.schedule(part, bounds, &self.choices.options)?;
            }
            report.stages = schedule.stages.into();
            let steps = if self.is_fixed() { schedule.substeps } else { 1 };
            for k in 0..steps {
                let now = time + done + schedule.start(k);
                self.choices.method.advance(&schedule, &mut self.heat, self.pool, now, t, self.work)?;
                report.substeps += 1;
                report.came_in(1.0, self.work.tally);
                // Later it would be seen at all neighbours; after the last one it is looked for anyway.
                if report.substeps == 1 && schedule.substeps > 1 {
                    self.refuse_what_is_not_finite("T", t)?;
                }
                self.tell(time, dt, done + schedule.start(k + 1))?;
            }
            let ends = steps == schedule.substeps && schedule.total == dt - done;
            done = if ends { dt } else { done + schedule.start(steps) };
        }
        Ok(())
    }

    /// Sub-steps that are rejected where they miss a tolerance, leave bounds or do not converge, none longer than is
    /// stable.
    fn adapt(&mut self, time: f64, dt: f64, t: &mut [f64], report: &mut Report) -> Result<()> {
        let (choices, before, volume) = (self.choices, self.heat.applications, self.heat.volume);
        let (method, options) = (choices.method, &choices.options);
        let bounds = self.stability(time, dt, t)?;
        report.limit =
            explicit_limit(if method.is_implicit() { self.known_or_proven(time, t)?.proven } else { bounds });
        let mut watch = self.watch(time, dt, t)?;
        let control = Control { method, tolerance: choices.tolerance, range: self.range, raises: watch.raises };
        let mut pace = Adaptive::new(control, self.pool, volume, &mut self.heat, (time, dt), t)?;
        let fastest = sum::max(self.pool, t.len(), |i| pace.rate()[i].abs());
        if !fastest.is_finite() {
            // No sub-step is short enough.
            self.refuse_what_is_not_finite("dT/dt", pace.rate())?;
        }
        // With a rate of 0 everywhere T stays as it is, however long the step.
        if fastest <= 0.0 && self.heat.is_autonomous() {
            (report.substeps, report.stages) = (1, 1);
            report.came_in(dt, self.heat.tally());
            return self.tell(time, dt, dt);
        }
        // Nothing makes a step possible that is too long for stability alone: it is refused before any work.
        method.schedule(dt, bounds, options)?;
        let reference = self.norm(|i| t[i]).max(dt * self.heat_from_outside(time, t)?);
        let mut done = 0.0;
        while done < dt {
            let (now, rest) = (time + done, dt - done);
            let scale = reference.max(pace.moved(t));
            let most = self.practical_limit(now, t, scale.max(watch.raises))?;
            let part = self.as_watched(&mut watch, now, pace.next(rest, most), t, scale)?;
            let bounds = self.stability(now, part, t)?;
            let (method, schedule) = self.schedule(part, bounds)?;
            report.stages = schedule.stages.into();
            if pace.attempt(method, &schedule, &mut self.heat, now, t, self.work)? {
                done = if schedule.dt == rest { dt } else { done + schedule.dt };
                report.substeps += 1;
                self.tell(time, dt, done)?;
            }
            self.refuse_what_does_not_end(&pace, (dt, dt - done), self.heat.applications - before)?;
        }
        (report.rejected, self.work.slack) = (pace.rejected, pace.slack);
        report.came_in(1.0, pace.tally);
        Ok(())
    }

    /// What bounds the length of a sub-step: nothing for an implicit method.
    fn stability(&mut self, time: f64, dt: f64, t: &[f64]) -> Result<Bounds> {
        let calm = Bounds { spectral: 0.0, diagonal: 0.0 };
        if self.choices.method.is_implicit() { Ok(calm) } else { self.bounds(time, dt, t) }
    }

    fn refuse_what_is_not_finite(&self, what: &str, values: &[f64]) -> Result<()> {
        heat::refuse_what_is_not_finite(self.pool, self.heat.host, values, |_| what.into())
    }

    /// Whether nothing changes, and nothing will.
    fn is_still(&mut self, time: f64, t: &[f64]) -> Result<bool> {
        if !self.heat.is_autonomous() {
            return Ok(false);
        }
        let mut rate = memory::filled("rate", t.len(), 0.0)?;
        self.heat.rate(time, t, &mut rate)?;
        Ok(sum::max(self.pool, rate.len(), |i| rate[i].abs()) <= 0.0)
    }

    /// Whether one schedule serves all sub-steps.
    fn is_fixed(&self) -> bool {
        self.heat.operator_is_fixed() && self.heat.is_autonomous()
    }

    /// Sub-steps may become so short, or so many, that the end is out of reach. How many are ahead says little: those
    /// after a steep beginning are longer.
    fn refuse_what_does_not_end(&self, pace: &Adaptive, (dt, rest): (f64, f64), applications: u64) -> Result<()> {
        let (allowed, part) = (self.choices.options.max_applications, pace.next(rest, f64::INFINITY));
        // An implicit sub-step takes as many as it takes; what came of one that took too many is not had.
        let over = applications > allowed && (rest > 0.0 || self.choices.method.is_implicit());
        if !over && (rest == 0.0 || part >= f64::EPSILON * rest) {
            return Ok(());
        }
        Err(match pace.failure() {
            Some(failure) => self.of_host(failure.clone()),
            None => {
                // As many again for what is left, or one for each sub-step where nothing is done yet.
                let ahead = if rest > 0.0 { rest / part } else { 0.0 };
                let needed = match over {
                    true => (applications as f64 * dt / (dt - rest)).min(applications as f64 + ahead),
                    false => ahead,
                };
                Error::StepTooLarge { dt, needed, allowed, remedy: self.choices.method.remedy().into() }
            }
        })
    }

    /// An error of the integrator, which knows particles by their internal number.
    fn of_host(&self, error: Error) -> Error {
        match error {
            Error::OutOfBounds { index, value, .. } if !value.is_finite() => {
                Error::NotFinite { what: "T".into(), index: self.heat.host[index] as usize, value }
            }
            Error::OutOfBounds { index, value, low, high, promise } => {
                Error::OutOfBounds { index: self.heat.host[index] as usize, value, low, high, promise }
            }
            other => other,
        }
    }

    /// The longest sub-step of a stabilised method in which T changes, at the present rate, by no more than `change`
    /// times `reference`, its spread at the beginning or how far it has come since. Stability allows more, but then one
    /// sub-step of second order would have to follow a decay by several factors of e, and modes that it cannot resolve
    /// would ring instead of dying (the practical step limit of Caplan et al. 2024 has the same purpose). Where a
    /// tolerance decides, errors are estimated instead.
    fn practical_limit(&mut self, time: f64, t: &[f64], reference: f64) -> Result<f64> {
        let Choices { method, options, change, tolerance, .. } = self.choices;
        if !method.is_stabilised() || options.stages.is_some() || change.is_infinite() || tolerance.is_some() {
            return Ok(f64::INFINITY);
        }
        let mut rate = memory::filled("rate", t.len(), 0.0)?;
        self.heat.rate(time, t, &mut rate)?;
        // What a function of the host's heats may relax as a whole; all else moves the mean at a steady pace.
        let speed = match self.heat.is_autonomous() {
            true => self.norm(|i| rate[i]),
            false => self.rms(|i| rate[i]),
        };
        let most = change * reference / speed;
        Ok(if most > 0.0 { most } else { f64::INFINITY })
    }

    /// How fast T rises by all that is no exchange between particles, root mean square.
    fn heat_from_outside(&mut self, time: f64, t: &[f64]) -> Result<f64> {
        let rate = self.heat.from_outside(time, t)?;
        Ok(sum::rms(self.pool, rate.len(), |i| self.heat.volume[i], |i| rate[i]))
    }

    /// The spread of a quantity over the volume.
    fn norm(&self, value: impl Fn(usize) -> f64 + Sync + Send) -> f64 {
        let volume = self.heat.volume;
        sum::spread(self.pool, volume.len(), |i| volume[i], value)
    }

    fn schedule(&self, dt: f64, bounds: Bounds) -> Result<(&'static Method, Schedule)> {
        let (method, options) = (self.choices.method, &self.choices.options);
        if self.plan.leaves_out(&rules::ONE_STAGE) && options.stages.is_none() && dt <= explicit_limit(bounds) {
            let euler = integrator::find("euler")?;
            return Ok((euler, euler.schedule(dt, bounds, options)?));
        }
        Ok((method, method.schedule(dt, bounds, options)?))
    }

    /// Bounds that are good enough for a step of `dt`.
    pub fn bounds(&mut self, time: f64, dt: f64, t: &[f64]) -> Result<Bounds> {
        let start = Instant::now();
        let known = self.known_or_proven(time, t)?;
        let cooling = self.fastest_cooling(time, t)?;
        let enough = self.plan.leaves_out(&rules::PROVEN_BOUND) && self.is_least_work(dt, known, cooling);
        let bounds = if enough { known.proven } else { self.refined(known, time, t)? };
        let bounds = raised(bounds, cooling);
        self.timers.add(passes::BOUND.name, start.elapsed());
        Ok(bounds)
    }

    /// The best bounds there are: Gershgorin's, lowered by Lanczos' method.
    pub fn refined_bounds(&mut self, time: f64, t: &[f64]) -> Result<Bounds> {
        let known = self.known_or_proven(time, t)?;
        let bounds = self.refined(known, time, t)?;
        self.with_cooling(bounds, time, t)
    }

    /// Bounds with what a source of the host's adds to them, which is looked at anew each time.
    pub fn with_cooling(&mut self, bounds: Bounds, time: f64, t: &[f64]) -> Result<Bounds> {
        Ok(raised(bounds, self.fastest_cooling(time, t)?))
    }

    fn fastest_cooling(&mut self, time: f64, t: &[f64]) -> Result<f64> {
        let cooling = self.heat.cooling(time, t)?;
        Ok(sum::max(self.pool, cooling.len(), |i| cooling[i]).max(0.0))
    }

    fn refined(&mut self, known: Known, time: f64, t: &[f64]) -> Result<Bounds> {
        if let Some(bounds) = known.refined {
            return Ok(bounds);
        }
        let bounds = self.refine(known, time, t)?;
        self.remember(Known { refined: Some(bounds), ..known });
        Ok(bounds)
    }

    /// Whether the proven bound asks for the very sub-steps that the least possible one asks for, and with it every
    /// bound between them.
    fn is_least_work(&self, dt: f64, known: Known, cooling: f64) -> bool {
        let least = Bounds { spectral: known.floor, ..known.proven };
        let steps = |bounds| {
            let scheduled = self.schedule(dt, raised(bounds, cooling)).ok();
            scheduled.map(|(method, s)| (method.name, s.substeps, s.stages))
        };
        steps(known.proven).is_some_and(|proven| steps(least) == Some(proven))
    }

    /// The best bounds that cost no more than one application: for a report, or a choice between methods.
    pub fn known_or_proven(&mut self, time: f64, t: &[f64]) -> Result<Known> {
        if let Some(known) = self.known.filter(|_| self.heat.operator_is_fixed()) {
            return Ok(known);
        }
        let known = self.proven(time, t)?;
        if !self.plan.leaves_out(&rules::DECAYS) && self.heat.has_spectrum() {
            self.refuse_growing_modes(time, t)?;
        }
        self.remember(known);
        Ok(known)
    }

    /// The fastest growth of a mode of the operator, and its largest rate, 1/s.
    pub fn growth(&mut self, time: f64, t: &[f64]) -> Result<(f64, f64)> {
        let weight = self.linearise_about(time, t)?;
        arnoldi::rightmost(self.pool, &weight, |x, y| self.heat.linear(x, y))
    }

    /// Makes the operator linear about T; answers the capacities, in whose norm it is symmetric if it is at all.
    fn linearise_about(&mut self, time: f64, t: &[f64]) -> Result<Vec<f64>> {
        self.heat.linearise_losses(time, t)?;
        self.heat.capacities()
    }

    /// An operator whose modes grow is of no use, however small the step.
    fn refuse_growing_modes(&mut self, time: f64, t: &[f64]) -> Result<()> {
        let start = Instant::now();
        let (growth, fastest) = self.growth(time, t)?;
        self.timers.add(passes::SPECTRUM.name, start.elapsed());
        if growth <= GROWS * fastest || self.choices.allow.unstable {
            return Ok(());
        }
        let operator = self.choices.operator.name;
        let rule = format!(
            "on these particles its weights have a mode that grows at {growth:.1e} /s, {:.1} % of the fastest decay: give \
             more neighbours by a larger h_fac, a lower order or a smoother kappa, use operator=brookshaw, or insist with \
             allow=unstable",
            100.0 * growth / fastest
        );
        Err(Error::bad("operator", operator, &rule))
    }

    /// Keeps bounds for later steps, if they will hold then.
    fn remember(&mut self, known: Known) {
        *self.known = Some(known).filter(|_| self.heat.operator_is_fixed());
    }

    /// Gershgorin's bounds: proven, for any operator and any kappa.
    pub fn proven(&mut self, time: f64, t: &[f64]) -> Result<Known> {
        let start = Instant::now();
        let circles = self.heat.circles(time, t)?;
        let largest = |of: fn(&(f64, f64)) -> f64| sum::max(self.pool, circles.len(), |i| of(&circles[i])).max(0.0);
        let proven = Bounds { spectral: largest(|c| c.0 + c.1), diagonal: largest(|c| c.0.max(c.1)) };
        // An eigenvalue of a symmetric operator is at least the largest diagonal element; of others nothing is known.
        let floor = if self.choices.operator.dissipative { largest(|c| c.1) } else { 0.0 };
        self.timers.add(passes::CIRCLES.name, start.elapsed());
        match sum::first(self.pool, circles.len(), |i| !(circles[i].0 + circles[i].1).is_finite()) {
            None => Ok(Known { proven, refined: None, floor }),
            Some(i) => Err(too_stiff(self.heat.host[i] as usize)),
        }
    }

    /// The same, lowered by an estimate from iterations. Exchange with the surroundings is linearised.
    fn refine(&mut self, Known { proven, floor, .. }: Known, time: f64, t: &[f64]) -> Result<Bounds> {
        if proven.spectral == 0.0 {
            return Ok(proven);
        }
        let weight = self.linearise_about(time, t)?;
        let symmetric = self.choices.operator.conserves && self.heat.engine.is_linear();
        let mut spectral =
            spectrum::largest(self.pool, &weight, proven.spectral, symmetric, |x, y| self.heat.linear(x, y))?;
        if !symmetric {
            // Each may miss what the other sees.
            let (_, fastest) = arnoldi::rightmost(self.pool, &weight, |x, y| self.heat.linear(x, y))?;
            spectral = spectral.max(BEYOND_ARNOLDI * fastest).min(proven.spectral);
        }
        Ok(Bounds { spectral: spectral.max(floor), ..proven })
    }

    fn tell(&mut self, time: f64, dt: f64, done: f64) -> Result<()> {
        match self.progress.as_mut().map_or(0, |progress| progress(time + done, done / dt)) {
            0 => Ok(()),
            _ => Err(Error::Cancelled),
        }
    }
}
