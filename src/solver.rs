//! The handle: create, set, step, get. What each call does is in the rooms below; here is what it is called, what it
//! accepts and what it answers.

use crate::array::{Strided, StridedMut};
use crate::error::{Error, Result};
use crate::integrator;
use crate::io::{self, Columns};
use crate::kernel;
use crate::memory;
use crate::model::conductivity::{LAWS, Law};
use crate::model::fields::{self, Access, FIELDS, Field, NUMBERS};
use crate::model::heat::Callback;
use crate::model::MODELS;
use crate::operator::{gradient, mean::MEANS, moments, table::OPERATORS};
use crate::plan::choices::{Choices, WORDS};
use crate::plan::state::{Input, Progress, State};
use crate::plan::{Plan, Report, rules::RULES};
use crate::space::{Domain, density, rows::Rows};
use std::path::Path;
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
}

impl Solver {
    /// A solver from words like `heat dim=3 kernel=M6 operator=kernel integrator=rkl2`; [`catalogue`] `words` lists
    /// them all.
    ///
    /// # Errors
    /// `UnknownWord` with the nearest known word, `BadValue`.
    pub fn new(words: &str) -> Result<Solver> {
        Ok(Solver { state: State::new(Choices::parse(words)?)? })
    }

    pub fn dim(&self) -> usize {
        self.state.dim()
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
            self.expect(name, len, self.dim(), "one value per axis")?;
        }
        self.state.set_box(Domain::new(lo, hi, periodic)?)
    }

    /// Positions, `dim` components each. The same number again moves the particles, which keep all else; another
    /// number starts anew, and what was given per particle must be given again.
    ///
    /// # Errors
    /// `WrongCount`, `BadElement` naming the first coordinate that is not finite, `NoMemory`.
    pub fn set_particles(&mut self, x: Strided) -> Result<()> {
        self.expect("x", x.components(), self.dim(), "dim components per particle")?;
        self.state.set_positions(x)
    }

    /// A quantity for each particle; [`catalogue`] `fields` lists them.
    ///
    /// # Errors
    /// `UnknownWord`, `OutOfOrder` before `set_particles`, `WrongCount`, `BadElement` naming the first bad value.
    pub fn set(&mut self, name: &str, values: Strided) -> Result<()> {
        if name == "x" {
            self.expect("x", values.len(), self.len(), "one position per particle")?;
            return self.set_particles(values);
        }
        if name == "u" {
            return self.set_u(values);
        }
        let slot = fields::slot(name)?;
        self.state.cloud("set")?;
        self.expect(name, values.len(), self.len(), "one value per particle")?;
        self.expect(name, values.components(), 1, "one component")?;
        let Access::Input { domain, .. } = FIELDS[slot].access else { return Ok(()) };
        values.check(name, domain.rule(), |v| domain.holds(v))?;
        let values = self.state.cloud("set")?.inward(name, values, 0)?;
        self.state.put(slot, Input::Each(values));
        if slot == fields::KAPPA {
            self.forget_kappa_of_t();
        }
        Ok(())
    }

    /// Energy per mass, in place of T = u/c_v.
    fn set_u(&mut self, values: Strided) -> Result<()> {
        let cloud = self.state.cloud("set")?;
        self.expect("u", values.len(), self.len(), "one value per particle")?;
        self.expect("u", values.components(), 1, "one component")?;
        values.check("u", "it must be finite", f64::is_finite)?;
        let mut t = cloud.inward("u", values, 0)?;
        let c_v = self.state.each(fields::C_V)?;
        t.iter_mut().zip(c_v).for_each(|(t, c_v)| *t /= c_v);
        self.state.put(fields::T, Input::Each(t));
        Ok(())
    }

    /// One value for all particles, or a number of the solver such as `time` or `sigma_SB`.
    ///
    /// # Errors
    /// `UnknownWord`, `BadValue`.
    pub fn set_number(&mut self, name: &str, value: f64) -> Result<()> {
        if let Some(number) = NUMBERS.iter().find(|n| n.name == name) {
            return self.set_own_number(number, value);
        }
        let slot = fields::slot(name)?;
        let Access::Input { domain, .. } = FIELDS[slot].access else { return Ok(()) };
        if !domain.holds(value) {
            return Err(Error::bad(name, value, domain.rule()));
        }
        self.state.put(slot, Input::Number(value));
        if slot == fields::KAPPA {
            self.forget_kappa_of_t();
        }
        Ok(())
    }

    fn set_own_number(&mut self, number: &fields::Number, value: f64) -> Result<()> {
        match number.settable {
            None => return Err(Error::bad("name", format!("'{}'", number.name), "it is a result, it cannot be set")),
            Some(domain) if !domain.holds(value) => return Err(Error::bad(number.name, value, domain.rule())),
            Some(_) => {}
        }
        if number.name == "time" {
            self.state.time = value;
        } else {
            self.state.sigma_sb = value;
            (self.state.surface, self.state.bounds) = (None, None);
        }
        Ok(())
    }

    /// kappa(T) in words: `power kappa0=1 T0=300 n=2.5`, `table T=300,400 kappa=1,2`; [`catalogue`] `laws`.
    ///
    /// # Errors
    /// `UnknownWord` for a name other than `kappa` or an unknown law, `BadValue`.
    pub fn set_law(&mut self, name: &str, words: &str) -> Result<()> {
        if name != "kappa" {
            return Err(Error::unknown("quantity with laws", name, ["kappa"]));
        }
        let law = Law::parse(words)?;
        self.forget_kappa_of_t();
        self.state.law = Some(law);
        self.state.drop_kappa();
        Ok(())
    }

    /// kappa(T) by a function; none takes it away.
    pub fn set_kappa_callback(&mut self, callback: Option<Callback>) {
        self.forget_kappa_of_t();
        self.state.kappa_host = callback;
        self.state.drop_kappa();
    }

    /// Heat released per volume by a function, in place of `source`; none takes it away.
    pub fn set_source_callback(&mut self, callback: Option<Callback>) {
        self.state.source_host = callback;
    }

    /// Called between sub-steps; an answer other than 0 cancels the step.
    pub fn set_progress_callback(&mut self, callback: Option<Progress>) {
        self.state.progress = callback;
    }

    fn forget_kappa_of_t(&mut self) {
        if self.state.kappa_of_t() {
            (self.state.law, self.state.kappa_host) = (None, None);
            self.state.drop_kappa();
        }
    }

    /// Setting it from any thread makes the running step stop with `Cancelled`.
    pub fn canceller(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.state.cancel)
    }

    /// Advances by exactly `dt`, in as many sub-steps as the method needs.
    ///
    /// # Errors
    /// See [`State::step`]; whatever goes wrong, T and time are as they were.
    pub fn step(&mut self, dt: f64) -> Result<Report> {
        self.state.step(dt)
    }

    /// du/dt now, W/kg, for hosts that integrate themselves.
    pub fn rate(&mut self, out: StridedMut) -> Result<()> {
        self.get("rate", out)
    }

    /// The largest stable explicit Euler step now; infinite where nothing diffuses.
    pub fn limit(&mut self) -> Result<f64> {
        self.state.limit()
    }

    /// What a step will do, and what it leaves out and why.
    pub fn plan(&mut self) -> Result<Plan> {
        self.state.plan()
    }

    /// Seconds spent in each pass so far.
    pub fn seconds(&self) -> Vec<(&'static str, f64)> {
        self.state.timers.seconds().collect()
    }

    /// A quantity of each particle, in the host's order; [`catalogue`] `fields`. Derived ones are computed now.
    ///
    /// # Errors
    /// `UnknownWord`, `WrongCount`, `OutOfOrder`; nothing is written then.
    pub fn get(&mut self, name: &str, mut out: StridedMut) -> Result<()> {
        let field = fields::field(name)?;
        self.state.cloud("get")?;
        let components = if field.vector { self.dim() } else { 1 };
        self.expect(name, out.len(), self.len(), "one value per particle")?;
        self.expect(name, out.components(), components, "dim components for vectors, else 1")?;
        let values = self.values(field)?;
        let cloud = self.state.cloud("get")?;
        for (c, values) in values.iter().enumerate() {
            cloud.host.iter().zip(values).for_each(|(&host, &v)| out.set(host as usize, c, v));
        }
        Ok(())
    }

    /// The components of a field, each in internal order.
    fn values(&mut self, field: &Field) -> Result<Vec<Vec<f64>>> {
        let state = &mut self.state;
        let one = |v: Vec<f64>| Ok(vec![v]);
        match field.name {
            "x" => state.cloud("get")?.x[..state.dim()].iter().map(|x| memory::copied("x", x)).collect(),
            "rho" | "h" | "area" => one(self.geometric(field.name)?),
            "u" => self.scaled_by_c_v(fields::T).map(|v| vec![v]),
            "dT_dt" => one(state.rate()?),
            "rate" => {
                let (mut rate, c_v) = (state.rate()?, state.each(fields::C_V)?);
                rate.iter_mut().zip(c_v).for_each(|(rate, c_v)| *rate *= c_v);
                one(rate)
            }
            "kappa" if state.kappa_of_t() => one(self.evaluated_kappa()?),
            "K_d2" => {
                state.prepare("get")?;
                one(state.weights.as_ref().map_or(Vec::new(), |w| w.moments.clone()))
            }
            "neighbours" => {
                state.prepare("get")?;
                let matrix = state.weights.as_ref().map(|w| &w.matrix);
                one((0..state.len()).map(|i| matrix.map_or(0, |m| m.neighbours(i)) as f64).collect())
            }
            "first_moment" => {
                state.prepare_geometry("get")?;
                let same_h = state.geometry.as_ref().is_some_and(|g| g.same_h);
                let found = state.with_assembly(same_h, |a| moments::first(a, &state.pool))?;
                Ok(columns(&found, state.dim()))
            }
            "omega" => {
                let m = state.each(fields::M)?;
                let pool_rows = |rows: &Rows| density::omega(&state.choices.kernel, rows, &m, &state.pool);
                state.prepare_geometry_shared("get")?;
                one(state.with_rows(pool_rows)?)
            }
            "grad_T" => self.gradient(),
            "flux" => {
                let (mut gradient, kappa) = (self.gradient()?, self.evaluated_kappa()?);
                gradient.iter_mut().for_each(|g| g.iter_mut().zip(&kappa).for_each(|(g, k)| *g *= -k));
                Ok(gradient)
            }
            name => {
                let slot = fields::slot(name)?;
                if state.inputs[slot] == Input::Unset && !state.is_empty() {
                    return Err(Error::OutOfOrder { call: format!("get {name}"), missing: format!("set {name}") });
                }
                one(state.each(slot)?)
            }
        }
    }
}
