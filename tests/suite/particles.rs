//! Particles and solvers that several tests use.

use diffusph::{Solver, Strided};
use std::f64::consts::PI;

/// A linear congruential generator: the same particles on every machine.
pub struct Random(pub u64);

impl Random {
    /// Uniform in [-1, 1).
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        2.0 * ((self.0 >> 11) as f64 / (1u64 << 53) as f64) - 1.0
    }
}

/// A cell-centred lattice of n^dim points in the unit box, each coordinate moved by up to `jitter` spacings.
pub fn lattice(n: usize, dim: usize, jitter: f64) -> Vec<f64> {
    let mut random = Random(12345);
    let cell = |p: usize, a: usize| ((p / n.pow(a as u32)) % n) as f64 + 0.5;
    let points = (0..n.pow(dim as u32)).flat_map(|p| (0..dim).map(move |a| (p, a)));
    points.map(|(p, a)| (cell(p, a) + jitter * random.next()) / n as f64).collect()
}

/// A solver on particles of total mass 1 and kappa 1 in the unit box, periodic or open; rho is 1 as given.
pub fn unit_box(words: &str, x: &[f64], dim: usize, periodic: bool) -> Solver {
    let n = x.len() / dim;
    let mut s = Solver::new(&format!("heat dim={dim} {words}")).unwrap();
    if periodic {
        s.set_box(&[0.0; 3][..dim], &[1.0; 3][..dim], &[true; 3][..dim]).unwrap();
    }
    s.set_particles(Strided::new("x", x, n, dim, dim).unwrap()).unwrap();
    for (name, value) in [("m", 1.0 / n.max(1) as f64), ("rho", 1.0), ("kappa", 1.0)] {
        s.set_number(name, value).unwrap();
    }
    s
}

pub fn set(s: &mut Solver, name: &str, values: &[f64]) {
    s.set(name, Strided::packed(values)).unwrap();
}

/// f at each particle.
pub fn field(x: &[f64], dim: usize, f: impl Fn(&[f64]) -> f64) -> Vec<f64> {
    x.chunks(dim).map(f).collect()
}

/// Relative l2 difference of a from b.
pub fn l2(a: &[f64], b: &[f64]) -> f64 {
    let (difference, size): (f64, f64) =
        a.iter().zip(b).fold((0.0, 0.0), |(d, s), (a, b)| (d + (a - b) * (a - b), s + b * b));
    (difference / size).sqrt()
}

/// Relative error of a mode in the periodic unit box after it has decayed by e.
pub fn mode_error(words: &str, x: &[f64], dim: usize) -> f64 {
    let mut s = unit_box(words, x, dim, true);
    let mode = field(x, dim, |p| p.iter().map(|x| (2.0 * PI * x).sin()).product());
    set(&mut s, "T", &mode);
    s.step(1.0 / (4.0 * PI * PI * dim as f64)).unwrap();
    let exact: Vec<f64> = mode.iter().map(|m| m * (-1.0f64).exp()).collect();
    l2(&s.get_all("T").unwrap(), &exact)
}

pub fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|v| v.to_bits()).collect()
}

pub fn max_abs(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, v| m.max(v.abs()))
}

/// Names of a catalogue.
pub fn names(catalogue: &str) -> Vec<String> {
    diffusph::solver::catalogue::catalogue(catalogue).unwrap().into_iter().map(|item| item.name).collect()
}

/// A glass in the periodic unit box.
pub fn glass(n: usize, dim: usize) -> Vec<f64> {
    let mut x = lattice(n, dim, 0.5);
    diffusph::study::glass::relax(&mut x, &[0.0; 3][..dim], &[1.0; 3][..dim]).unwrap();
    x
}
