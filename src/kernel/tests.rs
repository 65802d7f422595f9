//! Laws that every row of the table obeys in every dimension, and the closed forms of the literature.

use super::*;
use crate::kernel::form::Piece;

fn every() -> impl Iterator<Item = Kernel> {
    catalogue().flat_map(|(name, _)| (1..=3).map(move |dim| Kernel::new(name, dim).unwrap()))
}

fn at(form: &Form, q: f64) -> f64 {
    let mut out = [f64::NAN];
    form.evaluate(&[q], &mut out);
    out[0]
}

/// Every piece of every kernel ends at a multiple of 1/6.
const PANELS_PER_UNIT: usize = 6;

/// Nodes and weights on [-1, 1] of Gauss' rule with ten points, exact to degree 19: Newton on Legendre's recurrence.
fn gauss() -> Vec<(f64, f64)> {
    let n = 10;
    let legendre = |x: f64| {
        let (mut below, mut p) = (1.0, x);
        for j in 2..=n {
            (below, p) = (p, ((2 * j - 1) as f64 * x * p - (j - 1) as f64 * below) / j as f64);
        }
        (p, n as f64 * (x * p - below) / (x * x - 1.0))
    };
    let node = |i: usize| {
        let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        for _ in 0..20 {
            let (p, slope) = legendre(x);
            x -= p / slope;
        }
        (x, 2.0 / ((1.0 - x * x) * legendre(x).1.powi(2)))
    };
    (0..n).map(node).collect()
}

/// `∫ x^power W dV`, x one coordinate, by quadrature; `mean` is the mean of cos^power over directions.
fn moment(k: &Kernel, power: usize, mean: f64) -> f64 {
    let panels = (k.radius() * PANELS_PER_UNIT as f64).round() as usize;
    let half = 0.5 / PANELS_PER_UNIT as f64;
    let rule = gauss();
    let sphere = [2.0, 2.0 * PI, 4.0 * PI][k.dim() - 1];
    let integrand = |q: f64| sphere * mean * k.w_at(q) * q.powi((k.dim() - 1 + power) as i32);
    let panel =
        |i: usize| rule.iter().map(|(x, w)| half * w * integrand(half * (2 * i + 1) as f64 + half * x)).sum::<f64>();
    (0..panels).map(panel).sum()
}

#[test]
fn norm_and_moments_agree_with_quadrature() {
    for k in every() {
        let n = k.dim() as f64;
        // The rule is exact for every spline; 1e-14 allows for some hundred rounded terms.
        for (got, power, mean) in
            [(1.0, 0, 1.0), (k.second_moment(), 2, 1.0 / n), (k.fourth_moment(), 4, 3.0 / (n * (n + 2.0)))]
        {
            let quadrature = moment(&k, power, mean);
            assert!((got / quadrature - 1.0).abs() < 1e-14, "{} {n}: moment {power} {got} {quadrature}", k.name());
        }
    }
}

/// Largest difference of q * (f'/q) and f'' from differences of f and f' within the pieces, relative to f''(0).
fn derivative_error(w: &Form) -> f64 {
    let (slope, curvature) = (w.slope_over_q(), w.curvature());
    let e = 1e-3;
    let difference =
        |f: &dyn Fn(f64) -> f64, q: f64| (8.0 * (f(q + e) - f(q - e)) - (f(q + 2.0 * e) - f(q - 2.0 * e))) / (12.0 * e);
    let panels = (w.radius() * PANELS_PER_UNIT as f64).round() as usize;
    let error = |i: usize| {
        let q = (i as f64 + 0.5) / PANELS_PER_UNIT as f64;
        let d_slope = difference(&|q| at(w, q), q) - q * at(&slope, q);
        let d_curvature = difference(&|q| q * at(&slope, q), q) - at(&curvature, q);
        d_slope.abs().max(d_curvature.abs())
    };
    (0..panels).map(error).fold(0.0, f64::max) / at(&curvature, 0.0).abs()
}

#[test]
fn derivatives_agree_with_differences() {
    // Fourth-order differences over 1e-3: e^4/30 times a fifth derivative of some 1e2 f''(0), and 1e-13 of rounding.
    for k in every() {
        let error = derivative_error(&k.w);
        assert!(error < 1e-10, "{} {}: {error:e}", k.name(), k.dim());
    }
    // A cone is not smooth at q = 0, so that dividing its slope by q loses the constant: the check must see it.
    assert!(derivative_error(&Form::sum(&[Piece::new(1.0, 3, [1.0, 0.0, 0.0, 0.0])], 1.0)) > 0.1);
}

