//! The particles' positions in internal order, and the way back to the host's order.

use super::{Axes, Domain, OTHER_UNITS, lengths, morton, rule_of_lengths};
use crate::array::Strided;
use crate::error::{Error, Result};
use crate::memory;
use crate::pool::{BLOCK, Pool};
use std::cmp::Ordering;

/// Each cell is cut this many times per axis (in powers of two) for the order inside it.
const CUTS: i32 = 2;

/// A reach is rounded up to one of so many in a doubling: the order of the particles then depends on where they are and
/// how far the search goes, and not on which search came before.
const REACHES: f64 = 16.0;

/// Cells that are longer by this than the search needs, in 3-D, hold 512 times as many particles.
const COARSE: f64 = 0.125;

/// Positions sorted along a Morton curve. Ties are broken by coordinates, then by host index; who has data of the
/// particles breaks them by those first: [`Cloud::reorder`].
#[derive(Debug, Clone)]
pub struct Cloud {
    pub domain: Domain,
    /// Coordinates by axis, inside the box on periodic axes; axes beyond `dim` are empty.
    pub x: Axes<Vec<f64>>,
    /// `host[i]` is the host's index of internal particle i.
    pub host: Vec<u32>,
    /// The Morton key of each particle's finest cell.
    pub keys: Vec<u64>,
    pub grid: Grid,
    /// The rounded reach that the grid was made for.
    reach: f64,
    /// Some particles are in one place: neighbours in this order with the same coordinates.
    pub shared: bool,
}

/// The finest cells of the Morton curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    pub dim: usize,
    pub lo: Axes<f64>,
    pub edge: f64,
    /// Where cells as fine as the search needs would not fit a key: the parts of each axis on which particles are, so that
    /// one particle far away does not put all others into one cell.
    stretches: Axes<Vec<Stretch>>,
}

/// A part of an axis, up to the next one: where it begins, and the coordinate of its first cell.
#[derive(Debug, Clone, PartialEq)]
struct Stretch {
    from: f64,
    cell: u64,
}

impl Grid {
    /// Cells so that `reach` is a whole number of them. Where the extent would not fit a key, empty parts of the axes are
    /// left out (`sorted` has the coordinates on an axis, in order), and cells are no coarser than what is left needs.
    fn new(
        domain: &Domain,
        (lo, hi): (Axes<f64>, Axes<f64>),
        reach: f64,
        sorted: impl Fn(usize) -> Result<Vec<f64>>,
    ) -> Result<Grid> {
        let dim = domain.dim;
        let extent = (0..dim).map(|a| hi[a] - lo[a]).fold(0.0, f64::max);
        let fine = reach * 0.5f64.powi(CUTS);
        let room = 2f64.powi(morton::bits(dim) as i32 - 1);
        let mut grid = Grid { dim, lo, edge: fine, stretches: Default::default() };
        if fine.is_nan() || fine <= extent / room {
            let doublings = if fine > 0.0 { (extent / room / fine).log2().ceil() } else { f64::INFINITY };
            if doublings < 1000.0 {
                grid.leave_gaps_out(doublings as i32, |axis| if axis < dim { sorted(axis) } else { Ok(Vec::new()) })?;
            } else {
                grid.edge = extent / room;
            }
        }
        grid.edge = grid.edge.max(f64::MIN_POSITIVE);
        Ok(grid)
    }

    /// The least number of doublings of the edge, up to one that is enough for the whole extent, for which the stretches
    /// fit a key.
    fn leave_gaps_out(&mut self, enough: i32, sorted: impl Fn(usize) -> Result<Vec<f64>>) -> Result<()> {
        let (fine, last) = (self.edge, last_cell(self.dim));
        let axes = [sorted(0)?, sorted(1)?, sorted(2)?];
        let fits = |doublings: i32| {
            axes.iter().all(|x| stretch(x, fine * 2f64.powi(doublings), |_| Ok(())).is_ok_and(|end| end <= last))
        };
        let (mut low, mut high) = (0, enough);
        while low < high {
            let middle = (low + high) / 2;
            if fits(middle) { high = middle } else { low = middle + 1 }
        }
        self.edge = fine * 2f64.powi(high);
        if high < enough {
            for (list, x) in self.stretches.iter_mut().zip(&axes) {
                stretch(x, self.edge, |s| memory::pushed("the search's grid", list, s))?;
            }
        }
        Ok(())
    }

