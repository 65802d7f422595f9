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
            Some(p) => said.push(format!("for {wanted:.0e}: {}, {} ms ({})", p.choice, millis(p), short(p.error))),
            None => {
                let best = front.last();
                let best =
                    best.map(|p| format!("; the best is {} with {}, {} ms", short(p.error), p.choice, millis(p)));
                said.push(format!("for {wanted:.0e}: none of these{}", best.unwrap_or_default()));
                break;
            }
        }
    }
    said
}

fn millis(p: &Point) -> String {
    format!("{:.3}", 1e3 * p.seconds).chars().take(4).collect::<String>().trim_end_matches('.').into()
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
