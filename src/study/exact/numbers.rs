//! What the exact solutions need beyond elementary functions.

/// The root of a function that changes sign between `low` and `high`, by Newton's method, halving where a Newton step
/// would leave the bracket. `f` gives value and derivative.
pub fn root(low: f64, high: f64, f: impl Fn(f64) -> (f64, f64)) -> f64 {
    let (mut low, mut high) = (low, high);
    let rises = f(low).0 < 0.0;
    let mut x = 0.5 * (low + high);
    // Halving alone would need about 60 rounds for all the digits of a double.
    for _ in 0..200 {
        let (value, slope) = f(x);
        if value == 0.0 {
            return x;
        }
        if (value < 0.0) == rises {
            low = x
        } else {
            high = x
        }
        let newton = x - value / slope;
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - x).abs() <= f64::EPSILON * x.abs() || next == low || next == high {
            return next;
        }
        x = next;
    }
    x
}

/// The first roots of z tan z = b, one in each (k π, k π + π/2).
pub fn biot_roots(b: f64, count: usize) -> Vec<f64> {
    use std::f64::consts::{FRAC_PI_2, PI};
    // z sin z − b cos z has the same roots and no poles.
    let f = |z: f64| (z * z.sin() - b * z.cos(), (1.0 + b) * z.sin() + z * z.cos());
    (0..count).map(|k| root(k as f64 * PI, k as f64 * PI + FRAC_PI_2, f)).collect()
}

/// The error function, to about two units in the last place: the series 2/√π e^(−x²) Σ 2^n x^(2n+1)/(2n+1)!!, whose
/// terms all have one sign, and from 2.5 on the continued fraction of 1 − erf.
pub fn erf(x: f64) -> f64 {
    let a = x.abs();
    let scale = (-a * a).exp() / std::f64::consts::PI.sqrt();
    let value = if a < 2.5 {
        let (mut term, mut sum, mut odd) = (a, a, 1.0);
        while term > f64::EPSILON / 4.0 * sum {
            odd += 2.0;
            term *= 2.0 * a * a / odd;
            sum += term;
        }
        2.0 * scale * sum
    } else {
        // 40 levels leave less than 1e-16 of erf at 2.5, and less beyond.
        1.0 - scale / (1..=40).rev().fold(a, |tail, k| a + 0.5 * k as f64 / tail)
    };
    value.copysign(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn erf_has_its_known_values_derivative_and_no_seam() {
        // Abramowitz & Stegun, table 7.1.
        for (x, known) in [(0.5, 0.5204998778), (1.0, 0.8427007929), (2.0, 0.9953222650)] {
            assert!((erf(x) - known).abs() < 6e-11 && erf(-x) == -erf(x), "{x}");
        }
        let seam = erf(2.5) - erf(2.5f64.next_down());
        assert!(seam.abs() < 1e-15, "{seam}");
        for i in 1..60 {
            let (x, d) = (0.1 * i as f64, 1e-4);
            let slope = (erf(x + d) - erf(x - d)) / (2.0 * d);
            let known = 2.0 / std::f64::consts::PI.sqrt() * (-x * x).exp();
            // Central differences: d² f'''/6 <= 4e-9; rounding: 1e-16/d.
            assert!((slope - known).abs() < 5e-9, "{x}");
        }
        assert_eq!((erf(0.0), erf(7.0), erf(f64::INFINITY)), (0.0, 1.0, 1.0));
        assert!(erf(f64::NAN).is_nan());
    }

    #[test]
    fn roots_are_found_where_newton_alone_would_leave() {
        // Newton's method on atan diverges from |x| > 1.39.
        let x = root(-40.0, 90.0, |x: f64| ((x - 3.0).atan(), 1.0 / (1.0 + (x - 3.0).powi(2))));
        assert!((x - 3.0).abs() < 1e-14, "{x}");
        let quartic = root(0.0, 10.0, |x: f64| (2.0 - x.powi(4), -4.0 * x.powi(3)));
        assert!((quartic - 2f64.powf(0.25)).abs() < 1e-15);
    }

    #[test]
    fn biot_roots_solve_their_equation() {
        // Carslaw & Jaeger's table for b = 1: 0.8603, 3.4256, 6.4373.
        let z = biot_roots(1.0, 3);
        for (z, known) in z.iter().zip([0.8603, 3.4256, 6.4373]) {
            assert!((z - known).abs() < 5e-5, "{z}");
        }
        for b in [1e-6, 0.1, 7.0, 1e6] {
            for z in biot_roots(b, 50) {
                // The residual's rounding: one ulp of z through the slope of z tan z / b.
                let slope = (z / z.cos().powi(2) + z.tan()) / b;
                assert!((z * z.tan() / b - 1.0).abs() < 4e-16 * (2.0 + z * slope.abs()), "{b} {z}");
            }
        }
    }
}
