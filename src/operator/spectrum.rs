//! How fast an assembled operator can act: bounds on its largest eigenvalue, from which step limits follow.

use crate::error::Result;
use crate::memory;
use crate::pool::Pool;
use crate::sum;

/// Both methods approach from below; this factor covers what is left after they stop. Power iteration had reached 0.92 or
/// more of the largest eigenvalue on lattices and 20 to 100 % jitter, 2-D and 3-D, M4, M6 and C4 (Gershgorin: 1.4 to 1.8),
/// and once 0.88 where spacing is graded; Lanczos' method, of the same cost, 0.98 or more of all these.
const SAFETY: f64 = 1.1;
const SAFETY_OF_LANCZOS: f64 = 1.05;
const MOST: usize = 100;
const LEAST: usize = 16;
/// Growth per iteration below which it stops.
const SETTLED: f64 = 3e-3;
/// And Lanczos' method, over so many iterations: it may rest for a while before it finds a mode of few particles.
const RESTED: usize = 6;

/// An upper bound on the largest |eigenvalue| of A = C⁻¹ L, some per cent above an estimate, but never more than
/// `gershgorin`, which is a proven bound. `symmetric`: A is, in the norm Σ C x²; of others only power iteration can tell.
///
/// `weight` is C with 0 for particles that do not take part; `apply` sets its second argument to A times its first.
pub fn largest(
    pool: &Pool,
    weight: &[f64],
    gershgorin: f64,
    symmetric: bool,
    apply: impl FnMut(&[f64], &mut [f64]) -> Result<()>,
) -> Result<f64> {
    let estimate = match symmetric {
        true => SAFETY_OF_LANCZOS * lanczos(pool, weight, gershgorin, apply)?,
        false => SAFETY * estimate(pool, weight, MOST, apply)?,
    };
    Ok(if estimate.is_finite() { gershgorin.min(estimate) } else { gershgorin })
}

/// Lanczos' method (1950): A on the space of x, A x, A² x, … is tridiagonal, and the ends of its spectrum are found first.
fn lanczos(
    pool: &Pool,
    weight: &[f64],
    gershgorin: f64,
    mut apply: impl FnMut(&[f64], &mut [f64]) -> Result<()>,
) -> Result<f64> {
    let n = weight.len();
    let array = || memory::filled("Lanczos' method", n, 0.0);
    let (mut x, mut y, mut before) = (start(weight)?, array()?, array()?);
    // In units in which nothing over- or underflows.
    let most = sum::max(pool, n, |i| weight[i]);
    let product = |x: &[f64], y: &[f64]| sum::sum(pool, n, |i| (weight[i] / most) * x[i] * y[i]);
    let length = product(&x, &x).sqrt();
    if !(length > 0.0 && length.is_finite()) {
        return Ok(0.0);
    }
    pool.update(&mut x, |_, part| part.iter_mut().for_each(|x| *x /= length));
    let (mut unit, mut found) = (gershgorin, Tridiagonal::default());
    let mut estimates = Vec::with_capacity(MOST);
    for iteration in 0..MOST {
        apply(&x, &mut y)?;
        if !unit.is_finite() {
            unit = sum::max(pool, n, |i| y[i].abs());
        }
        if unit == 0.0 || unit.is_nan() {
            return Ok(0.0);
        }
        let off = found.off.last().copied().unwrap_or(0.0);
        pool.update(&mut y, |start, part| {
            part.iter_mut().enumerate().for_each(|(k, y)| *y = *y / unit - off * before[start + k]);
        });
        let centre = product(&x, &y);
        pool.update(&mut y, |start, part| {
            part.iter_mut().enumerate().for_each(|(k, y)| *y -= centre * x[start + k]);
        });
        let next = product(&y, &y).sqrt();
        found.diagonal.push(centre);
        estimates.push(found.largest());
        let estimate = estimates[iteration];
        let rested = iteration >= RESTED && estimate - estimates[iteration - RESTED] <= SETTLED * estimate;
        // Nothing is left outside the space that was searched.
        if (rested && iteration >= LEAST) || next <= f64::EPSILON * estimate || next.is_nan() {
            break;
        }
        found.off.push(next);
        pool.update(&mut y, |_, part| part.iter_mut().for_each(|y| *y /= next));
        std::mem::swap(&mut before, &mut x);
        std::mem::swap(&mut x, &mut y);
    }
    Ok(unit * estimates.last().copied().unwrap_or(0.0))
}

/// A symmetric tridiagonal matrix.
#[derive(Default)]
struct Tridiagonal {
    diagonal: Vec<f64>,
    off: Vec<f64>,
}

impl Tridiagonal {
    /// The largest |eigenvalue|, by bisection.
    fn largest(&self) -> f64 {
        let off = |k: usize| self.off.get(k).copied().unwrap_or(0.0).abs();
        let row = |k: usize| self.diagonal[k].abs() + off(k) + if k > 0 { off(k - 1) } else { 0.0 };
        let (mut low, mut high) = (0.0, (0..self.diagonal.len()).map(row).fold(0.0, f64::max));
        while high - low > 1e-6 * high {
            let middle = 0.5 * (low + high);
            if self.exceeds(middle) { low = middle } else { high = middle }
        }
        high
    }

