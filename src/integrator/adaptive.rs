//! Sub-steps as long as they may be, for every method: an estimate of each sub-step's error where there is a tolerance,
//! bounds on y where there is a maximum principle, and a controller that takes a sub-step or does it again shorter.
//!
//! Explicit and stabilised methods of order 1 and 2 are held against the trapezoidal rule, for one rate more: the
//! estimate of Sommeijer, Shampine & Verwer (J. Comput. Appl. Math. 88, 315, 1998), 0.8 (y_0 − y_1) + 0.4 dt (f_0 +
//! f_1), exact for methods of order 1 without the 0.8. All others are done once more in two halves, and the halves are
//! kept (Hairer, Nørsett & Wanner, Solving ODEs I, II.4): implicit methods damp what is too stiff to be resolved, and
//! such an estimate does too.

use super::{Family, Method, Range, Schedule, System, Tally, Work, tallied};
use crate::error::{Error, Result};
use crate::memory;
use crate::pool::Pool;
use crate::sum;

/// How much shorter a sub-step is than the one that would just do.
const SAFETY: f64 = 0.9;

/// Shortest and longest next sub-step, relative to the last.
const RANGE: (f64, f64) = (0.1, 5.0);

/// Exponents of the present and of the last error in units of 1/(order + 1): a PI controller, which rejects less often
/// than one without memory where stiffness sets the pace (Gustafsson 1991; Hairer & Wanner, Solving ODEs II, IV.2).
const PROPORTIONAL: (f64, f64) = (0.7, 0.4);

/// By how much a sub-step is shortened that failed without an estimate, and by how much those after it may be longer than
/// the one before.
const RETREAT: f64 = 0.25;
const RECOVERY: f64 = 1.5;

/// The largest share of what is inside the bounds that may be moved to bring in what is outside: a tenth of an error that
/// counts as none.
const CONFINED: f64 = 1e-4;

/// Of a step, the shortest first sub-step that is guessed: a spread of next to nothing says little of how long is too long.
const SHORTEST: f64 = 1e-9;

/// Differences of so many roundings of y are no error of the method.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// What decides on the length of a sub-step.
#[derive(Debug, Clone, Copy)]
pub struct Control {
    pub method: &'static Method,
    /// Largest error of a sub-step, as root mean square, relative to the spread of y at the beginning, or to how far y
    /// has moved since then where that is more. None: errors are not estimated.
    pub tolerance: Option<f64>,
    /// What no sub-step may leave.
    pub range: Range,
    /// What is known beforehand of how far y will move, as root mean square: it counts as y's spread does.
    pub raises: f64,
}

/// One step in sub-steps that may be rejected.
pub struct Adaptive<'a> {
    control: Control,
    pool: &'a Pool,
    /// Of the mean.
    weight: &'a [f64],
    spread: f64,
    start: Vec<f64>,
    trial: Vec<f64>,
    other: Vec<f64>,
    rate: Vec<f64>,
    /// Length of the next sub-step, as far as accuracy is concerned.
    length: f64,
    /// Beyond this length a sub-step failed, for this reason; longer ones are tried again after those that succeed.
    failure: Option<(f64, Error)>,
    /// Of the last sub-step, in units of what is allowed; none after a rejection.
    last: Option<f64>,
    pub rejected: u64,
    /// How far the sub-steps may be from the solutions of their equations, in sum.
    pub slack: f64,
    /// What the sub-steps have added to what is tallied.
    pub tally: Tally,
}

