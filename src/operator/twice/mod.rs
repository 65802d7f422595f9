//! The engine for operators that take two first derivatives: gradient, flux, divergence (Biriukov & Price 2019; Price
//! 2012 for the terms in Omega), for a conductivity that is a tensor.
//!
//! ```text
//! g_a = P_a Σ_b m_b s_ab f_ab (T_b − T_a) d_ab,    s_ab = −F(r, h_a)/r,   d_ab = r_b − r_a
//! E_a = Σ_b d_ab·(m_b s_ab f_ab z_a + m_a s_ba f_ba z_b) + Σ_b omega_ab R_ab
//! z_a = P_aᵀ (V_a kappa_a S_a g_a − ½ Σ_b omega_ab R_ab d_ab)
//! R_ab = T_b − T_a − ½ (g_a + g_b)·d_ab,           omega_ab = theta nu kappa_ab g_ab
//! ```
//!
//! E_a is the power into particle a: minus the derivative by T_a of Φ = ½ Σ V g·kappa S g + ½ Σ_pairs omega R², so the
//! operator is symmetric, conservative and never lets T grow, whatever P is. Either P_a = 1/(Omega_a rho_a), as in the
//! paper, or P_a is the inverse of Σ m_b s_ab d dᵀ, which makes g exact for linear fields (Bonet & Lok 1999). The
//! f_ab = kappa_ab/kappa_a where kappa_ab is the harmonic mean: across a jump of kappa, T changes mostly on the side that
//! conducts less, and kappa g is the same flux on both; nothing passes a particle with kappa = 0. With the arithmetic mean
//! f = 1: what flows between two particles is the mean of their fluxes. A tensor counts by its mean over directions. The
//! jumps R that the gradients do not explain are what two first derivatives cannot see; theta = 0 leaves them alone.

mod limit;

use super::assembly::Assembly;
use super::matrix::Matrix;
use super::tensor::{self, Sym, dot};
use super::{Kappa, gradient};
use crate::error::Result;
use crate::memory;
use crate::pool::{BLOCK, Pool};
use crate::space::{Axes, Row, Scratch};
use limit::ROOM;
use nalgebra::Matrix3;

/// What a pair adds to the stored weights.
#[derive(Clone, Copy)]
struct Slope {
    d: Axes<f64>,
    /// m_b s_ab
    own: f64,
    /// m_a s_ba
    mate: f64,
}

/// Bytes that it takes beside the weights, for each pair and for each particle.
pub const BYTES: [f64; 2] =
    [size_of::<Slope>() as f64, (size_of::<Matrix3<f64>>() + size_of::<Sym>() + size_of::<f64>()) as f64];

/// The stored two-sweep operator, over the pairs of a [`Matrix`] of weights.
pub struct Twice {
    slopes: Vec<Vec<Slope>>,
    start: Vec<Vec<u32>>,
    frame: Vec<Matrix3<f64>>,
    shape: Vec<Sym>,
    volume: Vec<f64>,
    /// theta nu
    penalty: f64,
    /// Limits the exchanges between pairs: coefficients of the monotone operator in the same rows.
    low: Option<Matrix>,
}

/// What makes the stored operator, beside the assembly of its weights.
pub struct Recipe<'a> {
    pub mass: &'a [f64],
    /// 1/(Omega rho), for gradients as in the paper; none for those that are exact for linear fields.
    pub plain: Option<&'a [f64]>,
    pub theta: f64,
    pub low: Option<Matrix>,
}

/// One right-hand side's view of a pair.
struct Exchange {
    a: usize,
    b: usize,
    /// Times f_ab and f_ba.
    slope: Slope,
    /// Stored coefficient of the weights, V_a V_b w_ab.
    coef: f64,
    low: f64,
    mean_kappa: f64,
}

