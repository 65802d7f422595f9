//! Orders with the stage count pinned, stability limits, conservation, schedules, and what stage counts cost.

use super::stabilised::{RKL1, RKL2, Stage};
use super::*;
use std::f64::consts::PI;

struct Rate<F>(F);

impl<F: FnMut(f64, &[f64], &mut [f64])> System for Rate<F> {
    fn rate(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<()> {
        (self.0)(t, y, dy);
        Ok(())
    }
}

fn rates(f: impl FnMut(f64, &[f64], &mut [f64])) -> Rate<impl FnMut(f64, &[f64], &mut [f64])> {
    Rate(f)
}

fn run(method: &Method, schedule: &Schedule, system: &mut dyn System, y: &mut [f64]) {
    let (pool, mut work) = (Pool::new(1).unwrap(), Work::default());
    for k in 0..schedule.substeps {
        method.advance(schedule, system, &pool, schedule.start(k), y, &mut work).unwrap();
    }
}

/// The methods that apply the rate only.
fn explicit() -> impl Iterator<Item = &'static Method> {
    METHODS.iter().filter(|m| !m.is_implicit())
}

/// `n` steps from 0 to `total`, with the stages given.
fn fixed(n: u64, stages: u32, total: f64) -> Schedule {
    Schedule { substeps: n, stages, dt: total / n as f64, total, limits: Limits::default() }
}

fn stages_of(method: &Method, pinned: u32) -> u32 {
    method.most_stages(&Options { stages: Some(pinned), ..Options::default() }).unwrap()
}

#[test]
fn orders_are_those_of_the_table() {
    // y' = -y + y sin t: nonautonomous; z' = -z²: nonlinear. Exact: exp(1 - t - cos t), 1/(1 + t).
    let f = |t: f64, y: &[f64], dy: &mut [f64]| {
        dy[0] = y[0] * (t.sin() - 1.0);
        dy[1] = -y[1] * y[1];
    };
    let exact = [(1.0 - 2.0 - 2f64.cos()).exp(), 1.0 / 3.0];
    for method in explicit() {
        for pinned in [3, 6, 9] {
            let stages = stages_of(method, pinned);
            let error = |n: u64| {
                let mut y = [1.0, 1.0];
                run(method, &fixed(n, stages, 2.0), &mut rates(f), &mut y);
                [(y[0] - exact[0]).abs(), (y[1] - exact[1]).abs()]
            };
            let (coarse, fine) = (error(80), error(160));
            for i in 0..2 {
                let order = (coarse[i] / fine[i]).log2();
                // The next order contributes a relative 1/80, so 0.1 in the exponent is ample.
                assert!((order - f64::from(method.order)).abs() < 0.1, "{} s={stages} [{i}]: {order}", method.name);
            }
        }
    }
}

/// |R(-z)| of one step of the method.
fn amplification(method: &Method, stages: u32, z: f64) -> f64 {
    let mut y = [1.0];
    run(method, &fixed(1, stages, 1.0), &mut rates(|_, y, dy| dy[0] = -z * y[0]), &mut y);
    y[0].abs()
}

#[test]
fn stability_intervals_end_where_the_table_says() {
    for method in explicit() {
        for pinned in [3, 5, 11, 33] {
            let stages = stages_of(method, pinned);
            let interval = method.interval(stages);
            for i in 1..2000 {
                let z = interval * f64::from(i) / 2000.0;
                // Legendre's polynomial reaches 1 at its end; the rest is rounding in the recursion.
                assert!(amplification(method, stages, z) <= 1.0 + 1e-12, "{} s={stages} at {z}", method.name);
            }
            assert!(amplification(method, stages, 0.99 * interval) < 1.0, "{}", method.name);
            // RKL2's polynomial is damped at its end, where it has room for a little more.
            let beyond = if method.name == "rkl2" { 1.5 } else { 1.02 };
            assert!(amplification(method, stages, beyond * interval) > 1.0, "{} s={stages}", method.name);
        }
    }
}

#[test]
fn internal_coefficients_are_those_of_the_paper() {
    let close = |a: f64, b: f64| (a - b).abs() < 1e-15;
    let [one, two, three] = [1.0, 2.0, 3.0].map(|j| (RKL2.stage)(3.0, j));
    assert!(close(two.mu, 3.0 / 2.0) && close(three.mu, 25.0 / 12.0));
    assert!(close(two.nu, -1.0 / 2.0) && close(three.nu, -5.0 / 6.0));
    assert!(close(one.mu_rate, 2.0 / 15.0) && close(two.mu_rate, 3.0 / 5.0) && close(three.mu_rate, 5.0 / 6.0));
    assert!(close(two.gamma_rate, -2.0 / 5.0) && close(three.gamma_rate, -5.0 / 9.0));
    let expected = Stage { mu: 5.0 / 3.0, nu: -2.0 / 3.0, mu_rate: 5.0 / 18.0, gamma_rate: 0.0 };
    assert_eq!((RKL1.stage)(3.0, 3.0), expected);
}

