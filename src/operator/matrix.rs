//! Stored weights of pairs: a sparse matrix in stretches of rows, applied at the speed of the memory, block by block. Twelve
//! bytes a pair: shorter columns (16 bits, named through a table of blocks) were measured to cost more in decoding than they
//! save in reading.

use super::{Kappa, Mean};
use crate::error::Result;
use crate::memory;
use crate::pool::{BLOCK, Pool};
use crate::space::{Row, Scratch, rows::Rows};
use std::ops::Range;

/// Pairs from the one at work to the one whose coefficient is asked of the memory: enough to hide its latency, which the
/// processor's own prefetching does not across pages. Asking between the sums, a line at a time, was measured to take
/// 0.8 times the time of asking for a row at once. Half or twice as far takes up to 1.08 times as long, four times as
/// far 1.2 and more (50³ and 100³ particles).
const AHEAD: usize = 256;

/// Blocks of a stretch at most: arrays of several MB are found in the memory by few addresses (huge pages), which makes
/// sums over them 1.1 to 1.3 times as fast as over an array for each block.
const STRETCH: usize = 16;
/// Stretches for each worker, so that none waits long for another.
const SHARES: usize = 4;

/// Symmetric coefficients g_ab = V_a V_b w_ab (and what was folded into them), in rows.
pub struct Matrix {
    n: usize,
    /// Rows of a stretch.
    length: usize,
    stretches: Vec<Stretch>,
}

/// Rows that follow each other, a whole number of blocks but for the last ones.
pub struct Stretch {
    first: usize,
    start: Vec<u32>,
    col: Vec<u32>,
    coef: Vec<f64>,
    /// The blocks in which the neighbours of each block live, sorted.
    touches: Vec<Vec<u32>>,
}

/// How many rows are made and kept together.
pub fn length(n: usize, pool: &Pool) -> usize {
    BLOCK * (n.div_ceil(BLOCK) / (SHARES * pool.threads())).clamp(1, STRETCH)
}

/// A worker's notes on which blocks a block's neighbours live in.
#[derive(Default)]
pub struct Seen(Vec<bool>);

impl Seen {
    fn touched(&mut self, n: usize, col: &[u32]) -> Result<Vec<u32>> {
        let blocks = n.div_ceil(BLOCK);
        memory::extended("block list", &mut self.0, blocks, false)?;
        // Noted without looking, and looked at once: a branch for each pair would cost more.
        col.iter().for_each(|&j| self.0[j as usize / BLOCK] = true);
        // The sums do not look again whether a neighbour exists.
        let complete = n.is_multiple_of(BLOCK) || !self.0.last().is_some_and(|seen| *seen);
        assert!(complete || col.iter().all(|&j| (j as usize) < n), "a neighbour that does not exist");
        let count = self.0.iter().filter(|seen| **seen).count();
        let mut list = memory::reserved("block list", count)?;
        list.extend((0..blocks as u32).filter(|&block| self.0[block as usize]));
        self.0.fill(false);
        Ok(list)
    }
}

