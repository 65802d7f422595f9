//! Where particles are: smoothing lengths, densities and volumes, given or found, on cells that fit them.

use super::passes;
use super::state::{Geometry, Input, State, least};
use crate::error::{Error, Result};
use crate::memory;
use crate::model::fields;
use crate::operator::table::Fit;
use crate::space::{density, rows::Rows};

/// How much thinner than wide a cloud is that has no thickness but rounding's.
const FLAT: f64 = 1e-12;

/// One block in this many is looked at to estimate the number of neighbours.
const SAMPLE: usize = 16;

impl State {
    /// Smoothing lengths, densities and volumes, given or computed, on cells that fit them: the same bits for the same
    /// particles, whatever was asked before.
    pub fn prepare_geometry(&mut self, call: &str) -> Result<()> {
        self.settle_ties()?;
        if self.geometry.is_some() {
            return Ok(());
        }
        self.cloud(call)?;
        self.refuse_lost(call, [fields::M, fields::RHO, fields::H])?;
        self.need(fields::M, call)?;
        // Along axes that are not periodic, whatever the reach.
        self.refuse_flat(f64::INFINITY)?;
        let start = std::time::Instant::now();
        if self.inputs[fields::H] == Input::Unset && self.inputs[fields::RHO] == Input::Unset {
            let h = self.find_lengths(call)?;
            self.inputs[fields::H] = Input::Each(h);
            let made = self.make_geometry(call, true);
            self.inputs[fields::H] = Input::Unset;
            self.geometry = Some(made?);
            self.timers.add(passes::DENSITY.name, start.elapsed());
        } else {
            self.geometry = Some(self.make_geometry(call, false)?);
            self.timers.add(passes::SORT.name, start.elapsed());
        }
        Ok(())
    }

    /// h together with rho, from the lengths found last where there are any.
    fn find_lengths(&mut self, call: &str) -> Result<Vec<f64>> {
        // The search for h reaches as far as it may be expected to be; what is found decides on the order that stays.
        let reach = self.reach(&self.domain, self.len(), |axis| self.extent(axis));
        self.sort_for(reach)?;
        let start = match self.last_h.len() == self.len() {
            true => memory::collected("h", self.cloud(call)?.host.iter().map(|&host| self.last_h[host as usize]))?,
            false => self.guessed_lengths(call)?,
        };
        let m = self.each(fields::M)?;
        let cloud = self.cloud(call)?;
        let h = density::smoothing_lengths(&self.choices.kernel, self.choices.h_fac, cloud, &m, start, &self.pool)?;
        let mut by_host = memory::filled("h", cloud.len(), 0.0)?;
        cloud.host.iter().zip(&h).for_each(|(&host, &h)| by_host[host as usize] = h);
        self.found_h = by_host;
        Ok(h)
    }

    /// A first guess of h, from cells that are not crowded by far: where one particle far away made them too long, from
    /// shorter ones.
    fn guessed_lengths(&mut self, call: &str) -> Result<Vec<f64>> {
        loop {
            let h = density::guess(self.cloud(call)?, self.choices.h_fac, &self.pool)?;
            let (reach, before) = (self.choices.kernel.radius() * least(&h), self.cloud(call)?.grid.edge);
            if !self.cloud(call)?.is_coarse_for(reach) {
                return Ok(h);
            }
            self.sort_again(reach)?;
            if self.cloud(call)?.grid.edge >= before {
                return density::guess(self.cloud(call)?, self.choices.h_fac, &self.pool);
            }
        }
    }

