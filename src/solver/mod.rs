//! The handle: create, set, step, get. What each call does is in the rooms below; here is what it is called, what it
//! accepts and what it answers.
//!
//! | file | what it holds |
//! |---|---|
//! | `mod` | create, set, step |
//! | `query` | get: fields and numbers, computed when asked for |
//! | `files` | particles from and to VTK files |
//! | `restart` | what a snapshot holds so that a run goes on from it |
//! | `frame` | how a plane or a line lies in a file |
//! | `recommend` | what reaches an error cheapest on the particles that a host has |
//! | `trial` | the same particles with other words |
//! | `catalogue` | what can be chosen, by name |

pub mod catalogue;
mod files;
pub mod frame;
mod query;
pub mod recommend;
mod restart;
pub mod trial;

use crate::array::{Strided, StridedMut};
use crate::error::{Error, Result};
use crate::memory;
use crate::model::conductivity::Law;
use crate::model::fields::{self, Access, Domain, FIELDS, NUMBERS};
use crate::model::heat::Callback;
use crate::plan::given::{Offer, Offered};
use crate::plan::report::Progress;
use crate::plan::state::{Input, State};
use crate::plan::{Choices, Plan, Report};
use crate::space::{self, OTHER_UNITS, lengths, rule_of_lengths};
use frame::Frame;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A diffusion solver on a set of particles.
///
/// ```
/// # fn main() -> diffusph::error::Result<()> {
/// use diffusph::{Solver, Strided};
/// let n = 100;
/// let x: Vec<f64> = (0..n).map(|i| (i as f64 + 0.5) / n as f64).collect();
/// let t: Vec<f64> = x.iter().map(|x| (2.0 * std::f64::consts::PI * x).sin()).collect();
///
/// let mut solver = Solver::new("heat dim=1 kernel=M6 integrator=rkl2")?;
/// solver.set_box(&[0.0], &[1.0], &[true])?;
/// solver.set_particles(Strided::packed(&x))?;
/// solver.set_number("m", 1.0 / n as f64)?;
/// solver.set_number("kappa", 1.0)?;
/// solver.set("T", Strided::packed(&t))?;
/// let report = solver.step(0.01)?;
/// let decay = report.t_max / t.iter().cloned().fold(0.0, f64::max);
/// assert!((decay - (-0.04 * std::f64::consts::PI.powi(2)).exp()).abs() < 2e-3);
/// # Ok(())
/// # }
/// ```
pub struct Solver {
    state: State,
    frame: Frame,
}

impl Solver {
    /// A solver from words like `heat dim=3 kernel=M6 operator=kernel integrator=rkl2`; the catalogue `words` lists
    /// them all.
    ///
    /// # Errors
    /// `UnknownWord` with the nearest known word, `BadValue`.
    pub fn new(words: &str) -> Result<Solver> {
        let state = State::new(Choices::parse(words)?)?;
        Ok(Solver { frame: Frame::first(state.dim()), state })
    }

    pub fn dim(&self) -> usize {
        self.state.dim()
    }

    /// Whether a step could be prepared: nothing is missing.
    ///
    /// # Errors
    /// As [`Solver::plan`]; `OutOfOrder` naming what must be set before `call`.
    pub fn ready(&mut self, call: &str) -> Result<()> {
        self.state.prepare_fresh(call).map(drop)
    }

    /// Number of particles; 0 before `set_particles`.
    pub fn len(&self) -> usize {
        self.state.len()
    }

    pub fn is_empty(&self) -> bool {
        self.state.is_empty()
    }

    /// The words it was created with.
    pub fn words(&self) -> &str {
        &self.state.choices.line
    }

    /// The box: bounds and whether it is periodic, per axis. Without it, space is open.
    ///
    /// # Errors
    /// `WrongCount` unless each has `dim` values; `BadElement` for bounds that are not finite or a periodic axis
    /// without length.
    pub fn set_box(&mut self, lo: &[f64], hi: &[f64], periodic: &[bool]) -> Result<()> {
        for (name, len) in [("lo", lo.len()), ("hi", hi.len()), ("periodic", periodic.len())] {
            expect(name, len, self.dim(), "one value per axis")?;
        }
        self.state.set_box(space::Domain::new(lo, hi, periodic)?)
    }

