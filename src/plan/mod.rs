//! From a scene to a list of passes: what runs, what was left out and why, in what memory.

/// Makes a constant of each row, and the table of all: a row exists once, and code names it by its constant.
macro_rules! table {
    ($(#[$about:meta])* $table:ident: $type:ty; $($constant:ident = $row:expr;)*) => {
        $(pub static $constant: $type = $row;)*

        $(#[$about])*
        pub static $table: &[&$type] = &[$(&$constant),*];
    };
}

pub mod applies;
pub mod auto;
pub mod choices;
pub mod facts;
mod geometry;
pub mod given;
pub mod input;
mod known;
pub mod motion;
pub mod passes;
pub mod preconditioner;
pub mod prepare;
pub mod report;
mod room;
pub mod rules;
pub mod run;
mod sample;
pub mod state;
mod watch;
mod weights;

pub use choices::Choices;
pub use facts::Facts;
pub use report::Report;
pub use state::State;

use passes::{Cost, PASSES, Pass, Scene, When};
use rules::{RULES, Rule};
use std::fmt;

/// A pass in the plan of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    pub pass: &'static Pass,
    pub about: String,
    pub when: When,
    pub cost: Cost,
}

/// What a scene compiles to.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    pub title: String,
    pub passes: Vec<Line>,
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
        let scene = Scene { choices, facts, left_out: &left_out };
        let line = |pass: &'static Pass| {
            (pass.when)(&scene).map(|when| Line { pass, about: (pass.about)(&scene), when, cost: (pass.cost)(&scene) })
        };
        let passes = PASSES.iter().copied().filter_map(line).collect();
        Plan { title: facts.title(choices), passes, left_out, disabled, notes: notes(facts) }
    }

    /// Whether a rule holds here and is not switched off.
    pub fn leaves_out(&self, rule: &Rule) -> bool {
        self.left_out.contains(&rule)
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
            let (bytes, pairs) = (size(pass.cost.bytes, "B"), size(pass.cost.pairs, " pairs"));
            let line = format!("  {when:<11}{:<10}{bytes:>9} {pairs:>12}  {}", pass.pass.name.0, pass.about);
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
