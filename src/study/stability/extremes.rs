//! Sizes, units and places at the end of what numbers can hold: 39 to 46 and 61.

use super::setting::{careful_step, disc, energy, field, l2, numbers, place, refused, same_bits, set};
use super::{Case, Seen, Setting, Trial, trial};
use crate::error::Result;
use crate::solver::Solver;
use std::f64::consts::PI;

pub const CASES: &[Case] = &[
    Case {
        number: 39,
        title: "h that jumps by 8 and by 64",
        required: "every exchange seen from both sides: energy to 1e-12, T in bounds",
        source: "",
        trials: || {
            [trial::operators("integrator=euler bounds=free"), trial::positive("integrator=backward-euler")].concat()
        },
        check: |setting, seen| [8.0, 64.0].iter().try_for_each(|jump| uneven(setting, *jump, seen)),
    },
    Case {
        number: 40,
        title: "h of 0, -1, NaN; h that covers the box",
        required: "an error that names the particle; images counted, or BOX_TOO_SMALL",
        source: "",
        trials: || vec![Trial::pass("")],
        check: odd_h,
    },
    Case {
        number: 41,
        title: "a periodic box smaller than a support",
        required: "the rates of the same box repeated, to 1e-12",
        source: "",
        trials: || trial::operators(""),
        check: small_box,
    },
    Case {
        number: 42,
        title: "lengths, masses, temperatures and capacities of 1e-40 to 1e40",
        required: "the same answer in other units, to 1e-10",
        source: "Phantom, test_radiation: rho = 2.5e-24, t = 5e-22",
        trials: trial::all,
        check: units,
    },
    Case {
        number: 43,
        title: "a free surface under near-vacuum: rho falls by 1e12",
        required: "one implicit step of 10 limits of the dense side: energy to 1e-12, T in bounds",
        source: "",
        trials: trial::l_stable,
        check: near_vacuum,
    },
    Case {
        number: 44,
        title: "an open side",
        required: "nothing flows through it: energy to 1e-12; with h_conv exactly area h_conv (T_ambient - T) does",
        source: "GPUSPH, SPHinXsys",
        trials: || [trial::all(), trial::operators("integrator=euler bounds=free")].concat(),
        check: open_side,
    },
    Case {
        number: 45,
        title: "a mass of 0, -1, NaN at particle 7",
        required: "an error that names it, and nothing changed",
        source: "",
        trials: || vec![Trial::pass("")],
        check: |setting, seen| {
            let mut s = setting.disc("")?;
            let before = s.get_all("m")?;
            for bad in [0.0, -1.0, f64::NAN] {
                let mut m = before.clone();
                m[7] = bad;
                refused(seen, &bad.to_string(), set(&mut s, "m", &m), "BAD_VALUE", "m[7]");
            }
            seen.require("m to the bit", same_bits(&s.get_all("m")?, &before));
            Ok(())
        },
    },
    Case {
        number: 46,
        title: "T < 0: plain, with kappa(T) = T^2.5, with radiation",
        required: "allowed where all is linear; refused where a power of T would be taken",
        source: "",
        trials: || vec![Trial::pass("")],
        check: negative,
    },
    Case {
        number: 61,
        title: "particles in another order, moved by 2^27 spacings, turned by 30 degrees",
        required: "the same bits; the same to 1e-12; the same to 1e-10",
        source: "",
        trials: || [trial::all(), trial::positive("integrator=euler")].concat(),
        check: moved,
    },
];

/// A row of fine particles beside a row of coarse ones, in 1-D.
fn uneven(setting: &Setting, jump: f64, seen: &mut Seen) -> Result<()> {
    let (coarse, d) = (12, 1.0 / 24.0);
    let fine = (f64::from(coarse) * jump) as i32;
    let left = (0..fine).map(|i| (f64::from(i) + 0.5) * d / jump);
    let x: Vec<f64> = left.chain((0..coarse).map(|i| 0.5 + (f64::from(i) + 0.5) * d)).collect();
    let size = field(&x, 1, |p| if p[0] < 0.5 { d / jump } else { d });
    let mut s = setting.unit_box(&x, 1, true, "")?;
    set(&mut s, "m", &size)?;
    set(&mut s, "h", &size)?;
    set(&mut s, "T", &field(&x, 1, |p| if p[0] < 0.5 { 1.0 } else { 0.0 }))?;
    let dt = 50.0 * s.limit()?;
    match setting.words.contains("direct") {
        // Of both signs, so without bounds; its exchanges are symmetric all the same.
        true => {
            let report = s.step(0.02 * dt)?;
            seen.at_most("energy off by", (report.energy / report.energy_before - 1.0).abs(), 1e-12);
        }
        false => careful_step(setting, &mut s, dt, seen)?,
    }
    Ok(())
}

