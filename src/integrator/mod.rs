//! Advancing dy/dt = rate(t, y) by explicit, stabilised and implicit Runge-Kutta methods: a table of methods, the
//! schedule of sub-steps and stages that a step needs, and the sub-step itself. What y is, the integrator does not know.

mod adaptive;
mod explicit;
mod implicit;
mod krylov;
mod range;
mod stabilised;

use crate::error::{Error, Result};
use crate::memory;
use crate::pool::Pool;
pub use adaptive::{Adaptive, Control};
use explicit::Tableau;
pub use krylov::Limits;
pub use range::Range;
use stabilised::Recursion;

/// Quantities whose rates follow from those of y, and on which none depends.
pub type Tally = [f64; 2];

/// `to += factor * what`.
pub(crate) fn tallied(to: &mut Tally, factor: f64, what: Tally) {
    to.iter_mut().zip(what).for_each(|(to, what)| *to += factor * what);
}

/// What an integrator advances: dy/dt = rate(t, y).
pub trait System {
    /// Writes the rate at (t, y) to `dy`, which has the length of `y` and holds nothing of use before.
    fn rate(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<()>;

    /// How fast what is tallied beside y grows, by the rate evaluated last. It is integrated with the weights that rates
    /// have, so that whatever law binds it to y holds for the step as well.
    fn tally(&self) -> Tally {
        Tally::default()
    }

    /// For implicit methods: fixes a linear operator A with rate(t, y + d) ≈ rate(t, y) + A d, after a call of `rate`
    /// with the same arguments. Writes −diag A, and the weights of the inner product Σ weight x y in which A is
    /// self-adjoint and has no positive eigenvalue; 0 for what does not move.
    fn linearise(&mut self, _t: f64, _y: &[f64], _diagonal: &mut [f64], _weight: &mut [f64]) -> Result<Linear> {
        Ok(Linear::Unknown)
    }

    /// Whether the rate is linear in y: a stage whose equations are not solved in one length is not in a little less.
    fn is_linear(&self) -> bool {
        false
    }

    /// Writes A x to `ax`, with A as `linearise` fixed it.
    fn apply(&mut self, _x: &[f64], ax: &mut [f64]) -> Result<()> {
        ax.fill(0.0);
        Ok(())
    }

    /// Writes z ≈ (I − g A)⁻¹ r, self-adjoint and positive in the same inner product, and the same for the whole of a
    /// solve. False where the system knows none, and the diagonal has to serve.
    fn precondition(&mut self, _shifted: Shifted, _r: &[f64], _z: &mut [f64]) -> Result<bool> {
        Ok(false)
    }

    /// Writes x such that y + x is uniform, and Σ weight x is 0, in each part of the system that A couples: what an endless
    /// step comes to. False where the system does not know its parts.
    fn flatten(&mut self, _shifted: Shifted, _y: &[f64], _x: &mut [f64]) -> Result<bool> {
        Ok(false)
    }

    /// Brings a y that is a little outside a range back, as [`Range::confine`] does, with the parts and capacities that the
    /// system knows. False where more than the share `most` would have to be moved, or the system knows no such thing.
    fn confine(&mut self, _range: Range, _most: f64, _y: &mut [f64]) -> Result<bool> {
        Ok(false)
    }

    /// Σ weight rate(t, y), where all but a few terms of the rate are exchanges that add up to nothing, from those few:
    /// implicit methods then keep the sum to rounding. `None` where there is no such law.
    fn supply(&mut self, _t: f64, _y: &[f64]) -> Result<Option<f64>> {
        Ok(None)
    }
}

/// The matrix I − g A of a stage.
#[derive(Clone, Copy)]
pub struct Shifted<'a> {
    pub g: f64,
    /// −diag A.
    pub diagonal: &'a [f64],
    /// Of the inner product in which A is self-adjoint.
    pub weight: &'a [f64],
}

/// What a system knows of its linear part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Linear {
    /// Nothing: implicit methods cannot advance it.
    Unknown,
    /// The rate is linear in y, and this is its operator.
    Exact,
    /// The operator changes with y.
    Frozen,
}

