//! The error that studies speak of.

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
