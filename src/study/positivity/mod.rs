//! Where the weights of Español & Revenga's anisotropic operator are negative, and from which anisotropy on something
//! grows: on the M6 neighbourhood of lattices, from the formulas alone.
//!
//! A pair along r̂ has the weight ((nu + 2) r̂·kappa·r̂ − tr kappa) (−F/r). A wave exp(i k·r) on a lattice grows at the
//! rate Σ V w (cos k·r − 1), for two first derivatives at −g·kappa·g with g = Σ V (F/r) r sin k·r.

mod lattice;

use super::page::Page;
use super::plot::{Axis, Plot, Style};
use super::request::Request;
use super::table::{Table, column, short};
use crate::error::Result;
use lattice::{Form, Neighbours};
use std::f64::consts::PI;

/// kappa = 1 along an axis, `across` at right angles to it.
#[derive(Debug, Clone, Copy)]
pub struct Tensor {
    pub angle: f64,
    pub across: f64,
}

impl Tensor {
    /// r̂·kappa·r̂ for a direction whose cosine with the axis is `cos`.
    fn along(&self, cos: f64) -> f64 {
        cos * cos + self.across * (1.0 - cos * cos)
    }

    fn trace(&self, dim: usize) -> f64 {
        1.0 + (dim as f64 - 1.0) * self.across
    }

    /// Español & Revenga's angular factor.
    pub fn factor(&self, dim: usize, cos: f64) -> f64 {
        (dim as f64 + 2.0) * self.along(cos) - self.trace(dim)
    }

    fn ratio(&self) -> f64 {
        1.0 / self.across
    }
}

/// The share of all directions where the factor is negative.
pub fn negative_share(dim: usize, across: f64) -> f64 {
    let tensor = Tensor { angle: 0.0, across };
    // The factor rises with cos²: it is negative below the cosine where it vanishes.
    let at = (tensor.trace(dim) / (dim as f64 + 2.0) - across) / (1.0 - across);
    match at.clamp(0.0, 1.0).sqrt() {
        _ if across >= 1.0 => 0.0,
        cos if dim == 2 => 1.0 - 2.0 * cos.acos() / PI,
        cos => cos,
    }
}

/// The largest kappa_par/kappa_perp without a negative direction, by bisection.
pub fn limit(dim: usize) -> f64 {
    let (mut positive, mut negative) = (1.0, 0.0);
    for _ in 0..60 {
        let across = 0.5 * (positive + negative);
        let tensor = Tensor { angle: 0.0, across };
        if tensor.factor(dim, 0.0) < 0.0 { negative = across } else { positive = across }
    }
    1.0 / positive
}

/// What grows on a lattice, over directions of the axis.
#[derive(Debug, Clone)]
pub struct Growth {
    pub lattice: &'static str,
    pub ratio: f64,
    /// Share of pairs with a negative weight, at the worst angle.
    pub negative: f64,
    /// Largest growth rate times h², 0 where nothing grows: Español & Revenga, r̂·kappa·r̂ alone, two first derivatives.
    pub rates: [f64; 3],
}

impl Growth {
    /// # Errors
    /// As [`crate::kernel::Kernel::new`].
    pub fn of(lattice: &'static str, across: f64, waves: usize) -> Result<Growth> {
        let near = Neighbours::new(lattice, "M6", 1.0)?;
        let angles: Vec<f64> = (0..=6).map(|i| f64::from(i) * PI / 12.0).collect();
        let tensors = angles.iter().map(|&angle| Tensor { angle, across });
        let most = |of: &dyn Fn(Tensor) -> f64| tensors.clone().map(of).fold(0.0, f64::max);
        let rates =
            [Form::EspanolRevenga, Form::Pair, Form::TwoFirst].map(|form| most(&|t| near.growth(form, t, waves)));
        let negative = most(&|t| near.negative(t));
        Ok(Growth { lattice, ratio: Tensor { angle: 0.0, across }.ratio(), negative, rates })
    }
}

