//! Who is near enough: candidates collected from cells, and those within reach picked out, for one particle at a time.

use super::{Axes, Cloud, Domain};
use crate::error::{Error, Result};
use crate::memory;

/// The neighbours of particle `i`, itself excluded (its periodic images included), in a fixed order.
pub struct Row<'a> {
    pub i: usize,
    /// Internal indices of the neighbours.
    pub j: &'a [u32],
    /// Distances.
    pub r: &'a [f64],
    /// r_b − r_a by axis; axes beyond `dim` are empty.
    pub d: Axes<&'a [f64]>,
}

impl Row<'_> {
    pub fn len(&self) -> usize {
        self.j.len()
    }

    /// The unit vector towards neighbour k; zero where it is at the same place.
    pub fn direction(&self, k: usize) -> Axes<f64> {
        let r = self.r[k];
        let unit = |axis: &[f64]| if r > 0.0 && !axis.is_empty() { axis[k] / r } else { 0.0 };
        self.d.map(unit)
    }

    pub fn is_empty(&self) -> bool {
        self.j.is_empty()
    }

    /// The length of the mean direction to the neighbours within `reach`, to be compared with [`ONE_SIDED`]; none where
    /// there are none.
    pub fn one_sidedness(&self, reach: f64) -> Option<f64> {
        let (mut sum, mut count) = ([0.0; 3], 0);
        for k in (0..self.len()).filter(|&k| self.r[k] > 0.0 && self.r[k] < reach) {
            sum.iter_mut().zip(self.direction(k)).for_each(|(sum, e)| *sum += e);
            count += 1;
        }
        (count > 0).then(|| sum.iter().map(|s| s * s).sum::<f64>().sqrt() / f64::from(count))
    }
}

/// Longer mean directions to the neighbours are those of particles at a surface, in 1, 2 and 3 dimensions: the first and
/// second layers of a square lattice have about 1 and 0.33, 0.54 and 0.22, 0.38 and 0.14, and disorder stays below 0.2.
pub const ONE_SIDED: [f64; 3] = [0.6, 0.3, 0.25];

/// Candidates sifted together.
const LANES: usize = 8;

const CANDIDATES: &str = "neighbour candidates";

/// What single precision may be wrong by in a distance between two places in the search box, in lengths of the box, with
/// room to spare: coordinates and their differences are rounded by 2^-25 at most, squares and their sum by 2^-23.
const SLACK: f64 = 1e-6;

