//! Second derivatives on particles: the table of operators, averages of the conductivity, and the engines that apply
//! them.
//!
//! Every operator here is a pair sum (Biriukov & Price 2019; Brookshaw 1985):
//!
//! ```text
//! m_a du_a/dt = Σ_b V_a V_b kappa_ab w_ab (T_b − T_a),     V = m/rho,  w_ab = w_ba
//! ```
//!
//! so energy is exchanged in equal and opposite parts, constants are kept exactly, and where w ≥ 0 a maximum principle
//! holds.
//!
//! Where the conductivity is a tensor kappa S (tr S = nu), an operator either turns S into weights of pairs ([`assembly`]) or
//! takes a gradient, a flux and a divergence ([`twice`]).

pub mod aggregate;
mod apart;
pub mod arnoldi;
pub mod assembly;
pub mod bypass;
mod bytes;
pub mod consistent;
pub mod engine;
pub mod gradient;
mod ldl;
pub mod matrix;
pub mod mean;
pub mod moments;
pub mod multigrid;
pub mod normalise;
pub mod once;
mod polynomials;
mod projected;
pub mod sides;
pub mod sparse;
pub mod spectrum;
mod stencils;
pub mod table;
pub mod tensor;
pub mod twice;
pub mod walls;

pub use assembly::Assembly;
pub use engine::{Engine, Medium};
pub use matrix::Matrix;
pub use mean::{Kappa, Mean};
pub use multigrid::Multigrid;
pub use table::{Normalise, Operator};
pub use tensor::Sym;
pub use twice::Twice;