    /// The fine cell coordinate of a position on an axis: a monotone function, clamped to the grid.
    pub fn coordinate(&self, axis: usize, x: f64) -> u64 {
        let (stretches, mut from, mut cell, mut end) = (&self.stretches[axis], self.lo[axis], 0, last_cell(self.dim));
        if !stretches.is_empty() {
            let next = stretches.partition_point(|s| s.from <= x);
            let Some(own) = next.checked_sub(1).map(|k| &stretches[k]) else { return 0 };
            (from, cell) = (own.from, own.cell);
            end = stretches.get(next).map_or(end, |s| s.cell - 1);
        }
        (((x - from) / self.edge) as u64).saturating_add(cell).min(end)
    }

    /// The Morton key of the fine cell of a position.
    pub fn key(&self, x: Axes<f64>) -> u64 {
        let mut cell = [0; 3];
        for (axis, c) in cell.iter_mut().enumerate().take(self.dim) {
            *c = self.coordinate(axis, x[axis]);
        }
        morton::key(self.dim, cell)
    }
}

fn last_cell(dim: usize) -> u64 {
    (1u64 << morton::bits(dim)) - 1
}

/// Cuts an axis with these coordinates, in order, where nothing is for twice a reach; answers how many cells are left, a
/// reach beyond each stretch included.
fn stretch(x: &[f64], edge: f64, mut found: impl FnMut(Stretch) -> Result<()>) -> Result<u64> {
    let reach = 1u64 << CUTS;
    let wide = |a: f64, b: f64| b - a > 2.0 * reach as f64 * edge;
    let mut cell = 0u64;
    for part in x.chunk_by(|a, b| !wide(*a, *b)) {
        let (from, to) = (part[0], part[part.len() - 1]);
        found(Stretch { from, cell })?;
        cell = cell.saturating_add(((to - from) / edge) as u64).saturating_add(1 + reach);
    }
    Ok(cell)
}

impl Cloud {
    /// Sorts the host's positions. `reach` is the shortest distance (the support radius of the smallest particle) that
    /// a search will ask for; 0 where it is not known yet.
    ///
    /// # Errors
    /// `BadElement` for a coordinate that is not finite; `BadValue` for more than 2³² − 1 particles, or where they fill no
    /// length of [`lengths`]; `NoMemory`.
    pub fn sort(domain: &Domain, x: Strided, reach: f64, pool: &Pool) -> Result<Cloud> {
        if x.len() >= u32::MAX as usize {
            return Err(Error::bad("n", x.len(), "at most 2^32 - 2 particles per solver"));
        }
        x.check("x", "coordinates must be finite", f64::is_finite)?;
        let reach = rounded(reach);
        let (lo, hi) = bounds(domain, x);
        let widest = (0..domain.dim).map(|a| hi[a] - lo[a]).fold(0.0, f64::max);
        if widest > 0.0 && !lengths(domain.dim).contains(&widest) {
            return Err(Error::bad("x", format!("spread over {widest:e}"), &rule_of_lengths(domain.dim, OTHER_UNITS)));
        }
        let grid = Grid::new(domain, (lo, hi), reach, |axis| {
            let wrapped = (0..x.len()).map(|i| domain.wrap(axis, x.at(i, axis)));
            let mut sorted = memory::collected("coordinates", wrapped)?;
            sorted.sort_unstable_by(f64::total_cmp);
            Ok(sorted)
        })?;
        let position = |i: usize| {
            let mut p = [0.0; 3];
            for (axis, value) in p.iter_mut().enumerate().take(domain.dim) {
                *value = domain.wrap(axis, x.at(i, axis));
            }
            p
        };
        let mut order = memory::filled("Morton keys", x.len(), (0u64, 0u32))?;
        pool.make(&mut order, |start, part| {
            for (k, item) in part.iter_mut().enumerate() {
                *item = (grid.key(position(start + k)), (start + k) as u32);
            }
        })?;
        let compare = |a: &(u64, u32), b: &(u64, u32)| {
            a.0.cmp(&b.0).then_with(|| {
                let (p, q) = (position(a.1 as usize), position(b.1 as usize));
                let by_axis = (0..3).map(|k| p[k].total_cmp(&q[k])).find(|c| c.is_ne());
                by_axis.unwrap_or(a.1.cmp(&b.1))
            })
        };
        pool.sort(&mut order, compare)?;
        let host = memory::collected("order", order.iter().map(|item| item.1))?;
        let keys = memory::collected("keys", order.iter().map(|item| item.0))?;
        let mut axes = [const { Vec::new() }; 3];
        for (axis, values) in axes.iter_mut().enumerate().take(domain.dim) {
            *values = memory::filled("positions", host.len(), 0.0)?;
            pool.chunks(values, BLOCK, |start, part| {
                for (k, value) in part.iter_mut().enumerate() {
                    *value = domain.wrap(axis, x.at(host[start + k] as usize, axis));
                }
            });
        }
        let mut cloud = Cloud { domain: domain.clone(), x: axes, host, keys, grid, reach, shared: false };
        cloud.shared = crate::sum::first(pool, cloud.len(), |i| i > 0 && cloud.in_one_place(i - 1, i)).is_some();
        Ok(cloud)
    }

