//! The engine for operators that need one pass: weights of pairs, made row by row, stored in a [`Matrix`] or applied as
//! they are made.
//!
//! The coefficient g_ab = V_a V_b w_ab is symmetric to the bit, so exchanges cancel exactly before rounding of the row
//! sums. Rows are gathered by their owner in a fixed order.

use super::matrix::{Block, Matrix, Seen, row_sum};
use super::table::Tensor;
use super::tensor::{self, Sym};
use super::twice::Twice;
use super::{Mean, Operator, consistent, moments, projected, stencils};
use crate::error::Result;
use crate::kernel::Kernel;
use crate::memory;
use crate::pool::{BLOCK, Pool};
use crate::space::{Row, Scratch, rows::Rows};

/// What a row of weights is made from.
#[derive(Clone, Copy)]
pub struct Assembly<'a> {
    pub operator: &'static Operator,
    pub kernel: &'a Kernel,
    pub rows: &'a Rows<'a>,
    /// Volumes m/rho in internal order.
    pub volume: &'a [f64],
    /// One kernel evaluation per pair: every h is the same.
    pub same_h: bool,
    /// Of polynomials that consistent weights are exact for: 2, 4 or 6.
    pub order: u32,
    /// Take consistent weights as they come, with modes that grow.
    pub any_row: bool,
    /// How each particle conducts by direction, trace nu; none where all are isotropic.
    pub shape: Option<&'a [Sym]>,
}

/// Buffers of one worker for rows of weights.
#[derive(Default)]
pub struct Buffers {
    q: Vec<f64>,
    w: Vec<f64>,
    other: Vec<f64>,
    spare: Vec<f64>,
    space: consistent::Space,
    /// That the last row's consistent weights reached.
    pub order: u32,
}

impl Assembly<'_> {
    /// w_ab of a row, symmetrised: the mean of the weights with h_a and with h_b, units 1/length^(nu + 2).
    pub fn weights<'b>(&self, row: &Row, buffers: &'b mut Buffers) -> Result<&'b [f64]> {
        let n = row.len();
        buffers.reserve(n)?;
        let Buffers { q, w, other, spare, space, order } = buffers;
        let (q, w, other, spare) = (&mut q[..n], &mut w[..n], &mut other[..n], &mut spare[..n]);
        let power = self.kernel.dim() as i32 + 2;
        let h = self.rows.h;
        let own = 1.0 / h[row.i];
        q.iter_mut().zip(row.r).for_each(|(q, r)| *q = r * own);
        (self.operator.weight)(self.kernel, q, w, spare);
        let scale = own.powi(power);
        w.iter_mut().for_each(|w| *w *= scale);
        if matches!(self.operator.tensor, Tensor::Consistent) {
            *order = consistent::fit(self, row, w, space)?;
            return Ok(w);
        }
        if !self.same_h {
            let inverse = |j: &u32| 1.0 / h[*j as usize];
            q.iter_mut().zip(row.r).zip(row.j).for_each(|((q, r), j)| *q = r * inverse(j));
            (self.operator.weight)(self.kernel, q, other, spare);
            for ((w, other), j) in w.iter_mut().zip(other).zip(row.j) {
                *w = 0.5 * (*w + *other * inverse(j).powi(power));
            }
        }
        match (self.operator.tensor, self.shape) {
            (Tensor::Angular(factor), Some(shape)) => self.turn(row, shape, factor, w),
            (Tensor::Stencils, _) => stencils::fit(self, row, w),
            _ => {}
        }
        Ok(w)
    }

    /// Multiplies weights by the angular factor of the mean of both particles' tensors. Coincident particles have no
    /// direction: theirs is the isotropic weight.
    fn turn(&self, row: &Row, shape: &[Sym], factor: fn(f64, f64) -> f64, w: &mut [f64]) {
        let nu = self.kernel.dim() as f64;
        for (k, (w, &j)) in w.iter_mut().zip(row.j).enumerate() {
            let e = row.direction(k);
            if e != [0.0; 3] {
                let along = 0.5 * (tensor::along(&shape[row.i], e) + tensor::along(&shape[j as usize], e));
                *w *= factor(along, nu);
            }
        }
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
        let mut matrix = Matrix::new(n, blocks);
        match self.operator.tensor {
            Tensor::Stencils => {
                matrix.symmetrise(pool)?;
                matrix.normalise(pool, &moments::second(self, &matrix, pool)?)?;
                projected::project(self, &mut matrix, pool)?;
            }
            Tensor::Projected => {
                matrix.normalise(pool, &moments)?;
                projected::project(self, &mut matrix, pool)?;
            }
            _ => return Ok((matrix, moments)),
        }
        moments = moments::second(self, &matrix, pool)?;
        Ok((matrix, moments))
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
    pub fn coefficients<'b>(&'b self, row: &'b Row, w: &'b [f64]) -> impl Iterator<Item = f64> + 'b {
        let (volume, own) = (self.volume, self.volume[row.i]);
        row.j.iter().zip(w).map(move |(&j, w)| (own * volume[j as usize]) * w)
    }

    fn block(&self, space: &mut Workspace, b: usize) -> Result<(Block, Vec<f64>)> {
        let range = b * BLOCK..((b + 1) * BLOCK).min(self.volume.len());
        let Workspace { scratch, buffers, seen, pairs } = space;
        // Made in place, in as much room as the last block took: a copy would cost as much as the weights themselves.
        let mut col = memory::reserved("matrix columns", *pairs)?;
        let mut coef = memory::reserved("matrix coefficients", *pairs)?;
        let mut start = memory::reserved("matrix rows", range.len() + 1)?;
        let mut k = memory::reserved("second moments", range.len())?;
        let mut failed = Ok(());
        let dim = self.kernel.dim() as f64;
        start.push(0);
        self.rows.visit(range, scratch, |row| {
            let w = match self.weights(&row, buffers) {
                Ok(w) if col.try_reserve(row.len()).is_ok() && coef.try_reserve(row.len()).is_ok() => w,
                Ok(_) => return failed = Err(memory::no_memory::<(u32, f64)>("matrix", row.len())),
                Err(e) => return failed = Err(e),
            };
            let from = col.len();
            col.extend_from_slice(row.j);
            coef.extend(self.coefficients(&row, w));
            k.push(moments::of_row(&coef[from..], row.r) / (2.0 * dim * self.volume[row.i]));
            start.push(col.len() as u32);
        })?;
        failed?;
        *pairs = col.len() + col.len() / 64;
        Ok((Block::new(self.volume.len(), b, start, col, coef, seen)?, k))
    }
}

#[derive(Default)]
struct Workspace {
    scratch: Scratch,
    buffers: Buffers,
    seen: Seen,
    /// Room for the pairs of a block.
    pairs: usize,
}

impl Buffers {
    fn reserve(&mut self, n: usize) -> Result<()> {
        for v in [&mut self.q, &mut self.w, &mut self.other, &mut self.spare] {
            memory::extended("a row of weights", v, n, 0.0)?;
        }
        Ok(())
    }
}

/// Pair sums, from stored weights or from weights made on the way.
#[derive(Clone, Copy)]
pub enum Pairs<'a> {
    Stored(&'a Matrix),
    Fresh(&'a Assembly<'a>),
    /// Two sweeps, over the pairs of a matrix.
    Twice(&'a Twice, &'a Matrix),
}
