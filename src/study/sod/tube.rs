//! The shock tube with standard SPH in 1 or 3 dimensions (Price 2012, Price et al. 2018): h and rho found together, grad-h
//! terms, Monaghan's viscosity with alpha = 1 and beta = 2, conductivity with v_sig = sqrt(|P_a − P_b|/rho).
//!
//! The box is periodic: the dense gas lies within 1/2 of the origin and the thin one beyond, so that there are two tubes,
//! each the other's mirror image, and no ends. In 3-D both gases are closest packings and the box is [`ACROSS`] dense cells
//! wide, which is one thin cell.

use super::riemann::Gas;
use crate::array::Strided;
use crate::error::Result;
use crate::kernel::Kernel;
use crate::pool::Pool;
use crate::space::rows::Rows;
use crate::space::{Cloud, Domain, Row, Scratch, density};
use crate::study::lattice;

const ALPHA: f64 = 1.0;
const BETA: f64 = 2.0;
const CONDUCT: f64 = 1.0;
/// Of the Courant time h/v_sig.
const COURANT: f64 = 0.3;
/// Dense cells across the tube.
const ACROSS: f64 = 2.0;

pub struct Tube {
    kernel: Kernel,
    h_fac: f64,
    gamma: f64,
    m: f64,
    domain: Domain,
    pool: Pool,
    /// dim coordinates per particle.
    x: Vec<f64>,
    v: Vec<f64>,
    u: Vec<f64>,
    rho: Vec<f64>,
    h: Vec<f64>,
    omega: Vec<f64>,
}

/// Rates of v and u.
type Rates = (Vec<f64>, Vec<f64>);

/// Kernel slopes of a row, with the smoothing length of its particle and with those of its neighbours.
#[derive(Default)]
struct Slopes {
    q: Vec<f64>,
    own: Vec<f64>,
    theirs: Vec<f64>,
}

impl Tube {
    /// `n` cells of the lattice along each half of the dense gas; all particles have the same mass.
    ///
    /// # Errors
    /// As [`Kernel::new`].
    pub fn new(kernel: &str, dim: usize, h_fac: f64, gamma: f64, n: usize, [dense, thin]: [Gas; 2]) -> Result<Tube> {
        let kernel = Kernel::new(kernel, dim)?;
        let width = ACROSS * 0.5 / n as f64;
        let fill = |from: f64, cells: f64| {
            let (lo, hi) = ([from, 0.0, 0.0], [from + 1.0, width, width]);
            lattice::find(if dim == 1 { "cubic" } else { "fcc" }, dim)?.fill(
                &lo[..dim],
                &hi[..dim],
                cells.round() as usize,
            )
        };
        let mut x = fill(-0.5, 2.0 * n as f64)?;
        let (dense_count, apart) = (x.len() / dim, (dense.rho / thin.rho).powf(1.0 / dim as f64));
        x.extend(fill(0.5, 2.0 * n as f64 / apart)?);
        let domain = Domain::new(&[-0.5, 0.0, 0.0][..dim], &[1.5, width, width][..dim], &[true; 3][..dim])?;
        let m = dense.rho * width.powi(dim as i32 - 1) / dense_count as f64;
        let count = x.len() / dim;
        let of =
            |f: &dyn Fn(&Gas) -> f64| (0..count).map(|i| f(if i < dense_count { &dense } else { &thin })).collect();
        let (rho, u): (Vec<f64>, Vec<f64>) = (of(&|g| g.rho), of(&|g| g.p / ((gamma - 1.0) * g.rho)));
        let h = rho.iter().map(|rho| h_fac * (m / rho).powf(1.0 / dim as f64)).collect();
        let (v, omega, pool) = (vec![0.0; x.len()], vec![1.0; count], Pool::new(1)?);
        Ok(Tube { kernel, h_fac, gamma, m, domain, pool, x, v, u, rho, h, omega })
    }

