//! The multigrid preconditioner of implicit integrators: few iterations at any number of particles, the answer of the
//! diagonal, and scenes in which some particles couple to few or to none.

use crate::particles::*;
use diffusph::Solver;

const STIFF: f64 = 1e6;

fn hot_cube(words: &str, n: usize) -> Solver {
    let x = lattice(n, 3, 0.2);
    let words = format!("kernel=M4 integrator=backward-euler solver_tolerance=1e-8 {words}");
    let mut s = unit_box(&words, &x, 3, true);
    set(&mut s, "T", &field(&x, 3, |p| if p.iter().all(|c| (c - 0.5).abs() < 0.25) { 10.0 } else { 0.1 }));
    s
}

/// An open box of jittered particles with unequal capacities, as `change` makes it.
fn open_box(words: &str, (n, dim): (usize, usize), change: Change) -> Solver {
    let x = lattice(n, dim, 0.2);
    let words = format!("kernel=M4 integrator=backward-euler solver_tolerance=1e-8 {words}");
    let mut s = unit_box(&words, &x, dim, false);
    set(&mut s, "c_v", &field(&x, dim, |p| 1.0 + p[dim - 1]));
    set(&mut s, "T", &field(&x, dim, |p| if p[0] < 0.3 { 10.0 } else { 1.0 }));
    change(&mut s, &|f| field(&x, dim, f));
    s
}

/// What makes a scene of a box, from a function that evaluates another at each particle.
type Change = fn(&mut Solver, &dyn Fn(fn(&[f64]) -> f64) -> Vec<f64>);

const SCENES: [(&str, Change); 8] = [
    ("plain", |_, _| {}),
    ("jump", |s, at| set(s, "kappa", &at(|p| if p[0] < 0.5 { 1e3 } else { 1e-3 }))),
    ("insulator", |s, at| set(s, "kappa", &at(|p| f64::from((p[0] - 0.5).abs() > 0.1)))),
    ("fixed", |s, at| set(s, "fixed", &at(|p| f64::from(p[0] < 0.1)))),
    ("all fixed", |s, _| s.set_number("fixed", 1.0).unwrap()),
    ("cooled", |s, at| {
        set(s, "h_conv", &at(|p| 5.0 * f64::from(p[0] < 0.05)));
        s.set_number("T_ambient", 0.5).unwrap();
    }),
    ("masses", |s, at| {
        // Lengths that follow: up to twice as long.
        let m = at(|p| 1.0 + p[0]);
        set(s, "m", &m.iter().map(|v| v / m.len() as f64).collect::<Vec<_>>());
    }),
    ("law", |s, _| s.set_law("kappa", "power n=1.5").unwrap()),
];

/// T after two steps, and the iterations of the second.
fn two_steps(s: &mut Solver, dt: f64) -> (Vec<f64>, u64) {
    s.step(dt).unwrap();
    let report = s.step(dt).unwrap();
    (s.get_all("T").unwrap(), report.iterations)
}

#[test]
fn iterations_do_not_grow_with_the_number_of_particles() {
    let counts = [12, 22, 46].map(|n| {
        let mut s = hot_cube("", n);
        let limit = s.limit().unwrap();
        let report = s.step(STIFF * limit).unwrap();
        assert!((report.energy / report.energy_before - 1.0).abs() < 1e-12);
        assert!(s.plan().unwrap().to_string().contains("multigrid where dt is"));
        report.iterations
    });
    println!("{counts:?} iterations");
    assert!(counts.iter().all(|&c| c > 0 && c <= 15), "{counts:?}");
    assert!(counts[2] <= counts[1] + 2, "{counts:?}");
}

