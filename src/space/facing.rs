//! The area of a particle that faces outside, from where its neighbours are.
//!
//! ```text
//! A_a = V_a^((nu−1)/nu) (|∇ ln S_a| / its value at a flat face)^(3/2),    S = Σ_b V_b W_ab(h_a), the particle itself included
//! ```
//!
//! S falls from 1 inside to 1/2 and less at a surface. Its logarithm adds up over faces at right angles, which therefore
//! count as their number to the power 3/4 at edges and corners; the exponent 3/2 makes up for that and for layers that are
//! not parallel to the surface. Measured on squares and cubes along and across the lattice and on discs, 20 and 12
//! particles wide, jitter 0 to 20 %: the sum over all particles is 0.95 to 1.07 of the area, on a ball 12 wide 1.13; nothing
//! inside. In a layer as thin as one particle ∇S vanishes, and ln S itself counts the faces.
//!
//! V^((nu−1)/nu) takes neighbours to be as far apart along the face as across it: on a lattice squeezed 2:1 the sum is 0.68 of
//! the area, at 3:1 nothing on one side. Where all surfaces are squeezed along one direction, that is refused; where the
//! direction turns with the surface (rings closer to each other than their particles are) it is not seen, because the
//! ragged surface of splashing water looks the same.

use super::{Row, rows::Rows};
use crate::error::{Error, Result};
use crate::kernel::Kernel;
use crate::memory;
use crate::pool::Pool;
use nalgebra::Matrix3;

/// Fewer faces than this are disorder.
const LEAST: f64 = 0.35;
/// Where ∇S says so, ln S must say that this many are open for it to be believed.
const THIN: f64 = 1.5;
/// Half the width of the lattice that is summed over for a flat face, in spacings: wider supports are not of use.
const MOST: f64 = 24.0;
/// h over spacing is rounded to these parts, so that few flat faces need to be looked at.
const PARTS: f64 = 64.0;

/// The largest ratio of nearness between directions, over all particles that face outside. With 20 % jitter: one flat face
/// of 8² or 16 particles 1.5 to 1.9, all faces of a body 1.0 to 1.1, splashing water 1.3; squeezed 2:1 to 3:1 from 2.8 on.
const ALIKE: f64 = 2.3;
/// Few particles are not alike by chance: ALIKE (1 + this / √n). 30 clouds had 4.6 at most for one particle, 3.6 for three.
const CHANCE: f64 = 1.5;

/// What is seen of one particle's surface.
#[derive(Clone, Copy, Default)]
struct Facing {
    area: f64,
    /// Of its neighbours, where it has a face: Σ (1/r)^4 r r / r² over its trace, upper triangle.
    near: Option<[f64; 6]>,
}

/// ln S and |∇ ln S| times the spacing, of the outermost layer of a lattice with a flat face.
#[derive(Clone, Copy)]
pub(super) struct Face {
    pub log: f64,
    pub slope: f64,
}

/// The flat faces met so far, by h over spacing.
#[derive(Default)]
pub(super) struct Faces(Vec<(u32, Face)>);

/// Buffers of a worker.
#[derive(Default)]
struct Space {
    q: Vec<f64>,
    w: Vec<f64>,
    slope: Vec<f64>,
    faces: Faces,
}

/// The areas of all particles for which `wanted`, 0 for the others.
///
/// # Errors
/// `NoMemory`; `BadElement` naming a particle where spacing differs by direction.
pub fn areas(
    kernel: &Kernel,
    rows: &Rows,
    volume: &[f64],
    wanted: impl Fn(usize) -> bool + Sync + Send,
    host: impl Fn(usize) -> usize,
    pool: &Pool,
) -> Result<Vec<f64>> {
    let mut seen = memory::filled("areas", volume.len(), Facing::default())?;
    rows.map(pool, &mut seen, |space: &mut Space, row: Row| {
        Ok(if wanted(row.i) { space.facing(kernel, rows.h[row.i], volume, &row) } else { Facing::default() })
    })?;
    refuse_squeezed(&seen, kernel.dim(), host)?;
    let mut areas = memory::reserved("areas", seen.len())?;
    areas.extend(seen.iter().map(|f| f.area));
    Ok(areas)
}

