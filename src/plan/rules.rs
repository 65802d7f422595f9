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

table! {
    /// Every rule, in the order in which the plan prints them.
    RULES: Rule;

    AT_REST = Rule {
        name: "at_rest",
        reason: "the particles do not move: no sort, no pairs, no weights after the first step",
        same: Same::Bits,
        holds: |f| !f.moves,
    };
    SAME_H = Rule {
        name: "same_h",
        reason: "every h is the same: one kernel evaluation per pair, no symmetrisation",
        same: Same::Bits,
        holds: |f| f.same_h,
    };
    UNIFORM_KAPPA = Rule {
        name: "uniform_kappa",
        reason: "kappa is one number: one factor instead of an average for each pair",
        same: Same::Rounding,
        holds: |f| f.uniform_kappa,
    };
    ISOTROPIC = Rule {
        name: "isotropic",
        reason: "kappa is the same in all directions: no angular factor, no tensor in the fluxes",
        same: Same::Rounding,
        holds: |f| !f.tensor,
    };
    FROZEN = Rule {
        name: "frozen",
        reason: "kappa does not change: its averages are folded into the weights",
        same: Same::Bits,
        holds: |f| !f.uniform_kappa && !f.kappa_of_t && !f.kappa_changes && !f.twice,
    };
    NO_WALL = Rule {
        name: "no_wall",
        reason: "nothing flows through a surface: insulation is the natural boundary",
        same: Same::Bits,
        holds: |f| f.exchanging == 0,
    };
    NO_SOURCE = Rule {
        name: "no_source",
        reason: "nothing is heated from inside",
        same: Same::Bits,
        holds: |f| !f.heated,
    };
    QUIET_ROWS = Rule {
        name: "quiet_rows",
        reason: "blocks of particles whose T and whose neighbours' T are all equal contribute exactly zero",
        same: Same::Bits,
        holds: |f| f.n > crate::pool::BLOCK && !f.twice,
    };
    ONE_STAGE = Rule {
        name: "one_stage",
        reason: "an rkl1 step below the explicit limit is one Euler stage, of the same order",
        same: Same::Order,
        holds: |f| f.integrator == "rkl1" && !f.controlled,
    };
    PROVEN_BOUND = Rule {
        name: "proven_bound",
        reason: "where Gershgorin's bound asks for the same sub-steps as any lower one could, no search for it",
        same: Same::Bits,
        holds: |f| !f.implicit,
    };
    KEEP_MATRIX = Rule {
        name: "keep_matrix",
        reason: "the conductivity does not depend on T: the levels of multigrid are kept, whatever dt is",
        same: Same::Bits,
        holds: |f| f.implicit && f.preconditioning.stiff.is_finite() && !f.kappa_of_t,
    };
    RATE_ONLY = Rule {
        name: "rate_only",
        reason: "only rates are asked for: no bound on the operator, no stages, no check",
        same: Same::Bits,
        holds: |f| f.rate_only,
    };
    USED_ONCE = Rule {
        name: "used_once",
        reason: "weights that serve one rate of moving particles are applied as they are made, and not stored",
        same: Same::Bits,
        holds: |f| f.rate_only && f.moves && !f.normalised && !f.twice && !f.joined && !f.walls,
    };
    DECAYS = Rule {
        name: "decays",
        reason: "no mode of the operator can grow, or growth was allowed: no check of the spectrum",
        same: Same::Bits,
        holds: |f| !f.may_grow,
    };
    POSITIVE = Rule {
        name: "positive",
        reason: "no pair weight is negative, so T cannot grow: no check of its norm",
        same: Same::Bits,
        holds: |f| f.positive,
    };
}

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