#[test]
fn kernels_are_positive_and_fall_and_end() {
    for k in every() {
        let q: Vec<f64> = (0..4000).map(|i| i as f64 * k.radius() / 4000.0).collect();
        let (mut w, mut slope) = (vec![0.0; q.len()], vec![0.0; q.len()]);
        k.w(&q, &mut w);
        k.slope_over_q(&q, &mut slope);
        assert!(w.iter().all(|&w| w > 0.0) && slope.iter().all(|&s| s < 0.0), "{} {}", k.name(), k.dim());
        assert!(w.windows(2).all(|w| w[1] <= w[0]), "{} {}", k.name(), k.dim());
        let beyond = [k.radius(), k.radius() * (1.0 + 1e-15), 10.0, 1e100, 1e308, f64::INFINITY];
        for form in [&k.w, &k.slope_over_q, &k.curvature] {
            assert!(beyond.iter().all(|&q| at(form, q) == 0.0), "{} {}", k.name(), k.dim());
        }
    }
}

#[test]
fn slope_over_q_tends_to_its_limit() {
    for k in every() {
        let limit = at(&k.curvature, 0.0);
        for q in [0.0, f64::MIN_POSITIVE / 4.0, 1e-300, 1e-160, 1e-20, 1e-8] {
            // f'/q differs from f''(0) by q f'''(0)/2, at most 3 q f''(0) here; the rest is rounding.
            let difference = at(&k.slope_over_q, q) / limit - 1.0;
            assert!(difference.abs() < 3.0 * q + 1e-14, "{} {} at {q:e}: {difference:e}", k.name(), k.dim());
        }
    }
}

#[test]
fn pieces_join_smoothly() {
    for k in every().filter(|k| k.name() != "Gaussian") {
        let panels = (k.radius() * PANELS_PER_UNIT as f64).round() as usize;
        for form in [&k.w, &k.slope_over_q, &k.curvature] {
            let scale = at(form, 0.0).abs();
            for q in (1..=panels).map(|i| i as f64 / PANELS_PER_UNIT as f64) {
                // A distance of 2e-13 times slopes of up to 20 times the height.
                let jump = (at(form, q + 1e-13) - at(form, q - 1e-13)).abs() / scale;
                assert!(jump < 1e-11, "{} {} at {q}: {jump:e}", k.name(), k.dim());
            }
        }
    }
}

#[test]
fn the_edge_is_accurate_not_only_small() {
    let k = Kernel::new("M8", 3).unwrap();
    // 4 - q is exact here, so that only the power and sigma round.
    let exact = k.sigma() * 2f64.powi(-70);
    assert!((k.w_at(4.0 - 2f64.powi(-10)) / exact - 1.0).abs() < 1e-14);
}

#[test]
fn norms_are_those_of_the_literature() {
    let inverse_pi = |a: f64, b: f64| a / (b * PI);
    let known: [(&str, [f64; 3]); 10] = [
        ("M4", [2.0 / 3.0, inverse_pi(10.0, 7.0), inverse_pi(1.0, 1.0)]),
        ("M5", [1.0 / 24.0, inverse_pi(96.0, 1199.0), inverse_pi(1.0, 20.0)]),
        ("M6", [1.0 / 120.0, inverse_pi(7.0, 478.0), inverse_pi(1.0, 120.0)]),
        ("M7", [1.0 / 720.0, inverse_pi(256.0, 113149.0), inverse_pi(1.0, 840.0)]),
        ("M8", [1.0 / 5040.0, inverse_pi(9.0, 29740.0), inverse_pi(1.0, 6720.0)]),
        ("M6/2", [1.5 / 120.0, inverse_pi(2.25 * 7.0, 478.0), inverse_pi(3.375, 120.0)]),
        ("C2", [5.0 / 8.0, inverse_pi(7.0, 4.0), inverse_pi(21.0, 16.0)]),
        ("C4", [3.0 / 4.0, inverse_pi(9.0, 4.0), inverse_pi(495.0, 256.0)]),
        ("C6", [55.0 / 64.0, inverse_pi(39.0, 14.0), inverse_pi(1365.0, 512.0)]),
        ("Lucy", [5.0 / 8.0, inverse_pi(5.0, 4.0), inverse_pi(105.0, 128.0)]),
    ];
    for (name, sigmas) in known {
        for (dim, sigma) in (1..).zip(sigmas) {
            let got = Kernel::new(name, dim).unwrap().sigma();
            assert!((got / sigma - 1.0).abs() < 4e-15, "{name} {dim}: {got} {sigma}");
        }
    }
}

