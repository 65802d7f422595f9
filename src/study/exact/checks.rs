//! What each solution of the table is held against, as a scene asks for it: its equation, by differences; its initial
//! and boundary conditions; and a number from somewhere else.
//!
//! The numbers come from other programs: convolution with the heat kernel by quadrature, finite volumes of 1000 and 2000
//! cells with an implicit method of order 5, an ordinary equation to 12 digits; or from a few lines by hand.

use super::laws::{Medium, violated};
use super::{Exact, Parameters, SOLUTIONS, find};
use std::collections::BTreeMap;

/// kappa(T), rho c_v and the source at a place.
type Material = (fn(f64) -> f64, f64, f64);

/// What is and what must be, and how near, absolutely.
type Condition = (f64, f64, f64);

struct Check {
    name: &'static str,
    dims: &'static [usize],
    given: &'static [(&'static str, &'static [f64])],
    material: fn([f64; 3]) -> Material,
    /// Places and times where the equation is tried.
    places: &'static [[f64; 3]],
    times: &'static [f64],
    /// Of an exact solution in so many dimensions.
    conditions: fn(&Exact, usize) -> Vec<Condition>,
    /// In the first of `dims`: place, time, T, how near.
    known: &'static [([f64; 3], f64, f64, f64)],
    steady: bool,
}

const PLAIN: Check = Check {
    name: "",
    dims: &[1, 2, 3],
    given: &[],
    material: |_| (|_| 0.3, 1.0, 0.0),
    places: &[[0.13, 0.31, 0.4], [0.4, 0.1, -0.2], [-0.3, 0.22, 0.05]],
    times: &[0.02, 0.2],
    conditions: |_, _| Vec::new(),
    known: &[],
    steady: false,
};

/// A slab from -0.2 to 0.5, kappa = 0.6, rho c_v = 2.
const SLAB: Check = Check {
    dims: &[1, 3],
    material: |_| (|_| 0.6, 2.0, 0.0),
    places: &[[0.0, 0.1, 0.2], [0.3, 0.0, 0.0], [0.45, 0.0, 0.0]],
    ..PLAIN
};

/// dT/dx, one-sided of second order: to the left for a negative d.
fn slope(f: &Exact, x: f64, t: f64, d: f64) -> f64 {
    let at = |x: f64| f([x, 0.0, 0.0], t);
    (-1.5 * at(x) + 2.0 * at(x + d) - 0.5 * at(x + 2.0 * d)) / d
}

