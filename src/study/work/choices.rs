//! What can be chosen for a scene: operator, kernel, h_fac, integrator, resolution.

use crate::integrator::{METHODS, find};
use crate::kernel::{self, Kernel};
use crate::model::fields::{FIELDS, TENSOR};
use crate::operator::Operator;
use crate::operator::table::OPERATORS;
use crate::plan::applies::fitting;
use crate::study::mode::isotropic;
use crate::study::request::Request;
use crate::study::scene::Scene;
use crate::words::replaced;
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
    let kernels = request.pick(vec!["M4", "M6"], vec!["M4", "M6", "C2"], kernel::catalogue().map(|k| k.0).collect());
    let some = vec!["ssprk2", "rkl2", "crank-nicolson"];
    let methods = request.pick(vec!["rkl2"], some, METHODS.iter().map(|m| m.name).collect());
    // In units of a kernel's default.
    let h_facs: &[f64] = request.pick(&[1.0], &[1.0, 1.25], &[0.8, 0.9, 1.0, 1.125, 1.25, 1.5]);
    let mut all = Vec::new();
    for operator in operators(scene, request.full) {
        for &kernel in &kernels {
            let default = Kernel::new(kernel, 1).map_or(1.0, |k| k.h_fac());
            for h_fac in h_facs.iter().map(|h| (100.0 * h * default).round() / 100.0) {
                // Implicit methods are for operators that can be solved for.
                let able = |method: &&&str| operator.dissipative || find(method).is_ok_and(|m| !m.is_implicit());
                for &integrator in methods.iter().filter(able) {
                    let one = |n: &Option<u32>| Choice { operator: operator.name, kernel, h_fac, integrator, n: *n };
                    all.extend(sizes.iter().map(one));
                }
            }
        }
    }
    all
}

/// Whether a scene sets a tensor conductivity.
pub fn has_tensor(scene: &Scene) -> bool {
    let mut set = scene.set.keys().chain(scene.mark.iter().flat_map(|mark| mark.set.keys()));
    set.any(|name| TENSOR.map(|slot| FIELDS[slot].name).any(|of_tensor| of_tensor == name))
}

/// Those that can take the scene's conductivity; of a number, a quick study leaves out those that are made for tensors.
fn operators(scene: &Scene, full: bool) -> Vec<&'static Operator> {
    match has_tensor(scene) {
        true => OPERATORS.iter().filter(|o| o.takes_tensors).collect(),
        false => isotropic().filter(|o| full || !o.takes_tensors).collect(),
    }
}

impl Choice {
    /// The scene with this choice in place of its own; what an operator is normalised by is the operator's own.
    pub fn put_into(&self, scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        let Choice { operator, kernel, h_fac, integrator, n } = self;
        let words = format!("operator={operator} kernel={kernel} h_fac={h_fac} integrator={integrator}");
        scene.words = fitting(&replaced(&scene.words, &words, &["normalise"]));
        scene.particles.n = *n;
        scene
    }
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Choice { operator, kernel, h_fac, integrator, n } = self;
        write!(f, "{operator}, {kernel} at h_fac {h_fac}, {integrator}")?;
        n.map_or(Ok(()), |n| write!(f, ", n = {n}"))
    }
}
