//! Particles that are badly placed: 30 to 38.

use super::seen::short;
use super::setting::{careful_step, disc, field, l2, numbers, place, refused, same_bits, set};
use super::{Case, Seen, Setting, Trial, trial};
use crate::error::Result;
use crate::study::lattice;
use std::f64::consts::PI;

const JITTER: Case = Case {
    number: 30,
    title: "10 % jitter",
    required: "a mode that decays to 1/e is right to 3 % (two-first: its rate to 15 %); a random T stays in bounds (two-first: its \
               norm does)",
    source: "measured on lattices, jitter and glass",
    trials: || [trial::positive(""), two_first()].concat(),
    check: |setting, seen| jittered(setting, 0.1, 3e-2, seen),
};

pub const CASES: &[Case] = &[
    JITTER,
    Case {
        number: 31,
        title: "30 % jitter",
        required: "the same, to 10 %",
        trials: disordered,
        check: |setting, seen| jittered(setting, 0.3, 0.1, seen),
        ..JITTER
    },
    Case {
        number: 32,
        title: "50 % jitter",
        required: "the same, to 25 % (its rate to 15 %)",
        trials: disordered,
        check: |setting, seen| jittered(setting, 0.5, 0.25, seen),
        ..JITTER
    },
    Case {
        number: 33,
        title: "particles at random places, density summed",
        required: "the same, to 50 % (its rate to 30 %)",
        trials: disordered,
        check: random,
        ..JITTER
    },
    Case {
        number: 34,
        title: "two particles in one place",
        required: "finite positive weights, the same T for both, energy to 1e-12, T in bounds",
        source: "Phantom adds tiny() to r",
        trials: pairs,
        check: |setting, seen| pair_at(setting, 0.0, seen),
    },
    Case {
        number: 35,
        title: "two particles 1e-300, 1e-160 and 1e-150 apart, so that r^2 underflows",
        required: "the same",
        source: "",
        trials: pairs,
        check: |setting, seen| [1e-300, 1e-160, 1e-150].iter().try_for_each(|r| pair_at(setting, *r, seen)),
    },
    Case {
        number: 36,
        title: "0, 1 and 2 particles",
        required: "no crash; one keeps its T, two keep their sum and do not part",
        source: "",
        trials: trial::all,
        check: few,
    },
    Case {
        number: 37,
        title: "a particle without neighbours beside others that have some",
        required: "its T to the bit, everything finite, energy to 1e-12",
        source: "",
        trials: || [trial::all(), trial::operators("integrator=euler")].concat(),
        check: lone,
    },
    Case {
        number: 38,
        title: "800 particles, all neighbours of each other; the same with 1 MB of memory",
        required: "energy to 1e-12; NO_MEMORY that says what to do",
        source: "Phantom stops at a full neighbour list",
        trials: || trial::positive(""),
        check: cluster,
    },
];

const GROWS: &str = "direct second derivatives have growing modes on disordered particles";

fn two_first() -> Vec<Trial> {
    vec![Trial::pass("operator=two-first")]
}

fn disordered() -> Vec<Trial> {
    [trial::positive(""), two_first(), vec![Trial::fail("operator=direct", GROWS)]].concat()
}

fn pairs() -> Vec<Trial> {
    [trial::positive("integrator=euler"), trial::positive("integrator=backward-euler"), vec![Trial::pass("")]].concat()
}

fn jittered(setting: &Setting, jitter: f64, tolerance: f64, seen: &mut Seen) -> Result<()> {
    let x = setting.lattice(24, 2, jitter)?;
    decay(setting, &x, false, tolerance, seen)
}

/// As many particles as a lattice of 24 by 24 has, each anywhere.
fn random(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let mut x = vec![0.5; 2 * (24 * setting.scale).pow(2)];
    lattice::jitter(&mut x, 0.5, 7);
    decay(setting, &x, true, 0.5, seen)
}

