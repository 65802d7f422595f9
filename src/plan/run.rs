//! One step: prepare, stages on a private copy, check, commit. A step that fails has changed nothing.

use super::choices::Promise;
use super::input::Energy;
use super::motion::explicit_limit;
use super::state::{Input, Made, State};
use super::{Choices, Plan, Report, passes, rules};
use crate::error::{Error, Result};
use crate::integrator::{Bounds, Range};
use crate::memory;
use crate::model::fields::{self, Slot};
use crate::model::heat;
use crate::sum;
use std::time::Instant;

/// How far, relative to the largest |T|, rounding may carry a value over a bound that the method keeps.
const ROUNDING: f64 = 1e-12;

/// Energy that an operator may make or lose, relative to what is out of balance.
const MADE: f64 = 0.01;
/// How far T may leave the bounds of the T that the host gave where the operator promises none, relative to their
/// distance: a hot disc rings by 5 % under two-first, whatever dt is.
const RINGING: f64 = 0.1;

/// Spread of T, relative to T, below which it is counted from its middle: subtracted without rounding.
const NEARLY: f64 = 1e-3;

/// What is true of T before a step, to be compared with after.
struct Before {
    /// What the maximum principle allows T to be.
    range: Range,
    size: f64,
    spread: f64,
}

impl State {
    /// Advances T by exactly `dt`.
    ///
    /// # Errors
    /// `BadValue` for a dt that is negative or not finite; any error of [`State::prepare`]; `StepTooLarge`,
    /// `NotFinite`, `OutOfBounds`, `Growth`, `Cancelled`, `CallbackFailed`. The state is as it was in every case.
    pub fn step(&mut self, dt: f64) -> Result<Report> {
        let (method, auto) = (self.choices.method, self.choices.auto.clone());
        let done = self.take_step(dt);
        if done.is_err() {
            // What was chosen for a step that was not taken.
            (self.choices.method, self.choices.auto) = (method, auto);
        }
        done
    }

    fn take_step(&mut self, dt: f64) -> Result<Report> {
        if !(dt >= 0.0 && dt.is_finite()) {
            return Err(Error::bad("dt", dt, "a step must be finite and not negative"));
        }
        if !(self.time + dt).is_finite() {
            return Err(Error::bad("dt", dt, &format!("the time would be beyond all numbers after {:e}", self.time)));
        }
        let start = Instant::now();
        self.set_anew()?;
        let mut plan = self.prepare("step")?;
        if self.choose(&plan, dt)? {
            plan = self.prepare("step")?;
        }
        self.refuse_leaks()?;
        let (mut t, time) = (self.each(fields::T)?, self.time);
        let (applications, iterations) = (self.applications, self.work.iterations);
        let before = self.before(&plan, dt, &t);
        let range = if self.choices.bounds == Promise::Kept { before.range } else { Range::FINITE };
        let integrator = self.choices.method.name;
        let mut report = Report { dt, integrator, energy_before: self.finite_energy(&t)?, ..Report::default() };
        let origin = self.origin(&t);
        self.counted_from(origin, &mut t, |state, t| {
            state.with_motion(&plan, |motion| {
                motion.range = Range { low: range.low - origin, high: range.high - origin };
                motion.advance(time, dt, t, &mut report)
            })
        })
        .map_err(|error| self.of_whole_step(error, dt))?;
        let checked = Instant::now();
        self.check(&plan, &before, &t)?;
        (report.t_min, report.t_max) = self.extrema(&t);
        report.energy = self.finite_energy(&t)?;
        if self.inputs[fields::FIXED] != Input::Number(0.0) {
            let came_in = report.heat_source + report.heat_surface;
            report.heat_fixed = report.energy - report.energy_before - came_in;
        }
        let made = self.made_by(dt, &t, report.energy - report.energy_before)?;
        self.timers.add(passes::CHECK.name, checked.elapsed());

        (self.inputs[fields::T], self.made) = (Input::Each(t), made);
        if self.choices.bounds == Promise::Watched && before.range.is_bound() {
            // Later steps start from wherever this one may have come to.
            self.span = self.span.map(|_| before.range);
        }
        if self.energy != Energy::Follows {
            self.energy = Energy::Moved;
        }
        self.time += dt;
        self.steps += 1;
        self.was_done_here = true;
        report.time = self.time;
        report.applications = self.applications - applications;
        report.iterations = self.work.iterations - iterations;
        report.seconds = start.elapsed().as_secs_f64();
        Ok(report)
    }

