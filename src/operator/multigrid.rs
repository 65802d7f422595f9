//! A multigrid preconditioner for implicit steps: smoothed aggregation (Vaněk, Mandel & Brezina 1996).
//!
//! The equations of a step are S x = b with S = M + g L: capacities M, couplings L. Level 0 is the stored operator
//! itself. Each level above has one unknown for each aggregate of the level below, and L is carried over by
//! P^T L P (Galerkin). M is lumped, so that all but the diagonals and the last level's factors serve any g.

use super::aggregate::{Graph, NONE, aggregates, parts};
use super::sparse::Sparse;
use super::spectrum;
use crate::error::Result;
use crate::memory;
use crate::pool::Pool;
use nalgebra::{Cholesky, DMatrix, DVectorViewMut, Dyn};

/// A level of so many unknowns or fewer is solved directly.
const LAST: usize = 100;
/// Most levels: each has a few times fewer unknowns than the one before.
const MOST: usize = 20;
/// Longest step of Jacobi relaxation: below 1 it is stable for any matrix whose diagonal is at least half the sum of its
/// row's absolute values (Gershgorin), and the preconditioner is positive.
const LONGEST: f64 = 0.95;
/// Applications that estimate the largest eigenvalue of D⁻¹ L, on which shorter steps depend.
const POWER: usize = 6;
/// Couplings below this share of a row's strongest do not smooth interpolation: rows of later levels would be long. In
/// 3-D with 80 neighbours 0.1 takes one iteration less than 0.3, 0.5 three more; 0.1 takes 1.25 times the time to set up.
const WEAK: f64 = 0.3;

/// A preconditioner; empty until it is built.
#[derive(Default)]
pub struct Multigrid {
    g: f64,
    /// Step of the particles' relaxation.
    step: f64,
    levels: Vec<Level>,
    residual: Vec<f64>,
    last: Option<Cholesky<f64, Dyn>>,
    /// Which coupled part each unknown of the last level belongs to.
    parts: Vec<u32>,
}

/// A level above the particles.
struct Level {
    /// From the level below, P^T, and to it, P.
    down: Sparse,
    up: Sparse,
    /// −L. It is applied to differences, so that what is uniform stays so to the bit.
    couplings: Sparse,
    /// L times what is uniform: exchange with what is fixed and with the outside.
    excess: Vec<f64>,
    mass: Vec<f64>,
    /// The diagonal of L, or half the sum of its row's absolute values where that is more.
    diagonal: Vec<f64>,
    /// Step of relaxation, and that over diag S for the present g.
    step: f64,
    inverse: Vec<f64>,
    x: Vec<f64>,
    b: Vec<f64>,
    r: Vec<f64>,
}

/// The particles' part of the equations: S = weight (1 + g diagonal) on the diagonal.
#[derive(Clone, Copy)]
pub struct Fine<'a> {
    pub pool: &'a Pool,
    pub g: f64,
    pub diagonal: &'a [f64],
    pub weight: &'a [f64],
}

impl Graph for Sparse {
    fn points(&self) -> usize {
        self.rows()
    }

    #[inline]
    fn visit(&self, i: usize, mut f: impl FnMut(usize, f64)) {
        self.row(i).filter(|(j, _)| *j as usize != i).for_each(|(j, c)| f(j as usize, c));
    }
}

impl Multigrid {
    pub fn is_empty(&self) -> bool {
        self.residual.is_empty()
    }

    pub fn bytes(&self) -> u64 {
        let factors = self.last.as_ref().map_or(0, |f| size_of_val(f.l_dirty().as_slice()) as u64);
        let arrays = memory::bytes(&self.residual) + memory::bytes(&self.parts);
        self.levels.iter().map(Level::bytes).sum::<u64>() + arrays + factors
    }

