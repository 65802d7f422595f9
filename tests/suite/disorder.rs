//! What disorder and free surfaces do to the operators, and why weights of pairs are normalised: on lattices, jittered
//! lattices, a glass and a dam break, with real particles from another code (tests/data).

use crate::particles::*;
use diffusph::Solver;
use std::f64::consts::PI;

fn data(name: &str) -> diffusph::io::Snapshot {
    diffusph::io::read(format!("{}/tests/data/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

fn glass() -> Vec<f64> {
    data("glass_24.vtu").points.into_iter().flatten().collect()
}

/// The relative error of the decay of Π sin 2πx to e^-1, time integrated to 1e-4 or better.
fn decay_error(words: &str, x: &[f64], dim: usize) -> f64 {
    let mut s = unit_box(&format!("{words} integrator=ssprk3"), x, dim, true);
    let t = field(x, dim, |p| p.iter().map(|c| (2.0 * PI * c).sin()).product());
    set(&mut s, "T", &t);
    s.step(1.0 / (dim as f64 * 4.0 * PI * PI)).unwrap();
    let exact: Vec<f64> = t.iter().map(|t| t * (-1.0f64).exp()).collect();
    l2(&s.get_all("T").unwrap(), &exact)
}

#[test]
fn normalised_pairs_are_better_wherever_there_is_disorder() {
    let clouds = [
        ("2-D, 10 %", lattice(64, 2, 0.1), 2, 1.2e-2),
        ("2-D, 20 %", lattice(64, 2, 0.2), 2, 3e-2),
        ("2-D, 50 %", lattice(64, 2, 0.5), 2, 1.3e-1),
        ("3-D, 10 %", lattice(20, 3, 0.1), 3, 4.5e-2),
        ("3-D, 20 %", lattice(20, 3, 0.2), 3, 6e-2),
        ("3-D, 50 %", lattice(20, 3, 0.5), 3, 1.2e-1),
        ("glass", glass(), 3, 4e-2),
    ];
    for (name, x, dim, bound) in &clouds {
        for operator in ["brookshaw", "kernel"] {
            for kernel in ["M4", "M6"] {
                let error = |normalise| {
                    decay_error(&format!("operator={operator} kernel={kernel} normalise={normalise}"), x, *dim)
                };
                let (pair, none) = (error("pair"), error("none"));
                // The bound is a third above what was measured on these fixed particles.
                assert!(pair < none && pair < *bound, "{name} {operator} {kernel}: {pair:e} {none:e}");
            }
        }
    }
    // On a lattice the moment is the same everywhere and only M4's is far enough from 1 to matter.
    let x = lattice(64, 2, 0.0);
    let error = |normalise| decay_error(&format!("kernel=M4 normalise={normalise}"), &x, 2);
    assert!(error("pair") < 0.3 * error("none"));
}

#[test]
fn the_kernel_itself_wins_on_lattices_and_not_on_disorder() {
    // Biriukov & Price claim up to a factor of two over Brookshaw's form; both without normalisation, as there.
    let error = |operator: &str, x: &[f64]| decay_error(&format!("kernel=M4 normalise=none operator={operator}"), x, 3);
    let (ordered, glass) = (lattice(20, 3, 0.0), glass());
    assert!(error("kernel", &ordered) < 0.8 * error("brookshaw", &ordered));
    assert!(error("kernel", &glass) > error("brookshaw", &glass));
}

#[test]
fn a_thin_strip_conducts_along_its_free_surfaces() {
    // 8 particles wide, insulated by nothing but the end of the particles: half of them lack half of their neighbours.
    let n = 100;
    let mut random = Random(8);
    let x: Vec<f64> = (0..n * 8)
        .flat_map(|p| [(p % n) as f64, (p / n) as f64])
        .map(|c| (c + 0.5 + 0.2 * random.next()) / n as f64)
        .collect();
    let error = |normalise: &str| {
        let mut s = unit_box(&format!("kernel=M4 normalise={normalise}"), &x, 2, false);
        s.set_number("m", 1.0 / (n * n) as f64).unwrap();
        let t = field(&x, 2, |p| (PI * p[0]).cos());
        set(&mut s, "T", &t);
        s.step(1.0 / (PI * PI)).unwrap();
        l2(&s.get_all("T").unwrap(), &t.iter().map(|t| t * (-1.0f64).exp()).collect::<Vec<_>>())
    };
    let (pair, none) = (error("pair"), error("none"));
    // Measured 4.4e-2 and 9.4e-2 on these particles; the bound is a quarter above.
    assert!(pair < 5.5e-2 && none > 1.8 * pair, "{pair:e} {none:e}");
}

fn dam_break(words: &str) -> Solver {
    let mut snapshot = data("dam_break.vtu");
    // The code's own summation density counts free surfaces as thin; water is uniform.
    snapshot.fields.retain(|f| f.name == "m");
    let mut s = Solver::new(&format!("heat dim=2 {words}")).unwrap();
    s.set_snapshot(&snapshot).unwrap();
    for (name, value) in [("rho", 1000.0), ("kappa", 1.0), ("T", 0.0)] {
        s.set_number(name, value).unwrap();
    }
    s
}

#[test]
fn a_dam_break_conducts_as_much_as_its_volume_says() {
    // For T = x the heat exchanged, −Σ m T du/dt, is ∫ kappa |grad T|² dV = kappa V in the weak sense, whatever the
    // surface looks like.
    let conducted = |words: &str, axis: usize| {
        let mut s = dam_break(words);
        let t: Vec<f64> = s.get_all("x").unwrap().chunks(2).map(|p| p[axis]).collect();
        set(&mut s, "T", &t);
        let (m, rate) = (s.get_all("m").unwrap(), s.get_all("rate").unwrap());
        let exchanged: f64 = -m.iter().zip(&t).zip(&rate).map(|((m, t), r)| m * t * r).sum::<f64>();
        exchanged / (m.iter().sum::<f64>() / 1000.0)
    };
    for operator in ["brookshaw", "kernel"] {
        for axis in [0, 1] {
            let share =
                |normalise: &str| conducted(&format!("kernel=M4 operator={operator} normalise={normalise}"), axis);
            let (pair, none) = (share("pair"), share("none"));
            assert!((pair - 1.0).abs() < (none - 1.0).abs(), "{operator} {axis}: {pair} {none}");
            // Measured 0.99 to 1.01, and 0.85 to 0.87 without normalisation.
            assert!((pair - 1.0).abs() < 0.02, "{operator} {axis}: {pair}");
        }
    }
}

#[test]
fn a_dam_break_heats_from_a_wall() {
    // The left wall at 80 °C, everything else at 20 °C, loss to the air at none, one or all surfaces.
    let run = |lossy: &dyn Fn(&[f64], f64) -> bool| {
        let mut s = dam_break("kernel=M4 integrator=euler");
        let x = s.get_all("x").unwrap();
        let hot = field(&x, 2, |p| f64::from(p[0] < 0.0));
        set(&mut s, "fixed", &hot);
        set(&mut s, "T", &hot.iter().map(|h| 293.15 + 60.0 * h).collect::<Vec<_>>());
        for (name, value) in [("kappa", 0.6), ("c_v", 4186.0), ("T_ambient", 283.15)] {
            s.set_number(name, value).unwrap();
        }
        let moment = s.get_all("first_moment").unwrap();
        let surface: Vec<f64> = x
            .chunks(2)
            .zip(moment.chunks(2))
            .map(|(p, m)| if lossy(p, m[0].hypot(m[1])) { 50.0 } else { 0.0 })
            .collect();
        set(&mut s, "h_conv", &surface);
        let report = s.step(3600.0).unwrap();
        assert!(report.t_min >= 283.15 - 1e-9 && report.t_max <= 353.15 + 1e-9, "{report:?}");
        (report.energy - report.energy_before, surface.iter().filter(|&&h| h > 0.0).count())
    };
    let (none, _) = run(&|_, _| false);
    let (one, some) = run(&|p, m| m > 0.5 && p[1] > 0.5);
    let (all, many) = run(&|_, m| m > 0.5);
    assert!(some > 100 && many > some + 500, "{some} {many}");
    assert!(none > 0.0 && one < none && all < one, "{none:e} {one:e} {all:e}");
}