impl<'a> Adaptive<'a> {
    /// Prepares a step of `dt` from (t, y). With a tolerance the first sub-step is the one in which, at the present rate,
    /// y moves by the share of its spread that the tolerance allows for an error of this order.
    ///
    /// # Errors
    /// `NoMemory`; any error of the system.
    pub fn new(
        control: Control,
        pool: &'a Pool,
        weight: &'a [f64],
        system: &mut dyn System,
        (t, dt): (f64, f64),
        y: &[f64],
    ) -> Result<Adaptive<'a>> {
        let array = || memory::filled("error control", y.len(), 0.0);
        let (mut rate, start) = (array()?, memory::copied("error control", y)?);
        system.rate(t, y, &mut rate)?;
        // What rounding makes of equal values is no spread.
        let size = sum::max(pool, y.len(), |i| y[i].abs());
        let spread = sum::spread(pool, y.len(), |i| weight[i], |i| y[i]);
        let spread = control.raises.max(if spread > ROUNDING * size { spread } else { 0.0 });
        let speed = sum::rms(pool, y.len(), |i| weight[i], |i| rate[i]);
        let guess = control.tolerance.map_or(dt, |tolerance| tolerance.powf(control.exponent()) * (spread / speed));
        let length = if guess > 0.0 { guess.max(SHORTEST * dt).min(dt) } else { dt };
        let (trial, other) = (array()?, array()?);
        let (failure, last, rejected, slack) = (None, None, 0, 0.0);
        Ok(Adaptive {
            control,
            pool,
            weight,
            spread,
            start,
            trial,
            other,
            rate,
            length,
            failure,
            last,
            rejected,
            slack,
            tally: Tally::default(),
        })
    }

    /// The next sub-step of a step of which `rest` is left, none longer than `most`: the rest in equal parts.
    pub fn next(&self, rest: f64, most: f64) -> f64 {
        let failed = self.failure.as_ref().map_or(f64::INFINITY, |f| f.0);
        // A little less than the quotient: its last digits differ from one system of units to another.
        rest / ((1.0 - 1e-9) * (rest / self.length.min(failed).min(most))).ceil().max(1.0)
    }

    /// The rate at the beginning.
    pub fn rate(&self) -> &[f64] {
        &self.rate
    }

    /// How far y has come from its beginning, root mean square.
    pub fn moved(&self, y: &[f64]) -> f64 {
        sum::rms(self.pool, y.len(), |i| self.weight[i], |i| y[i] - self.start[i])
    }

    /// Why sub-steps are as short as they are, where it is not for their errors.
    pub fn failure(&self) -> Option<&Error> {
        self.failure.as_ref().map(|f| &f.1)
    }

    /// Tries one sub-step of `schedule.dt` from (t, y) by a method, the controlled one or one that takes its place; says
    /// whether y was advanced.
    ///
    /// # Errors
    /// Any error of the system that a shorter sub-step would not mend.
    pub fn attempt(
        &mut self,
        method: &'static Method,
        schedule: &Schedule,
        system: &mut dyn System,
        t: f64,
        y: &mut [f64],
        work: &mut Work,
    ) -> Result<bool> {
        let dt = schedule.dt;
        let estimated = self.estimate(method, schedule, system, t, y, work);
        let error = match estimated.and_then(|error| self.kept(error, work.rounding, system)) {
            Err(error) if self.shorter_may_do(&error, system) => {
                self.failure = Some((RETREAT * dt, error));
                f64::INFINITY
            }
            other => other?,
        };
        let accepted = error <= 1.0;
        self.length = dt * self.factor(error);
        if accepted {
            y.copy_from_slice(&self.trial);
            if self.control.tolerance.is_some() {
                std::mem::swap(&mut self.rate, &mut self.other);
            }
            self.slack += work.slack;
            tallied(&mut self.tally, 1.0, work.tally);
            self.last = Some(error);
            self.failure.iter_mut().for_each(|(most, _)| *most = most.max(RECOVERY * dt));
        } else {
            self.rejected += 1;
            self.last = None;
        }
        Ok(accepted)
    }

    /// The error of what is in `trial`, if that is within its bounds, or is brought back.
    fn kept(&mut self, error: f64, rounding: f64, system: &mut dyn System) -> Result<f64> {
        let range = self.control.range;
        let Some(index) = range.first_outside(self.pool, &self.trial) else { return Ok(error) };
        let value = self.trial[index];
        if value.is_finite() && error > 1.0 {
            return Ok(error);
        }
        let room = rounding + ROUNDING * sum::max(self.pool, self.trial.len(), |i| self.trial[i].abs());
        if system.confine(range, CONFINED, &mut self.trial)? || range.clamp(self.pool, room, &mut self.trial) {
            return Ok(error);
        }
        let promise = format!("{} keeps in short sub-steps", self.control.method.name);
        Err(Error::OutOfBounds { index, value, low: range.low, high: range.high, promise })
    }

    /// Whether an error may be one of the sub-step's length: equations unsolved, bounds left, or a kappa asked for at a
    /// stage that overshoots.
    fn shorter_may_do(&self, error: &Error, system: &dyn System) -> bool {
        match error {
            Error::NotConverged { .. } => self.control.tolerance.is_some() || !system.is_linear(),
            other => matches!(other, Error::BadElement { .. } | Error::OutOfBounds { .. }),
        }
    }

    /// By what the length of a sub-step changes after this error.
    fn factor(&self, error: f64) -> f64 {
        let (exponent, (present, past)) = (self.control.exponent(), PROPORTIONAL);
        let error = error.max(f64::MIN_POSITIVE);
        match self.last {
            _ if !error.is_finite() => RANGE.0,
            _ if error > 1.0 => (SAFETY * error.powf(-exponent)).max(RANGE.0),
            Some(last) if last > 0.0 => {
                let memory = last.powf(past * exponent);
                (SAFETY * error.powf(-present * exponent) * memory).clamp(RANGE.0, RANGE.1)
            }
            _ => (SAFETY * error.powf(-exponent)).clamp(RANGE.0, RANGE.1),
        }
    }

    /// Leaves the advanced y in `trial`, and returns its error in units of what is allowed.
    fn estimate(
        &mut self,
        method: &'static Method,
        schedule: &Schedule,
        system: &mut dyn System,
        t: f64,
        y: &[f64],
        work: &mut Work,
    ) -> Result<f64> {
        self.trial.copy_from_slice(y);
        let (pool, dt) = (self.pool, schedule.dt);
        if self.control.tolerance.is_none() {
            return method.advance(schedule, system, pool, t, &mut self.trial, work).map(|()| 0.0);
        }
        let Some(scale) = method.trapezoidal() else {
            let half = Schedule { dt: 0.5 * dt, ..*schedule };
            method.advance(&half, system, pool, t, &mut self.trial, work)?;
            let (slack, rounding, mut tally) = (work.slack, work.rounding, work.tally);
            method.advance(&half, system, pool, t + half.dt, &mut self.trial, work)?;
            let (slack, rounding) = (slack + work.slack, rounding + work.rounding);
            tallied(&mut tally, 1.0, work.tally);
            self.other.copy_from_slice(y);
            method.advance(schedule, system, pool, t, &mut self.other, work)?;
            (work.slack, work.rounding, work.tally) = (slack, rounding, tally);
            let share = 1.0 / (2f64.powi(method.order as i32) - 1.0);
            return Ok(self.measure(|i| share * (self.trial[i] - self.other[i])));
        };
        method.advance(schedule, system, pool, t, &mut self.trial, work)?;
        system.rate(t + dt, &self.trial, &mut self.other)?;
        Ok(self.measure(|i| scale * ((y[i] - self.trial[i]) + 0.5 * dt * (self.rate[i] + self.other[i]))))
    }

    fn measure(&self, error: impl Fn(usize) -> f64 + Sync + Send) -> f64 {
        let (pool, n, weight) = (self.pool, self.trial.len(), |i: usize| self.weight[i]);
        let (moved, size) = (self.moved(&self.trial), sum::max(pool, n, |i| self.trial[i].abs()));
        let allowed = self.control.tolerance.unwrap_or(0.0) * self.spread.max(moved) + ROUNDING * size;
        let error = sum::rms(pool, n, weight, error);
        match error / allowed {
            _ if error == 0.0 => 0.0,
            unknown if unknown.is_nan() => f64::INFINITY,
            error => error,
        }
    }
}

impl Control {
    /// Of the error of a sub-step, in its length: 1 over this.
    fn exponent(&self) -> f64 {
        1.0 / f64::from(self.method.order + 1)
    }
}

impl Method {
    /// What the difference from the trapezoidal rule is multiplied by to estimate the error; `None` where the method is
    /// better than that rule, or applied to what is too stiff for it.
    fn trapezoidal(&self) -> Option<f64> {
        match (&self.family, self.order) {
            (Family::Implicit(_), _) => None,
            (_, 1) => Some(1.0),
            (_, 2) => Some(0.8),
            _ => None,
        }
    }
}