impl Stretch {
    /// Of the rows from particle `first` on, from their columns (all below `n`) and coefficients, row k from `start[k]` to
    /// `start[k + 1]`.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn new(
        n: usize,
        first: usize,
        start: Vec<u32>,
        col: Vec<u32>,
        coef: Vec<f64>,
        seen: &mut Seen,
    ) -> Result<Stretch> {
        if col.len() > u32::MAX as usize {
            return Err(memory::no_memory::<(u32, f64)>("matrix", col.len()));
        }
        let mut touches = memory::reserved("block lists", (start.len() - 1).div_ceil(BLOCK))?;
        for rows in
            start[..start.len() - 1].chunks(BLOCK).enumerate().map(|(b, rows)| b * BLOCK..b * BLOCK + rows.len())
        {
            touches.push(seen.touched(n, &col[start[rows.start] as usize..start[rows.end] as usize])?);
        }
        Ok(Stretch { first, start, col: fitted(col)?, coef: fitted(coef)?, touches })
    }

    fn len(&self) -> usize {
        self.start.len() - 1
    }

    /// The particle of row k, and where its coefficients are.
    fn row(&self, k: usize) -> (usize, Range<usize>) {
        (self.first + k, self.start[k] as usize..self.start[k + 1] as usize)
    }

    /// Of the rows from `from` on.
    fn sums(
        &self,
        from: usize,
        t: &[f64],
        out: &mut [f64],
        finish: impl Fn(usize, f64) -> f64,
        g: impl Fn(usize, usize, f64) -> f64,
    ) {
        for (k, out) in out.iter_mut().enumerate() {
            let (i, range) = self.row(from + k);
            *out = finish(i, row_sum(&self.col[range.clone()], &self.coef[range], t, t[i], |j, c| g(i, j, c)));
        }
    }

    fn bytes(&self) -> u64 {
        let touches = self.touches.iter().map(memory::bytes).sum::<u64>();
        memory::bytes(&self.start) + memory::bytes(&self.col) + memory::bytes(&self.coef) + touches
    }
}

/// The same items, in an array that is not much larger.
fn fitted<T: Copy>(items: Vec<T>) -> Result<Vec<T>> {
    match items.capacity() > items.len() + items.len() / 16 {
        true => memory::copied("matrix", &items),
        false => Ok(items),
    }
}

/// Asks the memory for what lies [`AHEAD`] items behind the first of these, without waiting.
#[inline(always)]
fn prefetch<T>(data: &[T]) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a prefetch reads nothing that the program can see, whatever the address.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(data.as_ptr().wrapping_add(AHEAD).cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = data;
}

impl Matrix {
    /// From all stretches, each of so many rows but for the last one.
    pub fn new(n: usize, length: usize, stretches: Vec<Stretch>) -> Matrix {
        Matrix { n, length, stretches }
    }

    /// Where the places of a particle's pairs count from: a number for each stretch.
    pub fn stretch(&self, i: usize) -> usize {
        i / self.length
    }

    /// Rows of a stretch.
    pub fn length(&self) -> usize {
        self.length
    }

    pub fn len(&self) -> usize {
        self.n
    }

    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// Stored pairs, both directions counted.
    pub fn pairs(&self) -> u64 {
        self.stretches.iter().map(|s| s.coef.len() as u64).sum()
    }

    pub fn bytes(&self) -> u64 {
        self.stretches.iter().map(Stretch::bytes).sum()
    }

    /// Multiplies each coefficient by `factor(a, b)`, which must be symmetric to the bit.
    pub fn scale(&mut self, pool: &Pool, factor: impl Fn(usize, usize) -> f64 + Copy + Sync + Send) {
        self.update(pool, move |a, b, _, g| g * factor(a, b));
    }

    /// Replaces each coefficient by `value(a, b, place in its stretch, g_ab)`, which must be symmetric to the bit.
    pub fn update(&mut self, pool: &Pool, value: impl Fn(usize, usize, usize, f64) -> f64 + Copy + Sync + Send) {
        pool.chunks(&mut self.stretches, 1, |_, part| {
            // A copy: what it refers to can then stay in registers while coefficients are written.
            let of_pair = value;
            for stretch in part {
                for k in 0..stretch.len() {
                    let (i, range) = stretch.row(k);
                    let pairs = stretch.coef[range.clone()].iter_mut().zip(&stretch.col[range.clone()]);
                    for ((g, &j), at) in pairs.zip(range) {
                        *g = of_pair(i, j as usize, at, *g);
                    }
                }
            }
        });
    }

