//! Particles that are not a cubic lattice: squeezed, graded, thin, open, disordered. `normalise=tensor` conducts alike in
//! all directions that there are, which `normalise=pair` does not.

use crate::particles::*;
use diffusph::{Solver, Strided};
use std::f64::consts::PI;

/// A solver on a lattice of so many particles per axis, so far apart, each moved by up to `jitter` spacings; periodic as
/// told, rho = kappa = 1.
pub fn grid(words: &str, count: &[usize], spacing: &[f64], jitter: f64, periodic: &[bool]) -> (Solver, Vec<f64>) {
    let (dim, n) = (count.len(), count.iter().product::<usize>());
    let mut random = Random(2);
    let x: Vec<f64> = (0..n)
        .flat_map(|p| {
            let at = |a: usize| (p / count[..a].iter().product::<usize>()) % count[a];
            (0..dim).map(|a| (at(a) as f64 + 0.5 + jitter * random.next()) * spacing[a]).collect::<Vec<_>>()
        })
        .collect();
    let length: Vec<f64> = count.iter().zip(spacing).map(|(n, d)| *n as f64 * d).collect();
    let mut s = Solver::new(&format!("heat dim={dim} {words}")).unwrap();
    s.set_box(&vec![0.0; dim], &length, periodic).unwrap();
    s.set_particles(Strided::new("x", &x, n, dim, dim).unwrap()).unwrap();
    for (name, value) in [("m", spacing.iter().product()), ("rho", 1.0), ("kappa", 1.0), ("T", 0.0)] {
        s.set_number(name, value).unwrap();
    }
    let x = s.get_all("x").unwrap();
    (s, x)
}

/// −Σ T dT/dt / Σ T² k² of the longest sine along an axis of a box: the conductivity that it meets.
fn conducted(s: &mut Solver, x: &[f64], dim: usize, axis: usize, length: f64) -> f64 {
    let k = 2.0 * PI / length;
    let t = field(x, dim, |p| (k * p[axis]).sin());
    set(s, "T", &t);
    let rate = s.get_all("dT_dt").unwrap();
    let (lost, all): (f64, f64) = t.iter().zip(rate).fold((0.0, 0.0), |(l, a), (t, r)| (l - t * r, a + t * t));
    lost / (all * k * k)
}

#[test]
fn lattices_squeezed_along_any_axis_conduct_alike() {
    for operator in ["brookshaw", "kernel"] {
        for (dim, n) in [(2, 20), (3, 8)] {
            for axis in 0..dim {
                for squeezed in [2.0, 3.0, 4.0, 6.0] {
                    let mut spacing = vec![1.0; dim];
                    spacing[axis] = 1.0 / squeezed;
                    let defect = |normalise: &str| {
                        let words = format!("operator={operator} kernel=M6 normalise={normalise}");
                        let (mut s, _) = grid(&words, &vec![n; dim], &spacing, 0.0, &vec![true; dim]);
                        assert!(s.get_number("smallest_weight").unwrap() >= 0.0);
                        s.get_number("conduction_defect").unwrap()
                    };
                    let (tensor, pair) = (defect("tensor"), defect("pair"));
                    // All particles are alike, so that the condition holds to rounding: it is solved from sums whose
                    // smallest, at 6:1 in 2-D, is a fortieth of the largest.
                    assert!(tensor < 1e-11, "{operator} {dim}-D {axis} {squeezed}:1 {tensor:e}");
                    let wrong = if dim == 2 { 0.2 } else { 0.05 };
                    assert!(squeezed < 3.0 || pair > wrong, "{operator} {dim}-D {axis} {squeezed}:1 {pair:e}");
                }
            }
        }
    }
}

#[test]
fn every_kernel_conducts_alike_on_a_squeezed_lattice() {
    for kernel in names("kernels") {
        for dim in [2, 3] {
            let (mut s, _) = grid(
                &format!("kernel={kernel}"),
                &[10, 10, 10][..dim],
                &[1.0 / 3.0, 1.0, 1.0][..dim],
                0.0,
                &[true; 3][..dim],
            );
            let defect = s.get_number("conduction_defect").unwrap();
            assert!(defect < 1e-11, "{kernel} {dim}-D {defect:e}");
        }
    }
}

