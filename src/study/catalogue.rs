//! Studies of the library itself, by name: `diffusph study NAME`. Add a study here.

use super::page::Page;
use super::request::{Answer, Request};
use super::{accuracy, claims, convergence, kernels, peers, positivity, sod, stability, work};
use crate::error::{Error, Result};

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
