//! Boundaries, steady states and callers that are wrong: 58 to 60 and 62.

use super::setting::{field, numbers, place, refused, same_bits, set, worst};
use super::{Case, Seen, Setting, trial};
use crate::array::{Strided, StridedMut};
use crate::error::Result;

pub const CASES: &[Case] = &[
    Case {
        number: 58,
        title: "fixed at two ends, insulated along two, with and without a source, in twelve implicit steps",
        required: "the steady line to 1e-10, the steady parabola to 1e-8, on a lattice",
        source: "",
        trials: || ["integrator=backward-euler", "integrator=sdirk2"].map(trial::positive).concat(),
        check: steady,
    },
    Case {
        number: 59,
        title: "one free particle among fixed ones; all fixed",
        required: "the weighted mean of its neighbours to 1e-9; nothing moves",
        source: "",
        trials: || [trial::l_stable(), trial::integrators(|m| m.ssp == 1.0)].concat(),
        check: among_fixed,
    },
    Case {
        number: 60,
        title: "insulated all round with sources: that add up to 0, and that do not; three implicit steps of 1e3",
        required: "a steady state and the mean kept to 1e-9; a mean that rises exactly as fed",
        source: "",
        trials: trial::l_stable,
        check: insulated,
    },
    Case {
        number: 62,
        title: "strides, counts and values that are wrong (NULL and overlaps in C: tests/suite/abi.rs)",
        required: "an error that names the argument, and nothing changed or written",
        source: "",
        trials: || vec![super::Trial::pass("")],
        check: wrong_calls,
    },
];

fn steady(setting: &Setting, seen: &mut Seen) -> Result<()> {
    for (source, tolerance) in [(0.0, 1e-10), (8.0, 1e-8)] {
        let (wide, high) = (24 * setting.scale, 6);
        let n = wide as f64;
        // Fixed outside 0 to 1, for a support and more on each side.
        let row = |i: usize| (i as f64 + 0.5 - 4.0) / n;
        let x: Vec<f64> =
            (0..high).flat_map(|j| (0..wide + 8).flat_map(move |i| [row(i), (j as f64 + 0.5) / n])).collect();
        let exact = field(&x, 2, |p| 1.0 + 2.0 * p[0] + 0.5 * source * p[0] * (1.0 - p[0]));
        let fixed = field(&x, 2, |p| f64::from(u8::from(!(0.0..=1.0).contains(&p[0]))));
        let mut s = setting.unit_box(&x, 2, false, "")?;
        if source != 0.0 {
            // Insulated by symmetry: an end of particles has fewer neighbours, and a parabola sees that.
            s.set_box(&[-1.0, 0.0], &[2.0, high as f64 / n], &[false, true])?;
        }
        numbers(&mut s, &[("m", 1.0 / (n * n)), ("source", source)])?;
        set(&mut s, "fixed", &fixed)?;
        set(&mut s, "T", &exact.iter().zip(&fixed).map(|(t, f)| t * f).collect::<Vec<_>>())?;
        for _ in 0..12 {
            s.step(10.0)?;
        }
        let t = s.get_all("T")?;
        seen.remember(&t);
        seen.at_most(if source == 0.0 { "line off by" } else { "parabola off by" }, worst(&t, &exact), tolerance);
    }
    Ok(())
}

fn among_fixed(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let x = setting.lattice(8, 2, 0.2)?;
    let n = x.len() / 2;
    let mut s = setting.unit_box(&x, 2, true, "")?;
    let mut t = field(&x, 2, |p| p[0] + 2.0 * p[1]);
    // The rate is A (mean - T): T = 0 and 1 tell the mean.
    let mut rate = |value: f64| {
        t[20] = value;
        set(&mut s, "T", &t)?;
        Ok(s.get_all("dT_dt")?[20])
    };
    let (at_0, at_1) = (rate(0.0)?, rate(1.0)?);
    set(&mut s, "fixed", &(0..n).map(|i| f64::from(u8::from(i != 20))).collect::<Vec<_>>())?;
    let long = if setting.is_implicit() { 1e9 / (at_0 - at_1) } else { 40.0 / (at_0 - at_1) };
    for _ in 0..2 {
        s.step(long)?;
    }
    let after = s.get_all("T")?;
    seen.remember(&after);
    seen.at_most("off by", (after[20] - at_0 / (at_0 - at_1)).abs(), 1e-9);
    t[20] = after[20];
    seen.require("the others to the bit", same_bits(&after, &t));
    s.set_number("fixed", 1.0)?;
    s.step(long)?;
    seen.require("all fixed: to the bit", same_bits(&s.get_all("T")?, &after));
    Ok(())
}

fn insulated(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let x = setting.lattice(16, 2, 0.2)?;
    for net in [0.0, 1.0] {
        let mut s = setting.unit_box(&x, 2, false, "")?;
        s.set_number("T", 1.0)?;
        let mut source = field(&x, 2, |p| (std::f64::consts::PI * p[0]).cos());
        let mean = source.iter().sum::<f64>() / source.len() as f64;
        source.iter_mut().for_each(|q| *q += net - mean);
        set(&mut s, "source", &source)?;
        for _ in 0..3 {
            s.step(1e3)?;
        }
        seen.remember(&s.get_all("T")?);
        seen.at_most("mean off by", (s.get_number("energy")? / (1.0 + net * 3e3) - 1.0).abs(), 1e-9);
        let rates = s.get_all("dT_dt")?;
        seen.at_most("steady but for", worst(&rates, &vec![net; rates.len()]), 1e-6);
    }
    Ok(())
}

fn wrong_calls(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let mut s = setting.disc("")?;
    let (n, before) = (s.len(), s.get_all("T")?);
    let short = &before[1..];
    refused(seen, "one value too few", set(&mut s, "T", short), "WRONG_COUNT", "T has");
    refused(seen, "stride 0", Strided::new("T", &before, n, 0, 1), "WRONG_COUNT", "stride");
    refused(seen, "a stride beyond the array", Strided::new("T", &before, n, 2, 1), "WRONG_COUNT", "T has");
    refused(seen, "a stride of huge", Strided::new("T", &before, n, usize::MAX, 1), "WRONG_COUNT", "T has");
    refused(seen, "vectors for T", s.set("T", Strided::new("T", &before, n / 2, 2, 2)?), "WRONG_COUNT", "T has");
    refused(seen, "3-D positions", s.set_particles(Strided::new("x", &before, n / 3, 3, 3)?), "WRONG_COUNT", "x has");
    let mut odd = before.clone();
    odd[3] = f64::NAN;
    refused(seen, "NaN", set(&mut s, "T", &odd), "BAD_VALUE", "T[3]");
    refused(seen, "NaN in x", place(&mut s, &[odd.clone(), odd].concat()), "BAD_VALUE", "x[1]");
    let mut out = vec![7.0; n - 1];
    refused(seen, "short output", s.get("T", StridedMut::new("T", &mut out, n - 1, 1, 1)?), "WRONG_COUNT", "T has");
    seen.require("nothing written", out.iter().all(|v| *v == 7.0));
    refused(seen, "a result as input", s.set_number("energy", 1.0), "BAD_VALUE", "result");
    seen.require("T to the bit", same_bits(&s.get_all("T")?, &before));
    Ok(())
}
