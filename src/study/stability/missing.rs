//! Cases of models that are not there, and what heat can already say about them: 17 and 47 to 52.

use super::setting::{field, same_bits, set};
use super::{Case, Seen, Setting, Trial};
use crate::error::Result;

const NOTHING: Case = Case {
    number: 0,
    title: "",
    required: "",
    source: "",
    trials: || vec![Trial::absent("model radiation")],
    check: |_, _| Ok(()),
};

pub const CASES: &[Case] = &[
    Case {
        number: 17,
        title: "flux-limited diffusion with an opacity of 0",
        required: "a flux of at most c E",
        source: "Phantom, iopacity_type=0",
        ..NOTHING
    },
    Case {
        number: 47,
        title: "dust fraction to 1 - 1e-12, and patches of 0",
        required: "a fraction between 0 and 1, its mass kept",
        source: "Phantom PR 400",
        trials: || vec![Trial::absent("model dust")],
        ..NOTHING
    },
    Case {
        number: 48,
        title: "a dust front, one step of 1e4 explicit limits; for heat: kappa = T, a parabola of T among T = 0",
        required: "0 <= T <= 1, energy to 1e-12",
        source: "Elsender & Bate 2024",
        trials: || {
            vec![
                Trial::pass("integrator=backward-euler mean=arithmetic"),
                Trial::pass("integrator=rkl2 mean=arithmetic"),
                Trial::absent("model dust"),
            ]
        },
        check: degenerate_front,
    },
    Case {
        number: 49,
        title: "gas and radiation exchange, a step of 1e-18 s to 5e-7 s",
        required: "equilibrium to 1e-12, both positive, their sum to 1e-14",
        source: "Phantom, test_radiation",
        ..NOTHING
    },
    Case {
        number: 50,
        title: "the same with c_v T / E_rad of 1e12 and 1e-12",
        required: "a safeguarded root, no cancellation",
        ..NOTHING
    },
    Case {
        number: 51,
        title: "Su & Olson's wave at 11 times",
        required: "1 % at 200 particles",
        source: "Su & Olson 1996",
        ..NOTHING
    },
    Case {
        number: 52,
        title: "a Marshak wave and free streaming",
        required: "no faster than c, T positive",
        ..NOTHING
    },
];

fn degenerate_front(setting: &Setting, seen: &mut Seen) -> Result<()> {
    let x = setting.lattice(100, 1, 0.0)?;
    let before = field(&x, 1, |p| (1.0 - 100.0 * (p[0] - 0.5).powi(2)).max(0.0));
    let mut s = setting.unit_box(&x, 1, false, "")?;
    s.set_law("kappa", "power n=1")?;
    set(&mut s, "T", &before)?;
    let dt = 1e4 * s.limit()?;
    let report = s.step(dt)?;
    let t = s.get_all("T")?;
    seen.remember(&t);
    seen.at_least("least T", report.t_min, 0.0);
    seen.at_most("greatest T", report.t_max, 1.0);
    seen.at_most("energy off by", (report.energy / report.energy_before - 1.0).abs(), 1e-12);
    seen.require("it moved", !same_bits(&t, &before));
    Ok(())
}