    /// Whether its cells are those that a sort for this reach makes.
    pub fn suits(&self, reach: f64) -> bool {
        let reach = rounded(reach);
        self.reach == reach || (self.reach.is_nan() && reach.is_nan())
    }

    /// Whether cells are so much longer than this reach that all work would be in looking through them.
    pub fn is_coarse_for(&self, reach: f64) -> bool {
        reach < COARSE * self.reach
    }

    /// Whether two particles have the same coordinates to the bit.
    pub fn in_one_place(&self, i: usize, j: usize) -> bool {
        self.x[..self.dim()].iter().all(|x| x[i].to_bits() == x[j].to_bits())
    }

    /// Host indices in the order in which particles of one place follow each other by `compare`; none where they do
    /// already.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn reorder(&self, compare: impl Fn(usize, usize) -> Ordering) -> Result<Option<Vec<u32>>> {
        let tied = |i: &usize| self.in_one_place(i - 1, *i);
        if !self.shared || (1..self.len()).filter(tied).all(|i| compare(i - 1, i).is_le()) {
            return Ok(None);
        }
        let mut order = memory::collected("order", 0..self.len())?;
        let mut start = 0;
        for end in 1..=self.len() {
            if end == self.len() || !self.in_one_place(end - 1, end) {
                order[start..end].sort_unstable_by(|&i, &j| compare(i, j).then(self.host[i].cmp(&self.host[j])));
                start = end;
            }
        }
        memory::collected("order", order.into_iter().map(|i| self.host[i])).map(Some)
    }

    pub fn len(&self) -> usize {
        self.host.len()
    }

    pub fn is_empty(&self) -> bool {
        self.host.is_empty()
    }

    pub fn dim(&self) -> usize {
        self.domain.dim
    }

    pub fn position(&self, i: usize) -> Axes<f64> {
        let mut p = [0.0; 3];
        for (value, axis) in p.iter_mut().zip(&self.x).take(self.dim()) {
            *value = axis[i];
        }
        p
    }

    /// Whether the host's positions are the ones held here, bit for bit after wrapping.
    pub fn is_at(&self, x: Strided, pool: &Pool) -> bool {
        let moved =
            |i: usize| (0..self.dim()).any(|a| self.x[a][i] != self.domain.wrap(a, x.at(self.host[i] as usize, a)));
        x.len() == self.len() && crate::sum::first(pool, self.len(), moved).is_none()
    }

    /// Host values in internal order.
    pub fn inward(&self, what: &str, values: Strided, component: usize) -> Result<Vec<f64>> {
        memory::collected(what, self.host.iter().map(|&h| values.at(h as usize, component)))
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        self.x.iter().map(memory::bytes).sum::<u64>() + memory::bytes(&self.host) + memory::bytes(&self.keys)
    }
}

fn rounded(reach: f64) -> f64 {
    if reach > 0.0 && reach.is_finite() { ((reach.log2() * REACHES).ceil() / REACHES).exp2() } else { reach }
}

