//! Particles on lattices, disordered on request.

use crate::error::{Error, Result};
use crate::memory;

/// A lattice is a unit cell with particles at fixed places. Add a lattice here.
pub struct Lattice {
    pub name: &'static str,
    pub about: &'static str,
    dims: &'static [usize],
    /// Edges of the cell, in units of its first.
    cell: [f64; 3],
    /// Places in the cell, in units of its edges.
    places: &'static [[f64; 3]],
}

pub static LATTICES: &[Lattice] = &[
    Lattice {
        name: "cubic",
        about: "evenly spaced along each axis, in 1, 2 or 3 dimensions",
        dims: &[1, 2, 3],
        cell: [1.0; 3],
        places: &[[0.5; 3]],
    },
    Lattice { name: "square", about: "the same in 2 dimensions", dims: &[2], cell: [1.0; 3], places: &[[0.5; 3]] },
    Lattice {
        name: "hexagonal",
        about: "the closest packing of discs, 2 dimensions; two particles in a cell",
        dims: &[2],
        cell: [1.0, 1.7320508075688772, 1.0],
        places: &[[0.25, 0.25, 0.0], [0.75, 0.75, 0.0]],
    },
    Lattice {
        name: "fcc",
        about: "a closest packing of spheres, 3 dimensions; four particles in a cell",
        dims: &[3],
        cell: [1.0; 3],
        places: &[[0.25, 0.25, 0.25], [0.75, 0.75, 0.25], [0.75, 0.25, 0.75], [0.25, 0.75, 0.75]],
    },
];

/// The lattice of that name, if it exists in `dim` dimensions.
///
/// # Errors
/// `UnknownWord`; `BadValue` for a lattice of other dimensions.
pub fn find(name: &str, dim: usize) -> Result<&'static Lattice> {
    let found = LATTICES.iter().find(|l| l.name == name);
    let found = found.ok_or_else(|| Error::unknown("lattice", name, LATTICES.iter().map(|l| l.name)))?;
    if !found.dims.contains(&dim) {
        return Err(Error::bad("lattice", format!("'{name}'"), &format!("it does not exist in {dim} dimension(s)")));
    }
    Ok(found)
}

impl Lattice {
    /// Fills the box from `lo` to `hi` with `n` cells along the first axis and as many along the others as keep the
    /// cell's shape best: `lo.len()` coordinates per particle.
    ///
    /// # Errors
    /// `BadElement` for a box without length; `BadValue` for an n beyond memory.
    pub fn fill(&self, lo: &[f64], hi: &[f64], n: usize) -> Result<Vec<f64>> {
        let dim = lo.len();
        let mut cells = [1usize; 3];
        for axis in 0..dim {
            let length = hi[axis] - lo[axis];
            if !(length > 0.0 && length.is_finite()) {
                return Err(Error::bad_at("hi", axis, hi[axis], "a lattice fills a box with hi > lo on every axis"));
            }
            cells[axis] = (n as f64 * length / (hi[0] - lo[0]) / self.cell[axis]).round().max(1.0) as usize;
        }
        let count = cells.iter().try_fold(self.places.len() * dim, |all, &c| all.checked_mul(c));
        let Ok(mut x) = memory::reserved("lattice", count.unwrap_or(usize::MAX)) else {
            let particles = cells.iter().map(|&c| c as f64).product::<f64>() * self.places.len() as f64;
            let rule = format!("there is no memory for {particles:.1e} particles: take fewer");
            return Err(Error::bad("n", n, &rule));
        };
        for k in 0..cells[2] {
            for j in 0..cells[1] {
                for i in 0..cells[0] {
                    for place in self.places {
                        x.extend((0..dim).map(|a| {
                            let share = ([i, j, k][a] as f64 + place[a]) / cells[a] as f64;
                            lo[a] + (hi[a] - lo[a]) * share
                        }));
                    }
                }
            }
        }
        Ok(x)
    }
}

/// Moves every coordinate by up to `most` either way, the same for the same seed.
pub fn jitter(x: &mut [f64], most: f64, seed: u64) {
    let mut state = seed;
    for x in x {
        *x += most * (2.0 * uniform(&mut state) - 1.0);
    }
}

/// Between 0 and 1, by splitmix64 (Steele, Lea & Flood 2014).
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) as f64 / 2f64.powi(64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distances from the first particle to all its periodic images, ascending.
    fn shells(lattice: &Lattice, dim: usize) -> Vec<f64> {
        let hi = &[4.0, 4.0 * lattice.cell[1], 4.0][..dim];
        let x = lattice.fill(&[0.0; 3][..dim], hi, 4).unwrap();
        let mut r: Vec<f64> = x
            .chunks(dim)
            .skip(1)
            .map(|p| {
                let d = (0..dim).map(|a| (p[a] - x[a]).abs()).enumerate().map(|(a, d)| d.min(hi[a] - d));
                d.map(|d| d * d).sum::<f64>().sqrt()
            })
            .collect();
        r.sort_by(f64::total_cmp);
        r
    }

    #[test]
    fn particles_have_the_neighbours_of_their_lattice() {
        // Kissing numbers of the packings.
        for (name, dim, neighbours) in
            [("cubic", 1, 2), ("cubic", 2, 4), ("cubic", 3, 6), ("square", 2, 4), ("hexagonal", 2, 6), ("fcc", 3, 12)]
        {
            let r = shells(find(name, dim).unwrap(), dim);
            let nearest = r.iter().filter(|d| **d < 1.001 * r[0]).count();
            assert_eq!(nearest, neighbours, "{name} in {dim}-D");
        }
        assert!(find("hexagonal", 3).is_err() && find("cubik", 3).is_err());
    }

    #[test]
    fn jitter_is_repeatable_bounded_and_even() {
        let mut x = vec![0.0; 100_000];
        jitter(&mut x, 0.5, 7);
        let mut again = vec![0.0; 100_000];
        jitter(&mut again, 0.5, 7);
        assert!(x == again && x.iter().all(|x| x.abs() <= 0.5));
        // Mean 0 within four standard errors, 0.5/sqrt(3 n); variance 1/12 likewise.
        let mean = x.iter().sum::<f64>() / 1e5;
        let variance = x.iter().map(|x| x * x).sum::<f64>() / 1e5;
        assert!(mean.abs() < 4e-3 && (variance * 12.0 - 1.0).abs() < 2e-2, "{mean} {variance}");
    }
}