    /// How far each particle is beyond the edge of the dense gas, and how dense it is there.
    pub fn densities(&self) -> impl Iterator<Item = (f64, f64)> {
        let along = self.x.iter().step_by(self.domain.dim);
        let beyond = along.map(|x| {
            let x = self.domain.wrap(0, *x);
            (if x < 1.0 { x } else { x - 2.0 }).abs() - 0.5
        });
        beyond.zip(self.rho.iter().copied())
    }

    /// Σ m (v²/2 + u).
    #[cfg(test)]
    fn energy(&self) -> f64 {
        self.m * (0.5 * self.v.iter().map(|v| v * v).sum::<f64>() + self.u.iter().sum::<f64>())
    }

    /// Heun's steps to `end`.
    ///
    /// # Errors
    /// `BadElement` where numbers end: a support of hardly two neighbours does not hold a gas together. `BoxTooSmall`.
    pub fn run(&mut self, end: f64) -> Result<()> {
        let mut t = 0.0;
        let mut rates = self.rates()?;
        while t < end {
            let dt = self.limit().min(end - t);
            rates = self.step(dt, rates)?;
            t += dt;
        }
        Ok(())
    }

    fn limit(&self) -> f64 {
        let fastest = self.v.iter().map(|v| v.abs()).fold(0.0, f64::max);
        let times = (0..self.u.len()).map(|i| self.h[i] / (self.sound(i) * (1.0 + ALPHA) + BETA * fastest));
        COURANT * times.fold(f64::INFINITY, f64::min)
    }

    /// From the rates at its start to those at its end.
    fn step(&mut self, dt: f64, (dv, du): Rates) -> Result<Rates> {
        let (x, v, u, dx) = (self.x.clone(), self.v.clone(), self.u.clone(), self.v.clone());
        add(&mut self.x, dt, &dx);
        add(&mut self.v, dt, &dv);
        add(&mut self.u, dt, &du);
        let (dv2, du2) = self.rates()?;
        let mean = |old: &[f64], first: &[f64], second: &[f64]| -> Vec<f64> {
            old.iter().zip(first.iter().zip(second)).map(|(old, (a, b))| old + 0.5 * dt * (a + b)).collect()
        };
        (self.x, self.v, self.u) = (mean(&x, &dx, &self.v), mean(&v, &dv, &dv2), mean(&u, &du, &du2));
        self.rates()
    }

    fn sound(&self, i: usize) -> f64 {
        (self.gamma * (self.gamma - 1.0) * self.u[i]).max(0.0).sqrt()
    }

    fn pressure(&self, i: usize) -> f64 {
        (self.gamma - 1.0) * self.rho[i] * self.u[i]
    }

    /// Finds rho, h and Omega where the particles are, and what moves and heats them there.
    fn rates(&mut self) -> Result<Rates> {
        let (dim, count) = (self.domain.dim, self.u.len());
        let widest = self.kernel.radius() * self.h.iter().copied().fold(0.0, f64::max);
        let cloud = Cloud::sort(&self.domain, Strided::new("x", &self.x, count, dim, dim)?, widest, &self.pool)?;
        let mass = vec![self.m; count];
        let start = cloud.inward("h", Strided::packed(&self.h), 0)?;
        let h = density::smoothing_lengths(&self.kernel, self.h_fac, &cloud, &mass, start, &self.pool)?;
        let rows = Rows::new(&cloud, &h, self.kernel.radius(), &self.pool)?;
        let omega = density::omega(&self.kernel, &rows, &mass, &self.pool)?;
        for (i, &host) in cloud.host.iter().enumerate() {
            let host = host as usize;
            (self.h[host], self.omega[host]) = (h[i], omega[i]);
            self.rho[host] = self.m * (self.h_fac / h[i]).powi(dim as i32);
        }
        let (mut dv, mut du) = (vec![0.0; self.v.len()], vec![0.0; count]);
        let mut slopes = Slopes::default();
        rows.visit(0..count, &mut Scratch::default(), |row| {
            let a = cloud.host[row.i] as usize;
            du[a] = self.pull(a, &row, &cloud.host, &mut slopes, &mut dv[a * dim..][..dim]);
            Ok(())
        })?;
        Ok((dv, du))
    }