/// The lanes whose bits are set in a mask, first to last, then zeros.
const PACKED: [[u8; LANES]; 1 << LANES] = {
    let mut all = [[0; LANES]; 1 << LANES];
    let mut mask = 0;
    while mask < all.len() {
        let (mut lane, mut found) = (0, 0);
        while lane < LANES {
            if mask >> lane & 1 == 1 {
                all[mask][found] = lane as u8;
                found += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    all
};

/// Bit k says whether a[k] < b[k]. `AVX2`: the processor has it.
#[inline(always)]
fn less<const AVX2: bool>(a: &[f32; LANES], b: &[f32; LANES]) -> usize {
    #[cfg(target_arch = "x86_64")]
    if AVX2 {
        // SAFETY: as the caller says.
        return unsafe { less_avx2(a, b) };
    }
    (0..LANES).map(|k| usize::from(a[k] < b[k]) << k).sum()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn less_avx2(a: &[f32; LANES], b: &[f32; LANES]) -> usize {
    use std::arch::x86_64::{_CMP_LT_OQ, _mm256_cmp_ps, _mm256_loadu_ps, _mm256_movemask_ps};
    // SAFETY: both are as long as a register.
    let (a, b) = unsafe { (_mm256_loadu_ps(a.as_ptr()), _mm256_loadu_ps(b.as_ptr())) };
    _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b)) as usize
}

/// The square of a reach in single precision, and enough more that no particle within it is lost.
fn generous(reach: f64, slack: f64) -> f32 {
    ((reach + slack).powi(2) * (1.0 + 1e-6)) as f32
}

/// Picks from an array.
#[inline(always)]
fn take<T: Copy>(to: &mut [T], from: &[T], places: &[u32]) {
    for (to, &c) in to.iter_mut().zip(places) {
        debug_assert!((c as usize) < from.len());
        // SAFETY: a hit is a candidate, and every array has a value for each.
        *to = unsafe { *from.get_unchecked(c as usize) };
    }
}

/// Buffers of one worker, reused from row to row.
///
/// Candidates are sifted in single precision, in units of the search box, with a little more reach than they have: half
/// the work for all, and the few that pass are tested exactly.
#[derive(Default)]
pub struct Scratch {
    j: Vec<u32>,
    x: Axes<Vec<f64>>,
    shift: Axes<Vec<f64>>,
    /// R h of each candidate, where they differ.
    reach: Vec<f64>,
    origin: Axes<f64>,
    /// 1 / length of the search box.
    scale: f64,
    slack: f64,
    /// The candidates' places in the box.
    sieve: Axes<Vec<f32>>,
    sieve_cut2: Vec<f32>,
    hits: Vec<u32>,
    row_j: Vec<u32>,
    row_r: Vec<f64>,
    row_d: Axes<Vec<f64>>,
}

impl Scratch {
    /// The row of particle i at `centre`: candidates with r < max(reach, theirs), `shifted` where some are images.
    /// `itself`: which candidate particle i is; its images are others.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn near<const D: usize>(
        &mut self,
        i: usize,
        itself: usize,
        centre: [f64; D],
        reach: f64,
        shifted: bool,
    ) -> Result<Row<'_>> {
        self.reserve_row(self.j.len(), D)?;
        let n = match shifted {
            true => self.pick::<D, true>(itself, centre, reach),
            false => self.pick::<D, false>(itself, centre, reach),
        };
        let d = [0, 1, 2].map(|a| if a < D { &self.row_d[a][..n] } else { &[] });
        Ok(Row { i, j: &self.row_j[..n], r: &self.row_r[..n], d })
    }

    /// The first of the candidates, one after the other, that are the particles from i on, and no images.
    ///
    /// # Errors
    /// `Panic` where they are not there: a search among the wrong cells must not pass for one without neighbours.
    pub fn place(&self, i: usize, count: usize) -> Result<usize> {
        let here = |c: &usize| self.shift.iter().all(|shift| shift.get(*c).is_none_or(|s| *s == 0.0));
        let candidates = self.j.iter().enumerate().filter(|(_, j)| **j as usize == i);
        let found = candidates.map(|(c, _)| c).find(here);
        let all =
            |first: &usize| self.j[*first..].iter().zip(i..).take_while(|(j, i)| **j as usize == *i).count() >= count;
        let lost = || Error::Panic { reason: format!("particle {i} is not in the cell that was searched for it") };
        found.filter(all).ok_or_else(lost)
    }

    fn pick<const D: usize, const SHIFTED: bool>(&mut self, itself: usize, centre: [f64; D], reach: f64) -> usize {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("popcnt") {
            // SAFETY: this processor has both.
            return unsafe { self.select_avx2::<D, SHIFTED>(itself, centre, reach) };
        }
        self.select::<D, SHIFTED, false>(itself, centre, reach)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,popcnt")]
    fn select_avx2<const D: usize, const SHIFTED: bool>(
        &mut self,
        itself: usize,
        centre: [f64; D],
        reach: f64,
    ) -> usize {
        self.select::<D, SHIFTED, true>(itself, centre, reach)
    }

    /// Makes the row and answers its length. No closures from here on: they would be compiled once, without the caller's
    /// processor features.
    #[inline(always)]
    fn select<const D: usize, const SHIFTED: bool, const AVX2: bool>(
        &mut self,
        itself: usize,
        centre: [f64; D],
        reach: f64,
    ) -> usize {
        let found = match self.reach.is_empty() {
            true => self.sift::<D, true, AVX2>(itself, &centre, reach),
            false => self.sift::<D, false, AVX2>(itself, &centre, reach),
        };
        self.fill_row::<D, SHIFTED>(&centre, found);
        let mut passed = found;
        if !self.all_within(reach, found) {
            passed = self.keep_within(reach, found);
            self.fill_row::<D, SHIFTED>(&centre, passed);
        }
        for r in &mut self.row_r[..passed] {
            *r = r.sqrt();
        }
        passed
    }

    /// Fills hits with the candidates that may be within reach; answers how many.
    #[inline(always)]
    fn sift<const D: usize, const SAME_H: bool, const AVX2: bool>(
        &mut self,
        itself: usize,
        centre: &[f64; D],
        reach: f64,
    ) -> usize {
        let mut own = [0.0f32; D];
        for a in 0..D {
            own[a] = ((centre[a] - self.origin[a]) * self.scale) as f32;
        }
        let own_cut2 = generous(reach * self.scale, self.slack);
        let mut x: [&[[f32; LANES]]; D] = [&[]; D];
        for (x, sieve) in x.iter_mut().zip(&self.sieve) {
            *x = &sieve.as_chunks().0[..self.sieve[0].len() / LANES];
        }
        let all_theirs = self.sieve_cut2.as_chunks::<LANES>().0;
        let mut found = 0;
        for c in 0..x[0].len() {
            let mut near = [0.0; LANES];
            for a in 0..D {
                for k in 0..LANES {
                    near[k] += (x[a][c][k] - own[a]) * (x[a][c][k] - own[a]);
                }
            }
            let mut cut2 = [own_cut2; LANES];
            if !SAME_H {
                let theirs = &all_theirs[c];
                for k in 0..LANES {
                    cut2[k] = if theirs[k] > own_cut2 { theirs[k] } else { own_cut2 };
                }
            }
            let mut mask = less::<AVX2>(&near, &cut2);
            if c == itself / LANES {
                mask &= !(1 << (itself % LANES));
            }
            // All lanes are written, and the end moves on by the hits alone: no branch to mispredict.
            for (hit, &lane) in self.hits[found..found + LANES].iter_mut().zip(&PACKED[mask]) {
                *hit = (c * LANES) as u32 + u32::from(lane);
            }
            found += mask.count_ones() as usize;
        }
        found
    }

    /// Makes the row of the first `found` hits, with r² in place of r.
    #[inline(always)]
    fn fill_row<const D: usize, const SHIFTED: bool>(&mut self, centre: &[f64; D], found: usize) {
        let (hits, r2) = (&self.hits[..found], &mut self.row_r[..found]);
        take(&mut self.row_j[..found], &self.j, hits);
        r2.fill(0.0);
        for (a, centre) in centre.iter().enumerate() {
            let row = &mut self.row_d[a][..found];
            take(row, &self.x[a], hits);
            for d in &mut *row {
                *d -= centre;
            }
            if SHIFTED {
                let shift = &self.shift[a][..self.j.len()];
                for (d, &c) in row.iter_mut().zip(hits) {
                    *d += shift[c as usize];
                }
            }
            for (r2, d) in r2.iter_mut().zip(&*row) {
                *r2 += d * d;
            }
        }
    }

    /// Whether the whole row is within reach.
    #[inline(always)]
    fn all_within(&self, reach: f64, found: usize) -> bool {
        let own = reach * reach;
        let mut all = true;
        if self.reach.is_empty() {
            for r2 in &self.row_r[..found] {
                all &= *r2 < own;
            }
        } else {
            for (r2, &c) in self.row_r[..found].iter().zip(&self.hits) {
                all &= *r2 < own.max(self.reach[c as usize].powi(2));
            }
        }
        all
    }

    /// Drops the hits of the row that are not within reach; answers how many are left.
    fn keep_within(&mut self, reach: f64, found: usize) -> usize {
        let own = reach * reach;
        let mut left = 0;
        for k in 0..found {
            let c = self.hits[k] as usize;
            let theirs = self.reach.get(c).map_or(0.0, |reach| reach.powi(2));
            if self.row_r[k] < own.max(theirs) {
                self.hits[left] = c as u32;
                left += 1;
            }
        }
        left
    }

    /// Forgets all candidates.
    pub fn clear(&mut self) {
        self.j.clear();
        self.reach.clear();
        self.x.iter_mut().chain(&mut self.shift).for_each(Vec::clear);
    }

    /// Makes every candidate so far an image that is not shifted.
    pub fn add_zero_shifts(&mut self) -> Result<()> {
        let n = self.j.len();
        for shift in &mut self.shift {
            memory::room(CANDIDATES, shift, n)?;
            shift.resize(n, 0.0);
        }
        Ok(())
    }

    /// Adds the particles of a cell. `shift`: where some candidates are images; `lengths`: smoothing lengths and kernel
    /// radius, where they differ.
    pub fn add(
        &mut self,
        cloud: &Cloud,
        cell: &[u32],
        shift: Option<Axes<f64>>,
        lengths: Option<(&[f64], f64)>,
    ) -> Result<()> {
        memory::appended(CANDIDATES, &mut self.j, cell)?;
        // Where all particles are on one level, those of a cell are one after the other.
        let run = cell.first().zip(cell.last()).map(|(&first, &last)| first as usize..last as usize + 1);
        for (a, x) in self.x.iter_mut().enumerate().take(cloud.dim()) {
            memory::room(CANDIDATES, x, cell.len())?;
            match &run {
                Some(run) if run.len() == cell.len() => x.extend_from_slice(&cloud.x[a][run.clone()]),
                _ => x.extend(cell.iter().map(|&j| cloud.x[a][j as usize])),
            }
        }
        for (all, by) in self.shift.iter_mut().zip(shift.iter().flatten()) {
            memory::room(CANDIDATES, all, cell.len())?;
            all.resize(all.len() + cell.len(), *by);
        }
        if let Some((h, radius)) = lengths {
            memory::room(CANDIDATES, &mut self.reach, cell.len())?;
            self.reach.extend(cell.iter().map(|&j| radius * h[j as usize]));
        }
        Ok(())
    }

    /// Makes the sieve, when all candidates are there, for rows within a box.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn settle(&mut self, domain: &Domain, from: Axes<f64>, to: Axes<f64>) -> Result<()> {
        let (mut size, mut magnitude) = (0.0f64, 0.0f64);
        for (a, (from, to)) in from.iter().zip(&to).enumerate().take(domain.dim) {
            size = size.max(to - from);
            magnitude = magnitude.max(from.abs()).max(to.abs());
            magnitude = if domain.periodic[a] { magnitude.max(domain.length(a)) } else { magnitude };
        }
        (self.origin, self.scale) = (from, 1.0 / size);
        self.slack = SLACK + 8.0 * f64::EPSILON * magnitude * self.scale;
        let (what, n) = (CANDIDATES, self.j.len());
        let padded = n.next_multiple_of(LANES);
        for (a, origin) in from.into_iter().enumerate().take(domain.dim) {
            let (shift, sieve, scale) = (&self.shift[a], &mut self.sieve[a], self.scale);
            sieve.clear();
            memory::extended(what, sieve, padded, f32::INFINITY)?;
            let places = sieve.iter_mut().zip(&self.x[a]);
            match shift.is_empty() {
                true => places.for_each(|(s, x)| *s = ((x - origin) * scale) as f32),
                false => places.zip(shift).for_each(|((s, x), by)| *s = (((x - origin) + by) * scale) as f32),
            }
        }
        self.sieve_cut2.clear();
        if !self.reach.is_empty() {
            memory::extended(what, &mut self.sieve_cut2, padded, 0.0)?;
            let theirs = self.sieve_cut2.iter_mut().zip(&self.reach);
            theirs.for_each(|(cut2, reach)| *cut2 = generous(reach * self.scale, self.slack));
        }
        Ok(())
    }

    fn reserve_row(&mut self, n: usize, dim: usize) -> Result<()> {
        let what = "a row of neighbours";
        memory::extended(what, &mut self.hits, n + LANES, 0)?;
        memory::extended(what, &mut self.row_j, n, 0)?;
        memory::extended(what, &mut self.row_r, n, 0.0)?;
        self.row_d.iter_mut().take(dim).try_for_each(|d| memory::extended(what, d, n, 0.0))
    }
}
