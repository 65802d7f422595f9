//! What a host may ask for. A derived quantity is computed only when it is asked for.

use super::{Solver, columns, expect};
use crate::array::StridedMut;
use crate::error::{Error, Result};
use crate::memory;
use crate::model::fields::{self, FIELDS, Field, Slot};
use crate::operator::{gradient, moments, tensor};
use crate::plan::state::{Input, State, Weights};
use crate::space::density;
use crate::sum;

impl Solver {
    /// A quantity of each particle, in the host's order; the catalogue `fields` lists them.
    ///
    /// # Errors
    /// `UnknownWord`, `WrongCount`, `OutOfOrder`; nothing is written then.
    pub fn get(&mut self, name: &str, out: StridedMut) -> Result<()> {
        self.begin();
        self.fetch(name, out)
    }

    fn fetch(&mut self, name: &str, mut out: StridedMut) -> Result<()> {
        let field = fields::field(name)?;
        let components = if field.vector { self.dim() } else { 1 };
        self.state.cloud("get")?;
        expect(name, out.len(), self.len(), "one value per particle")?;
        expect(name, out.components(), components, "dim components for vectors, else 1")?;
        self.state.settle_ties()?;
        let values = values(&mut self.state, field)?;
        let cloud = self.state.cloud("get")?;
        for (c, values) in values.iter().enumerate() {
            cloud.host.iter().zip(values).for_each(|(&host, &v)| out.set(host as usize, c, v));
        }
        Ok(())
    }

    /// A quantity of each particle as a packed array.
    ///
    /// # Errors
    /// As [`Solver::get`].
    pub fn get_all(&mut self, name: &str) -> Result<Vec<f64>> {
        self.begin();
        self.fetch_all(name)
    }

    /// As [`Solver::get_all`], within a call that may have been cancelled.
    pub(super) fn fetch_all(&mut self, name: &str) -> Result<Vec<f64>> {
        let components = if fields::field(name)?.vector { self.dim() } else { 1 };
        let n = self.len();
        let mut out = memory::filled(name, n * components, 0.0)?;
        self.fetch(name, StridedMut::new(name, &mut out, n, components, components)?)?;
        Ok(out)
    }

    /// A number of the solver; the catalogue `numbers` lists them.
    ///
    /// # Errors
    /// `UnknownWord`, `OutOfOrder`.
    pub fn get_number(&mut self, name: &str) -> Result<f64> {
        let number = fields::number(name)?;
        self.begin();
        let state = &mut self.state;
        let temperatures = |state: &State| -> Result<Vec<f64>> {
            state.cloud("get_number")?;
            given(state, fields::T)
        };
        let moments = |state: &mut State, fold: fn(f64, f64) -> f64, start: f64| -> Result<f64> {
            Ok(prepared(state)?.moments.iter().copied().fold(start, fold))
        };
        Ok(match number.name {
            "time" => state.time,
            "sigma_SB" => state.sigma_sb,
            "n" => state.len() as f64,
            "energy" => {
                let t = temperatures(state)?;
                for slot in [fields::M, fields::C_V] {
                    needed(state, slot)?;
                }
                state.energy(&t)
            }
            "T_min" => state.extrema(&temperatures(state)?).0,
            "T_max" => state.extrema(&temperatures(state)?).1,
            "limit" => state.limit()?,
            "spectral_bound" => state.bounds()?.spectral,
            "smallest_weight" => {
                prepared(state)?;
                state.weights.as_ref().map_or(0.0, |w| w.matrix.smallest(&state.pool))
            }
            "negative_pairs" => {
                prepared(state)?;
                state.weights.as_ref().map_or(0.0, |w| w.matrix.negative(&state.pool) as f64)
            }
            "mean_neighbours" => {
                let n = state.len().max(1) as f64;
                prepared(state)?.matrix.pairs() as f64 / n
            }
            "K_d2_min" => moments(state, f64::min, f64::INFINITY)?,
            "K_d2_max" => moments(state, f64::max, f64::NEG_INFINITY)?,
            "conduction_defect" => {
                let defect = conduction(state)?;
                sum::rms(&state.pool, defect.len(), |_| 1.0, |i| defect[i])
            }
            "energy_defect" => state.made.share(),
            "bypassed" => {
                state.plan()?;
                state.bypassed.map_or(0.0, |(_, over)| over as f64)
            }
            "growth_rate" => {
                // First, since it may put the particles in another order.
                prepared(state)?;
                let t = temperatures(state)?;
                state.growth(&t)?
            }
            "lowered_orders" => {
                let asked = if state.choices.operator.is_exact() { state.choices.order.into() } else { 0.0 };
                orders(state)?.into_iter().filter(|&order| order < asked).count() as f64
            }
            "ghost_supports" => state.ghost_supports(),
            "bytes" => state.bytes() as f64,
            _ => state.pool.threads() as f64,
        })
    }
}

