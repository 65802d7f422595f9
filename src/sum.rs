//! Sums, norms and extrema over particles that are the same to the bit for any number of threads: fixed blocks, each
//! added up in order, block sums combined in block order with compensation (Neumaier 1974).

use crate::pool::{BLOCK, FEW, Pool};

/// The compensated sum of a few numbers, in order.
pub fn compensated(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut lost) = (0.0f64, 0.0f64);
    for v in values {
        let next = sum + v;
        lost += if sum.abs() >= v.abs() { (sum - next) + v } else { (v - next) + sum };
        sum = next;
    }
    sum + lost
}

/// The sum of `term(i)` for i in 0..n.
pub fn sum(pool: &Pool, n: usize, term: impl Fn(usize) -> f64 + Sync + Send) -> f64 {
    compensated(blocks(pool, n, |range| compensated(range.map(&term))))
}

/// Σ w x y of a few numbers: four running sums and no compensation.
pub fn product(w: &[f64], x: &[f64], y: &[f64]) -> f64 {
    let ((ws, w), (xs, x), (ys, y)) = (w.as_chunks::<4>(), x.as_chunks::<4>(), y.as_chunks::<4>());
    let rest: f64 = w.iter().zip(x).zip(y).map(|((w, x), y)| w * (x * y)).sum();
    let mut sums = [0.0; 4];
    for ((w, x), y) in ws.iter().zip(xs).zip(ys) {
        for k in 0..4 {
            sums[k] += w[k] * (x[k] * y[k]);
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// The largest `term(i)`; negative infinity where n is 0. A NaN is passed on.
pub fn max(pool: &Pool, n: usize, term: impl Fn(usize) -> f64 + Sync + Send) -> f64 {
    let larger = |a: f64, b: f64| if a.is_nan() || a > b { a } else { b };
    let parts = blocks(pool, n, |range| range.map(&term).fold(f64::NEG_INFINITY, larger));
    parts.into_iter().fold(f64::NEG_INFINITY, larger)
}

/// The smallest `term(i)`; infinity where n is 0. A NaN is passed on.
pub fn min(pool: &Pool, n: usize, term: impl Fn(usize) -> f64 + Sync + Send) -> f64 {
    -max(pool, n, |i| -term(i))
}

/// The weighted root mean square of `value` − its weighted mean, scaled so that squares neither over- nor underflow;
/// infinite or NaN where a value is.
pub fn spread(
    pool: &Pool,
    n: usize,
    weight: impl Fn(usize) -> f64 + Sync + Send,
    value: impl Fn(usize) -> f64 + Sync + Send,
) -> f64 {
    deviation(pool, n, weight, value, true)
}

/// The weighted root mean square of `value`, scaled likewise.
pub fn rms(
    pool: &Pool,
    n: usize,
    weight: impl Fn(usize) -> f64 + Sync + Send,
    value: impl Fn(usize) -> f64 + Sync + Send,
) -> f64 {
    deviation(pool, n, weight, value, false)
}

/// Root mean square about the mean, or about 0.
fn deviation(
    pool: &Pool,
    n: usize,
    weight: impl Fn(usize) -> f64 + Sync + Send,
    value: impl Fn(usize) -> f64 + Sync + Send,
    about_mean: bool,
) -> f64 {
    let largest = max(pool, n, |i| value(i).abs());
    if !largest.is_finite() || largest == 0.0 {
        // Not max(0): that would drop a NaN. Nothing at all deviates by nothing.
        return if largest < 0.0 { 0.0 } else { largest };
    }
    let total = sum(pool, n, &weight);
    let scaled = |i: usize| value(i) / largest;
    let centre = if about_mean { sum(pool, n, |i| weight(i) / total * scaled(i)) } else { 0.0 };
    let from_centre = |i: usize| scaled(i) - centre;
    largest * sum(pool, n, |i| weight(i) / total * from_centre(i) * from_centre(i)).sqrt()
}

/// Relative l2 of pairs of a value and the known one, sqrt(Σ (v − known)² / Σ (known − mean)²): the same whatever values
/// are counted from. Known values that are all the same are their own measure.
pub fn l2(pairs: &[(f64, f64)]) -> f64 {
    let known = || pairs.iter().map(|(_, known)| *known);
    let mean = known().sum::<f64>() / pairs.len().max(1) as f64;
    let uniform = known().all(|k| Some(k) == known().next());
    let origin = if uniform { 0.0 } else { mean };
    let size: f64 = known().map(|k| (k - origin).powi(2)).sum();
    let error: f64 = pairs.iter().map(|(v, k)| (v - k).powi(2)).sum();
    (if size > 0.0 { error / size } else { error }).sqrt()
}

/// The first index for which `test` holds.
pub fn first(pool: &Pool, n: usize, test: impl Fn(usize) -> bool + Sync + Send) -> Option<usize> {
    blocks(pool, n, |mut range| range.find(|&i| test(i))).into_iter().flatten().next()
}

fn blocks<T: Send>(pool: &Pool, n: usize, f: impl Fn(std::ops::Range<usize>) -> T + Sync + Send) -> Vec<T> {
    let (count, of_block) = (n.div_ceil(BLOCK), |b: usize| f(b * BLOCK..((b + 1) * BLOCK).min(n)));
    if n < FEW { (0..count).map(of_block).collect() } else { pool.map(count, of_block) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_do_not_depend_on_threads() {
        let term = |i: usize| ((i * 2654435761) % 1000003) as f64 * 1e-3 - 500.0;
        let one = sum(&Pool::new(1).unwrap(), 100_000, term);
        for threads in [2, 3, 4] {
            assert_eq!(sum(&Pool::new(threads).unwrap(), 100_000, term).to_bits(), one.to_bits());
        }
    }

    #[test]
    fn cancellation_is_compensated() {
        assert_eq!(compensated([1.0, 1e100, 1.0, -1e100]), 2.0);
    }

    #[test]
    fn spread_is_scale_free_and_passes_infinity_on() {
        let pool = Pool::new(1).unwrap();
        for scale in [1.0, 1e-200, 1e200] {
            // Values 1 and 3 with weights 3 and 1: mean 1.5, variance (3·0.25 + 2.25)/4 = 0.75.
            let spread = spread(&pool, 2, |i| [3.0, 1.0][i], |i| scale * [1.0, 3.0][i]);
            assert!((spread / scale - 0.75f64.sqrt()).abs() < 1e-15);
        }
        let rms = rms(&pool, 2, |i| [3.0, 1.0][i], |i| 1e200 * [1.0, 3.0][i]);
        assert!((rms / 1e200 - 3f64.sqrt()).abs() < 1e-15);
        assert_eq!(spread(&pool, 2, |_| 1.0, |i| [0.0, f64::INFINITY][i]), f64::INFINITY);
        assert_eq!(spread(&pool, 2, |_| 1.0, |_| 0.0), 0.0);
        assert_eq!(spread(&pool, 0, |_| 1.0, |_| 0.0), 0.0);
        assert!(spread(&pool, 2, |_| 1.0, |i| [f64::NAN, 1.0][i]).is_nan());
    }

    #[test]
    fn extrema_pass_nan_on() {
        let pool = Pool::new(1).unwrap();
        assert_eq!(max(&pool, 3, |i| [1.0, 3.0, 2.0][i]), 3.0);
        assert_eq!(min(&pool, 3, |i| [1.0, 3.0, 2.0][i]), 1.0);
        assert!(max(&pool, 2, |i| [f64::NAN, 1.0][i]).is_nan() && min(&pool, 2, |i| [1.0, f64::NAN][i]).is_nan());
        assert_eq!(first(&pool, 5000, |i| i >= 2000), Some(2000));
    }
}
