//! Conductivities that depend on direction: 22 to 29.

use super::setting::{COLD, HOT, disc, field, l2, numbers, refused, same_bits, set};
use super::{Case, Seen, Setting, Trial};
use crate::error::Result;
use crate::solver::Solver;
use crate::study::lattice;
use std::f64::consts::PI;

const NOT_POSITIVE: &str = "its weights are negative across b beyond kappa_par = 3 kappa_perp";
const TWO_FIRST: &str = "two gradients in turn are not monotone";

const RATIO: Case = Case {
    number: 22,
    title: "kappa_par 3 times kappa_perp, b at 0, 30 and 45 degrees, 10 % jitter",
    required: "a hot disc in bounds, noise that does not grow, energy to 1e-12; two-first: leaks at most 1e-3",
    source: "Biriukov & Price 2019",
    trials: || {
        let bounded = ["espanol-revenga allow=unstable", "monotone", "limited"].map(pass);
        [bounded.to_vec(), vec![pass("two-first theta=0.3")]].concat()
    },
    check: |setting, seen| every_angle(setting, 1.0 / 3.0, seen),
};

pub const CASES: &[Case] = &[
    RATIO,
    Case {
        number: 23,
        title: "the same, 100 times",
        trials: beyond_3,
        check: |setting, seen| every_angle(setting, 1e-2, seen),
        ..RATIO
    },
    Case {
        number: 24,
        title: "the same, 1e6 times",
        trials: beyond_3,
        check: |setting, seen| every_angle(setting, 1e-6, seen),
        ..RATIO
    },
    Case {
        number: 25,
        title: "the same, kappa_perp = 0",
        trials: beyond_3,
        check: |setting, seen| every_angle(setting, 0.0, seen),
        ..RATIO
    },
    Case {
        number: 26,
        title: "b = 0 everywhere; NaN in b",
        required: "kappa_perp in all directions; an error that names the particle",
        source: "",
        trials: tensors,
        check: no_direction,
    },
    Case {
        number: 27,
        title: "b that changes sign from particle to particle",
        required: "the same answer to 1e-13, since b b^T is the same",
        source: "",
        trials: tensors,
        check: signs,
    },
    Case {
        number: 28,
        title: "the ring: T = 12 in a part of it and 10 elsewhere, b around the centre, kappa_par = 0.01, to t = 200",
        required: "10 <= T <= 12, energy to 1e-12; at t = 30 the first mode of the ring has decayed as along each circle",
        source: "Sharma & Hammett 2007",
        trials: || {
            [vec![Trial::fail("operator=two-first", TWO_FIRST)], vec![pass("monotone"), pass("limited")]].concat()
        },
        check: ring,
    },
    Case {
        number: 29,
        title: "espanol-revenga beyond a ratio of 3",
        required: "refused, unless it is allowed in words",
        source: "",
        trials: || vec![pass("espanol-revenga")],
        check: |setting, seen| {
            let mut s = tensor_box(setting, 0.01, 0.0)?;
            let step = s.step(1e-4);
            refused(seen, "ratio 100", step.map(drop), "BAD_VALUE", "allow=unstable");
            Ok(())
        },
    },
];

fn pass(operator: &str) -> Trial {
    Trial::pass(&format!("operator={operator}"))
}

fn beyond_3() -> Vec<Trial> {
    let unstable = vec![Trial::fail("operator=espanol-revenga allow=unstable", NOT_POSITIVE)];
    [unstable, ["monotone", "limited", "two-first theta=0.3"].map(pass).to_vec()].concat()
}

fn tensors() -> Vec<Trial> {
    ["two-first", "monotone", "limited"].map(pass).to_vec()
}

/// 20 by 20 jittered particles with kappa_par = 1 along b.
fn tensor_box(setting: &Setting, perp: f64, angle: f64) -> Result<Solver> {
    let x = setting.lattice(20, 2, 0.1)?;
    let mut s = setting.unit_box(&x, 2, true, "")?;
    let (sin, cos) = angle.sin_cos();
    let [par, perp] = [1.0, perp].map(|kappa| kappa * setting.conducts);
    numbers(&mut s, &[("kappa_par", par), ("kappa_perp", perp), ("b_x", cos), ("b_y", sin)])?;
    set(&mut s, "T", &field(&x, 2, disc))?;
    Ok(s)
}

fn every_angle(setting: &Setting, perp: f64, seen: &mut Seen) -> Result<()> {
    let two_first = setting.words.contains("two-first");
    for degrees in [0.0f64, 30.0, 45.0] {
        let mut s = tensor_box(setting, perp, degrees.to_radians())?;
        let report = s.step(0.01)?;
        seen.at_most("energy off by", (report.energy / report.energy_before - 1.0).abs(), 1e-12);
        let outside = (COLD - report.t_min).max(report.t_max - HOT).max(0.0);
        if two_first {
            seen.note(format!("outside by {outside:.2}"));
        } else {
            seen.at_most("outside by", outside, 1e-9);
        }
        seen.at_most("noise to", noise(&mut s)?, 1.0 + 1e-12);
    }
    if two_first {
        seen.at_most("leak", leak(setting, perp)?, 1e-3);
    }
    Ok(())
}

