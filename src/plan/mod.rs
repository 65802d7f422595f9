//! From a scene to a list of passes: what runs, what was left out and why, in what memory.

pub mod applies;
pub mod auto;
pub mod choices;
pub mod facts;
pub mod given;
pub mod input;
pub mod motion;
pub mod preconditioner;
pub mod prepare;
pub mod report;
mod room;
pub mod rules;
pub mod run;
pub mod state;

pub use choices::Choices;
pub use facts::Facts;
pub use report::Report;
pub use state::State;

use crate::operator::Normalise;
use rules::{RULES, Rule};
use std::fmt;

/// How often a pass runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum When {
    Once,
    EachStep,
    EachStage,
}

/// One pass of the plan, with what it holds and touches.
#[derive(Debug, Clone, PartialEq)]
pub struct Pass {
    pub name: &'static str,
    pub about: String,
    pub when: When,
    /// Memory that the pass's product holds.
    pub bytes: f64,
    /// Pairs that it visits, both directions counted.
    pub pairs: f64,
}

/// What a scene compiles to.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    pub title: String,
    pub passes: Vec<Pass>,
    /// Rules that hold for this scene: what they leave out is not done.
    pub left_out: Vec<&'static Rule>,
    /// Rules that would hold, switched off by `without=`.
    pub disabled: Vec<&'static Rule>,
    /// What a host should know before it believes the answer.
    pub notes: Vec<String>,
}

/// Of the particles beside ones that conduct much better: the share that pairs may reach over without a word. Corners of
/// thick bodies are less.
const BYPASSED: f64 = 0.1;

impl Plan {
    /// Compiles the plan of a scene.
    pub fn new(choices: &Choices, facts: &Facts) -> Plan {
        let (disabled, left_out): (Vec<_>, Vec<_>) =
            RULES.iter().copied().filter(|r| (r.holds)(facts)).partition(|r| choices.without(r));
        let mut plan =
            Plan { title: facts.title(choices), passes: Vec::new(), left_out, disabled, notes: notes(facts) };
        plan.passes = plan.list(choices, facts);
        plan
    }

    /// Whether a rule holds here and is not switched off.
    pub fn leaves_out(&self, rule: &Rule) -> bool {
        self.left_out.contains(&rule)
    }

    fn list(&self, choices: &Choices, facts: &Facts) -> Vec<Pass> {
        let (n, pairs) = (facts.n as f64, facts.n as f64 * facts.neighbours);
        let setup = if self.leaves_out(&rules::AT_REST) { When::Once } else { When::EachStep };
        let mut list = Vec::new();
        let mut add = |name, when, bytes, pairs, about: String| list.push(Pass { name, about, when, bytes, pairs });
        add("sort", setup, n * (8.0 * facts.dim as f64 + 4.0), 0.0, "particles along a Morton curve".into());
        if facts.finds_h || facts.sums_rho {
            let what = if facts.finds_h { "rho and h together" } else { "rho by summation" };
            add("density", setup, 16.0 * n, pairs, what.into());
        }
        let evaluations =
            if self.leaves_out(&rules::SAME_H) { "one kernel evaluation" } else { "two kernel evaluations" };
        let [kept_pair, kept] = choices.operator.bytes();
        add(
            "weights",
            setup,
            pairs * kept_pair + n * kept,
            pairs,
            format!("{} w_ab, {evaluations} per pair", facts.operator),
        );
        let [pair, particle] = choices.operator.bytes_to_project(facts.dim);
        if pair > 0.0 {
            let left = facts.defect.map_or(String::new(), |d| format!("; conduction_defect {d:.1e}"));
            let about = format!("moments of a Laplacian for all at once; memory for as long as it takes{left}");
            add("project", setup, pairs * pair + n * particle, 30.0 * pairs, about);
        }
        let normalise = choices.normalise;
        if normalise != Normalise::No && !choices.operator.is_projected() {
            add("normalise", setup, n * normalise.bytes(facts.dim), pairs, normalise.about().into());
        }
        if self.leaves_out(&rules::FROZEN) && !self.leaves_out(&rules::UNIFORM_KAPPA) {
            add("fold", setup, 0.0, pairs, format!("{} mean of kappa into the weights", facts.mean.name()));
        }
        if self.leaves_out(&rules::RATE_ONLY) {
            add("rate", When::EachStep, 0.0, pairs, "du/dt for a host that integrates itself".into());
        } else {
            self.list_motion(facts, setup, &mut add);
        }
        if !self.leaves_out(&rules::NO_WALL) {
            add("surface", When::EachStage, 48.0 * facts.exchanging as f64, 0.0, "exchange with the outside".into());
        }
        if !self.leaves_out(&rules::NO_SOURCE) {
            add("source", When::EachStage, 8.0 * n, 0.0, "heat released in the volume".into());
        }
        list
    }

