//! Directions in which a particle has neighbours on one side only.
//!
//! Where particles end, half of a particle's cell lies beyond the last centre: a straight line of T, which flows between
//! centres, carries there half of what it carries inside. Asked for its whole second moment, such a particle would make its
//! pairs too strong, and a plate of two layers conduct twice as well across itself as it should.

use super::normalise::rise;
use super::tensor::{self, Sym};
use crate::space::{Axes, Row};
use nalgebra::{Matrix3, Vector3};

/// |Σ ω r̂|/Σ ω, ω = g r², up to which nobody is looked at closer: disorder makes 0.1, a plate of two layers has 0.3 and more.
const SKEWED: f64 = 0.15;
/// |Σ ω c|c||/Σ ω c², c = r̂·e, between which e comes to be one-sided: second layers of lattices have up to 0.5, first ones
/// with 40 % jitter 0.8 to 1.
const BOTH: f64 = 0.6;
const ONE: f64 = 0.9;
/// The same along (n ± m)/√2, between which an edge comes to be one with neighbours on one side of m as well as of n.
const FACE: f64 = 0.85;
const EDGE: f64 = 1.0;

const LANES: usize = 4;

/// What is to be asked for of a second moment.
pub fn part_of(wanted: &Sym, dim: usize, row: &Row, g: &[f64]) -> Sym {
    match kept(dim, row, g) {
        Some(kept) => tensor::of_matrix(&(kept * tensor::matrix(wanted) * kept)),
        None => *wanted,
    }
}

/// K for which K S K is asked for where S is wanted: I where neighbours are all around, for which none stands.
pub fn kept(dim: usize, row: &Row, g: &[f64]) -> Option<Matrix3<f64>> {
    let ([x, y, z], all) = match dim {
        1 => skew::<1>(row, g),
        2 => skew::<2>(row, g),
        _ => skew::<3>(row, g),
    };
    let skew = Vector3::new(x, y, z);
    let skewed = skew.norm() > SKEWED * all && all > 0.0 && all.is_finite();
    if skewed { halved(&Sides { dim, row, g }, skew.normalize()) } else { None }
}

/// Σ ω r̂ and Σ ω, ω = g r².
#[inline(always)]
fn skew<const D: usize>(row: &Row, g: &[f64]) -> (Axes<f64>, f64) {
    let d: [&[f64]; D] = std::array::from_fn(|axis| &row.d[axis][..g.len()]);
    let r = &row.r[..g.len()];
    let (mut sums, mut all) = ([[0.0; LANES]; D], [0.0; LANES]);
    let whole = g.len() - g.len() % LANES;
    let mut add = |at: usize, lane: usize| {
        let once = g[at] * r[at];
        all[lane] += once * r[at];
        for axis in 0..D {
            sums[axis][lane] += once * d[axis][at];
        }
    };
    for at in (0..whole).step_by(LANES) {
        (0..LANES).for_each(|lane| add(at + lane, lane));
    }
    (whole..g.len()).for_each(|at| add(at, at - whole));
    let total = |lanes: [f64; LANES]| (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]);
    let mut skew = [0.0; 3];
    sums.into_iter().enumerate().for_each(|(axis, lanes)| skew[axis] = total(lanes));
    (skew, total(all))
}

/// √½ along directions of which one side is empty: `normal`, and others where it points out of an edge.
#[cold]
fn halved(sides: &Sides, normal: Vector3<f64>) -> Option<Matrix3<f64>> {
    let one_sided = rise(sides.along(normal), BOTH, ONE);
    if one_sided == 0.0 {
        return None;
    }
    let mut kept = Matrix3::identity();
    let mut keep = |e: Vector3<f64>, one_sided: f64| {
        kept -= e * e.transpose() * (1.0 - (1.0 - 0.5 * one_sided).sqrt());
    };
    keep(normal, one_sided);
    for m in sides.across(normal) {
        let tilted = |sign: f64| sides.along((normal + m * sign).normalize());
        keep(m, one_sided * rise(tilted(1.0).min(tilted(-1.0)), FACE, EDGE));
    }
    Some(kept)
}

struct Sides<'a> {
    dim: usize,
    row: &'a Row<'a>,
    g: &'a [f64],
}

impl Sides<'_> {
    /// |Σ ω c|c||/Σ ω c²
    fn along(&self, e: Vector3<f64>) -> f64 {
        let (mut signed, mut all) = (0.0, 0.0);
        for (k, g) in self.g.iter().enumerate() {
            let c: f64 = (0..self.dim).map(|axis| e[axis] * self.row.d[axis][k]).sum();
            signed += g * c * c.abs();
            all += g * c * c;
        }
        if all > 0.0 { signed.abs() / all } else { 0.0 }
    }

    /// The axes across it: the principal ones of what lies there.
    fn across(&self, normal: Vector3<f64>) -> Vec<Vector3<f64>> {
        if self.dim < 3 {
            let turned = Vector3::new(-normal.y, normal.x, 0.0);
            return [turned][..self.dim - 1].to_vec();
        }
        let u = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize();
        let v = normal.cross(&u);
        let second = tensor::second(self.row, self.dim, self.g);
        let of = |a: &Vector3<f64>, b: &Vector3<f64>| a.dot(&(second * b));
        let (sin, cos) = (0.5 * (2.0 * of(&u, &v)).atan2(of(&u, &u) - of(&v, &v))).sin_cos();
        vec![u * cos + v * sin, v * cos - u * sin]
    }
}
