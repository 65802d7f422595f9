//! The named quantities of the model `heat`: what a host may set, what it may get, and what values make sense.

use crate::error::{Error, Result};

/// What values a quantity may take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Domain {
    Finite,
    Positive,
    NonNegative,
    /// From 0 to 1.
    Share,
}

impl Domain {
    pub fn holds(self, v: f64) -> bool {
        match self {
            Domain::Finite => v.is_finite(),
            Domain::Positive => v.is_finite() && v > 0.0,
            Domain::NonNegative => v.is_finite() && v >= 0.0,
            Domain::Share => (0.0..=1.0).contains(&v),
        }
    }

    pub fn rule(self) -> &'static str {
        match self {
            Domain::Finite => "it must be finite",
            Domain::Positive => "it must be positive and finite",
            Domain::NonNegative => "it must be finite and not negative",
            Domain::Share => "it must be from 0 to 1",
        }
    }
}

/// A quantity per particle. Units are SI where the host uses SI; any consistent system works.
pub struct Field {
    pub name: &'static str,
    pub unit: &'static str,
    pub about: &'static str,
    /// Components: 1, or one per axis.
    pub vector: bool,
    pub access: Access,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Access {
    /// Set by the host (and readable); holds its default until then, if it has one.
    Input { domain: Domain, default: Option<f64> },
    /// Computed when asked for; where it is settable, that sets what it is made from.
    Output { settable: bool },
}

const fn input(
    name: &'static str,
    unit: &'static str,
    domain: Domain,
    default: Option<f64>,
    about: &'static str,
) -> Field {
    Field { name, unit, about, vector: false, access: Access::Input { domain, default } }
}

const fn output(name: &'static str, unit: &'static str, about: &'static str) -> Field {
    Field { name, unit, about, vector: false, access: Access::Output { settable: false } }
}

const fn settable(field: Field) -> Field {
    Field { access: Access::Output { settable: true }, ..field }
}

const fn vector(field: Field) -> Field {
    Field { vector: true, ..field }
}

use Domain::{Finite, NonNegative, Positive, Share};

/// Inputs first: their position is the index of their storage.
pub static FIELDS: &[Field] = &[
    input("T", "K", Finite, None, "temperature"),
    input("m", "kg", Positive, None, "mass"),
    input("rho", "kg/m^3", Positive, None, "density; without it, the sum over neighbours"),
    input("h", "m", Positive, None, "smoothing length; without it, h_fac (m/rho)^(1/nu)"),
    input("kappa", "W/(m K)", NonNegative, None, "thermal conductivity"),
    input("c_v", "J/(kg K)", Positive, Some(1.0), "heat capacity per mass"),
    input("fixed", "-", Finite, Some(0.0), "not 0: the particle keeps its T, whatever flows in or out"),
    input("source", "W/m^3", Finite, Some(0.0), "heat released per volume"),
    input("flux_in", "W/m^2", Finite, Some(0.0), "heat flux into the particle's area from outside"),
    input("h_conv", "W/(m^2 K)", NonNegative, Some(0.0), "heat transfer coefficient to T_ambient (Robin)"),
    input("emissivity", "-", Share, Some(0.0), "radiative exchange emissivity sigma_SB (T_ambient^4 - T^4)"),
    input("T_ambient", "K", Finite, Some(0.0), "temperature of the surroundings; absolute where there is emissivity"),
    input("area", "m^2", NonNegative, None, "area that faces outside; without it, what the neighbours leave open"),
    input(
        "depth",
        "m",
        NonNegative,
        None,
        "of the particle's centre below its area: T there and at the area differ by the heat that flows, over kappa; without it, half a spacing",
    ),
    input("kappa_par", "W/(m K)", NonNegative, None, "conductivity along b; with kappa_perp and b in place of kappa"),
    input("kappa_perp", "W/(m K)", NonNegative, None, "conductivity across b (without it, 0)"),
    input("b_x", "-", Finite, None, "direction of kappa_par, of any length and sign; 0: kappa_perp in all directions"),
    input("b_y", "-", Finite, None, "its second component"),
    input("b_z", "-", Finite, None, "its third component"),
    input(
        "kappa_xx",
        "W/(m K)",
        NonNegative,
        None,
        "symmetric tensor in place of kappa; components not set are 0; kappa_ij sets all of them",
    ),
    input("kappa_yy", "W/(m K)", NonNegative, None, "its second diagonal component"),
    input("kappa_zz", "W/(m K)", NonNegative, None, "its third diagonal component"),
    input("kappa_xy", "W/(m K)", Finite, None, "its component xy"),
    input("kappa_yz", "W/(m K)", Finite, None, "its component yz"),
    input("kappa_xz", "W/(m K)", Finite, None, "its component xz"),
    settable(vector(output("x", "m", "position, inside the box on periodic axes"))),
    settable(output("u", "J/kg", "energy per mass, c_v T; setting it sets T")),
    output("rate", "W/kg", "du/dt from diffusion, surface and source"),
    output("dT_dt", "K/s", "dT/dt; 0 where T is fixed"),
    output("K_d2", "-", "second moment of the operator before normalisation (1 for a perfect Laplacian)"),
    output(
        "conduction_defect",
        "-",
        "how wrong a particle conducts: |second moments of the weights in use - I|/sqrt(nu), all directions counted",
    ),
    vector(output("first_moment", "-", "h times the first moment of the operator (0 for a perfect Laplacian)")),
    output("neighbours", "-", "number of neighbours"),
    output(
        "order_reached",
        "-",
        "order of the consistent weights (0: others), lowered where neighbours are too few or on one side",
    ),
    output("omega", "-", "grad-h factor"),
    vector(output("grad_T", "K/m", "temperature gradient, exact for linear fields")),
    vector(output(
        "flux",
        "W/m^2",
        "heat flux -kappa grad T, with kappa averaged as between particles: the same on both sides of a jump",
    )),
    settable(vector(output("b", "-", "b_x, b_y, b_z as one vector; setting it sets them"))),
];

/// Position of an input in [`FIELDS`] and in a solver's storage.
pub type Slot = usize;

pub const T: Slot = 0;
pub const M: Slot = 1;
pub const RHO: Slot = 2;
pub const H: Slot = 3;
pub const KAPPA: Slot = 4;
pub const C_V: Slot = 5;
pub const FIXED: Slot = 6;
pub const SOURCE: Slot = 7;
pub const FLUX_IN: Slot = 8;
pub const H_CONV: Slot = 9;
pub const EMISSIVITY: Slot = 10;
pub const T_AMBIENT: Slot = 11;
pub const AREA: Slot = 12;
pub const DEPTH: Slot = 13;
pub const KAPPA_PAR: Slot = 14;
pub const KAPPA_PERP: Slot = 15;
/// The first of three.
pub const B: Slot = 16;
/// The first of six: xx, yy, zz, xy, yz, xz.
pub const KAPPA_IJ: Slot = 19;
pub const INPUTS: usize = 25;

/// Inputs that make the conductivity a tensor.
pub const TENSOR: std::ops::Range<Slot> = KAPPA_PAR..INPUTS;

/// Several inputs that a host may set at once, as the components of one array: the name, and their slots in `dim`
/// dimensions.
pub fn group(name: &str, dim: usize) -> Option<Vec<Slot>> {
    match (name, dim) {
        ("b", _) => Some((B..B + dim).collect()),
        ("kappa_ij", 1) => Some(vec![KAPPA_IJ]),
        ("kappa_ij", 2) => Some(vec![KAPPA_IJ, KAPPA_IJ + 1, KAPPA_IJ + 3]),
        ("kappa_ij", _) => Some((KAPPA_IJ..KAPPA_IJ + 6).collect()),
        _ => None,
    }
}

/// A single number of a solver.
pub struct Number {
    pub name: &'static str,
    pub unit: &'static str,
    pub about: &'static str,
    /// What a host may set it to; none for results.
    pub settable: Option<Domain>,
}

const fn result(name: &'static str, unit: &'static str, about: &'static str) -> Number {
    Number { name, unit, about, settable: None }
}

pub static NUMBERS: &[Number] = &[
    Number { name: "time", unit: "s", about: "time reached", settable: Some(Finite) },
    Number {
        name: "sigma_SB",
        unit: "W/(m^2 K^4)",
        about: "Stefan-Boltzmann constant in the host's units",
        settable: Some(NonNegative),
    },
    result("n", "-", "number of particles"),
    result("energy", "J", "sum of m c_v T"),
    result("T_min", "K", "smallest temperature"),
    result("T_max", "K", "largest temperature"),
    result("limit", "s", "largest stable explicit (Euler) step"),
    result("spectral_bound", "1/s", "upper bound on the operator's largest rate"),
    result("smallest_weight", "m^(nu-2)", "smallest pair weight V_a V_b w_ab; negative where positivity is lost"),
    result("mean_neighbours", "-", "mean number of neighbours"),
    result("negative_pairs", "-", "pairs with a negative weight, both directions counted"),
    result("K_d2_min", "-", "smallest second moment of the operator"),
    result("K_d2_max", "-", "largest second moment of the operator"),
    result("conduction_defect", "-", "root mean square of the field of this name"),
    result(
        "energy_defect",
        "-",
        "energy that operator=consistent has made or lost since T was set, of what was out of balance, sum of m c_v |T - mean|; 0 for others, and where something heats, cools or is fixed",
    ),
    result(
        "bypassed",
        "-",
        "particles in layers so thin that pairs of particles which conduct ten times better reach over them",
    ),
    result("growth_rate", "1/s", "largest real part in the operator's spectrum (Arnoldi): above 0 where a mode grows"),
    result("lowered_orders", "-", "particles whose consistent weights have a lower order than was asked for"),
    result(
        "ghost_supports",
        "-",
        "how many supports of ghosts around a part of the particles make `rate` there that of the whole, ghosts being given all that the others are; infinite where weights depend on all particles",
    ),
    result("bytes", "bytes", "memory held for particles and weights"),
    result("threads", "-", "worker threads"),
];

/// Stefan-Boltzmann constant, CODATA 2018 (exact), W/(m² K⁴).
pub const SIGMA_SB: f64 = 5.670374419e-8;

/// The slot of an input.
pub fn slot(name: &str) -> Result<Slot> {
    let inputs = &FIELDS[..INPUTS];
    inputs.iter().position(|f| f.name == name).ok_or_else(|| match FIELDS.iter().find(|f| f.name == name) {
        Some(_) if name == "x" => {
            Error::bad("name", "'x'", "positions are set for each particle, by set_particles or set")
        }
        Some(_) => Error::bad("name", format!("'{name}'"), "this quantity is computed, it cannot be set"),
        None => Error::unknown("field", name, inputs.iter().map(|f| f.name)),
    })
}

/// The description of any field.
pub fn field(name: &str) -> Result<&'static Field> {
    let found = FIELDS.iter().find(|f| f.name == name);
    found.ok_or_else(|| Error::unknown("field", name, FIELDS.iter().map(|f| f.name)))
}

