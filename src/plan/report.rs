//! What a step did, and what it took.

use crate::integrator::Tally;
use std::time::{Duration, Instant};

/// Of one step, and where the time went since the solver was created.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Report {
    pub time: f64,
    pub dt: f64,
    pub substeps: u64,
    /// Stages of the last sub-step.
    pub stages: u64,
    /// Applications of the operator, those of bounds and of solvers included.
    pub applications: u64,
    /// A stable explicit step, s, from the bounds that the step needed; `limit` finds the largest. After an implicit step
    /// what Gershgorin's circles prove, which is less.
    pub limit: f64,
    pub t_min: f64,
    pub t_max: f64,
    /// Σ m c_v T before and after, J.
    pub energy_before: f64,
    pub energy: f64,
    /// By what heat came in, J, negative where it went out: sources, exchange at surfaces, and particles of fixed T with
    /// their neighbours; where T is free, they add up to `energy` − `energy_before`. What an operator makes that does not
    /// conserve counts with the last, where some T is fixed.
    pub heat_source: f64,
    pub heat_surface: f64,
    pub heat_fixed: f64,
    pub seconds: f64,
    /// Sub-steps that were done again, shorter, for `tolerance`.
    pub rejected: u64,
    /// The method that took it.
    pub integrator: &'static str,
    /// Iterations of conjugate gradients, of implicit methods.
    pub iterations: u64,
}

impl Report {
    /// Adds what sources and surfaces have brought in.
    pub fn came_in(&mut self, factor: f64, [source, surface]: Tally) {
        self.heat_source += factor * source;
        self.heat_surface += factor * surface;
    }
}

/// Of a pass: what the plan and the clock call it. They are made in the table of passes and nowhere else.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Name(pub &'static str);

/// Told what time is reached, and which share of the step is done; an answer other than 0 cancels.
pub type Progress = Box<dyn FnMut(f64, f64) -> i32 + Send>;

/// Seconds per pass and how often it ran, summed over the life of a solver.
#[derive(Debug, Clone, Default)]
pub struct Timers {
    list: Vec<(Name, Duration, u64)>,
}

impl Timers {
    /// Runs a pass on its clock.
    pub fn time<T>(&mut self, pass: Name, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        self.add(pass, start.elapsed());
        result
    }

    pub fn add(&mut self, pass: Name, spent: Duration) {
        match self.list.iter_mut().find(|(name, ..)| *name == pass) {
            Some((_, total, runs)) => (*total, *runs) = (*total + spent, *runs + 1),
            None => self.list.push((pass, spent, 1)),
        }
    }

    /// Passes in the order in which they first ran, with seconds.
    pub fn seconds(&self) -> impl Iterator<Item = (&'static str, f64)> {
        self.list.iter().map(|(pass, spent, _)| (pass.0, spent.as_secs_f64()))
    }

    /// How often a pass ran.
    pub fn runs(&self, pass: &str) -> u64 {
        self.list.iter().find(|(timed, ..)| timed.0 == pass).map_or(0, |(.., runs)| *runs)
    }
}
