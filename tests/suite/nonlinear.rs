//! Conductivities that depend on temperature: fronts where theory has them, and stiffness that converges or says no.
//!
//! The front is the outermost particle with T above 1e-3 of the largest: for kappa ~ T^n the profile is so steep there
//! that the exact one reaches this T within 1e-7 of its radius.

use crate::particles::*;
use diffusph::study::exact::space::Barenblatt;
use diffusph::{Solver, Strided};

const SIDE: f64 = 5.2;
const TIMES: (f64, f64) = (0.01, 1.0);

fn wave(n: f64, dim: usize) -> Barenblatt {
    Barenblatt { a: 1.0, n, strength: 1.0, centre: [0.0; 3], dim }
}

fn place(p: &[f64]) -> [f64; 3] {
    [p[0], p.get(1).copied().unwrap_or(0.0), 0.0]
}

/// The wave at the first of `TIMES`, on a jittered lattice.
fn front(words: &str, n: f64, dim: usize) -> (Solver, Vec<f64>) {
    let count = [130, 48][dim - 1];
    let x: Vec<f64> = lattice(count, dim, 0.1).iter().map(|x| SIDE * (x - 0.5)).collect();
    let mut s = Solver::new(&format!("heat dim={dim} kernel=M4 {words}")).unwrap();
    s.set_particles(Strided::new("x", &x, x.len() / dim, dim, dim).unwrap()).unwrap();
    let cell = (SIDE / count as f64).powi(dim as i32);
    for (name, value) in [("m", cell), ("rho", 1.0), ("h", 1.2 * SIDE / count as f64)] {
        s.set_number(name, value).unwrap();
    }
    s.set_law("kappa", &format!("power n={n}")).unwrap();
    set(&mut s, "T", &field(&x, dim, |p| wave(n, dim).at(place(p), TIMES.0)));
    (s, x)
}

/// Steps that grow with time, as the wave slows down. Returns the front's radius and h.
fn travel(words: &str, n: f64, dim: usize, steps: i32) -> (f64, f64) {
    let (mut s, x) = front(words, n, dim);
    let energy = s.get_all("T").unwrap().iter().sum::<f64>();
    let at = |k: i32| TIMES.0 * (TIMES.1 / TIMES.0).powf(f64::from(k) / f64::from(steps));
    let mut lowest = 0.0f64;
    for k in 0..steps {
        let report = s.step(at(k + 1) - at(k)).unwrap_or_else(|e| panic!("{words} n={n} {dim}-D, step {k}: {e}"));
        let drift = report.energy / report.energy_before - 1.0;
        assert!(drift.abs() < 1e-12, "{words} n={n} {dim}-D: {drift:e}");
        lowest = lowest.min(report.t_min / report.t_max);
    }
    let t = s.get_all("T").unwrap();
    assert!((t.iter().sum::<f64>() / energy - 1.0).abs() < 1e-12 * f64::from(steps));
    // Backward Euler promises T >= 0 to its solver's tolerance; what the others leave is no more than a ripple.
    let promised = if words.contains("backward") || words.contains("ssprk") { 1e-9 } else { 1e-2 };
    assert!(lowest >= -promised, "{words} n={n} {dim}-D: {lowest:e}");
    let above = 1e-3 * max_abs(&t);
    let radius = |p: &[f64]| p.iter().map(|c| c * c).sum::<f64>().sqrt();
    let radius = x.chunks(dim).zip(&t).filter(|(_, t)| **t > above).map(|(p, _)| radius(p)).fold(0.0, f64::max);
    let h = s.get_all("h").unwrap()[0];
    let exact = wave(n, dim).front(TIMES.1);
    println!(
        "{words:55} n={n} {dim}-D: front {radius:.3} exact {exact:.3}, {:+.2} h, lowest {lowest:.1e}",
        (radius - exact) / h
    );
    (radius, h)
}

#[test]
fn fronts_are_within_two_smoothing_lengths() {
    let methods = [
        "backward-euler",
        "sdirk2",
        "rkl2",
        "ssprk2",
        "backward-euler tolerance=1e-3",
        "sdirk2 tolerance=1e-3",
        "rkl2 tolerance=1e-3",
    ];
    for dim in [1, 2] {
        for n in [2.5, 6.0] {
            for method in methods {
                let (radius, h) = travel(&format!("mean=arithmetic integrator={method}"), n, dim, 60);
                let exact = wave(n, dim).front(TIMES.1);
                assert!((radius - exact).abs() < 2.0 * h, "{method} n={n} {dim}-D: {radius} {exact}");
                // The front has come a long way: it was not there from the beginning.
                assert!(exact - wave(n, dim).front(TIMES.0) > 4.0 * h);
            }
        }
    }
}

