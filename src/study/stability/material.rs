//! Conductivities of every kind: 10 to 16 and 18 to 21.

use super::setting::{HOT, disc, field, numbers, refused, same_bits, set, worst};
use super::{Case, Seen, Setting, Trial, trial};
use crate::error::Result;
use crate::solver::Solver;
use crate::study::exact::space::Barenblatt;
use crate::study::exact::steady::Layers;

const JUMP: Case = Case {
    number: 10,
    title: "two layers of kappa 1 : 1e3 and 1e3 : 1 between fixed temperatures",
    required: "implicit: the steady flux to 1 % in six steps; explicit: T in bounds",
    source: "Cleary & Monaghan 1999: the harmonic mean keeps the flux",
    trials: layered,
    check: |setting, seen| jump(setting, 1e3, 1e-2, seen),
};

pub const CASES: &[Case] = &[
    JUMP,
    Case { number: 11, title: "the same, 1e6", check: |setting, seen| jump(setting, 1e6, 1e-2, seen), ..JUMP },
    Case { number: 12, title: "the same, 1e9", check: |setting, seen| jump(setting, 1e9, 1e-2, seen), ..JUMP },
    Case {
        number: 13,
        title: "the same, 1e12",
        trials: || {
            let coarse =
                "a limit of this library: the largest rounding of a residual, 4 eps dt lambda |T|, exceeds |T|";
            let solved = ["integrator=backward-euler", "integrator=sdirk2"];
            let explicit = vec![Trial::pass("integrator=euler"), Trial::pass("integrator=rkl2")];
            [solved.map(|words| Trial::fail(words, coarse)).to_vec(), explicit].concat()
        },
        check: |setting, seen| jump(setting, 1e12, 1e-3, seen),
        ..JUMP
    },
    Case {
        number: 14,
        title: "a layer of kappa = 0, six spacings thick, between a hot and a cold side",
        required: "a perfect insulator: each side keeps its energy, and T in the layer its bits",
        source: "",
        trials: || {
            let leaks = "the arithmetic mean gives a pair with one kappa of 0 half of the other's";
            let means = vec![Trial::pass("mean=geometric"), Trial::fail("mean=arithmetic", leaks)];
            let tensors = ["two-first", "two-first h_fac=1.8", "limited", "monotone"];
            let tensors = tensors.map(|o| Trial::pass(&format!("operator={o}"))).to_vec();
            let over = "pairs reach over a layer that is thinner than a support";
            let thin = ["h_fac=2.5", "operator=two-first h_fac=2.5"].map(|words| Trial::fail(words, over)).to_vec();
            [trial::all(), trial::positive("integrator=backward-euler"), means, tensors, thin].concat()
        },
        check: insulator,
    },
    Case {
        number: 15,
        title: "kappa = 0 everywhere",
        required: "the same bits after any step: no 0/0 in a mean",
        source: "",
        trials: || [trial::all(), vec![Trial::pass("mean=arithmetic"), Trial::pass("mean=geometric")]].concat(),
        check: |setting, seen| {
            let mut s = setting.disc("")?;
            let before = s.get_all("T")?;
            let zeros = vec![0.0; before.len()];
            for given in 0..2 {
                if given == 0 {
                    s.set_number("kappa", 0.0)?
                } else {
                    set(&mut s, "kappa", &zeros)?
                }
                s.step(1e3)?;
                seen.require("T to the bit", same_bits(&s.get_all("T")?, &before));
            }
            Ok(())
        },
    },
    Case {
        number: 16,
        title: "kappa of -1, NaN, infinity at particle 7",
        required: "an error that names it, and nothing changed",
        source: "",
        trials: || vec![Trial::pass("")],
        check: |setting, seen| {
            let mut s = setting.disc("")?;
            let before = s.get_all("dT_dt")?;
            for bad in [-1.0, f64::NAN, f64::INFINITY] {
                let mut kappa = vec![1.0; before.len()];
                kappa[7] = bad;
                refused(seen, &bad.to_string(), set(&mut s, "kappa", &kappa), "BAD_VALUE", "kappa[7]");
            }
            seen.require("rates to the bit", same_bits(&s.get_all("dT_dt")?, &before));
            Ok(())
        },
    },
    FRONT,
    Case { number: 19, title: "the same, kappa = T^6", check: |setting, seen| front(setting, 6.0, seen), ..FRONT },
    Case {
        number: 20,
        title: "kappa = T^-2, T from 1e-6 to 1: the cold conducts 1e12 times better",
        required: "0 <= T and energy to 1e-12, or a status and nothing changed",
        source: "",
        trials: trial::all,
        check: inverse_square,
    },
    Case {
        number: 21,
        title: "kappa = exp(T), T from -12 to 12, steps of 1 to 1e5 limits",
        required: "an implicit step solves its equation, or says that it does not and changes nothing",
        source: "",
        trials: || vec![Trial::pass("integrator=backward-euler")],
        check: exponential,
    },
];