#[test]
fn stabilised_methods_are_legendre_polynomials() {
    for (s, z) in [(3u32, 1.7), (7, 11.0), (15, 90.0)] {
        let x = |interval: f64| 1.0 - 2.0 * z / interval;
        let legendre = |x: f64| {
            let (mut below, mut p) = (1.0, x);
            for j in 2..=s {
                let j = f64::from(j);
                (below, p) = (p, ((2.0 * j - 1.0) * x * p - (j - 1.0) * below) / j);
            }
            p
        };
        let n = f64::from(s);
        let b = (n * n + n - 2.0) / (2.0 * n * (n + 1.0));
        let rkl1 = legendre(x((RKL1.interval)(n)));
        let rkl2 = 1.0 - b + b * legendre(x((RKL2.interval)(n)));
        // Rounding in s stages.
        assert!((amplification(find("rkl1").unwrap(), s, z) - rkl1.abs()).abs() < 1e-13);
        assert!((amplification(find("RKL2").unwrap(), s, z) - rkl2.abs()).abs() < 1e-13);
    }
}

/// The five-point Laplacian on a periodic square of side `n` with unit spacing; largest eigenvalue 8, row sum 4.
fn laplacian(n: usize) -> impl FnMut(f64, &[f64], &mut [f64]) {
    move |_, y, dy| {
        for i in 0..n {
            let (up, down) = ((i + n - 1) % n * n, (i + 1) % n * n);
            for j in 0..n {
                let (left, right) = ((j + n - 1) % n, (j + 1) % n);
                let around = (y[up + j] + y[down + j]) + (y[i * n + left] + y[i * n + right]);
                dy[i * n + j] = around - 4.0 * y[i * n + j];
            }
        }
    }
}

const SQUARE: Bounds = Bounds { spectral: 8.0, diagonal: 4.0 };

fn hot_disc(n: usize) -> Vec<f64> {
    let c = 0.5 * (n - 1) as f64;
    let inside = |k: usize| ((k / n) as f64 - c).hypot((k % n) as f64 - c) < 0.25 * n as f64;
    (0..n * n).map(|k| if inside(k) { 10.0 } else { 0.1 }).collect()
}