#[test]
fn means_that_vanish_with_one_kappa_freeze_a_front() {
    for mean in ["harmonic", "geometric"] {
        let (radius, h) = travel(&format!("mean={mean} integrator=backward-euler"), 2.5, 1, 20);
        assert!(radius - wave(2.5, 1).front(TIMES.0) < 2.0 * h, "{mean}: {radius}");
    }
}

#[test]
fn a_front_moves_whatever_makes_kappa_depend_on_t_unless_the_host_says_harmonic() {
    let exact = wave(2.5, 1).front(TIMES.1);
    let (radius, h) = travel("integrator=backward-euler", 2.5, 1, 60);
    assert!((radius - exact).abs() < 2.0 * h, "{radius} {exact}");

    let (mut s, _) = front("", 2.5, 1);
    let title = |s: &mut Solver| s.plan().unwrap().title;
    assert!(title(&mut s).contains("arithmetic kappa"));
    s.set_kappa_callback(Some(Box::new(|_, _, t, kappa| {
        kappa.iter_mut().zip(t).for_each(|(k, t)| *k = t.max(0.0).powf(2.5));
        0
    })));
    assert!(title(&mut s).contains("arithmetic kappa"));
    s.set_number("kappa", 1.0).unwrap();
    assert!(title(&mut s).contains("harmonic kappa"));
    let (mut s, _) = front("mean=harmonic", 2.5, 1);
    assert!(title(&mut s).contains("harmonic kappa"));
}

/// kappa = exp(T) with T from 0 to `hot`, in one step of `stiffness` explicit limits.
fn exponential(
    words: &str,
    hot: f64,
    stiffness: f64,
) -> (Solver, f64, diffusph::error::Result<diffusph::plan::Report>) {
    let x = lattice(24, 2, 0.2);
    let mut s = unit_box(&format!("kernel=M4 {words}"), &x, 2, true);
    s.set_kappa_callback(Some(Box::new(|_, _, t, kappa| {
        kappa.iter_mut().zip(t).for_each(|(k, t)| *k = t.exp());
        0
    })));
    set(&mut s, "T", &field(&x, 2, |p| hot * (-40.0 * ((p[0] - 0.5).powi(2) + (p[1] - 0.5).powi(2))).exp()));
    let dt = stiffness * s.limit().unwrap_or(1e-300);
    let report = s.step(dt);
    (s, dt, report)
}

#[test]
fn an_exponential_conductivity_is_solved_or_refused() {
    let (mut solved, mut refused) = (0, 0);
    for mean in ["harmonic", "arithmetic"] {
        for method in ["backward-euler", "crank-nicolson", "sdirk2", "backward-euler tolerance=1e-2"] {
            for hot in [3.0, 10.0, 30.0, 100.0, 700.0, 800.0] {
                for stiffness in [1.0, 1e2, 1e4, 1e6] {
                    let words = format!("mean={mean} integrator={method} max_applications=20000");
                    let case = format!("{words} hot={hot} R={stiffness}");
                    let start = {
                        let x = lattice(24, 2, 0.2);
                        field(&x, 2, |p| hot * (-40.0 * ((p[0] - 0.5).powi(2) + (p[1] - 0.5).powi(2))).exp())
                    };
                    let (mut s, dt, report) = exponential(&words, hot, stiffness);
                    let t = s.get_all("T").unwrap();
                    let report = match report {
                        Ok(report) => report,
                        Err(e) => {
                            refused += 1;
                            println!("{case}: {}", e.name());
                            assert!(
                                ["NOT_CONVERGED", "BAD_VALUE", "STEP_TOO_LARGE", "OUT_OF_BOUNDS"].contains(&e.name()),
                                "{case}: {e}"
                            );
                            assert_eq!(bits(&t), bits(&start), "{case}");
                            continue;
                        }
                    };
                    solved += 1;
                    assert!((report.energy / report.energy_before - 1.0).abs() < 1e-12, "{case}");
                    if method == "backward-euler" && report.substeps == 1 {
                        // It is the solution: T - dt rate(T) is what there was before, to tolerance and rounding.
                        let rate = s.get_all("dT_dt").unwrap();
                        let residual = (0..t.len()).map(|i| (t[i] - dt * rate[i] - start[i]).abs()).fold(0.0, f64::max);
                        let allowed = hot * (1e-9 + 1e-14 * stiffness);
                        assert!(residual < allowed, "{case}: {residual:e}");
                        let (low, high) = (-1e-9 * hot, hot * (1.0 + 1e-9));
                        assert!(t.iter().all(|t| (low..=high).contains(t)), "{case}");
                    }
                }
            }
        }
    }
    println!("{solved} solved, {refused} refused");
    assert!(solved > refused);
}