/// A wave and noise, each for the time in which the wave decays to 1/e. `summed`: rho and h are found.
fn decay(setting: &Setting, x: &[f64], summed: bool, tolerance: f64, seen: &mut Seen) -> Result<()> {
    let wave = field(x, 2, |p| (2.0 * PI * p[0]).sin() * (2.0 * PI * p[1]).sin());
    let mut noise = vec![0.0; wave.len()];
    lattice::jitter(&mut noise, 1.0, 99);
    let time = 1.0 / (8.0 * PI * PI);
    let mut run = |t: &[f64]| {
        let mut s = setting.solver(2, "")?;
        s.set_box(&[0.0; 2], &[1.0; 2], &[true; 2])?;
        place(&mut s, x)?;
        numbers(&mut s, &[("m", 1.0 / t.len() as f64), ("kappa", setting.conducts)])?;
        if !summed {
            s.set_number("rho", 1.0)?;
        }
        // The same volumes in rho c_v, whatever rho is.
        if summed {
            let c_v: Vec<f64> = s.get_all("rho")?.iter().map(|rho| 1.0 / rho).collect();
            set(&mut s, "c_v", &c_v)?;
        }
        set(&mut s, "T", t)?;
        let (low, high) = (s.get_number("T_min")?, s.get_number("T_max")?);
        let report = s.step(time)?;
        let after = s.get_all("T")?;
        seen.remember(&after);
        let outside = (low - report.t_min).max(report.t_max - high).max(0.0);
        Ok((after, outside))
    };
    let (after, outside) = run(&wave)?;
    let (decayed, noisy) = run(&noise)?;
    let exact: Vec<f64> = wave.iter().map(|t| t * (-1.0f64).exp()).collect();
    // What is left of the wave itself: its decay in units of what is right.
    let product = |a: &[f64]| a.iter().zip(&wave).map(|(a, b)| a * b).sum::<f64>();
    let rate = -(product(&after) / product(&wave)).ln();
    seen.at_most("rate off by", (rate - 1.0).abs(), if summed { 0.3 } else { 0.15 });
    if setting.words.contains("two-first") {
        let size = |t: &[f64]| l2(t, &vec![0.0; t.len()]);
        seen.note(format!("off by {}", short(l2(&after, &exact))));
        seen.at_most("wave to", size(&after) / size(&wave), 0.9);
        seen.at_most("noise to", size(&decayed) / size(&noise), 0.9);
        return Ok(());
    }
    seen.at_most("off by", l2(&after, &exact), tolerance);
    seen.at_most("outside by", outside, 1e-12);
    seen.at_most("noise outside by", noisy, 1e-12);
    Ok(())
}

/// The disc with one more particle beside the one at the origin.
fn pair_at(setting: &Setting, r: f64, seen: &mut Seen) -> Result<()> {
    let mut x = setting.lattice(16, 2, 0.1)?;
    let i = 40;
    let n = x.len() / 2;
    let (dx, dy) = (x[2 * i], x[2 * i + 1]);
    x.chunks_mut(2).for_each(|p| (p[0], p[1]) = (p[0] - dx, p[1] - dy));
    x.extend([r, 0.0]);
    let mut s = setting.solver(2, "")?;
    s.set_box(&[-dx, -dy], &[1.0 - dx, 1.0 - dy], &[true; 2])?;
    place(&mut s, &x)?;
    numbers(&mut s, &[("m", 1.0 / n as f64), ("rho", 1.0), ("kappa", 1.0)])?;
    let t = field(&x, 2, |p| disc(&[p[0] + dx, p[1] + dy]));
    set(&mut s, "T", &t)?;
    seen.at_least(&format!("{r:e}: least weight"), s.get_number("smallest_weight")?, 0.0);
    let dt = 20.0 * s.limit()?;
    careful_step(setting, &mut s, dt, seen)?;
    let t = s.get_all("T")?;
    seen.at_most("unlike by", (t[i] - t[n]).abs(), 1e-9);
    Ok(())
}

fn few(setting: &Setting, seen: &mut Seen) -> Result<()> {
    for dim in 1..=3 {
        for n in 0..3usize {
            let x: Vec<f64> = (0..n * dim).map(|c| if c < dim { 0.4 } else { 0.45 }).collect();
            let mut s = setting.unit_box(&x, dim, false, "")?;
            s.set_number("h", 0.2)?;
            let t: Vec<f64> = (0..n).map(|i| i as f64).collect();
            set(&mut s, "T", &t)?;
            let long = if n == 2 { 200.0 * s.limit()? } else { 1.0 };
            for _ in 0..2 {
                s.step(long)?;
            }
            let after = s.get_all("T")?;
            seen.remember(&after);
            match n {
                2 => {
                    seen.at_most(&format!("{dim}-D: sum off by"), (after[0] + after[1] - 1.0).abs(), 1e-12);
                    seen.at_most("apart", (after[1] - after[0]).abs(), 1.0 + 1e-12);
                }
                _ => seen.require(&format!("{n}"), same_bits(&after, &t)),
            }
        }
    }
    Ok(())
}

fn lone(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let mut x = setting.lattice(10, 2, 0.1)?;
    x.extend([50.0, 50.0]);
    let n = x.len() / 2;
    let mut s = setting.unit_box(&x, 2, false, "")?;
    let mut t = field(&x, 2, disc);
    t[n - 1] = 5.0;
    set(&mut s, "T", &t)?;
    let dt = 0.9 * s.limit()?;
    careful_step(setting, &mut s, dt, seen)?;
    seen.require("T to the bit", s.get_all("T")?[n - 1].to_bits() == 5.0f64.to_bits());
    seen.require("K_d2 finite", s.get_all("K_d2")?.iter().all(|k| k.is_finite()));
    Ok(())
}

fn cluster(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let mut x = vec![0.5; 3 * 800];
    lattice::jitter(&mut x, 0.05, 3);
    for memory in ["", "memory=1e6"] {
        let mut s = setting.unit_box(&x, 3, false, memory)?;
        numbers(&mut s, &[("h", 0.2)])?;
        set(&mut s, "T", &field(&x, 3, |p| p[0]))?;
        let dt = s.limit().map(|limit| 5.0 * limit);
        match memory {
            "" => careful_step(setting, &mut s, dt?, seen)?,
            _ => refused(seen, memory, dt, "NO_MEMORY", "smaller h_fac"),
        }
    }
    Ok(())
}
