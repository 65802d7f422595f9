//! Moment-consistent weights: exact for polynomials, of high order on disordered particles.

use crate::particles::*;
use std::f64::consts::PI;

/// A smooth function of place with a hump in every direction, and the sum of its second derivatives.
fn polynomial(p: &[f64], degree: i32) -> (f64, f64) {
    let value = p.iter().enumerate().map(|(a, x)| (x + 0.3 * a as f64).powi(degree)).sum::<f64>();
    let second = |x: f64| f64::from(degree * (degree - 1)) * x.powi(degree - 2);
    (value, p.iter().enumerate().map(|(a, x)| second(x + 0.3 * a as f64)).sum())
}

#[test]
fn polynomials_are_exact_on_any_particles() {
    for (dim, n) in [(1, 40), (2, 18), (3, 10)] {
        for order in [2, 4, 6] {
            // Enough neighbours for the monomials of the order, also beside the edge of an open cloud.
            let h_fac = [2.0, 1.5, 1.6][dim - 1] * (1.0 + 0.4 * f64::from(order - 2));
            let x = lattice(n, dim, 0.3);
            // Rows on one side of the edge are exact too, but have growing modes.
            let words = format!("kernel=C2 operator=consistent order={order} h_fac={h_fac} allow=unstable");
            let mut s = unit_box(&words, &x, dim, false);
            set(&mut s, "T", &field(&x, dim, |p| polynomial(p, order).0));
            let exact = field(&x, dim, |p| polynomial(p, order).1);
            let error = l2(&s.get_all("dT_dt").unwrap(), &exact);
            // Rounding of sums whose terms are 1/h² and more times the result.
            assert!(error < 1e-7, "{dim}-D order {order}: {error:e}");
        }
    }
}

/// The error on jittered particles.
fn error(words: &str, n: usize, dim: usize, jitter: f64) -> f64 {
    mode_error(words, &lattice(n, dim, jitter), dim)
}

#[test]
fn the_error_falls_with_the_order_on_disorder() {
    let words = |order: u32| format!("kernel=C2 h_fac=1.8 operator=consistent order={order} integrator=rk4");
    for order in [2, 4] {
        let (coarse, fine) = (error(&words(order), 16, 2, 0.2), error(&words(order), 32, 2, 0.2));
        let observed = (coarse / fine).log2();
        println!("order {order}: {coarse:.2e} {fine:.2e} observed {observed:.2}");
        // Disorder takes up to half an order of two sizes.
        assert!(observed > f64::from(order) - 0.5, "{order}: {observed}");
    }
    let pairs = error("kernel=C2 h_fac=1.8 operator=brookshaw integrator=rk4", 32, 2, 0.2);
    assert!(error(&words(4), 32, 2, 0.2) < 0.02 * pairs);
}

#[test]
fn the_work_item_in_three_dimensions() {
    // Support 2.6 spacings, 76 neighbours, 20 % jitter: an independent implementation found 9.4e-3 with 10³ particles,
    // 1.5e-3 with 16³, and for order 2 with a support of 2 9.3e-2 and 3.6e-2.
    for (order, h_fac, n, expected) in
        [(4, 1.3, 10, 9.4e-3), (4, 1.3, 16, 1.5e-3), (2, 1.0, 10, 9.3e-2), (2, 1.0, 16, 3.6e-2)]
    {
        let words = format!("kernel=C2 h_fac={h_fac} operator=consistent order={order} integrator=rk4");
        let error = error(&words, n, 3, 0.2);
        println!("order {order}, {n}^3: {error:.2e}");
        // Other random numbers.
        assert!((error / expected).ln().abs() < 0.3, "{words} {n}: {error:e} {expected:e}");
    }
}

