//! Error of a decaying mode against resolution: every operator, on lattices and on disordered particles.

use super::batch;
use super::mode::{CUBIC, FCC, GLASS_2D, GLASS_3D, HEXAGONAL, JITTER_2D, JITTER_3D, SQUARE, Sample, variants};
use super::page::Page;
use super::plot::{Axis, Plot, Style};
use super::request::Request;
use super::run::Study;
use super::table::{Cell, Table, column, short};
use crate::error::Result;
use crate::solver::recommend::refused;
use std::path::Path;

#[derive(Debug, Clone)]
pub struct Run {
    pub cloud: &'static str,
    pub kernel: &'static str,
    pub operator: String,
    pub n: usize,
    pub particles: usize,
    /// Relative l2 error; no number where the operator was refused.
    pub error: f64,
}

/// The time is integrated by explicit steps at the stability limit of a third-order method: 1e-4 of the error or less.
const EXACT_IN_TIME: &str = "integrator=ssprk3 bounds=free";

impl Run {
    /// # Errors
    /// As [`Study::run`], unless the operator is refused on these particles.
    pub fn of(sample: &Sample, kernel: &'static str, (words, name): &(String, String)) -> Result<Run> {
        let scene = sample.scene(&format!("kernel={kernel} {words} {EXACT_IN_TIME} threads=1"));
        let done = Study::new(scene, Path::new("")).and_then(|s| s.run(Path::new(""), Box::new(|_| true)));
        let (particles, error) = match done {
            Ok(report) => (report.particles, report.accuracy.map_or(f64::NAN, |a| a.l2)),
            Err(e) if refused(&e) => (0, f64::NAN),
            Err(e) => return Err(e),
        };
        Ok(Run { cloud: sample.cloud.name, kernel, operator: name.clone(), n: sample.n, particles, error })
    }
}

/// The samples of each cloud, coarse to fine.
fn samples(request: &Request) -> Result<Vec<Vec<Sample>>> {
    let plane = request.pick(vec![16, 32], vec![16, 32, 64], vec![16, 32, 64, 128]);
    let space = request.pick(vec![6, 8], vec![8, 12, 16], vec![8, 16, 24, 32, 48]);
    // Glasses take their time.
    let [flat, deep] = [&plane, &space].map(|sizes| sizes[..sizes.len() - 1].to_vec());
    let plane = [(SQUARE, &plane), (HEXAGONAL, &plane), (JITTER_2D, &plane), (GLASS_2D, &flat)];
    let space = [(CUBIC, &space), (FCC, &space), (JITTER_3D, &space), (GLASS_3D, &deep)];
    let of = |(cloud, sizes): (_, &Vec<usize>)| sizes.iter().map(|n| Sample::new(cloud, *n)).collect();
    plane.into_iter().chain(space).map(of).collect()
}

/// # Errors
/// As [`Run::of`].
pub fn run(mut request: Request) -> Result<Page> {
    let mut page = Page::new("convergence", "Convergence for isotropic heat conduction with various methods");
    let kernels: &[&'static str] = request.pick(&["M6"], &["M6"], &["M4", "M6", "M8", "C2", "C4", "C6"]);
    let (samples, variants) = (samples(&request)?, variants());
    let mut cases = Vec::new();
    for sizes in &samples {
        for kernel in kernels {
            cases.extend(variants.iter().flat_map(|v| sizes.iter().map(move |sample| (sample, *kernel, v))));
        }
    }
    let runs = batch::map(
        &cases,
        |(sample, kernel, variant)| Run::of(sample, kernel, variant),
        |done| request.goes_on(done, cases.len()),
    )?;
    page.complete = runs.len() == cases.len();
    page.tables = vec![orders(&runs), table(&runs)];
    page.plots = samples.iter().map(|sizes| plot(&runs, sizes[0].cloud.name)).collect();
    say(&mut page, &runs);
    Ok(page)
}

fn curves(runs: &[Run]) -> impl Iterator<Item = &[Run]> {
    runs.chunk_by(|a, b| (a.cloud, a.kernel, &a.operator) == (b.cloud, b.kernel, &b.operator))
}

/// Between two resolutions: −d log error / d log n, n from the number of particles.
fn order(a: &Run, b: &Run) -> f64 {
    -(b.error / a.error).ln() / (b.n as f64 / a.n as f64).ln()
}

fn table(runs: &[Run]) -> Table {
    let names = ["particles", "kernel", "operator", "n", "count", "l2"].map(|name| column(name, ""));
    let mut table = Table::long("errors", &names);
    for r in runs {
        let [cloud, kernel, operator]: [Cell; 3] = [r.cloud.into(), r.kernel.into(), r.operator.as_str().into()];
        table.push([cloud, kernel, operator, r.n.into(), r.particles.into(), r.error.into()]);
    }
    table
}

fn orders(runs: &[Run]) -> Table {
    let names = ["particles", "kernel", "operator", "n", "l2", "finest n", "l2 there", "last order"];
    let mut table = Table::new("orders", &names.map(|name| column(name, "")));
    for curve in curves(runs) {
        if let (Some(first), Some(last)) = (curve.first(), curve.last()) {
            let slope = curve.len().checked_sub(2).map_or(f64::NAN, |before| order(&curve[before], last));
            table.push([
                first.cloud.into(),
                first.kernel.into(),
                first.operator.as_str().into(),
                first.n.into(),
                first.error.into(),
                last.n.into(),
                last.error.into(),
                slope.into(),
            ]);
        }
    }
    table
}

fn plot(runs: &[Run], cloud: &str) -> Plot {
    let mut plot = Plot::new(format!("M6, {cloud}"), Axis::log("particles per side"), Axis::log("relative l2 error"));
    for curve in curves(runs).filter(|c| c[0].cloud == cloud && c[0].kernel == "M6") {
        plot.add(&curve[0].operator, Style::Line, curve.iter().map(|r| (r.n as f64, r.error)).collect());
    }
    plot
}

fn say(page: &mut Page, runs: &[Run]) {
    let finest = curves(runs).filter_map(<[Run]>::last).filter(|r| r.kernel == "M6");
    let finest: Vec<&Run> = finest.collect();
    for group in finest.chunk_by(|a, b| a.cloud == b.cloud) {
        let ok = group.iter().filter(|r| r.error.is_finite());
        if let Some(best) = ok.min_by(|a, b| a.error.total_cmp(&b.error)) {
            let lost: Vec<&str> = group.iter().filter(|r| !r.error.is_finite()).map(|r| r.operator.as_str()).collect();
            let lost = if lost.is_empty() { String::new() } else { format!("; refused: {}", lost.join(", ")) };
            let (l2, n) = (short(best.error), best.n);
            page.find(format!("M6, {}, n = {n}: {} is best, {l2}{lost}", best.cloud, best.operator));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lattice_converges_until_its_moment_shows_and_disorder_does_not() {
        let pair = ("operator=brookshaw normalise=pair".to_string(), "b".to_string());
        let of = |cloud, n, variant| Run::of(&Sample::new(cloud, n).unwrap(), "M6", variant).unwrap();
        let run = |cloud, n| of(cloud, n, &pair);
        // e4 h² k⁴ t: second order.
        assert!((order(&run(SQUARE, 16), &run(SQUARE, 32)) - 2.0).abs() < 0.15);
        assert!(order(&run(JITTER_2D, 32), &run(JITTER_2D, 64)).abs() < 1.0);
        let direct = ("operator=direct normalise=none".to_string(), "d".to_string());
        assert!(run(HEXAGONAL, 16).error < 0.1 && of(SQUARE, 16, &direct).error < 0.2);
    }
}
