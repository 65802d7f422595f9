//! Whatever dt a host gives: the error in time is what the words promise, it does not fall when dt grows, T stays between
//! its bounds, and what cannot be done is refused before minutes of work.

use crate::particles::*;
use diffusph::Solver;
use diffusph::error::Error;
use diffusph::integrator::METHODS;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;

const SIDE: usize = 14;

/// The solution in time of the operator itself, probed column by column: with equal capacities it is symmetric.
struct Exact {
    values: DVector<f64>,
    vectors: DMatrix<f64>,
}

impl Exact {
    fn new(s: &mut Solver) -> Exact {
        let n = s.len();
        let mut operator = DMatrix::zeros(n, n);
        for i in 0..n {
            let unit: Vec<f64> = (0..n).map(|j| f64::from(i == j)).collect();
            set(s, "T", &unit);
            operator.set_column(i, &DVector::from_vec(s.get_all("dT_dt").unwrap()));
        }
        let eigen = (0.5 * (&operator + operator.transpose())).symmetric_eigen();
        Exact { values: eigen.eigenvalues, vectors: eigen.eigenvectors }
    }

    fn after(&self, t: &[f64], dt: f64) -> Vec<f64> {
        let mut modes = self.vectors.tr_mul(&DVector::from_column_slice(t));
        modes.iter_mut().zip(&self.values).for_each(|(m, v)| *m *= (v * dt).exp());
        (&self.vectors * modes).as_slice().to_vec()
    }
}

fn particles() -> Vec<f64> {
    lattice(SIDE, 2, 0.2)
}