    /// Calls `change` with each row that is `wanted`, found again, and its coefficients. `B` is what a worker reuses from row
    /// to row.
    ///
    /// # Errors
    /// `NoMemory`; that of `change`.
    pub fn update_rows<B: Default>(
        &mut self,
        rows: &Rows,
        pool: &Pool,
        wanted: impl Fn(usize) -> bool + Sync + Send,
        change: impl Fn(&mut B, &Row, &mut [f64]) -> Result<()> + Sync + Send,
    ) -> Result<()> {
        let failed = std::sync::Mutex::new(None);
        pool.chunks(&mut self.stretches, 1, |_, part| {
            for Stretch { first, start, coef, .. } in part {
                let (mut buffers, range) = (B::default(), *first..*first + start.len() - 1);
                let found = rows.visit_where(range, &mut Scratch::default(), &wanted, |row| {
                    let from = start[row.i - *first] as usize;
                    change(&mut buffers, &row, &mut coef[from..from + row.len()])
                });
                if let (Err(e), Ok(mut slot)) = (found, failed.lock()) {
                    *slot = Some(e);
                }
            }
        });
        failed.into_inner().ok().flatten().map_or(Ok(()), Err)
    }

    /// out_a = finish(a, Σ_b g_ab mean(k_a, k_b) (T_b − T_a)), the mean left out where `kappa` is none.
    ///
    /// `quiet` skips blocks whose values and neighbours' values are all the same: their sums are exactly zero.
    pub fn apply(
        &self,
        pool: &Pool,
        kappa: Kappa,
        t: &[f64],
        out: &mut [f64],
        quiet: bool,
        finish: impl Fn(usize, f64) -> f64 + Sync + Send,
    ) {
        assert!(t.len() == self.n && out.len() == self.n, "one value for each particle");
        let levels = quiet.then(|| self.levels(pool, t));
        pool.chunks(out, BLOCK, |start, part| {
            let stretch = &self.stretches[start / self.length];
            let from = start - stretch.first;
            if levels.as_ref().is_some_and(|l| is_quiet(l, start / BLOCK, &stretch.touches[from / BLOCK])) {
                return part.fill(0.0);
            }
            // One loop per average, so that the choice is made once per block and not once per pair.
            match kappa {
                None => stretch.sums(from, t, part, &finish, |_, _, c| c),
                Some((Mean::Harmonic, k)) => {
                    stretch.sums(from, t, part, &finish, |i, j, c| c * Mean::Harmonic.of(k[i], k[j]))
                }
                Some((Mean::Arithmetic, k)) => {
                    stretch.sums(from, t, part, &finish, |i, j, c| c * Mean::Arithmetic.of(k[i], k[j]))
                }
                Some((Mean::Geometric, k)) => {
                    stretch.sums(from, t, part, &finish, |i, j, c| c * Mean::Geometric.of(k[i], k[j]))
                }
            }
        });
    }

    /// Σ_b |g_ab| mean(k_a, k_b) of each row, and |Σ_b g_ab mean(k_a, k_b)| beside it: what Gershgorin's circles are made of.
    pub fn circles(&self, pool: &Pool, kappa: Kappa) -> Result<Vec<(f64, f64)>> {
        let mut out = memory::filled("row sums", self.n, (0.0, 0.0))?;
        pool.chunks(&mut out, BLOCK, |start, part| {
            let stretch = &self.stretches[start / self.length];
            for (k, out) in part.iter_mut().enumerate() {
                let (i, range) = stretch.row(start - stretch.first + k);
                let (mut absolute, mut signed) = (0.0f64, 0.0f64);
                for at in range {
                    let (j, c) = (stretch.col[at] as usize, stretch.coef[at]);
                    let g = kappa.map_or(c, |(mean, k)| c * mean.of(k[i], k[j]));
                    // An image of the particle itself exchanges nothing.
                    let g = if j == i { 0.0 } else { g };
                    (absolute, signed) = (absolute + g.abs(), signed + g);
                }
                *out = (absolute, signed.abs());
            }
        });
        Ok(out)
    }

    /// Number of stored neighbours of a particle.
    pub fn neighbours(&self, i: usize) -> usize {
        self.columns(i).len()
    }

    /// The stored neighbours of a particle.
    pub fn columns(&self, i: usize) -> &[u32] {
        &self.stretches[self.stretch(i)].col[self.places(i)]
    }

