//! Whether kernels see what is around particles: a look at some of them.
//!
//! Where spacing differs much by direction, supports may end before the next neighbour in one of them. A particle then
//! conducts nothing there, as one of a thin body rightly does; but volumes that were given overfill the support, and
//! densities that are summed are those of what is near alone.

use super::state::{Input, State};
use crate::error::{Error, Result};
use crate::memory;
use crate::model::fields;
use crate::operator::{Matrix, Normalise, tensor};
use crate::space::{Row, Scratch, rows::Rows};
use crate::sum;
use nalgebra::Matrix3;

/// Particles that are looked at.
const SAMPLE: usize = 1024;
/// Fewest that say anything.
const FEWEST: usize = 10;

/// What a direction has less of than others where it is hardly seen: of Σ V W d², relative to the largest. Poisson clouds have
/// 0.5 at the median and less than 0.3 at 4 to 16 % of the particles, as lattices squeezed 3:1 have in 2-D; squeezed 4:1, and
/// 3:1 in 3-D, 30 to 100 %, and summed densities are then off by a fifth and more.
const THIN: f64 = 0.3;
const MOST_THIN: f64 = 0.2;
/// The same at the median of sheets and strings: 0 to 0.04 with one layer and 30 % jitter, 0.5 with two.
const FLAT: f64 = 0.15;
/// What a particle conducts at least in its worst direction, and by how much more than fill it its neighbours' volumes may.
/// Both are missed by 0 to 2 % of Poisson clouds and others with noise, by 9 to 90 % of lattices squeezed 6:1 and more, and by
/// 6 % of particles graded 10:1 along each axis, whose modes converge all the same.
const CONDUCTS: f64 = 0.3;
const OVERFULL: f64 = 1.1;
const MOST_LACKING: f64 = 0.08;

/// What one particle sees.
struct Seen {
    i: usize,
    /// The least of Σ V W d² over directions, relative to the largest.
    roundness: f64,
    /// Σ V W
    filled: f64,
    /// The least of Σ V w d²/2 over directions, w the operator's weights: 1 where it is right.
    conducts: f64,
}

impl State {
    /// Refuses clouds in which kernels do not reach the neighbours in every direction that there is.
    pub(super) fn refuse_what_is_not_seen(&self, matrix: &Matrix) -> Result<()> {
        let summed = self.inputs[fields::RHO] == Input::Unset;
        let isotropic = self.directions.as_ref().is_none_or(|d| d.shape.is_empty());
        let by_tensor = self.choices.normalise == Normalise::Tensor && self.choices.operator.is_one_matrix();
        let tensor = by_tensor && isotropic;
        let insisted = self.choices.allow.volumes || self.choices.allow.flat;
        let thick = self.needs_thickness();
        if self.dim() == 1 || self.len() < FEWEST || !(thick || ((summed || tensor) && !insisted)) {
            return Ok(());
        }
        let seen = self.with_rows(|rows| self.look_around(rows, matrix))?;
        if thick && median(seen.iter().map(|s| s.roundness)) < FLAT {
            return Err(self.too_thin("one direction"));
        }
        if insisted {
            return Ok(());
        }
        let worst = seen.iter().min_by(|a, b| a.roundness.total_cmp(&b.roundness));
        let thin = share(&seen, |s| s.roundness < THIN);
        if let Some(worst) = worst.filter(|_| summed && thin > MOST_THIN) {
            let value = format!(
                "summed over neighbours that leave a direction empty, as {:.0} % of the particles do",
                100.0 * thin
            );
            let rule = "it is a fifth and more off there: give rho, or a larger h_fac where spacing differs by direction, or \
                        insist with allow=volumes";
            return Err(Error::bad_at("rho", self.host(worst.i), value, rule));
        }
        let lacks = |s: &Seen| s.conducts < CONDUCTS && s.filled > OVERFULL;
        let lacking = share(&seen, lacks);
        if let Some(first) = seen.iter().find(|s| lacks(s)).filter(|_| tensor && !summed && lacking > MOST_LACKING) {
            let value = format!("too short, as that of {:.0} % of the particles", 100.0 * lacking);
            let rule = format!(
                "in one direction it has hardly a neighbour, though volumes m/rho reach that far, and conducts {:.2} of what it \
                 should: give a larger h_fac, h, or more particles, or insist with allow=volumes",
                first.conducts.max(0.0)
            );
            return Err(Error::bad_at("h", self.host(first.i), value, &rule));
        }
        Ok(())
    }

    fn look_around(&self, rows: &Rows, matrix: &Matrix) -> Result<Vec<Seen>> {
        let volume = self.geometry.as_ref().map_or(&[][..], |g| &g.volume);
        let (n, kernel) = (self.len(), &self.choices.kernel);
        let count = n.min(SAMPLE);
        let one = |k: usize| {
            let (i, mut seen) = (k * n / count, None);
            rows.visit(i..i + 1, &mut Scratch::default(), |row| {
                let h = rows.h[i];
                let q = memory::collected("a sample", row.r.iter().map(|r| r / h))?;
                let mut w = memory::filled("a sample", q.len(), 0.0)?;
                kernel.w(&q, &mut w);
                let unit = h.powi(-(kernel.dim() as i32));
                w.iter_mut().zip(row.j).for_each(|(w, &j)| *w *= volume[j as usize] * unit);
                let (least, most) = extremes(&row, kernel.dim(), &w);
                let scale = 0.5 / volume[i];
                seen = Some(Seen {
                    i,
                    roundness: if most > 0.0 { least / most } else { 0.0 },
                    filled: volume[i] * unit * kernel.w_at(0.0) + w.iter().sum::<f64>(),
                    conducts: scale * extremes(&row, kernel.dim(), matrix.coefficients(i)).0,
                });
                Ok(())
            })?;
            Ok(seen)
        };
        let seen: Result<Vec<Option<Seen>>> = self.pool.map(count, one).into_iter().collect();
        Ok(seen?.into_iter().flatten().collect())
    }
}

/// The least and the largest of Σ weight d² over directions.
fn extremes(row: &Row, dim: usize, weight: &[f64]) -> (f64, f64) {
    let mut second = Matrix3::zeros();
    for [k, l] in tensor::AXES.into_iter().filter(|[_, l]| *l < dim) {
        let sum = sum::product(weight, row.d[k], row.d[l]);
        (second[(k, l)], second[(l, k)]) = (sum, sum);
    }
    match dim {
        2 => both(second.fixed_view::<2, 2>(0, 0).symmetric_eigenvalues().as_slice()),
        _ => both(second.symmetric_eigenvalues().as_slice()),
    }
}

fn both(values: &[f64]) -> (f64, f64) {
    (values.iter().copied().fold(f64::INFINITY, f64::min), values.iter().copied().fold(0.0, f64::max))
}

fn share(seen: &[Seen], of: impl Fn(&Seen) -> bool) -> f64 {
    seen.iter().filter(|s| of(s)).count() as f64 / seen.len().max(1) as f64
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}
