//! What a host hands over in a call: taken whole, or not at all. Whatever can fail is done before anything is changed.

use super::input::{Energy, Input};
use super::state::State;
use crate::array::Strided;
use crate::error::{Error, Result};
use crate::memory;
use crate::model::fields::{self, FIELDS, INPUTS, Slot};
use crate::pool::Pool;
use crate::space::{Cloud, Domain};
use std::cmp::Ordering;

/// A quantity as the host has it: in its own order.
#[derive(Clone, Copy)]
pub enum Offered<'a> {
    Number(f64),
    Each(Strided<'a>),
}

impl Offered<'_> {
    fn inward(self, what: &str, host: &[u32]) -> Result<Input> {
        Ok(match self {
            Offered::Number(v) => Input::Number(v),
            Offered::Each(values) => {
                Input::Each(memory::collected(what, host.iter().map(|&h| values.at(h as usize, 0)))?)
            }
        })
    }
}

/// Particles, where they are, and what is given with them.
pub struct Offer<'a> {
    pub domain: Domain,
    pub x: Strided<'a>,
    pub given: &'a [(Slot, Offered<'a>)],
    pub energy: Option<Offered<'a>>,
    /// What is not given goes back to its default, rather than staying with the particles.
    pub anew: bool,
}

/// Quantities in the order of a new cloud.
struct Carried {
    inputs: [Option<Input>; INPUTS],
    energy: Option<Input>,
}