impl Twice {
    /// # Errors
    /// `NoMemory`.
    pub fn store(assembly: &Assembly, recipe: Recipe, pool: &Pool) -> Result<Twice> {
        let n = assembly.volume.len();
        let (mut slopes, mut start, mut frame) = (Vec::new(), Vec::new(), memory::reserved("frames", n)?);
        let blocks = n.div_ceil(BLOCK);
        for made in pool.map_init(blocks, Scratch::default, |scratch, b| block(assembly, &recipe, scratch, b)) {
            let (s, at, f) = made?;
            slopes.push(s);
            start.push(at);
            frame.extend_from_slice(&f);
        }
        let dim = assembly.kernel.dim();
        let shape = match assembly.shape {
            Some(shape) => memory::copied("shapes", shape)?,
            None => memory::filled("shapes", n, tensor::unit(dim))?,
        };
        let volume = memory::copied("volumes", assembly.volume)?;
        Ok(Twice { slopes, start, frame, shape, volume, penalty: recipe.theta * dim as f64, low: recipe.low })
    }

    pub fn is_limited(&self) -> bool {
        self.low.is_some()
    }

    pub fn bytes(&self) -> u64 {
        let slopes: u64 = self.slopes.iter().map(memory::bytes).sum();
        slopes + memory::bytes(&self.frame) + memory::bytes(&self.shape) + self.low.as_ref().map_or(0, Matrix::bytes)
    }

