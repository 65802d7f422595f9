//! `integrator=auto`: the method that takes a step with the least work, from how stiff the step is.
//!
//! The choice is made anew for every step, from that step alone. Measured on 20 %-jittered 64² particles, a hot disc and
//! a smooth mode: where the tolerance is the same, rkl2 does less work than sdirk2 on conjugate gradients with multigrid
//! (an iteration is 1.3 times its applications of the operator) up to 7e4 (tolerance 1e-2), 9e4 (1e-3) and 2e5 (1e-5)
//! explicit limits, for a stabilised sub-step may be as long as the error allows while the stiff waves are dying. Without
//! a tolerance, where sdirk2 takes dt in one sub-step, up to 150, and up to 500 where that step makes the levels. Of the
//! methods that keep the maximum principle, ssprk3 and backward Euler cross at 40, with a tolerance at 300 (1e-2) and
//! 700 (1e-3).

use super::Plan;
use super::motion::explicit_limit;
use super::state::State;
use crate::error::Result;
use crate::integrator::{self, Method};
use crate::model::fields;

/// Two methods, and the stiffness where the second needs less work: with a tolerance, and without.
struct Pair {
    light: &'static str,
    heavy: &'static str,
    controlled: f64,
    free: f64,
}

static FAST: Pair = Pair { light: "rkl2", heavy: "sdirk2", controlled: 9e4, free: 500.0 };

/// Where `bounds=keep` is asked for.
static KEEPING: Pair = Pair { light: "ssprk3", heavy: "backward-euler", controlled: 700.0, free: 40.0 };

/// Unless told otherwise: without a tolerance the methods differ in more than work. rkl2 alone errs by some 5e-4.
pub const TOLERANCE: f64 = 1e-3;

pub struct Auto {
    pair: &'static Pair,
    /// What was chosen for the last step, and why.
    pub reason: String,
}

impl Auto {
    pub fn new(keep_bounds: bool) -> Auto {
        let pair = if keep_bounds { &KEEPING } else { &FAST };
        Auto { pair, reason: format!("{} until a step is known", pair.light) }
    }

    /// The method before there is a step to choose for.
    ///
    /// # Errors
    /// None: both are in the table.
    pub fn first(&self) -> Result<&'static Method> {
        integrator::find(self.pair.light)
    }

    /// The method for a step of so many explicit limits, of an operator that can be solved for or not.
    fn choose(&mut self, stiffness: f64, controlled: bool, solvable: bool) -> Result<&'static Method> {
        let Pair { light, heavy, .. } = *self.pair;
        let most = if controlled { self.pair.controlled } else { self.pair.free };
        let stiff = stiffness > most;
        let name = if stiff && solvable { heavy } else { light };
        self.reason = match (stiff, solvable) {
            (true, false) => format!("{name} because this operator cannot be solved for"),
            _ => format!("{name} because dt is {} explicit limits; {heavy} pays beyond {most}", rounded(stiffness)),
        };
        integrator::find(name)
    }
}

impl State {
    /// Chooses the method for a step, where that is left to us; says whether it is another one than before.
    ///
    /// # Errors
    /// As [`State::bounds`].
    pub fn choose(&mut self, plan: &Plan, dt: f64) -> Result<bool> {
        if self.choices.auto.is_none() {
            return Ok(false);
        }
        let (t, time) = (self.each(fields::T)?, self.time);
        let bounds = self.with_motion(plan, |motion| Ok(motion.known_or_proven(time, &t)?.proven))?;
        let (stiffness, choices) = (dt / explicit_limit(bounds), &mut self.choices);
        let (controlled, solvable) = (choices.tolerance.is_some(), choices.operator.dissipative);
        let Some(auto) = &mut choices.auto else { return Ok(false) };
        let before = std::mem::replace(&mut choices.method, auto.choose(stiffness, controlled, solvable)?);
        Ok(before.name != choices.method.name)
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
        let mut auto = Auto::new(false);
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
        let mut auto = Auto::new(true);
        assert_eq!(auto.choose(3.0, true, true).unwrap().name, "ssprk3");
        assert_eq!(auto.choose(1e3, true, true).unwrap().name, "backward-euler");
        assert_eq!(auto.reason, "backward-euler because dt is 1000 explicit limits; backward-euler pays beyond 700");
        assert_eq!([3.12, 40.2, 2.345e6, 0.0].map(rounded), ["3.1", "40", "2.3e6", "0.0e0"]);
    }
}