    /// `found`: h was found together with rho, and tells it.
    fn make_geometry(&mut self, call: &str, found: bool) -> Result<Geometry> {
        let (nu, radius) = (self.dim() as f64, self.choices.kernel.radius());
        let mut h = self.lengths(nu)?;
        let reach = radius * h.iter().copied().fold(0.0, f64::max);
        self.refuse_flat(reach)?;
        let shortest = radius * least(&h);
        if !self.cloud(call)?.suits(shortest) {
            self.sort_for(shortest)?;
            h = self.lengths(nu)?;
        }
        let m = self.each(fields::M)?;
        let cloud = self.cloud(call)?;
        let rows = Rows::new(cloud, &h, radius, &self.pool)?;
        let rho = match &self.inputs[fields::RHO] {
            Input::Unset if found => {
                let rho = |(m, h): (&f64, &f64)| m * (self.choices.h_fac / h).powf(nu);
                memory::collected("rho", m.iter().zip(&h).map(rho))?
            }
            Input::Unset => density::sum(&self.choices.kernel, &rows, &m, &self.pool)?,
            _ => self.each(fields::RHO)?,
        };
        let (same_h, neighbours) = (rows.same_h(), rows.mean_neighbours(&self.pool, SAMPLE)?);
        let volume = memory::collected("volumes", m.iter().zip(&rho).map(|(m, rho)| m / rho))?;
        Ok(Geometry { h, rho, volume, same_h, neighbours })
    }

    /// Refuses particles that leave an axis of their space empty: sums over neighbours would take a disc for a ball.
    /// Where the axis is periodic and images of the particles are among the neighbours, it is not empty.
    fn refuse_flat(&self, reach: f64) -> Result<()> {
        let thick = self.needs_thickness() && reach.is_finite();
        let Some(cloud) = self.cloud.as_ref().filter(|c| c.len() > c.dim() && (thick || !self.choices.allow.flat))
        else {
            return Ok(());
        };
        let dim = cloud.dim();
        let extents: Vec<f64> = (0..dim).map(|axis| self.extent(axis)).collect();
        let widest = extents.iter().copied().fold(0.0, f64::max);
        let imaged = |axis: usize| cloud.domain.periodic[axis] && reach >= cloud.domain.length(axis);
        let spacing = reach / (self.choices.kernel.radius() * self.choices.h_fac);
        let least = if thick { 0.5 * spacing } else { 0.0 };
        let empty: Vec<usize> = (0..dim).filter(|&a| extents[a] <= least.max(FLAT * widest) && !imaged(a)).collect();
        if empty.is_empty() || widest == 0.0 {
            return Ok(());
        }
        let axes: Vec<&str> = empty.iter().map(|&a| ["x", "y", "z"][a]).collect();
        let (axes, rest) = (axes.join(" and "), dim - empty.len());
        if thick {
            return Err(self.too_thin(&axes));
        }
        let value = format!("flat along {axes}: all {} particles have the same", cloud.len());
        let rule = format!(
            "particles that fill {rest} of {dim} dimensions need dim={rest} and their other coordinates alone; a sheet or a \
             row of one layer in {dim}-D space is had by giving rho and insisting with allow=flat"
        );
        Err(Error::bad("x", value, &rule))
    }

    /// What [`State::needs_thickness`] refuses.
    pub(super) fn too_thin(&self, along: &str) -> Error {
        let rule = format!(
            "particles less than half a spacing thick along {along} conduct wrong with it: use operator=brookshaw, kernel or \
             projected, or fewer dimensions"
        );
        Error::bad("operator", self.choices.operator.name, &rule)
    }

    /// Whether the operator is wrong in sheets and strings of one layer: two gradients see noise across them, and weights
    /// that are scaled in the mean over directions conduct too well along them.
    pub(super) fn needs_thickness(&self) -> bool {
        !self.choices.operator.is_one_matrix() || matches!(self.choices.operator.fit, Fit::Moments)
    }

    /// h as given, or h_fac (m/rho)^(1/nu).
    fn lengths(&self, nu: f64) -> Result<Vec<f64>> {
        if self.inputs[fields::H] != Input::Unset {
            return self.each(fields::H);
        }
        let h = |m: f64, rho: f64| self.choices.h_fac * (m / rho).powf(1.0 / nu);
        if let (Input::Number(m), Input::Number(rho)) = (&self.inputs[fields::M], &self.inputs[fields::RHO]) {
            return memory::filled("h", self.len(), h(*m, *rho));
        }
        let (m, rho) = (self.each(fields::M)?, self.each(fields::RHO)?);
        memory::collected("h", m.iter().zip(&rho).map(|(m, rho)| h(*m, *rho)))
    }
}
