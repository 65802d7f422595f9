//! Exchange with the outside beyond all measure, and what has come to rest: steps end, at the right answer or at once.

use crate::particles::*;
use diffusph::{Solver, Strided};

/// A cube at 300 to 424 K of which every particle exchanges heat with its surroundings.
fn exposed(words: &str, exchange: &[(&str, f64)]) -> Solver {
    let x = lattice(5, 3, 0.0);
    let mut s = Solver::new(&format!("heat dim=3 max_applications=40000 {words}")).unwrap();
    s.set_box(&[0.0; 3], &[1.0; 3], &[false; 3]).unwrap();
    s.set_particles(Strided::new("x", &x, 125, 3, 3).unwrap()).unwrap();
    for &(name, value) in [("m", 1.0 / 125.0), ("rho", 1.0), ("kappa", 1.0)].iter().chain(exchange) {
        s.set_number(name, value).unwrap();
    }
    set(&mut s, "T", &(0..125).map(|i| 300.0 + f64::from(i)).collect::<Vec<_>>());
    s
}

/// Methods that keep bounds, or errors, by the length of their sub-steps.
const ADAPTING: [&str; 6] = [
    "",
    "operator=projected",
    "integrator=sdirk2",
    "integrator=sdirk2 tolerance=1e-4",
    "integrator=crank-nicolson tolerance=1e-4",
    "integrator=backward-euler",
];

/// Sub-steps stayed short for ever where rounding carried values over a bound at which they had come to rest.
#[test]
fn what_has_come_to_rest_at_a_bound_goes_on_in_long_sub_steps() {
    for words in ADAPTING {
        for (t_ambient, dt) in [(5000.0, 1e3), (5000.0, 1e8), (300.0, 1e8), (424.0, 1e5)] {
            let mut s = exposed(words, &[("emissivity", 1.0), ("T_ambient", t_ambient)]);
            let report = s.step(dt).unwrap_or_else(|e| panic!("{words} {t_ambient} {dt:e}: {e}"));
            let (low, high) = (report.t_min.min(t_ambient), report.t_max.max(t_ambient));
            // dt is at least 5e4 relaxation times, of which one sub-step of backward Euler leaves the inverse.
            assert!(high - low < 1e-4 * t_ambient, "{words} {t_ambient} {dt:e}: {low} to {high}");
            assert!(report.substeps < 100, "{words} {t_ambient} {dt:e}: {}", report.substeps);
        }
    }
}

/// The rate of a method that overflowed was no number, and neither was the estimate of its error: no sub-step was too short.
#[test]
fn exchange_beyond_all_measure_is_done_or_refused_at_once() {
    let cell = 1.0 / 125.0;
    for words in ADAPTING.iter().chain(&["integrator=rkl2", "integrator=euler"]) {
        for (name, value, t_ambient, dt) in [
            ("flux_in", 1e200, 0.0, 1.0),
            ("flux_in", -1e200, 0.0, 1.0),
            ("flux_in", 1e200, 0.0, 1e-3),
            ("h_conv", 1e200, 1e100, 1.0),
            ("h_conv", 1e200, 300.0, 1.0),
            ("emissivity", 1.0, 1e70, 1e8),
        ] {
            let case = format!("{words} {name}={value:e} T_ambient={t_ambient:e} dt={dt:e}");
            let mut s = exposed(words, &[(name, value), ("T_ambient", t_ambient)]);
            let areas: f64 = s.get_all("area").unwrap().iter().sum();
            match s.step(dt) {
                Ok(report) if name == "flux_in" => {
                    let came_in = report.energy / (value * areas * dt);
                    assert!((came_in - 1.0).abs() < 1e-9, "{case}: {came_in}");
                }
                // What is left of the way is that of one long sub-step of order 1.
                Ok(report) => {
                    let mean = report.energy / (125.0 * cell);
                    assert!((mean / t_ambient - 1.0).abs() < 0.05, "{case}: {mean:e}");
                }
                Err(e) => {
                    assert!(e.code() == 1 && name == "emissivity", "{case}: {e}");
                }
            }
        }
    }
}

#[test]
fn what_radiates_does_not_fall_below_absolute_zero() {
    for words in ADAPTING.iter().chain(&["integrator=rkl2", "integrator=euler bounds=free"]) {
        let mut s = exposed(words, &[("emissivity", 1e-3), ("source", -2e4)]);
        let before = s.get_all("T").unwrap();
        let error = s.step(0.1).unwrap_err();
        assert!(error.to_string().contains("absolute temperatures"), "{words}: {error}");
        assert_eq!(s.get_all("T").unwrap(), before, "{words}");
        s.step(1e-3).unwrap();
    }
}

/// However short the step.
#[test]
fn a_rate_that_is_no_number_names_the_particle() {
    for words in ADAPTING.iter().chain(&["integrator=rkl2", "integrator=euler", "operator=limited"]) {
        for (name, value) in [("source", 1.7e308), ("flux_in", 1.7e308), ("h_conv", 1e308)] {
            for dt in [5e-324, 1e-300, 1e-5] {
                let mut s = exposed(words, &[]);
                let mut values = vec![0.0; 125];
                values[5] = value;
                set(&mut s, name, &values);
                // Capacities of 8e-3: 1.7e308 of them are no number.
                s.set_number("c_v", 1e-3).unwrap();
                match s.step(dt) {
                    Err(e) => assert!(
                        e.to_string().contains("particle 5") || e.to_string().contains("[5]"),
                        "{words} {name} {dt:e}: {e}"
                    ),
                    Ok(report) => assert!(report.t_max.is_finite(), "{words} {name} {dt:e}"),
                }
            }
        }
    }
}