fn starts(x: &[f64]) -> [(&'static str, Vec<f64>); 4] {
    let n = x.len() / 2;
    [
        ("disc", field(x, 2, |p| if (p[0] - 0.5).hypot(p[1] - 0.5) < 0.2 { 1.0 } else { 0.0 })),
        ("half", field(x, 2, |p| if p[0] > 0.5 { 1.0 } else { 0.0 })),
        ("one hot particle", (0..n).map(|i| if i == n / 2 { 1e6 } else { 1.0 }).collect()),
        ("mode", field(x, 2, |p| 2.0 + (2.0 * PI * p[0]).sin())),
    ]
}

fn spread(t: &[f64]) -> f64 {
    let mean = t.iter().sum::<f64>() / t.len() as f64;
    (t.iter().map(|t| (t - mean) * (t - mean)).sum::<f64>() / t.len() as f64).sqrt()
}

/// The error of one step, relative to the spread at the beginning, how far T is outside its bounds, and applications of
/// the operator.
fn one_step(words: &str, x: &[f64], exact: &Exact, start: &[f64], limits: f64) -> (f64, f64, u64) {
    let mut s = unit_box(words, x, 2, true);
    set(&mut s, "T", start);
    let dt = limits * s.limit().unwrap();
    let report = s.step(dt).unwrap_or_else(|e| panic!("{words} {limits}: {e}"));
    let t = s.get_all("T").unwrap();
    let off: Vec<f64> = t.iter().zip(exact.after(start, dt)).map(|(a, b)| a - b).collect();
    let error = (off.iter().map(|v| v * v).sum::<f64>() / off.len() as f64).sqrt() / spread(start);
    let (low, high) = start.iter().fold((f64::MAX, f64::MIN), |(l, h), &v| (l.min(v), h.max(v)));
    let outside = t.iter().map(|t| (low - t).max(t - high)).fold(f64::MIN, f64::max);
    (error, outside, report.applications)
}

const LIMITS: [f64; 10] = [0.1, 0.5, 1.0, 2.0, 3.0, 10.0, 30.0, 100.0, 1000.0, 1e4];

#[test]
fn the_error_of_a_step_is_what_was_promised_whatever_dt_is() {
    let x = particles();
    let exact = Exact::new(&mut unit_box("", &x, 2, true));
    // auto and what it may choose answer for 1e-3 in a sub-step; change=0.05 for 5 % of the spread in one.
    for (words, promise) in
        [("", 1e-3), ("integrator=sdirk2 tolerance=1e-3", 1e-3), ("integrator=rkl2 tolerance=off", 5e-3)]
    {
        for (name, start) in starts(&x) {
            for limits in LIMITS {
                let (error, outside, applications) = one_step(words, &x, &exact, &start, limits);
                println!("{words:35} {name:17} {limits:6}: {error:.1e} with {applications}");
                assert!(error < promise, "{words} {name} {limits}: {error:e}");
                assert!(outside <= 0.0, "{words} {name} {limits}: outside by {outside:e}");
            }
        }
    }
    // What the default was before: one long sub-step, in no bounds. These criteria see it.
    let old = "integrator=rkl2 tolerance=off change=inf bounds=free";
    let (disc, spike) = (&starts(&x)[0].1, &starts(&x)[2].1);
    let (error, outside) = (one_step(old, &x, &exact, disc, 2.0).0, one_step(old, &x, &exact, spike, 2.0).1);
    assert!(error > 0.05 && outside > 1e3, "{error:e} {outside:e}");
}

#[test]
fn every_method_keeps_bounds_and_energy_where_the_operator_can() {
    let x = particles();
    let (name, start) = starts(&x)[2].clone();
    for method in METHODS {
        for limits in [0.7, 2.5, 40.0, 1e4] {
            for operator in ["brookshaw", "kernel"] {
                let mut s =
                    unit_box(&format!("integrator={} operator={operator} bounds=keep", method.name), &x, 2, true);
                set(&mut s, "T", &start);
                let dt = limits * s.limit().unwrap();
                let report = s.step(dt).unwrap_or_else(|e| panic!("{} {limits}: {e}", method.name));
                assert!(report.t_min >= 1.0 && report.t_max <= 1e6, "{} {name} {limits}: {report:?}", method.name);
                let drift = report.energy / report.energy_before - 1.0;
                assert!(drift.abs() < 1e-12, "{} {limits}: energy {drift:e}", method.name);
            }
        }
    }
    // Left alone, a long step of second order goes far below.
    let mut s = unit_box("integrator=sdirk2 bounds=free", &x, 2, true);
    set(&mut s, "T", &start);
    let dt = 40.0 * s.limit().unwrap();
    assert!(s.step(dt).unwrap().t_min < -1e3);
}

#[test]
fn bounds_that_cannot_be_kept_are_refused_and_those_left_by_far_are_an_error() {
    for operator in ["direct", "consistent", "two-first"] {
        let text = Solver::new(&format!("heat dim=2 operator={operator} bounds=keep")).err().unwrap().to_string();
        assert!(text.contains("bounds=keep needs an operator that is positive"), "{text}");
    }
    let x = particles();
    let start = starts(&x)[2].1.clone();
    // Gradients that see nothing of the shortest waves: a hot particle rings, beyond what is watched for.
    let step = |words: &str| {
        let mut s = unit_box(&format!("operator=two-first theta=0 {words}"), &x, 2, true);
        set(&mut s, "T", &start);
        let dt = 5.0 * s.limit().unwrap();
        let done = s.step(dt);
        (done, s.get_all("T").unwrap())
    };
    let (error, t) = step("");
    let error = error.unwrap_err();
    assert!(error.name() == "OUT_OF_BOUNDS" && error.to_string().contains("two-first misses"), "{error}");
    assert_eq!(bits(&t), bits(&start));
    assert!(step("bounds=free").0.unwrap().t_min < 1.0 - 0.1e6);
}

#[test]
fn two_bodies_that_exchange_nothing_each_keep_their_energy_while_bounds_are_kept() {
    // A gap wider than a support, and a layer that insulates.
    for gap in [true, false] {
        let x: Vec<f64> = particles()
            .iter()
            .enumerate()
            .map(|(k, x)| if gap && k % 2 == 0 && *x > 0.5 { x + 1.0 } else { *x })
            .collect();
        let mut s = unit_box("integrator=rkl2", &x, 2, false);
        let right = field(&x, 2, |p| f64::from(p[0] > 0.5));
        if !gap {
            set(&mut s, "kappa", &field(&x, 2, |p| if (0.35..0.65).contains(&p[0]) { 0.0 } else { 1.0 }));
        }
        let hot = field(&x, 2, |p| p[0]).iter().position(|x| *x < 0.2).unwrap();
        let start: Vec<f64> = (0..right.len()).map(|i| if i == hot + 5 { 1e6 } else { 1.0 + right[i] }).collect();
        set(&mut s, "T", &start);
        let dt = 30.0 * s.limit().unwrap();
        let report = s.step(dt).unwrap();
        let t = s.get_all("T").unwrap();
        assert!(report.t_min >= 1.0, "{report:?}");
        for side in [0.0, 1.0] {
            let sum = |t: &[f64]| t.iter().zip(&right).filter(|(_, r)| **r == side).map(|(t, _)| t).sum::<f64>();
            assert!((sum(&t) / sum(&start) - 1.0).abs() < 1e-12, "gap {gap}, side {side}: {} {}", sum(&t), sum(&start));
        }
    }
}

#[test]
fn growth_is_refused_whatever_else_the_scene_has() {
    let x = lattice(20, 2, 0.2);
    let scene = |words: &str, set_up: fn(&mut Solver, &[f64])| {
        let mut s = unit_box(&format!("operator=direct kernel=M4 h_fac=1.5 {words}"), &x, 2, true);
        set(&mut s, "T", &field(&x, 2, |p| 300.0 + f64::from(p[0] < 0.05)));
        set_up(&mut s, &x);
        s.step(1.0).map(|report| (report.t_min, report.t_max))
    };
    let set_ups: [fn(&mut Solver, &[f64]); 4] = [
        |_, _| (),
        |s, x| set(s, "fixed", &field(x, 2, |p| f64::from(p[0] < 0.05))),
        |s, _| s.set_number("source", 1.0).unwrap(),
        // Weaker than the growth, which it would outdo.
        |s, _| ["h_conv", "area"].iter().for_each(|name| s.set_number(name, 1e-3).unwrap()),
    ];
    for set_up in set_ups {
        let error = scene("", set_up).unwrap_err().to_string();
        assert!(error.contains("a mode that grows"), "{error}");
    }
    // Who insists gets what is watched.
    let error = scene("allow=unstable", set_ups[1]).unwrap_err();
    assert!(["OUT_OF_BOUNDS", "NOT_FINITE"].contains(&error.name()), "{error}");
}

#[test]
fn a_source_that_depends_on_t_is_followed() {
    let x = lattice(6, 2, 0.0);
    let follow = |words: &str, rate: f64| {
        let mut s = unit_box(words, &x, 2, true);
        s.set_number("T", 1.0).unwrap();
        s.set_source_callback(Some(Box::new(move |_, _, t, source| {
            source.iter_mut().zip(t).for_each(|(s, t)| *s = -rate * (t - 2.0));
            0
        })));
        s.step(1.0).map(|r| (r.t_min, r.t_max))
    };
    for rate in [1.0f64, 10.0, 1e3, 1e6] {
        let exact = 2.0 - (-rate).exp();
        // A million sub-steps of an explicit method teach nothing new.
        for method in METHODS.iter().filter(|m| rate < 1e6 || m.is_implicit()) {
            let (low, high) = follow(&format!("integrator={} tolerance=1e-4", method.name), rate).unwrap();
            assert!((low - exact).abs() < 0.02 && (high - exact).abs() < 0.02, "{} {rate}: {low} {high}", method.name);
            // Without one, a single implicit step is what it is (Crank-Nicolson's turns what is stiff round): nothing
            // blows up.
            let (low, high) = follow(&format!("integrator={} tolerance=off", method.name), rate).unwrap();
            let most = if method.name == "crank-nicolson" { 1.01 } else { 0.3 };
            assert!((low - exact).abs() < most && (high - exact).abs() < most, "{} {rate}: {low} {high}", method.name);
        }
        let (low, high) = follow("", rate).unwrap();
        assert!((low - exact).abs() < 2e-3 && (high - exact).abs() < 2e-3, "{rate}: {low} {high}");
    }
    // One that feeds on T grows as it should.
    let (low, high) = follow("", -3.0).unwrap();
    let exact = 2.0 - 3f64.exp();
    assert!((low / exact - 1.0).abs() < 5e-3 && low == high, "{low} {exact}");
}

#[test]
fn a_value_that_is_not_finite_in_any_call_of_the_source_is_never_done() {
    let x = lattice(8, 2, 0.2);
    for words in ["", "integrator=rkl2", "integrator=rk4", "integrator=ssprk2 tolerance=1e-6", "integrator=sdirk2"] {
        let step = |bad: usize| {
            let calls = std::sync::Arc::new(std::sync::atomic::AtomicUsize::new(0));
            let count = calls.clone();
            let mut s = unit_box(words, &x, 2, true);
            set(&mut s, "T", &field(&x, 2, |p| 2.0 + p[0]));
            s.set_source_callback(Some(Box::new(move |_, _, t, source| {
                source.iter_mut().zip(t).for_each(|(s, t)| *s = 0.1 * t);
                if count.fetch_add(1, std::sync::atomic::Ordering::Relaxed) == bad {
                    source[3] = f64::NAN;
                }
                0
            })));
            let done = s.step(5e-3).map(drop);
            (done, calls.load(std::sync::atomic::Ordering::Relaxed))
        };
        let (done, calls) = step(usize::MAX);
        done.unwrap();
        for bad in (0..calls).step_by(calls / 20 + 1) {
            let error = step(bad).0.unwrap_err().to_string();
            assert!(
                error.contains("source callback") && error.contains("NaN at particle"),
                "{words} call {bad} of {calls}: {error}"
            );
        }
    }
}

#[test]
fn where_nothing_changes_a_step_is_one() {
    let x = particles();
    let mut s = unit_box("max_applications=1000", &x, 2, true);
    s.set_number("T", 300.0).unwrap();
    for words in names("integrators").iter().map(|m| format!("integrator={m}")).chain([String::new()]) {
        let mut s = unit_box(&words, &x, 2, true);
        s.set_number("T", 300.0).unwrap();
        let limit = s.limit().unwrap();
        for dt in [20.0 * limit, 1e4, 1e300] {
            let report = s.step(dt).unwrap_or_else(|e| panic!("{words} {dt:e}: {e}"));
            assert_eq!((report.substeps, report.t_min, report.t_max), (1, 300.0, 300.0), "{words} {dt:e}");
        }
    }
    // In equilibrium with what surrounds it.
    s.set_number("h_conv", 3.0).unwrap();
    s.set_number("area", 0.1).unwrap();
    s.set_number("T_ambient", 300.0).unwrap();
    assert_eq!(s.step(1e6).unwrap().substeps, 1);
    // A last digit of noise, heated as a whole, costs little more than the heating.
    let mut s = unit_box("", &x, 2, true);
    let mut random = Random(3);
    let noise: Vec<f64> = (0..s.len()).map(|_| 300.0 + 1e-9 * random.next()).collect();
    set(&mut s, "T", &noise);
    let dt = 1e4 * s.limit().unwrap();
    s.set_number("source", 1.0 / dt).unwrap();
    let report = s.step(dt).unwrap();
    assert!(report.substeps < 150 && (report.t_max - 301.0).abs() < 1e-6, "{report:?}");
}

#[test]
fn what_a_step_may_cost_is_kept() {
    let x = particles();
    for words in names("integrators").iter().map(|m| format!("integrator={m}")).chain([String::new()]) {
        for dt in [1e-2, 1e4, 1e300] {
            let mut s = unit_box(&format!("{words} max_applications=300"), &x, 2, true);
            let start = starts(&x)[0].1.clone();
            set(&mut s, "T", &start);
            match s.step(dt) {
                Ok(report) => assert!(report.applications < 600, "{words} {dt:e}: {report:?}"),
                Err(e) => {
                    assert!(["STEP_TOO_LARGE", "NOT_CONVERGED", "OUT_OF_BOUNDS"].contains(&e.name()), "{words}: {e}");
                    assert!(!e.to_string().contains("18446744073709551615"), "{e}");
                    if e.name() == "STEP_TOO_LARGE" {
                        assert!(e.to_string().contains(&format!("step of {dt:e}")), "{words} {dt:e}: {e}");
                    }
                    assert_eq!(bits(&s.get_all("T").unwrap()), bits(&start), "{words} {dt:e}");
                }
            }
        }
    }
}

#[test]
fn a_stiff_half_costs_no_more_than_the_root_of_its_contrast() {
    let x = particles();
    let applications = |contrast: f64| {
        let mut s = unit_box("", &x, 2, true);
        set(&mut s, "T", &field(&x, 2, |p| 1.0 + p[0]));
        set(&mut s, "kappa", &field(&x, 2, |p| if p[0] < 0.5 { 1.0 } else { contrast }));
        s.step(0.01).unwrap().applications as f64
    };
    let base = applications(1.0);
    for contrast in [1e2, 1e4, 1e6, 1e8] {
        let cost = applications(contrast);
        println!("{contrast:e}: {cost} of {base}");
        assert!(cost < 2.0 * base * contrast.sqrt(), "{contrast:e}: {cost} of {base}");
        assert!(cost < 2e4, "{contrast:e}: {cost}");
    }
}

#[test]
fn radiation_does_not_cool_below_all_surroundings() {
    let (n, side) = (12, 0.02);
    let x: Vec<f64> = lattice(n, 2, 0.0).iter().map(|x| side * x).collect();
    let d = side / n as f64;
    let edge = field(&x, 2, |p| f64::from(p.iter().any(|c| *c < d || *c > side - d)));
    for words in ["", "integrator=sdirk2", "integrator=crank-nicolson", "integrator=backward-euler", "integrator=rkl2"]
    {
        for (hot, dt) in [(1800.0, 60.0), (3000.0, 3600.0), (3000.0, 86400.0)] {
            if words.ends_with("rkl2") && dt > 60.0 {
                continue;
            }
            let mut s = Solver::new(&format!("heat dim=2 kernel=C2 {words}")).unwrap();
            s.set_particles(diffusph::Strided::new("x", &x, n * n, 2, 2).unwrap()).unwrap();
            let numbers = [("m", 7800.0 * d * d), ("rho", 7800.0), ("T", hot), ("kappa", 30.0), ("c_v", 460.0)];
            numbers.iter().for_each(|(name, value)| s.set_number(name, *value).unwrap());
            set(&mut s, "emissivity", &edge.iter().map(|e| 0.8 * e).collect::<Vec<_>>());
            set(&mut s, "area", &edge.iter().map(|e| d * e).collect::<Vec<_>>());
            s.set_number("T_ambient", 300.0).unwrap();
            let report = s.step(dt).unwrap_or_else(|e| panic!("{words} {hot} {dt}: {e}"));
            assert!(report.t_min >= 300.0 && report.t_max < hot, "{words} {hot} {dt}: {report:?}");
        }
    }
}

#[test]
fn a_body_that_radiates_alone_follows_its_equation() {
    // dT/dt = -rate T^4 from 1: T = (1 + 3 rate t)^(-1/3).
    let x = lattice(4, 2, 0.0);
    for rate in [1.0, 1e3, 1e6] {
        for (words, tolerance) in [("", 5e-3), ("integrator=sdirk2 tolerance=1e-5", 1e-3)] {
            let mut s = unit_box(words, &x, 2, true);
            let numbers = [("T", 1.0), ("emissivity", 1.0), ("area", 1.0 / 16.0), ("depth", 0.0), ("sigma_SB", rate)];
            numbers.iter().for_each(|(name, value)| s.set_number(name, *value).unwrap());
            let t = s.step(1.0).unwrap_or_else(|e| panic!("{words} {rate}: {e}")).t_min;
            let exact = (1.0 + 3.0 * rate).powf(-1.0 / 3.0);
            assert!((t / exact - 1.0).abs() < tolerance, "{words} {rate}: {t} {exact}");
        }
    }
}

#[test]
fn equal_temperatures_that_sums_do_not_find_equal_are_equal() {
    // Rounding of a mean of ones is no spread of T: every sixth of these strips was refused for it.
    for n in 15..70 {
        let d = 1.0 / f64::from(n);
        let x: Vec<f64> = (0..3 * n).flat_map(|i| [f64::from(i / 3) * d, f64::from(i % 3) * d]).collect();
        let mut s = Solver::new("heat dim=2").unwrap();
        s.set_box(&[0.0; 2], &[1.0, 3.0 * d], &[true, false]).unwrap();
        s.set_particles(diffusph::Strided::new("x", &x, x.len() / 2, 2, 2).unwrap()).unwrap();
        for (name, value) in [("m", d * d), ("rho", 1.0), ("kappa", 1.0), ("T", 1.0), ("h_conv", 1.0)] {
            s.set_number(name, value).unwrap();
        }
        let report = s.step(0.05).unwrap_or_else(|e| panic!("{n}: {e}"));
        assert!(report.t_max < 1.0 && report.t_min > 0.0, "{n}: {report:?}");
    }
}

#[test]
fn implicit_steps_keep_what_they_may_cost() {
    let x = particles();
    for method in ["backward-euler", "crank-nicolson", "sdirk2"] {
        let mut s = unit_box(&format!("integrator={method} max_applications=20"), &x, 2, true);
        let start = starts(&x)[0].1.clone();
        set(&mut s, "T", &start);
        let error = s.step(1.0).unwrap_err();
        // Or what was amiss with the sub-steps that it did try.
        assert!(["STEP_TOO_LARGE", "OUT_OF_BOUNDS"].contains(&error.name()), "{method}: {error}");
        assert_eq!(bits(&s.get_all("T").unwrap()), bits(&start));
    }
}

/// What a pulse of the host's does within one step of `limits` explicit limits: what came in, T and how often it was asked.
fn pulsed(words: &str, limits: f64, on: [f64; 2], what: &str) -> Result<(f64, Vec<f64>, f64), Error> {
    let x = lattice(16, 2, 0.2);
    let mut s = unit_box(&format!("kernel=M4 {words}"), &x, 2, true);
    let mut lens = unit_box("kernel=M4", &x, 2, true);
    lens.set_number("T", 0.0).unwrap();
    let dt = limits * lens.limit().unwrap();
    let is_on = move |time: f64| time > on[0] * dt && time < on[1] * dt;
    if what == "source" {
        s.set_number("T", 0.0).unwrap();
        s.set_source_callback(Some(Box::new(move |time, _, _, source| {
            source.fill(if is_on(time) { 1.0 / dt } else { 0.0 });
            0
        })));
    } else {
        set(&mut s, "T", &field(&x, 2, |p| (2.0 * PI * p[0]).sin()));
        s.set_kappa_callback(Some(Box::new(move |time, _, _, kappa| {
            kappa.fill(if is_on(time) { 1.0 } else { 0.0 });
            0
        })));
    }
    let report = s.step(dt)?;
    Ok((report.heat_source, s.get_all("T").unwrap(), dt))
}

#[test]
fn heat_that_comes_and_goes_within_a_step_is_not_lost() {
    for method in names("integrators") {
        for limits in [0.5, 2.0, 300.0] {
            for on in [[0.41, 0.6], [0.15, 0.29], [0.85, 0.99], [0.3, 1.1], [-1.0, 0.248], [-1.0, 0.155]] {
                let came = |words: &str| {
                    pulsed(&format!("integrator={method} {words}"), limits, on, "source").map(|(heat, ..)| heat)
                };
                let right = on[1].min(1.0) - on[0].max(0.0);
                // An edge is found to 1/4096 of the step, and errors of 1e-3 are none.
                for words in ["", "tolerance=1e-5"] {
                    let heat = came(words).unwrap_or_else(|e| panic!("{method} {words} {limits} {on:?}: {e}"));
                    assert!((heat - right).abs() < 4e-3, "{method} {words} {limits} {on:?}: {heat} for {right}");
                }
            }
        }
    }
    // A rate that rises from nothing, for methods that know one end of a sub-step.
    for method in ["euler", "backward-euler", "ssprk2"] {
        let x = lattice(16, 2, 0.2);
        let mut s = unit_box(&format!("kernel=M4 integrator={method}"), &x, 2, true);
        s.set_number("T", 0.0).unwrap();
        s.set_source_callback(Some(Box::new(|time, _, _, source| {
            source.fill(2.0 * time);
            0
        })));
        let heat = s.step(1.0).unwrap().heat_source;
        assert!((heat - 1.0).abs() < 0.04, "{method}: {heat}");
    }
    // What stages alone see of it.
    let lost = pulsed("integrator=rkl2 looks=0", 0.5, [0.41, 0.6], "source").unwrap();
    assert_eq!(lost.0, 0.0);
}

#[test]
fn a_layer_that_conducts_for_a_while_does_so() {
    for (method, limits) in [("auto", 0.5), ("auto", 50.0), ("rk4", 2.0), ("sdirk2", 50.0), ("crank-nicolson", 5.0)] {
        for on in [[0.41, 0.6], [0.15, 0.29]] {
            let words = format!("integrator={method} mean=arithmetic");
            let (_, t, dt) = pulsed(&words, limits, on, "kappa").unwrap();
            // The same without a pulse: a step as long as it, of a kappa that stays.
            let x = lattice(16, 2, 0.2);
            let mut s = unit_box("kernel=M4 integrator=rk4 tolerance=1e-8 mean=arithmetic", &x, 2, true);
            let start = field(&x, 2, |p| (2.0 * PI * p[0]).sin());
            set(&mut s, "T", &start);
            s.step((on[1] - on[0]) * dt).unwrap();
            let right = s.get_all("T").unwrap();
            let rms = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
            let (off, moved) = (rms(&t, &right), rms(&start, &right));
            assert!(
                off < 0.02 * moved + 3e-3 * rms(&start, &vec![0.0; start.len()]),
                "{method} {limits} {on:?}: {off} of {moved}"
            );
        }
    }
    let (_, t, _) = pulsed("integrator=rkl2 looks=0", 0.5, [0.41, 0.6], "kappa").unwrap();
    assert_eq!(t[0], field(&lattice(16, 2, 0.2), 2, |p| (2.0 * PI * p[0]).sin())[0]);
}

#[test]
fn a_source_that_switches_on_in_a_uniform_body_is_followed() {
    for method in names("integrators") {
        for from in [0.0, 300.0] {
            let x = lattice(12, 2, 0.2);
            let mut s = unit_box(&format!("kernel=M4 integrator={method} tolerance=1e-3"), &x, 2, true);
            s.set_number("T", from).unwrap();
            s.set_source_callback(Some(Box::new(move |time, _, _, source| {
                source.fill(if time < 0.37 { 0.0 } else { 2.0 });
                0
            })));
            let report = s.step(1.0).unwrap_or_else(|e| panic!("{method} from {from}: {e}"));
            assert!((report.heat_source - 1.26).abs() < 5e-3, "{method}: {report:?}");
        }
    }
}

/// Stiff, and hardly uneven: rounding of T must not be what is solved for.
#[test]
fn small_differences_of_large_temperatures_are_as_right_as_by_themselves() {
    for method in ["auto", "rkl2", "sdirk2", "backward-euler"] {
        for limits in [1e2, 1e6, 1e8] {
            let of = |offset: f64, size: f64| {
                let x = lattice(16, 2, 0.2);
                let mut s = unit_box(&format!("kernel=M4 integrator={method}"), &x, 2, true);
                set(&mut s, "kappa", &field(&x, 2, |p| if p[0] < 0.5 { 1.0 } else { 1e6 }));
                set(&mut s, "T", &field(&x, 2, |p| offset + size * (2.0 * PI * p[1]).cos()));
                set(&mut s, "fixed", &field(&x, 2, |p| f64::from(u8::from(p[1] < 0.1))));
                let dt = limits * s.limit().unwrap();
                let report = s.step(dt).map(|_| ());
                (report.is_ok(), s.get_all("T").unwrap().iter().map(|t| (t - offset) / size).collect::<Vec<_>>())
            };
            let (alone, on_top) = (of(0.0, 1.0), of(300.0, 1e-6));
            assert_eq!(alone.0, on_top.0, "{method} {limits}");
            let off = alone.1.iter().zip(&on_top.1).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            // 300 holds 1e-6 to 6e-8 of it at the beginning, and again at the end.
            assert!(off < 1e-6, "{method} {limits}: {off:e}");
        }
    }
}

#[test]
fn a_source_is_no_excuse_for_a_mode_that_grows() {
    let x = lattice(12, 2, 0.45);
    let scene = |words: &str| {
        let mut s = unit_box(&format!("kernel=M4 operator=direct allow=unstable integrator=rk4 {words}"), &x, 2, true);
        set(&mut s, "T", &field(&x, 2, |p| 300.0 + (2.0 * PI * p[0]).sin()));
        s
    };
    let growth = scene("").get_number("growth_rate").unwrap();
    assert!(growth > 0.0, "{growth}");
    let dt = 30.0 / growth;
    for (what, sources) in [("source", true), ("flux_in", true), ("fixed", false)] {
        for steps in [1, 10] {
            let mut s = scene("");
            let one = |v: f64| (0..144).map(|i| if i == 7 { v } else { 0.0 }).collect::<Vec<_>>();
            set(&mut s, "fixed", &one(1.0).into_iter().rev().collect::<Vec<_>>());
            if sources {
                set(&mut s, what, &one(1e-3));
                s.set_number("area", 1e-2).unwrap();
            }
            let refused = (0..steps).map(|_| s.step(dt / f64::from(steps))).find_map(Result::err);
            let name = refused.map(|e| e.name());
            assert!(matches!(name, Some("OUT_OF_BOUNDS" | "GROWTH")), "{what} {steps}: {name:?}");
            let t = s.get_all("T").unwrap();
            assert!(t.iter().all(|t| (298.0..302.0).contains(t)), "{what} {steps}");
        }
    }
    // What is heated by as much as its source gives is no mode that grows.
    let mut s = unit_box("kernel=M4 operator=two-first", &lattice(12, 2, 0.2), 2, true);
    set(&mut s, "T", &vec![300.0; 144]);
    set(&mut s, "source", &(0..144).map(|i| f64::from(i % 5) * 1e3).collect::<Vec<_>>());
    for _ in 0..5 {
        s.step(0.1).unwrap();
    }
    assert!((s.get_number("T_max").unwrap() - 1300.0).abs() < 50.0);
}

#[test]
fn heat_adds_up_on_an_offset() {
    for from in [0.0, 300.0, 1e6] {
        let x = lattice(50, 1, 0.3);
        let mut s = unit_box("kernel=C2 operator=kernel integrator=rkl2", &x, 1, true);
        s.set_number("T", from).unwrap();
        set(&mut s, "source", &field(&x, 1, |p| 1.0 + (2.0 * PI * p[0]).cos()));
        let dt = 1e6 * s.limit().unwrap();
        let report = s.step(dt).unwrap();
        let gained = report.energy - report.energy_before;
        assert!(
            (gained - report.heat_source).abs() < 1e-9 * gained.abs() + 1e-13 * from,
            "{from}: {gained} {report:?}"
        );
    }
}