fn bounds(domain: &Domain, x: Strided) -> (Axes<f64>, Axes<f64>) {
    let (mut lo, mut hi) = ([0.0; 3], [0.0; 3]);
    for axis in 0..domain.dim {
        (lo[axis], hi[axis]) = if domain.periodic[axis] {
            (domain.lo[axis], domain.hi[axis])
        } else {
            let start = (f64::INFINITY, f64::NEG_INFINITY);
            (0..x.len()).map(|i| x.at(i, axis)).fold(start, |(lo, hi), v| (lo.min(v), hi.max(v)))
        };
    }
    (lo, hi)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scattered(n: usize, dim: usize) -> Vec<f64> {
        let mut state = 7u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..n * dim).map(|_| next()).collect()
    }

    #[test]
    fn order_is_a_permutation_and_forgets_the_hosts_order() {
        let (pool, domain) = (Pool::new(2).unwrap(), Domain::open(3));
        let x = scattered(2000, 3);
        let reversed: Vec<f64> = x.chunks(3).rev().flatten().copied().collect();
        let sort = |v: &[f64]| Cloud::sort(&domain, Strided::new("x", v, 2000, 3, 3).unwrap(), 0.1, &pool).unwrap();
        let (a, b) = (sort(&x), sort(&reversed));
        assert_eq!(a.x, b.x);
        let mut seen = a.host.clone();
        seen.sort_unstable();
        assert!(seen.iter().enumerate().all(|(i, &h)| i == h as usize));
        assert!(a.is_at(Strided::new("x", &x, 2000, 3, 3).unwrap(), &pool));
        assert!(!a.is_at(Strided::new("x", &reversed, 2000, 3, 3).unwrap(), &pool));
    }

    #[test]
    fn the_grid_forgets_how_a_reach_was_guessed() {
        let (pool, x) = (Pool::new(1).unwrap(), scattered(100, 2));
        let sort =
            |reach| Cloud::sort(&Domain::open(2), Strided::new("x", &x, 100, 2, 2).unwrap(), reach, &pool).unwrap();
        let cloud = sort(0.1);
        assert!(cloud.suits(0.1) && cloud.suits(0.1001) && !cloud.suits(0.11) && !cloud.suits(0.0));
        assert!(cloud.grid == sort(0.1001).grid && cloud.grid != sort(0.11).grid);
        // Cells are not shorter than the reach, and hardly longer.
        assert!((0.1..0.105).contains(&(4.0 * cloud.grid.edge)), "{}", cloud.grid.edge);
    }

    #[test]
    fn particles_of_one_place_are_ordered_by_what_is_said() {
        let (pool, x) = (Pool::new(1).unwrap(), [0.5, 0.1, 0.5, 0.5, 0.9]);
        let cloud = Cloud::sort(&Domain::open(1), Strided::packed(&x), 0.1, &pool).unwrap();
        assert!(cloud.shared && cloud.host == [1, 0, 2, 3, 4]);
        let data: [f64; 5] = [3.0, 0.0, 1.0, 2.0, 0.0];
        let by_data = |i: usize, j: usize| data[cloud.host[i] as usize].total_cmp(&data[cloud.host[j] as usize]);
        assert_eq!(cloud.reorder(by_data).unwrap().unwrap(), [1, 2, 3, 0, 4]);
        assert_eq!(cloud.reorder(|i, j| i.cmp(&j)).unwrap(), None);
        assert!(!Cloud::sort(&Domain::open(1), Strided::packed(&[0.0, -0.0]), 0.1, &pool).unwrap().shared);
    }

    #[test]
    fn empty_space_takes_no_cells() {
        let pool = Pool::new(1).unwrap();
        for dim in 1..=3 {
            for far in [1e4, 1e9, 1e15, 0.4 * lengths(dim).end()] {
                let mut x = scattered(500, dim);
                x.extend([far, -far].map(|far| vec![far; dim]).concat());
                let n = x.len() / dim;
                let reach = 0.5 * 500f64.powf(-1.0 / dim as f64);
                let cloud =
                    Cloud::sort(&Domain::open(dim), Strided::new("x", &x, n, dim, dim).unwrap(), reach, &pool).unwrap();
                // Cells as fine as where nothing is far away, and coordinates that never fall.
                assert!(cloud.grid.edge <= 0.3 * reach, "{dim}-D {far:e} {:e}", cloud.grid.edge);
                let along: Vec<f64> =
                    (0..4000).map(|k| -1.1 + 3e-3 * f64::from(k) / 4.0).chain([0.1 * far, far, 2.0 * far]).collect();
                for axis in 0..dim {
                    let cells: Vec<u64> = along.iter().map(|&x| cloud.grid.coordinate(axis, x)).collect();
                    assert!(cells.is_sorted() && cells[4000] > cells[2000], "{dim}-D {far:e}");
                }
                let mut keys = cloud.keys.clone();
                keys.dedup();
                assert!(keys.len() > 400, "{dim}-D {far:e} {}", keys.len());
            }
        }
    }

    #[test]
    fn extreme_extents_fit_the_grid() {
        let pool = Pool::new(1).unwrap();
        for reach in [0.0, 1e-300, 1e-3, 1e300] {
            let x = [0.0, 1e8, 1e8 + 1.0, -1e-5, 5.0, 5.0];
            let cloud = Cloud::sort(&Domain::open(1), Strided::packed(&x), reach, &pool).unwrap();
            assert_eq!(cloud.len(), 6);
        }
        let e = Cloud::sort(&Domain::open(1), Strided::packed(&[0.0, f64::INFINITY]), 1.0, &pool).unwrap_err();
        assert_eq!(e.to_string(), "x[1] is inf; coordinates must be finite");
    }
}
