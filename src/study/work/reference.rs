//! What errors are measured against: the scene's exact solution; where it names none, a run of twice the resolution; for
//! particles from a file, which have no other resolution, weights of higher order on the same particles. Of the last two
//! it is known what they may be wrong by.

use super::choices::{Choice, has_tensor};
use crate::error::{Error, Result};
use crate::plan::applies::fitting;
use crate::solver::recommend;
use crate::study::run::{Field, Known, Study};
use crate::study::scene::Scene;
use crate::study::setup::setup;
use crate::sum::l2;
use crate::words::replaced;
use std::cell::RefCell;
use std::collections::HashMap;
use std::path::Path;
use std::rc::Rc;

/// Resolutions of a reference, in units of the finest that is tried, each this many times the one before.
const RATIO: f64 = std::f64::consts::SQRT_2;

/// Error in time of a sub-step of a reference, relative to the spread of T.
const EXACT_IN_TIME: f64 = 1e-6;

pub enum Reference {
    Exact,
    Finer {
        field: Field,
        error: f64,
        /// Values at the particles of resolutions that were asked for.
        at: RefCell<HashMap<Option<u32>, Rc<Vec<f64>>>>,
    },
    Same {
        t: Rc<Vec<f64>>,
        error: f64,
        about: String,
    },
}

impl Reference {
    /// # Errors
    /// Of the scene, or of the runs that make it; `BadValue` for a tensor kappa on particles from a file.
    pub fn of(scene: &Scene, folder: &Path, choices: &[Choice]) -> Result<Reference> {
        if scene.exact.is_some() {
            return Ok(Reference::Exact);
        }
        match choices.iter().filter_map(|c| c.n).max() {
            Some(n) => finer(scene, folder, n),
            None => {
                let (mut solver, _) = setup(scene, folder)?;
                let dt = scene.time.end - solver.get_number("time")?;
                let recommend::Reference { t, error, about } =
                    recommend::Reference::of(&mut solver, dt, EXACT_IN_TIME)?;
                Ok(Reference::Same { t: Rc::new(t), error, about: format!("{about} on the same particles") })
            }
        }
    }

    /// What it is, and what it may itself be wrong by.
    pub fn about(&self) -> Option<(&str, f64)> {
        match self {
            Reference::Exact => None,
            Reference::Finer { error, .. } => Some(("twice the resolution", *error)),
            Reference::Same { error, about, .. } => Some((about, *error)),
        }
    }

    /// The study, with this to be held against.
    ///
    /// # Errors
    /// As [`Study::places`].
    pub fn known_to(&self, mut study: Study, choice: &Choice) -> Result<Study> {
        let (Some((name, _)), Some(values)) = (self.about(), self.values(&mut study, choice)?) else {
            return Ok(study);
        };
        Ok(study.against(name, Known::Values(values)))
    }

    fn values(&self, study: &mut Study, choice: &Choice) -> Result<Option<Rc<Vec<f64>>>> {
        match self {
            Reference::Exact => Ok(None),
            Reference::Same { t, .. } => Ok(Some(Rc::clone(t))),
            Reference::Finer { field, at, .. } => {
                if let Some(values) = at.borrow().get(&choice.n) {
                    return Ok(Some(Rc::clone(values)));
                }
                let values = Rc::new(study.places()?.into_iter().map(|x| field.at(x)).collect());
                at.borrow_mut().insert(choice.n, Rc::clone(&values));
                Ok(Some(values))
            }
        }
    }
}

/// The field of twice the resolution, and by Richardson's extrapolation from three of them what it is wrong by: with
/// differences d₁ and d₂ from each to the next the order is p = log(d₁/d₂)/log r, and the error of the last
/// d₂/(r^p − 1) (Roache 1994). Where the differences hardly fall, p is taken as 1/2.
fn finer(scene: &Scene, folder: &Path, n: u32) -> Result<Reference> {
    let mut coarse = Study::new(scene.clone(), folder)?;
    let own = format!("integrator=rkl2 tolerance={EXACT_IN_TIME:e}");
    // Weights that are fitted row by row know neither free surfaces nor jumps of kappa, however fine.
    let fitted = !has_tensor(scene) && recommend::is_smooth(&mut setup(scene, folder)?.0)?;
    let consistent = fitted.then(|| recommend::exact_words(coarse.dim(), 4, EXACT_IN_TIME));
    let places = coarse.places()?;
    let fields = |words: &str| (0..3).map(|power| level(scene, folder, n, power, words)).collect::<Result<Vec<_>>>();
    // What a scene asks for itself is second best: pairs do not converge on disorder.
    let fields = match consistent.transpose()?.map(|words| fields(&words)) {
        Some(Ok(found)) => found,
        Some(Err(e)) if !recommend::refused(&e) => return Err(e),
        _ => fields(&own)?,
    };
    let at = |field: &Field| places.iter().map(|x| field.at(*x)).collect::<Vec<f64>>();
    let differences: Vec<f64> =
        fields.windows(2).map(|pair| l2(&at(&pair[0]).into_iter().zip(at(&pair[1])).collect::<Vec<_>>())).collect();
    let (first, second) = (differences[0], differences[1]);
    let fall = (first / second).max(RATIO.sqrt());
    let error = if second > 0.0 { second / (fall - 1.0) } else { 0.0 };
    let finest = fields.into_iter().last();
    finest.map(|field| Reference::Finer { field, error, at: RefCell::default() }).ok_or(Error::Cancelled)
}

/// The scene with `n` RATIO^power cells along its first axis and these words, at its end.
fn level(scene: &Scene, folder: &Path, n: u32, power: i32, words: &str) -> Result<Field> {
    let mut scene = scene.clone();
    scene.output = None;
    scene.particles.n = Some((f64::from(n) * RATIO.powi(power)).round() as u32);
    scene.words = fitting(&replaced(&scene.words, words, &["stages", "normalise"]));
    Study::new(scene, folder)?.field()
}
