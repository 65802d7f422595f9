//! The same particles with other words: what another choice would have answered, and how fast.

use super::Solver;
use crate::array::Strided;
use crate::error::{Error, Result};
use crate::memory;
use crate::model::fields::{self, FIELDS, INPUTS};
use crate::plan::given::{Offer, Offered};
use crate::plan::state::{Input, State};
use crate::space::Domain;
use std::time::{Duration, Instant};

/// What other words made of the particles.
pub struct Trial {
    /// After the step, in the host's order.
    pub t: Vec<f64>,
    /// From particles to answer: neighbours, weights and the step.
    pub seconds: f64,
}

impl Solver {
    /// A step of `dt` with other words on the same particles: this solver stays as it is. Smoothing lengths follow from
    /// the words' h_fac; those that the host has given are left aside. Functions of kappa and of the source are lent;
    /// a step that lasts longer than `patience` is given up, and answers nothing.
    ///
    /// # Errors
    /// As [`Solver::new`] and [`Solver::step`]; `OutOfOrder` before particles are set; `Cancelled`.
    pub fn attempt(&mut self, words: &str, dt: f64, patience: Duration) -> Result<Option<Trial>> {
        let mut other = Solver::new(words)?;
        super::expect("dim", other.dim(), self.dim(), "a trial has the dimensions of its particles")?;
        let (n, dim, x) = (self.len(), self.dim(), self.fetch_all("x")?);
        let inputs = self.inputs_by_host()?;
        let start = Instant::now();
        self.hand_over(&mut other.state, Strided::new("x", &x, n, dim, dim)?, inputs)?;
        other.state.pool.obey(self.canceller());
        other.set_progress_callback(Some(Box::new(move |_, _| i32::from(start.elapsed() > patience))));
        self.lend(&mut other.state);
        let done = other.state.step(dt);
        self.lend(&mut other.state);
        let seconds = start.elapsed().as_secs_f64();
        match done {
            Ok(_) => Ok(Some(Trial { t: other.fetch_all("T")?, seconds })),
            Err(Error::Cancelled) if self.state.pool.go_on().is_ok() => Ok(None),
            Err(e) => Err(e),
        }
    }

    /// Tells the host which share of several trials is done.
    ///
    /// # Errors
    /// `Cancelled` where it wants no more, or has called cancel.
    pub fn tell(&mut self, share: f64) -> Result<()> {
        let time = self.state.time;
        let refused = self.state.progress.as_mut().is_some_and(|progress| progress(time, share) != 0);
        if refused { Err(Error::Cancelled) } else { self.state.pool.go_on() }
    }

    /// Forgets that an earlier call was cancelled.
    pub fn begin(&mut self) {
        self.state.pool.begin();
    }

    /// The box, or open space.
    pub fn domain(&self) -> &Domain {
        &self.state.domain
    }

    /// Whether kappa was given as a tensor.
    pub fn has_tensor(&self) -> bool {
        self.state.has_tensor()
    }

    /// Inputs as they were given, in the host's order; h follows from h_fac.
    fn inputs_by_host(&self) -> Result<[Input; INPUTS]> {
        let cloud = self.state.cloud("a trial")?;
        let mut inputs = [const { Input::Unset }; INPUTS];
        for (slot, input) in inputs.iter_mut().enumerate().filter(|(slot, _)| *slot != fields::H) {
            *input = match &self.state.inputs[slot] {
                Input::Each(values) => {
                    let mut by_host = memory::filled(FIELDS[slot].name, values.len(), 0.0)?;
                    cloud.host.iter().zip(values).for_each(|(&host, v)| by_host[host as usize] = *v);
                    Input::Each(by_host)
                }
                other => other.clone(),
            };
        }
        Ok(inputs)
    }

    fn hand_over(&self, other: &mut State, x: Strided, inputs: [Input; INPUTS]) -> Result<()> {
        let own = &self.state;
        self.state.refuse_lost("a trial", 0..INPUTS)?;
        (other.time, other.sigma_sb, other.law) = (own.time, own.sigma_sb, own.law.clone());
        let mut given = Vec::new();
        for (slot, input) in inputs.iter().enumerate() {
            match input {
                Input::Unset => {}
                Input::Number(v) => given.push((slot, Offered::Number(*v))),
                Input::Each(values) => given.push((slot, Offered::Each(Strided::packed(values)))),
            }
        }
        other.accept(&Offer { domain: own.domain.clone(), x, given: &given, energy: None, anew: true })
    }

    /// Exchanges the host's functions; called twice, they are back.
    fn lend(&mut self, other: &mut State) {
        std::mem::swap(&mut self.state.kappa_host, &mut other.kappa_host);
        std::mem::swap(&mut self.state.source_host, &mut other.source_host);
    }
}
