//! Speed of explicit steps on the work item of particle codes (`work_item`), stored weights.
//!
//! `cargo bench` times the parts with divan and then prints one table, its rows measured in turn in the same run: ns per
//! particle-step and per pair, the set-up in steps, bytes per particle, and the share of the memory's read bandwidth
//! that a step reaches. Where DIFFUSPH_PYTHON names a Python with scipy, its sparse product runs in turn with ours.
//! `BENCH=full cargo bench` adds sizes up to 4 million particles.

mod work_item;

use diffusph::{Solver, Strided};
use divan::Bencher;
use divan::counter::{BytesCount, ItemsCount};
use std::f64::consts::PI;
use std::process::Command;
use std::time::Instant;
use work_item::{median, positions};

fn main() {
    divan::main();
    let full = std::env::var("BENCH").is_ok_and(|b| b == "full");
    // Without `--bench` cargo only checks that benchmarks start.
    if std::env::args().any(|a| a == "--bench") {
        table(if full { &[22, 50, 100, 159] } else { &[22, 50] });
        stiff(30);
        consistent(46);
    }
}

struct Item {
    n: usize,
    x: Vec<f64>,
    solver: Solver,
    dt: f64,
}

impl Item {
    fn new(n: usize, threads: usize) -> Item {
        Item::with(n, &format!("integrator=euler threads={threads}"))
    }

    fn with(n: usize, words: &str) -> Item {
        let x = positions(n);
        let t: Vec<f64> = x.chunks(3).map(|p| p.iter().map(|c| (2.0 * PI * c).sin()).product()).collect();
        let solver = work_item::solver(&x, &t, words);
        // A tenth of the explicit limit: one application of the operator, and no other bound is asked for.
        let dt = 0.03 / (n * n) as f64;
        Item { n, x, solver, dt }
    }

    fn count(&self) -> usize {
        self.n * self.n * self.n
    }

    /// Seconds for one application of the operator, from a step of many.
    fn step(&mut self, applications: usize) -> f64 {
        let start = Instant::now();
        let report = self.solver.step(self.dt * 10.0 * applications as f64).unwrap();
        start.elapsed().as_secs_f64() / report.applications as f64
    }

    /// Seconds to find neighbours and make weights for particles that have moved.
    fn set_up(&mut self) -> f64 {
        self.x[0] += 1e-9;
        let count = self.count();
        self.solver.set_particles(Strided::new("x", &self.x, count, 3, 3).unwrap()).unwrap();
        let start = Instant::now();
        self.solver.get_number("mean_neighbours").unwrap();
        start.elapsed().as_secs_f64()
    }
}

#[divan::bench(args = [(50, 1), (50, 2)], sample_count = 20)]
fn step(bencher: Bencher, (n, threads): (usize, usize)) {
    let mut item = Item::new(n, threads);
    item.step(10);
    let items = ItemsCount::new(item.count());
    bencher.counter(items).bench_local(|| item.solver.step(item.dt).unwrap());
}

#[divan::bench(args = [(50, 1), (50, 2)], sample_count = 5)]
fn neighbours_and_weights(bencher: Bencher, (n, threads): (usize, usize)) {
    let mut item = Item::new(n, threads);
    bencher.counter(ItemsCount::new(item.count())).bench_local(|| item.set_up());
}

#[divan::bench(sample_count = 20)]
fn memory_read(bencher: Bencher) {
    let data = vec![1.0f64; 1 << 24];
    bencher.counter(BytesCount::of_slice(&data)).bench_local(|| read(&data, 1));
}

/// Bytes per second of reading an array with so many threads.
fn read(data: &[f64], threads: usize) -> f64 {
    let start = Instant::now();
    let sum = |part: &[f64]| {
        let mut lanes = [0.0; 8];
        part.chunks_exact(8).for_each(|c| lanes.iter_mut().zip(c).for_each(|(l, v)| *l += v));
        lanes.iter().sum::<f64>()
    };
    let total: f64 = std::thread::scope(|s| {
        let parts: Vec<_> = data.chunks(data.len().div_ceil(threads)).map(|part| s.spawn(move || sum(part))).collect();
        parts.into_iter().map(|p| p.join().unwrap()).sum()
    });
    divan::black_box(total);
    size_of_val(data) as f64 / start.elapsed().as_secs_f64()
}

