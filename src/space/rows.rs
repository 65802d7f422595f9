//! Rows of neighbours: for each particle a, every particle b (and every periodic image of it) with
//! r_ab < R max(h_a, h_b), found cell by cell and handed on as slices.
//!
//! The rule is symmetric to the bit: r_ab is computed from (x_b − x_a) + shift, whose negative is exactly
//! (x_a − x_b) − shift.

use super::cells::Cells;
use super::{Axes, Cloud, Nearest, Row, Scratch};
use crate::error::{Error, Result};
use crate::pool::{BLOCK, Pool};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A neighbour search over a cloud: cells plus the smoothing lengths they were made for.
pub struct Rows<'a> {
    pub cloud: &'a Cloud,
    pub h: &'a [f64],
    pub radius: f64,
    cells: Cells,
    cancel: Arc<AtomicBool>,
}

impl<'a> Rows<'a> {
    /// `h` in internal order, `radius` the kernel's support in units of h.
    ///
    /// # Errors
    /// `BoxTooSmall` where a support reaches too many images of a periodic box; `NoMemory`.
    pub fn new(cloud: &'a Cloud, h: &'a [f64], radius: f64, pool: &Pool) -> Result<Rows<'a>> {
        let cells = Cells::new(cloud, h, radius, pool)?;
        let extremes = [cells.h_max, h.iter().copied().fold(f64::INFINITY, f64::min)];
        for (i, h) in extremes.into_iter().filter_map(|extreme| Some((h.iter().position(|&h| h == extreme)?, extreme)))
        {
            cloud.domain.check_reach(radius * h, cloud.host[i] as usize)?;
        }
        Ok(Rows { cloud, h, radius, cells, cancel: pool.canceller() })
    }

    /// The way from a particle to its neighbours without a search; none where one may be a neighbour with two images.
    pub fn nearest<const D: usize>(&self) -> Option<Nearest<D>> {
        Nearest::new(&self.cloud.domain, self.radius * self.cells.h_max)
    }

    /// The largest smoothing length.
    pub fn largest(&self) -> f64 {
        self.cells.h_max
    }

    /// Whether all smoothing lengths are the same.
    pub fn same_h(&self) -> bool {
        self.cells.same_h
    }

    /// Calls `visit` with the row of every particle in `range`, in order.
    ///
    /// # Errors
    /// The first of `visit`'s, which ends it; `NoMemory`; `Cancelled`.
    pub fn visit(
        &self,
        range: Range<usize>,
        scratch: &mut Scratch,
        visit: impl FnMut(Row) -> Result<()>,
    ) -> Result<()> {
        self.visit_where(range, scratch, |_| true, visit)
    }

    /// As [`Rows::visit`], for the particles that are wanted alone.
    pub fn visit_where(
        &self,
        range: Range<usize>,
        scratch: &mut Scratch,
        wanted: impl Fn(usize) -> bool,
        visit: impl FnMut(Row) -> Result<()>,
    ) -> Result<()> {
        if self.cancel.load(Ordering::Relaxed) {
            return Err(Error::Cancelled);
        }
        match self.cloud.dim() {
            1 => self.visit_in::<1>(range, scratch, wanted, visit),
            2 => self.visit_in::<2>(range, scratch, wanted, visit),
            _ => self.visit_in::<3>(range, scratch, wanted, visit),
        }
    }

    /// One value per particle from its row: blocks in parallel, the same bits for any number of threads. `B` is what a
    /// worker reuses from row to row.
    pub fn map<T: Send, B: Default>(
        &self,
        pool: &Pool,
        out: &mut [T],
        f: impl Fn(&mut B, Row) -> Result<T> + Sync + Send,
    ) -> Result<()> {
        let failed = std::sync::Mutex::new(None);
        pool.chunks(out, BLOCK, |start, part| {
            let (mut buffers, range) = (B::default(), start..start + part.len());
            let done = self.visit(range, &mut Scratch::default(), |row| {
                let at = row.i - start;
                part[at] = f(&mut buffers, row)?;
                Ok(())
            });
            if let (Err(e), Ok(mut slot)) = (done, failed.lock()) {
                *slot = Some(e);
            }
        });
        failed.into_inner().ok().flatten().map_or(Ok(()), Err)
    }

    /// The mean number of neighbours, from a sample of the blocks; one block in `every` is looked at.
    pub fn mean_neighbours(&self, pool: &Pool, every: usize) -> Result<f64> {
        let blocks = self.cloud.len().div_ceil(BLOCK);
        let sampled: Vec<usize> = (0..blocks).step_by(every.max(1)).collect();
        let counts = pool.map(sampled.len(), |k| {
            // A slice of each sampled block is enough: rows of one block resemble each other.
            let start = sampled[k] * BLOCK;
            let range = start..(start + BLOCK / 8).min(self.cloud.len());
            let (mut pairs, rows) = (0u64, range.len() as u64);
            self.visit(range, &mut Scratch::default(), |row| {
                pairs += row.len() as u64;
                Ok(())
            })?;
            Ok((pairs, rows))
        });
        let (mut pairs, mut rows) = (0, 0);
        for count in counts {
            let (p, r) = count?;
            (pairs, rows) = (pairs + p, rows + r);
        }
        Ok(if rows == 0 { 0.0 } else { pairs as f64 / rows as f64 })
    }

    fn visit_in<const D: usize>(
        &self,
        range: Range<usize>,
        s: &mut Scratch,
        wanted: impl Fn(usize) -> bool,
        mut visit: impl FnMut(Row) -> Result<()>,
    ) -> Result<()> {
        let group_of = |i: usize| self.cells.group_key(self.cloud, i, self.h[i]);
        let mut start = range.start;
        while start < range.end {
            let group = group_of(start);
            let end = (start + 1..range.end).find(|&i| group_of(i) != group).unwrap_or(range.end);
            if (start..end).any(&wanted) {
                let shifted = self.gather(start..end, s)?;
                // The group is in one cell, in order.
                let first = s.place(start, end - start)?;
                for i in (start..end).filter(|&i| wanted(i)) {
                    let centre: [f64; D] = std::array::from_fn(|a| self.cloud.x[a][i]);
                    visit(s.near(i, first + (i - start), centre, self.radius * self.h[i], shifted)?)?;
                }
            }
            start = end;
        }
        Ok(())
    }

    /// Collects every particle that may be a neighbour of someone in the group; tells whether any is an image.
    fn gather(&self, group: Range<usize>, s: &mut Scratch) -> Result<bool> {
        let dim = self.cloud.dim();
        let (lo, hi) = self.extent(group.clone());
        let h_group = self.h[group].iter().copied().fold(0.0, f64::max);
        let same_h = self.cells.same_h;
        s.clear();
        let (mut shifted, mut failed) = (false, Ok(()));
        let lengths = (!same_h).then_some((self.h, self.radius));
        for level in &self.cells.levels {
            let reach = self.radius * h_group.max(level.h_max);
            let (from, to) = self.around(lo, hi, reach);
            let wraps = (0..dim).any(|a| self.cloud.domain.images(a, from[a], to[a]) != (0..=0));
            if wraps && !shifted {
                // So far no candidate was an image.
                shifted = true;
                s.add_zero_shifts()?;
            }
            self.for_images(from, to, |shift, from, to| {
                level.overlapping(self.cloud, from, to, |cell| {
                    let added = s.add(self.cloud, cell, shifted.then_some(shift), lengths);
                    if added.is_err() {
                        failed = added;
                    }
                });
            });
        }
        failed?;
        let (from, to) = self.around(lo, hi, self.radius * self.cells.h_max);
        s.settle(&self.cloud.domain, from, to)?;
        Ok(shifted)
    }

    /// The box of all that is within reach of a box, with slack for rounding of its ends: the distance test decides, and it
    /// is symmetric.
    fn around(&self, mut lo: Axes<f64>, mut hi: Axes<f64>, reach: f64) -> (Axes<f64>, Axes<f64>) {
        let pad = |x: f64| reach * (1.0 + 1e-9) + 4.0 * f64::EPSILON * x.abs();
        for a in 0..self.cloud.dim() {
            (lo[a], hi[a]) = (lo[a] - pad(lo[a]), hi[a] + pad(hi[a]));
        }
        (lo, hi)
    }

    fn extent(&self, group: Range<usize>) -> (Axes<f64>, Axes<f64>) {
        let (mut lo, mut hi) = ([0.0; 3], [0.0; 3]);
        for a in 0..self.cloud.dim() {
            let x = &self.cloud.x[a][group.clone()];
            lo[a] = x.iter().copied().fold(f64::INFINITY, f64::min);
            hi[a] = x.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        }
        (lo, hi)
    }

    /// Calls `visit(shift, from, to)` for every image of the domain that a box touches: the image's shift, and the box
    /// as seen from inside the domain.
    fn for_images(&self, from: Axes<f64>, to: Axes<f64>, mut visit: impl FnMut(Axes<f64>, Axes<f64>, Axes<f64>)) {
        let domain = &self.cloud.domain;
        let images = |a: usize| if a < domain.dim { domain.images(a, from[a], to[a]) } else { 0..=0 };
        for kz in images(2) {
            for ky in images(1) {
                for kx in images(0) {
                    let k = [kx, ky, kz];
                    let shift = [0, 1, 2].map(|a| if k[a] == 0 { 0.0 } else { k[a] as f64 * domain.length(a) });
                    visit(shift, [0, 1, 2].map(|a| from[a] - shift[a]), [0, 1, 2].map(|a| to[a] - shift[a]));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::array::Strided;
    use crate::space::Domain;

    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        }
    }

    /// Every pair and image by the definition.
    fn brute_force(cloud: &Cloud, h: &[f64], radius: f64, i: usize) -> Vec<(u32, u64)> {
        let (dim, domain) = (cloud.dim(), &cloud.domain);
        let reach = radius * h.iter().copied().fold(0.0, f64::max);
        let most = |a: usize| (reach / domain.length(a)).ceil() as i64;
        let images = |a: usize| if a < dim && domain.periodic[a] { -most(a)..=most(a) } else { 0..=0 };
        let mut found = Vec::new();
        for j in 0..cloud.len() {
            for (kx, ky, kz) in images(0).flat_map(|x| images(1).flat_map(move |y| images(2).map(move |z| (x, y, z)))) {
                let k = [kx, ky, kz];
                let (p, q) = (cloud.position(i), cloud.position(j));
                let r2: f64 = (0..dim).map(|a| (q[a] - p[a]) + k[a] as f64 * domain.length(a)).map(|d| d * d).sum();
                let reach = radius * h[i].max(h[j]);
                if r2 < reach * reach && (i != j || k != [0; 3]) {
                    found.push((j as u32, r2.sqrt().to_bits()));
                }
            }
        }
        found.sort_unstable();
        found
    }

    fn agrees_with_brute_force(dim: usize, n: usize, periodic: [bool; 3], spread: f64, h0: f64) {
        let pool = Pool::new(2).unwrap();
        let mut random = Random(dim as u64 * 31 + n as u64);
        let x: Vec<f64> = (0..n * dim).map(|_| random.next()).collect();
        let domain = Domain::new(&[0.0; 3][..dim], &[1.0; 3][..dim], &periodic[..dim]).unwrap();
        let cloud = Cloud::sort(&domain, Strided::new("x", &x, n, dim, dim).unwrap(), 2.0 * h0, &pool).unwrap();
        let h: Vec<f64> = (0..n).map(|_| h0 * spread.powf(random.next())).collect();
        rows_agree(&cloud, &h, &pool, &format!("dim {dim} n {n}"));
    }

    fn rows_agree(cloud: &Cloud, h: &[f64], pool: &Pool, what: &str) {
        let rows = Rows::new(cloud, h, 2.0, pool).unwrap();
        assert_eq!(rows.same_h(), h.iter().all(|other| *other == h[0]));
        let mut pairs = 0;
        let all = rows.visit(0..h.len(), &mut Scratch::default(), |row| {
            let mut got: Vec<(u32, u64)> = row.j.iter().zip(row.r).map(|(&j, r)| (j, r.to_bits())).collect();
            got.sort_unstable();
            assert_eq!(got, brute_force(cloud, h, 2.0, row.i), "{what} row {}", row.i);
            pairs += got.len();
            Ok(())
        });
        all.unwrap_or_else(|e| panic!("{what}: {e}"));
        assert!(pairs > 0);
    }

    /// Levels are cut by ratios of h: two populations try every ratio, in cells that were sorted for either of them. Lost
    /// neighbours came at 2.5, 2.7, 3.9 to 4.2, 7.9 and 8.6 only.
    #[test]
    fn two_populations_of_any_ratio_equal_brute_force() {
        let pool = Pool::new(1).unwrap();
        for dim in 1..=3 {
            let n = 60;
            let mut random = Random(dim as u64);
            let x: Vec<f64> = (0..n * dim).map(|_| random.next()).collect();
            let coarse: Vec<bool> = (0..n).map(|_| random.next() < 0.4).collect();
            for step in 0..=140 {
                let ratio = 64f64.powf(f64::from(step) / 140.0);
                let periodic = step % 2 == 0;
                let domain = Domain::new(&[0.0; 3][..dim], &[1.0; 3][..dim], &[periodic; 3][..dim]).unwrap();
                let largest = 0.15;
                let h: Vec<f64> = coarse.iter().map(|&c| if c { largest } else { largest / ratio }).collect();
                for reach in [2.0 * largest, 2.0 * largest / ratio, 0.0] {
                    let at = Strided::new("x", &x, n, dim, dim).unwrap();
                    let cloud = Cloud::sort(&domain, at, reach, &pool).unwrap();
                    let inward: Vec<f64> = cloud.host.iter().map(|&i| h[i as usize]).collect();
                    rows_agree(&cloud, &inward, &pool, &format!("dim {dim} ratio {ratio} reach {reach}"));
                }
            }
        }
    }

    #[test]
    fn lengths_that_are_found_have_the_neighbours_of_brute_force() {
        let pool = Pool::new(1).unwrap();
        for dim in 1..=3 {
            let kernel = crate::kernel::Kernel::new("M4", dim).unwrap();
            for ratio in [1.0, 2.5, 2.7, 4.0, 8.6, 30.0] {
                let n = 80;
                let mut random = Random(7);
                // Half of the particles in a corner, closer by this ratio.
                let place = |i: usize, v: f64| if i < n / 2 { v * 0.5 / ratio } else { v };
                let x: Vec<f64> = (0..n * dim).map(|k| place(k / dim, random.next())).collect();
                for periodic in [false, true] {
                    let domain = Domain::new(&[0.0; 3][..dim], &[1.0; 3][..dim], &[periodic; 3][..dim]).unwrap();
                    let at = Strided::new("x", &x, n, dim, dim).unwrap();
                    let cloud = Cloud::sort(&domain, at, 0.0, &pool).unwrap();
                    let guess = super::super::density::guess(&cloud, 1.0, &pool).unwrap();
                    let mass = vec![1.0; n];
                    let h = super::super::density::smoothing_lengths(&kernel, 1.0, &cloud, &mass, guess, &pool);
                    rows_agree(&cloud, &h.unwrap(), &pool, &format!("dim {dim} ratio {ratio}"));
                }
            }
        }
    }

    #[test]
    fn rows_equal_brute_force() {
        for dim in 1..=3 {
            for periodic in [[false; 3], [true; 3], [true, false, true]] {
                agrees_with_brute_force(dim, 300, periodic, 1.0, 0.08);
                agrees_with_brute_force(dim, 300, periodic, 70.0, 0.004);
            }
        }
    }

    #[test]
    fn a_box_smaller_than_the_support_uses_all_images() {
        agrees_with_brute_force(1, 5, [true; 3], 1.0, 0.7);
        agrees_with_brute_force(2, 4, [true; 3], 3.0, 0.5);
        agrees_with_brute_force(3, 2, [true; 3], 1.0, 0.9);
    }

    #[test]
    fn coincident_and_far_apart_particles() {
        let pool = Pool::new(1).unwrap();
        let x = [0.5, 0.5, 0.5 + 1e-300, 1e-300, 0.0, 1e12];
        let cloud = Cloud::sort(&Domain::open(1), Strided::packed(&x), 0.2, &pool).unwrap();
        let rows = Rows::new(&cloud, &[0.1; 6], 2.0, &pool).unwrap();
        let mut counts = [0; 6];
        rows.visit(0..6, &mut Scratch::default(), |row| {
            counts[cloud.host[row.i] as usize] = row.len();
            Ok(())
        })
        .unwrap();
        assert_eq!(counts, [2, 2, 2, 1, 1, 0]);
    }

    #[test]
    fn blocks_do_not_change_a_row() {
        let pool = Pool::new(1).unwrap();
        let mut random = Random(5);
        let x: Vec<f64> = (0..6000).map(|_| random.next()).collect();
        let domain = Domain::new(&[0.0; 2], &[1.0; 2], &[true; 2]).unwrap();
        let cloud = Cloud::sort(&domain, Strided::new("x", &x, 3000, 2, 2).unwrap(), 0.06, &pool).unwrap();
        let h = vec![0.03; 3000];
        let rows = Rows::new(&cloud, &h, 2.0, &pool).unwrap();
        let collect = |cuts: &[usize]| {
            let mut all: Vec<Vec<u32>> = Vec::new();
            for w in cuts.windows(2) {
                rows.visit(w[0]..w[1], &mut Scratch::default(), |row| {
                    all.push(row.j.to_vec());
                    Ok(())
                })
                .unwrap();
            }
            all
        };
        assert_eq!(collect(&[0, 3000]), collect(&[0, 1, 700, 701, 1500, 3000]));
    }
}