/// What is left of the norm of noise.
fn noise(s: &mut Solver) -> Result<f64> {
    let mut t = vec![0.0; s.len()];
    lattice::jitter(&mut t, 1.0, 5);
    let zero = vec![0.0; t.len()];
    let mean = t.iter().sum::<f64>() / t.len() as f64;
    t.iter_mut().for_each(|t| *t -= mean);
    set(s, "T", &t)?;
    s.step(0.05)?;
    Ok(l2(&s.get_all("T")?, &zero) / l2(&t, &zero))
}

/// How much faster than kappa_perp says a wave across b decays, relative to kappa_par.
fn leak(setting: &Setting, perp: f64) -> Result<f64> {
    let mut s = tensor_box(setting, perp, 0.0)?;
    let wave = field(&s.get_all("x")?, 2, |p| (2.0 * PI * p[1]).sin());
    set(&mut s, "T", &wave)?;
    let rate = s.get_all("dT_dt")?;
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let apparent = -product(&wave, &rate) / product(&wave, &wave) / (2.0 * PI).powi(2);
    // The operator's own error is a share of kappa_perp, not of kappa_par.
    Ok(((apparent - perp).abs() - 0.1 * perp).max(0.0))
}

fn no_direction(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let mut s = tensor_box(setting, 0.2, 0.0)?;
    numbers(&mut s, &[("b_x", 0.0), ("b_y", 0.0)])?;
    let without = s.get_all("dT_dt")?;
    let mut isotropic = tensor_box(setting, 0.2, 0.0)?;
    isotropic.set_number("kappa_par", 0.2)?;
    seen.at_most("b = 0 off by", l2(&without, &isotropic.get_all("dT_dt")?), 1e-12);
    let mut b = vec![1.0; s.len()];
    b[7] = f64::NAN;
    refused(seen, "NaN", set(&mut s, "b_x", &b), "BAD_VALUE", "b_x[7]");
    Ok(())
}

fn signs(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let run = |flips: bool| {
        let mut s = tensor_box(setting, 0.01, 0.5)?;
        let sign = |i: usize| if flips && i % 3 == 1 { -1.0 } else { 1.0 };
        for (name, b) in [("b_x", 0.5f64.cos()), ("b_y", 0.5f64.sin())] {
            let b: Vec<f64> = (0..s.len()).map(|i| sign(i) * b).collect();
            set(&mut s, name, &b)?;
        }
        s.step(0.01)?;
        s.get_all("T")
    };
    let (plain, flipped) = (run(false)?, run(true)?);
    seen.remember(&plain);
    seen.at_most("off by", l2(&flipped, &plain), 1e-13);
    if same_bits(&flipped, &plain) {
        seen.note("same bits");
    }
    Ok(())
}

fn ring(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let x: Vec<f64> = setting.lattice(32, 2, 0.1)?.iter().map(|x| 2.0 * x - 1.0).collect();
    let mut s = setting.unit_box(&x, 2, false, "")?;
    let radius = |p: &[f64]| p[0].hypot(p[1]).max(1e-12);
    numbers(
        &mut s,
        &[("m", 4.0 / (x.len() as f64 / 2.0)), ("kappa_par", 0.01 * setting.conducts), ("kappa_perp", 0.0)],
    )?;
    set(&mut s, "b_x", &field(&x, 2, |p| -p[1] / radius(p)))?;
    set(&mut s, "b_y", &field(&x, 2, |p| p[0] / radius(p)))?;
    let hot = |p: &[f64]| (0.5..0.7).contains(&radius(p)) && p[0] < 0.0 && (p[1] / p[0]).atan().abs() < PI / 12.0;
    let before = field(&x, 2, |p| if hot(p) { 12.0 } else { 10.0 });
    set(&mut s, "T", &before)?;
    // All of it, wherever it leaks to: of the wave cos(angle) there is left exp(-kappa t/r^2).
    let mode = |t: &[f64], decay: f64| -> f64 {
        let of = |(p, t): (&[f64], &f64)| -(t - 10.0) * p[0] / radius(p) * (-decay / radius(p).powi(2)).exp();
        x.chunks(2).zip(t).map(of).sum()
    };
    let first = s.step(30.0)?;
    let left = mode(&s.get_all("T")?, 0.0) / mode(&before, 0.01 * 30.0);
    seen.at_most("mode off by", (left - 1.0).abs(), 0.1);
    let report = s.step(170.0)?;
    seen.at_most("energy off by", (report.energy / first.energy_before - 1.0).abs(), 1e-12);
    seen.at_least("least T", report.t_min.min(first.t_min), 10.0 - 1e-9);
    seen.at_most("greatest T", report.t_max.max(first.t_max), 12.0 + 1e-9);
    Ok(())
}
