//! Whether an operator that is not symmetric has growing modes: the largest real part in its spectrum, by Arnoldi's
//! method (Arnoldi 1951; Saad 2011, chapter 6).

use super::spectrum::start;
use crate::error::{Error, Result};
use crate::memory;
use crate::pool::{BLOCK, Pool};
use crate::sum;
use nalgebra::{Complex, DMatrix, DVector, linalg::Schur};

/// Applications of the operator. A mode that grows by a hundredth of the fastest rate stands out after them by e^8.
const APPLICATIONS: usize = 40;

/// What is left of a vector outside a space, below which it is rounding.
const SPANNED: f64 = 1e-12;

/// How often the search starts again, and the growth, and change of it, in units of the fastest rate, that end it.
const RESTARTS: usize = 8;
const SETTLED: f64 = 1e-4;

/// What is left of a uniform mode's rate, of the fastest one, where it is rounding.
const STILL: f64 = 1e-10;

/// The largest real part among the Ritz values of an operator, in its own unit, and the largest modulus beside it. Where
/// something seems to grow, the search starts again from its Ritz vector: Ritz values of operators that are far from normal
/// stand right of all eigenvalues at first.
///
/// `weight` are capacities, 0 for particles that do not take part; `apply` sets its second argument to the operator
/// times its first.
///
/// # Errors
/// Those of `apply`; `NotFinite` where it leaves no finite numbers; `NoMemory` for [`APPLICATIONS`] vectors.
pub fn rightmost(
    pool: &Pool,
    weight: &[f64],
    mut apply: impl FnMut(&[f64], &mut [f64]) -> Result<()>,
) -> Result<(f64, f64)> {
    let mut space = Space::new(pool, weight, start(weight)?, &mut apply)?;
    let (mut growth, mut fastest) = space.extremes()?;
    for _ in 0..RESTARTS {
        if growth <= SETTLED * fastest {
            break;
        }
        let Some(vector) = space.ritz_vector(pool)? else { break };
        space = Space::new(pool, weight, vector, &mut apply)?;
        let (now, modulus) = space.extremes()?;
        let before = std::mem::replace(&mut growth, now);
        fastest = fastest.max(modulus);
        if (growth - before).abs() <= SETTLED * fastest {
            break;
        }
    }
    // What is the same everywhere stays as it is in a closed system: a mode that is known, though its Ritz value be late.
    let mut rate = memory::filled("a uniform mode", weight.len(), 0.0)?;
    let uniform = memory::collected("a uniform mode", weight.iter().map(|&w| f64::from(w > 0.0)))?;
    apply(&uniform, &mut rate)?;
    let stays = norm(pool, weight, &rate) <= STILL * fastest * norm(pool, weight, &uniform);
    Ok((if stays { growth.max(0.0) } else { growth }, fastest))
}

fn norm(pool: &Pool, weight: &[f64], v: &[f64]) -> f64 {
    sum::sum(pool, v.len(), |i| weight[i] * v[i] * v[i]).sqrt()
}

/// A Krylov space, and the operator on it.
struct Space {
    basis: Vec<Vec<f64>>,
    hessenberg: DMatrix<f64>,
}

impl Space {
    fn new(
        pool: &Pool,
        weight: &[f64],
        mut next: Vec<f64>,
        apply: &mut impl FnMut(&[f64], &mut [f64]) -> Result<()>,
    ) -> Result<Space> {
        let mut basis: Vec<Vec<f64>> = Vec::new();
        let mut hessenberg = DMatrix::<f64>::zeros(APPLICATIONS + 1, APPLICATIONS);
        let mut length = norm(pool, weight, &next);
        for k in 0..APPLICATIONS {
            if !length.is_finite() {
                return Err(Error::NotFinite { what: "the spectrum of the operator".into(), index: 0, value: length });
            }
            // Nobody takes part.
            if length == 0.0 {
                break;
            }
            if k > 0 {
                hessenberg[(k, k - 1)] = length;
            }
            pool.update(&mut next, |_, part| part.iter_mut().for_each(|v| *v /= length));
            basis.push(memory::copied("Krylov space", &next)?);
            apply(&basis[k], &mut next)?;
            // Twice, because rounding of the first time leaves something.
            for _ in 0..2 {
                let shares = take_out(pool, weight, &basis, &mut next);
                shares.iter().enumerate().for_each(|(j, share)| hessenberg[(j, k)] += share);
            }
            length = norm(pool, weight, &next);
            // The vectors so far span all that the operator can reach.
            if length <= SPANNED * hessenberg.column(k).norm() {
                break;
            }
        }
        let hessenberg = hessenberg.view((0, 0), (basis.len(), basis.len())).into_owned();
        Ok(Space { basis, hessenberg })
    }

    /// The largest real part and the largest modulus among the Ritz values.
    fn extremes(&self) -> Result<(f64, f64)> {
        let values = self.values()?;
        let fold = |of: fn(f64, f64) -> f64, start| values.iter().map(|v| of(v.re, v.im)).fold(start, f64::max);
        if values.is_empty() {
            Ok((0.0, 0.0))
        } else {
            Ok((fold(|re, _| re, f64::NEG_INFINITY), fold(f64::hypot, 0.0)))
        }
    }

