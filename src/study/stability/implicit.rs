//! What implicit solves promise: 55 to 57.

use super::setting::{careful_step, l2, same_bits};
use super::{Case, trial};

pub const CASES: &[Case] = &[
    Case {
        number: 55,
        title: "a tolerance of 1e-2 for implicit solves, 1e3 limits",
        required: "energy to 1e-12 all the same",
        source: "GIZMO's conjugate gradients stop at 1e-2",
        trials: trial::implicit,
        check: |setting, seen| {
            let mut s = setting.disc("solver_tolerance=1e-2")?;
            let before = s.get_number("energy")?;
            let dt = 1e3 * s.limit()?;
            let report = s.step(dt)?;
            seen.remember(&s.get_all("T")?);
            seen.at_most("energy off by", (report.energy / before - 1.0).abs(), 1e-12);
            Ok(())
        },
    },
    Case {
        number: 56,
        title: "one iteration allowed, 1e4 limits",
        required: "NOT_CONVERGED, nothing changed, and a step that can be taken still works",
        source: "Phantom PR 419 goes on unconverged",
        trials: trial::implicit,
        check: |setting, seen| {
            let mut s = setting.disc("max_iterations=1")?;
            let (before, dt) = (s.get_all("T")?, 1e4 * s.limit()?);
            let name = s.step(dt).map_or_else(|e| e.name(), |_| "DONE");
            seen.require("NOT_CONVERGED", name == "NOT_CONVERGED");
            seen.require("T to the bit", same_bits(&s.get_all("T")?, &before));
            seen.at_most("time", s.get_number("time")?, 0.0);
            careful_step(setting, &mut s, 1e-14 * dt, seen)
        },
    },
    Case {
        number: 57,
        title: "a solver that has stepped before and a fresh one, 300 limits",
        required: "the same answer, in no more applications",
        source: "SPlisHSPlasH issue 80",
        trials: trial::implicit,
        check: |setting, seen| {
            let mut warm = setting.disc("")?;
            let dt = 300.0 * warm.limit()?;
            warm.step(dt)?;
            let mut cold = setting.disc("")?;
            super::setting::set(&mut cold, "T", &warm.get_all("T")?)?;
            let (again, first) = (warm.step(dt)?, cold.step(dt)?);
            seen.at_most("off by", l2(&warm.get_all("T")?, &cold.get_all("T")?), 1e-12);
            seen.at_most("applications", again.applications as f64, first.applications as f64);
            Ok(())
        },
    },
];
