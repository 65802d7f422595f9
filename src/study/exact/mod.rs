//! Exact solutions as functions of place and time: one table, by name. Add a solution here.
//!
//! | file | what it holds |
//! |---|---|
//! | `space` | waves, Gaussians, contacts and fronts in a periodic box or in open space |
//! | `slab` | a slab with fixed, lossy, radiating and heated faces |
//! | `steady` | layers, cylinders, spheres; a body without inner resistance |
//! | `parameters` | what a scene gives a solution, with defaults |
//! | `numbers` | error function, roots |
//! | `laws`, `checks` | in tests: the equation, and what every solution is held against; one without a check is refused |

#[cfg(test)]
mod checks;
#[cfg(test)]
mod laws;
pub mod numbers;
mod parameters;
pub mod slab;
pub mod space;
pub mod steady;

pub use parameters::Parameters;

use crate::error::{Error, Result};
use crate::model::fields::SIGMA_SB;
use parameters::Given;
use std::collections::BTreeMap;

/// T at a place and a time.
pub type Exact = Box<dyn Fn([f64; 3], f64) -> f64>;

/// A parameter: its name, its default (none: it must be given), what it is.
type Parameter = (&'static str, Option<&'static [f64]>, &'static str);

/// An exact solution that a scene can be held against.
pub struct Solution {
    pub name: &'static str,
    pub about: &'static str,
    pub parameters: &'static [Parameter],
    make: fn(&Given) -> Result<Exact>,
}

const KAPPA: Parameter = ("kappa", None, "conductivity (default: that of [set])");
const RHO: Parameter = ("rho", Some(&[1.0]), "density (default: that of [set], or 1)");
const C_V: Parameter = ("c_v", Some(&[1.0]), "heat capacity per mass (default: that of [set], or 1)");
const MEAN: Parameter = ("mean", Some(&[0.0]), "T far away, or on average");
const AMPLITUDE: Parameter = ("amplitude", Some(&[1.0]), "height above the mean at time 0");
const CENTRE: Parameter = ("centre", Some(&[0.0, 0.0, 0.0]), "the middle, one number per axis");
const FACES: Parameter = ("x", None, "where the faces are");
const INITIAL: Parameter = ("initial", None, "T everywhere at time 0");
const FIXED: Parameter = ("fixed", None, "T of the first face");
const AMBIENT: Parameter = ("T_ambient", Some(&[0.0]), "T of the surroundings");
const BOTH: Parameter = ("T", None, "both temperatures");

pub static SOLUTIONS: &[Solution] = &[
    Solution {
        name: "sine",
        about: "mean + amplitude product of sin(k_i x_i) exp(-D k^2 t), over the axes with k_i not 0",
        parameters: &[("waves", None, "k_i/(2 pi), one number per axis"), MEAN, AMPLITUDE, KAPPA, RHO, C_V],
        make: |p| {
            let k = p.point("waves")?.map(|w| 2.0 * std::f64::consts::PI * w);
            let (mean, amplitude, diffusivity) = (p.number("mean")?, p.number("amplitude")?, p.diffusivity()?);
            let sine = space::Sine { mean, amplitude, k, diffusivity };
            Ok(Box::new(move |x, t| sine.at(x, t)))
        },
    },
    Solution {
        name: "gaussian",
        about: "a Gaussian of variance s^2 + 2 D t in open space",
        parameters: &[("s", None, "standard deviation at time 0"), MEAN, AMPLITUDE, CENTRE, KAPPA, RHO, C_V],
        make: |p| {
            let (mean, amplitude, s) = (p.number("mean")?, p.number("amplitude")?, p.positive("s")?);
            let (centre, dim, diffusivity) = (p.point("centre")?, p.dim, p.diffusivity()?);
            let gaussian = space::Gaussian { mean, amplitude, s, centre, dim, diffusivity };
            Ok(Box::new(move |x, t| gaussian.at(x, t)))
        },
    },
    Solution {
        name: "contact",
        about: "two half-spaces of different material and T in touch: one contact T, an error function on each side",
        parameters: &[
            ("at", Some(&[0.0]), "x of the contact"),
            BOTH,
            ("kappa", None, "both conductivities"),
            ("capacity", None, "both rho c_v"),
        ],
        make: |p| {
            let (at, temperature) = (p.number("at")?, p.two("T")?);
            let (kappa, capacity) = (p.two_positive("kappa")?, p.two_positive("capacity")?);
            let contact = space::Contact { at, temperature, kappa, capacity };
            Ok(Box::new(move |x, t| contact.at(x, t)))
        },
    },
    Solution {
        name: "barenblatt",
        about: "a point of heat that spreads with kappa = a rho c_v T^n behind a sharp front",
        parameters: &[
            ("n", None, "exponent of kappa(T)"),
            ("a", Some(&[1.0]), "kappa/(rho c_v) at T = 1"),
            ("strength", Some(&[1.0]), "C in [C - n beta r^2 t^(-2 beta)/(2a)]^(1/n)"),
            CENTRE,
        ],
        make: |p| {
            let (a, n, strength) = (p.positive("a")?, p.positive("n")?, p.positive("strength")?);
            let wave = space::Barenblatt { a, n, strength, centre: p.point("centre")?, dim: p.dim };
            Ok(Box::new(move |x, t| wave.at(x, t)))
        },
    },
    Solution {
        name: "slab",
        about: "steady slab between two fixed temperatures, with heat released inside",
        parameters: &[FACES, BOTH, ("source", Some(&[0.0]), "heat released, W/m^3"), KAPPA],
        make: |p| {
            let (slab, temperature, source) = (p.slab()?, p.two("T")?, p.number("source")?);
            Ok(Box::new(move |x, _| slab.between(temperature, source, x[0])))
        },
    },
    Solution {
        name: "layers",
        about: "steady slab of two layers between two fixed temperatures",
        parameters: &[("x", None, "outer face, contact, outer face"), BOTH, ("kappa", None, "both conductivities")],
        make: |p| {
            let x = [p.at("x", 0, 3)?, p.at("x", 1, 3)?, p.at("x", 2, 3)?];
            p.rule("x", x[0] < x[1] && x[1] < x[2], "the three faces must be in order")?;
            let layers = steady::Layers { x, kappa: p.two_positive("kappa")?, temperature: p.two("T")? };
            Ok(Box::new(move |x, _| layers.at(x[0])))
        },
    },
    Solution {
        name: "shell",
        about: "steady state between two circles (2-D, log r) or spheres (3-D, 1/r) of fixed T",
        parameters: &[("radius", None, "inner and outer radius"), BOTH, CENTRE],
        make: |p| {
            let radius = p.two_positive("radius")?;
            p.rule("radius", radius[0] < radius[1], "the inner radius comes first")?;
            let shell = steady::Shell { radius, temperature: p.two("T")?, centre: p.point("centre")?, dim: p.dim };
            Ok(Box::new(move |x, _| shell.at(x)))
        },
    },
    Solution {
        name: "losing_slab",
        about: "steady slab, T fixed at the first face, loss h_conv (T - T_ambient) at the second",
        parameters: &[FACES, FIXED, ("h_conv", None, "heat transfer coefficient"), AMBIENT, KAPPA],
        make: |p| {
            let (slab, fixed, h, ambient) =
                (p.slab()?, p.number("fixed")?, p.positive("h_conv")?, p.number("T_ambient")?);
            Ok(Box::new(move |x, _| slab.loses(fixed, h, ambient, x[0])))
        },
    },
    Solution {
        name: "radiating_slab",
        about: "steady slab, T fixed at the first face, radiation emissivity sigma_SB (T^4 - T_ambient^4) at the second",
        parameters: &[
            FACES,
            FIXED,
            ("emissivity", Some(&[1.0]), "of the second face"),
            ("sigma_SB", Some(&[SIGMA_SB]), "Stefan-Boltzmann constant"),
            AMBIENT,
            KAPPA,
        ],
        make: |p| {
            let (slab, fixed, ambient) = (p.slab()?, p.number("fixed")?, p.number("T_ambient")?);
            p.rule("fixed", fixed >= 0.0 && ambient >= 0.0, "temperatures that radiate must not be negative")?;
            let sigma = p.positive("emissivity")? * p.positive("sigma_SB")?;
            Ok(Box::new(move |x, _| slab.radiates(fixed, sigma, ambient, x[0])))
        },
    },
    Solution {
        name: "heated_slab",
        about: "slab insulated at the first face, heated by a constant flux at the second from time 0 on",
        parameters: &[FACES, INITIAL, ("flux_in", None, "W/m^2 into the second face"), KAPPA, RHO, C_V],
        make: |p| {
            let (slab, initial, q) = (p.slab()?, p.number("initial")?, p.number("flux_in")?);
            Ok(Box::new(move |x, t| slab.heated(initial, q, x[0], t)))
        },
    },
    Solution {
        name: "cooling_slab",
        about: "slab insulated at the first face, losing h_conv (T - T_ambient) at the second from time 0 on",
        parameters: &[FACES, INITIAL, ("h_conv", None, "heat transfer coefficient"), AMBIENT, KAPPA, RHO, C_V],
        make: |p| {
            let (initial, h, ambient) = (p.number("initial")?, p.positive("h_conv")?, p.number("T_ambient")?);
            let cooling = slab::Cooling::new(p.slab()?, initial, h, ambient);
            Ok(Box::new(move |x, t| cooling.at(x[0], t)))
        },
    },
    Solution {
        name: "radiative_cooling",
        about: "a body of one T that radiates into the cold: dT/dt = -rate T^4",
        parameters: &[INITIAL, ("rate", None, "area emissivity sigma_SB/(m c_v)")],
        make: |p| {
            let (initial, rate) = (p.positive("initial")?, p.positive("rate")?);
            Ok(Box::new(move |_, t| steady::radiative_cooling(initial, rate, t)))
        },
    },
];

/// The solution of that name in `dim` dimensions. Parameters that are not `given` are looked for in `material`.
///
/// # Errors
/// `UnknownWord` for a name or a parameter that does not exist, `BadValue` for one that is missing or makes no sense.
pub fn find(name: &str, dim: usize, given: Parameters, material: &BTreeMap<String, f64>) -> Result<Exact> {
    let solution = SOLUTIONS.iter().find(|s| s.name == name);
    let solution = solution.ok_or_else(|| Error::unknown("exact solution", name, SOLUTIONS.iter().map(|s| s.name)))?;
    let known = |key: &String| solution.parameters.iter().any(|(name, ..)| name == key);
    if let Some(key) = given.keys().find(|k| !known(k)) {
        return Err(Error::unknown(&format!("parameter of {name}"), key, solution.parameters.iter().map(|p| p.0)));
    }
    (solution.make)(&Given { solution, dim, given, material })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A value for every parameter that must be given.
    fn sample(solution: &Solution) -> Parameters {
        let value = |name: &str| match name {
            "waves" => vec![1.0, 2.0, 1.0],
            "T" | "radius" => vec![1.0, 2.0],
            "kappa" | "capacity" if ["contact", "layers"].contains(&solution.name) => vec![1.0, 3.0],
            "x" if solution.name == "layers" => vec![0.0, 0.4, 1.0],
            "x" => vec![0.0, 1.0],
            _ => vec![0.5],
        };
        let needed = solution.parameters.iter().filter(|p| p.1.is_none());
        needed.map(|p| (p.0.to_string(), value(p.0))).collect()
    }

    #[test]
    fn every_solution_is_made_from_its_parameters_and_asks_for_those_that_are_missing() {
        let material = BTreeMap::new();
        for solution in SOLUTIONS {
            let given = sample(solution);
            let exact = find(solution.name, 3, given.clone(), &material).unwrap();
            assert!(exact([0.3, 0.4, 0.5], 0.1).is_finite(), "{}", solution.name);
            for name in given.keys() {
                let fewer = given.iter().filter(|(k, _)| *k != name).map(|(k, v)| (k.clone(), v.clone())).collect();
                let text = find(solution.name, 3, fewer, &material).err().unwrap().to_string();
                assert!(text.contains(name) && text.contains("missing"), "{}: {text}", solution.name);
                let mut odd = given.clone();
                odd.insert(name.clone(), vec![f64::NAN; 3]);
                assert!(find(solution.name, 3, odd, &material).is_err(), "{} {name}", solution.name);
            }
            let mut more = given.clone();
            more.insert("amplitud".into(), vec![1.0]);
            assert!(find(solution.name, 3, more, &material).err().unwrap().to_string().contains("unknown parameter"));
        }
        let text = find("sin", 1, Parameters::new(), &material).err().unwrap().to_string();
        assert!(text.contains("did you mean 'sine'"), "{text}");
    }

    #[test]
    fn the_material_of_a_scene_is_taken_where_nothing_else_is_given() {
        let material = BTreeMap::from([("kappa".to_string(), 2.0), ("rho".into(), 4.0), ("c_v".into(), 0.5)]);
        let given = Parameters::from([("waves".to_string(), vec![1.0])]);
        let exact = find("sine", 1, given, &material).unwrap();
        let k2 = (2.0 * std::f64::consts::PI).powi(2);
        assert!((exact([0.25, 0.0, 0.0], 0.01) - (-k2 * 0.01).exp()).abs() < 1e-14);
    }
}