    /// The places of its pairs in its stretch.
    pub fn places(&self, i: usize) -> Range<usize> {
        let stretch = &self.stretches[self.stretch(i)];
        stretch.row(i - stretch.first).1
    }

    /// Their coefficients.
    pub fn coefficients(&self, i: usize) -> &[f64] {
        &self.stretches[self.stretch(i)].coef[self.places(i)]
    }

    /// Replaces each coefficient by the mean of itself and its mate's, g_ba. Rows must list each other. `apart`: what is
    /// between the particles of each pair, where some are neighbours with several images; the mate of the image at d is the
    /// one at −d.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn symmetrise(&mut self, apart: Option<&[Vec<[f32; 3]>]>, pool: &Pool) -> Result<()> {
        let between = |i: usize, at: usize| apart.map_or([0.0; 3], |apart| apart[self.stretch(i)][at]);
        let made = pool.map(self.stretches.len(), |s| {
            let stretch = &self.stretches[s];
            let mut coef = memory::copied("matrix coefficients", &stretch.coef)?;
            for k in 0..stretch.len() {
                pool.go_on()?;
                let (i, range) = stretch.row(k);
                for at in range {
                    let (j, back) = (stretch.col[at] as usize, between(i, at).map(|d| -d));
                    let mut mates = self.columns(j).iter().zip(self.coefficients(j)).zip(self.places(j));
                    let is_mate = |place: usize, c: u32| c as usize == i && between(j, place) == back;
                    let mate = mates.find(|((c, _), place)| is_mate(*place, **c)).map(|((_, mate), _)| mate);
                    debug_assert!(mate.is_some(), "particles {i} and {j} do not list each other");
                    coef[at] = mate.map_or(coef[at], |mate| 0.5 * (coef[at] + mate));
                }
            }
            Ok(coef)
        });
        for (stretch, coef) in self.stretches.iter_mut().zip(made) {
            stretch.coef = coef?;
        }
        Ok(())
    }

    /// The smallest coefficient; negative where the operator breaks positivity on some pair.
    pub fn smallest(&self, pool: &Pool) -> f64 {
        let of_stretch = |s: usize| self.stretches[s].coef.iter().copied().fold(f64::INFINITY, f64::min);
        pool.map(self.stretches.len(), of_stretch).into_iter().fold(f64::INFINITY, f64::min)
    }

    /// How many coefficients are negative.
    pub fn negative(&self, pool: &Pool) -> usize {
        let of_stretch = |s: usize| self.stretches[s].coef.iter().filter(|c| **c < 0.0).count();
        pool.map(self.stretches.len(), of_stretch).into_iter().sum()
    }

    /// The first particle with a coefficient that is not a finite number.
    pub fn first_bad(&self, pool: &Pool) -> Option<usize> {
        let of_stretch = |s: usize| {
            let stretch: &Stretch = &self.stretches[s];
            let bad = stretch.coef.iter().position(|c| !c.is_finite())?;
            (0..stretch.len()).map(|k| stretch.row(k)).find(|(_, range)| range.contains(&bad)).map(|(i, _)| i)
        };
        pool.map(self.stretches.len(), of_stretch).into_iter().flatten().next()
    }

    /// One value for each block whose members all have it.
    fn levels(&self, pool: &Pool, t: &[f64]) -> Vec<Option<f64>> {
        pool.map(self.n.div_ceil(BLOCK), |b| {
            let part = &t[b * BLOCK..((b + 1) * BLOCK).min(self.n)];
            part.iter().all(|&v| v == part[0]).then_some(part[0])
        })
    }
}

fn is_quiet(levels: &[Option<f64>], block: usize, touches: &[u32]) -> bool {
    levels[block].is_some_and(|own| touches.iter().all(|&b| levels[b as usize] == Some(own)))
}

