//! What diffuses: the fields that a model declares, and the right-hand side that it makes of them.

pub mod conductivity;
pub mod fields;
pub mod heat;
pub mod precondition;
pub mod surface;
pub mod tensor;

/// A model and what a host may read about it.
pub struct Model {
    pub name: &'static str,
    pub about: &'static str,
}

pub static MODELS: &[Model] =
    &[Model { name: "heat", about: "rho c_v dT/dt = div(kappa grad T) + source, with kappa a number or a tensor" }];
