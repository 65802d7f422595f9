//! `tolerance=`: what it promises for every integrator, what it rejects, and that it ends.

use crate::particles::*;
use diffusph::Solver;
use diffusph::plan::Report;
use std::f64::consts::PI;

/// Nonlinear, heated, jittered: kappa = T^2.5 with a source, 400 particles.
fn scene(words: &str) -> Solver {
    let x = lattice(20, 2, 0.2);
    let mut s = unit_box(&format!("kernel=M4 mean=arithmetic {words}"), &x, 2, true);
    s.set_law("kappa", "power n=2.5").unwrap();
    set(&mut s, "T", &field(&x, 2, |p| 1.0 + 0.5 * (2.0 * PI * p[0]).sin()));
    set(&mut s, "source", &field(&x, 2, |p| 20.0 * (2.0 * PI * p[1]).cos()));
    s
}

const DT: f64 = 0.02;

fn run(words: &str) -> (Vec<f64>, Report) {
    let mut s = scene(words);
    let report = s.step(DT).unwrap_or_else(|e| panic!("{words}: {e}"));
    assert_eq!((report.time, s.get_number("time").unwrap()), (DT, DT));
    (s.get_all("T").unwrap(), report)
}

fn spread(t: &[f64]) -> f64 {
    let mean = t.iter().sum::<f64>() / t.len() as f64;
    (t.iter().map(|t| (t - mean) * (t - mean)).sum::<f64>() / t.len() as f64).sqrt()
}

#[test]
fn errors_follow_the_tolerance() {
    let (reference, _) = run("integrator=rk4 tolerance=1e-9");
    let scale = spread(&scene("").get_all("T").unwrap());
    for method in names("integrators") {
        let mut errors = Vec::new();
        for tolerance in [1e-3, 1e-4, 1e-5] {
            let (t, report) = run(&format!("integrator={method} tolerance={tolerance}"));
            let off: Vec<f64> = t.iter().zip(&reference).map(|(a, b)| a - b).collect();
            let error = (off.iter().map(|v| v * v).sum::<f64>() / off.len() as f64).sqrt() / scale;
            let Report { substeps, rejected, applications, .. } = report;
            println!(
                "{method:15} {tolerance:e}: {error:.1e}, {substeps} sub-steps, {rejected} rejected, {applications}"
            );
            // Diffusion does not amplify errors: they add up, at most.
            assert!(error < 2.0 * tolerance * substeps as f64, "{method} {tolerance:e}: {error:e}");
            errors.push(error);
        }
        // Of order p: errors go with tolerance^(p/(p + 1)), the square root at least; stability makes the first smaller.
        assert!(errors[2] < 0.3 * errors[0] || errors[0] < 1e-4, "{method}: {errors:?}");
    }
}

#[test]
fn no_tolerance_is_no_control() {
    for method in names("integrators") {
        let (off, report) = run(&format!("integrator={method} tolerance=off"));
        assert_eq!(report.rejected, 0);
        // Stabilised methods look at their errors unless told not to.
        let default = if method.starts_with("rkl") || method == "auto" { " tolerance=1e-3" } else { "" };
        let same = |words: &str| {
            bits(&run(&format!("integrator={method}{words}")).0) == bits(&run(&format!("integrator={method}")).0)
        };
        assert!(same(default) && (default.is_empty() == (bits(&off) == bits(&run(&format!("integrator={method}")).0))));
    }
}

