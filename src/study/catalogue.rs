//! Studies of the library itself, by name: `diffusph study NAME`. Add a study here.

use super::run::Watch;
use super::stability;
use crate::error::{Error, Result};

/// What a study is asked for.
pub struct Request {
    /// More particles than a minute allows.
    pub full: bool,
    /// Told the share that is done; false stops the study.
    pub watch: Watch,
}

/// What a study answers: the same for people and for programs.
pub struct Answer {
    pub text: String,
    pub json: serde_json::Value,
    /// How many findings are not as they should be.
    pub failures: usize,
}

/// One row of [`STUDIES`].
pub struct Entry {
    pub name: &'static str,
    pub about: &'static str,
    pub run: fn(Request) -> Result<Answer>,
}

/// Every study.
pub static STUDIES: &[Entry] = &[Entry {
    name: "stability",
    about: "62 cases that break solvers, for every method where they apply: required, seen, pass or fail",
    run: stability::answer,
}];

/// The study of this name.
///
/// # Errors
/// `UnknownWord` with the known ones.
pub fn find(name: &str) -> Result<&'static Entry> {
    let found = STUDIES.iter().find(|s| s.name == name);
    found.ok_or_else(|| Error::unknown("study", name, STUDIES.iter().map(|s| s.name)))
}