fn refuse_squeezed(seen: &[Facing], dim: usize, host: impl Fn(usize) -> usize) -> Result<()> {
    let (mut near, mut faces) = (Matrix3::zeros(), 0.0);
    for [xx, xy, xz, yy, yz, zz] in seen.iter().filter_map(|f| f.near) {
        near += Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        faces += 1.0;
    }
    let Some(first) = (0..seen.len()).filter(|&i| seen[i].near.is_some()).map(host).min() else { return Ok(()) };
    let mut along = near.symmetric_eigenvalues();
    along.as_mut_slice().sort_by(|a, b| b.total_cmp(a));
    let (most, least) = (along[0], along[dim - 1]);
    // Bodies without thickness have edges only.
    if least < 1e-6 * most || most <= ALIKE * (1.0 + CHANCE / f64::sqrt(faces)) * least {
        return Ok(());
    }
    let rule =
        "neighbours are not as far apart along the surface as across it, where area cannot be measured: give area";
    Err(Error::bad_at("area", first, "unset", rule))
}

impl Space {
    fn facing(&mut self, kernel: &Kernel, h: f64, volume: &[f64], row: &Row) -> Facing {
        let nu = kernel.dim() as f64;
        let spacing = volume[row.i].powf(1.0 / nu);
        self.evaluate(kernel, row.r.iter().map(|r| r / h));
        // In units of h, so that nothing overflows in any system of units.
        let share = |j: u32| volume[j as usize] / h.powf(nu);
        let (mut s, mut gradient) = (share(row.i as u32) * kernel.w_at(0.0), [0.0; 3]);
        for (k, (w, slope)) in self.w.iter().zip(&self.slope).enumerate() {
            s += share(row.j[k]) * w;
            for (g, d) in gradient.iter_mut().zip(row.d).filter(|(_, d)| !d.is_empty()) {
                *g += share(row.j[k]) * slope * d[k] / h;
            }
        }
        let slope = gradient.iter().map(|g| g * g).sum::<f64>().sqrt() * (spacing / h) / s;
        let face = self.faces.at(kernel, h / spacing);
        let (open, thin) = ((slope / face.slope).powf(1.5), s.ln() / face.log);
        // The ends of a row are whole.
        let line = kernel.dim() == 1;
        let faces = if row.is_empty() {
            2.0 * nu
        } else if open >= LEAST {
            if line { 1.0 } else { open }
        } else if thin >= THIN {
            if line { 2.0 } else { thin }
        } else {
            0.0
        };
        let near = (open >= LEAST && !line).then(|| near(row));
        Facing { area: spacing.powf(nu - 1.0) * faces, near: near.flatten() }
    }

    fn evaluate(&mut self, kernel: &Kernel, q: impl Iterator<Item = f64>) {
        self.q.clear();
        self.q.extend(q);
        self.w.resize(self.q.len(), 0.0);
        self.slope.resize(self.q.len(), 0.0);
        kernel.w(&self.q, &mut self.w);
        kernel.slope_over_q(&self.q, &mut self.slope);
    }
}

/// In which directions the nearest neighbours are; nothing without any.
fn near(row: &Row) -> Option<[f64; 6]> {
    let nearest = row.r.iter().copied().filter(|&r| r > 0.0).fold(f64::INFINITY, f64::min);
    let mut sum = [0.0; 6];
    for (k, &r) in row.r.iter().enumerate().filter(|(_, r)| **r > 0.0) {
        let [x, y, z] = row.d.map(|d| d.get(k).map_or(0.0, |d| d / r));
        let weight = (nearest / r).powi(4);
        for (s, product) in sum.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
            *s += weight * product;
        }
    }
    let trace = sum[0] + sum[3] + sum[5];
    (trace > 0.0).then(|| sum.map(|s| s / trace))
}

impl Faces {
    /// The flat face for this h over spacing.
    pub fn at(&mut self, kernel: &Kernel, ratio: f64) -> Face {
        let part = (ratio * PARTS).round().clamp(1.0, 1e6) as u32;
        if let Some((_, face)) = self.0.iter().find(|(p, _)| *p == part) {
            return *face;
        }
        let face = Face::of(kernel, f64::from(part) / PARTS);
        self.0.push((part, face));
        face
    }
}

impl Face {
    /// Sums over a half lattice of spacing 1; layers from the face inwards.
    fn of(kernel: &Kernel, h: f64) -> Face {
        let most = (kernel.radius() * h).min(MOST).floor() as i32;
        let across = |axis: usize| if axis < kernel.dim() { -most..=most } else { 0..=0 };
        let (mut s, mut slope, volume) = (0.0, 0.0, h.powi(-(kernel.dim() as i32)));
        for x in 0..=most {
            for (y, z) in across(1).flat_map(|y| across(2).map(move |z| (y, z))) {
                let q = f64::from(x * x + y * y + z * z).sqrt() / h;
                let mut by_q = [0.0];
                kernel.slope_over_q(&[q], &mut by_q);
                s += volume * kernel.w_at(q);
                slope += volume * by_q[0] * f64::from(x) / h;
            }
        }
        Face { log: s.ln(), slope: (slope / h / s).abs() }
    }
}
