//! Diffusion on SPH particles.
//!
//! The rooms of the house, from the ground up; a room uses only rooms below it:
//!
//! | floor | rooms |
//! |---|---|
//! | doors | [`ffi`], `cli` |
//! | users | `study` |
//! | handle | [`solver`], [`io`] |
//! | plan | [`plan`] |
//! | motion | [`integrator`], [`model`] |
//! | discretise | [`operator`] |
//! | geometry | [`space`] |
//! | data | [`kernel`] |
//! | ground | [`error`], [`sum`], [`memory`], [`pool`], [`words`] |
//!
//! The feature `reserve` (default) makes [`memory`]'s allocator that of the whole program; one that has its own leaves it out.

pub mod array;
pub mod error;
pub mod memory;
pub mod pool;
pub mod sum;
pub mod words;

pub mod kernel;

pub mod space;

pub mod operator;

pub mod integrator;
pub mod model;

pub mod plan;

pub mod solver;

pub mod io;

#[cfg(feature = "cli")]
pub mod study;

#[cfg(feature = "cli")]
pub mod cli;

pub mod ffi;

pub use array::{Strided, StridedMut};
pub use solver::Solver;