#[test]
fn conductivity_that_varies_keeps_the_order() {
    // kappa = 1 + sin(2 pi x)/2 and T = cos(2 pi x): d/dx(kappa dT/dx) by hand.
    let error = |mean: &str, n: usize| {
        let x = lattice(n, 2, 0.2);
        let mut s = unit_box(&format!("kernel=C2 h_fac=1.8 operator=consistent {mean}"), &x, 2, true);
        let k = 2.0 * PI;
        set(&mut s, "kappa", &field(&x, 2, |p| 1.0 + 0.5 * (k * p[0]).sin()));
        set(&mut s, "T", &field(&x, 2, |p| (k * p[0]).cos()));
        let exact = field(&x, 2, |p| -k * k * ((k * p[0]).cos() + 0.5 * (2.0 * k * p[0]).sin()));
        l2(&s.get_all("dT_dt").unwrap(), &exact)
    };
    for mean in ["", "mean=arithmetic", "mean=geometric"] {
        let (coarse, fine) = (error(mean, 16), error(mean, 32));
        println!("variable kappa, {mean}: {coarse:.2e} {fine:.2e}");
        // Derivatives of fourth-order weights converge at least with order 3, whatever the mean.
        assert!(coarse / fine > 7.0, "{mean}: {coarse:e} {fine:e}");
    }
}

#[test]
fn a_jump_of_the_conductivity_wants_the_harmonic_mean() {
    // The slowest mode of two slabs, 1 and 10, in a periodic box, against many cells in a row.
    let cells = 1000;
    let (k, t0) = (2.0 * PI, 0.01);
    let conducts = |x: f64| if (x - 0.5).abs() < 0.25 { 10.0 } else { 1.0 };
    let at = |i: usize| (i as f64 + 0.5) / cells as f64;
    let mut exact: Vec<f64> = (0..cells).map(|i| (k * at(i) + 0.3).sin()).collect();
    let mut s =
        unit_box("normalise=pair integrator=sdirk2 tolerance=1e-6", &(0..cells).map(at).collect::<Vec<_>>(), 1, true);
    set(&mut s, "kappa", &(0..cells).map(|i| conducts(at(i))).collect::<Vec<_>>());
    set(&mut s, "T", &exact);
    s.step(t0).unwrap();
    exact = s.get_all("T").unwrap();
    let error = |mean: &str| {
        let x = lattice(24, 2, 0.2);
        let mut s = unit_box(&format!("kernel=C2 h_fac=1.8 operator=consistent {mean}"), &x, 2, true);
        set(&mut s, "kappa", &field(&x, 2, |p| conducts(p[0].rem_euclid(1.0))));
        set(&mut s, "T", &field(&x, 2, |p| (k * p[0] + 0.3).sin()));
        s.step(t0).unwrap();
        let there = field(&x, 2, |p| exact[(p[0].rem_euclid(1.0) * cells as f64) as usize % cells]);
        l2(&s.get_all("T").unwrap(), &there)
    };
    let (harmonic, arithmetic) = (error(""), error("mean=arithmetic"));
    assert!(harmonic < 0.5 * arithmetic, "{harmonic:e} {arithmetic:e}");
}

/// Error, energy made and number of paired rows of a mode in an open, insulated box.
fn insulated(words: &str, x: &[f64], dim: usize) -> (f64, f64, f64) {
    let mut s = unit_box(&format!("kernel=C2 {words}"), x, dim, false);
    let mode = field(x, dim, |p| 2.0 + p.iter().map(|x| (PI * x).cos()).product::<f64>());
    set(&mut s, "T", &mode);
    let paired = s.get_all("order_reached").unwrap().iter().filter(|o| **o == 0.0).count() as f64;
    let report = s.step(1.0 / (PI * PI * dim as f64)).unwrap();
    let exact = mode.iter().map(|m| 2.0 + (m - 2.0) * (-1.0f64).exp());
    let (off, all) = s
        .get_all("T")
        .unwrap()
        .iter()
        .zip(exact)
        .fold((0.0, 0.0), |(o, a), (t, e)| (o + (t - e) * (t - e), a + (e - 2.0) * (e - 2.0)));
    let levelled: f64 = mode.iter().map(|m| (m - 2.0).abs()).sum::<f64>() / mode.len() as f64;
    let made = (report.energy - report.energy_before).abs() / levelled;
    assert!((s.get_number("energy_defect").unwrap() / made - 1.0).abs() < 0.1 || made < 1e-6);
    (f64::sqrt(off / all), made, paired)
}

