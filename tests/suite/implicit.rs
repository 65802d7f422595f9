//! Implicit integrators on particles: bounds and energy at any step, orders, steady states in one step, nonlinear laws.

use crate::particles::*;
use diffusph::Solver;
use diffusph::study::exact::slab::Slab;
use diffusph::study::exact::steady::radiative_cooling;
use std::f64::consts::PI;

const METHODS: [&str; 3] = ["backward-euler", "crank-nicolson", "sdirk2"];

/// The hot disc, 10 : 0.1, on 4096 jittered particles with unequal capacities.
fn disc(words: &str) -> Solver {
    let x = lattice(64, 2, 0.2);
    let mut s = unit_box(words, &x, 2, true);
    set(&mut s, "c_v", &field(&x, 2, |p| 1.0 + p[1]));
    set(&mut s, "T", &field(&x, 2, |p| if (p[0] - 0.5).hypot(p[1] - 0.5) < 0.25 { 10.0 } else { 0.1 }));
    s
}

#[test]
fn bounds_and_energy_are_kept_at_any_step() {
    for tolerance in [1e-2, 1e-8, 1e-10] {
        for stiffness in [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6] {
            for method in METHODS {
                let mut s = disc(&format!("integrator={method} solver_tolerance={tolerance}"));
                let limit = s.limit().unwrap();
                let report = s.step(stiffness * limit).unwrap();
                assert!(report.limit > 0.5 * limit && report.limit <= limit);
                let drift = report.energy / report.energy_before - 1.0;
                // Rounding of the two sums.
                assert!(drift.abs() < 1e-12, "{method} {stiffness} {tolerance}: {drift:e}");
                if method == "backward-euler" {
                    // The promise: no further outside than the residual, which is relative to a change of at most 9.9
                    // and, at R = 1e6, rounded at 4 eps (1 + 1e6) 10.
                    let slack = 2.0 * (9.9 * tolerance + 4.0 * f64::EPSILON * stiffness * 10.0) + 1e-12;
                    let outside = (0.1 - report.t_min).max(report.t_max - 10.0);
                    assert!(outside <= slack, "{stiffness} {tolerance}: {outside:e} {slack:e}");
                }
                if stiffness == 1e6 && method != "crank-nicolson" && tolerance < 1e-2 {
                    // The slowest wave decays at 20 or faster and the step is some 60 long: one over a thousand is left.
                    assert!(report.t_max - report.t_min < 0.01 * 9.9, "{method}: {}", report.t_max - report.t_min);
                }
            }
        }
    }
}

#[test]
fn a_wave_decays_at_the_order_of_the_method() {
    // On a periodic lattice a sine is an eigenvector: only the error in time is left.
    let x = lattice(32, 2, 0.0);
    let sine = field(&x, 2, |p| (2.0 * PI * p[0]).sin());
    for (method, order) in METHODS.iter().zip([1.0, 2.0, 2.0]) {
        let error = |steps: u32| {
            let mut s = unit_box(&format!("integrator={method}"), &x, 2, true);
            set(&mut s, "T", &sine);
            let eigenvalue = -s.get_all("rate").unwrap()[5] / sine[5];
            let end = 1.0 / eigenvalue;
            for _ in 0..steps {
                s.step(end / f64::from(steps)).unwrap();
            }
            let exact: Vec<f64> = sine.iter().map(|v| v * (-1.0f64).exp()).collect();
            l2(&s.get_all("T").unwrap(), &exact)
        };
        let measured = (error(20) / error(40)).log2();
        assert!((measured - order).abs() < 0.1, "{method}: {measured}");
    }
}

#[test]
fn short_steps_are_those_of_explicit_methods() {
    let run = |words: &str| {
        let mut s = disc(words);
        let limit = s.limit().unwrap();
        for _ in 0..8 {
            s.step(0.02 * limit).unwrap();
        }
        s.get_all("T").unwrap()
    };
    let reference = run("integrator=ssprk3");
    // Eight steps whose local errors are (0.04)²/2 and (0.04)³ of what the fastest wave holds.
    for (method, tolerance) in METHODS.iter().zip([8e-4, 4e-5, 4e-5]) {
        let off = l2(&run(&format!("integrator={method}")), &reference);
        assert!(off > 0.0 && off < tolerance, "{method}: {off:e}");
    }
}

#[test]
fn one_giant_step_reaches_the_steady_parabola() {
    let slab = Slab { a: 0.0, b: 1.0, kappa: 1.0, capacity: 1.0 };
    let x: Vec<f64> = (0..56).map(|i| (f64::from(i) - 7.5) / 40.0).collect();
    for operator in ["brookshaw", "kernel"] {
        for method in ["backward-euler", "sdirk2"] {
            let mut s = unit_box(&format!("integrator={method} operator={operator}"), &x, 1, false);
            s.set_number("m", 1.0 / 40.0).unwrap();
            s.set_number("source", 8.0).unwrap();
            let exact = |x: f64| slab.between([1.0, 3.0], 8.0, x);
            let fixed = field(&x, 1, |p| f64::from(!(0.0..=1.0).contains(&p[0])));
            set(&mut s, "fixed", &fixed);
            let start: Vec<f64> = x.iter().zip(&fixed).map(|(&x, &f)| f * exact(x)).collect();
            set(&mut s, "T", &start);
            s.step(1e9).unwrap();
            let t = s.get_all("T").unwrap();
            let worst = x.iter().zip(&t).map(|(&x, t)| (t - exact(x)).abs()).fold(0.0, f64::max);
            // Of the start 1/(1e9 pi²) is left, of sdirk2 a few times that; eps times the condition number is less.
            assert!(worst < 1e-8, "{method} {operator}: {worst:e}");
            assert!((0..x.len()).all(|i| fixed[i] == 0.0 || t[i].to_bits() == start[i].to_bits()));
        }
    }
}