    /// Chooses the method for a step, where that is left to us; says whether it is another one than before.
    ///
    /// # Errors
    /// As [`State::bounds`].
    pub fn choose(&mut self, plan: &Plan, dt: f64) -> Result<bool> {
        if self.choices.auto.is_none() {
            return Ok(false);
        }
        let (t, time) = (self.each(fields::T)?, self.time);
        let bounds = self.with_motion(plan, |motion| {
            let known = motion.known_or_proven(time, &t)?.proven;
            motion.with_cooling(known, time, &t)
        })?;
        let (stiffness, choices) = (dt / explicit_limit(bounds), &mut self.choices);
        let (controlled, solvable) = (choices.tolerance.is_some(), choices.operator.dissipative);
        let Some(auto) = &mut choices.auto else { return Ok(false) };
        let before = std::mem::replace(&mut choices.method, auto.choose(stiffness, controlled, solvable)?);
        Ok(before.name != choices.method.name)
    }

    /// dT/dt now.
    ///
    /// # Errors
    /// Any error of [`State::prepare`]; `CallbackFailed`.
    pub fn rate(&mut self) -> Result<Vec<f64>> {
        self.set_anew()?;
        // It counts for the plan, and only if it succeeds for what comes after.
        let before = self.rates;
        self.rates += 1;
        let rate = self.rate_now();
        match &rate {
            Ok(_) => self.was_done_here = true,
            Err(_) => self.rates = before,
        }
        rate
    }

    fn rate_now(&mut self) -> Result<Vec<f64>> {
        let mut plan = self.prepare_fresh("rate")?;
        // A bound wants stored weights.
        if !(plan.leaves_out(&rules::USED_ONCE) && plan.leaves_out(&rules::RATE_ONLY)) {
            plan = self.prepare("rate")?;
        }
        let (t, time) = (self.each(fields::T)?, self.time);
        let mut rate = memory::filled("rate", t.len(), 0.0)?;
        self.with_motion(&plan, |motion| {
            if !plan.leaves_out(&rules::RATE_ONLY) {
                motion.proven(time, &t)?;
            }
            motion.heat.rate(time, &t, &mut rate)
        })?;
        self.refuse_what_is_not_finite("dT/dt", &rate)?;
        Ok(rate)
    }

    /// Bounds on the operator now, refined by iterations.
    pub fn bounds(&mut self) -> Result<Bounds> {
        let plan = self.prepare("limit")?;
        let (t, time) = (self.each(fields::T)?, self.time);
        self.with_motion(&plan, |motion| motion.refined_bounds(time, &t))
    }

    /// The largest real part in the spectrum of the operator now, 1/s.
    pub fn growth(&mut self, t: &[f64]) -> Result<f64> {
        let plan = self.prepare("growth_rate")?;
        let time = self.time;
        self.with_motion(&plan, |motion| {
            motion.heat.kappa_of_t(time, t)?;
            Ok(motion.growth(time, t)?.0)
        })
    }

    /// The largest stable explicit Euler step now; infinite where nothing diffuses.
    pub fn limit(&mut self) -> Result<f64> {
        Ok(explicit_limit(self.bounds()?))
    }