fn odd_h(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let mut s = setting.disc("")?;
    let (n, before) = (s.len(), s.get_all("dT_dt")?);
    for bad in [0.0, -1.0, f64::NAN] {
        let mut h = vec![0.04; n];
        h[7] = bad;
        refused(seen, &bad.to_string(), set(&mut s, "h", &h), "BAD_VALUE", "h[7]");
    }
    seen.require("rates to the bit", same_bits(&s.get_all("dT_dt")?, &before));
    s.set_number("h", 0.5)?;
    let limit = s.limit()?;
    careful_step(setting, &mut s, 10.0 * limit, seen)?;
    s.set_number("h", 100.0)?;
    refused(seen, "h of 100 boxes", s.step(limit), "BOX_TOO_SMALL", "h_fac");
    Ok(())
}

/// Rates in a box of 3 by 3 particles and in the same box 5 by 5 times.
fn small_box(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let cell: [[f64; 2]; 9] = std::array::from_fn(|i| {
        let place = |k: usize, wobble: f64| k as f64 + 0.5 + wobble * ((i * 7 % 5) as f64 / 5.0 - 0.4);
        [place(i % 3, 0.2), place(i / 3, -0.2)]
    });
    let rates = |copies: usize| {
        let shift = |c: usize| [3.0 * (c % copies) as f64, 3.0 * (c / copies) as f64];
        let x: Vec<f64> = (0..copies * copies)
            .flat_map(|c| cell.iter().flat_map(move |p| [p[0] + shift(c)[0], p[1] + shift(c)[1]]))
            .collect();
        let length = 3.0 * copies as f64;
        let mut s = setting.solver(2, "")?;
        s.set_box(&[0.0; 2], &[length; 2], &[true; 2])?;
        place(&mut s, &x)?;
        numbers(&mut s, &[("m", 1.0), ("rho", 1.0), ("kappa", 1.0)])?;
        set(&mut s, "T", &(0..x.len() / 2).map(|i| (i % 9 * (i % 9)) as f64).collect::<Vec<_>>())?;
        s.get_all("dT_dt")
    };
    let (small, large) = (rates(1)?, rates(5)?);
    seen.remember(&small);
    seen.at_most("off by", l2(&large[..9], &small), 1e-12);
    Ok(())
}

fn units(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let x = setting.lattice(12, 2, 0.2)?;
    let run = |[length, mass, temperature, capacity]: [f64; 4]| {
        let scaled: Vec<f64> = x.iter().map(|x| x * length).collect();
        let mut s = setting.solver(2, "")?;
        s.set_box(&[0.0; 2], &[length; 2], &[true; 2])?;
        place(&mut s, &scaled)?;
        let n = x.len() as f64 / 2.0;
        numbers(&mut s, &[("m", mass / n), ("rho", mass / length.powi(2)), ("c_v", capacity), ("kappa", 1.0)])?;
        let t = field(&x, 2, |p| temperature * disc(p));
        set(&mut s, "T", &t)?;
        // kappa is 1, so times are mass capacity: L² rho c_v / kappa.
        s.step(0.02 * mass * capacity)?;
        Ok(s.get_all("T")?.iter().map(|t| t / temperature).collect::<Vec<f64>>())
    };
    let reference = run([1.0; 4])?;
    seen.remember(&reference);
    for scale in [1e-40, 1e40] {
        for which in 0..4 {
            let mut scales = [1.0; 4];
            scales[which] = scale;
            let name = ["length", "mass", "T", "c_v"][which];
            seen.at_most(&format!("{name} {scale:e}"), l2(&run(scales)?, &reference), 1e-10);
        }
    }
    seen.at_most("all", l2(&run([1e-13, 1e33, 1e7, 1e-24])?, &reference), 1e-10);
    Ok(())
}

fn near_vacuum(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let x = setting.lattice(20, 2, 0.2)?;
    let n = x.len() as f64 / 2.0;
    let density = field(&x, 2, |p| if p[1] < 0.6 { 1.0 } else { 1e-12 });
    let mut s = setting.unit_box(&x, 2, false, "")?;
    let dense = s.set_number("T", 0.0).and_then(|()| s.limit())?;
    set(&mut s, "m", &density.iter().map(|d| d / n).collect::<Vec<_>>())?;
    set(&mut s, "rho", &density)?;
    set(&mut s, "h", &vec![1.0 / n.sqrt(); density.len()])?;
    set(&mut s, "T", &field(&x, 2, |p| if p[1] < 0.6 { disc(p) } else { 3.0 }))?;
    careful_step(setting, &mut s, 10.0 * dense, seen)
}