/// The description of any number.
pub fn number(name: &str) -> Result<&'static Number> {
    let found = NUMBERS.iter().find(|f| f.name == name);
    found.ok_or_else(|| Error::unknown("number", name, NUMBERS.iter().map(|f| f.name)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_are_the_positions_of_the_inputs() {
        let named = [
            (T, "T"),
            (M, "m"),
            (RHO, "rho"),
            (H, "h"),
            (KAPPA, "kappa"),
            (C_V, "c_v"),
            (FIXED, "fixed"),
            (SOURCE, "source"),
            (FLUX_IN, "flux_in"),
            (H_CONV, "h_conv"),
            (EMISSIVITY, "emissivity"),
            (T_AMBIENT, "T_ambient"),
            (AREA, "area"),
            (DEPTH, "depth"),
            (KAPPA_PAR, "kappa_par"),
            (KAPPA_PERP, "kappa_perp"),
            (B, "b_x"),
            (B + 1, "b_y"),
            (B + 2, "b_z"),
            (KAPPA_IJ, "kappa_xx"),
            (KAPPA_IJ + 1, "kappa_yy"),
            (KAPPA_IJ + 2, "kappa_zz"),
            (KAPPA_IJ + 3, "kappa_xy"),
            (KAPPA_IJ + 4, "kappa_yz"),
            (KAPPA_IJ + 5, "kappa_xz"),
        ];
        assert_eq!(named.len(), INPUTS);
        for (at, name) in named {
            assert_eq!(slot(name).unwrap(), at);
        }
        let is_input = |f: &Field| matches!(f.access, Access::Input { .. });
        assert!(FIELDS.iter().enumerate().all(|(i, f)| is_input(f) == (i < INPUTS)));
        assert!(slot("grad_T").unwrap_err().to_string().contains("computed"));
        assert!(slot("kapa").unwrap_err().to_string().contains("'kappa'"));
    }
}