    /// out_a = finish(a, E_a / kappa unit), kappa being 1 where `kappa` is none.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn apply(
        &self,
        matrix: &Matrix,
        pool: &Pool,
        kappa: Kappa,
        t: &[f64],
        out: &mut [f64],
        finish: impl Fn(usize, f64) -> f64 + Sync + Send,
    ) -> Result<()> {
        let g = self.gradients(pool, matrix, kappa, t)?;
        let z = self.fluxes(pool, matrix, kappa, t, &g)?;
        let exchange = |e: &Exchange| {
            let through = dot(e.slope.d, z[e.a]) * e.slope.own + dot(e.slope.d, z[e.b]) * e.slope.mate;
            through + self.omega(e) * jump(e, t, &g)
        };
        match &self.low {
            Some(_) => self.limited(pool, (matrix, kappa), t, exchange, out, finish),
            None => self.each(pool, out, |a| finish(a, self.row(matrix, kappa, a).map(|e| exchange(&e)).sum())),
        }
    }

    /// For each particle a bound on Σ_c |A_ac| beyond its diagonal, and its diagonal, A being minus the operator:
    /// Gershgorin's circles, not tight.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn circles(&self, matrix: &Matrix, pool: &Pool, kappa: Kappa) -> Result<Vec<(f64, f64)>> {
        let n = self.volume.len();
        let mut out = memory::filled("row sums", n, (0.0, 0.0))?;
        if self.low.is_some() {
            // The limiter keeps every row within the sum of what may flow.
            self.each(pool, &mut out, |a| {
                let sum: f64 = self
                    .row(matrix, kappa, a)
                    .filter(|e| e.b != e.a)
                    .map(|e| e.mean_kappa * (e.low + ROOM * e.coef))
                    .sum();
                (sum, sum)
            })?;
            return Ok(out);
        }
        let own_kappa = |a: usize| kappa.map_or(1.0, |(_, k)| k[a]);
        let length = |v: Axes<f64>| dot(v, v).sqrt();
        // |g|, |z| and |E| for |T| <= 1.
        let mut g = memory::filled("gradients", n, 0.0)?;
        self.each(pool, &mut g, |a| {
            let raw: f64 = self.row(matrix, kappa, a).map(|e| e.slope.own * length(e.slope.d)).sum();
            2.0 * self.frame[a].norm() * raw
        })?;
        let jump = |e: &Exchange| self.omega(e).abs() * (2.0 + 0.5 * (g[e.a] + g[e.b]) * length(e.slope.d));
        let mut z = memory::filled("fluxes", n, 0.0)?;
        self.each(pool, &mut z, |a| {
            let jumps: f64 = self.row(matrix, kappa, a).map(|e| 0.5 * jump(&e) * length(e.slope.d)).sum();
            self.frame[a].norm() * (self.volume[a] * own_kappa(a) * tensor::trace(&self.shape[a]) * g[a] + jumps)
        })?;
        self.each(pool, &mut out, |a| {
            let all = |e: &Exchange| length(e.slope.d) * (z[e.a] * e.slope.own + z[e.b] * e.slope.mate) + jump(e);
            let bound: f64 = self.row(matrix, kappa, a).map(|e| all(&e)).sum();
            let diagonal = self.diagonal(matrix, kappa, a);
            ((bound - diagonal).max(0.0), diagonal)
        })?;
        Ok(out)
    }

    /// Minus the coefficient of T_a in E_a, the gradients in the jumps left aside.
    fn diagonal(&self, matrix: &Matrix, kappa: Kappa, a: usize) -> f64 {
        let own_kappa = |a: usize| kappa.map_or(1.0, |(_, k)| k[a]);
        let conducts = |i: usize, v: Axes<f64>| {
            self.volume[i] * own_kappa(i) * tensor::along(&self.shape[i], times(&self.frame[i], v))
        };
        let mut sum = [0.0; 3];
        let mut diagonal = 0.0;
        for e in self.row(matrix, kappa, a).filter(|e| e.b != e.a) {
            (0..3).for_each(|k| sum[k] += e.slope.own * e.slope.d[k]);
            diagonal += self.omega(&e) + conducts(e.b, e.slope.d.map(|d| e.slope.mate * d));
        }
        diagonal + conducts(a, sum)
    }

    fn gradients(&self, pool: &Pool, matrix: &Matrix, kappa: Kappa, t: &[f64]) -> Result<Vec<Axes<f64>>> {
        let mut g = memory::filled("gradients", t.len(), [0.0; 3])?;
        self.each(pool, &mut g, |a| {
            let mut raw = [0.0; 3];
            for e in self.row(matrix, kappa, a) {
                let rise = e.slope.own * (t[e.b] - t[a]);
                (0..3).for_each(|k| raw[k] += rise * e.slope.d[k]);
            }
            times(&self.frame[a], raw)
        })?;
        Ok(g)
    }

    fn fluxes(&self, pool: &Pool, matrix: &Matrix, kappa: Kappa, t: &[f64], g: &[Axes<f64>]) -> Result<Vec<Axes<f64>>> {
        let mut z = memory::filled("fluxes", t.len(), [0.0; 3])?;
        self.each(pool, &mut z, |a| {
            let scale = self.volume[a] * kappa.map_or(1.0, |(_, k)| k[a]);
            let mut q = tensor::times(&self.shape[a], g[a]).map(|q| scale * q);
            if self.penalty > 0.0 {
                for e in self.row(matrix, kappa, a) {
                    let half = 0.5 * self.omega(&e) * jump(&e, t, g);
                    (0..3).for_each(|k| q[k] -= half * e.slope.d[k]);
                }
            }
            transposed(&self.frame[a], q)
        })?;
        Ok(z)
    }

    fn omega(&self, e: &Exchange) -> f64 {
        self.penalty * e.mean_kappa * e.coef
    }

    fn slopes(&self, a: usize) -> &[Slope] {
        let (b, k) = (a / BLOCK, a % BLOCK);
        &self.slopes[b][self.start[b][k] as usize..self.start[b][k + 1] as usize]
    }

    fn row<'a>(&'a self, matrix: &'a Matrix, kappa: Kappa<'a>, a: usize) -> impl Iterator<Item = Exchange> + 'a {
        let low = self.low.as_ref().map_or(&[][..], |low| low.coefficients(a));
        let pairs = self.slopes(a).iter().zip(matrix.columns(a)).zip(matrix.coefficients(a)).enumerate();
        pairs.map(move |(k, ((&slope, &b), &coef))| {
            let b = b as usize;
            let (mut slope, mut mean_kappa) = (slope, 1.0);
            if let Some((mean, kappa)) = kappa {
                let (here, there) = (kappa[a], kappa[b]);
                mean_kappa = mean.of(here, there);
                slope.own *= mean.share(here, there);
                slope.mate *= mean.share(there, here);
            }
            Exchange { a, b, slope, coef, low: low.get(k).copied().unwrap_or(0.0), mean_kappa }
        })
    }

    fn each<T: Send>(&self, pool: &Pool, out: &mut [T], f: impl Fn(usize) -> T + Sync + Send) -> Result<()> {
        pool.make(out, |start, part| part.iter_mut().enumerate().for_each(|(k, out)| *out = f(start + k)))
    }
}