const ACROSS: &[f64] = &[1.0, 0.5, 0.4, 1.0 / 3.0, 0.3, 0.25, 0.2, 0.1, 0.03, 0.0];

/// # Errors
/// As [`Growth::of`].
pub fn run(mut request: Request) -> Result<Page> {
    let mut page = Page::new("positivity", "Where anisotropic weights are negative, and what grows");
    let waves = request.pick(12, 32, 96);
    let mut found = Vec::new();
    for (done, across) in ACROSS.iter().enumerate() {
        if !request.goes_on(done, ACROSS.len()) {
            page.complete = false;
            break;
        }
        for lattice in ["square", "hexagonal"] {
            found.push(Growth::of(lattice, *across, waves)?);
        }
    }
    page.tables = vec![directions(), growth(&found)];
    let near = Neighbours::new("square", "M6", 1.0)?;
    page.tables.push(pairs(&near));
    page.plots = vec![map(&near), growth_plot(&found)];
    say(&mut page, &found, &near);
    Ok(page)
}

fn directions() -> Table {
    let names = ["kappa_par/kappa_perp", "negative in 2-D", "in 3-D"];
    let mut table = Table::new("directions", &names.map(|name| column(name, "share of directions")));
    table.columns[0].unit = "";
    for across in ACROSS {
        table.push([(1.0 / across).into(), negative_share(2, *across).into(), negative_share(3, *across).into()]);
    }
    table
}

fn growth(found: &[Growth]) -> Table {
    let mut table = Table::new(
        "growth",
        &[
            column("lattice", ""),
            column("kappa_par/kappa_perp", ""),
            column("negative pairs", "share"),
            column("Espanol-Revenga", "kappa/h^2"),
            column("pair form", "kappa/h^2"),
            column("two first derivatives", "kappa/h^2"),
        ],
    );
    for Growth { lattice, ratio, negative, rates: [er, pair, two] } in found {
        table.push([
            (*lattice).into(),
            (*ratio).into(),
            (*negative).into(),
            (*er).into(),
            (*pair).into(),
            (*two).into(),
        ]);
    }
    table
}

/// kappa_xx = 1, all else 0.
const ALONG_X: Tensor = Tensor { angle: 0.0, across: 0.0 };

fn pairs(near: &Neighbours) -> Table {
    let names = ["x/h", "y/h", "factor", "weight"].map(|name| column(name, ""));
    let mut table = Table::long("pairs", &names);
    for pair in &near.pairs {
        let factor = ALONG_X.factor(2, pair.cos(ALONG_X.angle));
        table.push([pair.r[0].into(), pair.r[1].into(), factor.into(), (factor * pair.slope).into()]);
    }
    table
}

/// The slide's grey region: two wedges around the axis across.
fn map(near: &Neighbours) -> Plot {
    let title = "Grey: the inequality fails for kappa_xx = 1, kappa_yy = 0 (M6 on a square lattice)";
    let mut plot = Plot::new(title, Axis::linear("x/h"), Axis::linear("y/h"));
    plot.map = true;
    let edge = (PI / 2.0) * (1.0 - negative_share(2, 0.0));
    for (name, middle) in [("inequality fails", PI / 2.0), ("", -PI / 2.0)] {
        let rim = (0..=40).map(|i| middle + (PI / 2.0 - edge) * (f64::from(i) / 20.0 - 1.0));
        let rim = rim.map(|a| (near.radius * a.cos(), near.radius * a.sin()));
        plot.add(name, Style::Area, std::iter::once((0.0, 0.0)).chain(rim).collect());
    }
    for (name, negative) in [("weight < 0", true), ("weight >= 0", false)] {
        let of = near.pairs.iter().filter(|p| (ALONG_X.factor(2, p.cos(0.0)) < 0.0) == negative);
        plot.add(name, Style::Points, of.map(|p| (p.r[0], p.r[1])).collect());
    }
    plot
}

