//! Words that can have no effect beside the others of their line: they are refused, since who wrote them expects one. A
//! word that says what is so anyway, like `normalise=none` of an operator that has nothing to normalise, is fine.

use super::Choices;
use crate::error::{Error, Result};

struct Row {
    word: &'static str,
    /// Whether the word with this value does something, or says what is so.
    applies: fn(&Choices, value: &str) -> bool,
    /// What it needs, as the error says it.
    needs: &'static str,
}

fn has_stages(c: &Choices) -> bool {
    c.auto.is_some() || c.method.is_stabilised()
}

/// Of `auto`, which solves only where the operator lets it.
fn solves(c: &Choices) -> bool {
    c.method.is_implicit() || (c.auto.is_some() && c.operator.dissipative)
}

fn gives_stages(c: &Choices) -> bool {
    c.options.stages.is_some()
}

fn is_twice(c: &Choices) -> bool {
    !c.operator.is_one_matrix()
}

const SOLVES: &str =
    "backward-euler, crank-nicolson or sdirk2, or integrator=auto with an operator that can be solved for";

#[rustfmt::skip]
static ROWS: &[Row] = &[
    Row { word: "order", applies: |c, _| c.operator.is_exact(), needs: "operator=consistent" },
    Row { word: "theta", applies: |c, _| is_twice(c), needs: "operator=two-first or limited" },
    Row { word: "gradient", applies: |c, _| is_twice(c), needs: "operator=two-first or limited" },
    Row { word: "allow", applies: |c, v| !says(v, "unstable") || !(c.operator.positive || c.operator.dissipative),
          needs: "for 'unstable' an operator that may have growing modes: direct, consistent or espanol-revenga" },
    Row { word: "allow", applies: |c, v| !says(v, "energy") || !c.operator.conserves,
          needs: "for 'energy' operator=consistent" },
    Row { word: "allow", applies: |c, v| !says(v, "flat") || c.kernel.dim() > 1, needs: "for 'flat' dim=2 or 3" },
    Row { word: "normalise", applies: |c, v| says(v, "none") || !c.operator.is_exact(),
          needs: "an operator whose weights are not exact already" },
    Row { word: "stages", applies: |c, _| has_stages(c), needs: "integrator=rkl1, rkl2 or auto" },
    Row { word: "max_stages", applies: |c, _| has_stages(c), needs: "integrator=rkl1, rkl2 or auto" },
    Row { word: "max_stages", applies: |c, _| !gives_stages(c), needs: "stages that are not pinned by stages=" },
    Row { word: "change", applies: |c, _| has_stages(c), needs: "integrator=rkl1, rkl2 or auto" },
    Row { word: "change", applies: |c, _| c.change.is_infinite() || !gives_stages(c), needs: "stages that are not pinned by stages=" },
    Row { word: "change", applies: |c, _| c.change.is_infinite() || c.tolerance.is_none(),
          needs: "tolerance=off: where there is a tolerance, as integrator=auto has, it decides on the sub-steps" },
    Row { word: "solver_tolerance", applies: |c, _| solves(c), needs: SOLVES },
    Row { word: "max_iterations", applies: |c, _| solves(c), needs: SOLVES },
    Row { word: "preconditioner", applies: |c, _| solves(c), needs: SOLVES },
];

/// Whether a value, which may be a list, has this word.
fn says(value: &str, word: &str) -> bool {
    value.split(',').any(|part| part.eq_ignore_ascii_case(word))
}

/// The first word of the line without effect, as key and value, and what it needs.
fn idle(choices: &Choices) -> Option<(&str, &str, &'static str)> {
    let pairs = choices.line.split_whitespace().filter_map(|word| word.split_once('='));
    pairs
        .flat_map(|(key, value)| ROWS.iter().filter(move |row| row.word == key).map(move |row| (row, value)))
        .find(|(row, value)| !(row.applies)(choices, value))
        .map(|(row, value)| (row.word, value, row.needs))
}

/// Refuses words that have no effect.
///
/// # Errors
/// `BadValue` naming the first and what it needs.
pub fn check(choices: &Choices) -> Result<()> {
    match idle(choices) {
        None => Ok(()),
        Some((key, value, needs)) => Err(Error::bad(
            key,
            value,
            &format!("it has no effect here: it needs {needs}; leave it out, or change that"),
        )),
    }
}