/// The components of a field, each in internal order.
fn values(state: &mut State, field: &Field) -> Result<Vec<Vec<f64>>> {
    let n = state.len();
    let scalar = match field.name {
        "x" => {
            let dim = state.dim();
            return state.cloud("get")?.x[..dim].iter().map(|x| memory::copied("x", x)).collect();
        }
        "first_moment" => {
            let same_h = geometry(state)?.same_h;
            let joined = state.choices.operator.joins_rows();
            if joined {
                state.prepare_unfolded("get")?;
            }
            let stored = state.weights.as_ref().filter(|_| joined).map(|w| &w.matrix);
            let found = state.with_assembly(same_h, |a| a.first_moments(stored, &state.pool))?;
            return columns(&found, state.dim());
        }
        "grad_T" => {
            geometry(state)?;
            let t = given(state, fields::T)?;
            return gradient_of(state, |a, b| t[b] - t[a]);
        }
        "flux" => return flux(state),
        "b" => return (0..state.dim()).map(|a| given(state, fields::B + a)).collect(),
        "rho" => memory::copied("rho", &geometry(state)?.rho)?,
        "h" => memory::copied("h", &geometry(state)?.h)?,
        "area" => {
            geometry(state)?;
            state.refuse_lost("get area", [fields::AREA])?;
            state.areas(|_| true)?
        }
        "u" => {
            needed(state, fields::T)?;
            needed(state, fields::C_V)?;
            state.energies()?.view(n)?.into_owned()
        }
        "dT_dt" => state.rate()?,
        "rate" => {
            let rate = state.rate()?;
            times_c_v(state, rate)?
        }
        "kappa" => state.kappa_now()?,
        "conduction_defect" => conduction(state)?,
        "K_d2" => memory::copied("K_d2", &prepared(state)?.moments)?,
        "neighbours" => {
            let matrix = &prepared(state)?.matrix;
            memory::collected("neighbours", (0..n).map(|i| matrix.neighbours(i) as f64))?
        }
        "order_reached" => orders(state)?,
        "omega" => {
            geometry(state)?;
            let m = given(state, fields::M)?;
            state.with_rows(|rows| density::omega(&state.choices.kernel, rows, &m, &state.pool))?
        }
        "depth" => {
            geometry(state)?;
            memory::collected("depth", (0..n).map(|i| state.depth(i)))?
        }
        name => given(state, fields::slot(name)?)?,
    };
    Ok(vec![scalar])
}

/// An input as an array, or the error that says that it was not set.
fn given(state: &State, slot: Slot) -> Result<Vec<f64>> {
    needed(state, slot)?;
    state.each(slot)
}

fn needed(state: &State, slot: Slot) -> Result<()> {
    let name = FIELDS[slot].name;
    state.refuse_lost(&format!("get {name}"), [slot])?;
    if state.inputs[slot] == Input::Unset && !state.is_empty() {
        return Err(Error::OutOfOrder { call: format!("get {name}"), missing: format!("set {name}") });
    }
    Ok(())
}

fn geometry(state: &mut State) -> Result<&crate::plan::state::Geometry> {
    state.prepare_geometry("get")?;
    state.geometry.as_ref().ok_or(Error::OutOfOrder { call: "get".into(), missing: "set_particles".into() })
}

fn prepared(state: &mut State) -> Result<&Weights> {
    state.prepare("get")?;
    state.weights.as_ref().ok_or(Error::OutOfOrder { call: "get".into(), missing: "set_particles".into() })
}

/// How wrong each particle conducts.
fn conduction(state: &mut State) -> Result<Vec<f64>> {
    state.prepare_unfolded("get")?;
    let same_h = geometry(state)?.same_h;
    let Some(weights) = &state.weights else { return Ok(Vec::new()) };
    state.with_assembly(same_h, |a| moments::conduction(a, &weights.matrix, &state.pool))
}

/// The order of each particle's consistent weights; 0 where others are used.
fn orders(state: &mut State) -> Result<Vec<f64>> {
    let same_h = geometry(state)?.same_h;
    state.with_assembly(same_h, |a| a.orders(&state.pool))
}

/// The gradient, by components, of what rises by `rise(a, b)` from a particle to its neighbour.
fn gradient_of(state: &mut State, rise: impl Fn(usize, usize) -> f64 + Sync + Send) -> Result<Vec<Vec<f64>>> {
    let volume = memory::copied("volumes", &geometry(state)?.volume)?;
    let found = state.with_rows(|rows| gradient::of(rise, &state.choices.kernel, rows, &volume, &state.pool))?;
    columns(&found, state.dim())
}

/// What flows through each particle: the gradient made of kappa_ab (T_b − T_a), with the average of kappa by which the
/// operator exchanges heat, so that it is the same flux on both sides of a jump of kappa. Times −S where kappa S is a
/// tensor. Two sweeps average fluxes where pairs average kappa arithmetically.
fn flux(state: &mut State) -> Result<Vec<Vec<f64>>> {
    // First, since it may put the particles in another order.
    geometry(state)?;
    let (t, kappa, mean) = (given(state, fields::T)?, state.kappa_now()?, state.mean());
    let by_pair = state.choices.operator.is_one_matrix();
    let mut flux = gradient_of(state, |a, b| match by_pair {
        true => mean.of(kappa[a], kappa[b]) * (t[a] - t[b]),
        false => kappa[a] * mean.share(kappa[a], kappa[b]) * (t[a] - t[b]),
    })?;
    turn(state, &mut flux);
    Ok(flux)
}

/// Multiplies vectors, given by components, by the shape of each particle's tensor.
fn turn(state: &State, vectors: &mut [Vec<f64>]) {
    for (i, shape) in state.directions.iter().flat_map(|d| &d.shape).enumerate() {
        let v = std::array::from_fn(|a| vectors.get(a).map_or(0.0, |v| v[i]));
        let turned = tensor::times(shape, v);
        vectors.iter_mut().zip(turned).for_each(|(v, t)| v[i] = t);
    }
}

fn times_c_v(state: &State, mut values: Vec<f64>) -> Result<Vec<f64>> {
    let c_v = state.each(fields::C_V)?;
    values.iter_mut().zip(c_v).for_each(|(v, c_v)| *v *= c_v);
    Ok(values)
}