/// Σ g(b, c) (T_b − T_a) over a row, every column being a particle of `t`. Four running sums: one would wait
/// for its own last addition at every neighbour.
#[inline(always)]
pub(super) fn row_sum(col: &[u32], coef: &[f64], t: &[f64], own: f64, g: impl Fn(usize, f64) -> f64) -> f64 {
    let term = |j: u32, coef: f64| {
        let j = j as usize;
        debug_assert!(j < t.len());
        // SAFETY: columns are below the number of particles where they are made, and t has one value for each.
        g(j, coef) * (unsafe { *t.get_unchecked(j) } - own)
    };
    let mut sums = [0.0; 4];
    // Eight coefficients are a line of the memory.
    let (cols, coefs) = (col.chunks_exact(8), coef.chunks_exact(8));
    let rest: f64 = cols.remainder().iter().zip(coefs.remainder()).map(|(&j, &c)| term(j, c)).sum();
    for (j, c) in cols.zip(coefs) {
        prefetch(j);
        prefetch(c);
        for k in 0..8 {
            sums[k % 4] += term(j[k], c[k]);
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of `per_row` neighbours spread over so many blocks, and their sums by the definition.
    fn random_matrix(blocks: usize, per_row: usize) -> (Matrix, Vec<f64>, Vec<f64>) {
        let n = blocks * BLOCK - 100;
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as usize
        };
        let t: Vec<f64> = (0..n).map(|_| next() as f64).collect();
        let (mut list, mut sums, mut seen) = (Vec::new(), vec![0.0; n], Seen::default());
        for b in 0..blocks {
            let (mut start, mut col, mut coef) = (vec![0], Vec::new(), Vec::new());
            for i in b * BLOCK..((b + 1) * BLOCK).min(n) {
                for _ in 0..per_row {
                    let j = next() % n;
                    col.push(j as u32);
                    coef.push((next() % 16) as f64);
                    // Whole numbers below 2^53: exact in any order.
                    sums[i] += coef[coef.len() - 1] * (t[j] - t[i]);
                }
                start.push(col.len() as u32);
            }
            list.push(Stretch::new(n, b * BLOCK, start, col, coef, &mut seen).unwrap());
        }
        (Matrix::new(n, BLOCK, list), t, sums)
    }

    #[test]
    fn sums_are_those_of_the_definition() {
        for blocks in [1, 2, 70] {
            let (mut matrix, t, sums) = random_matrix(blocks, 13);
            let pool = Pool::new(2).unwrap();
            let mut out = vec![0.0; t.len()];
            matrix.apply(&pool, None, &t, &mut out, true, |_, s| s);
            assert_eq!(out, sums);
            matrix.scale(&pool, |a, b| if (a + b) % 2 == 0 { 2.0 } else { 4.0 });
            let kappa: Vec<f64> = (0..t.len()).map(|i| if i % 2 == 0 { 1.0 } else { 3.0 }).collect();
            let plain = matrix.circles(&pool, None).unwrap();
            let weighed = matrix.circles(&pool, Some((Mean::Arithmetic, &kappa))).unwrap();
            assert!(plain.iter().zip(&weighed).all(|(p, w)| p.0 <= w.0 && w.0 <= 3.0 * p.0 && p.0 == p.1));
            assert_eq!(matrix.pairs(), 13 * t.len() as u64);
        }
    }

    #[test]
    fn quiet_blocks_are_zero_and_others_are_not_skipped() {
        let (matrix, mut t, _) = random_matrix(3, 5);
        let pool = Pool::new(1).unwrap();
        let mut out = vec![f64::NAN; t.len()];
        t.fill(2.0);
        matrix.apply(&pool, None, &t, &mut out, true, |_, s| s);
        assert!(out.iter().all(|&o| o == 0.0));
        t[0] = 3.0;
        let mut slow = out.clone();
        matrix.apply(&pool, None, &t, &mut out, true, |_, s| s);
        matrix.apply(&pool, None, &t, &mut slow, false, |_, s| s);
        assert!(out == slow && out.iter().any(|&o| o != 0.0));
    }
}
