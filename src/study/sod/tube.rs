//! The shock tube with standard SPH in 1-D (Price 2012, Price et al. 2018): h and rho found together, grad-h terms,
//! Monaghan's viscosity with alpha = 1 and beta = 2, conductivity with v_sig = sqrt(|P_a − P_b|/rho).

use super::riemann::Gas;
use crate::error::Result;
use crate::kernel::Kernel;

const ALPHA: f64 = 1.0;
const BETA: f64 = 2.0;
const CONDUCT: f64 = 1.0;
/// Of the Courant time h/v_sig.
const COURANT: f64 = 0.3;

pub struct Tube {
    kernel: Kernel,
    h_fac: f64,
    gamma: f64,
    m: f64,
    /// Particles that move; the others hold the ends.
    free: std::ops::Range<usize>,
    pub x: Vec<f64>,
    v: Vec<f64>,
    u: Vec<f64>,
    pub rho: Vec<f64>,
    h: Vec<f64>,
    omega: Vec<f64>,
}

/// Rates of v and u.
type Rates = (Vec<f64>, Vec<f64>);

/// Buffers for a row of neighbours.
#[derive(Default)]
struct Row {
    q: Vec<f64>,
    w: Vec<f64>,
    slope: Vec<f64>,
}

impl Tube {
    /// `n` particles from −0.5 to 0 on the left; all have the same mass.
    ///
    /// # Errors
    /// As [`Kernel::new`].
    pub fn new(kernel: &str, h_fac: f64, gamma: f64, n: usize, [left, right]: [Gas; 2]) -> Result<Tube> {
        let kernel = Kernel::new(kernel, 1)?;
        let fine = 0.5 / n as f64;
        let coarse = fine * left.rho / right.rho;
        // Enough beyond the ends that free particles have whole supports.
        let spare = (kernel.radius() * h_fac * 1.5).ceil() as usize + 2;
        let m = left.rho * fine;
        let (inside, outside) = (n, (0.5 / coarse) as usize);
        let x: Vec<f64> = (0..n + spare)
            .rev()
            .map(|i| -fine * (i as f64 + 0.5))
            .chain((0..outside + spare).map(|i| coarse * (i as f64 + 0.5)))
            .collect();
        let of =
            |f: &dyn Fn(&Gas) -> f64| x.iter().map(|x| f(if *x < 0.0 { &left } else { &right })).collect::<Vec<_>>();
        let (rho, v) = (of(&|g| g.rho), of(&|g| g.v));
        let u = of(&|g| g.p / ((gamma - 1.0) * g.rho));
        let h = rho.iter().map(|rho| h_fac * m / rho).collect();
        let (free, omega) = (spare..spare + inside + outside, vec![1.0; x.len()]);
        let mut tube = Tube { kernel, h_fac, gamma, m, free, x, v, u, rho, h, omega };
        // From sharp densities to those of the sum.
        (0..10).for_each(|_| tube.densities());
        Ok(tube)
    }

    /// Where the particles that move are, and how dense it is there.
    pub fn densities_at(&self) -> impl Iterator<Item = (f64, f64)> {
        self.free.clone().map(|i| (self.x[i], self.rho[i]))
    }

    /// Σ m (v²/2 + u) of all particles.
    #[cfg(test)]
    fn energy(&self) -> f64 {
        self.v.iter().zip(&self.u).map(|(v, u)| self.m * (0.5 * v * v + u)).sum()
    }

    /// Heun's steps to `end`, or to where numbers end: a support of hardly two neighbours does not hold a gas together.
    pub fn run(&mut self, end: f64) {
        let mut t = 0.0;
        while t < end && self.u.iter().all(|u| u.is_finite()) {
            let dt = self.limit().min(end - t);
            self.step(dt);
            t += dt;
        }
    }

    fn limit(&self) -> f64 {
        let fastest = self.v.iter().map(|v| v.abs()).fold(0.0, f64::max);
        let times = self.free.clone().map(|i| self.h[i] / (self.sound(i) * (1.0 + ALPHA) + BETA * fastest));
        COURANT * times.fold(f64::INFINITY, f64::min)
    }

    fn step(&mut self, dt: f64) {
        let old = (self.x.clone(), self.v.clone(), self.u.clone());
        let (dv, du) = self.rates();
        let dx = self.v.clone();
        for i in self.free.clone() {
            self.x[i] += dt * dx[i];
            self.v[i] += dt * dv[i];
            self.u[i] += dt * du[i];
        }
        self.densities();
        let (dv2, du2) = self.rates();
        for i in self.free.clone() {
            self.x[i] = old.0[i] + 0.5 * dt * (dx[i] + self.v[i]);
            self.v[i] = old.1[i] + 0.5 * dt * (dv[i] + dv2[i]);
            self.u[i] = old.2[i] + 0.5 * dt * (du[i] + du2[i]);
        }
        self.densities();
    }

