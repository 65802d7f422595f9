//! Particles and solvers that several cases use.

use super::{Seen, trial};
use crate::array::Strided;
use crate::error::Result;
use crate::integrator::Method;
use crate::operator::table;
use crate::plan::applies::fitting;
use crate::solver::Solver;
use crate::study::lattice;
use crate::words::replaced;

/// What a case is tried with.
pub struct Setting {
    /// Of the solver, beside `heat dim=…`.
    pub words: String,
    /// Multiplies the number of particles along each axis.
    pub scale: usize,
    pub threads: usize,
    /// Multiplies conductivities: 1, or something else in a control, whose cases must fail.
    pub conducts: f64,
}

/// T inside and outside the hot disc.
pub const HOT: f64 = 10.0;
pub const COLD: f64 = 0.1;

impl Setting {
    /// `n` particles (times the scale) along each axis of the unit box, moved by up to `jitter` spacings.
    pub fn lattice(&self, n: usize, dim: usize, jitter: f64) -> Result<Vec<f64>> {
        let n = n * self.scale;
        let mut x = lattice::find("cubic", dim)?.fill(&[0.0; 3][..dim], &[1.0; 3][..dim], n)?;
        lattice::jitter(&mut x, jitter / n as f64, 12345);
        Ok(x)
    }

    /// A solver without particles.
    pub fn solver(&self, dim: usize, more: &str) -> Result<Solver> {
        Solver::new(&fitting(&format!("heat dim={dim} threads={} {} {more}", self.threads, self.words)))
    }

    /// Particles of total mass 1, rho = 1 and kappa = 1 in the unit box, periodic or open.
    pub fn unit_box(&self, x: &[f64], dim: usize, periodic: bool, more: &str) -> Result<Solver> {
        let mut s = self.solver(dim, more)?;
        if periodic {
            s.set_box(&[0.0; 3][..dim], &[1.0; 3][..dim], &[true; 3][..dim])?;
        }
        place(&mut s, x)?;
        numbers(&mut s, &[("m", dim as f64 / x.len().max(1) as f64), ("rho", 1.0), ("kappa", self.conducts)])?;
        Ok(s)
    }

    /// To know what is right with the same operator: conducts as it should, in many short steps of an explicit method.
    pub fn careful(&self) -> Setting {
        let words = replaced(&self.words, "integrator=ssprk3", &["stages", "tolerance"]);
        Setting { words, conducts: 1.0, ..*self }
    }

    /// The hot disc, 10 : 0.1, on 20 %-jittered particles with unequal heat capacities.
    pub fn disc(&self, more: &str) -> Result<Solver> {
        let x = self.lattice(24, 2, 0.2)?;
        let mut s = self.unit_box(&x, 2, true, more)?;
        set(&mut s, "c_v", &field(&x, 2, |p| 1.0 + p[1].rem_euclid(1.0)))?;
        set(&mut s, "T", &field(&x, 2, disc))?;
        Ok(s)
    }

    pub fn method(&self) -> Option<&'static Method> {
        trial::method(&self.words)
    }

    /// Whether the words promise the maximum principle.
    pub fn keeps_bounds(&self) -> bool {
        let named = trial::value(&self.words, "operator").unwrap_or("brookshaw");
        let able = table::find(named).is_ok_and(|o| o.positive) && !self.words.contains("bounds=free");
        able || self.method().is_some_and(|m| m.ssp > 0.0)
    }

    pub fn is_implicit(&self) -> bool {
        self.method().is_some_and(Method::is_implicit)
    }
}

/// T of the hot disc.
pub fn disc(p: &[f64]) -> f64 {
    if (p[0] - 0.5).hypot(p[1] - 0.5) < 0.25 { HOT } else { COLD }
}

pub fn place(s: &mut Solver, x: &[f64]) -> Result<()> {
    let dim = s.dim();
    s.set_particles(Strided::new("x", x, x.len() / dim, dim, dim)?)
}

pub fn set(s: &mut Solver, name: &str, values: &[f64]) -> Result<()> {
    s.set(name, Strided::packed(values))
}

pub fn numbers(s: &mut Solver, given: &[(&str, f64)]) -> Result<()> {
    given.iter().try_for_each(|(name, value)| s.set_number(name, *value))
}

/// f at each particle.
pub fn field(x: &[f64], dim: usize, f: impl Fn(&[f64]) -> f64) -> Vec<f64> {
    x.chunks(dim).map(f).collect()
}

/// Relative l2 difference of a from b.
pub fn l2(a: &[f64], b: &[f64]) -> f64 {
    let (difference, size): (f64, f64) =
        a.iter().zip(b).fold((0.0, 0.0), |(d, s), (a, b)| (d + (a - b) * (a - b), s + b * b));
    if size > 0.0 { (difference / size).sqrt() } else { difference.sqrt() }
}

pub fn same_bits(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// Σ m c_v T and Σ |m c_v T| of a solver.
pub fn energy(s: &mut Solver) -> Result<(f64, f64)> {
    let (m, u) = (s.get_all("m")?, s.get_all("u")?);
    let terms = || m.iter().zip(&u).map(|(m, u)| m * u);
    Ok((s.get_number("energy")?, terms().map(f64::abs).sum()))
}

/// Steps, and requires that energy is kept, that T stays in bounds where the method promises it, and that T is finite.
pub fn careful_step(setting: &Setting, s: &mut Solver, dt: f64, seen: &mut Seen) -> Result<()> {
    let (low, high, (before, size)) = (s.get_number("T_min")?, s.get_number("T_max")?, energy(s)?);
    s.step(dt)?;
    let t = s.get_all("T")?;
    seen.remember(&t);
    seen.at_most("energy off by", (energy(s)?.0 - before).abs() / size, 1e-12);
    let outside = t.iter().map(|t| (low - t).max(t - high)).fold(0.0, f64::max);
    match setting.keeps_bounds() {
        true => seen.at_most("outside by", outside, bounds_slack(setting, s, dt, high - low)?),
        false => seen.at_most("outside by", outside, high - low),
    }
    if t.iter().any(|t| !t.is_finite()) {
        seen.require("finite", false);
    }
    Ok(())
}

/// How far outside a method that keeps bounds may be: rounding, and of an implicit solve the tolerance of its equations,
/// which cannot be better than they are rounded.
fn bounds_slack(setting: &Setting, s: &mut Solver, dt: f64, spread: f64) -> Result<f64> {
    let rounding = 1e-12 * s.get_number("T_max")?.abs().max(spread);
    if !setting.is_implicit() {
        return Ok(rounding);
    }
    let stiffness = dt / s.limit()?;
    Ok(rounding + 2.0 * spread * (1e-10 + 4.0 * f64::EPSILON * stiffness))
}

/// Requires that a call answers with this error and that its message contains `says`.
pub fn refused<T>(seen: &mut Seen, what: &str, answer: Result<T>, name: &str, says: &str) {
    match answer {
        Err(e) if e.name() == name && e.to_string().contains(says) => seen.require(&format!("{what}: {name}"), true),
        Err(e) => seen.require(&format!("{what}: {name} ({e})"), false),
        Ok(_) => seen.require(&format!("{what}: {name} (DONE)"), false),
    }
}
/// The largest difference of a from b.
pub fn worst(a: &[f64], b: &[f64]) -> f64 {
    // fold(max) would pass over NaN.
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, |m, d| if d > m || d.is_nan() { d } else { m })
}
