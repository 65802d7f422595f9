//! The shock tube over h_fac for every kernel: the error of the density against the exact solution.

pub mod riemann;
mod tube;

use super::batch;
use super::kernels::Moments;
use super::mode::{FCC, LINE, Sample};
use super::page::Page;
use super::plot::{Axis, Plot, Style};
use super::request::Request;
use super::table::{Cell, Table, column, short};
use crate::error::Result;
use crate::kernel;
use crate::solver::recommend::refused;
use riemann::{Gas, Riemann};
use tube::Tube;

pub const LEFT: Gas = Gas { rho: 1.0, v: 0.0, p: 1.0 };
pub const RIGHT: Gas = Gas { rho: 0.125, v: 0.0, p: 0.1 };
const END: f64 = 0.2;

/// Two kernels at supports of 2.7 spacings.
pub const EQUAL: [(&str, f64); 2] = [("M4", 1.35), ("M6", 0.9)];

pub const GAMMAS: [f64; 2] = [1.4, 5.0 / 3.0];

/// One tube.
#[derive(Debug, Clone)]
pub struct Shock {
    pub dim: usize,
    pub gamma: f64,
    pub kernel: &'static str,
    pub h_fac: f64,
    /// Of the density: sqrt(Σ (rho − exact)² / Σ exact²) over particles; no number where the gas fell apart.
    pub l2: f64,
    /// K_d2 − 1 of brookshaw on the lattice of the gas at rest.
    pub second: f64,
}

impl Shock {
    /// With `n` cells of the lattice along the dense half.
    ///
    /// # Errors
    /// As [`Tube::new`].
    pub fn of(dim: usize, kernel: &'static str, h_fac: f64, gamma: f64, n: usize) -> Result<Shock> {
        let mut tube = Tube::new(kernel, dim, h_fac, gamma, n, [LEFT, RIGHT])?;
        let l2 = match tube.run(END) {
            Ok(()) => error(&tube, &Riemann::new(gamma, LEFT, RIGHT)),
            Err(e) if refused(&e) => f64::NAN,
            Err(e) => return Err(e),
        };
        let (lattice, cells) = if dim == 1 { (LINE, 8) } else { (FCC, 4) };
        let second = Moments::of(&Sample::new(lattice, cells)?, kernel, "brookshaw", h_fac)?.second;
        Ok(Shock { dim, gamma, kernel, h_fac, l2, second })
    }
}

fn error(tube: &Tube, exact: &Riemann) -> f64 {
    let terms = tube.densities().map(|(x, rho)| (rho, exact.density(x / END)));
    let [error, size] = terms.fold([0.0; 2], |[e, s], (rho, known)| [e + (rho - known).powi(2), s + known * known]);
    (error / size).sqrt()
}

