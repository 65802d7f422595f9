//! Error control on problems with known solutions: what a tolerance gives, what is rejected, what is never shortened.

use super::*;

/// y' = −40 (y − cos t) − sin t, z' = −z²: a fast decay onto cos t, and a slow one. Exact: cos t from y = 1, 1/(1 + t).
struct Pair([f64; 2]);

impl System for Pair {
    fn rate(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<()> {
        dy.copy_from_slice(&[-40.0 * (y[0] - t.cos()) - t.sin(), -y[1] * y[1]]);
        Ok(())
    }

    fn linearise(&mut self, _: f64, y: &[f64], diagonal: &mut [f64], weight: &mut [f64]) -> Result<Linear> {
        self.0 = [40.0, y[1]];
        diagonal.copy_from_slice(&self.0);
        weight.fill(1.0);
        Ok(Linear::Frozen)
    }

    fn apply(&mut self, x: &[f64], ax: &mut [f64]) -> Result<()> {
        ax.copy_from_slice(&[-self.0[0] * x[0], -self.0[1] * x[1]]);
        Ok(())
    }
}

const BOUNDS: Bounds = Bounds { spectral: 40.0, diagonal: 40.0 };

/// (largest error at t = 2, sub-steps, rejected) from y = `start`, z = 1.
fn run(method: &'static Method, tolerance: f64, start: f64) -> (f64, u32, u64) {
    let (pool, mut work, mut y, mut system) = (Pool::new(1).unwrap(), Work::default(), [start, 1.0], Pair([0.0; 2]));
    let bounds = if method.is_implicit() { Bounds { spectral: 0.0, diagonal: 0.0 } } else { BOUNDS };
    let weight = [1.0; 2];
    let control = Control { method, tolerance: Some(tolerance), range: Range::FINITE, raises: 0.0 };
    let mut pace = Adaptive::new(control, &pool, &weight, &mut system, (0.0, 2.0), &y).unwrap();
    let (mut t, mut accepted) = (0.0, 0);
    while t < 2.0 {
        let part = pace.next(2.0 - t, f64::INFINITY);
        let schedule = method.schedule(part, bounds, &Options::default()).unwrap();
        if pace.attempt(method, &schedule, &mut system, t, &mut y, &mut work).unwrap() {
            t = if schedule.dt == 2.0 - t { 2.0 } else { t + schedule.dt };
            accepted += 1;
        }
    }
    let transient = (start - 1.0) * (-80.0f64).exp();
    ((y[0] - 2f64.cos() - transient).abs().max((y[1] - 1.0 / 3.0).abs()), accepted, pace.rejected)
}

#[test]
fn errors_follow_the_tolerance_for_every_method() {
    for method in METHODS {
        for tolerance in [1e-3, 1e-4, 1e-5, 1e-6] {
            let (error, substeps, rejected) = run(method, tolerance, 3.0);
            println!("{:15} {tolerance:e}: {error:.1e} {substeps} {rejected}", method.name);
            // Local errors of what decays slowly add up to the tolerance times the number of sub-steps, at most.
            assert!(error < 2.0 * tolerance * f64::from(substeps.max(5)), "{} {tolerance:e}: {error:e}", method.name);
            assert!(rejected <= u64::from(substeps / 5 + 5), "{} {tolerance:e}: {rejected}", method.name);
        }
    }
}

#[test]
fn a_constant_is_one_step_and_a_failure_is_passed_on() {
    struct Still(Option<Error>);
    impl System for Still {
        fn rate(&mut self, _: f64, _: &[f64], dy: &mut [f64]) -> Result<()> {
            dy.fill(0.0);
            self.0.clone().map_or(Ok(()), Err)
        }

        fn linearise(&mut self, _: f64, _: &[f64], diagonal: &mut [f64], weight: &mut [f64]) -> Result<Linear> {
            diagonal.fill(1.0);
            weight.fill(1.0);
            Ok(Linear::Exact)
        }
    }
    let (pool, weight) = (Pool::new(1).unwrap(), [1.0; 3]);
    for method in METHODS {
        let (mut y, mut system, mut work) = ([1.0, 2.0, 4.0], Still(None), Work::default());
        let control = Control { method, tolerance: Some(1e-6), range: Range::FINITE, raises: 0.0 };
        let mut pace = Adaptive::new(control, &pool, &weight, &mut system, (0.0, 7.0), &y).unwrap();
        assert_eq!(pace.next(7.0, f64::INFINITY), 7.0);
        let schedule = Schedule { substeps: 1, stages: 5, dt: 7.0, total: 7.0, limits: Limits::default() };
        assert_eq!(pace.attempt(method, &schedule, &mut system, 0.0, &mut y, &mut work), Ok(true), "{}", method.name);
        assert_eq!((y, pace.rejected), ([1.0, 2.0, 4.0], 0));
        system.0 = Some(Error::bad_at("kappa", 1, -1.0, "positive"));
        assert_eq!(pace.attempt(method, &schedule, &mut system, 0.0, &mut y, &mut work), Ok(false));
        assert!(pace.failure().is_some() && pace.next(7.0, f64::INFINITY) < 2.0 && pace.rejected == 1);
        system.0 = Some(Error::Cancelled);
        assert_eq!(pace.attempt(method, &schedule, &mut system, 0.0, &mut y, &mut work), Err(Error::Cancelled));
    }
}
