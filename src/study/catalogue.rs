//! Studies of the library itself, by name: `diffusph study NAME`. Add a study here.

use super::page::Page;
use super::run::Watch;
use super::{accuracy, claims, convergence, kernels, peers, positivity, sod, stability, work};
use crate::error::{Error, Result};
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

/// One row of [`STUDIES`].
pub struct Entry {
    pub name: &'static str,
    pub about: &'static str,
    /// Whether it can be of a scene of the user's own.
    pub takes_scene: bool,
    pub run: fn(Request) -> Result<Answer>,
}

/// Every study.
pub static STUDIES: &[Entry] = &[
    Entry {
        name: "stability",
        about: "62 cases that break solvers, for every method where they apply: required, seen, pass or fail",
        takes_scene: false,
        run: stability::answer,
    },
    Entry {
        name: "accuracy",
        about: "errors of a decaying mode for the choices that matter, medians over seeds: the figures of the README",
        takes_scene: false,
        run: |request| answer(accuracy::run(request)?),
    },
    Entry {
        name: "convergence",
        about: "error of a decaying mode against resolution, for every operator, on lattices and disordered particles",
        takes_scene: false,
        run: |request| answer(convergence::run(request)?),
    },
    Entry {
        name: "kernels",
        about: "second and first moment against h_fac for every kernel and operator, and the sweet spots",
        takes_scene: false,
        run: |request| answer(kernels::run(request)?),
    },
    Entry {
        name: "positivity",
        about: "pairs whose anisotropic weight is negative, and the anisotropy that is stable",
        takes_scene: false,
        run: |request| answer(positivity::run(request)?),
    },
    Entry {
        name: "sod",
        about: "density error of the shock tube against h_fac for every kernel, 1-D and 3-D",
        takes_scene: false,
        run: |request| answer(sod::run(request)?),
    },
    Entry {
        name: "work-precision",
        about: "error against run time and pair operations, for operator, kernel, h_fac, integrator and resolution",
        takes_scene: true,
        run: |request| answer(work::run(request)?),
    },
    Entry {
        name: "peers",
        about: "other codes on the same particles, where python3 has them: their error and run time beside ours",
        takes_scene: false,
        run: |request| answer(peers::run(request)?),
    },
    Entry {
        name: "claims",
        about: "four sentences of Biriukov & Price, each held against numbers",
        takes_scene: false,
        run: |request| answer(claims::run(request)?),
    },
];

fn answer(page: Page) -> Result<Answer> {
    let json = serde_json::to_value(&page).map_err(|e| Error::bad("--json", e, "report this, please"))?;
    Ok(Answer { text: page.text(), json, failures: 0, files: page.files()?, stopped: !page.complete })
}

/// The study of this name.
///
/// # Errors
/// `UnknownWord` with the known ones.
pub fn find(name: &str) -> Result<&'static Entry> {
    let found = STUDIES.iter().find(|s| s.name == name);
    found.ok_or_else(|| Error::unknown("study", name, STUDIES.iter().map(|s| s.name)))
}