/// One row of [`METHODS`].
#[derive(Debug)]
pub struct Method {
    pub name: &'static str,
    pub about: &'static str,
    pub order: u32,
    /// The strong-stability coefficient: steps within `ssp / Bounds::diagonal` are convex combinations of Euler steps
    /// that keep the maximum principle; infinite where all steps do. Zero: the method promises no such thing at any step.
    pub ssp: f64,
    family: Family,
}

#[derive(Debug)]
enum Family {
    Explicit(&'static Tableau),
    Stabilised(&'static Recursion),
    Implicit(&'static implicit::Tableau),
}

/// Every integrator of this room.
pub static METHODS: &[Method] = &[
    Method {
        name: "euler",
        about: "forward Euler, one stage, order 1; keeps the maximum principle",
        order: 1,
        ssp: 1.0,
        family: Family::Explicit(&explicit::EULER),
    },
    Method {
        name: "ssprk2",
        about: "Heun's method, two stages, order 2, strong stability preserving (Shu & Osher 1988)",
        order: 2,
        ssp: 1.0,
        family: Family::Explicit(&explicit::SSPRK2),
    },
    Method {
        name: "ssprk3",
        about: "three stages, order 3, strong stability preserving (Shu & Osher 1988)",
        order: 3,
        ssp: 1.0,
        family: Family::Explicit(&explicit::SSPRK3),
    },
    Method {
        name: "rk4",
        about: "the classical four stages, order 4 (Kutta 1901)",
        order: 4,
        ssp: 0.0,
        family: Family::Explicit(&explicit::RK4),
    },
    Method {
        name: "rkl1",
        about: "Runge-Kutta-Legendre, order 1, s stages for a step of (s^2+s)/2 Euler steps (Meyer, Balsara & Aslam 2014)",
        order: 1,
        ssp: 0.0,
        family: Family::Stabilised(&stabilised::RKL1),
    },
    Method {
        name: "rkl2",
        about: "Runge-Kutta-Legendre, order 2, s stages for a step of (s^2+s-2)/4 Euler steps (Meyer, Balsara & Aslam 2014)",
        order: 2,
        ssp: 0.0,
        family: Family::Stabilised(&stabilised::RKL2),
    },
    Method {
        name: "backward-euler",
        about: "implicit, one solve, order 1, L-stable; keeps the maximum principle at any dt, to the solver's tolerance",
        order: 1,
        ssp: f64::INFINITY,
        family: Family::Implicit(&implicit::BACKWARD_EULER),
    },
    Method {
        name: "crank-nicolson",
        about: "implicit, one solve, order 2; large steps leave short waves ringing (Crank & Nicolson 1947)",
        order: 2,
        ssp: 0.0,
        family: Family::Implicit(&implicit::CRANK_NICOLSON),
    },
    Method {
        name: "sdirk2",
        about: "implicit, two solves, order 2, L-stable, gamma = 1 - 1/sqrt(2) (Alexander 1977)",
        order: 2,
        ssp: 0.0,
        family: Family::Implicit(&implicit::SDIRK2),
    },
];

/// The method of this name, in either case, or an error that lists the known ones.
pub fn find(word: &str) -> Result<&'static Method> {
    METHODS
        .iter()
        .find(|m| m.name.eq_ignore_ascii_case(word))
        .ok_or_else(|| Error::unknown("integrator", word, METHODS.iter().map(|m| m.name)))
}

/// Bounds on a linear(ised) operator with real eigenvalues of one sign, in 1/time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// At least the largest |eigenvalue|.
    pub spectral: f64,
    /// The largest row sum: 1/diagonal is the largest Euler step that keeps the maximum principle.
    pub diagonal: f64,
}

#[derive(Debug, Clone)]
pub struct Options {
    /// Stages of a stabilised method, pinned so that orders can be measured; chosen from the step where `None`.
    /// Explicit methods have their own number.
    pub stages: Option<u32>,
    /// Most stages of a stabilised method per sub-step; more sub-steps are taken instead.
    pub max_stages: u32,
    /// Keep sub-steps within `ssp / diagonal`; asks nothing of methods whose `ssp` is zero.
    pub keep_bounds: bool,
    /// Most applications of the operator in one step.
    pub max_applications: u64,
    /// How far an implicit method solves its equations.
    pub limits: Limits,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            stages: None,
            max_stages: stabilised::MAX_STAGES,
            keep_bounds: false,
            max_applications: 1_000_000,
            limits: Limits::default(),
        }
    }
}

