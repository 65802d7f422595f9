//! Which operator, kernel, h_fac and integrator reach an error cheapest, tried on a host's own particles.
//!
//! No exact solution is known there. Errors are distances from a reference, the time integrated far more exactly than was
//! asked for; what a choice is said to err by includes what the reference may be wrong by.
//!
//! Inside a cloud and where kappa is smooth the reference has moment-consistent weights of the highest order that works
//! on these particles. Its own error is at most about its distance from the next lower order, since that one is the worse
//! of the two. Beside free surfaces and jumps of kappa such weights are exact for what T is not, and neither
//! conserve nor know that nothing flows out: both orders would be wrong, and alike. There the reference is a conservative
//! operator, and its error what conservative operators of other forms and supports differ from it by, a longer support
//! counted by Richardson as of a method of first order.

use super::Solver;
use super::trial::Trial;
use crate::error::{Error, Result};
use crate::kernel::Kernel;
use crate::operator::table;
use crate::plan::applies::fitting;
use crate::space::surface;
use crate::sum::l2;
use crate::words::replaced;
use std::f64::consts::PI;
use std::time::Duration;

/// Operators for a scalar kappa that can win somewhere: the positive pair forms, and the consistent ones.
const OPERATORS: [&str; 5] = ["brookshaw", "kernel", "projected", "consistent order=2", "consistent order=4"];
const KERNELS: [&str; 4] = ["M4", "M6", "C2", "C4"];
/// In units of a kernel's default.
const H_FACS: [f64; 2] = [1.0, 1.25];
const INTEGRATORS: [&str; 4] = ["rkl2", "ssprk3", "rk4", "sdirk2"];

/// Orders of references, the best first.
const ORDERS: [u32; 3] = [6, 4, 2];
/// Neighbours of a reference for each of its unknowns.
const NEIGHBOURS: f64 = 2.2;
/// Error in time of a reference's sub-step, in units of what is wanted.
const EXACT_IN_TIME: f64 = 1e-3;

/// The cheapest choice that is accurate enough.
#[derive(Debug, Clone, PartialEq)]
pub struct Recommendation {
    /// To create a solver with: those of the one that was asked, with this choice in them.
    pub words: String,
    /// Relative l2: its distance from the reference, and what the reference may be wrong by.
    pub error: f64,
    /// From particles to answer, s: neighbours, weights and the step.
    pub seconds: f64,
}

/// T after a time as exactly as it can be had on these particles.
pub struct Reference {
    /// In the host's order.
    pub t: Vec<f64>,
    /// What it may be wrong by, relative l2.
    pub error: f64,
    /// What it was made with.
    pub about: &'static str,
}

/// Whether a choice cannot be used on these particles, rather than something being wrong with what was asked.
pub fn refused(error: &Error) -> bool {
    let by_operator = matches!(error, Error::BadValue { argument, .. } if argument == "operator");
    by_operator
        || matches!(
            error,
            Error::BadElement { .. }
                | Error::BoxTooSmall { .. }
                | Error::Growth { .. }
                | Error::NotFinite { .. }
                | Error::StepTooLarge { .. }
                | Error::OutOfBounds { .. }
                | Error::NotConverged { .. }
        )
}

impl Reference {
    /// After `dt` from now; `tolerance` is the error in time of a sub-step, relative to the spread of T.
    ///
    /// # Errors
    /// `BadValue` for a tensor kappa, which no operator of high order takes; what the last that was tried answers where
    /// none of two works; as [`Solver::attempt`].
    pub fn of(solver: &mut Solver, dt: f64, tolerance: f64) -> Result<Reference> {
        if solver.has_tensor() {
            let rule = "no operator of high order takes one, so that there is nothing to measure errors against";
            return Err(Error::bad("kappa", "a tensor", rule));
        }
        let free = free(solver)?;
        if is_smooth(solver)?
            && let Some(reference) = consistent(solver, dt, tolerance, &free)?
        {
            return Ok(reference);
        }
        conservative(solver, dt, tolerance, &free)
    }
}

/// kappa of neighbours differs by no more, where it is called smooth.
const SMOOTH: f64 = 2.0;

