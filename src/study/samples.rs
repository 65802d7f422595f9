//! A computed field as a function of place.

use crate::error::Result;
use crate::solver::Solver;
use nalgebra::{DMatrix, DVector};
use std::collections::HashMap;

/// How far the fit around a place looks, in spacings: some 5, 15 and 45 particles in 1, 2 and 3 dimensions for the 3, 6
/// and 10 unknowns.
const REACH: f64 = 2.2;

/// T between particles: a quadratic fitted to those around, the nearer the closer. Third order where T is smooth.
pub struct Field {
    dim: usize,
    x: Vec<f64>,
    t: Vec<f64>,
    /// Particles by cells of this edge, some one in each.
    cells: HashMap<[i64; 3], Vec<usize>>,
    edge: f64,
}

impl Field {
    /// # Errors
    /// As [`Solver::get`].
    pub fn new(solver: &mut Solver) -> Result<Field> {
        let (dim, x, t) = (solver.dim(), solver.get_all("x")?, solver.get_all("T")?);
        let (m, rho) = (solver.get_all("m")?, solver.get_all("rho")?);
        let volume: f64 = m.iter().zip(rho).map(|(m, rho)| m / rho).sum();
        let edge = (volume / t.len().max(1) as f64).powf(1.0 / dim as f64);
        let mut cells: HashMap<_, Vec<usize>> = HashMap::new();
        x.chunks(dim).enumerate().for_each(|(i, p)| cells.entry(cell(p, edge)).or_default().push(i));
        Ok(Field { dim, x, t, cells, edge })
    }

    pub fn at(&self, place: [f64; 3]) -> f64 {
        let near: Vec<(Vec<f64>, f64)> = self.around(place).map(|i| (self.from(place, i), self.t[i])).collect();
        let nearest = || (0..self.t.len()).map(|i| (norm(&self.from(place, i)), i)).min_by(|a, b| a.0.total_cmp(&b.0));
        // Too few around, as far outside: what is nearest.
        fit(&near, self.dim).or_else(|| nearest().map(|(_, i)| self.t[i])).unwrap_or(0.0)
    }

    /// From a place to a particle, in units of the reach.
    fn from(&self, place: [f64; 3], i: usize) -> Vec<f64> {
        self.x[i * self.dim..][..self.dim].iter().zip(place).map(|(x, p)| (x - p) / (REACH * self.edge)).collect()
    }

    fn around(&self, place: [f64; 3]) -> impl Iterator<Item = usize> {
        let [a, b, c] = cell(&place[..self.dim], self.edge);
        let steps = |axis: usize| if axis < self.dim { -3..=3 } else { 0..=0 };
        let offsets =
            steps(2).flat_map(move |k| steps(1).flat_map(move |j| steps(0).map(move |i| [a + i, b + j, c + k])));
        let inside = move |i: &usize| norm(&self.from(place, *i)) < 1.0;
        offsets.filter_map(|cell| self.cells.get(&cell)).flatten().copied().filter(inside)
    }
}

fn cell(place: &[f64], edge: f64) -> [i64; 3] {
    let mut cell = [0; 3];
    cell.iter_mut().zip(place).for_each(|(c, x)| *c = (x / edge).floor() as i64);
    cell
}

fn norm(d: &[f64]) -> f64 {
    d.iter().map(|d| d * d).sum::<f64>().sqrt()
}

/// The value at 0 of the quadratic nearest to values at places within distance 1; none where these do not determine it.
fn fit(near: &[(Vec<f64>, f64)], dim: usize) -> Option<f64> {
    let unknowns = (dim + 1) * (dim + 2) / 2;
    let (mut normal, mut right) = (DMatrix::zeros(unknowns, unknowns), DVector::zeros(unknowns));
    for (d, t) in near {
        let squares = (0..dim).flat_map(|a| (a..dim).map(move |b| d[a] * d[b]));
        let p = DVector::from_iterator(unknowns, std::iter::once(1.0).chain(d.iter().copied()).chain(squares));
        let weight = (1.0 - norm(d)).powi(2);
        normal.ger(weight, &p, &p, 1.0);
        right.axpy(weight * t, &p, 1.0);
    }
    normal.cholesky().map(|factors| factors.solve(&right)[0])
}

#[cfg(test)]
mod tests {
    use super::super::mode::JITTER_2D;
    use super::super::setup::setup;
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn a_field_is_known_between_its_particles_to_third_order() {
        let worst = |n: usize| {
            let (mut solver, _) = setup(&JITTER_2D.scene(n, "").unwrap(), std::path::Path::new("")).unwrap();
            let field = Field::new(&mut solver).unwrap();
            let exact = |x: f64, y: f64| (2.0 * PI * x).sin() * (2.0 * PI * y).sin();
            let places = (0..50).map(|i| [0.2 + 0.012 * f64::from(i), 0.81 - 0.01 * f64::from(i)]);
            assert!(field.at([-5.0, 0.0, 0.0]).is_finite());
            places.map(|[x, y]| (field.at([x, y, 0.0]) - exact(x, y)).abs()).fold(0.0, f64::max)
        };
        let (coarse, fine) = (worst(20), worst(40));
        // Of 8 for third order, what disorder leaves.
        assert!(fine < 3e-3 && coarse / fine > 5.0, "{coarse:e} {fine:e}");
    }
}