#[test]
fn beside_free_surfaces_it_insulates() {
    for (dim, n, jitter, words) in [
        (2, 24, 0.0, "h_fac=1.8 operator=consistent"),
        (2, 24, 0.2, "h_fac=1.8 operator=consistent"),
        (2, 24, 0.2, "h_fac=1.8 operator=consistent order=2"),
        (3, 9, 0.2, "h_fac=1.3 operator=consistent"),
        (3, 12, 0.0, "h_fac=1.3 operator=consistent order=2"),
    ] {
        let x = lattice(n, dim, jitter);
        let (error, made, paired) = insulated(&format!("{words} allow=energy"), &x, dim);
        println!("{dim}-D {jitter} {words}: error {error:.2e} energy {made:.1e}, {paired} of {} paired", x.len() / dim);
        assert!(paired > 0.0 && paired < 0.8 * (x.len() / dim) as f64);
        // Before, 0.35 in 2-D.
        assert!(error < if dim == 2 { 5e-2 } else { 0.12 }, "{dim}-D {jitter} {words}: {error:e}");
    }
}

#[test]
fn energy_that_is_made_is_refused_above_a_hundredth() {
    let x = lattice(16, 2, 0.2);
    let made = |words: &str| {
        let mut s = unit_box(&format!("kernel=C2 h_fac=1.8 {words}"), &x, 2, false);
        set(&mut s, "T", &field(&x, 2, |p| (-((p[0] - 0.3).powi(2) + (p[1] - 0.3).powi(2)) / 0.045).exp()));
        s
    };
    let (mut s, mut insist) = (made("operator=consistent"), made("operator=consistent allow=energy"));
    insist.step(0.25).unwrap();
    assert!(insist.get_number("energy_defect").unwrap() > 0.01);
    // In one step, and in many that are each within the bound: what was made before is not forgotten.
    assert!(s.step(0.25).unwrap_err().to_string().contains("allow=energy"));
    let (mut last, mut steps) = (Ok(()), 0);
    while last.is_ok() && steps < 1000 {
        last = s.step(2.5e-4).map(drop);
        steps += 1;
    }
    assert!(last.is_err() && steps > 3, "{steps}");
    let reached = s.get_number("energy_defect").unwrap();
    assert!(reached > 0.005 && reached <= 0.01, "{reached}");
    // Setting T begins anew; operators that conserve have nothing to tell.
    set(&mut s, "T", &field(&x, 2, |p| p[0]));
    assert_eq!(s.get_number("energy_defect").unwrap(), 0.0);
    let mut pairs = made("");
    pairs.step(0.25).unwrap();
    assert_eq!(pairs.get_number("energy_defect").unwrap(), 0.0);
}

#[test]
fn too_few_neighbours_lower_the_order_and_a_tensor_is_refused() {
    let x = lattice(8, 2, 0.2);
    let rate = |words: &str| {
        let mut s = unit_box(&format!("kernel=C2 h_fac=1.0 {words}"), &x, 2, true);
        set(&mut s, "T", &field(&x, 2, |p| p[0]));
        s.get_all("dT_dt").unwrap()
    };
    // Twelve neighbours are too few for the 14 monomials of order 4 and enough for the 5 of order 2.
    let (four, two) = (rate("operator=consistent order=6"), rate("operator=consistent order=2"));
    assert!(four.iter().zip(&two).filter(|(a, b)| a == b).count() > 32);
    let mut s = unit_box("operator=consistent", &x, 2, true);
    for (name, value) in [("kappa_par", 1.0), ("b_x", 1.0), ("T", 0.0)] {
        s.set_number(name, value).unwrap();
    }
    assert!(s.step(1e-4).unwrap_err().to_string().contains("takes no tensor"));
}

