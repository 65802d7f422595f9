//! Steps of any length: 1 to 9, 53, 54.

use super::seen::short;
use super::setting::{HOT, careful_step, disc as disc_at, field, l2, same_bits, set};
use super::{Case, Seen, Setting, Trial, trial};
use crate::error::Result;
use crate::solver::Solver;

const NOT_MONOTONE: &str = "its weights have both signs: no maximum principle";

const DISC: Case = Case {
    number: 1,
    title: "hot disc 10 : 0.1, one step of 1 explicit limit",
    required: "energy to 1e-12; no new extremum where the method promises that, else none beyond the spread; the disc gives off \
               what short explicit steps say",
    source: "backward Euler with an M-matrix keeps the maximum principle at any step",
    trials: || {
        let two_first =
            Trial::fail("operator=two-first integrator=backward-euler", "two gradients in turn are not monotone");
        [methods(), vec![two_first], direct("integrator=ssprk3")].concat()
    },
    check: |setting, seen| disc(setting, 1.0, seen),
};

pub const CASES: &[Case] = &[
    DISC,
    Case {
        number: 2,
        title: "the same, 10 limits",
        trials: methods,
        check: |setting, seen| disc(setting, 1e1, seen),
        ..DISC
    },
    Case {
        number: 3,
        title: "the same, 100 limits",
        trials: long,
        check: |setting, seen| disc(setting, 1e2, seen),
        ..DISC
    },
    Case {
        number: 4,
        title: "the same, 1e4 limits",
        trials: long,
        check: |setting, seen| disc(setting, 1e4, seen),
        ..DISC
    },
    Case {
        number: 5,
        title: "the same, 1e6 limits",
        required: "as before, and within 1 % of the mean",
        source: "",
        trials: || {
            let rings = Trial::fail("integrator=crank-nicolson", "its long steps leave short waves ringing");
            [trial::l_stable(), trial::integrators(|m| m.is_stabilised()), vec![rings]].concat()
        },
        check: |setting, seen| {
            let s = disc_after(setting, 1e6, seen)?;
            at_mean(s, seen)
        },
    },
    Case {
        number: 6,
        title: "a step of 1e-30, T of 1 and of 1e-300",
        required: "T as it was: a change of 1e-27 is below rounding, and nothing underflows into a trap",
        source: "",
        trials: trial::all,
        check: |setting, seen| {
            for scale in [1.0, 1e-300] {
                let mut s = setting.disc("")?;
                let t: Vec<f64> = s.get_all("T")?.iter().map(|t| t * scale).collect();
                set(&mut s, "T", &t)?;
                s.step(1e-30)?;
                seen.at_most(&format!("T of {scale:e} moved by"), l2(&s.get_all("T")?, &t), 1e-15);
            }
            Ok(())
        },
    },
    Case {
        number: 7,
        title: "a step of 0",
        required: "the same bits",
        source: "",
        trials: trial::all,
        check: |setting, seen| {
            let mut s = setting.disc("")?;
            let before = s.get_all("T")?;
            s.step(0.0)?;
            seen.require("T to the bit", same_bits(&s.get_all("T")?, &before));
            seen.at_most("time", s.get_number("time")?, 0.0);
            Ok(())
        },
    },
    Case {
        number: 8,
        title: "a step of -1, NaN, infinity",
        required: "an error, and nothing changed",
        source: "",
        trials: trial::all,
        check: |setting, seen| {
            for dt in [-1.0, f64::NAN, f64::INFINITY] {
                let mut s = setting.disc("")?;
                let before = s.get_all("T")?;
                let name = s.step(dt).map_or_else(|e| e.name(), |_| "DONE");
                seen.require(&format!("{dt}: BAD_VALUE"), name == "BAD_VALUE");
                seen.require("unchanged", same_bits(&s.get_all("T")?, &before));
            }
            Ok(())
        },
    },
    Case {
        number: 9,
        title: "an explicit step of 37 limits; the same with 5 applications allowed",
        required: "sub-steps that stay bounded; refused and nothing changed where they may not be taken",
        source: "",
        trials: || trial::integrators(|m| !m.is_implicit()),
        check: |setting, seen| {
            let mut s = setting.disc("")?;
            let dt = 37.0 * s.limit()?;
            careful_step(setting, &mut s, dt, seen)?;
            let mut s = setting.disc("max_applications=5 stages=3")?;
            let before = s.get_all("T")?;
            let name = s.step(dt).map_or_else(|e| e.name(), |_| "DONE");
            seen.require("STEP_TOO_LARGE", name == "STEP_TOO_LARGE");
            seen.require("unchanged", same_bits(&s.get_all("T")?, &before));
            Ok(())
        },
    },
    Case {
        number: 53,
        title: "a hot bar in 1-D, a step that 201 stages of rkl2 would span",
        required: "within 1 % of what 21 stages at a time give, by whatever sub-steps that takes",
        source: "Caplan et al. 2024: practical step limits",
        trials: || trial::integrators(|m| m.is_stabilised()),
        check: long_stabilised_step,
    },
    Case {
        number: 54,
        title: "a checkerboard of T = +1 and -1 on a lattice",
        required: "decays as exp(-lambda t), lambda at most the spectral bound and at least 0.05 of it",
        source: "SWIFT, Diffusion_1D",
        trials: || {
            let null = "first differences do not see a checkerboard, so it never decays";
            let two_first = vec![Trial::fail("operator=two-first theta=0", null), Trial::pass("operator=two-first")];
            [trial::operators(""), two_first].concat()
        },
        check: checkerboard,
    },
];

