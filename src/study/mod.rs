//! Scenes: particles, a material and what happens to them, run through the solver and held against what is known.
//!
//! | file | what it holds |
//! |---|---|
//! | `exact` | exact solutions, by name |
//! | `lattice`, `glass` | particles on lattices, and evenly spaced without one |
//! | `keys` | every key of a scene file, what it means, what is wrong with it |
//! | `scene` | the scene file |
//! | `setup` | from a scene to a solver |
//! | `choose` | the particles that a mark is for |
//! | `run` | the run and its snapshots |
//! | `resume`, `identity` | how it goes on from the last of them, and what says that it is the same run |
//! | `report` | accuracy against run time |
//! | `catalogue` | studies of the library itself, by name |
//! | `request` | what they are asked for and answer |
//! | `accuracy`, `kernels`, `convergence`, `work` | studies of accuracy |
//! | `peers` | other codes, on the same particles in the same run |
//! | `positivity` | of anisotropic operators |
//! | `sod` | of a shock tube, with a small hydrodynamics of its own |
//! | `claims` | of what others said |
//! | `samples` | a computed field as a function of place |
//! | `mode`, `batch` | the scene that they share, and many cases side by side |
//! | `page`, `table`, `plot` | what a study found, for people, browsers and programs |
//! | `stability` | cases that break solvers |

pub mod accuracy;
mod batch;
pub mod catalogue;
mod choose;
pub mod claims;
pub mod convergence;
pub mod exact;
pub mod glass;
mod identity;
pub mod kernels;
pub mod keys;
pub mod lattice;
mod mode;
pub mod page;
pub mod peers;
pub mod plot;
pub mod positivity;
pub mod report;
pub mod request;
mod resume;
pub mod run;
pub mod samples;
pub mod scene;
mod setup;
pub mod sod;
pub mod stability;
pub mod table;
pub mod work;
