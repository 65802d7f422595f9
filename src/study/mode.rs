//! The scene of most studies: one mode, the product of sines over a periodic box of particles, decays to 1/e.

use super::scene::Scene;
use super::setup::setup;
use crate::error::Result;
use crate::operator::table::OPERATORS;
use crate::operator::{Normalise, Operator};
use crate::plan::applies::fitting;
use crate::words::replaced;
use std::path::Path;
use std::sync::Arc;

/// How particles lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cloud {
    pub name: &'static str,
    pub dim: usize,
    lattice: &'static str,
    jitter: f64,
    glass: bool,
    /// Edge of the cell along y in units of that along x, and particles in it.
    cell: (f64, usize),
}

const fn cloud(name: &'static str, dim: usize, lattice: &'static str, jitter: f64) -> Cloud {
    Cloud { name, dim, lattice, jitter, glass: false, cell: (1.0, 1) }
}

pub const LINE: Cloud = cloud("line", 1, "cubic", 0.0);
pub const SQUARE: Cloud = cloud("square", 2, "square", 0.0);
pub const HEXAGONAL: Cloud = Cloud { cell: (1.7320508075688772, 2), ..cloud("hexagonal", 2, "hexagonal", 0.0) };
pub const JITTER_2D: Cloud = cloud("2-D 20 % jitter", 2, "square", 0.2);
pub const STRONG_2D: Cloud = cloud("2-D 40 % jitter", 2, "square", 0.4);
pub const GLASS_2D: Cloud = Cloud { glass: true, ..cloud("2-D glass", 2, "square", 0.5) };
pub const CUBIC: Cloud = cloud("cubic", 3, "cubic", 0.0);
pub const FCC: Cloud = Cloud { cell: (1.0, 4), ..cloud("fcc", 3, "fcc", 0.0) };
pub const JITTER_3D: Cloud = cloud("3-D 20 % jitter", 3, "cubic", 0.2);
pub const STRONG_3D: Cloud = cloud("3-D 40 % jitter", 3, "cubic", 0.4);
pub const GLASS_3D: Cloud = Cloud { glass: true, ..cloud("3-D glass", 3, "cubic", 0.5) };

impl Cloud {
    /// Whether chance places its particles.
    pub fn is_disordered(&self) -> bool {
        self.jitter > 0.0
    }

    /// Some `n` particles per side.
    ///
    /// # Errors
    /// As [`Scene::parse`].
    pub fn scene(&self, n: usize, words: &str) -> Result<Scene> {
        let dim = self.dim;
        let (edge, count) = self.cell;
        let cells = (n as f64 * (edge / count as f64).powf(1.0 / dim as f64)).round().max(1.0);
        // A whole number of undistorted cells along y.
        let rows = (cells / edge).round().max(1.0);
        let hi: Vec<f64> = [1.0, rows * edge / cells, 1.0][..dim].to_vec();
        let waves: Vec<f64> = hi.iter().map(|hi| 1.0 / hi).collect();
        let rate: f64 = waves.iter().map(|w| (2.0 * std::f64::consts::PI * w).powi(2)).sum();
        let Cloud { lattice, jitter, glass, .. } = self;
        let text = format!(
            "words = \"heat dim={dim} {words}\"\n[box]\nlo = {:?}\nhi = {hi:?}\nperiodic = true\n[particles]\n\
             lattice = \"{lattice}\"\nn = {cells}\njitter = {jitter:?}\nglass = {glass}\n[set]\nkappa = 1\nrho = 1\n\
             [time]\nend = {:?}\nsteps = 1\n[exact]\nname = \"sine\"\nwaves = {waves:?}\n",
            vec![0.0; dim],
            1.0 / rate
        );
        Scene::parse(self.name, &text)
    }
}

/// A cloud of some size, its particles made once: a glass takes time.
#[derive(Debug, Clone)]
pub struct Sample {
    pub cloud: Cloud,
    pub n: usize,
    scene: Scene,
}

impl Sample {
    /// # Errors
    /// As [`Cloud::scene`] and of the particles.
    pub fn new(cloud: Cloud, n: usize) -> Result<Sample> {
        Sample::seeded(cloud, n, 1)
    }

    /// The same with another disorder for each seed.
    ///
    /// # Errors
    /// As [`Sample::new`].
    pub fn seeded(cloud: Cloud, n: usize, seed: u64) -> Result<Sample> {
        let mut scene = cloud.scene(n, "")?;
        scene.particles.seed = seed;
        if cloud.glass {
            let (mut solver, _) = setup(&scene, Path::new(""))?;
            scene.particles.made = Some(Arc::new(solver.get_all("x")?));
        }
        Ok(Sample { cloud, n, scene })
    }

    /// The scene with these words.
    pub fn scene(&self, words: &str) -> Scene {
        let mut scene = self.scene.clone();
        scene.words = fitting(&replaced(&scene.words, words, &[]));
        scene
    }
}

/// Operators for a scalar conductivity that differ from each other there: those that only multiply a pair's weight by an
/// angle are the same as without.
pub fn isotropic() -> impl Iterator<Item = &'static Operator> {
    OPERATORS.iter().filter(|o| !o.has_angle())
}

/// Each with and without what it can be normalised by: in words, and what it is called.
pub fn variants() -> Vec<(String, String)> {
    let of = |(name, normalise): (&str, &str)| {
        (format!("operator={name} normalise={normalise}"), format!("{name} {normalise}"))
    };
    let pairs =
        isotropic().flat_map(|o| match o.normalise == Normalise::No || o.is_projected() || !o.is_one_matrix() {
            true => vec![(o.name, o.normalise.name())],
            false => vec![(o.name, "none"), (o.name, "pair"), (o.name, "tensor")],
        });
    pairs.map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clouds_have_about_n_particles_per_side_in_undistorted_cells() {
        for cloud in [LINE, SQUARE, HEXAGONAL, JITTER_2D, GLASS_2D, CUBIC, FCC, JITTER_3D, GLASS_3D] {
            let scene = Sample::new(cloud, 12).unwrap().scene("threads=1");
            let (mut solver, exact) = setup(&scene, Path::new("")).unwrap();
            let wanted = 12f64.powi(cloud.dim as i32);
            assert!((solver.len() as f64 / wanted - 1.0).abs() < 0.4, "{} {}", cloud.name, solver.len());
            // Every neighbour of the closest packings is as far away as the next one: K is the same in x and y.
            assert!(exact.is_some() && solver.get_number("K_d2_max").unwrap() > 0.5);
        }
        assert!(variants().len() >= 5);
    }
}
