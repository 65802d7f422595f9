//! Explicit Runge-Kutta methods: Butcher's tables, and one loop for all of them.

use super::{System, Tally, Work, tallied};
use crate::error::Result;
use crate::pool::Pool;

/// Stage i is y + dt Σ_j a[i][j] k_j at t + c[i] dt, where k_j is the rate at stage j; the step is y + dt Σ_j b[j] k_j.
#[derive(Debug)]
pub struct Tableau {
    pub a: &'static [&'static [f64]],
    pub b: &'static [f64],
    pub c: &'static [f64],
    /// Length of the real stability interval, rounded down.
    pub interval: f64,
}

pub static EULER: Tableau = Tableau { a: &[&[]], b: &[1.0], c: &[0.0], interval: 2.0 };

pub static SSPRK2: Tableau = Tableau { a: &[&[], &[1.0]], b: &[0.5, 0.5], c: &[0.0, 1.0], interval: 2.0 };

pub static SSPRK3: Tableau = Tableau {
    a: &[&[], &[1.0], &[0.25, 0.25]],
    b: &[1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0],
    c: &[0.0, 1.0, 0.5],
    interval: 2.5127,
};

pub static RK4: Tableau = Tableau {
    a: &[&[], &[0.5], &[0.0, 0.5], &[0.0, 0.0, 1.0]],
    b: &[1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
    c: &[0.0, 0.5, 0.5, 1.0],
    interval: 2.7852,
};

impl Tableau {
    pub fn stages(&self) -> u32 {
        self.b.len() as u32
    }

    pub fn advance(
        &self,
        dt: f64,
        system: &mut dyn System,
        pool: &Pool,
        t: f64,
        y: &mut [f64],
        work: &mut Work,
    ) -> Result<()> {
        let mut tally = Tally::default();
        let [stage, rates @ ..] = work.arrays::<5>(y.len())?;
        for (i, (a, c)) in self.a.iter().zip(self.c).enumerate() {
            let (known, rest) = rates.split_at_mut(i);
            let Some(rate) = rest.first_mut() else { break };
            if a.is_empty() {
                system.rate(t, y, rate)?;
                tallied(&mut tally, dt * self.b[i], system.tally());
                continue;
            }
            pool.update(stage, |start, part| {
                part.copy_from_slice(&y[start..start + part.len()]);
                add(part, start, dt, a, known);
            });
            system.rate(t + c * dt, stage, rate)?;
            tallied(&mut tally, dt * self.b[i], system.tally());
        }
        pool.update(y, |start, part| add(part, start, dt, self.b, rates));
        work.tally = tally;
        Ok(())
    }
}

/// `part += dt Σ_j weights[j] rates[j]`, where `part` begins at `start`.
fn add(part: &mut [f64], start: usize, dt: f64, weights: &[f64], rates: &[Vec<f64>]) {
    for (weight, rate) in weights.iter().zip(rates).filter(|(w, _)| **w != 0.0) {
        let factor = dt * weight;
        for (y, k) in part.iter_mut().zip(&rate[start..]) {
            *y += factor * k;
        }
    }
}
