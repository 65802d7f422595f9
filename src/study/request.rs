//! What a study is asked for, and what it answers.

use super::run::Watch;
use std::path::PathBuf;

/// What a study is asked for.
pub struct Request {
    /// More particles than a minute allows.
    pub full: bool,
    /// As few as show that it works.
    pub tiny: bool,
    /// The user's own scene, for studies of one.
    pub scene: Option<PathBuf>,
    /// Told the share that is done; false stops the study.
    pub watch: Watch,
}

impl Request {
    /// The one for the size that was asked for.
    pub fn pick<T>(&self, tiny: T, quick: T, full: T) -> T {
        match (self.tiny, self.full) {
            (true, _) => tiny,
            (_, true) => full,
            _ => quick,
        }
    }

    /// Done so much of so much; whether to go on.
    pub fn goes_on(&mut self, done: usize, all: usize) -> bool {
        (self.watch)(done as f64 / all.max(1) as f64)
    }
}

/// What a study answers: the same for people and for programs.
#[derive(Default)]
pub struct Answer {
    pub text: String,
    pub json: serde_json::Value,
    /// How many findings are not as they should be.
    pub failures: usize,
    /// Names and contents of further files: pages, tables.
    pub files: Vec<(String, String)>,
    /// It was stopped, and answers what it had.
    pub stopped: bool,
}