    /// Σ m c_v T.
    pub fn energy(&self, t: &[f64]) -> f64 {
        let inputs = &self.inputs;
        let value = |slot: Slot, i: usize| inputs[slot].at(i).unwrap_or(0.0);
        sum::sum(&self.pool, t.len(), |i| value(fields::M, i) * value(fields::C_V, i) * t[i])
    }

    fn finite_energy(&self, t: &[f64]) -> Result<f64> {
        let energy = self.energy(t);
        if !energy.is_finite() {
            let rule = "the energy, the sum of m c_v T, is beyond all numbers: choose other units";
            return Err(Error::bad("T", format!("up to {:e}", sum::max(&self.pool, t.len(), |i| t[i].abs())), rule));
        }
        Ok(energy)
    }

    /// The smallest and the largest value.
    pub fn extrema(&self, t: &[f64]) -> (f64, f64) {
        (sum::min(&self.pool, t.len(), |i| t[i]), sum::max(&self.pool, t.len(), |i| t[i]))
    }

    /// What T is counted from in a step: its middle, where it differs by little of itself and nothing depends on more than
    /// differences. What rounding does is then in proportion to them.
    fn origin(&self, t: &[f64]) -> f64 {
        let absolute = self.kappa_of_t() || self.source_host.is_some();
        if absolute || self.surface.as_ref().is_some_and(|s| !s.is_linear()) {
            return 0.0;
        }
        let (low, high) = self.extrema(t);
        let (low, high) = self.surface.as_ref().map_or((low, high), |s| s.with_surroundings(low, high));
        let middle = 0.5 * low + 0.5 * high;
        if high - low <= NEARLY * middle.abs() { middle } else { 0.0 }
    }

    /// Calls `work` with T counted from `origin`.
    fn counted_from(
        &mut self,
        origin: f64,
        t: &mut [f64],
        work: impl FnOnce(&mut State, &mut [f64]) -> Result<()>,
    ) -> Result<()> {
        if origin == 0.0 {
            return work(self, t);
        }
        let moved = self.surface.as_ref().map(|s| s.counted_from(origin)).transpose()?;
        let surface = std::mem::replace(&mut self.surface, moved);
        self.pool.update(t, |_, part| part.iter_mut().for_each(|t| *t -= origin));
        let done = work(self, t);
        self.pool.update(t, |_, part| part.iter_mut().for_each(|t| *t += origin));
        self.surface = surface;
        done.map_err(|error| match error {
            Error::OutOfBounds { index, value, low, high, promise } => {
                let [value, low, high] = [value, low, high].map(|v| v + origin);
                Error::OutOfBounds { index, value, low, high, promise }
            }
            other => other,
        })
    }

    fn before(&mut self, plan: &Plan, dt: f64, t: &[f64]) -> Before {
        let (low, high) = self.extrema(t);
        if self.choices.bounds == Promise::Kept || self.span.is_none() {
            self.span = Some(Range { low, high });
        }
        let reached = |span| match self.choices.bounds {
            Promise::Watched => self.reached_in(dt, span),
            _ => self.reached(span),
        };
        let range = self.span.filter(|_| !t.is_empty()).map_or(Range::FINITE, reached);
        let spread = if self.may_grow(plan) { self.spread(t) } else { 0.0 };
        Before { range, size: high.abs().max(low.abs()), spread }
    }

    /// What T may become that starts within a range: the surroundings' temperatures as well, and anything on the side on
    /// which it is heated or cooled from outside.
    fn reached(&self, from: Range) -> Range {
        if self.source_host.is_some() {
            return Range::FINITE;
        }
        let mut range = self.surface.as_ref().map_or(from, |surface| {
            let (low, high) = surface.reached(from.low, from.high);
            Range { low, high }
        });
        let source = &self.inputs[fields::SOURCE];
        let heats = |sign: f64| match source {
            Input::Each(v) => v.iter().any(|s| sign * s > 0.0),
            other => other.at(0).is_some_and(|s| sign * s > 0.0),
        };
        if heats(1.0) {
            range.high = Range::FINITE.high;
        }
        if heats(-1.0) {
            range.low = Range::FINITE.low;
        }
        range
    }

