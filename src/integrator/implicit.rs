//! Diagonally implicit Runge-Kutta methods: Butcher's tables, and one loop for all of them.
//!
//! A stage solves Y = base + g rate(t, Y) by defect correction: the true residual F = base + g rate(t, Y) − Y, then
//! (I − g A) d = F with the linear operator A of the system about Y, then Y + d. Where the rate is linear, one
//! correction does it and the next residual is the check; where it is not, this is Picard's iteration, as A is frozen.
//! A correction that does not lower the residual is taken back by halves (a line search, Dennis & Schnabel 1983, 6.3):
//! what is left lies between two iterates, and so within their bounds.

use super::krylov::{Equations, Limits, add, unsolved};
use super::{Linear, Schedule, Shifted, System, Tally, Work, tallied};
use crate::error::{Error, Result};
use crate::pool::Pool;
use crate::sum;

/// Stage i is Y_i = y + dt Σ_j a[i][j] k_j, j ≤ i, at t + c[i] dt; the last one is the step (stiffly accurate). A zero on
/// the diagonal makes a stage explicit.
#[derive(Debug)]
pub struct Tableau {
    pub a: &'static [&'static [f64]],
    pub c: &'static [f64],
}

pub static BACKWARD_EULER: Tableau = Tableau { a: &[&[1.0]], c: &[1.0] };

pub static CRANK_NICOLSON: Tableau = Tableau { a: &[&[0.0], &[0.5, 0.5]], c: &[0.0, 1.0] };

/// 1 − 1/√2: second order and L-stable.
const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

pub static SDIRK2: Tableau = Tableau { a: &[&[GAMMA], &[1.0 - GAMMA, GAMMA]], c: &[GAMMA, 1.0] };

/// Most corrections of a stage.
const CORRECTIONS: u32 = 100;

/// By how much one correction of a frozen operator lowers the residual: solving further would be undone by the next.
const FORCING: f64 = 0.05;

/// The smallest share of a correction that is tried.
const LEAST_SHARE: f64 = 1.0 / 256.0;

/// The residual's rounding in units of (1 + g diagonal) |Y|: one for Y itself and a few for the sum over neighbours.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// By how much the residual may rise from one correction to the next before the correction is cut: where a front opens cold
/// particles, it rises once and falls for good.
const RISE: f64 = 4.0;

/// Beyond this rounding, relative to |Y|, a residual says nothing.
const ILLEGIBLE: f64 = 0.1;

/// Arrays that a stage is solved with: −diagonal, weight, residual, correction and two directions.
type Space = [Vec<f64>; 6];

impl Tableau {
    /// Stages that are solved for.
    pub fn solves(&self) -> u32 {
        self.a.iter().enumerate().filter(|(i, row)| row[*i] != 0.0).count() as u32
    }

    pub fn advance(
        &self,
        schedule: &Schedule,
        system: &mut dyn System,
        pool: &Pool,
        t: f64,
        y: &mut [f64],
        work: &mut Work,
    ) -> Result<()> {
        let dt = schedule.dt;
        let [base, stage, first, second, space @ ..] = work.arrays::<10>(y.len())?;
        let rates = [first, second];
        let (mut supplies, mut slack, mut rounding, mut iterations) = ([Some(0.0); 2], 0.0, 0.0, 0);
        let mut tallies = [Tally::default(); 2];
        stage.copy_from_slice(y);
        for (i, (a, c)) in self.a.iter().zip(self.c).enumerate() {
            let (time, g) = (t + c * dt, a[i] * dt);
            if g == 0.0 {
                // An explicit stage, or a step too short for numbers.
                system.rate(time, stage, rates[i])?;
                (tallies[i], supplies[i]) = (system.tally(), system.supply(time, stage)?);
                continue;
            }
            base.copy_from_slice(y);
            (0..i).for_each(|j| add(pool, base, dt * a[j], rates[j]));
            let solved = solve(system, pool, schedule.limits, (time, g), base, stage, space)?;
            (slack, iterations) = (solved.allowed, iterations + solved.iterations);
            (tallies[i], supplies[i]) = (system.tally(), system.supply(time, stage)?);
            if supplies[i] != Some(0.0) {
                rounding = solved.rounding;
            }
            let supplied = (0..=i).map(|j| Some(dt * a[j] * supplies[j]?)).sum::<Option<f64>>();
            if let Some(supplied) = supplied {
                slack += conserve(pool, g, supplied, y, stage, space);
            }
            // Not rate(Y): that would carry the residual, and be multiplied by dt once more.
            pool.update(rates[i], |start, part| {
                part.iter_mut().enumerate().for_each(|(k, rate)| *rate = (stage[start + k] - base[start + k]) / g);
            });
        }
        y.copy_from_slice(stage);
        (work.slack, work.rounding) = (slack, rounding);
        work.iterations += iterations;
        // Stiffly accurate: the step is its last stage.
        if let Some(weights) = self.a.last() {
            weights.iter().zip(tallies).for_each(|(a, tally)| tallied(&mut work.tally, dt * a, tally));
        }
        Ok(())
    }
}

