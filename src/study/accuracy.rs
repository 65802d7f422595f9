//! The figures of "How right": errors of a decaying mode for the choices that matter, medians over seeds of the disorder.

use super::batch;
use super::convergence::Run;
use super::mode::{CUBIC, Cloud, FCC, GLASS_3D, JITTER_2D, JITTER_3D, SQUARE, STRONG_2D, STRONG_3D, Sample};
use super::page::Page;
use super::request::Request;
use super::table::{Table, column};
use crate::error::Result;

/// One line of the table; every word beside the kernel's is in it.
struct Line {
    cloud: Cloud,
    n: usize,
    kernel: &'static str,
    words: &'static str,
}

const fn line(cloud: Cloud, n: usize, kernel: &'static str, words: &'static str) -> Line {
    Line { cloud, n, kernel, words }
}

/// With M6 at its own h_fac on every cloud.
const PAIRS: &[&str] = &[
    "operator=brookshaw normalise=none",
    "operator=brookshaw normalise=pair",
    "operator=brookshaw",
    "operator=kernel normalise=none",
    "operator=kernel normalise=pair",
    "operator=kernel",
    "operator=direct",
];

const CLOUDS: &[(Cloud, usize)] =
    &[(SQUARE, 64), (JITTER_2D, 64), (CUBIC, 24), (FCC, 24), (JITTER_3D, 24), (GLASS_3D, 24)];

/// Where more than pairs of a default support are meant.
const OTHERS: &[Line] = &[
    line(JITTER_3D, 10, "C2", "operator=consistent order=4 h_fac=1.3"),
    line(JITTER_3D, 16, "C2", "operator=consistent order=4 h_fac=1.3"),
    line(JITTER_2D, 64, "M6", "operator=brookshaw h_fac=1.2"),
    line(JITTER_2D, 64, "M6", "operator=projected h_fac=1.2"),
    line(STRONG_2D, 64, "M4", "operator=brookshaw h_fac=1.8"),
    line(STRONG_2D, 64, "M4", "operator=projected h_fac=1.8"),
    line(JITTER_3D, 32, "M4", "operator=brookshaw h_fac=1.3"),
    line(JITTER_3D, 32, "M4", "operator=projected h_fac=1.3"),
    line(STRONG_3D, 32, "M4", "operator=brookshaw h_fac=1.3"),
    line(STRONG_3D, 32, "M4", "operator=projected h_fac=1.3"),
];

/// The median, the least and the greatest of values; none of no values.
pub fn spread(values: &[f64]) -> [f64; 3] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    match (sorted.first(), sorted.last()) {
        (Some(&least), Some(&greatest)) => [sorted[sorted.len() / 2], least, greatest],
        _ => [f64::NAN; 3],
    }
}

/// # Errors
/// As [`Run::of`].
pub fn run(mut request: Request) -> Result<Page> {
    let mut page = Page::new("accuracy", "Errors of a mode that decays to 1/e, medians over seeds of the disorder");
    let coarser = request.pick(4, 1, 1);
    let [plane, space] = request.pick([1, 1], [5, 3], [11, 5]);
    let of_pairs = |&(cloud, n): &(Cloud, usize)| PAIRS.iter().map(move |words| line(cloud, n, "M6", words));
    let others = OTHERS.iter().map(|l| line(l.cloud, l.n, l.kernel, l.words));
    let lines: Vec<Line> = CLOUDS.iter().flat_map(of_pairs).chain(others).collect();
    let names = ["particles", "n", "kernel", "words", "seeds", "median l2", "least", "greatest"];
    let mut table = Table::new("errors", &names.map(|name| column(name, "")));
    let mut samples: Vec<Sample> = Vec::new();
    for (done, Line { cloud, n, kernel, words }) in lines.iter().enumerate() {
        if !request.goes_on(done, lines.len()) {
            page.complete = false;
            break;
        }
        let (n, seeds) = (n / coarser, if cloud.is_disordered() { [plane, space][cloud.dim - 2] } else { 1 });
        // Glasses take longer to make than to use.
        if samples.first().is_none_or(|s| (s.cloud, s.n) != (*cloud, n)) {
            samples =
                batch::map(&(1..=seeds).collect::<Vec<u64>>(), |seed| Sample::seeded(*cloud, n, *seed), |_| true)?;
        }
        let variant = (words.to_string(), words.to_string());
        let found = batch::map(&samples, |sample| Run::of(sample, kernel, &variant), |_| true)?;
        let [median, least, greatest] = spread(&found.iter().map(|r| r.error).collect::<Vec<_>>());
        table.push([
            cloud.name.into(),
            n.into(),
            (*kernel).into(),
            (*words).into(),
            (seeds as usize).into(),
            median.into(),
            least.into(),
            greatest.into(),
        ]);
        if !median.is_finite() {
            page.find(format!("{words} on {}, n = {n}: refused or lost", cloud.name));
        }
    }
    page.find(format!(
        "the time is integrated by ssprk3 at its stability limit; disorder has {plane} seed(s) in 2-D and {space} in 3-D"
    ));
    page.tables.push(table);
    Ok(page)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_median_is_one_of_the_values() {
        assert_eq!(spread(&[3.0, 1.0, 2.0]), [2.0, 1.0, 3.0]);
        assert_eq!(spread(&[5.0]), [5.0; 3]);
        assert!(spread(&[]).iter().all(|v| v.is_nan()));
        // What is lost once is not hidden by the others.
        assert!(spread(&[1.0, f64::NAN, 2.0])[2].is_nan());
    }
}