/// T_b − T_a beyond what the gradients say.
fn jump(e: &Exchange, t: &[f64], g: &[Axes<f64>]) -> f64 {
    t[e.b] - t[e.a] - 0.5 * (dot(g[e.a], e.slope.d) + dot(g[e.b], e.slope.d))
}

fn times(m: &Matrix3<f64>, v: Axes<f64>) -> Axes<f64> {
    (m * nalgebra::Vector3::from(v)).into()
}

fn transposed(m: &Matrix3<f64>, v: Axes<f64>) -> Axes<f64> {
    m.tr_mul(&nalgebra::Vector3::from(v)).into()
}

type Made = (Vec<Slope>, Vec<u32>, Vec<Matrix3<f64>>);

/// The slopes and frames of one block of particles.
fn block(assembly: &Assembly, recipe: &Recipe, scratch: &mut Scratch, b: usize) -> Result<Made> {
    let range = b * BLOCK..((b + 1) * BLOCK).min(assembly.volume.len());
    let (mut slopes, mut start) = (Vec::new(), memory::reserved("rows", range.len() + 1)?);
    let mut frames = memory::reserved("frames", range.len())?;
    let (mut q, mut own, mut mate) = (Vec::new(), Vec::new(), Vec::new());
    start.push(0);
    assembly.rows.visit(range, scratch, |row| {
        memory::room("slopes", &mut slopes, row.len())?;
        let h = assembly.rows.h;
        fill(assembly, &row, |_| h[row.i], &mut q, &mut own);
        fill(assembly, &row, |j| h[j], &mut q, &mut mate);
        let first = slopes.len();
        for (k, &j) in row.j.iter().enumerate() {
            let d = row.d.map(|axis| axis.get(k).copied().unwrap_or(0.0));
            slopes.push(Slope { d, own: recipe.mass[j as usize] * own[k], mate: recipe.mass[row.i] * mate[k] });
        }
        start.push(slopes.len() as u32);
        frames.push(match recipe.plain {
            Some(plain) => Matrix3::identity() * plain[row.i],
            None => frame(&slopes[first..]),
        });
        Ok(())
    })?;
    Ok((slopes, start, frames))
}

/// s = −F(r, h)/r for each pair of a row.
fn fill(assembly: &Assembly, row: &Row, h: impl Fn(usize) -> f64, q: &mut Vec<f64>, out: &mut Vec<f64>) {
    q.clear();
    q.extend(row.r.iter().zip(row.j).map(|(r, &j)| r / h(j as usize)));
    out.resize(q.len(), 0.0);
    assembly.kernel.slope_over_q(q, out);
    let power = assembly.kernel.dim() as i32 + 2;
    out.iter_mut().zip(row.j).for_each(|(s, &j)| *s *= -(1.0 / h(j as usize)).powi(power));
}

/// The inverse of Σ m_b s_ab d dᵀ.
fn frame(slopes: &[Slope]) -> Matrix3<f64> {
    let spread = slopes.iter().fold(Matrix3::zeros(), |sum, s| {
        let d = nalgebra::Vector3::from(s.d);
        sum + d * d.transpose() * s.own
    });
    gradient::pseudo_inverse(spread)
}
