//! Exchange with the outside at the particles that a host marks: given flux, convection (Robin), radiation.

use crate::error::Result;
use crate::memory;

/// Inputs of one particle, in the order of its row here.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Exchange {
    pub area: f64,
    pub flux_in: f64,
    pub h_conv: f64,
    pub emissivity: f64,
    pub t_ambient: f64,
}

impl Exchange {
    fn idle(&self) -> bool {
        self.area == 0.0 || (self.flux_in == 0.0 && self.h_conv == 0.0 && self.emissivity == 0.0)
    }

    /// Power into the particle, W.
    pub fn power(&self, sigma_sb: f64, t: f64) -> f64 {
        let radiated = self.emissivity * sigma_sb * (self.t_ambient.powi(4) - t.powi(4));
        self.area * (self.flux_in + self.h_conv * (self.t_ambient - t) + radiated)
    }

    /// How strongly the power falls with T, W/K: the largest slope between t and the surroundings.
    pub fn slope(&self, sigma_sb: f64, t: f64) -> f64 {
        let hottest = t.abs().max(self.t_ambient);
        self.area * (self.h_conv + 4.0 * self.emissivity * sigma_sb * hottest.powi(3))
    }
}

/// The particles that exchange heat with the outside; the others are not stored.
#[derive(Debug, Default)]
pub struct Surface {
    pub sigma_sb: f64,
    members: Vec<(u32, Exchange)>,
}

impl Surface {
    /// Keeps the particles for which something flows; `every` keeps the idle ones too.
    pub fn new(n: usize, sigma_sb: f64, every: bool, exchange: impl Fn(usize) -> Exchange) -> Result<Surface> {
        let wanted = |i: &usize| every || !exchange(*i).idle();
        let mut members = memory::reserved("surface", (0..n).filter(wanted).count())?;
        members.extend((0..n).filter(wanted).map(|i| (i as u32, exchange(i))));
        Ok(Surface { sigma_sb, members })
    }

    pub fn len(&self) -> usize {
        self.members.len()
    }

    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// Whether the power is a linear function of T.
    pub fn is_linear(&self) -> bool {
        self.members.iter().all(|(_, e)| e.emissivity == 0.0)
    }

    /// The bounds of what T may become that starts between these: the surroundings of what exchanges with them are in
    /// between as well, and nothing bounds the side on which a flux is given.
    pub fn reached(&self, mut low: f64, mut high: f64) -> (f64, f64) {
        for (_, e) in self.members.iter().filter(|(_, e)| e.area > 0.0) {
            if e.h_conv > 0.0 || (e.emissivity > 0.0 && self.sigma_sb > 0.0) {
                (low, high) = (low.min(e.t_ambient), high.max(e.t_ambient));
            }
            low = if e.flux_in < 0.0 { f64::MIN } else { low };
            high = if e.flux_in > 0.0 { f64::MAX } else { high };
        }
        (low, high)
    }

    /// rate_i += power_i / capacity_i; `inverse` holds 1/capacity.
    pub fn add(&self, t: &[f64], inverse: &[f64], rate: &mut [f64]) {
        for (i, exchange) in &self.members {
            let i = *i as usize;
            rate[i] += exchange.power(self.sigma_sb, t[i]) * inverse[i];
        }
    }

    /// Calls `visit(i, slope)` with W/K for each particle here.
    pub fn slopes(&self, t: &[f64], mut visit: impl FnMut(usize, f64)) {
        for (i, exchange) in &self.members {
            visit(*i as usize, exchange.slope(self.sigma_sb, t[*i as usize]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_and_slope_agree() {
        let e = Exchange { area: 2.0, flux_in: 3.0, h_conv: 5.0, emissivity: 0.5, t_ambient: 300.0 };
        let sigma = 5.67e-8;
        assert_eq!(e.power(sigma, 300.0), 6.0);
        let d = 1e-3;
        let slope = -(e.power(sigma, 400.0 + d) - e.power(sigma, 400.0 - d)) / (2.0 * d);
        // Central difference of a quartic: exact to rounding of the powers (1e3) over d.
        assert!((slope - e.slope(sigma, 400.0)).abs() < 1e-7, "{slope}");
    }

    #[test]
    fn idle_particles_are_left_out() {
        let one = |i: usize| Exchange { area: 1.0, h_conv: f64::from(i == 3), ..Exchange::default() };
        assert_eq!(Surface::new(10, 0.0, false, one).unwrap().len(), 1);
        assert_eq!(Surface::new(10, 0.0, true, one).unwrap().len(), 10);
    }
}
