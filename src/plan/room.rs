//! Whether stored weights have room in memory, told before anything is searched where that is hopeless.

use super::state::{Input, State};
use crate::error::{Error, Result};
use crate::memory;
use crate::model::fields;
use crate::space::Domain;

/// Of the neighbours that particles have which fill space: those in sheets and near surfaces have fewer.
const SURE: f64 = 0.25;

impl State {
    /// # Errors
    /// `NoMemory` where weights of so many neighbours do not fit in `memory=`, or in what the system has left.
    pub(super) fn refuse_weights_without_room(&self, neighbours: f64) -> Result<()> {
        let operator = self.choices.operator;
        let each = [operator.bytes(), operator.bytes_to_project(self.dim())].map(|[pair, one]| neighbours * pair + one);
        let bytes = ((each[0] + each[1]) * self.len() as f64) as u64;
        let available = self.choices.memory.unwrap_or_else(memory::available);
        if bytes <= available {
            return Ok(());
        }
        let what = format!("weights of {neighbours:.0} neighbours for each of {} particles", self.len());
        Err(Error::NoMemory { what, bytes, available })
    }

    /// How many neighbours particles have at the least in the mean, from nothing but the room that they fill.
    pub(super) fn fewest_neighbours(&self) -> f64 {
        let (nu, n, radius) = (self.dim() as i32, self.len() as f64, self.choices.kernel.radius());
        let sphere = ball(self.dim()) * radius.powi(nu);
        let mean = match &self.inputs[fields::H] {
            Input::Unset => return SURE * (sphere * self.choices.h_fac.powi(nu)).min(n),
            Input::Number(h) => h.powi(nu),
            Input::Each(h) => crate::sum::sum(&self.pool, h.len(), |i| h[i].powi(nu)) / n,
        };
        let domain: &Domain = &self.domain;
        let reach = radius * mean.powf(1.0 / nu as f64);
        let width = |a: usize| if domain.periodic[a] { domain.length(a) } else { self.extent(a) + 2.0 * reach };
        let room: f64 = (0..self.dim()).map(width).product();
        SURE * (n * sphere * mean / room).min(n)
    }
}

/// The volume of a ball of radius 1.
fn ball(dim: usize) -> f64 {
    [2.0, std::f64::consts::PI, 4.0 / 3.0 * std::f64::consts::PI][dim - 1]
}
