//! Orders of implicit methods, what they keep at any step and tolerance, and what they do when they fail.

use super::*;

/// y' = −y (1 − sin t), z' = −z²; the second with the operator −z frozen.
struct Decay([f64; 2]);

impl System for Decay {
    fn rate(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<()> {
        dy.copy_from_slice(&[y[0] * (t.sin() - 1.0), -y[1] * y[1]]);
        Ok(())
    }

    fn linearise(&mut self, t: f64, y: &[f64], diagonal: &mut [f64], weight: &mut [f64]) -> Result<Linear> {
        diagonal.copy_from_slice(&[1.0 - t.sin(), y[1]]);
        weight.fill(1.0);
        self.0 = [1.0 - t.sin(), y[1]];
        Ok(Linear::Frozen)
    }

    fn apply(&mut self, x: &[f64], ax: &mut [f64]) -> Result<()> {
        ax.copy_from_slice(&[-self.0[0] * x[0], -self.0[1] * x[1]]);
        Ok(())
    }
}

/// A ring of points in which each exchanges with the next, at rates up to 1.
struct Ring;

impl System for Ring {
    fn rate(&mut self, _: f64, y: &[f64], dy: &mut [f64]) -> Result<()> {
        let n = y.len();
        (0..n).for_each(|i| dy[i] = 0.5 * ((y[(i + 1) % n] - y[i]) + (y[(i + n - 1) % n] - y[i])));
        Ok(())
    }

    fn linearise(&mut self, _: f64, _: &[f64], diagonal: &mut [f64], weight: &mut [f64]) -> Result<Linear> {
        diagonal.fill(1.0);
        weight.fill(1.0);
        Ok(Linear::Exact)
    }

    fn apply(&mut self, x: &[f64], ax: &mut [f64]) -> Result<()> {
        self.rate(0.0, x, ax)
    }

    fn supply(&mut self, _: f64, _: &[f64]) -> Result<Option<f64>> {
        Ok(Some(0.0))
    }
}

fn implicit() -> impl Iterator<Item = &'static Method> {
    METHODS.iter().filter(|m| m.is_implicit())
}

fn step(method: &Method, dt: f64, limits: Limits, system: &mut dyn System, y: &mut [f64]) -> Result<f64> {
    let calm = Bounds { spectral: 0.0, diagonal: 0.0 };
    let schedule = method.schedule(dt, calm, &Options { limits, ..Options::default() })?;
    assert_eq!((schedule.substeps, schedule.dt), (1, dt));
    let mut work = Work::default();
    method.advance(&schedule, system, &Pool::new(1)?, 0.0, y, &mut work)?;
    Ok(work.slack)
}

#[test]
fn orders_are_those_of_the_table() {
    // Exact: exp(1 − t − cos t) and 1/(1 + t).
    let exact = [(-1.0 - 2f64.cos()).exp(), 1.0 / 3.0];
    let calm = Bounds { spectral: 0.0, diagonal: 0.0 };
    for method in implicit() {
        let error = |n: u32| {
            let (mut y, dt) = ([1.0, 1.0], 2.0 / f64::from(n));
            let schedule = method.schedule(dt, calm, &Options::default()).unwrap();
            let (pool, mut work, mut system) = (Pool::new(1).unwrap(), Work::default(), Decay([0.0; 2]));
            for k in 0..n {
                method.advance(&schedule, &mut system, &pool, f64::from(k) * dt, &mut y, &mut work).unwrap();
            }
            [(y[0] - exact[0]).abs(), (y[1] - exact[1]).abs()]
        };
        let (coarse, fine) = (error(80), error(160));
        for i in 0..2 {
            let order = (coarse[i] / fine[i]).log2();
            // The next order contributes a relative 1/80; the solver's tolerance far less.
            assert!((order - f64::from(method.order)).abs() < 0.1, "{} [{i}]: {order}", method.name);
        }
    }
}

#[test]
fn stiff_waves_die_where_the_method_is_l_stable() {
    // The shortest wave of the ring has eigenvalue −2.
    for (name, largest) in [("backward-euler", 1e-4), ("sdirk2", 1e-3), ("crank-nicolson", 1.0)] {
        let mut y: Vec<f64> = (0..64).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
        step(find(name).unwrap(), 1e4, Limits::default(), &mut Ring, &mut y).unwrap();
        let rest = y.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
        assert!(rest <= largest && (name != "crank-nicolson" || rest > 0.99), "{name}: {rest:e}");
    }
}

#[test]
fn sums_are_kept_at_any_tolerance_and_constants_to_the_bit() {
    for method in implicit() {
        for (tolerance, dt) in [(1e-2, 1.0), (1e-2, 1e3), (1e-2, 1e6), (1e-10, 1e6), (1e-10, 1e12)] {
            let mut y: Vec<f64> = (0..256).map(|i| if i % 64 < 16 { 10.0 } else { 0.1 }).collect();
            let limits = Limits { tolerance, ..Limits::default() };
            let before: f64 = y.iter().sum();
            let slack = step(method, dt, limits, &mut Ring, &mut y).unwrap();
            let change = y.iter().sum::<f64>() / before - 1.0;
            // 256 roundings of values up to 10.
            assert!(change.abs() < 1e-14 * 256.0, "{} {tolerance} {dt}: {change:e}", method.name);
            let inside = y.iter().all(|y| (0.1 - slack..=10.0 + slack).contains(y));
            assert!(inside || method.ssp == 0.0, "{dt} {slack:e}");
            let mut flat = vec![0.1; 64];
            step(method, dt, limits, &mut Ring, &mut flat).unwrap();
            assert!(flat.iter().all(|&v| v == 0.1), "{}", method.name);
        }
    }
}

#[test]
fn failures_leave_the_state() {
    struct Opaque;
    impl System for Opaque {
        fn rate(&mut self, _: f64, _: &[f64], dy: &mut [f64]) -> Result<()> {
            dy.fill(1.0);
            Ok(())
        }
    }
    for method in implicit() {
        let start: Vec<f64> = (0..256).map(f64::from).collect();
        let mut y = start.clone();
        let few = Limits { iterations: 3, ..Limits::default() };
        let e = step(method, 1e4, few, &mut Ring, &mut y).unwrap_err();
        assert_eq!((e.name(), &y), ("NOT_CONVERGED", &start), "{}", method.name);
        let e = step(method, 1e30, Limits::default(), &mut Ring, &mut y).unwrap_err();
        assert_eq!((e.name(), &y), ("NOT_CONVERGED", &start), "{}", method.name);
        let e = step(method, 1.0, Limits::default(), &mut Opaque, &mut y).unwrap_err();
        assert_eq!((e.name(), &y), ("BAD_VALUE", &start), "{}", method.name);
    }
}
