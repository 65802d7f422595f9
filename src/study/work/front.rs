//! The front: choices that nothing cheaper beats.

use super::Point;
use crate::study::table::short;

/// In order of cost, each more accurate than all that cost less.
pub fn front(points: &[Point], cost: impl Fn(&Point) -> f64) -> Vec<&Point> {
    let mut sorted: Vec<&Point> = points.iter().filter(|p| p.error.is_finite()).collect();
    sorted.sort_by(|a, b| cost(a).total_cmp(&cost(b)).then(a.error.total_cmp(&b.error)));
    let mut least = f64::INFINITY;
    sorted.retain(|p| {
        p.error < least && {
            least = p.error;
            true
        }
    });
    sorted
}

/// Errors that someone may want.
const WANTED: &[f64] = &[1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 1e-4];

/// The cheapest choice for each error, in words; the last sentence says where the choices end, or where the reference
/// is no longer known well enough: `doubt` is what it may be wrong by.
pub fn recommend(points: &[Point], doubt: f64) -> Vec<String> {
    let front = front(points, |p| p.seconds);
    let mut said = Vec::new();
    for wanted in WANTED {
        if *wanted < doubt {
            said.push(format!(
                "for {wanted:.0e}: not known, since the reference itself may be wrong by {}",
                short(doubt)
            ));
            break;
        }
        match front.iter().find(|p| p.error <= *wanted) {
            Some(p) => said.push(format!("for {wanted:.0e}: {}, {} ({})", p.choice, took(p.seconds), short(p.error))),
            None => {
                let best = front.last();
                let best =
                    best.map(|p| format!("; the best is {} with {}, {}", short(p.error), p.choice, took(p.seconds)));
                said.push(format!("for {wanted:.0e}: none of these{}", best.unwrap_or_default()));
                break;
            }
        }
    }
    said
}

/// Three digits, in the unit that suits.
fn took(seconds: f64) -> String {
    let (value, unit) = if seconds < 0.9995 { (1e3 * seconds, "ms") } else { (seconds, "s") };
    let digits = match value {
        v if v >= 99.95 => 0,
        v if v >= 9.995 => 1,
        _ => 2,
    };
    format!("{value:.digits$} {unit}")
}

#[cfg(test)]
mod tests {
    use super::super::choices::Choice;
    use super::*;

    fn point(seconds: f64, error: f64) -> Point {
        let choice = Choice { operator: "brookshaw", kernel: "M6", h_fac: 1.0, integrator: "rkl2", n: Some(8) };
        Point { choice, particles: 512, neighbours: 100.0, error, seconds, pairs: 1e6 }
    }

    #[test]
    fn times_have_three_digits_and_their_unit() {
        let texts = [1.234e-5, 1.9846e-2, 0.12345, 0.9996, 9.9952, 12.33, 1784.4].map(took);
        assert_eq!(texts, ["0.01 ms", "19.8 ms", "123 ms", "1.00 s", "10.0 s", "12.3 s", "1784 s"]);
    }

    #[test]
    fn the_front_is_what_nothing_cheaper_beats() {
        let points = [point(0.03, 2e-2), point(0.01, 5e-2), point(0.02, 9e-2), point(0.1, f64::NAN), point(0.2, 2e-2)];
        let seconds: Vec<f64> = front(&points, |p| p.seconds).iter().map(|p| p.seconds).collect();
        assert_eq!(seconds, [0.01, 0.03]);
        let said = recommend(&points, 0.0);
        assert_eq!(said[0], "for 1e-1: brookshaw, M6 at h_fac 1, rkl2, n = 8, 10.0 ms (0.050)");
        assert!(said.len() == 3 && said[2].starts_with("for 1e-2: none of these; the best is 0.020"), "{said:?}");
        let said = recommend(&points, 0.05);
        assert!(said.len() == 2 && said[1].starts_with("for 3e-2: not known"), "{said:?}");
    }
}