#[test]
fn a_mode_on_a_squeezed_lattice_decays_as_it_should() {
    // 24 spacings of the wide axis in both directions: what is left is the error of the mode, 0.5 to 4 % (k h)².
    for (count, spacing) in [(vec![24, 24], vec![0.25, 1.0]), (vec![48, 12, 12], vec![0.25, 1.0, 1.0])] {
        let dim = count.len();
        let run = |normalise: &str| -> Vec<f64> {
            let words = format!("normalise={normalise}");
            let (mut s, x) = grid(&words, &count, &spacing, 0.0, &vec![true; dim]);
            (0..dim).map(|a| conducted(&mut s, &x, dim, a, count[a] as f64 * spacing[a])).collect()
        };
        let (tensor, pair) = (run("tensor"), run("pair"));
        assert!(tensor.iter().all(|k| (k - 1.0).abs() < 0.05), "{tensor:?}");
        assert!(pair.iter().any(|k| (k - 1.0).abs() > 0.1), "{pair:?}");
    }
}

#[test]
fn thin_bodies_conduct_along_themselves() {
    let bodies: [(&str, &[usize], f64); 8] = [
        ("2-D string", &[40, 1], 0.9),
        ("2-D strip of 2", &[40, 2], 0.2),
        ("2-D strip of 6", &[40, 6], 0.05),
        ("3-D string", &[40, 1, 1], 1.8),
        ("3-D sheet", &[20, 20, 1], 0.4),
        ("3-D sheet of 2", &[20, 20, 2], 0.12),
        ("rod 2x2", &[40, 2, 2], 0.3),
        ("rod 4x4", &[40, 4, 4], 0.1),
    ];
    for (name, count, wrong) in bodies {
        let dim = count.len();
        let mut periodic = vec![false; dim];
        periodic[0] = true;
        for jitter in [0.0, 0.1, 0.2] {
            let along = |normalise: &str| {
                let insist = if jitter == 0.0 && count.contains(&1) { "allow=flat" } else { "" };
                let words = format!("kernel=M6 normalise={normalise} {insist}");
                let (mut s, x) = grid(&words, count, &vec![1.0; dim], jitter, &periodic);
                assert!(s.get_number("smallest_weight").unwrap() >= 0.0);
                conducted(&mut s, &x, dim, 0, count[0] as f64)
            };
            let (tensor, pair) = (along("tensor"), along("pair"));
            // A prototype had 0.987 to 1.008 on other random numbers; 1 % is what the mode itself loses on 20 particles.
            assert!((tensor - 1.0).abs() < 0.025, "{name} {jitter}: {tensor}");
            assert!(pair - 1.0 > wrong, "{name} {jitter}: {pair}");
        }
    }
}

/// Error of a mode in a periodic unit box whose spacing varies 10:1 along each axis.
fn graded(normalise: &str, n: usize, jitter: f64) -> f64 {
    let (mut random, stretch) = (Random(3), 9.0 / 11.0);
    let q: Vec<f64> =
        (0..n * n).flat_map(|p| [p % n, p / n]).map(|c| (c as f64 + 0.5 + jitter * random.next()) / n as f64).collect();
    let x: Vec<f64> = q.iter().map(|q| (q + stretch * (2.0 * PI * q).sin() / (2.0 * PI)).rem_euclid(1.0)).collect();
    let area = |q: &[f64]| q.iter().map(|q| (1.0 + stretch * (2.0 * PI * q).cos()) / n as f64).product::<f64>();
    let mut s = unit_box(&format!("normalise={normalise}"), &x, 2, true);
    set(&mut s, "m", &field(&q, 2, area));
    let mode = field(&x, 2, |p| (2.0 * PI * p[0]).sin() * (2.0 * PI * p[1]).sin());
    set(&mut s, "T", &mode);
    s.step(1.0 / (8.0 * PI * PI)).unwrap();
    let (t, m) = (s.get_all("T").unwrap(), s.get_all("m").unwrap());
    let exact = mode.iter().map(|m| m * (-1.0f64).exp());
    let (off, all) =
        t.iter().zip(exact).zip(m).fold((0.0, 0.0), |(o, a), ((t, e), m)| (o + m * (t - e) * (t - e), a + m * e * e));
    (off / all).sqrt()
}

