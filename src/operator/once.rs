//! The engine for operators that need one pass: weights of pairs, made row by row, stored in a [`Matrix`] or applied as
//! they are made.
//!
//! The coefficient g_ab = V_a V_b w_ab is symmetric to the bit, so exchanges cancel exactly before rounding of the row
//! sums. Rows are gathered by their owner in a fixed order.

use super::assembly::{self, Assembly};
use super::matrix::{self, Matrix, Seen, Stretch, row_sum};
use super::normalise::{self, Normals};
use super::table::{self, Fit, Join, Normalise};
use super::{Kappa, apart, consistent, moments, projected, stencils};
use crate::error::Result;
use crate::memory;
use crate::pool::Pool;
use crate::space::{Axes, Row, Scratch};
use crate::sum;
use std::ops::Range;

/// Buffers of one worker for rows of weights.
#[derive(Default)]
pub struct Buffers {
    pairs: assembly::Buffers,
    space: consistent::Space,
    /// That the last row's consistent weights reached.
    order: u32,
}

impl Assembly<'_> {
    /// w_ab of a row, fitted to what the operator fits them to.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn weights<'b>(&self, row: &Row, buffers: &'b mut Buffers) -> Result<&'b [f64]> {
        let Buffers { pairs, space, order } = buffers;
        let w = self.pair_weights(row, pairs)?;
        match self.operator.fit {
            Fit::Polynomials => *order = consistent::fit(self, row, w, space)?,
            Fit::Moments => stencils::fit(self, row, w),
            Fit::None | Fit::Angle(_) => {}
        }
        Ok(w)
    }

    /// The order that consistent weights reach for each particle.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn orders(&self, pool: &Pool) -> Result<Vec<f64>> {
        let mut out = memory::filled("orders", self.volume.len(), 0.0)?;
        self.rows.map(pool, &mut out, |buffers: &mut Buffers, row: Row| {
            self.weights(&row, buffers)?;
            Ok(buffers.order.into())
        })?;
        Ok(out)
    }

    /// h_a Σ_b V_b w_ab (r_b − r_a) for each particle: dimensionless, one component per axis, and 0 for a perfect Laplacian.
    /// `stored`: where coefficients are not those that the assembly makes of a row.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn first_moments(&self, stored: Option<&Matrix>, pool: &Pool) -> Result<Vec<Axes<f64>>> {
        let mut out = memory::filled("first moments", self.volume.len(), [0.0; 3])?;
        self.rows.map(pool, &mut out, |(buffers, made): &mut (Buffers, Vec<f64>), row: Row| {
            let g = match stored {
                Some(matrix) => matrix.coefficients(row.i),
                None => {
                    made.clear();
                    made.extend(self.coefficients(&row, self.weights(&row, buffers)?));
                    made
                }
            };
            let scale = self.rows.h[row.i] / self.volume[row.i];
            let sum = |d: &[f64]| scale * g.iter().zip(d).map(|(g, d)| g * d).sum::<f64>();
            Ok(row.d.map(sum))
        })?;
        Ok(out)
    }

    /// The stored matrix, joined and not normalised yet, and what [`normalise::scale`] needs for that.
    ///
    /// # Errors
    /// `NoMemory`; `Cancelled`.
    pub fn store(&self, pool: &Pool) -> Result<(Matrix, Normals)> {
        let (mut matrix, mut normals) = self.rows(pool)?;
        self.join(&mut matrix, &mut normals, pool)?;
        Ok((matrix, normals))
    }

    /// The rows of the matrix, each by itself, and the local second moment K_a = Σ_b V_b r² w_ab / (2 nu) of each particle,
    /// which is 1 for a perfect Laplacian (Biriukov & Price 2019), and beyond.
    ///
    /// # Errors
    /// `NoMemory`; `Cancelled`.
    pub fn rows(&self, pool: &Pool) -> Result<(Matrix, Normals)> {
        let n = self.volume.len();
        let length = matrix::length(n, pool);
        let mut stretches = memory::reserved("matrix", n.div_ceil(length))?;
        let mut normals = Normals {
            moments: memory::reserved("second moments", n)?,
            tensors: memory::reserved("second moments", if self.turns_pairs() { n } else { 0 })?,
            paired: memory::reserved("rows", if self.may_pair() { n } else { 0 })?,
            defect: None,
        };
        let stretch = |space: &mut Workspace, s: usize| self.stretch(space, s * length..((s + 1) * length).min(n));
        for made in pool.map_init(n.div_ceil(length), Workspace::default, stretch) {
            let (stretch, k) = made?;
            stretches.push(stretch);
            normals.moments.extend_from_slice(&k.moments);
            normals.tensors.extend_from_slice(&k.tensors);
            normals.paired.extend_from_slice(&k.paired);
        }
        Ok((Matrix::new(n, length, stretches), normals))
    }

    /// What the operator does to all rows together.
    ///
    /// # Errors
    /// `NoMemory`; `Cancelled`.
    pub fn join(&self, matrix: &mut Matrix, normals: &mut Normals, pool: &Pool) -> Result<()> {
        match self.operator.join {
            Join::Projection => {
                if matches!(self.operator.fit, Fit::Moments) {
                    self.symmetrise(matrix, pool)?;
                    *normals = moments::normals(self, matrix, pool)?;
                }
                normalise::scale(self, matrix, normals, pool)?;
                projected::project(self, matrix, pool)?;
                let unmet = moments::conduction(self, matrix, pool)?;
                let defect = Some(sum::rms(pool, unmet.len(), |_| 1.0, |i| unmet[i]));
                *normals = Normals { defect, ..moments::normals(self, matrix, pool)? };
            }
            Join::Pairs if normals.paired.contains(&true) => {
                self.pair_up(matrix, &normals.paired, pool)?;
                let paired = std::mem::take(&mut normals.paired);
                *normals = Normals { paired, ..moments::normals(self, matrix, pool)? };
            }
            _ => {}
        }
        Ok(())
    }

    /// Normalises what [`Assembly::store`] made, where that is not done yet.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn normalise(&self, matrix: &mut Matrix, normals: &Normals, pool: &Pool) -> Result<()> {
        if self.operator.is_projected() { Ok(()) } else { normalise::scale(self, matrix, normals, pool) }
    }

    fn may_pair(&self) -> bool {
        self.operator.join == Join::Pairs
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
        matrix.symmetrise(Some(&apart::of(self.rows, matrix.length(), self.rows.largest(), pool)?), pool)
    }

    /// As [`Matrix::apply`], with weights that are made for this one application and not kept: the same bits.
    ///
    /// # Errors
    /// `NoMemory` for a row that does not fit.
    pub fn apply(
        &self,
        pool: &Pool,
        kappa: Kappa,
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

    fn stretch(&self, space: &mut Workspace, range: Range<usize>) -> Result<(Stretch, Normals)> {
        let first = range.start;
        let Workspace { scratch, buffers, seen, pairs } = space;
        // Made in place, in as much room as the last stretch took: a copy would cost as much as the weights themselves.
        let mut col = memory::reserved("matrix columns", *pairs)?;
        let mut coef = memory::reserved("matrix coefficients", *pairs)?;
        let mut start = memory::reserved("matrix rows", range.len() + 1)?;
        let mut normals = Normals {
            moments: memory::reserved("second moments", range.len())?,
            tensors: memory::reserved("second moments", if self.turns_pairs() { range.len() } else { 0 })?,
            paired: memory::reserved("rows", if self.may_pair() { range.len() } else { 0 })?,
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
            if self.may_pair() {
                normals.paired.push(buffers.order == 0);
            }
            start.push(col.len() as u32);
            Ok(())
        })?;
        *pairs = col.len() + col.len() / 64;
        Ok((Stretch::new(self.volume.len(), first, start, col, coef, seen)?, normals))
    }
}

#[derive(Default)]
struct Workspace {
    scratch: Scratch,
    buffers: Buffers,
    seen: Seen,
    /// Room for the pairs of a stretch.
    pairs: usize,
}