/// How a step is taken: `substeps` equal sub-steps of `dt`, each with `stages` applications of the operator
/// (implicit methods: solves).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    pub substeps: u64,
    pub stages: u32,
    /// Length of each sub-step: `total / substeps`, rounded once.
    pub dt: f64,
    /// The whole step, as asked for.
    pub total: f64,
    pub limits: Limits,
}

impl Schedule {
    pub fn applications(&self) -> u64 {
        self.substeps.saturating_mul(u64::from(self.stages))
    }

    /// Time from the beginning of the step to that of sub-step `k`: 0 for the first, `total` to the bit for
    /// `k = substeps`.
    pub fn start(&self, k: u64) -> f64 {
        if k >= self.substeps { self.total } else { self.dt * k as f64 }
    }
}

impl Method {
    /// The fewest equal sub-steps, each with the fewest stages, that are stable under `bounds`. A step of zero has no
    /// sub-steps; one without stiffness has one.
    ///
    /// Errors: `StepTooLarge` beyond `max_applications`; `BadValue` for a dt or a bound that is negative or not
    /// finite, and for a number of stages with which the method does not exist.
    pub fn schedule(&self, dt: f64, bounds: Bounds, options: &Options) -> Result<Schedule> {
        for (what, value) in [("dt", dt), ("spectral", bounds.spectral), ("diagonal", bounds.diagonal)] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::bad(what, value, "it must be finite and not negative"));
            }
        }
        let (most, limits) = (self.most_stages(options)?, options.limits);
        if dt == 0.0 {
            return Ok(Schedule { substeps: 0, stages: most, dt: 0.0, total: 0.0, limits });
        }
        let mut needed = dt * (bounds.spectral / self.interval(most));
        if options.keep_bounds && self.ssp > 0.0 {
            needed = needed.max(dt * (bounds.diagonal / self.ssp));
        }
        // As a float, because it may exceed every integer; infinity saturates.
        let substeps = needed.ceil().max(1.0);
        let part = dt / substeps;
        let stages = self.fewest_stages(part * bounds.spectral, most, options);
        let applications = substeps * f64::from(stages);
        if applications > options.max_applications as f64 {
            let (allowed, remedy) = (options.max_applications, self.remedy().into());
            return Err(Error::StepTooLarge { dt, needed: applications, allowed, remedy });
        }
        Ok(Schedule { substeps: substeps as u64, stages, dt: part, total: dt, limits })
    }

    /// The largest stable sub-step with the fewest stages the method takes: the length of its real stability interval
    /// over the spectral bound. Infinite where nothing is stiff.
    pub fn limit(&self, bounds: Bounds) -> f64 {
        let fewest = match self.family {
            Family::Explicit(tableau) => tableau.stages(),
            Family::Stabilised(_) => stabilised::LEAST_STAGES,
            Family::Implicit(tableau) => tableau.solves(),
        };
        self.interval(fewest) / bounds.spectral
    }

    /// What takes a step with fewer applications.
    pub fn remedy(&self) -> &'static str {
        if self.is_stabilised() { "choose integrator=auto or sdirk2" } else { "choose integrator=auto or rkl2" }
    }

    /// Whether stages are neither solved for nor as many as dt needs.
    pub fn is_explicit(&self) -> bool {
        matches!(self.family, Family::Explicit(_))
    }

    /// Whether the number of stages follows from the step.
    pub fn is_stabilised(&self) -> bool {
        matches!(self.family, Family::Stabilised(_))
    }

    /// Whether stages are solved for: any step is stable, and bounds on the operator are not needed.
    pub fn is_implicit(&self) -> bool {
        matches!(self.family, Family::Implicit(_))
    }

    /// z such that the method is stable for real eigenvalues in [-z / dt, 0].
    pub fn interval(&self, stages: u32) -> f64 {
        match self.family {
            Family::Explicit(tableau) => tableau.interval,
            Family::Stabilised(recursion) => (recursion.interval)(f64::from(stages)),
            Family::Implicit(_) => f64::INFINITY,
        }
    }

    /// One sub-step of `schedule.dt` from (t, y), in place. An error of the system is passed on and leaves y as it was.
    pub fn advance(
        &self,
        schedule: &Schedule,
        system: &mut dyn System,
        pool: &Pool,
        t: f64,
        y: &mut [f64],
        work: &mut Work,
    ) -> Result<()> {
        (work.slack, work.rounding, work.tally) = (0.0, 0.0, Tally::default());
        match self.family {
            Family::Explicit(tableau) => tableau.advance(schedule.dt, system, pool, t, y, work),
            Family::Stabilised(recursion) => recursion.advance(schedule, system, pool, t, y, work),
            Family::Implicit(tableau) => tableau.advance(schedule, system, pool, t, y, work),
        }
    }

    fn most_stages(&self, options: &Options) -> Result<u32> {
        let recursion = match self.family {
            Family::Explicit(tableau) => return Ok(tableau.stages()),
            Family::Implicit(tableau) => return Ok(tableau.solves()),
            Family::Stabilised(recursion) => recursion,
        };
        match options.stages {
            Some(s) if s < recursion.least => {
                Err(Error::bad("stages", s, &format!("{} needs at least {}", self.name, recursion.least)))
            }
            Some(s) => Ok(s),
            None if options.max_stages < stabilised::LEAST_STAGES => {
                let rule = format!("{} takes at least {} stages", self.name, stabilised::LEAST_STAGES);
                Err(Error::bad("max_stages", options.max_stages, &rule))
            }
            None => Ok((options.max_stages - 1) | 1),
        }
    }

    fn fewest_stages(&self, z: f64, most: u32, options: &Options) -> u32 {
        match self.family {
            Family::Stabilised(_) if options.stages.is_none() => {
                // Halving: the interval grows with the number of stages.
                let odd = |i: u32| stabilised::LEAST_STAGES + 2 * i;
                let (mut low, mut high) = (0, (most - stabilised::LEAST_STAGES) / 2);
                while low < high {
                    let middle = low + (high - low) / 2;
                    if self.interval(odd(middle)) >= z { high = middle } else { low = middle + 1 }
                }
                odd(low)
            }
            _ => most,
        }
    }
}