/// How a stage was solved.
struct Solved {
    /// The largest residual that was allowed: for a matrix whose inverse is positive it bounds the error too.
    allowed: f64,
    /// The part of it that is rounding.
    rounding: f64,
    iterations: u64,
}

/// Solves Y = base + g rate(t, Y), starting from the Y given.
fn solve(
    system: &mut dyn System,
    pool: &Pool,
    limits: Limits,
    (t, g): (f64, f64),
    base: &[f64],
    y: &mut [f64],
    [diagonal, weight, residual, correction, p, q]: &mut Space,
) -> Result<Solved> {
    let n = y.len();
    let (mut spent, mut size, mut change) = (0, 0.0, None);
    let (mut worst, mut wanted) = (f64::INFINITY, 0.0);
    let mut taken = Taken { share: 0.0, before: f64::INFINITY };
    for _ in 0..CORRECTIONS {
        match system.rate(t, y, residual) {
            // Where a correction went too far, the rate may not be defined.
            Err(Error::BadElement { .. }) if taken.halve(pool, y, correction) => continue,
            done => done?,
        }
        pool.update(residual, |start, part| {
            part.iter_mut().enumerate().for_each(|(k, f)| *f = base[start + k] + g * *f - y[start + k]);
        });
        let linear = system.linearise(t, y, diagonal, weight)?;
        if linear == Linear::Unknown {
            return Err(Error::bad("integrator", "implicit", "it needs a system that knows its linear part"));
        }
        // Of the first correction, as the diagonal alone would make it: the tolerance is relative to it, so that short
        // steps are as well resolved as long ones.
        let change = *change.get_or_insert_with(|| {
            sum::max(pool, n, |i| (residual[i] / (1.0 + g * diagonal[i])).abs().max((y[i] - base[i]).abs()))
        });
        let relative = ROUNDING * (1.0 + g * sum::max(pool, n, |i| diagonal[i]));
        if relative.is_nan() || relative > ILLEGIBLE {
            return Err(unsolved(0, limits.iterations, relative, ILLEGIBLE));
        }
        size = sum::max(pool, n, |i| y[i].abs()).max(change).max(size);
        // The base of a second stage is as large as g times a rate: its rounding counts once.
        let rounding = relative * size + ROUNDING * sum::max(pool, n, |i| base[i].abs());
        wanted = limits.tolerance * change + rounding;
        worst = sum::max(pool, n, |i| residual[i].abs());
        if worst <= wanted || n == 0 {
            return Ok(Solved { allowed: wanted.max(0.0), rounding: rounding.max(0.0), iterations: spent });
        }
        if linear == Linear::Frozen && (worst.is_nan() || worst >= RISE * taken.before) {
            if taken.halve(pool, y, correction) {
                continue;
            }
            break;
        }
        let target = if linear == Linear::Exact { 0.5 * wanted } else { (0.5 * wanted).max(FORCING * worst) };
        let mut equations = Equations { system, pool, shifted: Shifted { g, diagonal, weight } };
        match linear {
            Linear::Exact => equations.start(y, [correction, residual, q])?,
            _ => correction.fill(0.0),
        }
        spent += equations.solve(target, limits.iterations - spent, [correction, residual, p, q])?;
        taken = Taken { share: taken.next(), before: worst };
        add(pool, y, taken.share, correction);
    }
    Err(unsolved(spent, limits.iterations, worst, wanted))
}

/// The share of the last correction that is in y, and the largest residual before it.
struct Taken {
    share: f64,
    before: f64,
}

impl Taken {
    /// Takes half of it back; `false` where too little is left.
    fn halve(&mut self, pool: &Pool, y: &mut [f64], correction: &[f64]) -> bool {
        let enough = self.share > LEAST_SHARE;
        if enough {
            self.share *= 0.5;
            add(pool, y, -self.share, correction);
        }
        enough
    }

    /// Twice the last share: where one correction had to be cut, the next one does, too.
    fn next(&self) -> f64 {
        if self.share > 0.0 { (2.0 * self.share).min(1.0) } else { 1.0 }
    }
}

/// Makes Σ weight (Y − y) what was supplied, to rounding, whatever the solver's tolerance: what is amiss is shared by
/// the particles in the measure in which they exchange within the stage. Returns the largest change.
fn conserve(pool: &Pool, g: f64, supplied: f64, y: &[f64], stage: &mut [f64], space: &Space) -> f64 {
    let [diagonal, weight, ..] = space;
    let share = |i: usize| g * diagonal[i] / (1.0 + g * diagonal[i]);
    let total = sum::sum(pool, y.len(), |i| weight[i] * share(i));
    let excess = sum::sum(pool, y.len(), |i| weight[i] * (stage[i] - y[i])) - supplied;
    let each = excess / total;
    if !each.is_finite() || excess == 0.0 {
        return 0.0;
    }
    pool.update(stage, |start, part| {
        part.iter_mut().enumerate().for_each(|(k, stage)| *stage -= each * share(start + k));
    });
    each.abs()
}
