//! Second and first moment of every operator against h_fac: how good a Laplacian each kernel makes, and where it is best.

use super::batch;
use super::mode::{CUBIC, FCC, GLASS_2D, GLASS_3D, HEXAGONAL, JITTER_2D, JITTER_3D, LINE, SQUARE, Sample};
use super::page::Page;
use super::plot::{Axis, Plot, Style};
use super::request::Request;
use super::setup::setup;
use super::table::{Cell, Table, column, short};
use crate::error::Result;
use crate::kernel;
use crate::operator::table::{Fit, OPERATORS, Operator};
use std::path::Path;

/// The moments of an operator on particles.
#[derive(Debug, Clone)]
pub struct Moments {
    pub cloud: &'static str,
    pub dim: usize,
    pub kernel: &'static str,
    pub operator: &'static str,
    pub h_fac: f64,
    pub neighbours: f64,
    /// Root mean square of K_d2 − 1; with its sign where all particles are alike.
    pub second: f64,
    /// Root mean square of h Σ V w r.
    pub first: f64,
}

impl Moments {
    /// As they are, before anything is normalised.
    ///
    /// # Errors
    /// As [`crate::Solver::get`].
    pub fn of(sample: &Sample, kernel: &'static str, operator: &'static str, h_fac: f64) -> Result<Moments> {
        let cloud = &sample.cloud;
        let words = format!("kernel={kernel} operator={operator} h_fac={h_fac} normalise=none threads=1");
        let (mut solver, _) = setup(&sample.scene(&words), Path::new(""))?;
        let off: Vec<f64> = solver.get_all("K_d2")?.iter().map(|k| k - 1.0).collect();
        let sign = if off.iter().all(|k| *k < 0.0) { -1.0 } else { 1.0 };
        // Of vectors, over particles.
        let first = rms(&solver.get_all("first_moment")?) * (cloud.dim as f64).sqrt();
        let neighbours = solver.get_number("mean_neighbours")?;
        let (cloud, dim) = (cloud.name, cloud.dim);
        Ok(Moments { cloud, dim, kernel, operator, h_fac, neighbours, second: sign * rms(&off), first })
    }
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// On lattices a few particles are as good as many; disorder wants a mean.
fn samples(request: &Request) -> Result<Vec<Sample>> {
    let lattices = [(LINE, 8), (SQUARE, 4), (HEXAGONAL, 4), (CUBIC, 3), (FCC, 4)];
    let (plane, space) = request.pick((0, 0), (12, 6), (64, 16));
    let disordered = [(JITTER_2D, plane), (GLASS_2D, plane), (JITTER_3D, space), (GLASS_3D, space)];
    let all = lattices.into_iter().chain(disordered).filter(|(_, n)| *n > 0);
    all.map(|(cloud, n)| Sample::new(cloud, n)).collect()
}

/// From 0.8 to 2.0.
fn h_facs(steps: u32) -> Vec<f64> {
    (0..=steps).map(|i| 0.8 + 1.2 * f64::from(i) / f64::from(steps)).collect()
}

/// Those whose weights are their own function of the distance and nothing more: all others have the weights of one of these.
fn is_plain(operator: &&Operator) -> bool {
    matches!(operator.fit, Fit::None) && !operator.joins_rows() && operator.is_one_matrix()
}

/// # Errors
/// As [`Moments::of`].
pub fn run(mut request: Request) -> Result<Page> {
    let mut page = Page::new("kernels", "Second derivative normalisation of every kernel and operator against h_fac");
    let kernels: Vec<&'static str> = kernel::catalogue().map(|(name, _)| name).collect();
    let (samples, h_facs) = (samples(&request)?, h_facs(request.pick(12, 24, 48)));
    let mut cases = Vec::new();
    for sample in &samples {
        for kernel in &kernels {
            for operator in OPERATORS.iter().filter(is_plain) {
                cases.extend(h_facs.iter().map(|h_fac| (sample, *kernel, operator.name, *h_fac)));
            }
        }
    }
    let found = batch::map(
        &cases,
        |(sample, kernel, operator, h_fac)| Moments::of(sample, kernel, operator, *h_fac),
        |done| request.goes_on(done, cases.len()),
    )?;
    page.complete = found.len() == cases.len();
    page.tables = vec![summary(&found), sweet_spots(&found), table(&found)];
    page.plots = samples.iter().map(|sample| plot(&found, sample.cloud.name, "brookshaw")).collect();
    page.plots.push(plot(&found, FCC.name, "kernel"));
    say(&mut page, &found);
    Ok(page)
}

fn table(found: &[Moments]) -> Table {
    let columns = ["particles", "dim", "kernel", "operator", "h_fac", "neighbours", "K_d2 - 1", "first moment"];
    let mut table = Table::long("moments", &columns.map(|name| column(name, "")));
    for m in found {
        let texts: [Cell; 4] = [m.cloud.into(), m.dim.into(), m.kernel.into(), m.operator.into()];
        let numbers = [m.h_fac, m.neighbours, m.second, m.first].map(Cell::Number);
        table.rows.push(texts.into_iter().chain(numbers).collect());
    }
    table
}

/// Runs of one curve, in the order in which they were found.
fn curves(found: &[Moments]) -> impl Iterator<Item = &[Moments]> {
    found.chunk_by(|a, b| (a.cloud, a.kernel, a.operator) == (b.cloud, b.kernel, b.operator))
}

/// Where |K_d2 − 1| is smallest.
fn best(curve: &[Moments]) -> Option<&Moments> {
    curve.iter().min_by(|a, b| a.second.abs().total_cmp(&b.second.abs()))
}

/// The smallest h_fac from which |K_d2 − 1| falls below a thousandth, or where it is least: more neighbours cost.
fn sweet(curve: &[Moments]) -> Option<&Moments> {
    let dips = curve.windows(3).map(|w| &w[1]).zip(curve.windows(3));
    let dip = dips.filter(|(m, w)| m.second.abs() <= w[0].second.abs().min(w[2].second.abs())).map(|(m, _)| m);
    dip.into_iter().find(|m| m.second.abs() < 1e-3).or(best(curve))
}

fn sweet_spots(found: &[Moments]) -> Table {
    let columns =
        ["particles", "kernel", "operator", "sweet h_fac", "neighbours", "K_d2 - 1", "best h_fac", "K_d2 - 1"];
    let mut table = Table::long("sweet_spots", &columns.map(|name| column(name, "")));
    for curve in curves(found) {
        if let (Some(sweet), Some(best)) = (sweet(curve), best(curve)) {
            table.push([
                sweet.cloud.into(),
                sweet.kernel.into(),
                sweet.operator.into(),
                sweet.h_fac.into(),
                sweet.neighbours.into(),
                sweet.second.into(),
                best.h_fac.into(),
                best.second.into(),
            ]);
        }
    }
    table
}

const LATTICES: [&str; 5] = [LINE.name, SQUARE.name, HEXAGONAL.name, CUBIC.name, FCC.name];

/// The sweet spot of a kernel with brookshaw on some particles, in short.
fn spot(found: &[Moments], cloud: &str, kernel: &str) -> Option<String> {
    let curve = curves(found).find(|c| (c[0].cloud, c[0].kernel, c[0].operator) == (cloud, kernel, "brookshaw"))?;
    sweet(curve).map(|m| format!("{:.2} ({:.0e}, {:.0})", m.h_fac, m.second, m.neighbours))
}

/// A row for each kernel: h_fac, and in brackets K_d2 − 1 and neighbours.
fn summary(found: &[Moments]) -> Table {
    let names = ["brookshaw: h_fac (K_d2 - 1, neighbours)"].into_iter().chain(LATTICES);
    let mut table = Table::new("summary", &names.map(|name| column(name, "")).collect::<Vec<_>>());
    for (kernel, _) in kernel::catalogue() {
        let spots = LATTICES.iter().map(|cloud| Cell::Text(spot(found, cloud, kernel).unwrap_or_default()));
        table.rows.push(std::iter::once(kernel.into()).chain(spots).collect());
    }
    table
}

/// What is drawn at the least: a dip to nothing would hide all else.
const LEAST: f64 = 1e-7;

fn plot(found: &[Moments], cloud: &str, operator: &str) -> Plot {
    let title = format!("|K_d2 - 1| of {operator}, {cloud}");
    let mut plot = Plot::new(title, Axis::linear("h_fac"), Axis::log(&format!("|K_d2 - 1|, {LEAST:.0e} where less")));
    for curve in curves(found).filter(|c| c[0].cloud == cloud && c[0].operator == operator) {
        let points = curve.iter().map(|m| (m.h_fac, m.second.abs().max(LEAST))).collect();
        plot.add(curve[0].kernel, Style::Line, points);
    }
    plot
}

fn say(page: &mut Page, found: &[Moments]) {
    page.find(
        "sweet spots are the first dip of |K_d2 - 1| below a thousandth: more neighbours cost more; where there is \
         none, the smallest of all",
    );
    for cloud in [JITTER_2D, GLASS_2D, JITTER_3D, GLASS_3D].map(|cloud| cloud.name) {
        let of = found.iter().filter(|m| m.cloud == cloud && m.operator == "brookshaw");
        if let Some(least) = of.min_by(|a, b| a.first.total_cmp(&b.first)) {
            let Moments { kernel, h_fac, first, neighbours, .. } = least;
            let first = short(*first);
            page.find(format!(
                "{cloud}: the first moment, which no pair operator removes, is least with {kernel} {h_fac:.2}: {first} ({neighbours:.0} neighbours)"
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// K_d2 − 1 on fcc, derived independently: brookshaw, kernel, direct, and neighbours.
    #[test]
    fn moments_on_fcc_are_those_derived_elsewhere() {
        let fcc = Sample::new(FCC, 4).unwrap();
        for (kernel, h_fac, expected, neighbours) in [
            ("M4", 1.0, [-3.4e-2, -1.3e-3, -1.1e-2], 42.0),
            ("M4", 1.35, [1.1e-2, 4.8e-3, -1.7e-2], 78.0),
            ("M6", 0.9, [-4.1e-4, 3.6e-4, -7.2e-3], 78.0),
            ("M6", 1.0, [-7.4e-4, -1.5e-4, 3.3e-3], 134.0),
            ("C2", 1.3, [-9.0e-3, -7.3e-3, 3.8e-2], 78.0),
        ] {
            for (operator, expected) in ["brookshaw", "kernel", "direct"].into_iter().zip(expected) {
                let found = Moments::of(&fcc, kernel, operator, h_fac).unwrap();
                assert!((found.second / expected - 1.0).abs() < 0.05, "{found:?} {expected:e}");
                assert!((found.neighbours - neighbours).abs() < 1.5 && found.first < 1e-12, "{found:?}");
            }
        }
    }
}