    /// dv/dt and du/dt of a particle from its neighbours. What two do to each other is equal and opposite.
    fn pull(&self, a: usize, row: &Row, host: &[u32], slopes: &mut Slopes, dv: &mut [f64]) -> f64 {
        let dim = dv.len();
        let Slopes { q, own, theirs } = slopes;
        let mut of = |h: &dyn Fn(usize) -> f64, slope: &mut Vec<f64>| {
            q.clear();
            q.extend(row.r.iter().enumerate().map(|(k, r)| r / h(k)));
            slope.resize(q.len(), 0.0);
            self.kernel.slope_over_q(q, slope);
            // dW/dr with the grad-h term.
            slope.iter_mut().enumerate().for_each(|(k, s)| *s *= q[k] / h(k).powi(dim as i32 + 1));
        };
        let neighbour = |k: usize| host[row.j[k] as usize] as usize;
        of(&|_| self.h[a], own);
        of(&|k| self.h[neighbour(k)], theirs);
        let mut du = 0.0;
        for k in 0..row.len() {
            let (b, to) = (neighbour(k), row.direction(k));
            let (fa, fb) = (own[k] / self.omega[a], theirs[k] / self.omega[b]);
            let velocity = |i: usize| (0..dim).map(|axis| self.v[i * dim + axis] * to[axis]).sum::<f64>();
            let closing = velocity(a) - velocity(b);
            // P/rho² and the viscosity's share of it.
            let push = |i: usize| {
                let c = closing.max(0.0);
                let shock = 0.5 * self.rho[i] * (ALPHA * self.sound(i) + BETA * c) * c;
                (self.pressure(i) + shock) / (self.rho[i] * self.rho[i])
            };
            let (pa, pb) = (push(a) * fa, push(b) * fb);
            dv.iter_mut().zip(to).for_each(|(dv, to)| *dv += self.m * (pa + pb) * to);
            du -= self.m * pa * closing;
            let mean = 0.5 * (self.rho[a] + self.rho[b]);
            let signal = ((self.pressure(a) - self.pressure(b)).abs() / mean).sqrt();
            let slope = 0.5 * (fa / self.rho[a] + fb / self.rho[b]);
            du += self.m * CONDUCT * signal * (self.u[a] - self.u[b]) * slope;
        }
        du
    }
}

fn add(values: &mut [f64], dt: f64, rates: &[f64]) {
    values.iter_mut().zip(rates).for_each(|(v, rate)| *v += dt * rate);
}

#[cfg(test)]
mod tests {
    use super::super::{LEFT, RIGHT};
    use super::*;

    #[test]
    fn a_uniform_gas_stays_as_it_is_and_a_tube_keeps_its_energy() {
        for (dim, n) in [(1, 40), (3, 4)] {
            let mut still = Tube::new("M6", dim, 1.0, 1.4, n, [LEFT, LEFT]).unwrap();
            still.run(0.05).unwrap();
            // A lattice is in equilibrium by symmetry; its density sum is off by its own quadrature error.
            let off = still.densities().map(|(_, rho)| (rho - 1.0).abs()).fold(0.0, f64::max);
            assert!(still.v.iter().all(|v| v.abs() < 1e-10) && off < 3e-3, "{dim}-D: {off}");
            let mut tube = Tube::new("M4", dim, 1.2, 1.4, 2 * n, [LEFT, RIGHT]).unwrap();
            let before = tube.energy();
            tube.run(0.1).unwrap();
            // Heun's error.
            assert!((tube.energy() / before - 1.0).abs() < 1e-3, "{dim}-D: {before} {}", tube.energy());
            let momentum: f64 = tube.v.iter().step_by(dim).sum::<f64>() * tube.m;
            // Sums of equal and opposite terms.
            assert!(momentum.abs() < 1e-10, "{dim}-D: {momentum:e}");
        }
    }
}