fn growth_plot(found: &[Growth]) -> Plot {
    let title = "Largest growth rate on a lattice, M6";
    let mut plot = Plot::new(title, Axis::log("kappa_par/kappa_perp"), Axis::linear("rate h^2/kappa_par"));
    for lattice in ["square", "hexagonal"] {
        let of = found.iter().filter(|g| g.lattice == lattice);
        plot.add(format!("Espanol-Revenga, {lattice}"), Style::Line, of.map(|g| (g.ratio, g.rates[0])).collect());
    }
    plot
}

fn say(page: &mut Page, found: &[Growth], near: &Neighbours) {
    let (plane, space) = (negative_share(2, 0.0), negative_share(3, 0.0));
    page.find(format!(
        "kappa_xx = 1, kappa_yy = 0: the inequality fails beyond {:.1} degrees from the axis in 2-D ({:.0} % of directions) and {:.1} in 3-D ({:.0} %)",
        90.0 * (1.0 - plane),
        100.0 * plane,
        space.acos().to_degrees(),
        100.0 * space
    ));
    page.find(format!(
        "of {} pairs of M6 on a square lattice {:.0} % have a negative weight there",
        near.pairs.len(),
        100.0 * near.negative(ALONG_X)
    ));
    page.find(format!(
        "no direction is negative up to kappa_par/kappa_perp = {:.3} in 2-D, {:.3} in 3-D",
        limit(2),
        limit(3)
    ));
    for lattice in ["square", "hexagonal"] {
        let grows: Vec<&Growth> = found.iter().filter(|g| g.lattice == lattice && g.rates[0] > 1e-9).collect();
        let from = grows.iter().map(|g| g.ratio).fold(f64::INFINITY, f64::min);
        let most = grows.iter().map(|g| g.rates[0]).fold(0.0, f64::max);
        let (from, most) = (short(from), short(most));
        page.find(match grows.is_empty() {
            true => format!("{lattice} lattice: Espanol-Revenga does not grow in spite of its negative weights"),
            false => format!("{lattice} lattice: Espanol-Revenga grows from kappa_par/kappa_perp = {from} of those tried on, by at most {most} kappa/h^2"),
        });
    }
    let [pair, two] = [1, 2].map(|k| found.iter().map(|g| g.rates[k]).fold(0.0, f64::max));
    page.find(format!("the pair form 2 r.kappa.r (never negative) grows at most at {pair:.0e}, two first derivatives at {two:.0e}; the pair form stands for another tensor once kappa_par > 3 kappa_perp"));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_is_three_and_the_grey_region_starts_at_sixty_degrees() {
        for dim in [2, 3] {
            assert!((limit(dim) - 3.0).abs() < 1e-12);
            assert_eq!(negative_share(dim, 1.0 / 3.0 + 1e-9), 0.0);
        }
        assert!((negative_share(2, 0.0) - 1.0 / 3.0).abs() < 1e-12, "60 of 90 degrees");
        assert!((negative_share(3, 0.0).acos().to_degrees() - 63.4349).abs() < 1e-3);
    }

    #[test]
    fn a_square_lattice_grows_and_a_hexagonal_one_does_not() {
        // 0.13680 with an axis along the lattice, from another program.
        let steep = Growth::of("square", 0.0, 32).unwrap();
        assert!((steep.rates[0] - 0.1368).abs() < 1e-3 && steep.negative > 0.3, "{steep:?}");
        // The six-fold tensors of fourth rank are those of continuous space.
        let hexagonal = Growth::of("hexagonal", 0.0, 32).unwrap();
        let mild = Growth::of("square", 0.34, 24).unwrap();
        for growth in [&hexagonal, &mild] {
            assert!(growth.rates[0] < 1e-12, "{growth:?}");
        }
        assert!(steep.rates[1] < 1e-12 && steep.rates[2] < 1e-12 && mild.negative == 0.0, "{steep:?}");
    }
}
