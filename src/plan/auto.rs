//! `integrator=auto`, the default: the method that takes a step with the least work, from how stiff the step is.
//!
//! The choice is made anew for every step, from that step alone. Measured on 20 %-jittered 64² particles, a hot disc and
//! a smooth mode: where the tolerance is the same, rkl2 does less work than sdirk2 on conjugate gradients with multigrid
//! (an iteration is 1.3 times its applications of the operator) up to 7e4 (tolerance 1e-2), 9e4 (1e-3) and 2e5 (1e-5)
//! explicit limits, for a stabilised sub-step may be as long as the error allows while the stiff waves are dying. Without
//! a tolerance, where sdirk2 takes dt in one sub-step, up to 150, and up to 500 where that step makes the levels. Bounds
//! are kept by sub-steps that are rejected where they leave them.

use crate::error::Result;
use crate::integrator::{self, Method};

/// Of a step that is not stiff, and of one that is.
const LIGHT: &str = "rkl2";
const HEAVY: &str = "sdirk2";

/// As the list of integrators has it.
pub const ABOUT: &str = "for each step, from how stiff it is, rkl2 or, for the stiffest, sdirk2, at tolerance=1e-3; keeps bounds where the operator does";

/// The stiffness, in explicit limits, where the second needs less work: with a tolerance, and without.
const CONTROLLED: f64 = 9e4;
const FREE: f64 = 500.0;

/// Unless told otherwise: without a tolerance the methods differ in more than work. rkl2 alone errs by some 5e-4.
pub const TOLERANCE: f64 = 1e-3;

#[derive(Clone)]
pub struct Auto {
    /// What was chosen for the last step, and why.
    pub reason: String,
}

impl Default for Auto {
    fn default() -> Auto {
        Auto { reason: format!("{LIGHT} until a step is known") }
    }
}

impl Auto {
    /// The method before there is a step to choose for.
    ///
    /// # Errors
    /// None: both are in the table.
    pub fn first(&self) -> Result<&'static Method> {
        integrator::find(LIGHT)
    }

    /// The method for a step of so many explicit limits, of an operator that can be solved for or not.
    pub fn choose(&mut self, stiffness: f64, controlled: bool, solvable: bool) -> Result<&'static Method> {
        let most = if controlled { CONTROLLED } else { FREE };
        let stiff = stiffness > most;
        let name = if stiff && solvable { HEAVY } else { LIGHT };
        self.reason = match (stiff, solvable) {
            (true, false) => format!("{name} because this operator cannot be solved for"),
            _ => format!("{name} because dt is {} explicit limits; {HEAVY} pays beyond {most}", rounded(stiffness)),
        };
        integrator::find(name)
    }
}

/// To two digits.
fn rounded(v: f64) -> String {
    if (0.1..1e4).contains(&v) { format!("{v:.*}", usize::from(v < 10.0)) } else { format!("{v:.1e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stiffness_chooses_and_the_reason_says_so() {
        let mut auto = Auto::default();
        let mut chosen = |stiffness, controlled, solvable| {
            let name = auto.choose(stiffness, controlled, solvable).unwrap().name;
            assert!(auto.reason.starts_with(name), "{}", auto.reason);
            name
        };
        assert_eq!(
            [chosen(40.0, true, true), chosen(1e4, true, true), chosen(1e6, true, true)],
            ["rkl2", "rkl2", "sdirk2"]
        );
        assert_eq!(
            [chosen(40.0, false, true), chosen(1e4, false, true), chosen(1e6, true, false)],
            ["rkl2", "sdirk2", "rkl2"]
        );
        assert!(auto.reason.contains("cannot be solved"));
        assert!(auto.choose(2e5, true, true).is_ok_and(|m| m.name == HEAVY));
        assert_eq!(auto.reason, "sdirk2 because dt is 2.0e5 explicit limits; sdirk2 pays beyond 90000");
        assert_eq!([3.12, 40.2, 2.345e6, 0.0].map(rounded), ["3.1", "40", "2.3e6", "0.0e0"]);
    }
}
