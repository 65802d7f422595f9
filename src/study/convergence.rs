//! Error of a decaying mode against resolution: every operator, on lattices and on disordered particles.

use super::catalogue::Request;
use super::mode::{CUBIC, Cloud, FCC, GLASS, HEXAGONAL, JITTER_2D, JITTER_3D, SQUARE, refused, variants};
use super::page::Page;
use super::plot::{Axis, Plot, Style};
use super::run::Study;
use super::table::{Cell, Table, column, short};
use crate::error::Result;
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
const EXACT_IN_TIME: &str = "integrator=ssprk3";

impl Run {
    /// # Errors
    /// As [`Study::run`], unless the operator is refused on these particles.
    pub fn of(cloud: &Cloud, n: usize, kernel: &'static str, (words, name): &(String, String)) -> Result<Run> {
        let scene = cloud.scene(n, &format!("kernel={kernel} {words} {EXACT_IN_TIME}"))?;
        let done = Study::new(scene, Path::new("")).and_then(|s| s.run(Path::new(""), Box::new(|_| true)));
        let (particles, error) = match done {
            Ok(report) => (report.particles, report.accuracy.map_or(f64::NAN, |a| a.l2)),
            Err(e) if refused(&e) => (0, f64::NAN),
            Err(e) => return Err(e),
        };
        Ok(Run { cloud: cloud.name, kernel, operator: name.clone(), n, particles, error })
    }
}

fn clouds(request: &Request) -> Vec<(Cloud, Vec<usize>)> {
    let plane = request.pick(vec![16, 32], vec![16, 32, 64, 128], vec![16, 32, 64, 128, 256]);
    let space = request.pick(vec![6, 8], vec![8, 12, 16, 24], vec![8, 16, 24, 32, 48]);
    let mut clouds: Vec<_> = [SQUARE, HEXAGONAL, JITTER_2D].map(|c| (c, plane.clone())).into();
    clouds.extend([CUBIC, FCC, JITTER_3D].map(|c| (c, space.clone())));
    if !request.tiny && GLASS.is_here() {
        clouds.push((GLASS, vec![24]));
    }
    clouds
}

/// # Errors
/// As [`Run::of`].
pub fn run(mut request: Request) -> Result<Page> {
    let mut page = Page::new("convergence", "Convergence for isotropic heat conduction with various methods");
    let kernels: &[&'static str] = request.pick(&["M6"], &["M4", "M6"], &["M4", "M6", "M8", "C2", "C4", "C6"]);
    let (clouds, variants) = (clouds(&request), variants());
    let mut cases = Vec::new();
    for (cloud, sizes) in &clouds {
        for kernel in kernels.iter().filter(|k| request.full || cloud.name != GLASS.name || **k == "M6") {
            cases.extend(variants.iter().flat_map(|v| sizes.iter().map(move |n| (cloud, *n, *kernel, v))));
        }
    }
    let mut runs = Vec::new();
    for (done, (cloud, n, kernel, variant)) in cases.iter().enumerate() {
        if !request.goes_on(done, cases.len()) {
            page.complete = false;
            break;
        }
        runs.push(Run::of(cloud, *n, kernel, variant)?);
    }
    page.tables = vec![orders(&runs), table(&runs)];
    page.plots = clouds.iter().filter(|(_, sizes)| sizes.len() > 1).map(|(cloud, _)| plot(&runs, cloud.name)).collect();
    say(&mut page, &runs);
    if !GLASS.is_here() {
        page.find("no glass: its file lies in the source of this program, which is not here");
    }
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
        let run = |cloud: &Cloud, n| Run::of(cloud, n, "M6", &pair).unwrap();
        // e4 h² k⁴ t: second order.
        assert!((order(&run(&SQUARE, 16), &run(&SQUARE, 32)) - 2.0).abs() < 0.15);
        assert!(order(&run(&JITTER_2D, 32), &run(&JITTER_2D, 64)).abs() < 1.0);
        let direct = ("operator=direct normalise=none".to_string(), "d".to_string());
        assert!(run(&HEXAGONAL, 16).error < 0.1 && Run::of(&SQUARE, 16, "M6", &direct).unwrap().error < 0.2);
    }
}