    /// Positions, `dim` components each. The same number again moves the particles, which keep all else. Where the number
    /// changes, what was given per particle must be given again, or as one number: until then, calls that need it answer
    /// `OutOfOrder`.
    ///
    /// # Errors
    /// `WrongCount`, `BadElement` naming the first coordinate that is not finite, `NoMemory`.
    pub fn set_particles(&mut self, x: Strided) -> Result<()> {
        self.set_particles_with(x, &[])
    }

    /// Positions together with inputs per particle: all of them are taken, or nothing is changed.
    ///
    /// # Errors
    /// As [`Solver::set_particles`] and [`Solver::set`].
    pub fn set_particles_with(&mut self, x: Strided, given: &[(&str, Strided)]) -> Result<()> {
        expect("x", x.components(), self.dim(), "dim components per particle")?;
        x.check("x", "coordinates must be finite", f64::is_finite)?;
        let mut slots = Vec::new();
        for (name, values) in given {
            let slot = fields::slot(name)?;
            check(slot, name, values, (x.len(), self.dim()))?;
            slots.push((slot, Offered::Each(*values)));
        }
        let domain = self.state.domain.clone();
        self.state.accept(&Offer { domain, x, given: &slots, energy: None, anew: false })?;
        self.forget_functions(slots.iter().map(|(slot, _)| *slot));
        Ok(())
    }

    /// Setting a quantity takes a function away that gave it.
    fn forget_functions(&mut self, slots: impl Iterator<Item = fields::Slot>) {
        for slot in slots {
            if slot == fields::KAPPA && self.state.kappa_of_t() {
                self.state.set_kappa_of_t(None, None);
            }
            if slot == fields::SOURCE {
                self.state.source_host = None;
            }
        }
    }

    /// A quantity for each particle; the catalogue `fields` lists them.
    ///
    /// # Errors
    /// `UnknownWord`, `OutOfOrder` before `set_particles`, `WrongCount`, `BadElement` naming the first bad value.
    pub fn set(&mut self, name: &str, values: Strided) -> Result<()> {
        if name == "x" {
            expect("x", values.len(), self.len(), "one position per particle")?;
            return self.set_particles(values);
        }
        if let Some(slots) = fields::group(name, self.dim()) {
            expect(name, values.components(), slots.len(), "one component for each")?;
            self.state.cloud("set")?;
            let mut parts = Vec::new();
            for (component, &slot) in slots.iter().enumerate() {
                let (name, part) = (FIELDS[slot].name, values.component(component));
                check(slot, name, &part, (self.len(), self.dim()))?;
                parts.push((slot, Input::Each(self.state.cloud("set")?.inward(name, part, 0)?)));
            }
            // None of these can fail any more.
            return parts.into_iter().try_for_each(|(slot, input)| self.put(slot, input));
        }
        let energy = name == "u";
        let slot = if energy { fields::T } else { fields::slot(name)? };
        let cloud = self.state.cloud("set")?;
        check(slot, name, &values, (self.len(), self.dim()))?;
        let values = Input::Each(cloud.inward(name, values, 0)?);
        if energy { self.state.put_energy(values) } else { self.put(slot, values) }
    }

    /// One value for all particles, or a number of the solver such as `time` or `sigma_SB`.
    ///
    /// # Errors
    /// `UnknownWord`, `BadValue`.
    pub fn set_number(&mut self, name: &str, value: f64) -> Result<()> {
        let own = NUMBERS.iter().find(|n| n.name == name);
        let domain = match own {
            Some(number) => number.settable,
            None if name == "u" => Some(Domain::Finite),
            None => match FIELDS[fields::slot(name)?].access {
                Access::Input { domain, .. } => Some(domain),
                Access::Output { .. } => None,
            },
        };
        match domain {
            None => return Err(Error::bad("name", format!("'{name}'"), "it is a result, it cannot be set")),
            Some(domain) if !domain.holds(value) => return Err(Error::bad(name, value, domain.rule())),
            Some(_) if name == "h" && !lengths(self.dim()).contains(&value) => {
                return Err(Error::bad(name, value, &rule_of_lengths(self.dim(), OTHER_UNITS)));
            }
            Some(_) => {}
        }
        match name {
            "time" => self.state.time = value,
            "sigma_SB" => self.state.set_sigma_sb(value),
            "u" => self.state.put_energy(Input::Number(value))?,
            _ => self.put(fields::slot(name)?, Input::Number(value))?,
        }
        Ok(())
    }

