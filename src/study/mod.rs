//! Scenes: particles, a material and what happens to them, run through the solver and held against what is known.
//!
//! | file | what it holds |
//! |---|---|
//! | `exact` | exact solutions, by name |
//! | `lattice`, `glass` | particles on lattices, and evenly spaced without one |
//! | `surface` | particles at a free surface |
//! | `keys` | every key of a scene file, what it means, what is wrong with it |
//! | `scene` | the scene file |
//! | `setup` | from a scene to a solver |
//! | `choose` | the particles that a mark is for |
//! | `run` | the run and its snapshots |
//! | `report` | accuracy against run time |
//! | `norm` | the error that is meant |
//! | `recommend` | what reaches an error cheapest on a host's particles |
//! | `catalogue` | studies of the library itself, by name |
//! | `accuracy`, `kernels`, `convergence`, `work` | studies of accuracy |
//! | `peers` | other codes, on the same particles in the same run |
//! | `positivity` | of anisotropic operators |
//! | `sod` | of a shock tube, with a small hydrodynamics of its own |
//! | `claims` | of what others said |
//! | `samples` | a computed field as a function of place |
//! | `mode`, `batch` | the scene that they share, and many cases side by side |
//! | `page`, `table`, `plot` | what a study found, for people, browsers and programs |
//! | `stability` | cases that break solvers |

#[cfg(feature = "cli")]
pub mod accuracy;
#[cfg(feature = "cli")]
mod batch;
#[cfg(feature = "cli")]
pub mod catalogue;
#[cfg(feature = "cli")]
mod choose;
#[cfg(feature = "cli")]
pub mod claims;
#[cfg(feature = "cli")]
pub mod convergence;
pub mod exact;
pub mod glass;
#[cfg(feature = "cli")]
pub mod kernels;
#[cfg(feature = "cli")]
pub mod keys;
pub mod lattice;
#[cfg(feature = "cli")]
mod mode;
pub mod norm;
#[cfg(feature = "cli")]
pub mod page;
#[cfg(feature = "cli")]
pub mod peers;
#[cfg(feature = "cli")]
pub mod plot;
#[cfg(feature = "cli")]
pub mod positivity;
pub mod recommend;
#[cfg(feature = "cli")]
pub mod report;
#[cfg(feature = "cli")]
pub mod run;
#[cfg(feature = "cli")]
pub mod samples;
#[cfg(feature = "cli")]
pub mod scene;
#[cfg(feature = "cli")]
mod setup;
#[cfg(feature = "cli")]
pub mod sod;
#[cfg(feature = "cli")]
pub mod stability;
pub mod surface;
#[cfg(feature = "cli")]
pub mod table;
#[cfg(feature = "cli")]
pub mod work;