#[test]
fn graded_particles_converge() {
    let (coarse, fine, pair) = (graded("tensor", 24, 0.0), graded("tensor", 48, 0.0), graded("pair", 48, 0.0));
    // Another implementation: 3.3e-2, 8.3e-3 and 1.0e-1.
    assert!(coarse < 4e-2 && fine < 1.1e-2 && pair > 8e-2, "{coarse:e} {fine:e} {pair:e}");
    let (tensor, pair) = (graded("tensor", 48, 0.2), graded("pair", 48, 0.2));
    assert!(tensor < 0.75 * pair, "{tensor:e} {pair:e}");
}

/// Error of a mode in an open, insulated unit box.
fn open_error(normalise: &str, n: usize, dim: usize, seed: u64) -> f64 {
    let mut random = Random(seed);
    let x: Vec<f64> = lattice(n, dim, 0.0).iter().map(|x| x + 0.2 * random.next() / n as f64).collect();
    let mut s = unit_box(&format!("normalise={normalise}"), &x, dim, false);
    let mode = field(&x, dim, |p| p.iter().map(|x| (PI * x).cos()).product());
    set(&mut s, "T", &mode);
    s.step(1.0 / (PI * PI * dim as f64)).unwrap();
    l2(&s.get_all("T").unwrap(), &mode.iter().map(|m| m * (-1.0f64).exp()).collect::<Vec<_>>())
}

#[test]
fn open_clouds_conduct_beside_their_surfaces() {
    let of = |normalise: &str, n: usize, dim: usize| {
        let mut errors = [1, 2, 3].map(|seed| open_error(normalise, n, dim, seed));
        errors.sort_by(f64::total_cmp);
        errors[1]
    };
    let (tensor, pair, none) = (of("tensor", 12, 3), of("pair", 12, 3), of("none", 12, 3));
    // Another implementation, other random numbers: 4.0e-2, 8.1e-2 and 2.1e-1.
    assert!(tensor < 5e-2 && tensor < 0.6 * pair && pair < none, "{tensor:e} {pair:e} {none:e}");
    // In the square both err by 2e-2, which is the particles' disorder, and without either by 6.6e-2.
    let (tensor, none) = (of("tensor", 32, 2), of("none", 32, 2));
    assert!(tensor < 2.8e-2 && none > 2.0 * tensor, "{tensor:e} {none:e}");
}

#[test]
fn disorder_is_no_worse_than_with_pairs_and_conserves() {
    type Made<'a> = &'a dyn Fn(u64) -> Vec<f64>;
    let clouds: [(&str, usize, Made); 5] = [
        ("2-D, 20 %", 2, &|seed| shaken(24, 2, 0.2, seed)),
        ("2-D, 40 %", 2, &|seed| shaken(24, 2, 0.4, seed)),
        ("2-D, random", 2, &|seed| shaken(24, 2, 24.0, seed)),
        ("3-D, 20 %", 3, &|seed| shaken(10, 3, 0.2, seed)),
        ("3-D, random", 3, &|seed| shaken(10, 3, 10.0, seed)),
    ];
    for (name, dim, cloud) in clouds {
        let median = |normalise: &str| {
            let mut errors = [1, 2, 3, 4, 5].map(|seed| {
                let x = cloud(seed);
                let mut s = unit_box(&format!("normalise={normalise}"), &x, dim, true);
                assert!(s.set_number("T", 0.0).is_ok() && s.get_number("smallest_weight").unwrap() >= 0.0);
                mode_error(&format!("normalise={normalise}"), &x, dim)
            });
            errors.sort_by(f64::total_cmp);
            errors[2]
        };
        let (tensor, pair) = (median("tensor"), median("pair"));
        println!("{name}: tensor {tensor:.3e} pair {pair:.3e}");
        // What disorder does to first moments is the same for both on jitter; random particles, which err by a half, lose a
        // tenth to what is asked of few pairs. Medians of five scatter by a few per cent.
        let most = if name.contains("random") { 1.15 } else { 1.05 };
        assert!(tensor < most * pair, "{name}: {tensor:e} {pair:e}");
    }
    let x = shaken(24, 2, 24.0, 9);
    let mut s = unit_box("", &x, 2, true);
    set(&mut s, "T", &field(&x, 2, |p| p[0]));
    let report = s.step(0.01).unwrap();
    assert!((report.energy / report.energy_before - 1.0).abs() < 1e-12);
}