    /// The same after so long, with what heats and cools T at most; where a function of the host's does, anything.
    fn reached_in(&self, dt: f64, from: Range) -> Range {
        let (Some(geometry), Some(inverse), None) = (&self.geometry, &self.inverse_capacity, &self.source_host) else {
            return self.reached(from);
        };
        let source = |i: usize| self.inputs[fields::SOURCE].at(i).unwrap_or(0.0);
        let released = (0..inverse.len()).map(|i| source(i) * geometry.volume[i] * inverse[i]);
        let Ok(mut given) = memory::collected("what is given", released) else { return self.reached(from) };
        let (mut low, mut high) = (from.low, from.high);
        if let Some(surface) = &self.surface {
            (low, high) = surface.with_surroundings(low, high);
            surface.given(|i, power| given[i] += power * inverse[i]);
        }
        let most = |sign: f64| sum::max(&self.pool, given.len(), |i| sign * given[i]).max(0.0);
        Range { low: low - dt * most(-1.0), high: high + dt * most(1.0) }
    }

    /// Whether the norm of T is to be checked: nothing heats, and the operator does not rule growth out.
    fn may_grow(&self, plan: &Plan) -> bool {
        let isolated = self.exchanging() == 0 && !self.heated() && self.inputs[fields::FIXED] == Input::Number(0.0);
        isolated && !plan.leaves_out(&rules::POSITIVE)
    }

    /// The norm of T − mean(T), weighted by capacity: what diffusion can only lower.
    fn spread(&mut self, t: &[f64]) -> f64 {
        let (Some(inverse), pool) = (&self.inverse_capacity, &self.pool) else { return 0.0 };
        let weight = |i: usize| if inverse[i] > 0.0 { 1.0 / inverse[i] } else { 0.0 };
        self.timers.time(passes::NORM.name, || sum::spread(pool, t.len(), weight, |i| t[i]))
    }

    /// The host's number of a particle.
    pub fn host(&self, i: usize) -> usize {
        self.cloud.as_ref().map_or(i, |c| c.host[i] as usize)
    }

    /// What steps have made of energy with this one, by an operator that is not the same from both sides of a pair, where
    /// nothing else can.
    fn made_by(&self, dt: f64, after: &[f64], energy: f64) -> Result<Made> {
        let open =
            self.exchanging() > 0 || self.source_host.is_some() || self.inputs[fields::FIXED] != Input::Number(0.0);
        if open || self.choices.operator.conserves {
            return Ok(Made::default());
        }
        let (before, released) = (self.each(fields::T)?, dt * self.released());
        let levelled = self.unevenness(&before).max(self.unevenness(after));
        let made = Made { energy: self.made.energy + energy - released, levelled: self.made.levelled.max(levelled) };
        if made.share() > MADE && !self.choices.allow.energy {
            let rule = format!(
                "since T was set its weights, which are not the same from both sides of a pair, have made {:.1e} J of the \
                 {:.1e} J that are out of balance; nothing was changed: use operator=brookshaw or projected, more \
                 particles beside free surfaces, a smoother T, or insist with allow=energy",
                made.energy, made.levelled
            );
            return Err(Error::bad("operator", self.choices.operator.name, &rule));
        }
        Ok(made)
    }

    /// The power of the source, W.
    fn released(&self) -> f64 {
        let Some(geometry) = &self.geometry else { return 0.0 };
        let source = &self.inputs[fields::SOURCE];
        sum::sum(&self.pool, geometry.volume.len(), |i| source.at(i).unwrap_or(0.0) * geometry.volume[i])
    }

