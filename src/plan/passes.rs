//! What is done for a step, in order: one table. A scene's plan lists the rows that it wants, preparing runs those that make
//! something, and the clock has their names, so that the three cannot differ.

use super::report::Name;
use super::state::State;
use super::{Choices, Facts, Plan, rules};
use crate::error::Result;
use crate::operator::Normalise;
use crate::operator::table::Join;
use rules::Rule;

/// How often a pass runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum When {
    Once,
    EachStep,
    EachStage,
}

/// A row of the table.
pub struct Pass {
    pub name: Name,
    /// How often it runs in a scene; none where it is not wanted.
    pub when: fn(&Scene) -> Option<When>,
    /// What it does there.
    pub about: fn(&Scene) -> String,
    pub cost: fn(&Scene) -> Cost,
    /// Makes what a right-hand side needs, unless it is there; answers whether anything was done. None for what runs in a
    /// step or a stage, and for what the plan itself is made from.
    pub make: Option<fn(&mut State, &Plan) -> Result<bool>>,
}

impl PartialEq for Pass {
    fn eq(&self, other: &Pass) -> bool {
        self.name == other.name
    }
}

impl std::fmt::Debug for Pass {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(self.name.0)
    }
}

/// What a pass's product holds, and how many pairs it visits, both directions counted.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Cost {
    pub bytes: f64,
    pub pairs: f64,
}

/// What a pass is asked about.
pub struct Scene<'a> {
    pub choices: &'a Choices,
    pub facts: &'a Facts,
    pub left_out: &'a [&'static Rule],
}

impl Scene<'_> {
    fn leaves_out(&self, rule: &Rule) -> bool {
        self.left_out.contains(&rule)
    }

    /// How often what depends on where particles are is made.
    fn setup(&self) -> Option<When> {
        Some(if self.leaves_out(&rules::AT_REST) { When::Once } else { When::EachStep })
    }

    fn setup_if(&self, wanted: bool) -> Option<When> {
        self.setup().filter(|_| wanted)
    }

    /// Whether steps are taken, not only rates asked for.
    fn moves_t(&self) -> bool {
        !self.leaves_out(&rules::RATE_ONLY)
    }

    fn n(&self) -> f64 {
        self.facts.n as f64
    }

    fn pairs(&self) -> f64 {
        self.n() * self.facts.neighbours
    }

    /// So many bytes per pair and per particle, all pairs visited `times`.
    fn cost(&self, [pair, particle]: [f64; 2], times: f64) -> Cost {
        Cost { bytes: self.pairs() * pair + self.n() * particle, pairs: times * self.pairs() }
    }

    fn folds(&self) -> bool {
        self.leaves_out(&rules::FROZEN) && !self.leaves_out(&rules::UNIFORM_KAPPA)
    }

    /// The pass that moves T, in words.
    fn motion(&self, how: &str) -> String {
        match &self.facts.auto {
            Some(reason) => format!("auto: {reason}; {how}"),
            None => format!("{}: {how}", self.facts.integrator),
        }
    }
}

/// Each stage, where it is wanted.
fn each_stage(wanted: bool) -> Option<When> {
    wanted.then_some(When::EachStage)
}

/// What a row says nothing of: it costs nothing, and makes nothing by itself.
const PLAIN: Pass = Pass {
    name: Name(""),
    when: |_| None,
    about: |_| String::new(),
    cost: |_| Cost { bytes: 0.0, pairs: 0.0 },
    make: None,
};