/// A periodic lattice with each coordinate moved by up to `jitter` spacings.
fn shaken(n: usize, dim: usize, jitter: f64, seed: u64) -> Vec<f64> {
    let mut random = Random(seed);
    lattice(n, dim, 0.0).iter().map(|x| (x + jitter * random.next() / n as f64).rem_euclid(1.0)).collect()
}

/// dT/dt of particles in a box that is `thin` on one axis, and of the same box repeated so that no particle has two images
/// of another for a neighbour.
fn thin_and_repeated(words: &str, tensor: bool) -> (Vec<f64>, Vec<f64>) {
    let (nx, ny) = (24, 2);
    let run = |times: usize| {
        let mut random = Random(5);
        let cell: Vec<[f64; 3]> = (0..nx * ny)
            .map(|p| {
                let at = |c: usize, jitter: f64| c as f64 + 0.5 + 0.2 * jitter;
                [at(p % nx, random.next()), at(p / nx, random.next()), random.next()]
            })
            .collect();
        let all: Vec<[f64; 3]> =
            (0..times).flat_map(|k| cell.iter().map(move |[x, y, t]| [*x, y + (k * ny) as f64, *t])).collect();
        let x: Vec<f64> = all.iter().flat_map(|p| [p[0], p[1]]).collect();
        let mut s = Solver::new(&format!("heat dim=2 kernel=M4 {words}")).unwrap();
        s.set_box(&[0.0; 2], &[nx as f64, (ny * times) as f64], &[true; 2]).unwrap();
        s.set_particles(Strided::new("x", &x, all.len(), 2, 2).unwrap()).unwrap();
        for (name, value) in [("m", 1.0), ("rho", 1.0)] {
            s.set_number(name, value).unwrap();
        }
        match tensor {
            true => [("kappa_par", 1.0), ("kappa_perp", 0.1), ("b_x", 0.6), ("b_y", 0.8)]
                .iter()
                .for_each(|(name, value)| s.set_number(name, *value).unwrap()),
            false => s.set_number("kappa", 1.0).unwrap(),
        }
        set(&mut s, "T", &all.iter().map(|p| p[2]).collect::<Vec<_>>());
        s.get_all("dT_dt").unwrap()
    };
    let (thin, repeated) = (run(1), run(5));
    (thin, repeated[..nx * ny].to_vec())
}

#[test]
fn a_thin_periodic_box_is_the_box_repeated() {
    for (words, tensor) in [
        ("", false),
        ("operator=kernel", false),
        ("operator=consistent order=2", false),
        ("operator=espanol-revenga allow=unstable", true),
        ("operator=monotone", true),
        ("operator=limited", true),
        ("operator=two-first", true),
    ] {
        let (thin, repeated) = thin_and_repeated(words, tensor);
        let error = l2(&thin, &repeated);
        // The same sums in another order; the fits behind monotone and limited stop at 1e-6.
        let fitted = words.contains("monotone") || words.contains("limited");
        assert!(error < if fitted { 1e-6 } else { 1e-11 }, "{words}: {error:e}");
    }
}

