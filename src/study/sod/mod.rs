//! The shock tube over h_fac for every kernel: the error of the density against the exact solution.

pub mod riemann;
mod tube;

use super::catalogue::Request;
use super::kernels::Moments;
use super::mode::LINE;
use super::page::Page;
use super::plot::{Axis, Plot, Style};
use super::table::{Table, column, short};
use crate::error::Result;
use crate::kernel;
use riemann::{Gas, Riemann};
use tube::Tube;

pub const LEFT: Gas = Gas { rho: 1.0, v: 0.0, p: 1.0 };
pub const RIGHT: Gas = Gas { rho: 0.125, v: 0.0, p: 0.1 };
const END: f64 = 0.2;

/// One tube.
#[derive(Debug, Clone)]
pub struct Shock {
    pub gamma: f64,
    pub kernel: &'static str,
    pub h_fac: f64,
    /// Of the density: sqrt(Σ (rho − exact)² / Σ exact²) over particles.
    pub l2: f64,
    /// K_d2 − 1 of brookshaw on a line of particles.
    pub second: f64,
}

impl Shock {
    /// With `n` particles on the left.
    ///
    /// # Errors
    /// As [`Tube::new`].
    pub fn of(kernel: &'static str, h_fac: f64, gamma: f64, n: usize) -> Result<Shock> {
        let mut tube = Tube::new(kernel, h_fac, gamma, n, [LEFT, RIGHT])?;
        tube.run(END);
        let exact = Riemann::new(gamma, LEFT, RIGHT);
        let (mut error, mut size) = (0.0, 0.0);
        for (x, rho) in tube.densities_at() {
            let known = exact.density(x / END);
            error += (rho - known).powi(2);
            size += known * known;
        }
        let second = Moments::of(&LINE, 8, kernel, "brookshaw", h_fac)?.second;
        Ok(Shock { gamma, kernel, h_fac, l2: (error / size).sqrt(), second })
    }
}

/// # Errors
/// As [`Shock::of`].
pub fn run(mut request: Request) -> Result<Page> {
    let mut page = Page::new("sod", "Shock tube in 1-D: density error against h_fac for every kernel");
    let (n, steps) = request.pick((40, 2), (120, 8), (400, 24));
    let h_facs: Vec<f64> = (0..=steps).map(|i| 0.8 + 1.2 * f64::from(i) / f64::from(steps)).collect();
    let mut cases = Vec::new();
    for gamma in [1.4, 5.0 / 3.0] {
        for (kernel, _) in kernel::catalogue() {
            cases.extend(h_facs.iter().map(|h_fac| (kernel, *h_fac, gamma)));
        }
    }
    let mut found = Vec::new();
    for (done, (kernel, h_fac, gamma)) in cases.iter().enumerate() {
        if !request.goes_on(done, cases.len()) {
            page.complete = false;
            break;
        }
        found.push(Shock::of(kernel, *h_fac, *gamma, n)?);
    }
    page.tables = vec![best(&found), table(&found)];
    page.plots = [1.4, 5.0 / 3.0].map(|gamma| plot(&found, gamma)).into();
    page.find(format!("{n} particles on the left and {} on the right; in 3-D it is not there yet", n / 8));
    let lost = found.iter().filter(|s| !s.l2.is_finite());
    let lost: Vec<String> = lost.map(|s| format!("{} at {:.2}", s.kernel, s.h_fac)).collect();
    if !lost.is_empty() {
        page.find(format!("no numbers in the end, for want of neighbours: {}", lost.join(", ")));
    }
    say(&mut page, &found);
    Ok(page)
}

fn curves(found: &[Shock]) -> impl Iterator<Item = &[Shock]> {
    found.chunk_by(|a, b| (a.gamma, a.kernel) == (b.gamma, b.kernel))
}

fn table(found: &[Shock]) -> Table {
    let names = ["gamma", "kernel", "h_fac", "l2", "K_d2 - 1"].map(|name| column(name, ""));
    let mut table = Table::long("errors", &names);
    for Shock { gamma, kernel, h_fac, l2, second } in found {
        table.push([(*gamma).into(), (*kernel).into(), (*h_fac).into(), (*l2).into(), (*second).into()]);
    }
    table
}