/// The arrays a sub-step works on: reserved by the first sub-step, reused by all others of the same length.
#[derive(Debug, Default)]
pub struct Work {
    arrays: [Vec<f64>; 10],
    /// How far the last sub-step may be from the solution of its equations: 0 for explicit methods.
    pub slack: f64,
    /// The part of it that is rounding, where y exchanges with an outside that keeps no account.
    pub rounding: f64,
    /// Iterations of conjugate gradients so far.
    pub iterations: u64,
    /// What the last sub-step has added to what is tallied.
    pub tally: Tally,
}

impl Work {
    pub fn bytes(&self) -> u64 {
        self.arrays.iter().map(memory::bytes).sum()
    }

    /// `K` arrays of length `n`, with anything in them.
    fn arrays<const K: usize>(&mut self, n: usize) -> Result<&mut [Vec<f64>; K]> {
        let arrays = self.arrays.first_chunk_mut::<K>();
        let arrays = arrays.ok_or_else(|| Error::Panic { reason: "an integrator asks for too many arrays".into() })?;
        for array in arrays.iter_mut().filter(|a| a.len() != n) {
            *array = memory::filled("stages of the integrator", n, 0.0)?;
        }
        Ok(arrays)
    }
}

#[cfg(test)]
mod adaptive_tests;
#[cfg(test)]
mod implicit_tests;
#[cfg(test)]
mod tests;
