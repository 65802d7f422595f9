//! Glasses: particles that are evenly spaced without a lattice, made from jittered ones.

use crate::array::Strided;
use crate::error::Result;
use crate::solver::Solver;

/// How often.
const PUSHES: usize = 300;
/// Support, in spacings.
const REACH: f64 = 2.4;
/// Length of a push, in spacings times the first moment.
const PUSH: f64 = 0.012;

/// Lets particles of a periodic box, `lo.len()` coordinates each, push each other apart.
///
/// # Errors
/// As [`Solver::set_box`] and [`Solver::get`].
pub fn relax(x: &mut [f64], lo: &[f64], hi: &[f64]) -> Result<()> {
    let dim = lo.len();
    let n = x.len() / dim;
    let volume: f64 = lo.iter().zip(hi).map(|(lo, hi)| hi - lo).product();
    let spacing = (volume / n.max(1) as f64).powf(1.0 / dim as f64);
    let mut s = Solver::new(&format!("heat dim={dim} kernel=M4"))?;
    s.set_box(lo, hi, &vec![true; dim])?;
    for (name, value) in [("m", volume / n.max(1) as f64), ("rho", 1.0), ("h", 0.5 * REACH * spacing)] {
        s.set_number(name, value)?;
    }
    for _ in 0..PUSHES {
        s.set_particles(Strided::new("x", x, n, dim, dim)?)?;
        // The first moment of positive weights points to where neighbours crowd.
        let crowd = s.get_all("first_moment")?;
        for (i, (x, crowd)) in x.iter_mut().zip(crowd).enumerate() {
            let (lo, hi) = (lo[i % dim], hi[i % dim]);
            *x = lo + (*x - PUSH * spacing * crowd - lo).rem_euclid(hi - lo);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::lattice;
    use super::*;

    #[test]
    fn a_glass_has_a_smaller_first_moment_than_what_it_was_made_from() {
        for (dim, n) in [(2, 16), (3, 8)] {
            let (lo, hi) = (&[0.0, -1.0, 2.0][..dim], &[1.0, 0.0, 3.0][..dim]);
            let mut x = lattice::find("cubic", dim).unwrap().fill(lo, hi, n).unwrap();
            lattice::jitter(&mut x, 0.5 / n as f64, 3);
            let moment = |x: &[f64]| {
                let mut s = Solver::new(&format!("heat dim={dim}")).unwrap();
                s.set_box(lo, hi, &[true; 3][..dim]).unwrap();
                s.set_particles(Strided::new("x", x, x.len() / dim, dim, dim).unwrap()).unwrap();
                s.set_number("m", dim as f64 / x.len() as f64).unwrap();
                s.set_number("rho", 1.0).unwrap();
                s.get_all("first_moment").unwrap().iter().map(|v| v * v).sum::<f64>().sqrt()
            };
            let before = moment(&x);
            relax(&mut x, lo, hi).unwrap();
            assert!(moment(&x) < 0.3 * before, "{dim}-D: {before} {}", moment(&x));
            assert!(x.chunks(dim).flatten().enumerate().all(|(i, x)| (lo[i % dim]..hi[i % dim]).contains(x)));
        }
    }
}
