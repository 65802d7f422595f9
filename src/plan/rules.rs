//! What a scene does not need: one table. Each rule is switched off by `without=name`, which is how it is tested: with
//! it and without it, the same answer.

use super::Facts;

/// How two answers agree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Same {
    Bits,
    Rounding,
    /// To the order of accuracy of the method.
    Order,
}

impl std::fmt::Display for Same {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(match self {
            Same::Bits => "same bits",
            Same::Rounding => "same to rounding",
            Same::Order => "same order of accuracy",
        })
    }
}

pub struct Rule {
    pub name: &'static str,
    /// Why the work is not needed, as the plan prints it.
    pub reason: &'static str,
    /// How the answers with and without the rule agree.
    pub same: Same,
    pub holds: fn(&Facts) -> bool,
}

pub static RULES: &[Rule] = &[
    Rule {
        name: "at_rest",
        reason: "the particles do not move: no sort, no pairs, no weights after the first step",
        same: Same::Bits,
        holds: |f| !f.moves,
    },
    Rule {
        name: "same_h",
        reason: "every h is the same: one kernel evaluation per pair, no symmetrisation",
        same: Same::Bits,
        holds: |f| f.same_h,
    },
    Rule {
        name: "uniform_kappa",
        reason: "kappa is one number: one factor instead of an average for each pair",
        same: Same::Rounding,
        holds: |f| f.uniform_kappa,
    },
    Rule {
        name: "isotropic",
        reason: "kappa is the same in all directions: no angular factor, no tensor in the fluxes",
        same: Same::Rounding,
        holds: |f| !f.tensor,
    },
    Rule {
        name: "frozen",
        reason: "kappa does not change: its averages are folded into the weights",
        same: Same::Bits,
        holds: |f| !f.uniform_kappa && !f.kappa_of_t && !f.kappa_changes && !f.twice,
    },
    Rule {
        name: "no_wall",
        reason: "nothing flows through a surface: insulation is the natural boundary",
        same: Same::Bits,
        holds: |f| f.exchanging == 0,
    },
    Rule { name: "no_source", reason: "nothing is heated from inside", same: Same::Bits, holds: |f| !f.heated },
    Rule {
        name: "quiet_rows",
        reason: "blocks of particles whose T and whose neighbours' T are all equal contribute exactly zero",
        same: Same::Bits,
        holds: |f| f.n > crate::pool::BLOCK && !f.twice,
    },
    Rule {
        name: "one_stage",
        reason: "an rkl1 step below the explicit limit is one Euler stage, of the same order",
        same: Same::Order,
        holds: |f| f.integrator == "rkl1",
    },
    Rule {
        name: "proven_bound",
        reason: "where Gershgorin's bound asks for no more stages than any bound would, no power iteration",
        same: Same::Bits,
        holds: |f| !f.implicit,
    },
    Rule {
        name: "keep_matrix",
        reason: "the conductivity does not depend on T: the levels of multigrid are kept, whatever dt is",
        same: Same::Bits,
        holds: |f| f.implicit && f.preconditioning.stiff.is_finite() && !f.kappa_of_t,
    },
    Rule {
        name: "rate_only",
        reason: "only rates are asked for: no bound on the operator, no stages, no check",
        same: Same::Bits,
        holds: |f| f.rate_only,
    },
    Rule {
        name: "used_once",
        reason: "weights that serve one rate of moving particles are applied as they are made, and not stored",
        same: Same::Bits,
        holds: |f| f.rate_only && f.moves && !f.normalised && !f.twice && !f.joined && !f.walls,
    },
    Rule {
        name: "decays",
        reason: "weights are the same from both sides of a pair, or growth was allowed: no check of the spectrum",
        same: Same::Bits,
        holds: |f| !f.one_sided,
    },
    Rule {
        name: "positive",
        reason: "no pair weight is negative, so T cannot grow: no check of its norm",
        same: Same::Bits,
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