#[test]
fn the_outside_is_part_of_the_equations() {
    let lone = |words: &str, name: &str, value: f64| {
        let mut s = unit_box(&format!("kernel=M4 {words}"), &[0.0], 1, false);
        for (name, value) in [("h", 0.1), ("c_v", 2.0), ("m", 3.0), ("area", 0.7), ("depth", 0.0), (name, value)] {
            s.set_number(name, value).unwrap();
        }
        s
    };
    for dt in [0.1, 10.0, 1e6] {
        let mut s = lone("integrator=backward-euler", "h_conv", 5.0);
        s.set_number("T", 2.0).unwrap();
        s.set_number("T_ambient", 0.5).unwrap();
        s.step(dt).unwrap();
        let k = dt * 0.7 * 5.0 / 6.0;
        let exact = (2.0 + k * 0.5) / (1.0 + k);
        // The solver's tolerance.
        assert!((s.get_all("T").unwrap()[0] - exact).abs() < 1e-9, "{dt}");
    }
    for method in ["crank-nicolson", "sdirk2"] {
        let mut s = lone(&format!("integrator={method}"), "emissivity", 0.5);
        s.set_number("T", 400.0).unwrap();
        let sigma = s.get_number("sigma_SB").unwrap();
        for _ in 0..200 {
            s.step(0.05).unwrap();
        }
        let exact = radiative_cooling(400.0, 0.7 * 0.5 * sigma / 6.0, 10.0);
        let off = s.get_all("T").unwrap()[0] / exact - 1.0;
        // Second order; the first step changes T by a hundredth: 1e-6 times 200 at most, and far less later on.
        assert!(off.abs() < 5e-5, "{method}: {off:e}");
    }
}

#[test]
fn conductivity_that_depends_on_temperature() {
    let x = lattice(24, 2, 0.2);
    let run = |words: &str, steps: u32| {
        let mut s = unit_box(&format!("kernel=M4 mean=arithmetic {words}"), &x, 2, true);
        s.set_law("kappa", "power n=2.5").unwrap();
        set(&mut s, "T", &field(&x, 2, |p| 1.5 + (2.0 * PI * p[0]).sin()));
        for _ in 0..steps {
            let report = s.step(4e-3 / f64::from(steps)).unwrap();
            assert!((report.energy / report.energy_before - 1.0).abs() < 1e-12);
        }
        s.get_all("T").unwrap()
    };
    let reference = run("integrator=ssprk3", 1);
    for (method, order) in METHODS.iter().zip([1.0, 2.0, 2.0]) {
        let words = format!("integrator={method}");
        let (coarse, fine) = (l2(&run(&words, 16), &reference), l2(&run(&words, 32), &reference));
        let measured = (coarse / fine).log2();
        // Waves that 16 steps do not resolve blur the order a little.
        assert!((measured - order).abs() < 0.25 && fine < 5e-3, "{method}: {measured} {fine:e}");
    }
}

#[test]
fn stiffness_costs_iterations_until_heat_has_crossed_the_box() {
    let x = lattice(16, 3, 0.2);
    let mut last = 0;
    for stiffness in [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6] {
        let words = "kernel=M4 integrator=backward-euler solver_tolerance=1e-8 preconditioner=jacobi";
        let mut s = unit_box(words, &x, 3, true);
        set(&mut s, "T", &field(&x, 3, |p| if p.iter().all(|c| (c - 0.5).abs() < 0.25) { 10.0 } else { 0.1 }));
        let limit = s.limit().unwrap();
        let applications = s.step(stiffness * limit).unwrap().applications;
        println!("R = {stiffness}: {applications}");
        // More work for a stiffer step, but never what an explicit method would need.
        assert!(applications >= last && applications < 250, "{stiffness}: {applications}");
        last = applications;
    }
}

#[test]
fn an_unsolved_step_changes_nothing() {
    for method in METHODS {
        let mut s = disc(&format!("integrator={method} max_iterations=12 preconditioner=jacobi"));
        let before = bits(&s.get_all("T").unwrap());
        let limit = s.limit().unwrap();
        let e = s.step(1e4 * limit).unwrap_err();
        assert_eq!(e.name(), "NOT_CONVERGED", "{e}");
        assert!(e.to_string().contains("max_iterations") && e.to_string().contains("nothing was changed"), "{e}");
        assert_eq!((bits(&s.get_all("T").unwrap()), s.get_number("time").unwrap()), (before, 0.0));
        s.step(0.1 * limit).unwrap();
    }
}

#[test]
fn threads_do_not_change_a_bit_and_the_plan_says_what_runs() {
    for method in METHODS {
        let run = |threads: usize| {
            let mut s = disc(&format!("integrator={method} threads={threads}"));
            let limit = s.limit().unwrap();
            s.step(300.0 * limit).unwrap();
            let plan = s.plan().unwrap();
            let has = |name: &str| plan.passes.iter().any(|line| line.pass.name.0 == name);
            assert!(has("solve") && !has("bound") && !has("stages"), "{plan}");
            bits(&s.get_all("T").unwrap())
        };
        assert_eq!(run(1), run(3), "{method}");
    }
}