    /// Whether an eigenvalue lies beyond ±bound: a pivot of bound ∓ T is not positive (Sylvester's law of inertia).
    fn exceeds(&self, bound: f64) -> bool {
        [1.0, -1.0].iter().any(|sign| {
            let mut pivot = 1.0;
            self.diagonal.iter().enumerate().any(|(k, diagonal)| {
                let off = if k > 0 { self.off[k - 1] } else { 0.0 };
                pivot = bound - sign * diagonal - off * off / pivot;
                pivot <= 0.0
            })
        })
    }
}

/// The largest |eigenvalue| by power iteration, from at most so many applications: from below, and 0 where nothing is coupled.
pub fn estimate(
    pool: &Pool,
    weight: &[f64],
    most: usize,
    mut apply: impl FnMut(&[f64], &mut [f64]) -> Result<()>,
) -> Result<f64> {
    let n = weight.len();
    let mut x = start(weight)?;
    let mut y = memory::filled("power iteration", n, 0.0)?;
    let norm = |v: &[f64]| {
        let largest = sum::max(pool, n, |i| v[i].abs());
        if largest > 0.0 && largest.is_finite() { Some(largest) } else { None }
    };
    let length2 = |v: &[f64], by: f64| sum::sum(pool, n, |i| weight[i] * (v[i] / by) * (v[i] / by));
    let mut estimate = 0.0;
    for iteration in 0..most {
        apply(&x, &mut y)?;
        let (Some(size_x), Some(size_y)) = (norm(&x), norm(&y)) else { break };
        // Scaled by the largest element, so that no unit system over- or underflows.
        let next = (length2(&y, size_y) / length2(&x, size_x)).sqrt() * (size_y / size_x);
        pool.update(&mut y, |_, part| part.iter_mut().for_each(|v| *v /= size_y));
        std::mem::swap(&mut x, &mut y);
        let settled = (next - estimate).abs() <= SETTLED * next;
        estimate = next;
        if settled && iteration >= LEAST {
            break;
        }
    }
    Ok(estimate)
}

/// A start vector that is rich in the fastest modes and the same on every machine: signs and sizes from a hash; 0 for what
/// does not take part.
///
/// # Errors
/// `NoMemory`.
pub(super) fn start(weight: &[f64]) -> Result<Vec<f64>> {
    let hashed = |i: usize| {
        let mixed = (i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let bits = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 11;
        bits as f64 / (1u64 << 52) as f64 - 1.0
    };
    memory::collected("Krylov space", weight.iter().enumerate().map(|(i, &w)| if w > 0.0 { hashed(i) } else { 0.0 }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_the_spectrum_of_a_chain() {
        // The periodic second difference on 64 points: eigenvalues 2 − 2 cos k, the largest is 4.
        let (n, pool) = (64, Pool::new(1).unwrap());
        for scale in [1.0, 1e-150, 1e150] {
            let apply = |x: &[f64], y: &mut [f64]| {
                (0..n).for_each(|i| y[i] = scale * (x[(i + 1) % n] + x[(i + n - 1) % n] - 2.0 * x[i]));
                Ok(())
            };
            for symmetric in [true, false] {
                let bound = largest(&pool, &vec![1.0; n], f64::INFINITY, symmetric, apply).unwrap() / scale;
                assert!((4.0..=4.4).contains(&bound), "{bound}");
                assert_eq!(largest(&pool, &vec![1.0; n], 4.1 * scale, symmetric, apply).unwrap(), 4.1 * scale);
            }
        }
    }

    #[test]
    fn tridiagonal_matrices_have_the_largest_eigenvalue_that_is_known() {
        // −2 and 1: eigenvalues −2 + 2 cos(k π / (m + 1)).
        for m in [1, 2, 7, 50] {
            let exact = 2.0 - 2.0 * (f64::from(m) * std::f64::consts::PI / f64::from(m + 1)).cos();
            for sign in [1.0, -1.0] {
                let matrix = Tridiagonal { diagonal: vec![sign * 2.0; m as usize], off: vec![1.0; m as usize - 1] };
                assert!((matrix.largest() / exact - 1.0).abs() < 2e-6, "{m}: {} {exact}", matrix.largest());
            }
        }
        assert_eq!(Tridiagonal::default().largest(), 0.0);
    }

    #[test]
    fn nothing_to_do_is_zero() {
        let pool = Pool::new(1).unwrap();
        let idle = |_: &[f64], y: &mut [f64]| {
            y.fill(0.0);
            Ok(())
        };
        for symmetric in [true, false] {
            assert_eq!(largest(&pool, &[1.0; 5], 0.0, symmetric, idle).unwrap(), 0.0);
            assert_eq!(largest(&pool, &[], 0.0, symmetric, idle).unwrap(), 0.0);
        }
    }
}