fn best(found: &[Shock]) -> Table {
    let names = [
        "kernel",
        "gamma",
        "best h_fac",
        "l2",
        "worst h_fac",
        "l2 there",
        "rank correlation with |K_d2 - 1|",
        "without trend",
    ];
    let mut table = Table::new("best", &names.map(|name| column(name, "")));
    for curve in curves(found) {
        let known = || curve.iter().filter(|s| s.l2.is_finite());
        let by = |a: &&Shock, b: &&Shock| a.l2.total_cmp(&b.l2);
        let [plain, left] = correlations(curve);
        if let (Some(best), Some(worst)) = (known().min_by(by), known().max_by(by)) {
            table.push([
                best.kernel.into(),
                best.gamma.into(),
                best.h_fac.into(),
                best.l2.into(),
                worst.h_fac.into(),
                worst.l2.into(),
                plain.into(),
                left.into(),
            ]);
        }
    }
    table
}

fn plot(found: &[Shock], gamma: f64) -> Plot {
    let title = format!("l2 error of the density, gamma = {gamma:.3}");
    let mut plot = Plot::new(title, Axis::linear("h_fac"), Axis::log("l2 error"));
    let shown = ["M4", "M5", "M6", "M8", "C2", "C4", "C6"];
    for curve in curves(found).filter(|c| c[0].gamma == gamma && shown.contains(&c[0].kernel)) {
        plot.add(curve[0].kernel, Style::Line, curve.iter().map(|s| (s.h_fac, s.l2)).collect());
    }
    plot
}

/// Spearman's, 1 where the density is the worse the farther K_d2 is from 1: of the errors as they are, and of what a
/// line in h_fac leaves of them, since more neighbours smooth more.
pub fn correlations(curve: &[Shock]) -> [f64; 2] {
    let known: Vec<&Shock> = curve.iter().filter(|s| s.l2.is_finite()).collect();
    let of = |f: fn(&Shock) -> f64| known.iter().map(|s| f(s)).collect::<Vec<f64>>();
    let (h, l2, second) = (of(|s| s.h_fac), of(|s| s.l2), of(|s| s.second.abs()));
    let slope = moment(&h, &l2) / moment(&h, &h);
    let left: Vec<f64> = l2.iter().zip(&h).map(|(l2, h)| l2 - slope * h).collect();
    [l2, left].map(|errors| {
        let (a, b) = (ranks(&errors), ranks(&second));
        moment(&a, &b) / (moment(&a, &a) * moment(&b, &b)).sqrt()
    })
}

fn ranks(values: &[f64]) -> Vec<f64> {
    values.iter().map(|v| values.iter().filter(|other| *other < v).count() as f64).collect()
}

/// Σ (x − mean)(y − mean)
fn moment(x: &[f64], y: &[f64]) -> f64 {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len().max(1) as f64;
    let (mx, my) = (mean(x), mean(y));
    x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum()
}

fn say(page: &mut Page, found: &[Shock]) {
    for gamma in [1.4, 5.0 / 3.0] {
        let of = |kernel: &str, h: f64| {
            let near = found.iter().filter(|s| s.gamma == gamma && s.kernel == kernel);
            near.min_by(|a, b| (a.h_fac - h).abs().total_cmp(&(b.h_fac - h).abs()))
        };
        if let (Some(m6), Some(m4)) = (of("M6", 0.9), of("M4", 1.35)) {
            page.find(format!(
                "gamma {gamma:.3}: M6 at {:.2} has {} and M4 at {:.2} has {}, at the same cost",
                m6.h_fac,
                short(m6.l2),
                m4.h_fac,
                short(m4.l2)
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shock_tube_is_better_with_more_particles() {
        let [few, many] = [60, 120].map(|n| Shock::of("M6", 1.0, 1.4, n).unwrap().l2);
        assert!(many < 0.8 * few && many < 0.05, "{few} {many}");
    }
}