/// Whether weights that are fitted row by row can be trusted: no particle that moves is at a free surface, and kappa does
/// not jump.
///
/// # Errors
/// As [`surface::free`] and [`Solver::get`].
pub fn is_smooth(solver: &mut Solver) -> Result<bool> {
    let [m, rho, x, kappa, fixed] = ["m", "rho", "x", "kappa", "fixed"].map(|name| solver.get_all(name));
    let (m, rho, x, kappa, fixed) = (m?, rho?, x?, kappa?, fixed?);
    let power = 1.0 / solver.dim() as f64;
    let spacing: Vec<f64> = m.iter().zip(&rho).map(|(m, rho)| (m / rho).powf(power)).collect();
    let free = surface::free(solver.domain(), &x, &spacing)?;
    let open = free.iter().zip(&fixed).any(|(free, fixed)| *free && *fixed == 0.0);
    Ok(!open && surface::jump(solver.domain(), &x, &spacing, &kappa)? <= SMOOTH)
}

/// None where no two orders can be used on these particles.
fn consistent(solver: &mut Solver, dt: f64, tolerance: f64, free: &[bool]) -> Result<Option<Reference>> {
    let (mut found, mut failed) = (Vec::new(), Error::Cancelled);
    for order in ORDERS {
        let words = exact_words(solver.dim(), order, tolerance)?;
        found.extend(attempted(solver, &words, dt, &mut failed)?);
        if let [best, next] = &found[..] {
            let error = l2(&pairs(next, best, free));
            let about = "consistent weights of higher order";
            return Ok(Some(Reference { t: found.swap_remove(0), error, about }));
        }
    }
    Ok(None)
}

/// Of the conservative operators: the reference, the same with a support [`LONGER`], and others.
const CONSERVATIVE: [&str; 4] = ["brookshaw", "brookshaw", "kernel", "projected"];
const LONGER: f64 = 1.25;

fn conservative(solver: &mut Solver, dt: f64, tolerance: f64, free: &[bool]) -> Result<Reference> {
    let (default, mut failed) = (Kernel::new("M6", solver.dim())?.h_fac(), Error::Cancelled);
    let mut found = Vec::new();
    for (i, operator) in CONSERVATIVE.into_iter().enumerate() {
        let h_fac = if i % 2 == 1 { LONGER * default } else { default };
        let words = format!("operator={operator} kernel=M6 h_fac={h_fac} integrator=rkl2 tolerance={tolerance:e}");
        found.push(attempted(solver, &words, dt, &mut failed)?);
    }
    let mut found = found.into_iter();
    let (Some(Some(t)), Some(Some(longer))) = (found.next(), found.next()) else { return Err(failed) };
    let apart = |other: &[f64]| l2(&pairs(other, &t, free));
    // With an error of first order in the support: e (LONGER − 1) is what they differ by.
    let richardson = apart(&longer) / (LONGER - 1.0);
    let error = found.flatten().map(|other| apart(&other)).fold(richardson, f64::max);
    Ok(Reference { t, error, about: "conservative operators" })
}

/// T with these words; none where they cannot be used here, with the reason in `failed`.
fn attempted(solver: &mut Solver, words: &str, dt: f64, failed: &mut Error) -> Result<Option<Vec<f64>>> {
    let line = fitting(&replaced(solver.words(), words, DROPPED));
    match solver.attempt(&line, dt, Duration::MAX) {
        Ok(trial) => Ok(trial.map(|t| t.t)),
        Err(e) if refused(&e) => {
            *failed = e;
            Ok(None)
        }
        Err(e) => Err(e),
    }
}

/// Words that belong to the choice which is replaced.
const DROPPED: &[&str] = &["order", "normalise", "stages"];

/// Words for weights that are consistent to an order, with neighbours enough for its unknowns, and a time integration
/// that errs by `tolerance` at most in a sub-step.
///
/// # Errors
/// As [`Kernel::new`].
pub fn exact_words(dim: usize, order: u32, tolerance: f64) -> Result<String> {
    let h_fac = reach(dim, order) / Kernel::new("C2", dim)?.radius();
    Ok(format!(
        "operator=consistent order={order} mean=arithmetic kernel=C2 h_fac={h_fac} integrator=rkl2 tolerance={tolerance:e}"
    ))
}

/// How many spacings the support of a consistent operator must reach for neighbours enough.
fn reach(dim: usize, order: u32) -> f64 {
    // Monomials of degree 1 to the order.
    let unknowns = (1..=dim).fold(1, |product, k| product * (order as usize + k) / k) - 1;
    let ball = [2.0, PI, 4.0 * PI / 3.0][dim - 1];
    (NEIGHBOURS * unknowns as f64 / ball).powf(1.0 / dim as f64)
}