#[test]
fn operators_that_are_wrong_in_one_layer_are_refused_there() {
    for operator in ["two-first", "limited", "monotone"] {
        for (jitter, words) in [(0.0, "allow=flat"), (0.1, "allow=flat"), (0.1, "")] {
            let (mut s, _) = grid(&format!("operator={operator} {words}"), &[40, 1], &[1.0; 2], jitter, &[true, false]);
            let error = s.get_all("dT_dt").unwrap_err().to_string();
            assert!(error.contains("conduct wrong with it") && error.contains("along y"), "{operator}: {error}");
        }
        let (mut s, _) = grid(&format!("operator={operator}"), &[40, 6], &[1.0; 2], 0.1, &[true, false]);
        s.get_all("dT_dt").unwrap();
    }
}

/// Refused with this name and these words.
fn refused(s: &mut Solver, name: &str, has: &str) -> bool {
    s.set_number("T", 0.0).unwrap();
    let refused = |e: diffusph::error::Error| e.name() == name && e.to_string().contains(has);
    s.step(1e-6).is_err_and(refused)
}

#[test]
fn supports_that_end_before_the_next_neighbour_in_a_direction_are_refused() {
    for kernel in ["M4", "M6", "C2"] {
        for (spacing, jitter) in [([8.0, 1.0], 0.0), ([8.0, 1.0], 0.1), ([1.0, 10.0], 0.1), ([12.0, 1.0], 0.1)] {
            let count = if spacing[0] > spacing[1] { [16, 100] } else { [100, 16] };
            for periodic in [true, false] {
                let words = |more: &str| format!("kernel={kernel} {more}");
                let mut s = grid(&words(""), &count, &spacing, jitter, &[periodic; 2]).0;
                assert!(refused(&mut s, "BAD_VALUE", "larger h_fac"), "{kernel} {spacing:?} {jitter}");
                // What it says does help: with it, the wide direction conducts.
                let own = if kernel == "M6" { 3.0 } else { 4.0 };
                let wide = usize::from(spacing[1] > spacing[0]);
                if periodic && jitter == 0.0 {
                    let (mut s, x) = grid(&words(&format!("h_fac={own}")), &count, &spacing, jitter, &[periodic; 2]);
                    let conducts = conducted(&mut s, &x, 2, wide, 16.0 * spacing[wide]);
                    assert!((conducts - 1.0).abs() < 0.1, "{kernel} {conducts}");
                }
                assert!(!refused(
                    &mut grid(&words("allow=volumes"), &count, &spacing, jitter, &[periodic; 2]).0,
                    "BAD_VALUE",
                    ""
                ));
            }
        }
        // Spacing that kernels see, thin bodies, and noise of any kind are not refused.
        for (spacing, jitter) in [([1.0, 1.0], 0.45), ([3.0, 1.0], 0.0), ([3.0, 1.0], 0.3), ([4.0, 1.0], 0.0)] {
            let mut s = grid(&format!("kernel={kernel}"), &[30, 30], &spacing, jitter, &[false; 2]).0;
            assert!(!refused(&mut s, "BAD_VALUE", ""), "{kernel} {spacing:?} {jitter}");
        }
    }
}

#[test]
fn what_conducts_too_little_together_is_refused_whatever_the_operator() {
    for (words, spacing, jitter) in [
        ("operator=consistent kernel=M4", [6.0, 1.0], 0.0),
        ("operator=consistent kernel=M6 order=2", [9.0, 1.0], 0.0),
        ("operator=consistent kernel=C2", [7.0, 1.0], 0.0),
        ("operator=kernel kernel=M4", [5.0, 1.0], 0.0),
        ("operator=kernel kernel=C6", [6.0, 1.0], 0.0),
        ("operator=projected kernel=M6", [9.0, 1.0], 0.0),
    ] {
        let mut s = grid(words, &[20, 60], &spacing, jitter, &[true; 2]).0;
        assert!(refused(&mut s, "BAD_VALUE", "larger h_fac"), "{words} {spacing:?}");
        // It is as wrong as it says.
        let (mut s, x) = grid(&format!("{words} allow=volumes"), &[20, 60], &spacing, jitter, &[true; 2]);
        let conducts = conducted(&mut s, &x, 2, 0, 20.0 * spacing[0]);
        assert!(conducts < 0.7, "{words} {spacing:?}: {conducts}");
    }
}