table! {
    /// Every pass, in the order in which they run.
    PASSES: Pass;

    SORT = Pass {
        name: Name("sort"),
        when: |s| s.setup(),
        about: |_| "particles along a Morton curve".into(),
        cost: |s| s.cost([0.0, 8.0 * s.facts.dim as f64 + 4.0], 0.0),
        ..PLAIN
    };
    DENSITY = Pass {
        name: Name("density"),
        when: |s| s.setup_if(s.facts.finds_h || s.facts.sums_rho),
        about: |s| if s.facts.finds_h { "rho and h together" } else { "rho by summation" }.into(),
        cost: |s| s.cost([0.0, 16.0], 1.0),
        ..PLAIN
    };
    WEIGHTS = Pass {
        name: Name("weights"),
        when: |s| s.setup(),
        about: |s| {
            let evaluations = if s.leaves_out(&rules::SAME_H) { "one kernel evaluation" } else { "two kernel evaluations" };
            format!("{} w_ab, {evaluations} per pair", s.facts.operator)
        },
        cost: |s| s.cost(s.choices.operator.bytes_of_pairs(), 1.0),
        make: Some(State::make_weights),
    };
    JOIN = Pass {
        name: Name("join"),
        when: |s| s.setup_if(s.choices.operator.joins_rows()),
        about: |s| match s.choices.operator.join {
            Join::Pairs => "normalised pairs beside free surfaces".into(),
            _ => {
                let left = s.facts.defect.map_or(String::new(), |d| format!("; conduction_defect {d:.1e}"));
                format!("moments of a Laplacian for all at once; memory for as long as it takes{left}")
            }
        },
        cost: |s| s.cost(s.choices.operator.bytes_to_project(s.facts.dim), if s.choices.operator.is_projected() { 30.0 } else { 1.0 }),
        make: Some(State::join_weights),
    };
    NORMALISE = Pass {
        name: Name("normalise"),
        when: |s| s.setup_if(s.choices.normalise != Normalise::No && !s.choices.operator.is_projected()),
        about: |s| s.choices.normalise.about().into(),
        cost: |s| s.cost([0.0, s.choices.normalise.bytes(s.facts.dim)], 1.0),
        make: Some(State::normalise_weights),
    };
    WALLS = Pass {
        name: Name("walls"),
        when: |s| s.setup_if(s.facts.walls),
        about: |_| "exchanges with particles of fixed T, completed by what lies behind them".into(),
        make: Some(State::complete_walls),
        ..PLAIN
    };
    SWEEPS = Pass {
        name: Name("sweeps"),
        when: |s| s.setup_if(s.facts.twice),
        about: |_| "slopes of gradient and divergence".into(),
        cost: |s| s.cost(s.choices.operator.bytes_of_sweeps(), 1.0),
        make: Some(State::make_sweeps),
    };
    TRUST = Pass {
        name: Name("trust"),
        when: |s| s.setup(),
        about: |_| "no weight is NaN, volumes fit distances, and a sample sees neighbours in all directions".into(),
        make: Some(State::trust_weights),
        ..PLAIN
    };
    FOLD = Pass {
        name: Name("fold"),
        when: |s| s.setup_if(s.folds()),
        about: |s| format!("{} mean of kappa into the weights", s.facts.mean.name()),
        cost: |s| s.cost([0.0; 2], 1.0),
        make: Some(State::fold_kappa),
    };
    RATE = Pass {
        name: Name("rate"),
        when: |s| (!s.moves_t()).then_some(When::EachStep),
        about: |_| "du/dt for a host that integrates itself".into(),
        cost: |s| s.cost([0.0; 2], 1.0),
        ..PLAIN
    };
    CIRCLES = Pass {
        name: Name("circles"),
        when: |s| if s.facts.kappa_of_t { Some(When::EachStep) } else { s.setup() }.filter(|_| s.moves_t()),
        about: |_| "Gershgorin's circles: a bound on every rate".into(),
        cost: |s| s.cost([0.0; 2], 1.0),
        ..PLAIN
    };
    BOUND = Pass {
        name: Name("bound"),
        when: |s| (CIRCLES.when)(s).filter(|_| !s.facts.implicit),
        about: |_| "Lanczos' method, where it saves stages".into(),
        cost: |s| s.cost([0.0; 2], 1.0),
        ..PLAIN
    };
    SPECTRUM = Pass {
        name: Name("spectrum"),
        when: |s| s.setup_if(s.moves_t() && !s.leaves_out(&rules::DECAYS) && !s.facts.kappa_of_t),
        about: |_| "Arnoldi's method: refused where a mode grows".into(),
        cost: |s| s.cost([0.0, 320.0], 40.0),
        ..PLAIN
    };
    WATCH = Pass {
        name: Name("watch"),
        when: |s| (s.moves_t() && s.facts.watched).then_some(When::EachStep),
        about: |s| format!("the host's functions at {} times of a step, and between where they change", s.choices.looks),
        ..PLAIN
    };
    KAPPA = Pass {
        name: Name("kappa"),
        when: |s| each_stage(s.moves_t() && s.facts.kappa_of_t),
        about: |_| "kappa(T)".into(),
        cost: |s| s.cost([0.0, 8.0], 0.0),
        ..PLAIN
    };
    SOLVE = Pass {
        name: Name("solve"),
        when: |s| each_stage(s.moves_t() && s.facts.implicit),
        about: |s| s.motion(&format!("conjugate gradients on rows of weights; {}", s.facts.preconditioning.about)),
        cost: |s| s.cost([0.0, 8.0 * s.facts.buffers], 1.0),
        ..PLAIN
    };
    STAGES = Pass {
        name: Name("stages"),
        when: |s| each_stage(s.moves_t() && !s.facts.implicit),
        about: |s| s.motion("rows of weights"),
        cost: |s| s.cost([0.0, 8.0 * s.facts.buffers], 1.0),
        ..PLAIN
    };
    SURFACE = Pass {
        name: Name("surface"),
        when: |s| each_stage(!s.leaves_out(&rules::NO_WALL)),
        about: |_| "exchange with the outside".into(),
        cost: |s| Cost { bytes: 48.0 * s.facts.exchanging as f64, pairs: 0.0 },
        ..PLAIN
    };
    SOURCE = Pass {
        name: Name("source"),
        when: |s| each_stage(!s.leaves_out(&rules::NO_SOURCE)),
        about: |_| "heat released in the volume".into(),
        cost: |s| s.cost([0.0, 8.0], 0.0),
        ..PLAIN
    };
    NORM = Pass {
        name: Name("norm"),
        when: |s| (s.moves_t() && !s.leaves_out(&rules::POSITIVE)).then_some(When::EachStep),
        about: |_| "of T before and after: no growth".into(),
        ..PLAIN
    };
    CHECK = Pass {
        name: Name("check"),
        when: |s| s.moves_t().then_some(When::EachStep),
        about: |s| if s.facts.keeps_bounds { "finite, within the bounds of before" } else { "finite" }.into(),
        ..PLAIN
    };
    COMMIT = Pass {
        name: Name("commit"),
        when: |s| s.moves_t().then_some(When::EachStep),
        about: |_| "the new state replaces the old".into(),
        ..PLAIN
    };
}
