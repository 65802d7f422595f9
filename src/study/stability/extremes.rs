//! Sizes, units and places at the end of what numbers can hold: 39 to 46 and 61.

use super::setting::{HOT, careful_step, disc, energy, field, l2, numbers, place, refused, same_bits, set, worst};
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
        required: "the rates of the same box repeated, to 1e-12; the same of boxes that are one to three particles wide",
        source: "",
        trials: || {
            let tensors = ["two-first", "monotone", "limited", "espanol-revenga allow=unstable"];
            [trial::operators(""), tensors.map(|o| Trial::pass(&format!("operator={o}"))).to_vec()].concat()
        },
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
        required: "one implicit step of 10 limits of the dense side: energy to 1e-12, T in bounds; the same with the vacuum fixed, \
                   and heated; consistent: rates of a parabola are right on both sides",
        source: "",
        trials: || {
            let consistent = Trial::pass("operator=consistent order=2 kernel=C2 h_fac=1.6");
            [trial::l_stable(), vec![consistent]].concat()
        },
        check: near_vacuum,
    },
    Case {
        number: 44,
        title: "an open side",
        required: "nothing flows through it: energy to 1e-12; a wave that knows insulated sides decays as it must; with h_conv exactly \
                   area h_conv (T_ambient - T) flows",
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

/// Rates in boxes of few particles and in the same boxes repeated.
fn small_box(setting: &Setting, seen: &mut Seen) -> Result<()> {
    for (wide, high) in [(3, 3), (6, 2), (7, 1), (2, 2)] {
        let copies = [(15 / wide) | 1, if high == 1 { 9 } else { 5 }];
        let (small, large) =
            (rates_of_copies(setting, [wide, high], [1, 1])?, rates_of_copies(setting, [wide, high], copies)?);
        seen.remember(&small);
        // Sums that cancel: in units of what a pair exchanges.
        let size = small.iter().fold(1.0f64, |m, r| m.max(r.abs()));
        let exchanged = small.iter().fold(0.0f64, |m, r| m.max(r.abs()));
        seen.at_least("rates of", exchanged, 0.1);
        seen.at_most(&format!("{wide} by {high} off by"), worst(&large[..small.len()], &small) / size, 1e-12);
    }
    Ok(())
}

fn rates_of_copies(setting: &Setting, [wide, high]: [usize; 2], copies: [usize; 2]) -> Result<Vec<f64>> {
    let cell: Vec<[f64; 2]> = (0..wide * high)
        .map(|i| {
            let place = |k: usize, wobble: f64| k as f64 + 0.5 + wobble * ((i * 7 % 5) as f64 / 5.0 - 0.4);
            [place(i % wide, 0.2), place(i / wide, -0.2)]
        })
        .collect();
    let edge = [wide as f64, high as f64];
    let mut x = Vec::new();
    for c in 0..copies[0] * copies[1] {
        let shift = [edge[0] * (c % copies[0]) as f64, edge[1] * (c / copies[0]) as f64];
        x.extend(cell.iter().flat_map(|p| [p[0] + shift[0], p[1] + shift[1]]));
    }
    let mut s = setting.solver(2, "")?;
    s.set_box(&[0.0; 2], &[edge[0] * copies[0] as f64, edge[1] * copies[1] as f64], &[true; 2])?;
    place(&mut s, &x)?;
    numbers(&mut s, &[("m", 1.0), ("rho", 1.0)])?;
    match ["two-first", "monotone", "limited", "espanol"].iter().any(|o| setting.words.contains(o)) {
        false => s.set_number("kappa", setting.conducts)?,
        true => {
            let [par, perp] = [1.0, 0.2].map(|kappa| kappa * setting.conducts);
            numbers(&mut s, &[("kappa_par", par), ("kappa_perp", perp), ("b_x", 0.8), ("b_y", 0.6)])?;
        }
    }
    let n = cell.len();
    set(&mut s, "T", &(0..x.len() / 2).map(|i| (i % n * (i % n)) as f64).collect::<Vec<_>>())?;
    s.get_all("dT_dt")
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

/// A dense and an almost empty part, of particles that are as large.
fn beside_vacuum(setting: &Setting, x: &[f64]) -> Result<(Solver, Vec<f64>)> {
    let n = x.len() as f64 / 2.0;
    let density = field(x, 2, |p| if p[1] < 0.6 { 1.0 } else { 1e-12 });
    let mut s = setting.unit_box(x, 2, false, "")?;
    set(&mut s, "m", &density.iter().map(|d| d / n).collect::<Vec<_>>())?;
    set(&mut s, "rho", &density)?;
    Ok((s, density))
}

fn near_vacuum(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let x = setting.lattice(20, 2, 0.2)?;
    if setting.words.contains("consistent") {
        return parabola_beside_vacuum(setting, &x, seen);
    }
    let dense = setting
        .careful()
        .unit_box(&x, 2, false, "")
        .and_then(|mut s| s.set_number("T", 0.0).and_then(|()| s.limit()))?;
    let h = (2.0 / x.len() as f64).sqrt();
    let t = field(&x, 2, |p| if p[1] < 0.6 { disc(p) } else { 3.0 });
    for what in ["", "fixed", "heated"] {
        let (mut s, density) = beside_vacuum(setting, &x)?;
        set(&mut s, "h", &vec![h; density.len()])?;
        set(&mut s, "T", &t)?;
        let vacuum: Vec<f64> = density.iter().map(|&d| f64::from(u8::from(d < 1.0))).collect();
        match what {
            "fixed" => {
                set(&mut s, "fixed", &vacuum)?;
                let before = s.get_all("dT_dt")?;
                s.step(10.0 * dense)?;
                let (low, high, after) = (s.get_number("T_min")?, s.get_number("T_max")?, s.get_all("T")?);
                seen.at_most("fixed: outside by", (0.1 - low).max(high - HOT).max(0.0), 1e-8);
                let held = vacuum.iter().zip(t.iter().zip(&after)).filter(|(v, _)| **v == 1.0);
                seen.require("fixed: to the bit", held.into_iter().all(|(_, (a, b))| a.to_bits() == b.to_bits()));
                // The dense side feels it: beside the vacuum it warms.
                let warms = (0..t.len()).any(|i| vacuum[i] == 0.0 && before[i] > 0.0 && after[i] > t[i] + 0.01);
                seen.require("fixed: warms what is beside it", warms);
            }
            "heated" => {
                set(&mut s, "source", &vacuum)?;
                let report = s.step(10.0 * dense)?;
                let fed = 10.0 * dense * vacuum.iter().sum::<f64>() * h * h;
                seen.at_most("heated: energy off by", (report.energy - report.energy_before - fed).abs(), 1e-12 * HOT);
                // A source of 1 over the height of the vacuum raises T by less than that squared.
                seen.at_most("heated: T to", report.t_max, HOT + 0.16);
            }
            _ => careful_step(setting, &mut s, 10.0 * dense, seen)?,
        }
        seen.remember(&s.get_all("T")?);
    }
    Ok(())
}

/// Weights that are exact for it give 2 kappa/(rho c_v) wherever a support is whole, in the vacuum as beside it.
fn parabola_beside_vacuum(setting: &Setting, x: &[f64], seen: &mut Seen) -> Result<()> {
    let (mut s, density) = beside_vacuum(setting, x)?;
    set(&mut s, "h", &vec![1.6 * (2.0 / x.len() as f64).sqrt(); density.len()])?;
    set(&mut s, "T", &field(x, 2, |p| p[1] * p[1]))?;
    let rates = s.get_all("dT_dt")?;
    let inside = (0..density.len()).filter(|&i| x[2 * i..2 * i + 2].iter().all(|x| (0.2..0.8).contains(x)));
    let off = inside.map(|i| (rates[i] * density[i] / 2.0 - 1.0).abs()).fold(0.0, f64::max);
    seen.remember(&rates);
    seen.at_most("parabola off by", off, 1e-8);
    Ok(())
}

fn open_side(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let x = setting.lattice(16, 2, 0.1)?;
    let t = field(&x, 2, |p| 2.0 + (PI * p[0]).cos());
    let mut s = setting.unit_box(&x, 2, false, "")?;
    set(&mut s, "T", &t)?;
    let (dt, (before, size)) = (0.5 * s.limit()?, energy(&mut s)?);
    // The whole energy of the wave falls as that of the exact one.
    let (rates, wave) = (s.get_all("dT_dt")?, field(&x, 2, |p| (PI * p[0]).cos()));
    let product = |a: &[f64]| a.iter().zip(&wave).map(|(a, b)| a * b).sum::<f64>();
    seen.at_most("decay off by", (-product(&rates) / product(&wave) / (PI * PI) - 1.0).abs(), 0.15);
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