    fn values(&self) -> Result<Vec<Complex<f64>>> {
        match self.hessenberg.nrows() {
            0 => return Ok(Vec::new()),
            // Schur's form wants two.
            1 => return Ok(vec![self.hessenberg[(0, 0)].into()]),
            _ => {}
        }
        let Some(schur) = Schur::try_new(self.hessenberg.clone(), f64::EPSILON, 100 * APPLICATIONS) else {
            return Err(Error::NotFinite { what: "the spectrum of the operator".into(), index: 0, value: f64::NAN });
        };
        Ok(schur.complex_eigenvalues().iter().copied().collect())
    }

    /// The real part of the vector that belongs to the rightmost Ritz value, by inverse iteration; none where that fails.
    fn ritz_vector(&self, pool: &Pool) -> Result<Option<Vec<f64>>> {
        let values = self.values()?;
        let Some(value) = values.iter().copied().max_by(|a, b| a.re.total_cmp(&b.re)) else { return Ok(None) };
        let n = self.hessenberg.nrows();
        let beside = value + Complex::from(1e-10 * self.hessenberg.norm());
        let shifted = self.hessenberg.map(Complex::from) - DMatrix::from_diagonal_element(n, n, beside);
        let lu = shifted.lu();
        let mut y = DVector::from_element(n, Complex::from(1.0));
        for _ in 0..2 {
            let Some(solved) = lu.solve(&y) else { return Ok(None) };
            let length = solved.norm();
            y = solved.map(|v| v / length);
        }
        if y.iter().any(|v| !v.re.is_finite()) {
            return Ok(None);
        }
        let mut vector = memory::filled("Krylov space", self.basis[0].len(), 0.0)?;
        pool.chunks(&mut vector, BLOCK, |at, part| {
            for (share, b) in y.iter().zip(&self.basis) {
                part.iter_mut().zip(&b[at..]).for_each(|(v, b)| *v += share.re * b);
            }
        });
        Ok(Some(vector))
    }
}

/// Takes out of a vector what it has of an orthonormal basis, and answers how much of each: classical Gram and Schmidt, all
/// vectors in one sweep.
fn take_out(pool: &Pool, weight: &[f64], basis: &[Vec<f64>], vector: &mut [f64]) -> Vec<f64> {
    let from = &*vector;
    let of_block = |block: usize| {
        let part = block * BLOCK..((block + 1) * BLOCK).min(from.len());
        let share = |b: &Vec<f64>| sum::product(&weight[part.clone()], &b[part.clone()], &from[part.clone()]);
        basis.iter().map(share).collect::<Vec<_>>()
    };
    let parts = pool.map(vector.len().div_ceil(BLOCK), of_block);
    let shares: Vec<f64> = (0..basis.len()).map(|j| parts.iter().map(|part| part[j]).sum()).collect();
    pool.chunks(vector, BLOCK, |at, part| {
        for (share, b) in shares.iter().zip(basis) {
            part.iter_mut().zip(&b[at..]).for_each(|(v, b)| *v -= share * b);
        }
    });
    shares
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_mode_that_grows() {
        // Decay rates spread over (0, 1] on the diagonal, one pair that turns and grows: 0.02 ± 0.3 i.
        let (n, pool) = (400, Pool::new(1).unwrap());
        for growth in [0.02, -0.02] {
            let apply = |x: &[f64], y: &mut [f64]| {
                (0..n).for_each(|i| y[i] = -(i as f64 + 20.0) / 420.0 * x[i]);
                (y[0], y[1]) = (growth * x[0] - 0.3 * x[1], 0.3 * x[0] + growth * x[1]);
                Ok(())
            };
            let (real, modulus) = rightmost(&pool, &vec![1.0; n], apply).unwrap();
            // Slowly decaying modes stand at -0.05: the pair is right of them, and found to the digits that it stands out by.
            assert!((real - growth).abs() < 1e-4, "{real} {growth}");
            assert!((0.99..1.0).contains(&modulus), "{modulus}");
        }
    }

    #[test]
    fn what_is_the_same_everywhere_stays() {
        // Of a graph whose rows sum to 0, with capacities from 1 to 1e6, the mode of 0 is late: it is known all the same.
        let (n, pool) = (400usize, Pool::new(1).unwrap());
        let weight: Vec<f64> = (0..n).map(|i| 10f64.powf(6.0 * i as f64 / n as f64)).collect();
        let apply = |loss: f64| {
            let weight = &weight;
            move |x: &[f64], y: &mut [f64]| {
                (0..n)
                    .for_each(|i| y[i] = (x[(i + 1) % n] + x[(i + n - 1) % n] - 2.0 * x[i]) / weight[i] - loss * x[i]);
                Ok(())
            }
        };
        let (growth, _) = rightmost(&pool, &weight, apply(0.0)).unwrap();
        assert!((0.0..1e-9).contains(&growth), "{growth:e}");
        // Where something leaks it is not there.
        let (growth, _) = rightmost(&pool, &weight, apply(0.5)).unwrap();
        assert!(growth < -0.4, "{growth:e}");
    }

    #[test]
    fn a_space_that_closes_early_is_enough() {
        let pool = Pool::new(1).unwrap();
        let halve = |x: &[f64], y: &mut [f64]| {
            y.iter_mut().zip(x).for_each(|(y, x)| *y = -0.5 * x);
            Ok(())
        };
        let (real, modulus) = rightmost(&pool, &[1.0, 2.0, 0.0], halve).unwrap();
        assert!((real + 0.5).abs() < 1e-12 && (modulus - 0.5).abs() < 1e-12);
        assert_eq!(rightmost(&pool, &[], halve).unwrap(), (0.0, 0.0));
    }
}