/// The cheapest choice that errs by at most `wanted` (relative l2, as the studies measure it) over `dt` from now. Many
/// choices are tried, each on a solver of its own: `solver` stays as it is, and this lasts as long as some hundred steps.
/// Where h was given it is left aside: h_fac is part of the choice. The progress callback is told the share of choices
/// tried.
///
/// # Errors
/// `OutOfReach` naming the most accurate choice; `BadValue` for numbers that are not positive, or a tensor kappa;
/// `Cancelled`; as [`Solver::step`].
pub fn recommend(solver: &mut Solver, wanted: f64, dt: f64) -> Result<Recommendation> {
    for (name, value) in [("wanted", wanted), ("dt", dt)] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(Error::bad(name, value, "it must be positive and finite"));
        }
    }
    solver.begin();
    if let Err(missing @ Error::OutOfOrder { .. }) = solver.ready("recommend") {
        return Err(missing);
    }
    solver.tell(0.0)?;
    let reference = Reference::of(solver, dt, (EXACT_IN_TIME * wanted).clamp(1e-9, 1e-4))?;
    let (free, all) = (free(solver)?, choices(solver)?);
    let (mut best, mut nearest): (Option<Recommendation>, Option<Recommendation>) = (None, None);
    for (done, words) in all.iter().enumerate() {
        solver.tell(done as f64 / all.len() as f64)?;
        // What takes longer than the best so far cannot win.
        let patience = best.as_ref().map_or(Duration::MAX, |b| Duration::from_secs_f64(b.seconds));
        let Trial { t, seconds } = match solver.attempt(words, dt, patience) {
            Ok(Some(trial)) => trial,
            Ok(None) => continue,
            Err(e) if refused(&e) => continue,
            Err(e) => return Err(e),
        };
        let error = l2(&pairs(&t, &reference.t, &free)) + reference.error;
        let found = Recommendation { words: words.clone(), error, seconds };
        if error <= wanted && best.as_ref().is_none_or(|b| seconds < b.seconds) {
            best = Some(found);
        } else if nearest.as_ref().is_none_or(|n| error < n.error) {
            nearest = Some(found);
        }
    }
    best.ok_or_else(|| {
        let (best, error) = nearest.map_or((String::new(), f64::INFINITY), |n| (n.words, n.error));
        Error::OutOfReach { wanted, best, error, reference: reference.error }
    })
}

/// Words of every choice.
fn choices(solver: &Solver) -> Result<Vec<String>> {
    let mut all = Vec::new();
    for operator in OPERATORS {
        let solvable = operator.split(' ').next().map(table::find).transpose()?.is_some_and(|o| o.dissipative);
        for kernel in KERNELS {
            let default = Kernel::new(kernel, solver.dim())?.h_fac();
            for h_fac in H_FACS.map(|h| h * default) {
                for integrator in INTEGRATORS.iter().filter(|name| solvable || **name != "sdirk2") {
                    let words = format!("operator={operator} kernel={kernel} h_fac={h_fac:.2} integrator={integrator}");
                    all.push(fitting(&replaced(solver.words(), &words, DROPPED)));
                }
            }
        }
    }
    Ok(all)
}

/// Which particles' T is not fixed.
fn free(solver: &mut Solver) -> Result<Vec<bool>> {
    Ok(solver.get_all("fixed")?.iter().map(|fixed| *fixed == 0.0).collect())
}

fn pairs(t: &[f64], known: &[f64], free: &[bool]) -> Vec<(f64, f64)> {
    t.iter().zip(known).zip(free).filter(|(_, free)| **free).map(|((t, known), _)| (*t, *known)).collect()
}

#[cfg(all(test, feature = "cli"))]
mod tests {
    use super::*;
    use crate::array::Strided;
    use crate::study::lattice;

