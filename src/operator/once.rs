//! The engine for operators that need one pass: weights of pairs, stored in rows, applied as a sparse sum.
//!
//! The stored coefficient g_ab = V_a V_b w_ab is symmetric to the bit, so exchanges cancel exactly before rounding of
//! the row sums. Rows are gathered by their owner in a fixed order.

use super::{Mean, Operator};
use crate::error::Result;
use crate::kernel::Kernel;
use crate::memory;
use crate::pool::{BLOCK, Pool};
use crate::space::{Row, Scratch, rows::Rows};

/// What a row of weights is made from.
pub struct Assembly<'a> {
    pub operator: &'static Operator,
    pub kernel: &'a Kernel,
    pub rows: &'a Rows<'a>,
    /// Volumes m/rho in internal order.
    pub volume: &'a [f64],
    /// One kernel evaluation per pair: every h is the same.
    pub same_h: bool,
}

/// Buffers of one worker for rows of weights.
#[derive(Default)]
pub struct Buffers {
    q: Vec<f64>,
    w: Vec<f64>,
    other: Vec<f64>,
    spare: Vec<f64>,
}

impl Assembly<'_> {
    /// w_ab of a row, symmetrised: the mean of the weights with h_a and with h_b, units 1/length^(nu + 2).
    pub fn weights<'b>(&self, row: &Row, buffers: &'b mut Buffers) -> Result<&'b [f64]> {
        let n = row.len();
        buffers.reserve(n)?;
        let Buffers { q, w, other, spare } = buffers;
        let (q, w, other, spare) = (&mut q[..n], &mut w[..n], &mut other[..n], &mut spare[..n]);
        let power = self.kernel.dim() as i32 + 2;
        let h = self.rows.h;
        let own = 1.0 / h[row.i];
        q.iter_mut().zip(row.r).for_each(|(q, r)| *q = r * own);
        (self.operator.weight)(self.kernel, q, w, spare);
        let scale = own.powi(power);
        w.iter_mut().for_each(|w| *w *= scale);
        if !self.same_h {
            let inverse = |j: &u32| 1.0 / h[*j as usize];
            q.iter_mut().zip(row.r).zip(row.j).for_each(|((q, r), j)| *q = r * inverse(j));
            (self.operator.weight)(self.kernel, q, other, spare);
            for ((w, other), j) in w.iter_mut().zip(other).zip(row.j) {
                *w = 0.5 * (*w + *other * inverse(j).powi(power));
            }
        }
        Ok(w)
    }

    /// The stored matrix, and the local second moment K_a = Σ_b V_b r² w_ab / (2 nu) of each particle, which is 1 for
    /// a perfect Laplacian (Biriukov & Price 2019).
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn store(&self, pool: &Pool) -> Result<(Matrix, Vec<f64>)> {
        let n = self.volume.len();
        let mut blocks = memory::reserved("matrix", n.div_ceil(BLOCK))?;
        let mut moments = memory::reserved("second moments", n)?;
        for block in pool.map_init(n.div_ceil(BLOCK), Workspace::default, |space, b| self.block(space, b)) {
            let (block, k) = block?;
            blocks.push(block);
            moments.extend_from_slice(&k);
        }
        Ok((Matrix { n, blocks }, moments))
    }

    /// As [`Matrix::apply`], with weights that are made for this one application and not kept: the same bits.
    ///
    /// # Errors
    /// `NoMemory` for a row that does not fit.
    pub fn apply(
        &self,
        pool: &Pool,
        kappa: Option<(Mean, &[f64])>,
        t: &[f64],
        out: &mut [f64],
        finish: impl Fn(usize, f64) -> f64 + Sync + Send,
    ) -> Result<()> {
        self.rows.map(pool, out, |(buffers, coef): &mut (Buffers, Vec<f64>), row: Row| {
            let w = self.weights(&row, buffers)?;
            coef.clear();
            coef.extend(self.coefficients(&row, w));
            let own = t[row.i];
            let sum = match kappa {
                None => row_sum(row.j, coef, t, own, |_, c| c),
                Some((mean, k)) => row_sum(row.j, coef, t, own, |j, c| c * mean.of(k[row.i], k[j])),
            };
            Ok(finish(row.i, sum))
        })
    }

    /// g_ab = V_a V_b w_ab of a row.
    fn coefficients<'b>(&'b self, row: &'b Row, w: &'b [f64]) -> impl Iterator<Item = f64> + 'b {
        let own = self.volume[row.i];
        row.j.iter().zip(w).map(move |(&j, w)| (own * self.volume[j as usize]) * w)
    }

    fn block(&self, space: &mut Workspace, b: usize) -> Result<(Block, Vec<f64>)> {
        let range = b * BLOCK..((b + 1) * BLOCK).min(self.volume.len());
        let Workspace { scratch, buffers, col, coef } = space;
        col.clear();
        coef.clear();
        let mut start = memory::reserved("matrix rows", range.len() + 1)?;
        let mut moments = memory::reserved("second moments", range.len())?;
        let mut failed = Ok(());
        let dim = self.kernel.dim() as f64;
        start.push(0);
        self.rows.visit(range, scratch, |row| {
            let w = match self.weights(&row, buffers) {
                Ok(w) if col.try_reserve(row.len()).is_ok() && coef.try_reserve(row.len()).is_ok() => w,
                Ok(_) => return failed = Err(memory::no_memory::<(u32, f64)>("matrix", row.len())),
                Err(e) => return failed = Err(e),
            };
            let second = row.j.iter().zip(w).zip(row.r);
            let k: f64 = second.map(|((&j, w), r)| self.volume[j as usize] * (r * r) * w).sum();
            col.extend_from_slice(row.j);
            coef.extend(self.coefficients(&row, w));
            moments.push(k / (2.0 * dim));
            start.push(col.len() as u32);
        })?;
        failed?;
        if col.len() > u32::MAX as usize {
            return Err(memory::no_memory::<(u32, f64)>("matrix", col.len()));
        }
        let block = Block {
            first: b * BLOCK,
            start,
            touches: touched(col)?,
            col: memory::copied("matrix columns", col)?,
            coef: memory::copied("matrix coefficients", coef)?,
        };
        Ok((block, moments))
    }
}