const FRONT: Case = Case {
    number: 18,
    title: "a point of heat with kappa = T^2.5 in a medium of 1e-6",
    required: "the front within 2 h of Barenblatt's, 0 <= T, energy to 1e-12",
    source: "Zel'dovich & Raizer",
    trials: || {
        let freezes = "the harmonic mean of a hot and a cold kappa is the cold one: the front freezes";
        let methods = ["euler", "rkl2", "backward-euler", "sdirk2"];
        let pass = methods.map(|m| Trial::pass(&format!("integrator={m} mean=arithmetic"))).to_vec();
        [pass, vec![Trial::fail("mean=harmonic", freezes)]].concat()
    },
    check: |setting, seen| front(setting, 2.5, seen),
};

fn layered() -> Vec<Trial> {
    let smears = "the arithmetic mean lets the good conductor reach into the bad one";
    let solved = ["integrator=backward-euler", "integrator=sdirk2"].map(trial::positive).concat();
    let mean = Trial::fail("integrator=backward-euler mean=arithmetic", smears);
    [solved, vec![mean, Trial::pass("integrator=euler"), Trial::pass("integrator=rkl2")]].concat()
}

/// Both ways round, so that the flux enters and leaves through the bad conductor.
fn jump(setting: &Setting, ratio: f64, tolerance: f64, seen: &mut Seen) -> Result<()> {
    for kappa in [[1.0, ratio], [ratio, 1.0]] {
        let exact = Layers { x: [0.0, 0.5, 1.0], kappa, temperature: [1.0, 0.0] };
        let (x, mut s) = layers(setting, &exact)?;
        let (low, high) = (s.get_number("T_min")?, s.get_number("T_max")?);
        match setting.is_implicit() {
            true => {
                // Six steps, each of 20 times the slowest decay.
                for _ in 0..6 {
                    s.step(0.5)?;
                }
                seen.at_most("flux off by", flux_error(&exact, &x, &s.get_all("T")?), tolerance);
            }
            false => {
                let dt = 200.0 * s.limit()?;
                s.step(dt)?;
            }
        }
        let slack = 1e-9 + 8.0 * f64::EPSILON * ratio;
        seen.at_most("outside by", (low - s.get_number("T_min")?).max(s.get_number("T_max")? - high), slack);
        seen.remember(&s.get_all("T")?);
    }
    Ok(())
}

/// Particles in 1-D from -0.2 to 1.2, fixed outside 0 to 1.
fn layers(setting: &Setting, exact: &Layers) -> Result<(Vec<f64>, Solver)> {
    let n = 40 * setting.scale as i32;
    let x: Vec<f64> = (-n / 5..n + n / 5).map(|i| (f64::from(i) + 0.5) / f64::from(n)).collect();
    let mut s = setting.unit_box(&x, 1, false, "")?;
    s.set_number("m", 1.0 / f64::from(n))?;
    set(&mut s, "kappa", &field(&x, 1, |p| exact.kappa[usize::from(p[0] > exact.x[1])]))?;
    let fixed = field(&x, 1, |p| f64::from(u8::from(!(0.0..=1.0).contains(&p[0]))));
    set(&mut s, "T", &field(&x, 1, |p| exact.at(p[0])).iter().zip(&fixed).map(|(t, f)| t * f).collect::<Vec<_>>())?;
    set(&mut s, "fixed", &fixed)?;
    Ok((x, s))
}