#[test]
fn both_preconditioners_give_one_answer() {
    for (n, dim) in [(300, 1), (40, 2), (12, 3)] {
        let limit = open_box("", (n, dim), |_, _| {}).limit().unwrap();
        // In 1-D the diagonal does not solve the law, whose front is hardly moved by one correction.
        for (name, change) in SCENES.into_iter().filter(|(name, _)| dim > 1 || *name != "law") {
            for stiffness in [30.0, 1e3, 1e5] {
                let dt = stiffness * limit;
                let run = |words: &str| two_steps(&mut open_box(words, (n, dim), change), dt);
                let ((jacobi, slow), (multigrid, fast)) =
                    (run("preconditioner=jacobi bounds=free"), run("preconditioner=multigrid bounds=free"));
                println!("{dim}-D {name} {stiffness}: {fast} iterations against {slow}");
                let off = max_abs(&jacobi.iter().zip(&multigrid).map(|(a, b)| a - b).collect::<Vec<_>>());
                // Both are solved to 1e-8 of a change of up to 9, and rounded at 4 eps (1 + 2e3 stiffness) 10.
                let slack = 4.0 * (9e-8 + 4.0 * f64::EPSILON * 2e3 * stiffness * 10.0);
                assert!(off < slack, "{dim}-D {name} {stiffness}: {off:e}");
                // The law is solved for in several corrections.
                assert!(
                    fast <= slow && (fast <= 20 || name == "law"),
                    "{dim}-D {name} {stiffness}: {fast} against {slow}"
                );
            }
        }
    }
}

#[test]
fn particles_without_neighbours_and_lone_pairs() {
    let mut x = lattice(12, 2, 0.1);
    x.extend([3.0, 3.0, 5.0, 5.0, 5.02, 5.0]);
    let run = |words: &str| {
        let mut s = unit_box(&format!("kernel=M4 integrator=sdirk2 {words}"), &x, 2, false);
        s.set_number("h", 0.1).unwrap();
        set(&mut s, "T", &field(&x, 2, |p| 1.0 + p[0]));
        two_steps(&mut s, 1e3).0
    };
    let (a, b) = (run("preconditioner=multigrid"), run("preconditioner=jacobi"));
    assert!(l2(&a, &b) < 1e-9 && a[144] == 4.0, "{:e}", l2(&a, &b));
    assert!((a[145] - 6.01).abs() < 1e-9 && (a[146] - 6.01).abs() < 1e-9);
}

#[test]
fn threads_change_no_bit_and_the_order_of_particles_no_answer() {
    let run = |threads: usize| {
        let mut s = hot_cube(&format!("preconditioner=multigrid threads={threads}"), 12);
        two_steps(&mut s, 0.01).0
    };
    let one = run(1);
    assert_eq!(bits(&one), bits(&run(2)));

    let x = lattice(12, 3, 0.2);
    let backwards: Vec<f64> = x.chunks(3).rev().flatten().copied().collect();
    let words = "kernel=M4 integrator=backward-euler solver_tolerance=1e-8 preconditioner=multigrid";
    let mut s = unit_box(words, &backwards, 3, true);
    let hot = |p: &[f64]| if p.iter().all(|c| (c - 0.5).abs() < 0.25) { 10.0 } else { 0.1 };
    set(&mut s, "T", &field(&backwards, 3, hot));
    let mut other = two_steps(&mut s, 0.01).0;
    other.reverse();
    assert!(l2(&other, &one) < 1e-8, "{:e}", l2(&other, &one));
}

#[test]
fn what_no_longer_holds_is_built_anew() {
    let changed: Change = |s, at| {
        set(s, "kappa", &at(|p| if p[1] < 0.5 { 1.0 } else { 1e4 }));
        set(s, "fixed", &at(|p| f64::from(p[1] > 0.9)));
    };
    let x = lattice(40, 2, 0.2);
    let mut s = open_box("preconditioner=multigrid", (40, 2), |_, _| {});
    s.step(1.0).unwrap();
    let t = s.get_all("T").unwrap();
    changed(&mut s, &|f| field(&x, 2, f));
    let kept = s.step(1.0).unwrap();
    let mut fresh = open_box("preconditioner=multigrid", (40, 2), changed);
    set(&mut fresh, "T", &t);
    let new = fresh.step(1.0).unwrap();
    assert_eq!(kept.iterations, new.iterations);
    assert!(l2(&s.get_all("T").unwrap(), &fresh.get_all("T").unwrap()) < 1e-12);
}

#[test]
fn operators_of_two_sweeps_say_that_the_diagonal_serves() {
    let x = lattice(12, 2, 0.2);
    let s = unit_box("operator=two-first integrator=backward-euler", &x, 2, true).plan().unwrap().to_string();
    assert!(s.contains("jacobi because multigrid needs an operator that is one matrix"), "{s}");
    let e = Solver::new("heat dim=2 operator=two-first integrator=sdirk2 preconditioner=multigrid").err().unwrap();
    assert!(e.to_string().contains("one matrix: brookshaw, kernel, projected, monotone"), "{e}");
}
