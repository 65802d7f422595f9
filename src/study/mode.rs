//! The scene of most studies: one mode, the product of sines over a periodic box of particles, decays to 1/e.

use super::scene::Scene;
use crate::error::{Error, Result};
use crate::operator::Operator;
use crate::operator::table::{OPERATORS, Tensor};
use std::path::Path;

/// How particles lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cloud {
    pub name: &'static str,
    pub dim: usize,
    lattice: &'static str,
    jitter: f64,
    /// Edge of the cell along y in units of that along x, and particles in it.
    cell: (f64, usize),
}

const fn cloud(name: &'static str, dim: usize, lattice: &'static str, jitter: f64) -> Cloud {
    Cloud { name, dim, lattice, jitter, cell: (1.0, 1) }
}

pub const LINE: Cloud = cloud("line", 1, "cubic", 0.0);
pub const SQUARE: Cloud = cloud("square", 2, "square", 0.0);
pub const HEXAGONAL: Cloud = Cloud { cell: (1.7320508075688772, 2), ..cloud("hexagonal", 2, "hexagonal", 0.0) };
pub const JITTER_2D: Cloud = cloud("2-D 20 % jitter", 2, "square", 0.2);
pub const CUBIC: Cloud = cloud("cubic", 3, "cubic", 0.0);
pub const FCC: Cloud = Cloud { cell: (1.0, 4), ..cloud("fcc", 3, "fcc", 0.0) };
pub const JITTER_3D: Cloud = cloud("3-D 20 % jitter", 3, "cubic", 0.2);
pub const GLASS: Cloud = cloud("3-D glass", 3, "", 0.0);

/// Where the glass lies in the source of this program.
const GLASS_FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/glass_24.vtu");

impl Cloud {
    /// Some `n` particles per side. A glass has as many as it has.
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
        let particles = match self.lattice {
            "" => format!("file = {GLASS_FILE:?}"),
            name => format!("lattice = \"{name}\"\nn = {cells}\njitter = {:?}", self.jitter),
        };
        // A file brings no masses of its own.
        let m = if self.lattice.is_empty() { format!("m = {:?}\n", 1.0 / 13824.0) } else { String::new() };
        let text = format!(
            "words = \"heat dim={dim} {words}\"\n[box]\nlo = {:?}\nhi = {hi:?}\nperiodic = true\n[particles]\n\
             {particles}\n[set]\nkappa = 1\nrho = 1\n{m}[time]\nend = {:?}\nsteps = 1\n[exact]\nname = \"sine\"\n\
             waves = {waves:?}\n",
            vec![0.0; dim],
            1.0 / rate
        );
        Scene::parse(self.name, &text)
    }

    /// Whether its particles can be had here.
    pub fn is_here(&self) -> bool {
        !self.lattice.is_empty() || Path::new(GLASS_FILE).exists()
    }
}

/// Operators for a scalar conductivity that differ from each other there: those that only multiply a pair's weight by an
/// angle are the same as without.
pub fn isotropic() -> impl Iterator<Item = &'static Operator> {
    OPERATORS.iter().filter(|o| !matches!(o.tensor, Tensor::Angular(_)))
}

/// Each with and without what it can be normalised by: in words, and what it is called.
pub fn variants() -> Vec<(String, String)> {
    let of = |(name, normalise): (&str, &str)| {
        (format!("operator={name} normalise={normalise}"), format!("{name} {normalise}"))
    };
    let pairs = isotropic().flat_map(|o| match (o.normalise, o.tensor) {
        (true, Tensor::Scalar) => vec![(o.name, "none"), (o.name, "pair")],
        (true, _) => vec![(o.name, "pair")],
        (false, _) => vec![(o.name, "none")],
    });
    pairs.map(of).collect()
}

/// Whether an operator does not go with these particles or words, rather than something being wrong.
pub fn refused(error: &Error) -> bool {
    matches!(
        error,
        Error::BadElement { .. }
            | Error::Growth { .. }
            | Error::NotFinite { .. }
            | Error::BadValue { .. }
            | Error::StepTooLarge { .. }
            | Error::OutOfBounds { .. }
            | Error::NotConverged { .. }
    )
}

#[cfg(test)]
mod tests {
    use super::super::setup::setup;
    use super::*;

    #[test]
    fn clouds_have_about_n_particles_per_side_in_undistorted_cells() {
        for cloud in [LINE, SQUARE, HEXAGONAL, JITTER_2D, CUBIC, FCC, JITTER_3D] {
            let (mut solver, exact) = setup(&cloud.scene(12, "threads=1").unwrap(), Path::new("")).unwrap();
            let wanted = 12f64.powi(cloud.dim as i32);
            assert!((solver.len() as f64 / wanted - 1.0).abs() < 0.4, "{} {}", cloud.name, solver.len());
            // Every neighbour of the closest packings is as far away as the next one: K is the same in x and y.
            assert!(exact.is_some() && solver.get_number("K_d2_max").unwrap() > 0.5);
        }
        assert!(GLASS.is_here() && variants().len() >= 5);
    }
}