    /// Builds the levels from the couplings between particles, which must not be negative.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn build(fine: Fine, graph: &impl Graph) -> Result<Multigrid> {
        let Fine { pool, diagonal, weight, .. } = fine;
        let mut levels: Vec<Level> = memory::reserved("levels", MOST)?;
        let of_particle = |i: usize| weight[i] * diagonal[i];
        let step = relaxation(pool, graph, of_particle)?;
        let mut next = Level::above(pool, graph, of_particle, weight, step)?;
        while let Some(level) = next.take() {
            levels.push(level);
            if let Some(level) = levels.last().filter(|l| l.mass.len() > LAST && levels.len() < MOST) {
                let couplings = &level.couplings;
                next = Level::above(pool, couplings, |i| -couplings.get(i, i), &level.mass, level.step)?;
            }
        }
        let residual = memory::filled("residual", graph.points(), 0.0)?;
        let parts = levels.last().map_or(Ok(Vec::new()), |l| parts(&l.couplings))?;
        Ok(Multigrid { g: f64::NAN, step, levels, residual, last: None, parts })
    }

    /// Makes what depends on g.
    pub fn set(&mut self, g: f64) {
        if self.g == g {
            return;
        }
        for level in &mut self.levels {
            let diagonal = level.mass.iter().zip(&level.diagonal);
            let step = |d: f64| damped(level.step, d);
            level.inverse.iter_mut().zip(diagonal).for_each(|(inverse, (m, d))| *inverse = step(*d) / (m + g * d));
        }
        self.last = self.levels.last().filter(|l| l.mass.len() <= LAST).and_then(|l| l.factors(g));
        self.g = g;
    }

    /// Sets x to the mean of y over each coupled part, less y; to 0 where nothing is coupled or nothing moves.
    pub fn flatten(&mut self, fine: Fine, y: &[f64], x: &mut [f64]) {
        let Fine { pool, weight, .. } = fine;
        let residual = &mut self.residual;
        set_each(pool, residual, |i, _| weight[i] * y[i]);
        let mut below = &residual[..];
        for level in &mut self.levels {
            set_each(pool, &mut level.b, |i, _| level.down.times(i, below));
            below = &level.b;
        }
        let Some(last) = self.levels.last_mut() else { return x.fill(0.0) };
        last.level_out(&self.parts);
        for k in (1..self.levels.len()).rev() {
            let (below, above) = self.levels.split_at_mut(k);
            set_each(pool, &mut below[k - 1].x, |i, _| above[0].up.times(i, &above[0].x));
        }
        let first = &self.levels[0];
        set_each(pool, x, |i, _| if first.up.is_empty(i) { 0.0 } else { first.up.times(i, &first.x) - y[i] });
    }

    /// z ≈ (I − g A)⁻¹ r by one V-cycle; `apply` sets its second argument to A times its first.
    ///
    /// # Errors
    /// Those of `apply`.
    pub fn cycle(
        &mut self,
        fine: Fine,
        r: &[f64],
        z: &mut [f64],
        mut apply: impl FnMut(&[f64], &mut [f64]) -> Result<()>,
    ) -> Result<()> {
        let Fine { pool, g, diagonal, weight } = fine;
        let (residual, step) = (&mut self.residual, self.step);
        let relaxed = |i: usize, r: f64| damped(step, diagonal[i]) * r / (1.0 + g * diagonal[i]);
        set_each(pool, z, |i, _| relaxed(i, r[i]));
        apply(z, residual)?;
        let Some((first, above)) = self.levels.split_first_mut() else { return Ok(()) };
        set_each(pool, residual, |i, a| weight[i] * (r[i] - (z[i] - g * a)));
        set_each(pool, &mut first.b, |i, _| first.down.times(i, residual));
        first.cycle(pool, g, above, self.last.as_ref());
        set_each(pool, z, |i, z| z + first.up.times(i, &first.x));
        apply(z, residual)?;
        set_each(pool, z, |i, z| z + relaxed(i, r[i] - (z - g * residual[i])));
        Ok(())
    }
}

impl Level {
    /// The level above points with these couplings, diagonal of L and capacities; none where it would have no unknowns,
    /// or not much fewer.
    fn above(
        pool: &Pool,
        graph: &impl Graph,
        diagonal: impl Fn(usize) -> f64 + Sync + Send,
        mass: &[f64],
        step: f64,
    ) -> Result<Option<Level>> {
        let n = graph.points();
        let aggregates = aggregates(pool, graph, |i| mass[i] > 0.0)?;
        let count = aggregates.count;
        if count == 0 || 2 * count > n {
            return Ok(None);
        }
        let up = Sparse::gather(pool, n, count, |i, gather| interpolate(graph, &aggregates.of, step, i, gather))?;
        let down = up.transposed()?;
        let carried = Sparse::gather(pool, n, count, |i, gather| {
            if aggregates.of[i] != NONE {
                up.row(i).for_each(|(j, p)| gather.add(j, -diagonal(i) * p));
                graph.visit(i, |k, c| up.row(k).for_each(|(j, p)| gather.add(j, c * p)));
            }
        })?;
        let couplings = down.product(pool, &carried)?;
        let array = || memory::filled("a coarse level", count, 0.0);
        let (mut coarse_mass, mut excess, mut diagonal) = (array()?, array()?, array()?);
        set_each(pool, &mut coarse_mass, |i, _| down.times(i, mass));
        set_each(pool, &mut excess, |i, _| -couplings.row(i).map(|(_, c)| c).sum::<f64>());
        let half = |i: usize| 0.5 * couplings.row(i).map(|(_, c)| c.abs()).sum::<f64>();
        set_each(pool, &mut diagonal, |i, _| half(i).max(-couplings.get(i, i)));
        let (inverse, x, b, r) = (array()?, array()?, array()?, array()?);
        let step = relaxation(pool, &couplings, |i| diagonal[i])?;
        Ok(Some(Level { down, up, couplings, excess, mass: coarse_mass, diagonal, step, inverse, x, b, r }))
    }