static CHECKS: &[Check] = &[
    Check {
        name: "sine",
        dims: &[2, 1, 3],
        given: &[
            ("waves", &[1.0, 2.0, 1.0]),
            ("mean", &[2.0]),
            ("amplitude", &[0.7]),
            ("kappa", &[0.3]),
            ("rho", &[2.0]),
            ("c_v", &[0.5]),
        ],
        // Waves of half a length decay by e^60 in the time that others have.
        times: &[0.005, 0.02],
        conditions: |f, dim| {
            let start = 2.0 + 0.7 * [1.0, 0.5f64.sqrt(), 1.0][..dim].iter().product::<f64>();
            vec![(f([0.25, 0.0625, 0.25], 0.0), start, 1e-14), (f([1.25, -0.9375, 5.25], 0.0), start, 1e-13)]
        },
        known: &[([0.13, 0.31, 0.0], 0.02, 1.8931308268736222, 1e-12)],
        ..PLAIN
    },
    Check {
        name: "gaussian",
        dims: &[2, 1, 3],
        given: &[
            ("s", &[0.3]),
            ("mean", &[1.0]),
            ("amplitude", &[3.0]),
            ("centre", &[0.1, -0.1, 0.05]),
            ("kappa", &[0.6]),
            ("c_v", &[2.0]),
        ],
        conditions: |f, _| vec![(f([0.1, -0.1, 0.05], 0.0), 4.0, 1e-14), (f([9.0, 0.0, 0.0], 0.2), 1.0, 1e-12)],
        known: &[([0.4, 0.1, 0.0], 0.2, 1.9434523855215402, 1e-12)],
        ..PLAIN
    },
    Check {
        name: "contact",
        given: &[("at", &[0.02]), ("T", &[400.0, 300.0]), ("kappa", &[10.0, 0.2]), ("capacity", &[2.0, 5.0])],
        material: |x| if x[0] < 0.02 { (|_| 10.0, 2.0, 0.0) } else { (|_| 0.2, 5.0, 0.0) },
        places: &[[-0.28, 0.1, 0.0], [0.12, 0.0, 0.3], [0.3, 0.0, 0.0]],
        times: &[0.1, 0.4],
        conditions: |f, _| {
            let flux = |kappa: f64, d: f64| kappa * slope(f, 0.02, 0.1, d);
            // Fronts of 4 kappa/capacity t at t = 1e-9 are far from both places.
            vec![
                (f([0.0; 3], 1e-9), 400.0, 1e-9),
                (f([0.04, 0.0, 0.0], 1e-9), 300.0, 1e-9),
                (f([0.02f64.next_down(), 0.0, 0.0], 0.1), f([0.02, 0.0, 0.0], 0.1), 1e-9),
                // Differences of second order: 1e-8 of the flux.
                (flux(10.0, -1e-5) / flux(0.2, 1e-5), 1.0, 1e-6),
            ]
        },
        // Extrapolated from the two grids, which differ by 1e-5 and 1e-4.
        known: &[([-0.28, 0.0, 0.0], 0.1, 386.035121, 1e-5), ([0.12, 0.0, 0.0], 0.1, 321.538984, 1e-4)],
        ..PLAIN
    },
    Check {
        name: "barenblatt",
        given: &[("n", &[2.5]), ("a", &[0.7]), ("strength", &[1.3])],
        material: |_| (|t| 0.7 * t.powf(2.5), 1.0, 0.0),
        places: &[[0.1, 0.05, 0.02], [-0.2, 0.3, 0.1], [0.4, -0.2, 0.1]],
        times: &[0.2, 0.4],
        conditions: |f, dim| {
            let power = dim as f64 - 1.0;
            let heat = |t: f64| -> f64 {
                let d = 2.5e-4;
                (0..20_000).map(|i| (f64::from(i) + 0.5) * d).map(|r| d * r.powf(power) * f([r, 0.0, 0.0], t)).sum()
            };
            // The midpoint rule at a front that rises as the root of 2.5: d^1.4 = 1e-5.
            vec![(heat(0.4) / heat(0.2), 1.0, 1e-4), (f([4.0, 0.0, 0.0], 0.4), 0.0, 0.0)]
        },
        // The steep front of a grid of 1000 cells is seen at its foot.
        known: &[([0.0; 3], 0.4, 1.36147, 1e-4), ([0.8, 0.0, 0.0], 0.4, 1.18477, 1e-4)],
        ..PLAIN
    },
    Check {
        name: "slab",
        given: &[("x", &[-0.2, 0.5]), ("T", &[3.0, 5.0]), ("source", &[7.0]), ("kappa", &[0.6])],
        material: |_| (|_| 0.6, 1.0, 7.0),
        conditions: |f, _| vec![(f([-0.2, 0.0, 0.0], 1.0), 3.0, 1e-13), (f([0.5, 0.0, 0.0], 1.0), 5.0, 1e-13)],
        // In the middle: 4 + 7 · 0.7²/(8 · 0.6).
        known: &[([0.15, 0.0, 0.0], 1.0, 4.714583333333333, 1e-12)],
        steady: true,
        ..SLAB
    },
    Check {
        name: "layers",
        given: &[("x", &[0.0, 0.3, 1.0]), ("T", &[400.0, 300.0]), ("kappa", &[2.0, 0.1])],
        material: |x| if x[0] < 0.3 { (|_| 2.0, 1.0, 0.0) } else { (|_| 0.1, 1.0, 0.0) },
        places: &[[0.1, 0.0, 0.0], [0.5, 0.2, 0.0], [0.9, 0.0, 0.0]],
        conditions: |f, _| {
            vec![
                (f([0.0; 3], 0.0), 400.0, 1e-12),
                (f([1.0, 0.0, 0.0], 0.0), 300.0, 1e-12),
                (f([0.3f64.next_down(), 0.0, 0.0], 0.0), f([0.3, 0.0, 0.0], 0.0), 1e-9),
                (20.0 * slope(f, 0.3, 0.0, -0.01) / slope(f, 0.3, 0.0, 0.01), 1.0, 1e-9),
            ]
        },
        // Resistances 0.15 and 7: the contact is at 400 - 100 · 0.15/7.15.
        known: &[([0.3, 0.0, 0.0], 0.0, 397.9020979020979, 1e-10)],
        steady: true,
        ..SLAB
    },
    Check {
        name: "shell",
        dims: &[2, 1, 3],
        given: &[("radius", &[0.2, 0.8]), ("T", &[5.0, 3.0]), ("centre", &[0.1, 0.0, -0.1])],
        places: &[[0.6, 0.1, 0.2], [0.5, -0.4, 0.1]],
        conditions: |f, dim| {
            let z = if dim == 3 { -0.1 } else { 0.0 };
            // Half way in log r, or in 1/r.
            let middle = [0.5, 0.4, 0.32][dim - 1];
            let at = |r: f64| f([0.1 + r, 0.0, z], 0.0);
            vec![(at(0.2), 5.0, 1e-13), (at(0.8), 3.0, 1e-13), (at(middle), 4.0, 1e-13)]
        },
        known: &[([0.5, 0.0, 0.0], 0.0, 4.0, 1e-12)],
        steady: true,
        ..PLAIN
    },
    Check {
        name: "losing_slab",
        given: &[
            ("x", &[-0.2, 0.5]),
            ("fixed", &[400.0]),
            ("h_conv", &[2.5]),
            ("T_ambient", &[300.0]),
            ("kappa", &[0.6]),
        ],
        conditions: |f, _| {
            let lost = 2.5 * (f([0.5, 0.0, 0.0], 0.0) - 300.0);
            vec![(f([-0.2, 0.0, 0.0], 0.0), 400.0, 1e-12), (-0.6 * slope(f, 0.5, 0.0, -1e-2) / lost, 1.0, 1e-9)]
        },
        // Resistances 0.7/0.6 and 1/2.5.
        known: &[([0.5, 0.0, 0.0], 0.0, 325.531914893617, 1e-9)],
        steady: true,
        ..SLAB
    },
    Check {
        name: "radiating_slab",
        given: &[
            ("x", &[-0.2, 0.8]),
            ("fixed", &[1000.0]),
            ("emissivity", &[0.5]),
            ("T_ambient", &[300.0]),
            ("kappa", &[3.084683683936]),
        ],
        material: |_| (|_| 3.084683683936, 1.0, 0.0),
        conditions: |f, _| {
            let lost = 0.5 * 5.670374419e-8 * (f([0.8, 0.0, 0.0], 0.0).powi(4) - 300f64.powi(4));
            vec![
                (f([-0.2, 0.0, 0.0], 0.0), 1000.0, 1e-12),
                (-3.084683683936 * slope(f, 0.8, 0.0, -1e-2) / lost, 1.0, 1e-8),
            ]
        },
        // kappa is such that 500 K radiate what conducts: 0.5 sigma (500⁴ - 300⁴) = 500 kappa.
        known: &[([0.8, 0.0, 0.0], 0.0, 500.0, 1e-7)],
        steady: true,
        ..SLAB
    },
    Check {
        name: "heated_slab",
        given: &[
            ("x", &[-0.2, 0.5]),
            ("initial", &[300.0]),
            ("flux_in", &[50.0]),
            ("kappa", &[0.6]),
            ("rho", &[4.0]),
            ("c_v", &[0.5]),
        ],
        conditions: |f, _| {
            vec![
                (f([0.3, 0.0, 0.0], 0.0), 300.0, 0.0),
                (f([0.3, 0.0, 0.0], 1e-4), 300.0, 1e-9),
                (0.6 * slope(f, 0.5, 0.2, -1e-4) / 50.0, 1.0, 1e-5),
                (slope(f, -0.2, 0.2, 1e-4), 0.0, 1e-3),
            ]
        },
        known: &[([0.3, 0.0, 0.0], 0.2, 310.1058325, 1e-6), ([-0.1, 0.0, 0.0], 0.2, 301.1817712, 1e-6)],
        ..SLAB
    },
    Check {
        name: "cooling_slab",
        given: &[
            ("x", &[-0.2, 0.5]),
            ("initial", &[400.0]),
            ("h_conv", &[3.0]),
            ("T_ambient", &[300.0]),
            ("kappa", &[0.6]),
            ("rho", &[2.0]),
        ],
        conditions: |f, _| {
            let lost = 3.0 * (f([0.5, 0.0, 0.0], 0.2) - 300.0);
            vec![
                (f([0.3, 0.0, 0.0], 0.0), 400.0, 0.0),
                (f([0.0, 0.0, 0.0], 1e-3), 400.0, 1e-9),
                (-0.6 * slope(f, 0.5, 0.2, -1e-4) / lost, 1.0, 1e-4),
                (slope(f, -0.2, 0.2, 1e-4), 0.0, 1e-2),
            ]
        },
        known: &[([0.3, 0.0, 0.0], 0.2, 369.1006538, 2e-6), ([-0.1, 0.0, 0.0], 0.2, 395.6702106, 2e-6)],
        ..SLAB
    },
    Check {
        name: "radiative_cooling",
        given: &[("initial", &[900.0]), ("rate", &[2e-9])],
        // No conduction: its own equation is the first condition.
        places: &[],
        conditions: |f, _| {
            let (at, d) = (|t: f64| f([0.2; 3], t), 1e-5);
            let rate = (at(0.3 + d) - at(0.3 - d)) / (2.0 * d);
            vec![(rate / (-2e-9 * at(0.3).powi(4)), 1.0, 1e-8), (at(0.0), 900.0, 1e-9)]
        },
        known: &[([0.0; 3], 0.3, 680.6137372586535, 1e-7)],
        ..PLAIN
    },
];

