//! The neighbours of one particle of a 2-D lattice, and waves on it. Lengths are in units of h.

use super::Tensor;
use crate::error::Result;
use crate::kernel::Kernel;
use crate::study::lattice;
use std::f64::consts::PI;

/// Which anisotropic operator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Form {
    EspanolRevenga,
    /// 2 r̂·kappa·r̂ (−F/r): never negative.
    Pair,
    /// The divergence of kappa times the gradient.
    TwoFirst,
}

pub struct Neighbour {
    pub r: [f64; 2],
    /// −F/r times the volume.
    pub slope: f64,
}

impl Neighbour {
    /// Of the angle between the pair and an axis.
    pub fn cos(&self, angle: f64) -> f64 {
        let [x, y] = self.r;
        (x * angle.cos() + y * angle.sin()) / x.hypot(y)
    }
}

pub struct Neighbours {
    pub pairs: Vec<Neighbour>,
    /// Of the support.
    pub radius: f64,
    /// Waves up to here are all that a lattice can tell apart.
    reach: f64,
}

impl Neighbours {
    /// # Errors
    /// As [`Kernel::new`] and [`lattice::find`].
    pub fn new(name: &str, kernel: &str, h_fac: f64) -> Result<Neighbours> {
        let kernel = Kernel::new(kernel, 2)?;
        let cells = 2 * (2.0 * kernel.radius() * h_fac).ceil() as usize;
        let height = if name == "hexagonal" { cells as f64 * 3f64.sqrt() } else { cells as f64 };
        let x = lattice::find(name, 2)?.fill(&[0.0; 2], &[cells as f64, height], cells)?;
        let volume = cells as f64 * height / (x.len() / 2) as f64;
        let h = h_fac * volume.sqrt();
        let middle = nearest(&x, [0.5 * cells as f64, 0.5 * height]);
        let from = |p: &[f64]| [(p[0] - middle[0]) / h, (p[1] - middle[1]) / h];
        let inside = |r: &[f64; 2]| (1e-9..kernel.radius()).contains(&r[0].hypot(r[1]));
        let pairs = x.chunks(2).map(from).filter(inside).map(|r| {
            let mut slope = [0.0];
            kernel.slope_over_q(&[r[0].hypot(r[1])], &mut slope);
            Neighbour { r, slope: -slope[0] * volume / (h * h) }
        });
        Ok(Neighbours { pairs: pairs.collect(), radius: kernel.radius(), reach: 2.0 * PI * h / volume.sqrt() })
    }

    /// The share of pairs with a negative weight.
    pub fn negative(&self, tensor: Tensor) -> f64 {
        let negative = |p: &&Neighbour| tensor.factor(2, p.cos(tensor.angle)) < -1e-12;
        self.pairs.iter().filter(negative).count() as f64 / self.pairs.len().max(1) as f64
    }

    /// The largest growth rate times h² over `waves`² waves in each quarter.
    pub fn growth(&self, form: Form, tensor: Tensor, waves: usize) -> f64 {
        let k = |i: usize| self.reach * (i as f64 / waves as f64);
        let all = (0..waves * waves).flat_map(|i| {
            let (x, y) = (k(i % waves), k(i / waves));
            [[x, y], [-x, y]]
        });
        all.map(|k| self.rate(form, tensor, k)).fold(0.0, f64::max)
    }

    fn rate(&self, form: Form, tensor: Tensor, k: [f64; 2]) -> f64 {
        let phase = |p: &Neighbour| k[0] * p.r[0] + k[1] * p.r[1];
        match form {
            Form::TwoFirst => {
                let g = [0, 1].map(|a| self.pairs.iter().map(|p| p.slope * p.r[a] * phase(p).sin()).sum::<f64>());
                let length = g[0].hypot(g[1]);
                if length == 0.0 { 0.0 } else { -length * length * tensor.along(cosine(g, tensor.angle) / length) }
            }
            _ => {
                let weight = |p: &Neighbour| match form {
                    Form::Pair => 2.0 * tensor.along(p.cos(tensor.angle)),
                    _ => tensor.factor(2, p.cos(tensor.angle)),
                };
                self.pairs.iter().map(|p| weight(p) * p.slope * (phase(p).cos() - 1.0)).sum()
            }
        }
    }
}

fn cosine(g: [f64; 2], angle: f64) -> f64 {
    g[0] * angle.cos() + g[1] * angle.sin()
}

fn nearest(x: &[f64], to: [f64; 2]) -> [f64; 2] {
    let distance = |p: &[f64]| (p[0] - to[0]).hypot(p[1] - to[1]);
    let nearest = x.chunks(2).min_by(|a, b| distance(a).total_cmp(&distance(b)));
    nearest.map_or(to, |p| [p[0], p[1]])
}
