//! The stability suite: cases that break solvers, as data, and a small runner that tries each of them with every method
//! where it applies.
//!
//! | file | what it holds |
//! |---|---|
//! | `mod` | what a case is, and the runner |
//! | `trial` | the words that a case is tried with |
//! | `seen` | what was measured, beside its bounds |
//! | `setting` | particles and solvers that several cases use |
//! | `table` | the rows as text and as JSON |
//! | `time`, `implicit` | steps of any length; what implicit solves promise |
//! | `material` | conductivities of every kind |
//! | `anisotropy` | conductivities that depend on direction |
//! | `disorder`, `extremes` | particles badly placed; sizes and units at the end of numbers |
//! | `limits` | boundaries, steady states, callers that are wrong |
//! | `missing` | cases of models that are not there |
//!
//! A case is a row of [`cases`]. What a method cannot do by its nature is a trial that is expected to fail, with the
//! reason; that it does fail is part of the suite.

mod anisotropy;
mod disorder;
mod extremes;
mod implicit;
mod limits;
mod material;
mod missing;
mod seen;
mod setting;
mod table;
mod time;
mod trial;

use super::batch;
use super::request::{Answer, Request};
use super::run::Watch;
use crate::error::Result;
pub use seen::Seen;
pub use setting::Setting;
pub use table::{Row, Verdict};
pub use trial::{Expect, Trial};

/// One row of the suite.
pub struct Case {
    pub number: u32,
    pub title: &'static str,
    /// What a correct solver must do.
    pub required: &'static str,
    /// Who met it before, where somebody did.
    pub source: &'static str,
    pub trials: fn() -> Vec<Trial>,
    /// Measures; an error is a failure, with its message as what was seen.
    pub check: fn(&Setting, &mut Seen) -> Result<()>,
}

/// Thread counts that must give the same bits.
const THREADS: [usize; 2] = [1, 3];

/// Every case in order of its number. Add a case to the list of its theme.
pub fn cases() -> Vec<&'static Case> {
    let themes = [
        time::CASES,
        material::CASES,
        anisotropy::CASES,
        disorder::CASES,
        extremes::CASES,
        missing::CASES,
        implicit::CASES,
        limits::CASES,
    ];
    let mut all: Vec<&Case> = themes.into_iter().flatten().collect();
    all.sort_by_key(|case| case.number);
    all
}

/// Tries every case with all its words, until `watch` says no; whether it came to the end is the second answer. `scale`
/// multiplies the number of particles along each axis.
///
/// # Errors
/// Where no threads can be had.
pub fn run(cases: &[&Case], scale: usize, watch: Watch) -> Result<(Vec<Row>, bool)> {
    control(cases, scale, 1.0, watch)
}

/// The same with solvers whose conductivity is `conducts` times what a case asks for: 0 for one that does nothing. What
/// passes then has criteria that do not see what they are about.
///
/// # Errors
/// As [`run`].
pub fn control(cases: &[&Case], scale: usize, conducts: f64, mut watch: Watch) -> Result<(Vec<Row>, bool)> {
    let todo: Vec<(&Case, Trial)> =
        cases.iter().flat_map(|case| (case.trials)().into_iter().map(|t| (*case, t))).collect();
    let row = |(case, trial): &(&Case, Trial)| Ok(Row::new(case, trial, attempt(case, trial, scale, conducts)));
    let rows = batch::map(&todo, row, |done| watch(done as f64 / todo.len() as f64))?;
    let complete = rows.len() == todo.len();
    Ok((rows, complete))
}

/// What was seen; none where the words are not known yet.
fn attempt(case: &Case, trial: &Trial, scale: usize, conducts: f64) -> Option<Seen> {
    if trial.is_absent() {
        return None;
    }
    let look = |threads: usize| {
        let mut seen = Seen::default();
        if let Err(e) = (case.check)(&Setting { words: trial.words.clone(), scale, threads, conducts }, &mut seen) {
            seen.require(&format!("an answer: {e}"), false);
        }
        seen
    };
    let [mut seen, other] = THREADS.map(look);
    if seen.bits != other.bits {
        seen.require("the same with more threads", false);
    }
    Some(seen)
}

/// The suite as a study.
///
/// # Errors
/// As [`table::answer`].
pub fn answer(request: Request) -> Result<Answer> {
    let (rows, complete) = run(&cases(), if request.full { 2 } else { 1 }, request.watch)?;
    Ok(Answer { stopped: !complete, ..table::answer(&rows)? })
}

#[cfg(test)]
mod tests;