/// The disc after one step of `total`, with at most so many stages, and the sub-steps that took.
fn disc_after(name: &str, total: f64, max_stages: u32) -> (Vec<f64>, Schedule) {
    let method = find(name).unwrap();
    let schedule = method.schedule(total, SQUARE, &Options { max_stages, ..Options::default() }).unwrap();
    let mut y = hot_disc(64);
    run(method, &schedule, &mut rates(laplacian(64)), &mut y);
    (y, schedule)
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn each_substep_about_halves_what_it_cannot_resolve() {
    // After t = 1000 the slowest wave of the square is exp(-1000 (2 pi / 64)²) = 6.5e-5 of what it was.
    let (exact, _) = disc_after("rk4", 1000.0, 31);
    for max_stages in [stabilised::MAX_STAGES, 45, 63, 127] {
        let (y, schedule) = disc_after("rkl2", 1000.0, max_stages);
        let rest = largest_difference(&y, &exact) / 9.9;
        // The shortest waves are halved; 0.65 is the next maximum of (1 + J0)/2.
        let [halved, most] = [0.5f64, 0.65].map(|factor| factor.powi(schedule.substeps as i32));
        assert!(rest < most && rest > halved / 4.0, "{max_stages}: {rest:e} {halved:e} {most:e}");
        assert_eq!(rest < 1e-3, max_stages == stabilised::MAX_STAGES, "{max_stages}: {rest:e}");
    }
}

#[test]
fn stabilised_methods_solve_the_heat_equation_as_euler_does() {
    // One wave of the square: all methods see the same eigenvalue.
    let (n, total) = (32usize, 20.0);
    let wave = |i: usize| (2.0 * PI * (i % n) as f64 / n as f64).sin();
    let eigenvalue = 2.0 - 2.0 * (2.0 * PI / n as f64).cos();
    for method in explicit() {
        let schedule = method.schedule(total, SQUARE, &Options { max_stages: 9, ..Options::default() }).unwrap();
        let mut y: Vec<f64> = (0..n * n).map(wave).collect();
        run(method, &schedule, &mut rates(laplacian(n)), &mut y);
        let exact: Vec<f64> = (0..n * n).map(|i| wave(i) * (-eigenvalue * total).exp()).collect();
        // Each sub-step errs by at most half of z^(order + 1), as all these methods do for z < 1; and rounds.
        let z = eigenvalue * schedule.dt;
        let tolerance = 0.5 * schedule.substeps as f64 * z.powi(method.order as i32 + 1) + 1e-13;
        let error = largest_difference(&y, &exact);
        assert!(z < 1.0 && error < tolerance, "{}: {error:e} {tolerance:e}", method.name);
    }
}

#[test]
fn sums_are_conserved_and_constants_are_kept_to_the_bit() {
    for method in explicit() {
        for max_stages in [9, 127] {
            let schedule = method.schedule(1000.0, SQUARE, &Options { max_stages, ..Options::default() }).unwrap();
            let mut y = hot_disc(64);
            let before = crate::sum::compensated(y.iter().copied());
            run(method, &schedule, &mut rates(laplacian(64)), &mut y);
            let change = crate::sum::compensated(y.iter().copied()) / before - 1.0;
            // Independent roundings of 4096 values in up to 8000 stages.
            assert!(change.abs() < 1e-13, "{} {max_stages}: {change:e}", method.name);
            let mut flat = vec![0.1; 64 * 64];
            run(method, &schedule, &mut rates(|_, _, dy| dy.fill(0.0)), &mut flat);
            assert!(flat.iter().all(|&v| v == 0.1), "{}", method.name);
        }
    }
}

#[test]
fn strong_stability_keeps_the_bounds_and_nothing_less_does() {
    // Sixteen points, each bound to all others: eigenvalue 16, row sum 15. A step of 1.9/16 is stable for Euler.
    let bounds = Bounds { spectral: 16.0, diagonal: 15.0 };
    let all_to_all = |_: f64, y: &[f64], dy: &mut [f64]| {
        let sum: f64 = y.iter().sum();
        dy.iter_mut().zip(y).for_each(|(dy, y)| *dy = sum - 16.0 * y);
    };
    let keeps = |method: &Method, keep_bounds: bool| {
        let schedule = method.schedule(1.9 / 16.0, bounds, &Options { keep_bounds, ..Options::default() }).unwrap();
        let mut y = [0.1; 16];
        y[3] = 10.0;
        run(method, &schedule, &mut rates(all_to_all), &mut y);
        y.iter().all(|v| (0.1 - 1e-14..=10.0 + 1e-14).contains(v))
    };
    assert!(explicit().filter(|m| m.ssp > 0.0).all(|m| keeps(m, true)));
    assert!(!keeps(find("euler").unwrap(), false));
}

#[test]
fn schedules_add_up_and_grow_with_the_step() {
    for method in explicit() {
        for (options, bounds) in [
            (Options::default(), SQUARE),
            (Options { max_stages: 4, ..Options::default() }, SQUARE),
            (Options { keep_bounds: true, ..Options::default() }, Bounds { spectral: 5.0, diagonal: 5.0 }),
        ] {
            let mut applications = 0;
            for i in 0..400 {
                let dt = 1e-3 * 1.04f64.powi(i);
                let s = method.schedule(dt, bounds, &options).unwrap();
                let stable = s.dt * bounds.spectral <= method.interval(s.stages) * (1.0 + 1e-15);
                assert!(stable, "{} {dt}: {s:?}", method.name);
                assert!((s.dt * s.substeps as f64 / dt - 1.0).abs() <= f64::EPSILON && s.start(s.substeps) == dt);
                assert!(s.applications() >= applications, "{} {dt}: {s:?}", method.name);
                applications = s.applications();
                assert!(s.stages <= options.max_stages.max(4) && s.start(0) == 0.0);
            }
        }
    }
}

#[test]
fn a_step_takes_the_fewest_odd_stages() {
    let rkl2 = find("rkl2").unwrap();
    let stages = |z: f64| rkl2.schedule(z / 8.0, SQUARE, &Options::default()).map(|s| (s.substeps, s.stages)).unwrap();
    // (s² + s - 2)/2: 5 for 3 stages, 14 for 5, 495 for 31.
    assert_eq!([1e-9, 5.0, 5.01, 14.0, 14.01, 495.0].map(stages), [(1, 3), (1, 3), (1, 5), (1, 5), (1, 7), (1, 31)]);
    assert_eq!(stages(496.0), (2, 23));
    assert_eq!(stages_of(rkl2, 8), 8);
}

#[test]
fn extreme_steps_and_bounds_are_answered() {
    let options = Options::default();
    let calm = Bounds { spectral: 0.0, diagonal: 0.0 };
    for method in explicit() {
        let substeps = |dt: f64, bounds: Bounds| method.schedule(dt, bounds, &options).map(|s| s.substeps);
        assert_eq!(substeps(0.0, SQUARE), Ok(0));
        assert_eq!([1e-300, 1.0, 1e300].map(|dt| substeps(dt, calm)), [Ok(1), Ok(1), Ok(1)]);
        assert_eq!(substeps(1e-300, SQUARE), Ok(1));
        assert_eq!(substeps(f64::MIN_POSITIVE / 2.0, Bounds { spectral: 1e300, diagonal: 1e300 }), Ok(1));
        assert_eq!(method.limit(calm), f64::INFINITY);
        for (dt, rate) in [(1e30, 8.0), (1e300, 1e300), (f64::MAX, f64::MAX)] {
            let error = substeps(dt, Bounds { spectral: rate, diagonal: rate }).unwrap_err();
            assert!(matches!(error, Error::StepTooLarge { needed, .. } if needed > options.max_applications as f64));
        }
        for bad in [-1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(substeps(bad, SQUARE).unwrap_err().code(), -2);
            assert_eq!(substeps(1.0, Bounds { spectral: bad, diagonal: 1.0 }).unwrap_err().code(), -2);
            assert_eq!(substeps(1.0, Bounds { spectral: 1.0, diagonal: bad }).unwrap_err().code(), -2);
        }
        let empty = method.schedule(1.0, SQUARE, &options).unwrap();
        run(method, &empty, &mut rates(|_, _, _| {}), &mut []);
    }
    let rkl2 = find("rkl2").unwrap();
    let stages = |stages, max_stages| {
        rkl2.schedule(1.0, SQUARE, &Options { stages, max_stages, ..Options::default() }).map(|s| s.stages)
    };
    assert_eq!([stages(Some(1), 31), stages(None, 2), stages(None, 0)].map(|s| s.unwrap_err().code()), [-2; 3]);
    assert_eq!((stages(None, u32::MAX), stages(Some(4), 31)), (Ok(5), Ok(4)));
    assert_eq!(find("rk5").unwrap_err().code(), -5);
}

#[test]
fn threads_do_not_change_a_bit() {
    for method in explicit() {
        let schedule = method.schedule(3.0, SQUARE, &Options::default()).unwrap();
        let result = |threads: usize| {
            let (pool, mut work, mut y) = (Pool::new(threads).unwrap(), Work::default(), hot_disc(64));
            method.advance(&schedule, &mut rates(laplacian(64)), &pool, 0.0, &mut y, &mut work).unwrap();
            y
        };
        assert!(result(1).iter().zip(result(3)).all(|(a, b)| a.to_bits() == b.to_bits()), "{}", method.name);
    }
}

#[test]
fn work_is_reserved_once() {
    let pool = Pool::new(1).unwrap();
    for method in explicit() {
        let (mut work, mut y) = (Work::default(), hot_disc(16));
        let mut step = |stages: u32, work: &mut Work| {
            let schedule = fixed(1, stages_of(method, stages), 0.01);
            method.advance(&schedule, &mut rates(laplacian(16)), &pool, 0.0, &mut y, work).unwrap();
            let mut places: Vec<_> = work.arrays.iter().map(|a| (a.as_ptr(), a.capacity())).collect();
            places.sort(); // the recursion swaps them
            places
        };
        let first = step(5, &mut work);
        assert_eq!(first, step(6, &mut work), "{}", method.name);
        assert!(work.bytes() >= 8 * 256);
    }
}

#[test]
fn an_error_of_the_system_leaves_the_state() {
    struct Failing(u32);
    impl System for Failing {
        fn rate(&mut self, _: f64, _: &[f64], dy: &mut [f64]) -> Result<()> {
            dy.fill(1.0);
            self.0 -= 1;
            if self.0 == 0 { Err(Error::Busy) } else { Ok(()) }
        }
    }
    let pool = Pool::new(1).unwrap();
    for method in explicit() {
        let stages = stages_of(method, 5);
        for call in 1..=stages {
            let mut y = [1.0, 2.0];
            let done =
                method.advance(&fixed(1, stages, 1.0), &mut Failing(call), &pool, 0.0, &mut y, &mut Work::default());
            assert_eq!((done, y), (Err(Error::Busy), [1.0, 2.0]), "{}", method.name);
        }
    }
}
