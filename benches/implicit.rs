//! Speed of implicit steps on the work item of particle codes (`work_item`): a hot cube, one step of backward Euler at a million times the explicit limit, solved to 1e-8.
//!
//! Prints, for each preconditioner: iterations, what a step and the set-up of the preconditioner cost in units of one
//! application of the operator, as Euler's sub-steps make it in turn, and bytes. `BENCH=full cargo bench` adds a million particles.

mod work_item;

use diffusph::plan::Report;
use diffusph::{Solver, Strided};
use std::time::Instant;
use work_item::{median, positions};

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

fn temperatures(x: &[f64]) -> Vec<f64> {
    let inside = |p: &[f64]| p.iter().all(|c| (c - 0.5).abs() < 0.25);
    x.chunks(3).map(|p| if inside(p) { 10.0 } else { 0.1 }).collect()
}

fn seconds(work: impl FnOnce()) -> f64 {
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64()
}

fn row(n: usize, preconditioner: &str) {
    let (x, particles) = (positions(n), n * n * n);
    let t = temperatures(&x);
    let solver = |words: &str| work_item::solver(&x, &t, &format!("threads=2 {words}"));
    let mut euler = solver("integrator=euler bounds=free");
    let words = "integrator=backward-euler solver_tolerance=1e-8 preconditioner=";
    let mut implicit = solver(&format!("{words}{preconditioner}"));
    let limit = euler.limit().unwrap();
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