    /// The passes that move T.
    fn list_motion(&self, facts: &Facts, setup: When, add: &mut impl FnMut(&'static str, When, f64, f64, String)) {
        let (n, pairs) = (facts.n as f64, facts.n as f64 * facts.neighbours);
        let bound_when = if facts.kappa_of_t { When::EachStep } else { setup };
        if !facts.implicit {
            let about = "Gershgorin's circles; power iteration where it saves stages";
            add("bound", bound_when, 0.0, pairs, about.into());
        }
        if !self.leaves_out(&rules::DECAYS) && !facts.kappa_of_t {
            add("spectrum", setup, 320.0 * n, 40.0 * pairs, "Arnoldi's method: refused where a mode grows".into());
        }
        if facts.kappa_of_t {
            add("kappa", When::EachStage, 8.0 * n, 0.0, "kappa(T)".into());
        }
        let (name, how) = match facts.implicit {
            true => ("solve", format!("conjugate gradients on rows of weights; {}", facts.preconditioning.about)),
            false => ("stages", "rows of weights".into()),
        };
        let about = match &facts.auto {
            Some(reason) => format!("auto: {reason}; {how}"),
            None => format!("{}: {how}", facts.integrator),
        };
        add(name, When::EachStage, facts.buffers * 8.0 * n, pairs, about);
        let mut promises = vec!["finite"];
        if facts.keeps_bounds {
            promises.push("within the bounds of before");
        }
        if !self.leaves_out(&rules::POSITIVE) {
            promises.push("no growth");
        }
        add("check", When::EachStep, 0.0, 0.0, promises.join(", "));
        add("commit", When::EachStep, 0.0, 0.0, "the new state replaces the old".into());
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        writeln!(f, "{}", self.title)?;
        for pass in &self.passes {
            let when = match pass.when {
                When::Once => "once",
                When::EachStep => "each step",
                When::EachStage => "each stage",
            };
            let size = |v: f64, unit: &str| if v == 0.0 { String::new() } else { format!("{}{unit}", readable(v)) };
            let (bytes, pairs) = (size(pass.bytes, "B"), size(pass.pairs, " pairs"));
            let line = format!("  {when:<11}{:<10}{bytes:>9} {pairs:>12}  {}", pass.name, pass.about);
            writeln!(f, "{}", line.trim_end())?;
        }
        let mut section = |title: &str, rules: &[&Rule]| -> fmt::Result {
            if rules.is_empty() {
                return Ok(());
            }
            writeln!(f, "{title}")?;
            for rule in rules {
                writeln!(f, "  {:<14}{} ({})", rule.name, rule.reason, rule.same)?;
            }
            Ok(())
        };
        section("left out", &self.left_out)?;
        section("could be left out, but without= says no", &self.disabled)?;
        self.notes.iter().try_for_each(|note| writeln!(f, "note: {note}"))
    }
}

fn notes(facts: &Facts) -> Vec<String> {
    let (beside, over) = facts.bypassed;
    let thin = over as f64 > BYPASSED * beside as f64;
    let layers = || {
        format!(
            "{over} particles lie in layers so thin that pairs of particles which conduct ten times better reach over \
             them: too much heat passes; such a layer must be thicker than a support (more particles, or a smaller h_fac)"
        )
    };
    thin.then(layers).into_iter().collect()
}

/// 1234567 as `1.2 M`.
pub fn readable(v: f64) -> String {
    let scales = [(1e12, " T"), (1e9, " G"), (1e6, " M"), (1e3, " k")];
    match scales.iter().find(|(scale, _)| v >= *scale) {
        Some((scale, unit)) => format!("{:.1}{unit}", v / scale),
        None => format!("{v:.0} "),
    }
}
