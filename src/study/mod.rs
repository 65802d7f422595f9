//! Scenes: particles, a material and what happens to them, run through the solver and held against what is known.
//!
//! | file | what it holds |
//! |---|---|
//! | `exact` | exact solutions, by name |
//! | `lattice` | particles on lattices |
//! | `surface` | particles at a free surface |
//! | `keys` | every key of a scene file, what it means, what is wrong with it |
//! | `scene` | the scene file |
//! | `setup` | from a scene to a solver |
//! | `choose` | the particles that a mark is for |
//! | `run` | the run and its snapshots |
//! | `report` | accuracy against run time |
//! | `catalogue` | studies of the library itself, by name |
//! | `stability` | cases that break solvers |

#[cfg(feature = "cli")]
pub mod catalogue;
#[cfg(feature = "cli")]
mod choose;
pub mod exact;
#[cfg(feature = "cli")]
pub mod keys;
pub mod lattice;
#[cfg(feature = "cli")]
pub mod report;
#[cfg(feature = "cli")]
pub mod run;
#[cfg(feature = "cli")]
pub mod scene;
#[cfg(feature = "cli")]
mod setup;
#[cfg(feature = "cli")]
pub mod stability;
pub mod surface;