/// From the slope in the layer that conducts worse, where the temperature falls.
fn flux_error(exact: &Layers, x: &[f64], t: &[f64]) -> f64 {
    let worse = usize::from(exact.kappa[1] < exact.kappa[0]);
    let nearest = |at: f64| (0..x.len()).min_by(|&a, &b| (x[a] - at).abs().total_cmp(&(x[b] - at).abs())).unwrap_or(0);
    let (a, b) = (nearest(exact.x[worse] + 0.1), nearest(exact.x[worse] + 0.4));
    let flux = -exact.kappa[worse] * (t[b] - t[a]) / (x[b] - x[a]);
    (flux / exact.flux() - 1.0).abs()
}

fn insulator(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let x = setting.lattice(20, 2, 0.2)?;
    let mut s = setting.solver(2, "")?;
    s.set_box(&[0.0; 2], &[1.0; 2], &[false, true])?;
    super::setting::place(&mut s, &x)?;
    numbers(&mut s, &[("m", 2.0 / x.len() as f64), ("rho", 1.0)])?;
    // Supports are 3 h_fac spacings, so that pairs reach across from h_fac = 2 on.
    let side = field(&x, 2, |p| {
        if p[0] < 0.35 {
            -1.0
        } else if p[0] > 0.65 {
            1.0
        } else {
            0.0
        }
    });
    let before: Vec<f64> = side.iter().zip(x.chunks(2)).map(|(s, p)| 2.0 + s + p[1].rem_euclid(1.0)).collect();
    set(&mut s, "kappa", &side.iter().map(|s| setting.conducts * s.abs()).collect::<Vec<_>>())?;
    set(&mut s, "T", &before)?;
    s.step(0.1)?;
    let after = s.get_all("T")?;
    seen.remember(&after);
    let sum = |t: &[f64], of: f64| t.iter().zip(&side).filter(|(_, s)| **s == of).map(|(t, _)| t).sum::<f64>();
    for (name, of) in [("left", -1.0), ("right", 1.0)] {
        seen.at_most(&format!("{name} off by"), (sum(&after, of) / sum(&before, of) - 1.0).abs(), 1e-12);
    }
    // Along y, where both sides conduct, the step of T evens out: by e^4 in this time.
    let spread = |t: &[f64], of: f64| {
        let own = || t.iter().zip(&side).filter(|(_, s)| **s == of).map(|(t, _)| *t);
        own().fold(f64::MIN, f64::max) - own().fold(f64::MAX, f64::min)
    };
    // A single implicit step is not as exact, and Crank's and Nicolson's rings.
    let most = if setting.is_implicit() { 0.95 } else { 0.2 };
    seen.at_most("spread left", spread(&after, -1.0) / spread(&before, -1.0), most);
    let inside = |t: &[f64]| t.iter().zip(&side).filter(|(_, s)| **s == 0.0).map(|(t, _)| *t).collect::<Vec<_>>();
    seen.require("layer to the bit", same_bits(&inside(&after), &inside(&before)));
    Ok(())
}

