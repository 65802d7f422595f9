//! What a row of weights is made from: an operator's function of the distance on a row of neighbours, symmetrised and
//! turned. What such rows are fitted to, and how all of them become a matrix, is in [`super::once`].

use super::table::{Fit, Normalise, Operator};
use super::tensor::{self, Sym};
use crate::error::Result;
use crate::kernel::Kernel;
use crate::memory;
use crate::space::{Row, rows::Rows};

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

/// Buffers of one worker for weights of pairs.
#[derive(Default)]
pub struct Buffers {
    q: Vec<f64>,
    w: Vec<f64>,
    other: Vec<f64>,
    spare: Vec<f64>,
}

impl Assembly<'_> {
    /// The operator's own w_ab of a row, units 1/length^(nu + 2): the mean of the weights with h_a and with h_b, times what
    /// the direction of the pair makes of it. Of weights that are exact for polynomials, the one with h_a, which is fitted.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn pair_weights<'b>(&self, row: &Row, buffers: &'b mut Buffers) -> Result<&'b mut [f64]> {
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
        if !self.same_h && !self.operator.is_exact() {
            let inverse = |j: &u32| 1.0 / h[*j as usize];
            q.iter_mut().zip(row.r).zip(row.j).for_each(|((q, r), j)| *q = r * inverse(j));
            (self.operator.weight)(self.kernel, q, other, spare);
            for ((w, other), j) in w.iter_mut().zip(other).zip(row.j) {
                *w = 0.5 * (*w + *other * inverse(j).powi(power));
            }
        }
        if let (Fit::Angle(factor), Some(shape)) = (self.operator.fit, self.shape) {
            self.turn(row, shape, factor, w);
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

    /// g_ab = V_a V_b w_ab of a row.
    pub fn coefficients<'b>(&'b self, row: &'b Row, w: &'b [f64]) -> impl Iterator<Item = f64> + 'b {
        let (volume, own) = (self.volume, self.volume[row.i]);
        row.j.iter().zip(w).map(move |(&j, w)| (own * volume[j as usize]) * w)
    }

    /// Whether rows are to be normalised by direction.
    pub fn turns_pairs(&self) -> bool {
        self.normalise == Normalise::Tensor
    }
}

impl Buffers {
    fn reserve(&mut self, n: usize) -> Result<()> {
        for v in [&mut self.q, &mut self.w, &mut self.other, &mut self.spare] {
            memory::extended("a row of weights", v, n, 0.0)?;
        }
        Ok(())
    }
}
