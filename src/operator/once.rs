//! The engine for operators that need one pass: weights of pairs, made row by row, stored in a [`Matrix`] or applied as
//! they are made.
//!
//! The coefficient g_ab = V_a V_b w_ab is symmetric to the bit, so exchanges cancel exactly before rounding of the row
//! sums. Rows are gathered by their owner in a fixed order.

use super::matrix::{Block, Matrix, Seen, row_sum};
use super::normalise::{self, Normalise, Normals};
use super::table::{self, Tensor};
use super::tensor::{self, Sym};
use super::twice::Twice;
use super::{Mean, Operator, apart, consistent, moments, projected, stencils};
use crate::error::Result;
use crate::kernel::Kernel;
use crate::memory;
use crate::pool::{BLOCK, Pool};
use crate::space::{Row, Scratch, rows::Rows};
use crate::sum;

/// What a row of weights is made from.
#[derive(Clone, Copy)]
pub struct Assembly<'a> {
    pub operator: &'static Operator,
    pub normalise: Normalise,
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

    /// The stored matrix, not normalised yet, and what [`normalise::scale`] needs for that: the local second moment
    /// K_a = Σ_b V_b r² w_ab / (2 nu) of each particle, which is 1 for a perfect Laplacian (Biriukov & Price 2019), and
    /// beyond.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn store(&self, pool: &Pool) -> Result<(Matrix, Normals)> {
        let n = self.volume.len();
        let mut blocks = memory::reserved("matrix", n.div_ceil(BLOCK))?;
        let mut normals = Normals {
            moments: memory::reserved("second moments", n)?,
            tensors: memory::reserved("second moments", if self.turns_pairs() { n } else { 0 })?,
            paired: memory::reserved("rows", if self.is_consistent() { n } else { 0 })?,
            defect: None,
        };
        for block in pool.map_init(n.div_ceil(BLOCK), Workspace::default, |space, b| self.block(space, b)) {
            let (block, k) = block?;
            blocks.push(block);
            normals.moments.extend_from_slice(&k.moments);
            normals.tensors.extend_from_slice(&k.tensors);
            normals.paired.extend_from_slice(&k.paired);
        }
        let mut matrix = Matrix::new(n, blocks);
        match self.operator.tensor {
            Tensor::Stencils | Tensor::Projected => {
                if matches!(self.operator.tensor, Tensor::Stencils) {
                    self.symmetrise(&mut matrix, pool)?;
                    normals = moments::normals(self, &matrix, pool)?;
                }
                normalise::scale(self, &mut matrix, &normals, pool)?;
                projected::project(self, &mut matrix, pool)?;
                let unmet = moments::conduction(self, &matrix, pool)?;
                let defect = Some(sum::rms(pool, unmet.len(), |_| 1.0, |i| unmet[i]));
                normals = Normals { defect, ..moments::normals(self, &matrix, pool)? };
            }
            Tensor::Consistent if normals.paired.contains(&true) => {
                self.pair_up(&mut matrix, &normals.paired, pool)?;
                normals = Normals { paired: normals.paired, ..moments::normals(self, &matrix, pool)? };
            }
            _ => {}
        }
        Ok((matrix, normals))
    }

    /// Normalises what [`Assembly::store`] made, where that is not done yet.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn normalise(&self, matrix: &mut Matrix, normals: &Normals, pool: &Pool) -> Result<()> {
        if self.operator.is_projected() { Ok(()) } else { normalise::scale(self, matrix, normals, pool) }
    }

    /// Whether rows are to be normalised by direction.
    pub fn turns_pairs(&self) -> bool {
        self.normalise == Normalise::Tensor && self.kernel.dim() > 1
    }

    fn is_consistent(&self) -> bool {
        matches!(self.operator.tensor, Tensor::Consistent)
    }

    /// Puts normalised pairs into some rows.
    fn pair_up(&self, matrix: &mut Matrix, paired: &[bool], pool: &Pool) -> Result<()> {
        let operator = table::find("brookshaw")?;
        let pairs = Assembly { operator, normalise: Normalise::Tensor, shape: None, ..*self };
        let mut met = memory::filled("rows", paired.len(), false)?;
        for i in (0..paired.len()).filter(|&i| paired[i]) {
            met[i] = true;
            matrix.columns(i).iter().for_each(|&j| met[j as usize] = true);
        }
        let mut tensors = memory::filled("second moments", paired.len(), [0.0; 6])?;
        self.rows.map(pool, &mut tensors, |(buffers, g): &mut (Buffers, Vec<f64>), row: Row| {
            if !met[row.i] {
                return Ok([0.0; 6]);
            }
            memory::extended("a row of weights", g, row.len(), 0.0)?;
            pairs.fill(&row, buffers, &mut g[..row.len()])?;
            Ok(normalise::tensor_of(&pairs, &row, &g[..row.len()]))
        })?;
        matrix.update_rows(
            self.rows,
            pool,
            |i| paired[i],
            |buffers: &mut Buffers, row, g| {
                pairs.fill(row, buffers, g)?;
                normalise::of_row(self.kernel.dim(), row, &tensors, g);
                Ok(())
            },
        )
    }

    /// g_ab of a row.
    fn fill(&self, row: &Row, buffers: &mut Buffers, g: &mut [f64]) -> Result<()> {
        let w = self.weights(row, buffers)?;
        g.iter_mut().zip(self.coefficients(row, w)).for_each(|(g, made)| *g = made);
        Ok(())
    }

    fn symmetrise(&self, matrix: &mut Matrix, pool: &Pool) -> Result<()> {
        if self.rows.nearest::<3>().is_some() {
            return matrix.symmetrise(None, pool);
        }
        matrix.symmetrise(Some(&apart::of(self.rows, self.rows.largest(), pool)?), pool)
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

    fn block(&self, space: &mut Workspace, b: usize) -> Result<(Block, Normals)> {
        let range = b * BLOCK..((b + 1) * BLOCK).min(self.volume.len());
        let Workspace { scratch, buffers, seen, pairs } = space;
        // Made in place, in as much room as the last block took: a copy would cost as much as the weights themselves.
        let mut col = memory::reserved("matrix columns", *pairs)?;
        let mut coef = memory::reserved("matrix coefficients", *pairs)?;
        let mut start = memory::reserved("matrix rows", range.len() + 1)?;
        let mut normals = Normals {
            moments: memory::reserved("second moments", range.len())?,
            tensors: memory::reserved("second moments", if self.turns_pairs() { range.len() } else { 0 })?,
            paired: memory::reserved("rows", if self.is_consistent() { range.len() } else { 0 })?,
            defect: None,
        };
        let dim = self.kernel.dim() as f64;
        start.push(0);
        self.rows.visit(range, scratch, |row| {
            let w = self.weights(&row, buffers)?;
            let from = col.len();
            memory::appended("matrix columns", &mut col, row.j)?;
            memory::room("matrix coefficients", &mut coef, row.len())?;
            coef.extend(self.coefficients(&row, w));
            normals.moments.push(moments::of_row(&coef[from..], row.r) / (2.0 * dim * self.volume[row.i]));
            if self.turns_pairs() {
                normals.tensors.push(normalise::tensor_of(self, &row, &coef[from..]));
            }
            if self.is_consistent() {
                normals.paired.push(buffers.order == 0);
            }
            start.push(col.len() as u32);
            Ok(())
        })?;
        *pairs = col.len() + col.len() / 64;
        Ok((Block::new(self.volume.len(), b, start, col, coef, seen)?, normals))
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