/// The sorted list of blocks in which a block's neighbours live.
fn touched(col: &[u32]) -> Result<Vec<u32>> {
    let mut list: Vec<u32> = Vec::new();
    let mut last = u32::MAX;
    for &j in col {
        let block = j / BLOCK as u32;
        if block != last {
            last = block;
            if !list.contains(&block) {
                list.try_reserve(1).map_err(|_| memory::no_memory::<u32>("block list", list.len()))?;
                list.push(block);
            }
        }
    }
    list.sort_unstable();
    Ok(list)
}

#[derive(Default)]
struct Workspace {
    scratch: Scratch,
    buffers: Buffers,
    col: Vec<u32>,
    coef: Vec<f64>,
}

impl Buffers {
    fn reserve(&mut self, n: usize) -> Result<()> {
        for v in [&mut self.q, &mut self.w, &mut self.other, &mut self.spare] {
            if v.len() < n {
                v.try_reserve(n - v.len()).map_err(|_| memory::no_memory::<f64>("a row of weights", n))?;
                v.resize(n, 0.0);
            }
        }
        Ok(())
    }
}

/// Pair sums, from stored weights or from weights made on the way.
#[derive(Clone, Copy)]
pub enum Pairs<'a> {
    Stored(&'a Matrix),
    Fresh(&'a Assembly<'a>),
}

/// Symmetric coefficients g_ab = V_a V_b w_ab (and what was folded into them), in rows, in blocks of [`BLOCK`] rows.
pub struct Matrix {
    n: usize,
    blocks: Vec<Block>,
}

struct Block {
    first: usize,
    start: Vec<u32>,
    col: Vec<u32>,
    coef: Vec<f64>,
    touches: Vec<u32>,
}

impl Block {
    fn rows(&self) -> impl Iterator<Item = (usize, &[u32], &[f64])> {
        self.start.windows(2).enumerate().map(|(k, s)| {
            let range = s[0] as usize..s[1] as usize;
            (self.first + k, &self.col[range.clone()], &self.coef[range])
        })
    }
}

impl Block {
    fn sums(
        &self,
        t: &[f64],
        out: &mut [f64],
        finish: impl Fn(usize, f64) -> f64,
        g: impl Fn(usize, usize, f64) -> f64,
    ) {
        for ((i, col, coef), out) in self.rows().zip(out) {
            *out = finish(i, row_sum(col, coef, t, t[i], |j, c| g(i, j, c)));
        }
    }
}

impl Matrix {
    pub fn len(&self) -> usize {
        self.n
    }

    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// Stored pairs, both directions counted.
    pub fn pairs(&self) -> u64 {
        self.blocks.iter().map(|b| b.col.len() as u64).sum()
    }

    pub fn bytes(&self) -> u64 {
        let block = |b: &Block| {
            memory::bytes(&b.start) + memory::bytes(&b.col) + memory::bytes(&b.coef) + memory::bytes(&b.touches)
        };
        self.blocks.iter().map(block).sum()
    }

    /// Multiplies each coefficient by `factor(a, b)`, which must be symmetric to the bit.
    pub fn scale(&mut self, pool: &Pool, factor: impl Fn(usize, usize) -> f64 + Sync + Send) {
        pool.chunks(&mut self.blocks, 1, |_, part| {
            for block in part {
                let Block { first, start, col, coef, .. } = block;
                for (k, s) in start.windows(2).enumerate() {
                    let range = s[0] as usize..s[1] as usize;
                    let pairs = coef[range.clone()].iter_mut().zip(&col[range]);
                    pairs.for_each(|(c, &j)| *c *= factor(*first + k, j as usize));
                }
            }
        });
    }

