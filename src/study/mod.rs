//! Scenes: particles, a material and what happens to them, run through the solver and held against what is known.
//!
//! | file | what it holds |
//! |---|---|
//! | `exact` | exact solutions, by name |
//! | `lattice` | particles on lattices |
//! | `surface` | particles at a free surface |
//! | `scene` | the scene file: every key, what it means, what is wrong with it |
//! | `setup` | from a scene to a solver |
//! | `run` | the run and its snapshots |
//! | `report` | accuracy against run time |

pub mod exact;
pub mod lattice;
#[cfg(feature = "cli")]
pub mod report;
#[cfg(feature = "cli")]
pub mod run;
#[cfg(feature = "cli")]
pub mod scene;
#[cfg(feature = "cli")]
mod setup;
pub mod surface;