#[test]
fn particles_that_are_all_in_pairs_see_too_little_and_are_refused() {
    let paired = |words: &str, dim: usize, n: usize, copies: usize, apart: f64, jitter: f64| {
        let mut random = Random(5);
        let mut x = Vec::new();
        for site in 0..n.pow(dim as u32) {
            let at: Vec<f64> =
                (0..dim).map(|a| (site / n.pow(a as u32) % n) as f64 + 0.5 + jitter * random.next()).collect();
            (0..copies).for_each(|c| x.extend(at.iter().map(|v| v + apart * c as f64)));
        }
        let count = x.len() / dim;
        let mut s = Solver::new(&format!("heat dim={dim} {words}")).unwrap();
        s.set_box(&vec![0.0; dim], &vec![n as f64; dim], &vec![true; dim]).unwrap();
        s.set_particles(Strided::new("x", &x, count, dim, dim).unwrap()).unwrap();
        for (name, value) in [("m", 1.0 / copies as f64), ("rho", 1.0), ("kappa", 1.0)] {
            s.set_number(name, value).unwrap();
        }
        s
    };
    for operator in ["brookshaw", "kernel", "projected"] {
        for (dim, n, copies) in [(1, 60, 2), (2, 16, 4), (3, 7, 8)] {
            for (apart, jitter) in [(0.0, 0.3), (0.0, 0.15), (0.005, 0.3)] {
                let words = format!("operator={operator}");
                let mut s = paired(&words, dim, n, copies, apart, jitter);
                assert!(
                    refused(&mut s, "BAD_VALUE", "sees hardly more than itself"),
                    "{operator} {dim}-D {apart} {jitter}"
                );
                // With lengths for their places it is taken, as are single ones, and some that share a place.
                let wide = 1.3 * (copies as f64).powf(1.0 / dim as f64);
                let mut s = paired(&format!("{words} h_fac={wide}"), dim, n, copies, apart, jitter);
                assert!(!refused(&mut s, "BAD_VALUE", ""), "{operator} {dim}-D");
                assert!(!refused(&mut paired(&words, dim, n, 1, 0.0, jitter), "BAD_VALUE", ""), "{operator} {dim}-D");
            }
        }
    }
}

