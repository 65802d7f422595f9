//! The equation that every exact solution is held against.

/// kappa(T), rho c_v and the heat released.
#[derive(Clone, Copy)]
pub struct Medium<'a> {
    pub kappa: &'a dyn Fn(f64) -> f64,
    pub capacity: f64,
    pub source: f64,
}

impl Medium<'_> {
    /// kappa = D, rho c_v = 1.
    pub fn uniform(diffusivity: f64) -> Medium<'static> {
        Medium { kappa: Box::leak(Box::new(move |_| diffusivity)), capacity: 1.0, source: 0.0 }
    }
}

/// Asserts what [`violated`] looks for.
pub fn obeys(dim: usize, medium: Medium, f: impl Fn([f64; 3], f64) -> f64, x: [f64; 3], t: f64) {
    if let Some(violation) = violated(dim, medium, f, x, t) {
        panic!("{violation}");
    }
}

/// Where capacity dT/dt = div(kappa grad T) + source does not hold at x and t, by central differences of second order,
/// extrapolated to fourth from two spacings.
pub fn violated(dim: usize, medium: Medium, f: impl Fn([f64; 3], f64) -> f64, x: [f64; 3], t: f64) -> Option<String> {
    let (coarse, fine) = (sides(dim, medium, &f, x, t, 2e-3), sides(dim, medium, &f, x, t, 1e-3));
    let extrapolated = |i: usize| (4.0 * fine[i] - coarse[i]) / 3.0;
    let (left, right) = (extrapolated(0), extrapolated(1));
    let size = left.abs().max(fine[2]);
    // What fourth order leaves: (d/l)^4 = (1e-3/0.05)^4 = 2e-7 for the shortest scale l here, with a safety factor;
    // and the rounding of second differences, ulp(T)/d².
    let tolerance = 2e-5 * size + 4.0 * f64::EPSILON * f(x, t).abs() * (medium.kappa)(f(x, t)) / 1e-6;
    let holds = (left - right).abs() <= tolerance;
    (!holds).then(|| format!("{x:?} {t}: {left} against {right}, tolerance {tolerance}"))
}

/// capacity dT/dt, div(kappa grad T) + source, and the size of the latter's terms.
fn sides(dim: usize, medium: Medium, f: &impl Fn([f64; 3], f64) -> f64, x: [f64; 3], t: f64, d: f64) -> [f64; 3] {
    let change = medium.capacity * (f(x, t + d * t) - f(x, t - d * t)) / (2.0 * d * t.max(f64::MIN_POSITIVE));
    let (mut divergence, mut size) = (medium.source, medium.source.abs());
    for axis in 0..dim {
        let moved = |by: f64| {
            let mut at = x;
            at[axis] += by;
            f(at, t)
        };
        let (low, mid, high) = (moved(-d), moved(0.0), moved(d));
        // kappa at the faces, from T there: second order, with an error that is even in d.
        let faces = [moved(-0.5 * d), moved(0.5 * d)].map(medium.kappa);
        let term = (faces[1] * (high - mid) - faces[0] * (mid - low)) / (d * d);
        divergence += term;
        size += term.abs();
    }
    [change, divergence, size]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "against")]
    fn a_wrong_solution_is_noticed() {
        obeys(1, Medium::uniform(1.0), |x, t| (3.0 * x[0]).sin() * (-8.99f64 * t).exp(), [0.3, 0.0, 0.0], 0.2);
    }
}
