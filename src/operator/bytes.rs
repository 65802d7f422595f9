//! What an operator takes of memory, for each pair and for each particle: a plan says it before anything is made.

use super::table::{Normalise, Operator, Sweeps};
use super::tensor::Sym;
use super::{projected, twice};

/// Bytes of a stored matrix for each pair and for each particle: a column and a coefficient; a second moment.
const MATRIX: [f64; 2] = [12.0, 8.0];

impl Operator {
    /// Bytes that all that is stored takes, for each pair and for each particle.
    pub fn bytes(&self) -> [f64; 2] {
        sum([self.bytes_of_pairs(), self.bytes_of_sweeps()])
    }

    /// The part of it that are weights of pairs.
    pub fn bytes_of_pairs(&self) -> [f64; 2] {
        MATRIX
    }

    /// The part that two sweeps take beside them.
    pub fn bytes_of_sweeps(&self) -> [f64; 2] {
        match self.sweeps {
            Sweeps::One => [0.0; 2],
            Sweeps::Two { limited: false } => twice::BYTES,
            // The limit is another matrix.
            Sweeps::Two { limited: true } => sum([twice::BYTES, MATRIX]),
        }
    }

    /// Bytes that projecting weights takes beside them while it lasts, where the operator does that.
    pub fn bytes_to_project(&self, dim: usize) -> [f64; 2] {
        let projects = self.is_projected() || self.sweeps == Sweeps::Two { limited: true };
        if projects { projected::bytes(dim) } else { [0.0; 2] }
    }
}

fn sum<const N: usize>(parts: [[f64; 2]; N]) -> [f64; 2] {
    [0, 1].map(|k| parts.iter().map(|part| part[k]).sum())
}

impl Normalise {
    /// Bytes for each particle that it takes while it lasts.
    pub fn bytes(self, dim: usize) -> f64 {
        match self {
            Normalise::No => 0.0,
            Normalise::Tensor if dim > 1 => (size_of::<Sym>() + 8 * (dim + dim * (dim + 1) / 2)) as f64,
            _ => 8.0,
        }
    }
}