fn methods() -> Vec<Trial> {
    let tensors = ["operator=monotone integrator=backward-euler", "operator=limited integrator=ssprk3"];
    [trial::all(), trial::positive("integrator=backward-euler"), tensors.map(Trial::pass).to_vec()].concat()
}

fn long() -> Vec<Trial> {
    // Limited fluxes are explicit, so their 1e4 limits are those of the case before, ten times as often: two minutes.
    let methods = methods().into_iter().filter(|t| !t.words.contains("operator=limited")).collect();
    [methods, direct("integrator=ssprk3")].concat()
}

fn direct(more: &str) -> Vec<Trial> {
    vec![Trial::fail(&format!("operator=direct allow=unstable {more}"), NOT_MONOTONE)]
}

fn disc(setting: &Setting, limits: f64, seen: &mut Seen) -> Result<()> {
    disc_after(setting, limits, seen).map(drop)
}

fn disc_after(setting: &Setting, limits: f64, seen: &mut Seen) -> Result<Solver> {
    let more = if setting.words.contains("direct") { "bounds=free" } else { "" };
    let (mut s, mut known) = (setting.disc(more)?, setting.careful().disc(more)?);
    let dt = limits * known.limit()?;
    careful_step(setting, &mut s, dt, seen)?;
    if limits <= 100.0 {
        known.step(dt)?;
    } else {
        // Some 150 of the slowest decays: all is at the mean.
        let (m, c_v) = (known.get_all("m")?, known.get_all("c_v")?);
        let capacity: f64 = m.iter().zip(&c_v).map(|(m, c_v)| m * c_v).sum();
        let mean = known.get_number("energy")? / capacity;
        known.set_number("T", mean)?;
    }
    let share = given_off(&mut s)? / given_off(&mut known)?;
    match setting.words.contains("crank-nicolson") {
        // Its long steps overshoot: what has left may be twice too much.
        true => seen.at_least("given off", share, 0.3),
        false => seen.at_most("given off, wrong by", (share - 1.0).abs(), blur(setting, limits)),
    }
    Ok(s)
}

/// The heat that has left the hot disc.
fn given_off(s: &mut Solver) -> Result<f64> {
    let [x, m, c_v, t] = ["x", "m", "c_v", "T"].map(|name| s.get_all(name));
    let (x, m, c_v, t) = (x?, m?, c_v?, t?);
    let hot = (0..t.len()).filter(|&i| disc_at(&x[2 * i..]) == HOT);
    Ok(hot.map(|i| m[i] * c_v[i] * (HOT - t[i])).sum())
}

/// What a method may be wrong by: explicit ones take steps of a limit at most, implicit ones a single step, or the few
/// that keep bounds (sdirk2 0.11 at 10 limits, 0.015 at 1e4).
fn blur(setting: &Setting, limits: f64) -> f64 {
    let first = setting.method().is_some_and(|m| m.order == 1);
    match (setting.is_implicit(), first) {
        _ if limits > 100.0 => 2e-2,
        (true, true) => 0.4,
        (true, false) => 0.15,
        (false, true) => 0.2,
        // All that is given off is nearly as much with any kappa in the end.
        (false, false) if limits > 10.0 => 0.02,
        (false, false) if limits > 1.0 => 0.05,
        (false, false) => 0.08,
    }
}

fn at_mean(mut s: Solver, seen: &mut Seen) -> Result<()> {
    let spread = s.get_number("T_max")? - s.get_number("T_min")?;
    seen.at_most("spread", spread, 0.01 * 9.9);
    Ok(())
}

fn checkerboard(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let n = 16 * setting.scale;
    let x = setting.lattice(16, 2, 0.0)?;
    let cell = |v: f64| (v * n as f64).floor() as i64;
    let t = field(&x, 2, |p| if (cell(p[0]) + cell(p[1])) % 2 == 0 { 1.0 } else { -1.0 });
    let mut s = setting.unit_box(&x, 2, true, "integrator=ssprk3")?;
    set(&mut s, "T", &t)?;
    let (lambda, bound) = (-s.get_all("dT_dt")?[0] / t[0], s.get_number("spectral_bound")?);
    seen.at_most("lambda / bound", lambda / bound, 1.0 + 1e-9);
    seen.at_least("lambda / bound", lambda / bound, 0.05);
    // Half an e-folding of the fastest wave, in steps far below it.
    for _ in 0..100 {
        s.step(0.005 / bound)?;
    }
    let exact: Vec<f64> = t.iter().map(|t| t * (-0.5 * lambda / bound).exp()).collect();
    seen.at_most("off by", l2(&s.get_all("T")?, &exact), 1e-6);
    Ok(())
}

fn long_stabilised_step(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let x = setting.lattice(400, 1, 0.0)?;
    let t = field(&x, 1, |p| if (p[0] - 0.5).abs() < 0.1 { 10.0 } else { 0.1 });
    let mut s = setting.unit_box(&x, 1, true, "")?;
    set(&mut s, "T", &t)?;
    let dt = (201.0 * 201.0 + 201.0 - 2.0) / 4.0 * s.limit()?;
    let calm = Setting { words: "integrator=rkl2 stages=21".into(), ..*setting };
    let mut reference = calm.unit_box(&x, 1, true, "")?;
    set(&mut reference, "T", &t)?;
    reference.step(dt)?;
    let report = s.step(dt)?;
    seen.note(format!("{} sub-steps", report.substeps));
    let (t, known) = (s.get_all("T")?, reference.get_all("T")?);
    seen.remember(&t);
    seen.at_most("off by", l2(&t, &known), 1e-2);
    seen.note(format!("spread left {}", short(s.get_number("T_max")? - s.get_number("T_min")?)));
    Ok(())
}