impl State {
    /// Takes particles with what is given for them. Other quantities stay with their particles; where the number of
    /// particles changes, those that were given per particle must be given again.
    ///
    /// # Errors
    /// As [`Cloud::sort`]; `NoMemory`. Nothing is changed then.
    pub fn accept(&mut self, offer: &Offer) -> Result<()> {
        let rests = self.cloud.as_ref().is_some_and(|c| c.domain == offer.domain && c.is_at(offer.x, &self.pool));
        let extent = |axis: usize| {
            let all = (0..offer.x.len()).map(|i| offer.x.at(i, axis));
            let (low, high) = all.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)));
            high - low
        };
        let reach = self.reach(&offer.domain, offer.x.len(), extent);
        let cloud = if rests { None } else { Some(Cloud::sort(&offer.domain, offer.x, reach, &self.pool)?) };
        let host = cloud.as_ref().or(self.cloud.as_ref()).map_or(&[][..], |c| &c.host);
        let mut taken = [const { None }; INPUTS];
        for (slot, offered) in offer.given {
            taken[*slot] = Some(offered.inward(FIELDS[*slot].name, host)?);
        }
        let energy = offer.energy.map(|u| u.inward("u", host)).transpose()?;
        let host_of = |i: usize| host[i] as usize;
        let carried = cloud.as_ref().map(|cloud| self.carried(cloud.host.as_slice())).transpose()?;
        // Where u was given before, T follows the new c_v: in the new order, since that is where both are.
        let kept = carried.as_ref().is_none_or(Option::is_some) && !offer.anew;
        let warmed = match &taken[fields::C_V] {
            Some(c_v) if kept && taken[fields::T].is_none() => {
                let carried = carried.as_ref().and_then(Option::as_ref);
                let of = |slot: Slot| carried.and_then(|c| c.inputs[slot].as_ref()).unwrap_or(&self.inputs[slot]);
                self.warmed(c_v, (of(fields::T), of(fields::C_V)), carried.and_then(|c| c.energy.as_ref()))?
            }
            _ => None,
        };
        // A u that comes without T says what T is.
        let (alone, beside) = if taken[fields::T].is_none() { (energy, None) } else { (None, energy) };
        let warmed = match alone {
            Some(u) => {
                let carried = carried.as_ref().and_then(|c| c.as_ref()?.inputs[fields::C_V].as_ref());
                let here = Some(&self.inputs[fields::C_V]).filter(|c_v| kept || !c_v.is_each());
                let lost =
                    || Error::OutOfOrder { call: "taking u".into(), missing: "c_v for so many particles".into() };
                let c_v = taken[fields::C_V].as_ref().or(carried).or(here).ok_or_else(lost)?;
                Some((temperature(&u, c_v, &self.pool, host_of)?, u))
            }
            None => warmed,
        };

        self.domain = offer.domain.clone();
        if let (Some(cloud), Some(carried)) = (cloud, carried) {
            self.place(cloud, carried);
            self.drop_geometry();
        }
        for (slot, input) in taken.into_iter().enumerate() {
            match input {
                Some(input) => self.store(slot, input),
                None if offer.anew => self.store(slot, Input::default_of(slot)),
                None => {}
            }
        }
        self.heat_up(warmed);
        if let Some(u) = beside {
            self.energy = Energy::Given(u);
        }
        Ok(())
    }

    /// Takes a new box; particles already here are wrapped into it.
    pub fn set_box(&mut self, domain: Domain) -> Result<()> {
        if domain == self.domain {
            return Ok(());
        }
        if let Some(x) = self.positions()? {
            let x = Strided::new("x", &x, self.len(), self.dim(), self.dim())?;
            return self.accept(&Offer { domain, x, given: &[], energy: None, anew: false });
        }
        self.domain = domain;
        Ok(())
    }

    /// Positions by host, where there are particles.
    fn positions(&self) -> Result<Option<Vec<f64>>> {
        let Some(cloud) = &self.cloud else { return Ok(None) };
        let dim = cloud.dim();
        let mut x = memory::filled("positions", cloud.len() * dim, 0.0)?;
        for (i, &host) in cloud.host.iter().enumerate() {
            (0..dim).for_each(|a| x[host as usize * dim + a] = cloud.x[a][i]);
        }
        Ok(Some(x))
    }

    /// Sorts for a search that reaches this far, unless the particles are sorted for it.
    pub fn sort_for(&mut self, reach: f64) -> Result<()> {
        if self.is_empty() || self.cloud.as_ref().is_none_or(|cloud| cloud.suits(reach)) || !reach.is_finite() {
            return self.settle_ties();
        }
        self.sort_again(reach)
    }

    /// Sorts for a search that reaches this far.
    pub fn sort_again(&mut self, reach: f64) -> Result<()> {
        let Some(x) = self.positions()? else { return Ok(()) };
        let x = Strided::new("x", &x, self.len(), self.dim(), self.dim())?;
        let cloud = Cloud::sort(&self.domain, x, reach, &self.pool)?;
        let carried = self.carried(&cloud.host)?;
        self.place(cloud, carried);
        self.settle_ties()
    }

    /// Orders particles that are in one place by what was given for them, so that the host's order leaves no trace:
    /// where all of it is alike, their order makes no difference.
    pub fn settle_ties(&mut self) -> Result<()> {
        let Some(cloud) = self.cloud.as_ref().filter(|cloud| cloud.shared) else { return Ok(()) };
        let by_input = |i: usize, j: usize| {
            // T last: it is what changes.
            let mut orders = (1..INPUTS).chain([fields::T]).map(|slot| match &self.inputs[slot] {
                Input::Each(v) => v[i].total_cmp(&v[j]),
                _ => Ordering::Equal,
            });
            let by_h = || match self.last_h.len() == cloud.len() {
                true => self.last_h[cloud.host[i] as usize].total_cmp(&self.last_h[cloud.host[j] as usize]),
                false => Ordering::Equal,
            };
            orders.find(|c| c.is_ne()).unwrap_or_else(by_h)
        };
        let Some(host) = cloud.reorder(by_input)? else { return Ok(()) };
        let Some(carried) = self.carried(&host)? else { return Ok(()) };
        self.carry(carried);
        if let Some(cloud) = &mut self.cloud {
            cloud.host = host;
        }
        self.forget_geometry();
        self.directions = None;
        Ok(())
    }

    /// What is held per particle, in the order of other host indices; none where their number is another.
    fn carried(&self, host: &[u32]) -> Result<Option<Carried>> {
        let Some(old) = self.cloud.as_ref().filter(|old| old.len() == host.len()) else { return Ok(None) };
        let mut was = memory::filled("order", host.len(), 0u32)?;
        old.host.iter().enumerate().for_each(|(i, &host)| was[host as usize] = i as u32);
        let moved = |input: &Input| input.moved(host.len(), |i| was[host[i] as usize] as usize);
        let mut carried = Carried { inputs: [const { None }; INPUTS], energy: None };
        for (input, moved_to) in self.inputs.iter().zip(&mut carried.inputs) {
            *moved_to = moved(input)?;
        }
        if let Energy::Given(u) = &self.energy {
            carried.energy = moved(u)?;
        }
        Ok(Some(carried))
    }

    /// Puts a newly sorted cloud in place of the old one.
    fn place(&mut self, cloud: Cloud, carried: Option<Carried>) {
        match carried {
            Some(carried) => self.carry(carried),
            None => self.lose(),
        }
        self.cloud = Some(cloud);
        (self.inverse_capacity, self.surface, self.directions) = (None, None, None);
    }

    fn carry(&mut self, carried: Carried) {
        for (input, moved) in self.inputs.iter_mut().zip(carried.inputs) {
            if let Some(moved) = moved {
                *input = moved;
            }
        }
        if let Some(moved) = carried.energy {
            self.energy = Energy::Given(moved);
        }
    }

    /// The number of particles changes: what was given for each of them is no more.
    fn lose(&mut self) {
        for (input, lost) in self.inputs.iter_mut().zip(&mut self.lost).filter(|(input, _)| input.is_each()) {
            (*input, *lost) = (Input::Unset, true);
        }
        if matches!(&self.energy, Energy::Given(Input::Each(_)) | Energy::Moved) {
            self.lost[fields::T] |= self.inputs[fields::T] == Input::Unset;
            self.energy = Energy::Follows;
        }
    }

    /// Refuses to go on with defaults for what was given per particle before the number of particles changed.
    ///
    /// # Errors
    /// `OutOfOrder` naming all of it.
    pub fn refuse_lost(&self, call: &str, among: impl IntoIterator<Item = Slot>) -> Result<()> {
        let name = |slot: Slot| if slot == fields::T { "T (or u)" } else { FIELDS[slot].name };
        let lost: Vec<&str> = among.into_iter().filter(|&slot| self.lost[slot]).map(name).collect();
        if lost.is_empty() || self.is_empty() {
            return Ok(());
        }
        let (lost, n) = (lost.join(", "), self.len());
        let what = format!("{lost} for the {n} particles that there are now (they were given for others)");
        Err(Error::OutOfOrder { call: call.into(), missing: what })
    }

    /// Stores an input and drops what depended on its old value. Where u was given, T follows c_v.
    ///
    /// # Errors
    /// `NoMemory`; `BadElement` where T = u / c_v is beyond all numbers. Nothing is changed then.
    pub fn put(&mut self, slot: Slot, input: Input) -> Result<()> {
        let warmed = match slot == fields::C_V {
            true => self.warmed(&input, (&self.inputs[fields::T], &self.inputs[fields::C_V]), None)?,
            false => None,
        };
        self.store(slot, input);
        self.heat_up(warmed);
        Ok(())
    }

    /// Takes u: T follows from it and from c_v.
    ///
    /// # Errors
    /// As [`State::put`].
    pub fn put_energy(&mut self, u: Input) -> Result<()> {
        let t = temperature(&u, &self.inputs[fields::C_V], &self.pool, |i| self.host(i))?;
        self.store(fields::T, t);
        self.energy = Energy::Given(u);
        Ok(())
    }

    /// u as it was given, or c_v T.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn energies(&self) -> Result<Input> {
        match &self.energy {
            Energy::Given(u) => Ok(u.clone()),
            _ => self.inputs[fields::T].with(&self.inputs[fields::C_V], |t, c_v| t * c_v),
        }
    }

    /// T and u for a new c_v, where u was given and T follows; `then` are T and c_v as they are.
    fn warmed(&self, c_v: &Input, then: (&Input, &Input), given: Option<&Input>) -> Result<Option<(Input, Input)>> {
        let u = match (&self.energy, given) {
            (Energy::Follows, _) => return Ok(None),
            (Energy::Given(_), Some(u)) | (Energy::Given(u), None) => u.with(&Input::Number(0.0), |u, _| u)?,
            (Energy::Moved, _) => then.0.with(then.1, |t, c_v| t * c_v)?,
        };
        Ok(Some((temperature(&u, c_v, &self.pool, |i| self.host(i))?, u)))
    }

    fn heat_up(&mut self, warmed: Option<(Input, Input)>) {
        if let Some((t, u)) = warmed {
            self.store(fields::T, t);
            self.energy = Energy::Given(u);
        }
    }
}

/// T of these energies; an error names the host's number of a particle.
fn temperature(u: &Input, c_v: &Input, pool: &Pool, host: impl Fn(usize) -> usize) -> Result<Input> {
    let t = u.with(c_v, |u, c_v| u / c_v)?;
    let wrong = match &t {
        Input::Each(t) => crate::sum::first(pool, t.len(), |i| !t[i].is_finite()),
        other => other.at(0).filter(|t| !t.is_finite()).map(|_| 0),
    };
    match wrong {
        None => Ok(t),
        Some(i) => {
            let value = u.at(i).unwrap_or(0.0);
            Err(Error::bad_at("u", host(i), value, "T = u / c_v must be finite: it is too large for this c_v"))
        }
    }
}