    /// A mode on jittered particles of the unit square, and the time in which it decays to 1/e.
    fn mode(n: usize, words: &str) -> (Solver, Vec<f64>, f64) {
        let mut x = lattice::find("square", 2).unwrap().fill(&[0.0; 2], &[1.0; 2], n).unwrap();
        lattice::jitter(&mut x, 0.2 / n as f64, 1);
        let mut s = Solver::new(&format!("heat dim=2 {words}")).unwrap();
        s.set_box(&[0.0; 2], &[1.0; 2], &[true; 2]).unwrap();
        s.set_particles(Strided::new("x", &x, n * n, 2, 2).unwrap()).unwrap();
        let t: Vec<f64> = x.chunks(2).map(|p| p.iter().map(|x| (2.0 * PI * x).sin()).product()).collect();
        for (name, value) in [("m", 1.0 / (n * n) as f64), ("rho", 1.0), ("kappa", 1.0)] {
            s.set_number(name, value).unwrap();
        }
        s.set("T", Strided::packed(&t)).unwrap();
        (s, t, 1.0 / (8.0 * PI * PI))
    }

    #[test]
    fn what_is_recommended_is_as_accurate_as_it_says() {
        let (mut s, t, dt) = mode(24, "threads=1 kernel=M4 max_stages=200");
        assert!(is_smooth(&mut s).unwrap());
        let exact: Vec<f64> = t.iter().map(|t| t / 1f64.exp()).collect();
        for wanted in [3e-2, 2e-3] {
            let found = recommend(&mut s, wanted, dt).unwrap();
            assert!(found.error <= wanted && found.words.contains("threads=1"), "{found:?}");
            // The host's word stays where the choice has stages.
            let has_stages = found.words.contains("integrator=rkl2");
            assert_eq!(found.words.contains("max_stages=200"), has_stages, "{found:?}");
            let trial = s.attempt(&found.words, dt, Duration::MAX).unwrap().unwrap();
            let error = l2(&pairs(&trial.t, &exact, &vec![true; t.len()]));
            // The bound includes the reference's own error in space; in time some thirty sub-steps add up.
            assert!(error <= found.error + 30.0 * EXACT_IN_TIME * wanted, "{error:e} {found:?}");
        }
        assert_eq!((s.get_all("T").unwrap(), s.get_number("time").unwrap()), (t, 0.0));
    }

    /// Jittered particles of the open unit square, or of a strip that is open along x alone.
    fn open(n: usize, strip: bool, kappa: impl Fn(f64) -> f64, t: impl Fn(&[f64]) -> f64) -> Solver {
        let mut x = lattice::find("square", 2).unwrap().fill(&[0.0; 2], &[1.0; 2], n).unwrap();
        lattice::jitter(&mut x, 0.2 / n as f64, 5);
        let mut s = Solver::new("heat dim=2 threads=1").unwrap();
        if strip {
            s.set_box(&[0.0; 2], &[1.0; 2], &[false, true]).unwrap();
        }
        s.set_particles(Strided::new("x", &x, n * n, 2, 2).unwrap()).unwrap();
        s.set_number("m", 1.0 / (n * n) as f64).unwrap();
        s.set_number("rho", 1.0).unwrap();
        let each = |f: &dyn Fn(&[f64]) -> f64| x.chunks(2).map(f).collect::<Vec<_>>();
        s.set("kappa", Strided::packed(&each(&|p| kappa(p[0])))).unwrap();
        s.set("T", Strided::packed(&each(&t))).unwrap();
        s
    }

    /// What is recommended is not worse than it says, nor much worse than the default.
    fn holds(s: &mut Solver, wanted: f64, dt: f64, exact: &[f64]) {
        let error = |s: &mut Solver, words: &str| {
            let trial = s.attempt(words, dt, Duration::MAX).unwrap().unwrap();
            l2(&pairs(&trial.t, exact, &vec![true; exact.len()]))
        };
        let own = s.words().to_string();
        let default = error(s, &own);
        match recommend(s, wanted, dt) {
            Ok(found) => {
                let true_error = error(s, &found.words);
                assert!(true_error <= found.error && found.error <= wanted, "{true_error:e} {default:e} {found:?}");
            }
            // The reference does not carry more; what it says of the best must be true as well.
            Err(Error::OutOfReach { best, error: said, .. }) => {
                let true_error = error(s, &best);
                assert!(true_error <= said && said < 20.0 * default, "{true_error:e} {default:e} {said:e} {best}");
            }
            Err(e) => panic!("{e}"),
        }
    }

