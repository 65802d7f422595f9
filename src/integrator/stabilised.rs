//! Stabilised Runge-Kutta methods: many stages of a three-term recursion, whose stability interval grows with the
//! square of their number (Meyer, Balsara & Aslam, J. Comput. Phys. 257, 594, 2014). One loop; the methods are
//! coefficients.

use super::{Schedule, System, Tally, Work};
use crate::error::Result;
use crate::pool::Pool;

/// The fewest stages a schedule takes. It takes odd numbers: with an even one the stability polynomial is 1 at the end
/// of its interval, and the shortest wave stays.
pub const LEAST_STAGES: u32 = 3;

/// The most stages of a sub-step unless told otherwise.
///
/// For many stages RKL2 multiplies a wave that decays as exp(-z) per sub-step by (1 + J0(sqrt(8 z)))/2, whatever their
/// number: close to exp(-z) for z < 1, but between 0.3 and 0.65 wherever exp(-z) is nothing. So what a sub-step is too
/// long to resolve rings on, about halved by each. Fewer stages mean more sub-steps, in which waves longer than some
/// 1.6 s spacings are resolved. Measured on a hot disc (10 in 0.1, 64 x 64 points) in one step of 4000 explicit ones:
/// at most 127, 63, 45, 31 stages leave errors of 0.4, 6e-2, 5e-3, 2e-4 of the contrast after 127, 252, 360, 527
/// applications.
pub const MAX_STAGES: u32 = 31;

/// Coefficients of stage j of s:
///
/// Y_j = Y_0 + mu (Y_{j-1} - Y_0) + nu (Y_{j-2} - Y_0) + dt (mu_rate L(Y_{j-1}) + gamma_rate L(Y_0))
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stage {
    pub mu: f64,
    pub nu: f64,
    pub mu_rate: f64,
    pub gamma_rate: f64,
}

impl Stage {
    /// Turns Y_{j-2} into Y_j, in one pass. Differences from y leave a value that does not change as it is, to the bit.
    fn update(&self, dt: f64, new: &mut [f64], arrays: [&[f64]; 4]) {
        let [y, last, rate, first_rate] = arrays.map(|a| &a[..new.len()]);
        let (mu_dt, gamma_dt) = (self.mu_rate * dt, self.gamma_rate * dt);
        for (i, new) in new.iter_mut().enumerate() {
            let moved = self.mu * (last[i] - y[i]) + self.nu * (*new - y[i]);
            *new = y[i] + (moved + (mu_dt * rate[i] + gamma_dt * first_rate[i]));
        }
    }
}

#[derive(Debug)]
pub struct Recursion {
    /// Coefficients of stage j of s, j >= 1.
    pub stage: fn(s: f64, j: f64) -> Stage,
    /// Length of the real stability interval with s stages.
    pub interval: fn(s: f64) -> f64,
    /// With fewer stages than this the method does not exist.
    pub least: u32,
}

/// The stability polynomial is Legendre's P_s.
pub static RKL1: Recursion = Recursion { stage: rkl1, interval: |s| s * s + s, least: 1 };

/// The stability polynomial is a_s + b_s P_s.
pub static RKL2: Recursion = Recursion { stage: rkl2, interval: |s| 0.5 * (s * s + s - 2.0), least: 2 };

fn rkl1(s: f64, j: f64) -> Stage {
    let mu = (2.0 * j - 1.0) / j;
    Stage { mu, nu: (1.0 - j) / j, mu_rate: mu * 2.0 / (s * s + s), gamma_rate: 0.0 }
}

fn rkl2(s: f64, j: f64) -> Stage {
    let b = |j: f64| if j < 2.0 { 1.0 / 3.0 } else { (j * j + j - 2.0) / (2.0 * j * (j + 1.0)) };
    let w = 4.0 / (s * s + s - 2.0);
    if j < 2.0 {
        return Stage { mu: 1.0, nu: 0.0, mu_rate: b(1.0) * w, gamma_rate: 0.0 };
    }
    let mu = (2.0 * j - 1.0) * b(j) / (j * b(j - 1.0));
    let nu = -(j - 1.0) * b(j) / (j * b(j - 2.0));
    Stage { mu, nu, mu_rate: mu * w, gamma_rate: (b(j - 1.0) - 1.0) * mu * w }
}

impl Recursion {
    pub fn advance(
        &self,
        schedule: &Schedule,
        system: &mut dyn System,
        pool: &Pool,
        t: f64,
        y: &mut [f64],
        work: &mut Work,
    ) -> Result<()> {
        let (dt, s) = (schedule.dt, f64::from(schedule.stages));
        let [before, last, first_rate, rate] = work.arrays::<4>(y.len())?;
        system.rate(t, y, first_rate)?;
        let first = (self.stage)(s, 1.0).mu_rate;
        before.copy_from_slice(y);
        pool.update(last, |start, part| {
            for (new, (y, rate)) in part.iter_mut().zip(y[start..].iter().zip(&first_rate[start..])) {
                *new = y + dt * first * rate;
            }
        });
        // Where a stage stands in time follows from the same recursion, in units of dt.
        let (mut time_before, mut time_last) = (0.0, first);
        // So does what is tallied, from nothing.
        let first_tally = system.tally();
        let (mut tally_before, mut tally_last) = (Tally::default(), first_tally.map(|rate| dt * first * rate));
        for j in 2..=schedule.stages {
            let k = (self.stage)(s, f64::from(j));
            system.rate(t + time_last * dt, last, rate)?;
            pool.update(before, |start, part| {
                k.update(dt, part, [&y[start..], &last[start..], &rate[start..], &first_rate[start..]]);
            });
            let time = k.mu * time_last + k.nu * time_before + k.mu_rate + k.gamma_rate;
            (time_before, time_last) = (time_last, time);
            let mut tally = tally_before;
            k.update(dt, &mut tally, [&[0.0; 2], &tally_last, &system.tally(), &first_tally]);
            (tally_before, tally_last) = (tally_last, tally);
            std::mem::swap(before, last);
        }
        pool.update(y, |start, part| part.copy_from_slice(&last[start..start + part.len()]));
        work.tally = tally_last;
        Ok(())
    }
}