fn open_side(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let x = setting.lattice(16, 2, 0.1)?;
    let t = field(&x, 2, |p| 2.0 + (PI * p[0]).cos());
    let mut s = setting.unit_box(&x, 2, false, "")?;
    set(&mut s, "T", &t)?;
    let (dt, (before, size)) = (0.5 * s.limit()?, energy(&mut s)?);
    s.step(dt)?;
    seen.remember(&s.get_all("T")?);
    seen.at_most("energy off by", (energy(&mut s)?.0 - before).abs() / size, 1e-12);
    set(&mut s, "h_conv", &field(&x, 2, |p| if p[0] < 1.0 / 16.0 { 0.3 } else { 0.0 }))?;
    // T is that of the surface.
    numbers(&mut s, &[("T_ambient", 1.0), ("depth", 0.0)])?;
    let [m, rate, area, h_conv, t] = ["m", "rate", "area", "h_conv", "T"].map(|name| s.get_all(name));
    let (m, rate, area, h_conv, t) = (m?, rate?, area?, h_conv?, t?);
    let gained: f64 = m.iter().zip(&rate).map(|(m, r)| m * r).sum();
    let given: f64 = (0..t.len()).map(|i| area[i] * h_conv[i] * (1.0 - t[i])).sum();
    seen.at_most("loss off by", (gained / given - 1.0).abs(), 1e-11);
    Ok(())
}

fn negative(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let cold = |law: bool, radiates: bool| -> Result<Solver> {
        let mut s = setting.disc("")?;
        let t: Vec<f64> = s.get_all("T")?.iter().map(|t| t - 5.0).collect();
        set(&mut s, "T", &t)?;
        if law {
            s.set_law("kappa", "power n=2.5")?;
        }
        if radiates {
            numbers(&mut s, &[("emissivity", 1.0), ("sigma_SB", 1.0)])?;
        }
        Ok(s)
    };
    let mut s = cold(false, false)?;
    let dt = s.limit()?;
    careful_step(setting, &mut s, dt, seen)?;
    refused(seen, "T^2.5", cold(true, false)?.step(dt), "BAD_VALUE", "at T = -");
    refused(seen, "radiation", cold(false, true)?.step(dt), "BAD_VALUE", "T[");
    Ok(())
}

/// T after a step, of particles in open space.
fn after(setting: &Setting, x: &[f64], t: &[f64], dt: f64) -> Result<Vec<f64>> {
    let mut s = setting.unit_box(x, 2, false, "")?;
    set(&mut s, "T", t)?;
    s.step(dt)?;
    s.get_all("T")
}

fn moved(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let x = setting.lattice(16, 2, 0.2)?;
    let (n, t) = (x.len() / 2, field(&x, 2, disc));
    // Too short for sub-steps, whose number follows from a bound that depends on the order of particles.
    let dt =
        0.3 * setting.unit_box(&x, 2, false, "").and_then(|mut s| s.set_number("T", 0.0).and_then(|()| s.limit()))?;
    let still = after(setting, &x, &t, dt)?;
    seen.remember(&still);
    // 101 is coprime to every power of 2.
    let order: Vec<usize> = (0..n).map(|i| i * 101 % n).collect();
    let shuffled: Vec<f64> = order.iter().flat_map(|&i| [x[2 * i], x[2 * i + 1]]).collect();
    let there = after(setting, &shuffled, &order.iter().map(|&i| t[i]).collect::<Vec<_>>(), dt)?;
    seen.require("another order: same bits", same_bits(&there, &order.iter().map(|&i| still[i]).collect::<Vec<_>>()));
    let turned: Vec<f64> = x.chunks(2).flat_map(|p| turn(p, PI / 6.0)).collect();
    seen.at_most("turned", l2(&after(setting, &turned, &t, dt)?, &still), 1e-10);
    // On a lattice of binary fractions the coordinates that are moved lose nothing.
    let lattice = setting.lattice(16, 2, 0.0)?;
    let far: Vec<f64> = lattice.iter().map(|x| x + 2f64.powi(27) / 16.0).collect();
    seen.at_most("moved", l2(&after(setting, &far, &t, dt)?, &after(setting, &lattice, &t, dt)?), 1e-12);
    Ok(())
}

fn turn(p: &[f64], by: f64) -> [f64; 2] {
    let (sin, cos) = by.sin_cos();
    [cos * p[0] - sin * p[1], sin * p[0] + cos * p[1]]
}
