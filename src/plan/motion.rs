//! The stages of a step: bounds on the operator, the schedule that follows from them, sub-steps on a private copy of T.

use super::report::{Report, Timers};
use super::state::Progress;
use super::{Choices, Plan, rules};
use crate::error::{Error, Result};
use crate::integrator::{self, Adaptive, Bounds, Control, Linear, Method, Schedule, Shifted, System, Work};
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
}

/// Bounds on an operator.
#[derive(Debug, Clone, Copy)]
pub struct Known {
    /// Gershgorin's: what every step finds first, whatever steps were before it.
    pub proven: Bounds,
    /// The same, lowered by power iteration, where that was needed.
    refined: Option<Bounds>,
    /// No bound on the spectrum can be less.
    floor: f64,
}

impl System for Heat<'_> {
    fn rate(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<()> {
        Heat::rate(self, t, y, dy)
    }

    fn linearise(&mut self, t: f64, y: &[f64], diagonal: &mut [f64], weight: &mut [f64]) -> Result<Linear> {
        let circles = self.circles(t, y)?;
        if let Some(i) = sum::first(self.pool, circles.len(), |i| !circles[i].1.is_finite()) {
            let rule = "too large: its product with the pair weights exceeds all numbers";
            return Err(Error::bad_at("kappa", self.host[i] as usize, "given", rule));
        }
        diagonal.iter_mut().zip(&circles).for_each(|(d, circle)| *d = circle.1);
        weight.iter_mut().zip(self.inverse_capacity).for_each(|(w, &i)| *w = heat::capacity(i));
        self.linearise_surface(y)?;
        Ok(if self.is_linear() { Linear::Exact } else { Linear::Frozen })
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

    fn supply(&mut self, t: f64, y: &[f64]) -> Result<Option<f64>> {
        Heat::supply(self, t, y)
    }
}

/// The equations of a stage as the preconditioner takes them.
fn fine<'a>(pool: &'a Pool, Shifted { g, diagonal, weight }: Shifted<'a>) -> Fine<'a> {
    Fine { pool, g, diagonal, weight }
}

/// The largest explicit Euler step that is stable under these bounds; infinite where nothing diffuses.
pub fn explicit_limit(bounds: Bounds) -> f64 {
    2.0 / bounds.spectral
}

impl Motion<'_> {
    /// Advances `t` by exactly `dt` from `time`. Where the operator changes with T, bounds and schedule are made anew
    /// for each sub-step.
    pub fn advance(&mut self, time: f64, dt: f64, t: &mut [f64], report: &mut Report) -> Result<()> {
        if let Some(tolerance) = self.choices.tolerance.filter(|_| dt > 0.0 && !t.is_empty()) {
            return self.adapt(tolerance, (time, dt), t, report);
        }
        if self.choices.method.is_implicit() {
            return self.solve(time, dt, t, report);
        }
        let reference = self.norm(|i| t[i]);
        let mut done = 0.0;
        while done < dt && !t.is_empty() {
            let bounds = self.bounds(time + done, dt - done, t)?;
            let part = self.practical_limit(time + done, t, bounds, reference)?.min(dt - done);
            let (method, schedule) = self.schedule(part, bounds)?;
            if report.substeps == 0 {
                report.limit = explicit_limit(bounds);
            }
            report.stages = schedule.stages.into();
            let start = Instant::now();
            let steps = if self.heat.operator_is_fixed() { schedule.substeps } else { 1 };
            for k in 0..steps {
                let now = time + done + schedule.start(k);
                method.advance(&schedule, &mut self.heat, self.pool, now, t, self.work)?;
                report.substeps += 1;
                self.tell(time, dt, done + schedule.start(k + 1))?;
            }
            self.timers.add("stages", start.elapsed());
            let to_the_end = part == dt - done && steps == schedule.substeps;
            done = if to_the_end { dt } else { done + schedule.start(steps) };
        }
        Ok(())
    }

    /// One sub-step of an implicit method: stable whatever dt is.
    fn solve(&mut self, time: f64, dt: f64, t: &mut [f64], report: &mut Report) -> Result<()> {
        let calm = Bounds { spectral: 0.0, diagonal: 0.0 };
        let (method, options) = (self.choices.method, &self.choices.options);
        let schedule = method.schedule(dt, calm, options)?;
        if schedule.substeps == 0 || t.is_empty() {
            return Ok(());
        }
        let start = Instant::now();
        report.limit = explicit_limit(self.known_or_proven(time, t)?.proven);
        method.advance(&schedule, &mut self.heat, self.pool, time, t, self.work)?;
        self.timers.add("solve", start.elapsed());
        (report.substeps, report.stages) = (1, schedule.stages.into());
        self.tell(time, dt, dt)
    }

    /// Sub-steps of the length that a tolerance allows, none longer than is stable.
    fn adapt(&mut self, tolerance: f64, (time, dt): (f64, f64), t: &mut [f64], report: &mut Report) -> Result<()> {
        let (method, options) = (self.choices.method, &self.choices.options);
        let (start, before, volume) = (Instant::now(), self.heat.applications, self.heat.volume);
        // No tolerance makes a step possible that is too long for stability alone.
        let bounds = self.stability(time, dt, t)?;
        let mut schedule = method.schedule(dt, bounds, options)?;
        report.limit =
            explicit_limit(if method.is_implicit() { self.known_or_proven(time, t)?.proven } else { bounds });
        let control = Control { method, tolerance };
        let mut pace = Adaptive::new(control, self.pool, volume, &mut self.heat, (time, dt), t)?;
        let mut done = 0.0;
        while done < dt {
            let (now, rest) = (time + done, dt - done);
            let part = pace.next(rest);
            let bounds = self.stability(now, part, t)?;
            schedule = method.schedule(part, bounds, options)?;
            if pace.attempt(&schedule, &mut self.heat, now, t, self.work)? {
                done = if schedule.dt == rest { dt } else { done + schedule.dt };
                report.substeps += 1;
                self.tell(time, dt, done)?;
            }
            self.refuse_what_does_not_end(&pace, (dt, dt - done), self.heat.applications - before)?;
        }
        self.timers.add(if method.is_implicit() { "solve" } else { "stages" }, start.elapsed());
        (report.stages, report.rejected, self.work.slack) = (schedule.stages.into(), pace.rejected, pace.slack);
        Ok(())
    }

    /// What bounds the length of a sub-step: nothing for an implicit method.
    fn stability(&mut self, time: f64, dt: f64, t: &[f64]) -> Result<Bounds> {
        let calm = Bounds { spectral: 0.0, diagonal: 0.0 };
        if self.choices.method.is_implicit() { Ok(calm) } else { self.bounds(time, dt, t) }
    }

    /// Sub-steps may become so short, or so many, that the end is out of reach.
    fn refuse_what_does_not_end(&self, pace: &Adaptive, (dt, rest): (f64, f64), applications: u64) -> Result<()> {
        let (allowed, part) = (self.choices.options.max_applications, pace.next(rest));
        let ahead = if rest > 0.0 { rest / part } else { 0.0 };
        match pace.failure() {
            Some(failure) if ahead > allowed as f64 => Err(failure.clone()),
            _ if applications > allowed || part < f64::EPSILON * rest => {
                Err(Error::StepTooLarge { dt, needed: applications.saturating_add(ahead as u64), allowed })
            }
            _ => Ok(()),
        }
    }

    /// The longest sub-step of a stabilised method in which T changes, at the present rate, by no more than `change`
    /// times its spread at the beginning. Stability allows more, but then one sub-step of second order would have to
    /// follow a decay by several factors of e, and modes that it cannot resolve would ring instead of dying (the
    /// practical step limit of Caplan et al. 2024 has the same purpose). Never below what three stages can do, less
    /// some rounding that would ask for five.
    fn practical_limit(&mut self, time: f64, t: &[f64], bounds: Bounds, reference: f64) -> Result<f64> {
        if !self.follows_t() {
            return Ok(f64::INFINITY);
        }
        let mut rate = memory::filled("rate", t.len(), 0.0)?;
        self.heat.rate(time, t, &mut rate)?;
        let speed = self.norm(|i| rate[i]);
        Ok((self.choices.change * reference / speed).max(self.shortest(bounds)))
    }

    /// Whether sub-steps are cut by how fast T changes.
    fn follows_t(&self) -> bool {
        let pinned = self.choices.options.stages.is_some();
        self.choices.method.is_stabilised() && !pinned && self.choices.change.is_finite()
    }

    /// The shortest sub-step that T asks for: what the fewest stages can do.
    fn shortest(&self, bounds: Bounds) -> f64 {
        self.choices.method.limit(bounds) * (1.0 - 4.0 * f64::EPSILON)
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
        let enough = self.plan.leaves_out(&rules::PROVEN_BOUND) && self.is_least_work(dt, known);
        let bounds = if enough { known.proven } else { self.refined(known, t)? };
        self.timers.add("bound", start.elapsed());
        Ok(bounds)
    }

    /// The best bounds there are: Gershgorin's, lowered by power iteration.
    pub fn refined_bounds(&mut self, time: f64, t: &[f64]) -> Result<Bounds> {
        let known = self.known_or_proven(time, t)?;
        self.refined(known, t)
    }

    fn refined(&mut self, known: Known, t: &[f64]) -> Result<Bounds> {
        if let Some(bounds) = known.refined {
            return Ok(bounds);
        }
        let bounds = self.refine(known, t)?;
        self.remember(Known { refined: Some(bounds), ..known });
        Ok(bounds)
    }

    /// Whether the proven bound asks for the very sub-steps that the least possible one asks for, and with it every
    /// bound between them.
    fn is_least_work(&self, dt: f64, known: Known) -> bool {
        let least = Bounds { spectral: known.floor, ..known.proven };
        let steps = |bounds| self.schedule(dt, bounds).ok().map(|(method, s)| (method.name, s.substeps, s.stages));
        let uncut = !self.follows_t() || dt <= self.shortest(known.proven);
        uncut && steps(known.proven).is_some_and(|proven| steps(least) == Some(proven))
    }

    /// The best bounds that cost no more than one application: for a report, or a choice between methods.
    pub fn known_or_proven(&mut self, time: f64, t: &[f64]) -> Result<Known> {
        if let Some(known) = self.known.filter(|_| self.heat.operator_is_fixed()) {
            return Ok(known);
        }
        let known = self.proven(time, t)?;
        if !self.plan.leaves_out(&rules::DECAYS) && self.heat.has_spectrum() {
            self.refuse_growing_modes(t)?;
        }
        self.remember(known);
        Ok(known)
    }

    /// The fastest growth of a mode of the operator, and its largest rate, 1/s.
    pub fn growth(&mut self, t: &[f64]) -> Result<(f64, f64)> {
        let weight = self.linearise_about(t)?;
        arnoldi::rightmost(self.pool, &weight, |x, y| self.heat.linear(x, y))
    }

    /// Makes the operator linear about T; answers the capacities, in whose norm it is symmetric if it is at all.
    fn linearise_about(&mut self, t: &[f64]) -> Result<Vec<f64>> {
        self.heat.linearise_surface(t)?;
        memory::collected("capacities", self.heat.inverse_capacity.iter().map(|&i| heat::capacity(i)))
    }

    /// An operator whose modes grow is of no use, however small the step.
    fn refuse_growing_modes(&mut self, t: &[f64]) -> Result<()> {
        let start = Instant::now();
        let (growth, fastest) = self.growth(t)?;
        self.timers.add("spectrum", start.elapsed());
        if growth <= GROWS * fastest || self.choices.allow_unstable {
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
        self.timers.add("circles", start.elapsed());
        match proven.spectral.is_finite() {
            true => Ok(Known { proven, refined: None, floor }),
            false => Err(Error::bad("kappa", "too large", "its product with the pair weights exceeds all numbers")),
        }
    }

    /// The same, lowered by power iteration. Exchange with the surroundings is linearised.
    fn refine(&mut self, Known { proven, floor, .. }: Known, t: &[f64]) -> Result<Bounds> {
        if proven.spectral == 0.0 {
            return Ok(proven);
        }
        let weight = self.linearise_about(t)?;
        let spectral = spectrum::largest(self.pool, &weight, proven.spectral, |x, y| self.heat.linear(x, y))?;
        Ok(Bounds { spectral: spectral.max(floor), ..proven })
    }

    fn tell(&mut self, time: f64, dt: f64, done: f64) -> Result<()> {
        match self.progress.as_mut().map_or(0, |progress| progress(time + done, done / dt)) {
            0 => Ok(()),
            _ => Err(Error::Cancelled),
        }
    }
}