    /// What flows through a free surface, or is released as a function says, cannot be followed where weights are not the
    /// same from both sides of a pair; heat that came in at a surface was seen to arrive to three quarters.
    fn refuse_leaks(&self) -> Result<()> {
        let leaks = self.weights.as_ref().is_some_and(|w| w.paired) && !self.choices.allow.energy;
        if !leaks || (self.exchanging() == 0 && self.source_host.is_none()) {
            return Ok(());
        }
        let rule = "beside free surfaces its weights are not the same from both sides of a pair, and much of what comes in \
                    there is lost: use operator=brookshaw or projected, or insist with allow=energy";
        Err(Error::bad("operator", self.choices.operator.name, rule))
    }

    /// Σ m c_v |T − mean|
    fn unevenness(&self, t: &[f64]) -> f64 {
        let Some(inverse) = &self.inverse_capacity else { return 0.0 };
        let capacity = |i: usize| heat::capacity(inverse[i]);
        let total = sum::sum(&self.pool, t.len(), capacity);
        let mean = sum::sum(&self.pool, t.len(), |i| capacity(i) / total * t[i]);
        sum::sum(&self.pool, t.len(), |i| capacity(i) * (t[i] - mean).abs())
    }

    fn refuse_what_is_not_finite(&self, what: &str, values: &[f64]) -> Result<()> {
        let particles = self.cloud.as_ref().map_or(&[][..], |cloud| &cloud.host);
        heat::refuse_what_is_not_finite(&self.pool, particles, values, |_| what.into())
    }

    fn check(&mut self, plan: &Plan, before: &Before, t: &[f64]) -> Result<()> {
        self.refuse_what_is_not_finite("T", t)?;
        self.refuse_below_zero(t)?;
        let slack = ROUNDING * before.size + self.work.slack;
        if self.may_grow(plan) {
            let after = self.spread(t);
            if after > before.spread * (1.0 + 1e-9) + slack {
                let operator = self.choices.operator.name.into();
                return Err(Error::Growth { before: before.spread, after, operator });
            }
        }
        self.check_bounds(before.range, slack, t)
    }

    /// What radiates has an absolute temperature.
    fn refuse_below_zero(&self, t: &[f64]) -> Result<()> {
        let Some(surface) = &self.surface else { return Ok(()) };
        let Some(i) = surface.radiating().find(|&i| t[i] < 0.0) else { return Ok(()) };
        let promise =
            "absolute temperatures keep, and radiation needs: a source or flux_in takes more than there is".into();
        Err(Error::OutOfBounds { index: self.host(i), value: t[i], low: 0.0, high: f64::MAX, promise })
    }

    /// An error that names the step that the host asked for, whatever part of it failed, and advice that can be followed.
    fn of_whole_step(&self, error: Error, dt: f64) -> Error {
        let Choices { method, auto, operator, .. } = &self.choices;
        let no_other = auto.is_some() || method.is_implicit() || !operator.dissipative;
        match error {
            Error::StepTooLarge { needed, allowed, remedy, .. } => {
                let remedy = if no_other { "ask for less by a larger tolerance".into() } else { remedy };
                Error::StepTooLarge { dt, needed, allowed, remedy }
            }
            other => other,
        }
    }

    /// Whether T is where the maximum principle has it: exactly where that is promised, nearly where the operator promises
    /// no such thing.
    fn check_bounds(&self, range: Range, slack: f64, t: &[f64]) -> Result<()> {
        let room = match self.choices.bounds {
            Promise::Kept => slack,
            Promise::Watched => slack + RINGING * (range.high - range.low),
            Promise::Free => return Ok(()),
        };
        let (low, high) = (range.low - room, range.high + room);
        let Some(i) = sum::first(&self.pool, t.len(), |i| t[i] < low || t[i] > high) else { return Ok(()) };
        let promise = match self.choices.bounds {
            Promise::Kept => format!("{} with bounds=keep keeps", self.choices.method.name),
            _ => format!("diffusion keeps and operator={} misses", self.choices.operator.name),
        };
        Err(Error::OutOfBounds { index: self.host(i), value: t[i], low: range.low, high: range.high, promise })
    }
}