    fn sound(&self, i: usize) -> f64 {
        (self.gamma * (self.gamma - 1.0) * self.u[i]).max(0.0).sqrt()
    }

    fn pressure(&self, i: usize) -> f64 {
        (self.gamma - 1.0) * self.rho[i] * self.u[i]
    }

    /// Particles within the support of `a`: in 1-D they stay in order.
    fn reach(&self, a: usize) -> std::ops::Range<usize> {
        let near = |b: &usize| (self.x[*b] - self.x[a]).abs() < self.kernel.radius() * self.h[a];
        let first = (0..a).rev().take_while(near).last().unwrap_or(a);
        let last = (a + 1..self.x.len()).take_while(near).last().unwrap_or(a);
        first..last + 1
    }

    fn row(&self, a: usize, near: std::ops::Range<usize>, row: &mut Row) {
        row.q.clear();
        row.q.extend(near.map(|b| (self.x[b] - self.x[a]).abs() / self.h[a]));
        row.w.resize(row.q.len(), 0.0);
        row.slope.resize(row.q.len(), 0.0);
        self.kernel.w(&row.q, &mut row.w);
        self.kernel.slope_over_q(&row.q, &mut row.slope);
    }

    /// rho = Σ m W(h) with h = h_fac m/rho, by Newton's method from where they were; Omega on the way.
    fn densities(&mut self) {
        let mut row = Row::default();
        for a in self.free.clone() {
            for _ in 0..20 {
                self.row(a, self.reach(a), &mut row);
                let h = self.h[a];
                let sum: f64 = self.m * row.w.iter().sum::<f64>() / h;
                // h dW/dh = −(f + q f')/h
                let change: f64 = row.w.iter().zip(&row.q).zip(&row.slope).map(|((w, q), s)| w + q * q * s).sum();
                self.omega[a] = 1.0 - self.m * change / (h * sum);
                self.rho[a] = sum;
                let wanted = self.h_fac * self.m / sum;
                let next = h + (wanted - h) / self.omega[a].max(0.2);
                self.h[a] = next.max(0.5 * h).min(2.0 * h);
                if (self.h[a] / h - 1.0).abs() < 1e-8 {
                    break;
                }
            }
        }
    }

    /// Each support's half of an exchange, in equal and opposite parts.
    fn rates(&self) -> Rates {
        let (mut dv, mut du) = (vec![0.0; self.x.len()], vec![0.0; self.x.len()]);
        let mut row = Row::default();
        for a in 0..self.x.len() {
            let near = self.reach(a);
            self.row(a, near.clone(), &mut row);
            for (b, (q, slope)) in near.zip(row.q.iter().zip(&row.slope)).filter(|(b, _)| *b != a) {
                // From a to b, r̂ = ±1; F = dW/dr < 0.
                let side = (self.x[b] - self.x[a]).signum();
                let f = slope * q / (self.h[a] * self.h[a]) / self.omega[a];
                let closing = ((self.v[a] - self.v[b]) * side).max(0.0);
                let shock = 0.5 * self.rho[a] * (ALPHA * self.sound(a) + BETA * closing) * closing;
                let push = self.m * (self.pressure(a) + shock) / (self.rho[a] * self.rho[a]) * f * side;
                dv[a] += push;
                dv[b] -= push;
                // The work of both ends: energy is kept to the integrator's error.
                du[a] -= push * (self.v[a] - self.v[b]);
                let mean = 0.5 * (self.rho[a] + self.rho[b]);
                let signal = ((self.pressure(a) - self.pressure(b)).abs() / mean).sqrt();
                let heat = self.m * CONDUCT * signal * (self.u[a] - self.u[b]) * 0.5 * f / self.rho[a];
                du[a] += heat;
                du[b] -= heat;
            }
        }
        (dv, du)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{LEFT, RIGHT};
    use super::*;

    #[test]
    fn a_uniform_gas_stays_as_it_is_and_a_tube_keeps_its_energy() {
        let mut still = Tube::new("M6", 1.0, 1.4, 40, [LEFT, LEFT]).unwrap();
        still.run(0.05);
        assert!(
            still.v.iter().all(|v| v.abs() < 1e-10) && still.densities_at().all(|(_, rho)| (rho - 1.0).abs() < 1e-3)
        );
        let mut tube = Tube::new("M4", 1.2, 1.4, 80, [LEFT, RIGHT]).unwrap();
        let before = tube.energy();
        tube.run(0.1);
        assert!((tube.energy() / before - 1.0).abs() < 1e-3, "{before} {}", tube.energy());
    }
}
