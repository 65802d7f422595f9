//! Speed of implicit steps on the work item of `heat`: a hot cube on a periodic cube of n³ jittered particles, M4 with
//! some 80 neighbours, one step of backward Euler at a million times the explicit limit, solved to 1e-8.
//!
//! Prints, for each preconditioner: iterations, what a step and the set-up of the preconditioner cost in units of one
//! application of the operator, as Euler's sub-steps make it in turn, and bytes. `BENCH=full cargo bench` adds a million particles.

use diffusph::plan::Report;
use diffusph::{Solver, Strided};
use std::time::Instant;

const STIFF: f64 = 1e6;

fn main() {
    // Without `--bench` cargo only checks that benchmarks start.
    if !std::env::args().any(|a| a == "--bench") {
        return;
    }
    let full = std::env::var("BENCH").is_ok_and(|b| b == "full");
    println!(" particles preconditioner  iterations  ns/particle  step/applications  set-up/applications  B/particle");
    for &n in if full { &[22, 46, 100][..] } else { &[22, 46] } {
        for preconditioner in ["multigrid", "jacobi"] {
            row(n, preconditioner);
        }
    }
}

fn positions(n: usize) -> Vec<f64> {
    let mut state = 12345u64;
    let mut uniform = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let cells = (0..n * n * n).flat_map(|p| [p % n, p / n % n, p / n / n]);
    cells.map(|c| (c as f64 + 0.5 + 0.2 * uniform()) / n as f64).collect()
}

/// A solver of the work item.
fn solver(x: &[f64], words: &str) -> Solver {
    let count = x.len() / 3;
    let mut solver = Solver::new(&format!("heat dim=3 kernel=M4 h_fac=1.3 threads=2 {words}")).unwrap();
    solver.set_box(&[0.0; 3], &[1.0; 3], &[true; 3]).unwrap();
    solver.set_particles(Strided::new("x", x, count, 3, 3).unwrap()).unwrap();
    for (name, value) in [("m", 1.0 / count as f64), ("rho", 1.0), ("kappa", 1.0)] {
        solver.set_number(name, value).unwrap();
    }
    solver.set("T", Strided::packed(&temperatures(x))).unwrap();
    solver
}

fn temperatures(x: &[f64]) -> Vec<f64> {
    let inside = |p: &[f64]| p.iter().all(|c| (c - 0.5).abs() < 0.25);
    x.chunks(3).map(|p| if inside(p) { 10.0 } else { 0.1 }).collect()
}

fn seconds(work: impl FnOnce()) -> f64 {
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn row(n: usize, preconditioner: &str) {
    let (x, particles) = (positions(n), n * n * n);
    let mut euler = solver(&x, "integrator=euler bounds=free");
    let words = "integrator=backward-euler solver_tolerance=1e-8 preconditioner=";
    let mut implicit = solver(&x, &format!("{words}{preconditioner}"));
    let (limit, t) = (euler.limit().unwrap(), temperatures(&x));
    implicit.get_number("mean_neighbours").unwrap();
    let (mut report, mut applications, mut steps, mut first) = (Report::default(), vec![], vec![], vec![]);
    for _ in 0..5 {
        let mut step = |implicit: &mut Solver| {
            implicit.set("T", Strided::packed(&t)).unwrap();
            seconds(|| report = implicit.step(STIFF * limit).unwrap())
        };
        let mut count = 0;
        let spent = seconds(|| count = euler.step(9.0 * limit).unwrap().applications);
        applications.push(spent / count as f64);
        steps.push(step(&mut implicit));
        // Another capacity, so that the preconditioner is built anew.
        implicit.set_number("c_v", 2.0).unwrap();
        implicit.set_number("c_v", 1.0).unwrap();
        first.push(step(&mut implicit));
    }
    let (application, step, first) = (median(applications), median(steps), median(first));
    println!(
        "{particles:10} {preconditioner:>14} {:11} {:12.0} {:18.1} {:20.1} {:10.0}",
        report.iterations,
        step / particles as f64 * 1e9,
        step / application,
        (first - step) / application,
        implicit.get_number("bytes").unwrap() / particles as f64
    );
}