#[test]
fn shapes_are_those_of_the_literature() {
    let cut = |x: f64, k: i32| x.max(0.0).powi(k);
    type Shape<'a> = &'a dyn Fn(f64) -> f64;
    let known: [(&str, usize, Shape); 10] = [
        ("m4", 2, &|q| if q < 1.0 { 1.0 - 1.5 * q * q + 0.75 * q.powi(3) } else { 0.25 * cut(2.0 - q, 3) }),
        ("M6/2", 3, &|q| cut(3.0 - 1.5 * q, 5) - 6.0 * cut(2.0 - 1.5 * q, 5) + 15.0 * cut(1.0 - 1.5 * q, 5)),
        ("C2", 1, &|q| cut(1.0 - 0.5 * q, 3) * (1.5 * q + 1.0)),
        ("c2", 3, &|q| cut(1.0 - 0.5 * q, 4) * (2.0 * q + 1.0)),
        ("C4", 1, &|q| cut(1.0 - 0.5 * q, 5) * (2.0 * q * q + 2.5 * q + 1.0)),
        ("C4", 2, &|q| cut(1.0 - 0.5 * q, 6) * (35.0 * q * q / 12.0 + 3.0 * q + 1.0)),
        ("C6", 1, &|q| cut(1.0 - 0.5 * q, 7) * (2.625 * q.powi(3) + 4.75 * q * q + 3.5 * q + 1.0)),
        ("C6", 3, &|q| cut(1.0 - 0.5 * q, 8) * (4.0 * q.powi(3) + 6.25 * q * q + 4.0 * q + 1.0)),
        ("lucy", 2, &|q| cut(1.0 - 0.5 * q, 3) * (1.0 + 1.5 * q)),
        ("GAUSSIAN", 3, &|q| if q < 4.0 { (-q * q).exp() } else { 0.0 }),
    ];
    for (name, dim, f) in known {
        let k = Kernel::new(name, dim).unwrap();
        for q in (0..100).map(|i| i as f64 * 0.045) {
            let difference = k.w_at(q) / k.sigma() - f(q);
            assert!(difference.abs() < 2e-15 * f(0.0), "{name} at {q}: {difference:e}");
        }
    }
}

#[test]
fn laplacian_factors_are_the_exact_rationals() {
    let known: [(&str, [f64; 3]); 10] = [
        ("M4", [6.0, 196.0 / 31.0, 20.0 / 3.0]),
        ("M5", [4.8, 2.0 * 24416.0 / 9759.0, 120.0 / 23.0]),
        ("M6", [4.0, 11472.0 / 2771.0, 30.0 / 7.0]),
        ("M8", [3.0, 2.0 * 817850.0 / 531453.0, 60.0 / 19.0]),
        ("M6/2", [9.0, 2.25 * 11472.0 / 2771.0, 67.5 / 7.0]),
        ("C2", [5.25, 7.2, 7.5]),
        ("C4", [7.5, 66.0 / 7.0, 9.75]),
        ("C6", [9.75, 35.0 / 3.0, 12.0]),
        ("Lucy", [5.25, 5.6, 6.0]),
        ("Gaussian", [4.0; 3]),
    ];
    for (name, factors) in known {
        // The cut removes R^3 exp(-R²)/2 = 3.6e-6 of 0.66 from the Gaussian's second moment in 3-D, less below.
        let tolerance = if name == "Gaussian" { 6e-6 } else { 4e-15 };
        for (dim, factor) in (1..).zip(factors) {
            let got = Kernel::new(name, dim).unwrap().laplacian_factor();
            assert!((got / factor - 1.0).abs() < tolerance, "{name} {dim}: {got} {factor}");
        }
    }
    let m7 = |dim| Kernel::new("M7", dim).unwrap().laplacian_factor();
    assert!((m7(1) - 24.0 / 7.0).abs() < 2e-14 && (m7(3) - 40.0 / 11.0).abs() < 2e-14);
}

#[test]
fn slices_of_any_length_have_the_same_bits_with_and_without_avx2() {
    for k in every() {
        for form in [&k.w, &k.slope_over_q, &k.curvature] {
            for n in 0..37 {
                let q: Vec<f64> = (0..n).map(|i| 1.07 * k.radius() * i as f64 / n as f64).collect();
                let (mut fast, mut portable) = (vec![f64::NAN; n], vec![f64::NAN; n]);
                form.evaluate(&q, &mut fast);
                form.evaluate_here(&q, &mut portable);
                for i in 0..n {
                    assert_eq!(fast[i].to_bits(), portable[i].to_bits(), "{} {} at {}", k.name(), k.dim(), q[i]);
                    assert_eq!(fast[i].to_bits(), at(form, q[i]).to_bits());
                }
            }
        }
    }
}

#[test]
fn unknown_names_and_dimensions_are_refused() {
    assert_eq!(Kernel::new("M9", 3).unwrap_err().code(), -5);
    assert!(Kernel::new("m44", 2).unwrap_err().to_string().contains("M4"));
    assert!([0, 4, usize::MAX].iter().all(|&dim| Kernel::new("M4", dim).unwrap_err().code() == -2));
}