#[test]
fn densities_that_are_summed_over_squeezed_neighbours_are_refused() {
    let summed = |words: &str, count: &[usize], spacing: &[f64], jitter: f64| {
        let dim = count.len();
        let (given, x) = grid(words, count, spacing, jitter, &vec![true; dim]);
        drop(given);
        let length: Vec<f64> = count.iter().zip(spacing).map(|(n, d)| *n as f64 * d).collect();
        let mut s = Solver::new(&format!("heat dim={dim} {words}")).unwrap();
        s.set_box(&vec![0.0; dim], &length, &vec![true; dim]).unwrap();
        s.set_particles(Strided::new("x", &x, x.len() / dim, dim, dim).unwrap()).unwrap();
        for (name, value) in [("m", spacing.iter().product()), ("kappa", 1.0)] {
            s.set_number(name, value).unwrap();
        }
        s
    };
    for kernel in ["M4", "M6"] {
        for (count, spacing, jitter) in [
            (&[20, 60][..], &[4.0, 1.0][..], 0.0),
            (&[20, 60], &[5.0, 1.0], 0.2),
            (&[20, 60], &[8.0, 1.0], 0.1),
            (&[10, 24, 24], &[4.0, 1.0, 1.0], 0.1),
            (&[6, 6, 80], &[20.0, 20.0, 1.0], 0.0),
            (&[6, 6, 30], &[5.0, 5.0, 1.0], 0.0),
            (&[6, 6, 48], &[8.0, 8.0, 1.0], 0.25),
            (&[6, 24, 24], &[5.0, 1.0, 1.0], 0.25),
            (&[16, 128], &[8.0, 1.0], 0.3),
        ] {
            let words = format!("kernel={kernel}");
            assert!(
                refused(&mut summed(&words, count, spacing, jitter), "BAD_VALUE", "give rho"),
                "{words} {spacing:?}"
            );
            let mut insisted = summed(&format!("{words} allow=volumes"), count, spacing, jitter);
            let rho = insisted.get_all("rho").unwrap();
            let mean = rho.iter().sum::<f64>() / rho.len() as f64;
            // It is as wrong as the message has it.
            assert!(!refused(&mut insisted, "BAD_VALUE", "") && mean > 1.15, "{words} {spacing:?}: {mean}");
        }
        // Uniformly random points, few and more.
        for seed in 0..24 {
            let (dim, n) = ([2, 3][seed % 2], [100, 125, 400, 1500][seed / 2 % 4]);
            let mut random = Random(seed as u64 + 1);
            let x: Vec<f64> = (0..n * dim).map(|_| 0.5 + 0.5 * random.next()).collect();
            let mut s = Solver::new(&format!("heat dim={dim} kernel={kernel}")).unwrap();
            if seed % 3 == 0 {
                s.set_box(&vec![0.0; dim], &vec![1.0; dim], &vec![true; dim]).unwrap();
            }
            s.set_particles(Strided::new("x", &x, n, dim, dim).unwrap()).unwrap();
            s.set_number("m", 1.0 / n as f64).unwrap();
            s.set_number("kappa", 1.0).unwrap();
            assert!(!refused(&mut s, "BAD_VALUE", "summed"), "{kernel} {dim}-D {n} {seed}");
        }
        // Lattices that are hardly squeezed, and as much disorder as there can be.
        for (count, spacing, jitter) in [(&[20, 40][..], &[2.0, 1.0][..], 0.1), (&[10, 10, 10], &[1.0; 3], 0.5)] {
            let mut s = summed(&format!("kernel={kernel}"), count, spacing, jitter);
            assert!(!refused(&mut s, "BAD_VALUE", ""), "{kernel} {spacing:?}");
        }
    }
}

#[test]
fn tilted_and_bent_bodies_of_one_layer_are_refused_by_operators_that_need_more() {
    let (turn, n) = (0.5f64, 20);
    let jittered = |random: &mut Random, size: f64| size * random.next();
    for jitter in [0.0, 0.2] {
        let mut random = Random(3);
        let sheet: Vec<f64> = (0..n * n)
            .flat_map(|p| {
                let at = [(p % n) as f64, (p / n) as f64, 0.0].map(|v| v + jittered(&mut random, jitter));
                [at[0] * turn.cos() - at[2] * turn.sin(), at[1], at[0] * turn.sin() + at[2] * turn.cos()]
            })
            .collect();
        let ring: Vec<f64> = (0..60)
            .flat_map(|k| {
                let (angle, r) = (k as f64 * PI / 30.0, 60.0 / (2.0 * PI) + jittered(&mut random, jitter));
                [r * angle.cos(), r * angle.sin()]
            })
            .collect();
        for (x, dim) in [(&sheet, 3), (&ring, 2)] {
            for operator in ["monotone", "two-first", "limited", "brookshaw", "projected"] {
                let mut s = Solver::new(&format!("heat dim={dim} operator={operator}")).unwrap();
                s.set_particles(Strided::new("x", x, x.len() / dim, dim, dim).unwrap()).unwrap();
                for (name, value) in [("m", 1.0), ("rho", 1.0), ("kappa", 1.0)] {
                    s.set_number(name, value).unwrap();
                }
                let thin = refused(&mut s, "BAD_VALUE", "half a spacing thick");
                assert_eq!(thin, !["brookshaw", "projected"].contains(&operator), "{operator} {dim}-D {jitter}");
            }
        }
    }
}