    fn put(&mut self, slot: fields::Slot, input: Input) -> Result<()> {
        self.state.put(slot, input)?;
        self.forget_functions([slot].into_iter());
        Ok(())
    }

    /// kappa(T) in words: `power kappa0=1 T0=300 n=2.5`, `table T=300,400 kappa=1,2`; the catalogue `laws`.
    ///
    /// # Errors
    /// `UnknownWord` for a name other than `kappa` or an unknown law, `BadValue`.
    pub fn set_law(&mut self, name: &str, words: &str) -> Result<()> {
        if name != "kappa" {
            return Err(Error::unknown("quantity with laws", name, ["kappa"]));
        }
        self.state.set_kappa_of_t(Some(Law::parse(words)?), None);
        Ok(())
    }

    /// kappa(T) by a function; none takes it away.
    pub fn set_kappa_callback(&mut self, callback: Option<Callback>) {
        self.state.set_kappa_of_t(None, callback);
    }

    /// Heat released per volume by a function, in place of `source`; none takes it away, and so does setting `source`.
    pub fn set_source_callback(&mut self, callback: Option<Callback>) {
        self.state.source_host = callback;
    }

    /// Called between sub-steps; an answer other than 0 cancels the step.
    pub fn set_progress_callback(&mut self, callback: Option<Progress>) {
        self.state.progress = callback;
    }

    /// Setting it from any thread makes the running call stop with `Cancelled`.
    pub fn canceller(&self) -> Arc<AtomicBool> {
        self.state.pool.canceller()
    }

    /// Advances by exactly `dt`, in as many sub-steps as the method needs.
    ///
    /// # Errors
    /// See [`State::step`]; whatever goes wrong, T and time are as they were.
    pub fn step(&mut self, dt: f64) -> Result<Report> {
        self.begin();
        self.state.step(dt)
    }

    /// du/dt now, W/kg, for hosts that integrate themselves.
    ///
    /// # Errors
    /// As [`Solver::get`].
    pub fn rate(&mut self, out: StridedMut) -> Result<()> {
        self.get("rate", out)
    }

    /// The largest stable explicit Euler step now, s; infinite where nothing diffuses.
    pub fn limit(&mut self) -> Result<f64> {
        self.begin();
        self.state.limit()
    }

    /// What a step will do, and what it leaves out and why.
    pub fn plan(&mut self) -> Result<Plan> {
        self.begin();
        self.state.plan()
    }

    /// Seconds spent in each pass so far, and how often the operator was applied.
    pub fn spent(&self) -> (Vec<(&'static str, f64)>, u64) {
        (self.state.timers.seconds().collect(), self.state.applications)
    }

    /// How often a pass has run so far, by its name in the plan.
    pub fn runs(&self, pass: &str) -> u64 {
        self.state.timers.runs(pass)
    }

    /// Forgets the worker threads, which do not exist in a forked child; for a handle that is thrown away there.
    pub fn abandon(self) {
        self.state.pool.abandon();
    }
}

/// Whether an input has one value per particle, each of which makes sense.
fn check(slot: fields::Slot, name: &str, values: &Strided, (n, dim): (usize, usize)) -> Result<()> {
    expect(name, values.len(), n, "one value per particle")?;
    expect(name, values.components(), 1, "one component")?;
    match FIELDS[slot].access {
        Access::Input { domain, .. } => values.check(name, domain.rule(), |v| domain.holds(v))?,
        Access::Output { .. } => {}
    }
    if slot != fields::H {
        return Ok(());
    }
    let among = lengths(dim);
    values.check(name, &rule_of_lengths(dim, OTHER_UNITS), |h| among.contains(&h))
}

pub(crate) fn expect(name: &str, got: usize, expected: usize, remedy: &str) -> Result<()> {
    if got == expected {
        return Ok(());
    }
    let (got, expected) = (got as i64, expected as i64);
    Err(Error::WrongCount { argument: name.into(), got, expected, remedy: remedy.into() })
}

/// Splits vectors into their components.
fn columns(vectors: &[[f64; 3]], dim: usize) -> Result<Vec<Vec<f64>>> {
    (0..dim).map(|a| memory::collected("components", vectors.iter().map(|v| v[a]))).collect()
}