    /// out_a = finish(a, Σ_b g_ab mean(k_a, k_b) (T_b − T_a)), the mean left out where `kappa` is none.
    ///
    /// `quiet` skips blocks whose values and neighbours' values are all the same: their sums are exactly zero.
    pub fn apply(
        &self,
        pool: &Pool,
        kappa: Option<(Mean, &[f64])>,
        t: &[f64],
        out: &mut [f64],
        quiet: bool,
        finish: impl Fn(usize, f64) -> f64 + Sync + Send,
    ) {
        let levels = quiet.then(|| self.levels(pool, t));
        pool.chunks(out, BLOCK, |start, part| {
            let block = &self.blocks[start / BLOCK];
            if levels.as_ref().is_some_and(|l| is_quiet(l, start / BLOCK, &block.touches)) {
                return part.fill(0.0);
            }
            // One loop per average, so that the choice is made once per block and not once per pair.
            match kappa {
                None => block.sums(t, part, &finish, |_, _, c| c),
                Some((Mean::Harmonic, k)) => block.sums(t, part, &finish, |i, j, c| c * Mean::Harmonic.of(k[i], k[j])),
                Some((Mean::Arithmetic, k)) => {
                    block.sums(t, part, &finish, |i, j, c| c * Mean::Arithmetic.of(k[i], k[j]))
                }
                Some((Mean::Geometric, k)) => {
                    block.sums(t, part, &finish, |i, j, c| c * Mean::Geometric.of(k[i], k[j]))
                }
            }
        });
    }

    /// Σ_b |g_ab| mean(k_a, k_b) of each row, and |Σ_b g_ab mean(k_a, k_b)| beside it: what Gershgorin's circles are made of.
    pub fn circles(&self, pool: &Pool, kappa: Option<(Mean, &[f64])>) -> Result<Vec<(f64, f64)>> {
        let mut out = memory::filled("row sums", self.n, (0.0, 0.0))?;
        pool.chunks(&mut out, BLOCK, |start, part| {
            for ((i, col, coef), out) in self.blocks[start / BLOCK].rows().zip(part) {
                let (mut absolute, mut signed) = (0.0f64, 0.0f64);
                for (&j, &c) in col.iter().zip(coef) {
                    let g = kappa.map_or(c, |(mean, k)| c * mean.of(k[i], k[j as usize]));
                    // An image of the particle itself exchanges nothing.
                    let g = if j as usize == i { 0.0 } else { g };
                    (absolute, signed) = (absolute + g.abs(), signed + g);
                }
                *out = (absolute, signed.abs());
            }
        });
        Ok(out)
    }

    /// Number of stored neighbours of a particle.
    pub fn neighbours(&self, i: usize) -> usize {
        let block = &self.blocks[i / BLOCK];
        let k = i - block.first;
        (block.start[k + 1] - block.start[k]) as usize
    }

    /// The smallest coefficient; negative where the operator breaks positivity on some pair.
    pub fn smallest(&self, pool: &Pool) -> f64 {
        let of_block = |b: usize| self.blocks[b].coef.iter().copied().fold(f64::INFINITY, f64::min);
        pool.map(self.blocks.len(), of_block).into_iter().fold(f64::INFINITY, f64::min)
    }

    /// The first particle with a coefficient that is not a finite number.
    pub fn first_bad(&self, pool: &Pool) -> Option<usize> {
        let of_block = |b: usize| {
            let block: &Block = &self.blocks[b];
            let finite = block.coef.iter().all(|c| c.is_finite());
            if finite { None } else { block.rows().find(|(.., c)| c.iter().any(|c| !c.is_finite())).map(|(i, ..)| i) }
        };
        pool.map(self.blocks.len(), of_block).into_iter().flatten().next()
    }

    /// One value for each block whose members all have it.
    fn levels(&self, pool: &Pool, t: &[f64]) -> Vec<Option<f64>> {
        pool.map(self.blocks.len(), |b| {
            let part = &t[b * BLOCK..((b + 1) * BLOCK).min(self.n)];
            part.iter().all(|&v| v == part[0]).then_some(part[0])
        })
    }
}

fn is_quiet(levels: &[Option<f64>], block: usize, touches: &[u32]) -> bool {
    levels[block].is_some_and(|own| touches.iter().all(|&b| levels[b as usize] == Some(own)))
}

/// Σ g(b, c) (T_b − T_a) over a row. Four running sums: one would wait for its own last addition at every neighbour.
#[inline(always)]
fn row_sum(col: &[u32], coef: &[f64], t: &[f64], own: f64, g: impl Fn(usize, f64) -> f64) -> f64 {
    let term = |j: u32, c: f64| g(j as usize, c) * (t[j as usize] - own);
    let mut sums = [0.0; 4];
    let (cols, coefs) = (col.chunks_exact(4), coef.chunks_exact(4));
    let rest: f64 = cols.remainder().iter().zip(coefs.remainder()).map(|(&j, &c)| term(j, c)).sum();
    for (j, c) in cols.zip(coefs) {
        for lane in 0..4 {
            sums[lane] += term(j[lane], c[lane]);
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}