#[test]
fn one_sided_rows_are_lowered_so_that_no_mode_grows() {
    for (dim, n) in [(2, 24), (3, 10)] {
        let x = lattice(n, dim, 0.4);
        let hot = field(&x, dim, |p| (9.0 * p[0]).cos() * (7.0 * p[1]).cos());
        let made = |words: &str, periodic: bool| {
            let mut s = unit_box(&format!("kernel=C2 h_fac=1.6 operator=consistent {words}"), &x, dim, periodic);
            set(&mut s, "T", &hot);
            s
        };
        let (mut open, mut closed, mut insist) = (made("", false), made("", true), made("allow=unstable", false));
        assert_eq!(closed.get_number("lowered_orders").unwrap(), 0.0);
        let (lowered, reached) = (open.get_number("lowered_orders").unwrap(), open.get_all("order_reached").unwrap());
        // Only beside the edges, and most of the outermost layer.
        let edge = |p: &[f64]| p.iter().any(|c| c.min(1.0 - c) < 2.0 / n as f64);
        let inside = x.chunks(dim).zip(&reached).filter(|(p, order)| !edge(p) && **order < 4.0).count();
        println!("{dim}-D: {lowered} of {} lowered, {inside} inside", reached.len());
        assert!(lowered > 0.0 && inside as f64 <= 0.02 * reached.len() as f64);
        for (s, grows) in [(&mut open, false), (&mut insist, true)] {
            let (growth, fastest) = (s.get_number("growth_rate").unwrap(), s.get_number("spectral_bound").unwrap());
            // Between the two sets of scenes that were looked at: at most 6e-6 of the bound, and at least 3e-2.
            assert_eq!(growth > 1e-3 * fastest, grows, "{dim}-D {growth:e} {fastest:e}");
        }
        assert!(open.step(1e-3).is_ok());
    }
}

#[test]
fn a_mode_that_grows_is_refused_before_any_step() {
    // Weights fitted to smooth fields know nothing of a conductivity that jumps by a thousand, and the arithmetic mean
    // nothing of what resists.
    let x = lattice(24, 2, 0.4);
    let made = |words: &str| {
        let words = format!("kernel=C2 h_fac=1.6 operator=consistent mean=arithmetic {words}");
        let mut s = unit_box(&words, &x, 2, true);
        set(&mut s, "T", &field(&x, 2, |p| (9.0 * p[0]).sin()));
        set(&mut s, "kappa", &field(&x, 2, |p| if (3.0 * p[0] + p[1]).fract() < 0.5 { 1.0 } else { 1e3 }));
        s
    };
    let (mut s, mut insist) = (made(""), made("allow=unstable"));
    let before = s.get_all("T").unwrap();
    let error = s.step(1e-9).unwrap_err().to_string();
    assert!(error.contains("a mode that grows") && error.contains("allow=unstable"), "{error}");
    assert_eq!(s.get_all("T").unwrap(), before);
    let relative = insist.get_number("growth_rate").unwrap() / insist.get_number("spectral_bound").unwrap();
    println!("growth {relative:e}: {error}");
    assert!(relative > 1e-3);
}

#[test]
fn what_comes_in_at_a_face_or_from_a_source_is_accounted_for_or_refused() {
    let n = 40;
    let x = lattice(n, 1, 0.0);
    let end = |value: f64| move |p: &[f64]| if p[0] < 1.0 / n as f64 { value } else { 0.0 };
    let open = |words: &str, name: &str, value: f64| {
        let mut s = unit_box(&format!("operator=consistent {words}"), &x, 1, false);
        s.set_number("T", 1.0).unwrap();
        set(&mut s, name, &field(&x, 1, end(value)));
        let done = s.step(0.5).map(drop);
        (done, s.get_all("T").unwrap().iter().sum::<f64>() / n as f64 - 1.0)
    };
    for (name, value) in [("flux_in", 1.0), ("h_conv", 1.0), ("source", n as f64)] {
        let (done, rise) = open("", name, value);
        let error = done.unwrap_err().to_string();
        assert!(error.contains("consistent") && error.contains("allow=energy") && rise == 0.0, "{name}: {error}");
    }
    // A twentieth more than what came in: that is what is refused.
    let (done, rise) = open("allow=energy", "flux_in", 1.0);
    assert!(done.is_ok() && (0.515..0.53).contains(&rise), "{rise}");
    // A source of next to nothing does not switch the account off.
    let x = lattice(14, 2, 0.2);
    let mut s = unit_box("operator=consistent", &x, 2, false);
    set(&mut s, "T", &field(&x, 2, |p| f64::from(p[0] < 0.25 && p[1] < 0.25)));
    s.set_number("source", 1e-30).unwrap();
    assert!(s.step(0.05).unwrap_err().to_string().contains("allow=energy"));
}
