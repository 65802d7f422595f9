//! What a scene does not need: one table. Each rule is switched off by `without=name`, which is how it is tested: with
//! it and without it, the same answer.

use super::Facts;

pub struct Rule {
    pub name: &'static str,
    /// Why the work is not needed, as the plan prints it.
    pub reason: &'static str,
    /// The answer is the same to the bit with and without the rule; otherwise to rounding.
    pub exact: bool,
    pub holds: fn(&Facts) -> bool,
}

pub static RULES: &[Rule] = &[
    Rule {
        name: "at_rest",
        reason: "the particles do not move: no sort, no pairs, no weights after the first step",
        exact: true,
        holds: |f| !f.moves,
    },
    Rule {
        name: "same_h",
        reason: "every h is the same: one kernel evaluation per pair, no symmetrisation",
        exact: true,
        holds: |f| f.same_h,
    },
    Rule {
        name: "uniform_kappa",
        reason: "kappa is one number: one factor instead of an average for each pair",
        exact: false,
        holds: |f| f.uniform_kappa,
    },
    Rule {
        name: "frozen",
        reason: "kappa does not change: its averages are folded into the weights",
        exact: true,
        holds: |f| !f.uniform_kappa && !f.kappa_of_t && !f.kappa_changes,
    },
    Rule {
        name: "no_wall",
        reason: "nothing flows through a surface: insulation is the natural boundary",
        exact: true,
        holds: |f| f.exchanging == 0,
    },
    Rule { name: "no_source", reason: "nothing is heated from inside", exact: true, holds: |f| !f.heated },
    Rule {
        name: "quiet_rows",
        reason: "blocks of particles whose T and whose neighbours' T are all equal contribute exactly zero",
        exact: true,
        holds: |f| f.n > crate::pool::BLOCK,
    },
    Rule {
        name: "one_stage",
        reason: "an rkl1 step below the explicit limit is one Euler stage, of the same order",
        exact: false,
        holds: |f| f.integrator == "rkl1",
    },
    Rule {
        name: "proven_bound",
        reason: "where Gershgorin's bound asks for no more stages than any bound would, no power iteration",
        exact: true,
        holds: |_| true,
    },
    Rule {
        name: "positive",
        reason: "no pair weight is negative, so T cannot grow: no check of its norm",
        exact: true,
        holds: |f| f.positive,
    },
];

impl PartialEq for Rule {
    fn eq(&self, other: &Rule) -> bool {
        self.name == other.name
    }
}

impl std::fmt::Debug for Rule {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(self.name)
    }
}
