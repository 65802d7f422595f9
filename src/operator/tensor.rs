//! Symmetric tensors of a particle: the directions in which it conducts.

use crate::space::{Axes, Row};
use crate::sum;
use nalgebra::Matrix3;

/// xx, yy, zz, xy, yz, xz: the order in which VTK keeps symmetric tensors. Axes that a space lacks are 0.
pub type Sym = [f64; 6];

/// The axes of its components.
pub const AXES: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [0, 1], [1, 2], [0, 2]];

/// The tensor of an isotropic particle.
pub fn unit(dim: usize) -> Sym {
    std::array::from_fn(|k| f64::from(k < dim))
}

/// The component of row k and column l.
pub fn component(s: &Sym, k: usize, l: usize) -> f64 {
    s[[[0, 3, 5], [3, 1, 4], [5, 4, 2]][k][l]]
}

pub fn matrix(s: &Sym) -> Matrix3<f64> {
    Matrix3::from_fn(|k, l| component(s, k, l))
}

pub fn of_matrix(m: &Matrix3<f64>) -> Sym {
    AXES.map(|[k, l]| m[(k, l)])
}

/// Σ weight d dᵀ
pub fn second(row: &Row, dim: usize, weight: &[f64]) -> Matrix3<f64> {
    let mut second = Matrix3::zeros();
    for [k, l] in AXES.into_iter().filter(|[_, l]| *l < dim) {
        let sum = sum::product(weight, row.d[k], row.d[l]);
        (second[(k, l)], second[(l, k)]) = (sum, sum);
    }
    second
}

/// s v
pub fn times(s: &Sym, v: Axes<f64>) -> Axes<f64> {
    [
        s[0] * v[0] + s[3] * v[1] + s[5] * v[2],
        s[3] * v[0] + s[1] * v[1] + s[4] * v[2],
        s[5] * v[0] + s[4] * v[1] + s[2] * v[2],
    ]
}

pub fn dot(a: Axes<f64>, b: Axes<f64>) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// v·s v
pub fn along(s: &Sym, v: Axes<f64>) -> f64 {
    dot(v, times(s, v))
}

pub fn trace(s: &Sym) -> f64 {
    s[0] + s[1] + s[2]
}

/// The smallest eigenvalue in `dim` dimensions.
pub fn smallest(s: &Sym, dim: usize) -> f64 {
    // Axes that the space lacks are filled with a value that is never the smallest.
    let fill = |k: usize| if k < dim { s[k] } else { f64::MAX.sqrt().min(trace(s).abs()) };
    let m = Matrix3::new(fill(0), s[3], s[5], s[3], fill(1), s[4], s[5], s[4], fill(2));
    m.symmetric_eigenvalues().min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_direction_has_the_eigenvalues_it_was_made_of() {
        let b = [0.6, 0.8, 0.0];
        // 3 along b, 0.5 across.
        let s: Sym = [0.5 + 2.5 * 0.36, 0.5 + 2.5 * 0.64, 0.0, 2.5 * 0.48, 0.0, 0.0];
        assert!((along(&s, b) - 3.0).abs() < 1e-15 && (smallest(&s, 2) - 0.5).abs() < 1e-15);
        assert!((along(&s, [-0.8, 0.6, 0.0]) - 0.5).abs() < 1e-15);
        assert_eq!(smallest(&unit(1), 1), 1.0);
        assert_eq!(trace(&unit(3)), 3.0);
    }
}
