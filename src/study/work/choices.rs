//! What can be chosen for a scene: operator, kernel, h_fac, integrator, resolution.

use crate::error::Result;
use crate::integrator::METHODS;
use crate::kernel::{self, Kernel};
use crate::study::catalogue::Request;
use crate::study::mode::isotropic;
use crate::study::scene::Scene;
use std::fmt;

#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    pub operator: &'static str,
    pub kernel: &'static str,
    pub h_fac: f64,
    pub integrator: &'static str,
    /// Cells of the lattice along the first axis; none for particles from a file.
    pub n: Option<u32>,
}

/// Every combination. Without sizes, those around the scene's own. A quick study takes a kernel of each kind, and an
/// explicit, a stabilised and an implicit method.
pub fn choices(scene: &Scene, sizes: &[u32], request: &Request) -> Vec<Choice> {
    let sizes: Vec<Option<u32>> = match (scene.particles.n, sizes) {
        (None, _) => vec![None],
        (Some(n), []) => [0.5, 0.75, 1.0].map(|s| Some((f64::from(n) * s).ceil() as u32)).into(),
        (Some(_), sizes) => sizes.iter().copied().map(Some).collect(),
    };
    let kernels =
        request.pick(vec!["M4", "M6"], vec!["M4", "M6", "C2", "C4"], kernel::catalogue().map(|k| k.0).collect());
    let some = vec!["ssprk2", "rkl2", "crank-nicolson"];
    let methods = request.pick(vec!["rkl2"], some, METHODS.iter().map(|m| m.name).collect());
    // In units of a kernel's default.
    let h_facs: &[f64] = request.pick(&[1.0], &[0.9, 1.0, 1.25], &[0.8, 0.9, 1.0, 1.125, 1.25, 1.5]);
    let mut all = Vec::new();
    for operator in isotropic() {
        for &kernel in &kernels {
            let default = Kernel::new(kernel, 1).map_or(1.0, |k| k.h_fac());
            for h_fac in h_facs.iter().map(|h| (100.0 * h * default).round() / 100.0) {
                for &integrator in &methods {
                    let one = |n: &Option<u32>| Choice { operator: operator.name, kernel, h_fac, integrator, n: *n };
                    all.extend(sizes.iter().map(one));
                }
            }
        }
    }
    all
}

impl Choice {
    /// The scene with this choice in place of its own.
    ///
    /// # Errors
    /// As [`Scene::set_word`].
    pub fn put_into(&self, scene: &Scene) -> Result<Scene> {
        let mut scene = scene.clone();
        let Choice { operator, kernel, h_fac, integrator, n } = self;
        for word in [
            format!("operator={operator}"),
            format!("kernel={kernel}"),
            format!("h_fac={h_fac}"),
            format!("integrator={integrator}"),
        ] {
            scene.set_word(&word)?;
        }
        // What an operator can be normalised by is its own default.
        let other = scene.words.split_whitespace().filter(|w| !w.starts_with("normalise="));
        scene.words = other.collect::<Vec<_>>().join(" ");
        scene.particles.n = *n;
        Ok(scene)
    }
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Choice { operator, kernel, h_fac, integrator, n } = self;
        write!(f, "{operator}, {kernel} at h_fac {h_fac}, {integrator}")?;
        n.map_or(Ok(()), |n| write!(f, ", n = {n}"))
    }
}
