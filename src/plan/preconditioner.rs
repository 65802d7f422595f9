//! What conjugate gradients are preconditioned with in a scene: multigrid where it repays, the diagonal elsewhere, and
//! why.

/// The choice of a host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preconditioner {
    Auto,
    Jacobi,
    Multigrid,
}

pub const KNOWN: [(&str, Preconditioner); 3] =
    [("auto", Preconditioner::Auto), ("jacobi", Preconditioner::Jacobi), ("multigrid", Preconditioner::Multigrid)];

/// dt in explicit limits from which multigrid takes less time than the diagonal, where its levels are kept from step to
/// step, and where they serve one step only.
const KEPT: f64 = 10.0;
const ONCE: f64 = 100.0;

/// What becomes of the choice.
#[derive(Debug, Clone, PartialEq)]
pub struct Preconditioning {
    /// The least dt, in explicit limits, for which multigrid is used; infinite where it never is.
    pub stiff: f64,
    /// As the plan prints it.
    pub about: String,
}

impl Preconditioner {
    /// For an operator that is one stored matrix, or is not; `once`: levels serve one step only.
    pub fn settle(self, stored: bool, once: bool) -> Preconditioning {
        let jacobi = |why: &str| Preconditioning { stiff: f64::INFINITY, about: format!("jacobi because {why}") };
        let stiff = if once { ONCE } else { KEPT };
        match self {
            Preconditioner::Jacobi => jacobi("it was asked for"),
            _ if !stored => jacobi("multigrid needs an operator that is one matrix"),
            Preconditioner::Multigrid => Preconditioning { stiff: 0.0, about: "multigrid".into() },
            Preconditioner::Auto => Preconditioning {
                stiff,
                about: format!("multigrid where dt is beyond {stiff} explicit limits, else jacobi"),
            },
        }
    }
}
