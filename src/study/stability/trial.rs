//! The words that a case is tried with, and what is expected of them.

use crate::integrator::{self, METHODS};
use crate::operator::table;

/// What a trial must come to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Expect {
    Pass,
    /// It cannot pass by its nature, and why.
    Fail(&'static str),
    /// What the case is about does not exist yet: what is missing.
    Absent(&'static str),
}

#[derive(Debug, Clone)]
pub struct Trial {
    /// Of the solver; none for the default method.
    pub words: String,
    pub expect: Expect,
}

impl Trial {
    /// Words that must pass.
    pub fn pass(words: &str) -> Trial {
        Trial { words: words.into(), expect: Expect::Pass }
    }

    /// Words that cannot pass, and why.
    pub fn fail(words: &str, why: &'static str) -> Trial {
        Trial { words: words.into(), expect: Expect::Fail(why) }
    }

    /// A case that has to wait for what is missing.
    pub fn absent(missing: &'static str) -> Trial {
        Trial { words: String::new(), expect: Expect::Absent(missing) }
    }

    /// Whether there is nothing to try: the case waits for a model, or its operator is not there.
    pub fn is_absent(&self) -> bool {
        matches!(self.expect, Expect::Absent(_)) || self.unknown_operator().is_some()
    }

    /// The operator of the words, if this library does not have it.
    pub fn unknown_operator(&self) -> Option<&str> {
        value(&self.words, "operator").filter(|name| table::find(name).is_err())
    }
}

/// The value of a key among words.
pub fn value<'a>(words: &'a str, key: &str) -> Option<&'a str> {
    words.split_whitespace().filter_map(|word| word.split_once('=')).find(|(k, _)| *k == key).map(|(_, v)| v)
}

/// The method that words choose; none where it is chosen step by step.
pub fn method(words: &str) -> Option<&'static integrator::Method> {
    integrator::find(value(words, "integrator").unwrap_or("auto")).ok()
}

/// Every integrator for which `keep` holds.
pub fn integrators(keep: impl Fn(&integrator::Method) -> bool) -> Vec<Trial> {
    METHODS.iter().filter(|m| keep(m)).map(|m| Trial::pass(&format!("integrator={}", m.name))).collect()
}

/// Every integrator.
pub fn all() -> Vec<Trial> {
    integrators(|_| true)
}

/// Integrators that solve for their stages.
pub fn implicit() -> Vec<Trial> {
    integrators(|m| m.is_implicit())
}

/// Integrators whose long steps lose all short waves.
pub fn l_stable() -> Vec<Trial> {
    integrators(|m| m.is_implicit() && m.name != "crank-nicolson")
}

/// The positive operators, with more words.
pub fn positive(more: &str) -> Vec<Trial> {
    ["brookshaw", "kernel"].map(|name| Trial::pass(format!("operator={name} {more}").trim())).to_vec()
}

/// All scalar operators, of which `direct` must pass too.
pub fn operators(more: &str) -> Vec<Trial> {
    [positive(more), vec![Trial::pass(format!("operator=direct allow=unstable {more}").trim())]].concat()
}