fn front(setting: &Setting, n: f64, seen: &mut Seen) -> Result<()> {
    let x: Vec<f64> = setting.lattice(100, 1, 0.0)?.iter().map(|x| 2.0 * x - 1.0).collect();
    let wave = Barenblatt { a: 1.0, n, strength: 0.1, centre: [0.0; 3], dim: 1 };
    // From a front at 0.3 to one at 0.6; the front goes with t^(1/(n + 2)).
    let time = |radius: f64| (radius / wave.front(1.0)).powf(n + 2.0);
    let (start, end) = (time(0.3), time(0.6));
    let top = wave.at([0.0; 3], start);
    let t = field(&x, 1, |p| wave.at([p[0], 0.0, 0.0], start).max(1e-6 * top));
    let mut s = setting.unit_box(&x, 1, false, "")?;
    s.set_number("m", 2.0 / x.len() as f64)?;
    s.set_law("kappa", &format!("power n={n}"))?;
    set(&mut s, "T", &t)?;
    let before = s.get_number("energy")?;
    for _ in 0..200 {
        s.step((end - start) / 200.0)?;
    }
    let t = s.get_all("T")?;
    seen.remember(&t);
    seen.at_least("least T", s.get_number("T_min")?, 0.0);
    seen.at_most("energy off by", (s.get_number("energy")? / before - 1.0).abs(), 1e-12);
    // T has fallen to 0.3 of its top at r_f (1 - 0.3^n)^(1/2).
    let reached =
        x.iter().zip(&t).filter(|(_, t)| **t > 0.3 * wave.at([0.0; 3], end)).map(|(x, _)| *x).fold(0.0, f64::max);
    let (known, h) = (wave.front(end) * (1.0 - 0.3f64.powf(n)).sqrt(), s.get_all("h")?[0]);
    seen.at_most("front off by h *", (reached - known).abs() / h, 2.0);
    Ok(())
}

fn exponential(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let x = setting.lattice(16, 2, 0.2)?;
    let before = field(&x, 2, |p| 12.0 * (2.0 * std::f64::consts::PI * p[0]).sin());
    let scene = |setting: &Setting| -> Result<Solver> {
        let mut s = setting.unit_box(&x, 2, true, "mean=arithmetic")?;
        s.set_kappa_callback(Some(Box::new(|_, _, t, kappa| {
            kappa.iter_mut().zip(t).for_each(|(kappa, t)| *kappa = t.exp());
            0
        })));
        set(&mut s, "T", &before)?;
        Ok(s)
    };
    for limits in [1.0, 1e1, 1e2, 1e3, 1e4, 1e5] {
        let mut s = scene(setting)?;
        let dt = limits * s.limit()?;
        let report = match s.step(dt) {
            Err(e) => {
                seen.note(format!("{limits:e}: {}", e.name()));
                seen.require("unchanged", same_bits(&s.get_all("T")?, &before));
                continue;
            }
            Ok(report) => report,
        };
        let t = s.get_all("T")?;
        seen.remember(&t);
        if report.substeps == 1 {
            // T - dt dT/dt(T) of backward Euler is what T was.
            let back: Vec<f64> = t.iter().zip(s.get_all("dT_dt")?).map(|(t, r)| t - dt * r).collect();
            seen.at_most(&format!("{limits:e}: residual"), worst(&back, &before) / 24.0, 1e-6);
        } else {
            // Cut where it did not converge: of first order in what it was cut to.
            let mut careful = scene(&Setting { words: "integrator=auto".into(), conducts: 1.0, ..*setting })?;
            careful.step(dt)?;
            let off = worst(&t, &careful.get_all("T")?) / 24.0;
            seen.at_most(&format!("{limits:e}: in {} sub-steps off by", report.substeps), off, 0.05);
        }
    }
    Ok(())
}

fn inverse_square(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let x = setting.lattice(16, 2, 0.2)?;
    let before = field(&x, 2, |p| if disc(p) == HOT { 1.0 } else { 1e-6 });
    let mut s = setting.unit_box(&x, 2, true, "mean=arithmetic")?;
    s.set_law("kappa", "power n=-2")?;
    set(&mut s, "T", &before)?;
    let dt = 30.0 * s.limit()?;
    match s.step(dt) {
        Err(e) => {
            seen.note(e.name());
            seen.require("unchanged", same_bits(&s.get_all("T")?, &before));
        }
        Ok(report) => {
            seen.at_least("least T", report.t_min, 0.0);
            seen.at_most("energy off by", (report.energy / report.energy_before - 1.0).abs(), 1e-12);
        }
    }
    Ok(())
}
