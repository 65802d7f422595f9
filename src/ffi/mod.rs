//! The C ABI. C, C++ and Fortran hosts see `include/diffusph.h` (made from here) and `include/diffusph.f90`; the
//! conventions that hold for every function stand at the top of the header.
//!
//! | file | what it holds |
//! |---|---|
//! | `guard` | the one door that every call goes through, and what lies behind a handle |
//! | `environment` | the host's floating-point environment, put aside during a call |
//! | `pointers` | C pointers, counts and strings to Rust and back |
//! | `codes` | numbers that C knows by name |
//! | `report` | what a step did, as a C struct |
//! | `lifetime` | create, destroy, message |
//! | `set`, `callback` | what a host sets, and functions that it lends |
//! | `log` | what it is told |
//! | `advance` | step, limit, rate, cancel, plan |
//! | `get` | what a host gets |
//! | `files` | VTK files |
//! | `catalogue` | what can be chosen, and versions |
//!
//! The first call installs a panic hook, once in the process, in front of the one that is there: panics that a call will
//! turn into a code are not printed, all others go on to it. In C hosts it is that of the Rust inside this library alone;
//! a Rust program that calls these functions shares it.

mod advance;
mod callback;
mod catalogue;
mod codes;
mod environment;
mod files;
mod get;
mod guard;
mod lifetime;
mod log;
mod pointers;
mod report;
mod set;

pub use advance::*;
pub use callback::*;
pub use catalogue::*;
pub use codes::*;
pub use files::*;
pub use get::*;
pub use guard::Handle;
pub use lifetime::*;
pub use report::Report;
pub use set::*;