/// Tubes that are asked for by kernel, h_fac and gamma, as far as `goes_on` lets them.
///
/// # Errors
/// As [`Shock::of`].
pub fn tubes(
    dim: usize,
    n: usize,
    cases: &[(&'static str, f64, f64)],
    goes_on: impl FnMut(usize) -> bool,
) -> Result<Vec<Shock>> {
    batch::map(cases, |(kernel, h_fac, gamma)| Shock::of(dim, kernel, *h_fac, *gamma, n), goes_on)
}

fn h_facs(last: f64, steps: u32) -> impl Iterator<Item = f64> + Clone {
    (0..=steps).map(move |i| 0.8 + (last - 0.8) * f64::from(i) / f64::from(steps))
}

/// # Errors
/// As [`Shock::of`].
pub fn run(mut request: Request) -> Result<Page> {
    let mut page = Page::new("sod", "Shock tube: density error against h_fac for every kernel, in 1-D and 3-D");
    let (line, steps) = request.pick((16, 2), (60, 6), (400, 24));
    let (space, few) = request.pick((2, 1), (5, 3), (24, 12));
    // In 3-D supports of twice the default reach a thousand neighbours.
    let h_facs_in = [h_facs(2.0, steps), h_facs(1.4, few)].map(|h| h.collect::<Vec<_>>());
    let sets = [(1, line), (3, space)].into_iter().zip(h_facs_in);
    let mut found: Vec<Shock> = Vec::new();
    for (part, ((dim, n), h_facs)) in sets.enumerate() {
        let mut cases = Vec::new();
        // In 3-D one gamma must do where time is short.
        for gamma in GAMMAS.into_iter().take(if dim == 3 && !request.full { 1 } else { GAMMAS.len() }) {
            cases.extend(kernel::catalogue().flat_map(|(k, _)| h_facs.iter().map(move |h| (k, *h, gamma))));
            // Those that are compared have supports of 2.7 spacings, and so the same neighbours.
            cases.extend(EQUAL.map(|(kernel, h_fac)| (kernel, h_fac, gamma)));
            cases.sort_by(|a, b| (a.0, a.1).partial_cmp(&(b.0, b.1)).unwrap_or(std::cmp::Ordering::Equal));
            cases.dedup();
        }
        cases.sort_by(|a, b| a.2.total_cmp(&b.2));
        let all = cases.len();
        let some = tubes(dim, n, &cases, |done| request.goes_on(part * all + done, 2 * all))?;
        page.complete &= some.len() == all;
        found.extend(some);
        page.find(format!("{dim}-D: {n} cells of the lattice along each half of the dense gas"));
    }
    page.tables = vec![best(&found), table(&found)];
    page.plots = found.chunk_by(|a, b| (a.dim, a.gamma) == (b.dim, b.gamma)).map(plot).collect();
    let lost = found.iter().filter(|s| !s.l2.is_finite());
    let lost: Vec<String> = lost.map(|s| format!("{} at {:.2} in {}-D", s.kernel, s.h_fac, s.dim)).collect();
    if !lost.is_empty() {
        page.find(format!("no numbers in the end, for want of neighbours: {}", lost.join(", ")));
    }
    say(&mut page, &found);
    Ok(page)
}

fn curves(found: &[Shock]) -> impl Iterator<Item = &[Shock]> {
    found.chunk_by(|a, b| (a.dim, a.gamma, a.kernel) == (b.dim, b.gamma, b.kernel))
}

fn table(found: &[Shock]) -> Table {
    let names = ["dim", "gamma", "kernel", "h_fac", "l2", "K_d2 - 1"].map(|name| column(name, ""));
    let mut table = Table::long("errors", &names);
    for Shock { dim, gamma, kernel, h_fac, l2, second } in found {
        let [gamma, h_fac, l2, second] = [gamma, h_fac, l2, second].map(|v| Cell::Number(*v));
        table.push([(*dim).into(), gamma, (*kernel).into(), h_fac, l2, second]);
    }
    table
}

fn best(found: &[Shock]) -> Table {
    let names = [
        "kernel",
        "dim",
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
                best.dim.into(),
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

/// Tubes of one dimension and gamma.
fn plot(found: &[Shock]) -> Plot {
    let title = format!("l2 error of the density in {}-D, gamma = {:.3}", found[0].dim, found[0].gamma);
    let mut plot = Plot::new(title, Axis::linear("h_fac"), Axis::log("relative l2 error of rho"));
    for curve in curves(found) {
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
    for (dim, gamma) in [1, 3].into_iter().flat_map(|dim| GAMMAS.map(|gamma| (dim, gamma))) {
        let of = |kernel: &str, h: f64| {
            let own = found.iter().filter(|s| (s.dim, s.gamma) == (dim, gamma) && s.kernel == kernel);
            own.into_iter().find(|s| s.h_fac == h)
        };
        let [m4, m6] = EQUAL.map(|(kernel, h)| of(kernel, h));
        if let (Some(m6), Some(m4)) = (m6, m4) {
            page.find(format!(
                "{dim}-D, gamma {gamma:.3}: M6 at {:.2} has {} and M4 at {:.2} has {}, with the same neighbours",
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
        for (dim, sizes, most) in [(1, [60, 120], 0.05), (3, [4, 8], 0.15)] {
            let [few, many] = sizes.map(|n| Shock::of(dim, "M6", 1.0, 1.4, n).unwrap().l2);
            assert!(many < 0.8 * few && many < most, "{dim}-D: {few} {many}");
        }
    }
}