impl Check {
    fn exact(&self, dim: usize) -> Exact {
        let given: Parameters = self.given.iter().map(|(k, v)| (k.to_string(), v.to_vec())).collect();
        find(self.name, dim, given, &BTreeMap::new()).unwrap()
    }

    /// What is wrong with a solution in so many dimensions.
    fn complaint(&self, f: &Exact, dim: usize) -> Option<String> {
        let tries = self.places.iter().flat_map(|x| self.times.iter().map(move |t| (*x, *t)));
        let violation = tries.into_iter().find_map(|(x, t)| {
            let (kappa, capacity, source) = (self.material)(x);
            violated(dim, Medium { kappa: &kappa, capacity, source }, f, x, t)
        });
        let near = |(is, must, by): &(f64, f64, f64)| (is - must).abs() <= *by;
        let condition = (self.conditions)(f, dim).into_iter().find(|c| !near(c)).map(|c| format!("condition {c:?}"));
        let known = self.known.iter().filter(|_| dim == self.dims[0]);
        let number = known.map(|&(x, t, must, by)| (f(x, t), must, by)).find(|c| !near(c));
        violation.or(condition).or(number.map(|c| format!("number {c:?}")))
    }
}

#[test]
fn every_solution_obeys_its_equation_its_conditions_and_a_number_from_elsewhere() {
    for solution in SOLUTIONS {
        let check = CHECKS.iter().find(|c| c.name == solution.name);
        let check = check.unwrap_or_else(|| panic!("nothing to hold {} against", solution.name));
        assert!(!check.known.is_empty() && !(check.conditions)(&check.exact(check.dims[0]), check.dims[0]).is_empty());
        for &dim in check.dims {
            if let Some(complaint) = check.complaint(&check.exact(dim), dim) {
                panic!("{} in {dim}-D: {complaint}", check.name);
            }
        }
    }
}

#[test]
fn solutions_that_are_wrong_are_noticed() {
    for check in CHECKS {
        let dim = check.dims[0];
        // erf(x/sqrt(5 D t)) in place of erf(x/sqrt(4 D t)), a place and a size that are off by some per cent or less.
        type Spoil = fn(Exact) -> Exact;
        let wrong: [(&str, Spoil); 3] = [
            ("time", |f| Box::new(move |x, t| f(x, 1.25 * t))),
            ("place", |f| Box::new(move |x, t| f([1.02 * x[0] + 0.01, x[1], x[2]], t))),
            ("size", |f| Box::new(move |x, t| 1.001 * f(x, t))),
        ];
        for (what, make) in wrong {
            let blind = what == "time" && check.steady || what == "place" && check.name == "radiative_cooling";
            let complaint = check.complaint(&make(check.exact(dim)), dim);
            assert!(blind || complaint.is_some(), "{} with a wrong {what} passes", check.name);
        }
    }
}
