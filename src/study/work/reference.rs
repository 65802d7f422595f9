//! What errors are measured against: the scene's exact solution, or where it names none a run with many more particles.

use super::choices::Choice;
use crate::error::{Error, Result};
use crate::study::run::{Field, Study};
use crate::study::scene::Scene;
use std::path::Path;
use std::sync::Arc;

pub enum Reference {
    Exact,
    Finest(Arc<Field>),
}

impl Reference {
    /// # Errors
    /// `BadValue` for particles from a file without an exact solution: there is nothing finer.
    pub fn of(scene: &Scene, folder: &Path, choices: &[Choice]) -> Result<Reference> {
        if scene.exact.is_some() {
            return Ok(Reference::Exact);
        }
        let Some(n) = choices.iter().filter_map(|c| c.n).max() else {
            let rule =
                "particles from a file need an [exact] solution, or a lattice in their place: nothing finer is known";
            return Err(Error::bad("--scene", "without a reference", rule));
        };
        let mut finest = scene.clone();
        finest.particles.n = Some(2 * n);
        Ok(Reference::Finest(Arc::new(Study::new(finest, folder)?.field()?)))
    }

    /// The study, with this to be held against.
    pub fn known_to(&self, study: Study) -> Study {
        match self {
            Reference::Exact => study,
            Reference::Finest(field) => {
                let field = Arc::clone(field);
                study.against("twice the particles", Box::new(move |x, _| field.at(x)))
            }
        }
    }
}