/// One row per size and number of threads; rivals in turn.
fn table(sizes: &[usize]) {
    println!(
        "\n particles threads neighbours  ns/particle  ns/pair  scipy ns  ours/scipy  set-up/steps  B/particle  of read bandwidth"
    );
    let array = vec![1.0f64; 1 << 25];
    for &n in sizes {
        // Beyond a million particles scipy's assembly needs more memory than a small machine has.
        let rival = if n <= 100 { Scipy::new(n) } else { None };
        for threads in [1, 2] {
            let mut item = Item::new(n, threads);
            let neighbours = item.solver.get_number("mean_neighbours").unwrap();
            let applications = (4_000_000 / item.count()).clamp(3, 200);
            item.step(applications);
            let (mut ours, mut theirs, mut bandwidth, mut setup) = (vec![], vec![], vec![], vec![]);
            for round in 0..5 {
                ours.push(item.step(applications));
                bandwidth.push(read(&array, threads));
                theirs.extend(rival.as_ref().filter(|_| threads == 1).and_then(|r| r.run(applications)));
                if round < 3 {
                    setup.push(item.set_up());
                    // The first step finds bounds, which the next ones know.
                    item.step(1);
                }
            }
            let per_step = median(ours);
            let bytes = 12.0 * neighbours * item.count() as f64 / per_step;
            let per = per_step / item.count() as f64 * 1e9;
            let (scipy, ratio) = match theirs.is_empty() {
                true => ("-".into(), "-".into()),
                false => {
                    let scipy = median(theirs) / item.count() as f64 * 1e9;
                    (format!("{scipy:.1}"), format!("{:.2}", per / scipy))
                }
            };
            println!(
                "{:10} {threads:7} {neighbours:10.1} {per:12.1} {:8.2} {scipy:>9} {ratio:>11} {:13.1} {:11.0} {:17.0} %",
                item.count(),
                per / neighbours,
                median(setup) / per_step,
                item.solver.get_number("bytes").unwrap() / item.count() as f64,
                100.0 * bytes / median(bandwidth)
            );
        }
    }
}

/// One step of R explicit limits by RKL2, as far as stability allows, beside Euler's sub-steps: the gain of s stages over
/// R ~ s²/4 sub-steps is about sqrt(R)/2.
fn stiff(n: usize) {
    println!("\n         R  euler applications     ms  rkl2 applications     ms   gain  sqrt(R)/2");
    for r in [10.0, 100.0, 1000.0, 10000.0] {
        let step = |words: &str| {
            let mut solver = Item::with(n, words).solver;
            let dt = r * solver.limit().unwrap();
            let start = Instant::now();
            let report = solver.step(dt).unwrap();
            (report.applications, start.elapsed().as_secs_f64() * 1e3)
        };
        let (euler, rkl2) = (
            step("threads=1 integrator=euler bounds=free"),
            step("threads=1 integrator=rkl2 tolerance=off change=inf max_stages=999"),
        );
        println!(
            "{r:10} {:19} {:6.0} {:18} {:6.0} {:6.1} {:10.1}",
            euler.0,
            euler.1,
            rkl2.0,
            rkl2.1,
            euler.1 / rkl2.1,
            r.sqrt() / 2.0
        );
    }
}

/// Neighbours and the weights of a fit around every particle, beside steps with these weights.
fn consistent(n: usize) {
    println!("\n consistent order threads  set-up us/particle  in steps");
    for (order, threads) in [(2, 1), (2, 2), (4, 1), (4, 2)] {
        let mut item = Item::with(n, &format!("integrator=euler operator=consistent order={order} threads={threads}"));
        item.step(1);
        let rounds = (0..5).map(|_| {
            let step = item.step(30);
            let set_up = item.set_up();
            // The first step checks the spectrum and finds bounds.
            item.step(1);
            (step, set_up)
        });
        let (steps, set_ups): (Vec<_>, Vec<_>) = rounds.unzip();
        let (step, set_up) = (median(steps), median(set_ups));
        println!("{order:17} {threads:7} {:19.2} {:9.0}", set_up / (n * n * n) as f64 * 1e6, set_up / step);
    }
}

/// scipy's sparse matrix on the same particles, in a process of its own that answers line by line.
struct Scipy {
    process: std::cell::RefCell<std::process::Child>,
}

impl Scipy {
    fn new(n: usize) -> Option<Scipy> {
        let python = std::env::var("DIFFUSPH_PYTHON").ok()?;
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/scipy_csr.py");
        let file = std::env::temp_dir().join(format!("diffusph-bench-{}-{n}.f64", std::process::id()));
        std::fs::write(&file, positions(n).iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>()).ok()?;
        let mut command = Command::new(python);
        command.arg(script).arg(&file).arg(n.to_string()).env("OMP_NUM_THREADS", "1");
        let child = command.stdin(std::process::Stdio::piped()).stdout(std::process::Stdio::piped()).spawn().ok()?;
        Some(Scipy { process: child.into() })
    }

    fn run(&self, steps: usize) -> Option<f64> {
        use std::io::{Read, Write};
        let mut child = self.process.borrow_mut();
        writeln!(child.stdin.as_mut()?, "{steps}").ok()?;
        child.stdin.as_mut()?.flush().ok()?;
        let mut line = String::new();
        let mut byte = [0];
        while child.stdout.as_mut()?.read(&mut byte).ok()? == 1 && byte[0] != b'\n' {
            line.push(byte[0] as char);
        }
        line.trim().parse().ok()
    }
}

impl Drop for Scipy {
    fn drop(&mut self) {
        let child = self.process.get_mut();
        let _ = child.kill();
        let _ = child.wait();
    }
}