#[test]
fn what_comes_unannounced_is_rejected_and_counted() {
    for method in names("integrators") {
        let x = lattice(20, 2, 0.0);
        let mut s = unit_box(&format!("kernel=M4 integrator={method} tolerance=1e-4 looks=0"), &x, 2, true);
        s.set_number("T", 1.0).unwrap();
        let hot: Vec<bool> = x.chunks(2).map(|p| p[0] < 0.5).collect();
        // Nothing happens at the beginning, and nobody looks ahead: the first guess is the whole step.
        s.set_source_callback(Some(Box::new(move |time, particles, _, source| {
            let power = 1e3 * time * time;
            source.iter_mut().zip(particles).for_each(|(s, i)| *s = if hot[*i as usize] { power } else { 0.0 });
            0
        })));
        let report = s.step(0.3).unwrap();
        assert!(report.rejected > 0 && report.substeps > 1, "{method}: {report:?}");
        let (t, cells) = (s.get_all("T").unwrap(), 400.0);
        // Half of the particles got 1e3 t^3/3; the integral in time is as exact as the tolerance asks.
        let mean = t.iter().sum::<f64>() / cells;
        assert!((mean - 1.0 - 0.5 * 9.0).abs() < 0.02 * 4.5, "{method}: {mean}");
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    for method in names("integrators") {
        let of = |threads: u32| bits(&run(&format!("integrator={method} tolerance=1e-3 threads={threads}")).0);
        assert_eq!(of(1), of(3), "{method}");
    }
}

#[test]
fn a_step_that_cannot_end_is_refused() {
    for method in names("integrators") {
        let mut s = scene(&format!("integrator={method} tolerance=1e-5 max_applications=300"));
        let before = bits(&s.get_all("T").unwrap());
        let e = s.step(10.0).unwrap_err();
        assert_eq!(e.name(), "STEP_TOO_LARGE", "{method}: {e}");
        let e = s.step(1e30).unwrap_err();
        assert!(["STEP_TOO_LARGE", "NOT_CONVERGED"].contains(&e.name()), "{method}: {e}");
        assert_eq!((bits(&s.get_all("T").unwrap()), s.get_number("time").unwrap()), (before, 0.0));
        assert_eq!(s.step(0.0).unwrap().substeps, 0);
        assert_eq!(s.step(1e-12).unwrap().rejected, 0, "{method}");
    }
}

#[test]
fn bounds_are_kept_by_the_methods_that_keep_them() {
    for method in ["euler", "ssprk2", "ssprk3", "backward-euler"] {
        let x = lattice(32, 2, 0.2);
        let mut s = unit_box(&format!("integrator={method} tolerance=1e-3"), &x, 2, true);
        set(&mut s, "T", &field(&x, 2, |p| if (p[0] - 0.5).hypot(p[1] - 0.5) < 0.25 { 10.0 } else { 0.1 }));
        let limit = s.limit().unwrap();
        let report = s.step(300.0 * limit).unwrap();
        assert!(report.t_min >= 0.1 - 1e-7 && report.t_max <= 10.0 + 1e-7, "{method}: {report:?}");
        assert!((report.energy / report.energy_before - 1.0).abs() < 1e-12, "{method}");
    }
}

#[test]
fn auto_chooses_by_stiffness_and_the_plan_says_so() {
    let x = lattice(20, 2, 0.2);
    let after = |words: &str, stiffness: f64| {
        let mut s = unit_box(&format!("kernel=M4 integrator=auto {words}"), &x, 2, true);
        set(&mut s, "T", &field(&x, 2, |p| 2.0 + (2.0 * PI * p[0]).sin()));
        assert!(s.plan().unwrap().to_string().contains("until a step is known"));
        let limit = s.limit().unwrap();
        let report = s.step(stiffness * limit).unwrap();
        let plan = s.plan().unwrap().to_string();
        assert!(plan.contains(&format!("auto: {} because dt is", report.integrator)), "{plan}");
        // The next step is another step.
        assert_eq!(s.step(0.5 * limit).unwrap().integrator, "rkl2");
        (report.integrator, s.get_all("T").unwrap())
    };
    for (words, stiffness, expected) in [
        ("", 40.0, "rkl2"),
        ("", 1e6, "sdirk2"),
        ("tolerance=off", 300.0, "rkl2"),
        ("tolerance=off", 1e4, "sdirk2"),
        ("bounds=keep", 40.0, "rkl2"),
        ("bounds=keep", 1e6, "sdirk2"),
    ] {
        let (integrator, t) = after(words, stiffness);
        assert_eq!(integrator, expected, "{words} {stiffness}");
        assert!(t.iter().all(|t| (1.0..=3.0).contains(t)), "{words} {stiffness}");
    }
    // What cannot be solved for is stabilised at any stiffness.
    let mut s = unit_box("kernel=M4 integrator=auto tolerance=off operator=direct", &lattice(20, 2, 0.0), 2, true);
    set(&mut s, "T", &field(&x, 2, |p| 2.0 + (2.0 * PI * p[0]).sin()));
    let limit = s.limit().unwrap();
    assert_eq!(s.step(3e3 * limit).unwrap().integrator, "rkl2");
    assert!(s.plan().unwrap().to_string().contains("cannot be solved for"));
}
