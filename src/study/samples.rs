//! A computed field as a function of place.

use crate::error::Result;
use crate::solver::Solver;
use std::collections::HashMap;

/// T between particles: that of the nearest one, and its gradient from there.
pub struct Field {
    dim: usize,
    x: Vec<f64>,
    t: Vec<f64>,
    gradient: Vec<f64>,
    /// Particles by cells of this edge, some one in each.
    cells: HashMap<[i64; 3], Vec<usize>>,
    edge: f64,
}

impl Field {
    /// # Errors
    /// As [`Solver::get`].
    pub fn new(solver: &mut Solver) -> Result<Field> {
        let (dim, x, t, gradient) =
            (solver.dim(), solver.get_all("x")?, solver.get_all("T")?, solver.get_all("grad_T")?);
        let (m, rho) = (solver.get_all("m")?, solver.get_all("rho")?);
        let volume: f64 = m.iter().zip(rho).map(|(m, rho)| m / rho).sum();
        let edge = (volume / t.len().max(1) as f64).powf(1.0 / dim as f64);
        let mut cells: HashMap<_, Vec<usize>> = HashMap::new();
        x.chunks(dim).enumerate().for_each(|(i, p)| cells.entry(cell(p, edge)).or_default().push(i));
        Ok(Field { dim, x, t, gradient, cells, edge })
    }

    pub fn at(&self, place: [f64; 3]) -> f64 {
        let from = |i: usize| self.x[i * self.dim..][..self.dim].iter().zip(place).map(|(x, p)| p - x);
        let distance = |i: usize| from(i).map(|d| d * d).sum::<f64>();
        let [a, b, c] = cell(&place[..self.dim], self.edge);
        // Beside the place, or anywhere where nothing is beside it.
        let beside = (0..27).filter_map(|k| self.cells.get(&[a + k % 3 - 1, b + k / 3 % 3 - 1, c + k / 9 - 1]));
        let near = beside.flatten().map(|i| (distance(*i), *i)).min_by(|a, b| a.0.total_cmp(&b.0));
        let far = || (0..self.t.len()).map(|i| (distance(i), i)).min_by(|a, b| a.0.total_cmp(&b.0));
        near.or_else(far).map_or(0.0, |(_, i)| {
            let gradient = &self.gradient[i * self.dim..][..self.dim];
            self.t[i] + gradient.iter().zip(from(i)).map(|(g, d)| g * d).sum::<f64>()
        })
    }
}

fn cell(place: &[f64], edge: f64) -> [i64; 3] {
    let mut cell = [0; 3];
    cell.iter_mut().zip(place).for_each(|(c, x)| *c = (x / edge).floor() as i64);
    cell
}

#[cfg(test)]
mod tests {
    use super::super::mode::JITTER_2D;
    use super::super::setup::setup;
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn a_field_is_known_between_its_particles_to_second_order() {
        let (mut solver, _) = setup(&JITTER_2D.scene(40, "").unwrap(), std::path::Path::new("")).unwrap();
        let field = Field::new(&mut solver).unwrap();
        for [x, y] in [[0.3, 0.21], [0.5, 0.9], [0.77, 0.4]] {
            let exact = (2.0 * PI * x).sin() * (2.0 * PI * y).sin();
            assert!((field.at([x, y, 0.0]) - exact).abs() < 2e-2, "{x} {y}");
        }
        assert!(field.at([-5.0, 0.0, 0.0]).is_finite());
    }
}
