//! Where the particles are: the box and its images, Morton order, cell lists, rows of neighbours, density.
//!
//! Everything here works in *internal order*: particles sorted along a Morton curve with ties broken by coordinates,
//! so that results do not depend on the order in which the host keeps its particles.

pub mod cells;
pub mod cloud;
pub mod density;
pub mod domain;
pub mod facing;
pub mod morton;
mod nearest;
pub mod rows;
mod scratch;
pub mod surface;

pub use cloud::Cloud;
pub use domain::{Domain, OTHER_UNITS, lengths, rule_of_lengths};
pub use nearest::Nearest;
pub use scratch::{ONE_SIDED, Row, Scratch};

/// At most 3 dimensions; unused axes are empty.
pub type Axes<T> = [T; 3];