    #[test]
    fn beside_free_surfaces_no_more_is_claimed_than_holds() {
        let wave = |p: &[f64]| (PI * p[0]).cos() * (PI * p[1]).cos();
        let mut s = open(14, false, |_| 1.0, wave);
        assert!(!is_smooth(&mut s).unwrap());
        let exact: Vec<f64> = s.get_all("T").unwrap().iter().map(|t| t / 1f64.exp()).collect();
        for wanted in [0.3, 1e-2] {
            holds(&mut s, wanted, 1.0 / (2.0 * PI * PI), &exact);
        }
        assert!(matches!(recommend(&mut s, 1e-3, 0.05), Err(Error::OutOfReach { .. })));
    }

    #[test]
    fn where_kappa_jumps_no_more_is_claimed_than_holds() {
        for ratio in [10.0, 30.0] {
            let kappa = |x: f64| if x < 0.5 { 1.0 } else { ratio };
            let mut s = open(10, true, kappa, |p| (PI * p[0]).cos());
            assert!(!is_smooth(&mut s).unwrap());
            let dt = 0.05;
            let lines = layers(kappa, dt);
            let x = s.get_all("x").unwrap();
            let exact: Vec<f64> = x.chunks(2).map(|p| lines(p[0])).collect();
            holds(&mut s, 0.3, dt, &exact);
        }
    }

    /// cos(pi x) after a time between insulated ends: finite volumes with the flux of resistances in series, 1000 cells and
    /// 2000 steps of backward Euler, right to some 1e-4.
    fn layers(kappa: impl Fn(f64) -> f64, time: f64) -> impl Fn(f64) -> f64 {
        let (n, steps) = (1000, 2000);
        let d = 1.0 / n as f64;
        let middle = |i: usize| (i as f64 + 0.5) * d;
        let mut t: Vec<f64> = (0..n).map(|i| (PI * middle(i)).cos()).collect();
        let face =
            |i: usize| 2.0 / (1.0 / kappa(middle(i)) + 1.0 / kappa(middle(i + 1))) / (d * d) * time / steps as f64;
        let g: Vec<f64> = (0..n - 1).map(face).collect();
        let left = |i: usize| if i > 0 { g[i - 1] } else { 0.0 };
        let right = |i: usize| if i + 1 < n { g[i] } else { 0.0 };
        for _ in 0..steps {
            // Elimination along the line, and back.
            let (mut c, mut r) = (vec![0.0; n], vec![0.0; n]);
            for i in 0..n {
                let (before, known) = if i > 0 { (c[i - 1], r[i - 1]) } else { (0.0, 0.0) };
                let pivot = 1.0 + left(i) + right(i) - left(i) * before;
                (c[i], r[i]) = (right(i) / pivot, (t[i] + left(i) * known) / pivot);
            }
            (0..n).rev().for_each(|i| t[i] = r[i] + c[i] * if i + 1 < n { t[i + 1] } else { 0.0 });
        }
        move |x| t[((x / d) as usize).min(n - 1)]
    }

    #[test]
    fn what_cannot_be_reached_is_said_with_the_best() {
        let (mut s, _, dt) = mode(12, "threads=1");
        let text = recommend(&mut s, 1e-9, dt).unwrap_err().to_string();
        assert!(text.contains("operator=consistent order=4") && text.contains("more particles"), "{text}");
        for (wanted, dt, expected) in [(0.0, dt, "wanted is 0"), (0.1, f64::NAN, "dt is NaN")] {
            assert!(recommend(&mut s, wanted, dt).unwrap_err().to_string().contains(expected));
        }
        for (name, value) in [("kappa_par", 1.0), ("kappa_perp", 0.1), ("b_x", 1.0)] {
            s.set_number(name, value).unwrap();
        }
        assert!(recommend(&mut s, 0.1, dt).unwrap_err().to_string().contains("kappa is a tensor"));
    }

    #[test]
    fn functions_of_the_host_are_lent_and_come_back() {
        let (mut s, _, dt) = mode(12, "threads=1");
        s.set_kappa_callback(Some(Box::new(|_, _, _, kappa| {
            kappa.fill(1.0);
            0
        })));
        s.set_progress_callback(Some(Box::new(|_, share| i32::from(share > 0.2))));
        assert_eq!(recommend(&mut s, 0.5, dt).unwrap_err(), Error::Cancelled);
        s.set_progress_callback(None);
        recommend(&mut s, 0.5, dt).unwrap();
        assert!(s.step(dt).is_ok(), "kappa is known");
    }
}