/// A line that has been made from another by changing some words, without those that have lost their effect. What is wrong
/// with it otherwise, who creates a solver from it will be told.
pub fn fitting(line: &str) -> String {
    let mut line = line.to_string();
    while let Ok(choices) = Choices::parse_any(&line) {
        match idle(&choices) {
            None => break,
            Some((key, value, _)) => {
                // Of a list, only what has lost its effect goes.
                let of_key = || ROWS.iter().filter(|row| row.word == key);
                let stays = |part: &&str| of_key().all(|row| (row.applies)(&choices, part));
                let rest = value.split(',').filter(stays).collect::<Vec<_>>().join(",");
                let word = if rest.is_empty() { String::new() } else { format!("{key}={rest}") };
                line = crate::words::replaced(&line, &word, &[key]);
            }
        }
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::choices::WORDS;

    fn complaint(line: &str) -> String {
        Choices::parse(&format!("heat {line}")).err().map(|e| e.to_string()).unwrap_or_default()
    }

    #[test]
    fn a_word_without_effect_is_refused_with_what_it_needs() {
        for (line, word, needs) in [
            ("order=4", "order", "operator=consistent"),
            ("operator=projected order=2", "order", "operator=consistent"),
            ("theta=0.5", "theta", "two-first"),
            ("operator=monotone gradient=plain", "gradient", "two-first"),
            ("allow=unstable", "allow", "direct"),
            ("dim=1 allow=flat", "allow", "dim=2 or 3"),
            ("allow=energy", "allow", "operator=consistent"),
            ("operator=consistent normalise=pair", "normalise", "exact already"),
            ("integrator=euler stages=5", "stages", "rkl1"),
            ("integrator=sdirk2 max_stages=5", "max_stages", "rkl1"),
            ("integrator=rkl2 stages=5 max_stages=9", "max_stages", "pinned"),
            ("integrator=rk4 change=0.1", "change", "rkl1"),
            ("integrator=rkl2 stages=5 change=0.1", "change", "pinned"),
            ("integrator=rkl2 tolerance=1e-3 change=0.1", "change", "tolerance=off"),
            ("integrator=auto change=0.1", "change", "tolerance=off"),
            ("integrator=rkl2 solver_tolerance=1e-9", "solver_tolerance", "sdirk2"),
            ("integrator=ssprk3 max_iterations=9", "max_iterations", "sdirk2"),
            ("integrator=euler preconditioner=jacobi", "preconditioner", "sdirk2"),
            ("integrator=auto operator=direct preconditioner=jacobi", "preconditioner", "sdirk2"),
        ] {
            let text = complaint(line);
            assert!(text.starts_with(&format!("{word} is ")) && text.contains(needs), "{line}: {text}");
        }
        // Each row has been seen to refuse.
        assert!(ROWS.iter().all(|row| WORDS.iter().any(|(word, _)| *word == row.word)));
    }

    #[test]
    fn a_word_that_says_what_is_so_or_may_serve_is_fine() {
        for line in [
            "operator=consistent normalise=none",
            "operator=projected normalise=pair",
            "integrator=rkl2 tolerance=1e-3 change=inf",
            "integrator=auto stages=5",
            "integrator=auto max_stages=9 solver_tolerance=1e-9 preconditioner=multigrid",
            "integrator=auto tolerance=off change=0.1",
            "operator=direct normalise=none bounds=free tolerance=off",
            "operator=consistent allow=unstable,flat",
        ] {
            assert_eq!(complaint(line), "", "{line}");
        }
    }

    #[test]
    fn a_changed_line_loses_what_it_has_no_use_for() {
        let line = "heat dim=2 integrator=sdirk2 operator=brookshaw order=4 theta=1 preconditioner=jacobi stages=3";
        assert_eq!(fitting(line), "heat dim=2 integrator=sdirk2 operator=brookshaw preconditioner=jacobi");
        assert_eq!(fitting("heat allow=unstable,flat"), "heat allow=flat");
        assert_eq!(fitting("heat kernl=M4"), "heat kernl=M4");
    }
}