    fn bytes(&self) -> u64 {
        let Level { down, up, couplings, excess, mass, diagonal, inverse, x, b, r, .. } = self;
        let arrays = [excess, mass, diagonal, inverse, x, b, r].into_iter().map(memory::bytes).sum::<u64>();
        down.bytes() + up.bytes() + couplings.bytes() + arrays
    }

    /// x = Σ b / Σ mass over each part.
    fn level_out(&mut self, parts: &[u32]) {
        let (x, r) = (&mut self.x, &mut self.r);
        x.fill(0.0);
        r.fill(0.0);
        for (i, &part) in parts.iter().enumerate() {
            x[part as usize] += self.b[i];
            r[part as usize] += self.mass[i];
        }
        r.iter_mut().zip(x.iter()).for_each(|(r, x)| *r = x / *r);
        x.iter_mut().zip(parts).for_each(|(x, &part)| *x = r[part as usize]);
    }

    fn factors(&self, g: f64) -> Option<Cholesky<f64, Dyn>> {
        let n = self.mass.len();
        let mut s = DMatrix::zeros(n, n);
        for i in 0..n {
            self.couplings.row(i).for_each(|(j, c)| s[(i, j as usize)] = -g * c);
            s[(i, i)] += self.mass[i];
        }
        Cholesky::new(s)
    }

    /// x ≈ S⁻¹ b.
    fn cycle(&mut self, pool: &Pool, g: f64, above: &mut [Level], last: Option<&Cholesky<f64, Dyn>>) {
        let Level { couplings, excess, mass, inverse, x, b, r, .. } = self;
        if let (Some(factors), true) = (last, above.is_empty()) {
            x.copy_from_slice(b);
            return factors.solve_mut(&mut DVectorViewMut::from_slice(x, mass.len()));
        }
        let residual =
            |x: &[f64], i: usize| b[i] - ((mass[i] + g * excess[i]) * x[i] - g * couplings.differences(i, x, x[i]));
        set_each(pool, x, |i, _| inverse[i] * b[i]);
        if let Some((next, above)) = above.split_first_mut() {
            set_each(pool, r, |i, _| residual(x, i));
            set_each(pool, &mut next.b, |i, _| next.down.times(i, r));
            next.cycle(pool, g, above, last);
            set_each(pool, x, |i, x| x + next.up.times(i, &next.x));
        }
        set_each(pool, r, |i, _| residual(x, i));
        set_each(pool, x, |i, x| x + inverse[i] * r[i]);
    }
}

/// The step of Jacobi relaxation that damps the upper two thirds of the spectrum of D⁻¹ L best, D being this diagonal
/// of L.
fn relaxation(pool: &Pool, graph: &impl Graph, diagonal: impl Fn(usize) -> f64) -> Result<f64> {
    let diagonal = memory::collected("a diagonal", (0..graph.points()).map(diagonal))?;
    let largest = spectrum::estimate(pool, &diagonal, POWER, |x, y| {
        set_each(pool, y, |i, _| if diagonal[i] > 0.0 { x[i] - average(graph, i, x, diagonal[i]) } else { 0.0 });
        Ok(())
    })?;
    Ok(if largest > 0.0 { LONGEST.min(4.0 / (3.0 * largest)) } else { LONGEST })
}

/// Σ_j c_ij x_j / diagonal.
fn average(graph: &impl Graph, i: usize, x: &[f64], diagonal: f64) -> f64 {
    let mut sum = 0.0;
    graph.visit(i, |j, c| sum += c * x[j]);
    sum / diagonal
}

/// The step of a point with this diagonal; where nothing is coupled the diagonal is the equation.
fn damped(step: f64, diagonal: f64) -> f64 {
    if diagonal > 0.0 { step } else { 1.0 }
}

/// Point i takes its aggregate's value and, as one step of relaxation would, its neighbours' by their couplings: a
/// convex combination, so that what is uniform stays so.
fn interpolate(graph: &impl Graph, of: &[u32], step: f64, i: usize, gather: &mut super::sparse::Gather) {
    if of[i] == NONE {
        return;
    }
    let (mut strongest, mut sum) = (0.0f64, 0.0);
    let moves = |j: usize| of[j] != NONE;
    graph.visit(i, |j, c| strongest = if moves(j) { strongest.max(c) } else { strongest });
    let carries = |j: usize, c: f64| moves(j) && c >= WEAK * strongest;
    graph.visit(i, |j, c| sum += if carries(j, c) { c } else { 0.0 });
    gather.add(of[i], 1.0 - step);
    graph.visit(i, |j, c| {
        if carries(j, c) {
            gather.add(of[j], step * c / sum);
        }
    });
}

/// Sets each value to what `f` makes of its place and of what it was.
fn set_each(pool: &Pool, values: &mut [f64], f: impl Fn(usize, f64) -> f64 + Sync + Send) {
    pool.update(values, |start, part| {
        part.iter_mut().enumerate().for_each(|(k, value)| *value = f(start + k, *value));
    });
}
