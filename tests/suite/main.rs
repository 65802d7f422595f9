//! Every test of whole behaviour that can share a process: one program, so that the library is linked once.

#[path = "../common/mod.rs"]
mod common;
mod particles;

mod abi;
mod adaptive;
mod any_dt;
mod boundaries;
mod c_examples;
mod consistent;
#[cfg(all(feature = "cli", unix))]
mod continued;
mod disorder;
mod extremes;
mod files;
mod floors;
mod fortran;
mod ghosts;
mod given;
mod header;
mod implicit;
mod laws;
mod memory;
mod multigrid;
mod nonlinear;
#[cfg(feature = "cli")]
mod program;
mod projected;
#[cfg(feature = "cli")]
mod python;
mod queries;
mod restart;
mod rules;
mod spacing;
#[cfg(feature = "cli")]
mod stability;
#[cfg(feature = "cli")]
mod studies;
mod tensor;
mod thin;
mod vtk_matrix;
