//! Exchange with the outside at the particles that a host marks: given flux, convection (Robin), radiation.
//!
//! A particle stands for the material around its centre, and the outside sees the temperature of the surface above it.
//! What comes in through the surface flows on to the centre, through kappa over the depth: convection then acts as
//! 1/(1/h_conv + depth/kappa).

use crate::error::Result;
use crate::memory;
use crate::sum;

/// Inputs of one particle, in the order of its row here.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Exchange {
    pub area: f64,
    pub flux_in: f64,
    pub h_conv: f64,
    pub emissivity: f64,
    pub t_ambient: f64,
    /// Of the particle's centre below the area.
    pub depth: f64,
}

/// Newton's method for the temperature of a surface; from above it converges for every flux.
const NEWTON: usize = 100;

impl Exchange {
    fn idle(&self) -> bool {
        self.area == 0.0 || (self.flux_in == 0.0 && self.h_conv == 0.0 && self.emissivity == 0.0)
    }

    /// What comes in through unit area at temperature t. Radiation is an odd function, so that it falls everywhere.
    fn flux(&self, sigma_sb: f64, t: f64) -> f64 {
        self.flux_in + self.h_conv * (self.t_ambient - t) + self.radiated(sigma_sb, t)
    }

    /// Where nothing radiates, T may be so large that its fourth power is no number.
    fn radiated(&self, sigma_sb: f64, t: f64) -> f64 {
        match self.emissivity {
            0.0 => 0.0,
            emissivity => emissivity * sigma_sb * (self.t_ambient.powi(4) - t.abs().powi(3) * t),
        }
    }

    /// Minus the derivative of the flux.
    fn fall(&self, sigma_sb: f64, t: f64) -> f64 {
        match self.emissivity {
            0.0 => self.h_conv,
            emissivity => self.h_conv + 4.0 * emissivity * sigma_sb * t.abs().powi(3),
        }
    }

    /// The temperature at the area where the particle has t: what comes in flows on to its centre,
    /// flux(T_s) = kappa/depth (T_s − t).
    fn at_the_area(&self, sigma_sb: f64, kappa: f64, t: f64) -> f64 {
        if self.depth == 0.0 {
            return t;
        }
        let inward = kappa / self.depth;
        let lacks = |s: f64| self.flux(sigma_sb, s) - inward * (s - t);
        // Convex where it is positive: no step from above goes too far, and the first comes from there.
        let mut s = t.max(self.t_ambient).max(0.0);
        for _ in 0..NEWTON {
            let slope = inward + self.fall(sigma_sb, s);
            let next = if slope > 0.0 { s + lacks(s) / slope } else { s };
            if next == s || (next - s).abs() <= f64::EPSILON * s.abs() {
                return next;
            }
            s = next;
        }
        s
    }

    /// Power into the particle, W.
    pub fn power(&self, sigma_sb: f64, kappa: f64, t: f64) -> f64 {
        if self.depth > 0.0 && kappa == 0.0 {
            return 0.0;
        }
        let surface = self.at_the_area(sigma_sb, kappa, t);
        // The same either way; the weaker of the two knows it to more digits.
        let inward = kappa / self.depth;
        let stiff = self.depth > 0.0 && self.fall(sigma_sb, surface) > inward;
        self.area * if stiff { inward * (surface - t) } else { self.flux(sigma_sb, surface) }
    }

    /// How strongly the power falls with T, W/K: the largest slope between t and the surroundings.
    pub fn slope(&self, sigma_sb: f64, kappa: f64, t: f64) -> f64 {
        let surface = self.at_the_area(sigma_sb, kappa, t);
        let fall = self.fall(sigma_sb, t.abs().max(self.t_ambient).max(surface.abs()));
        // In series with what lies between area and centre.
        let behind = self.depth * fall;
        self.area * if behind > 0.0 { fall * (kappa / (kappa + behind)) } else { fall }
    }
}

/// A particle, and its conductivity where that does not depend on T.
#[derive(Debug, Clone, Copy)]
struct Member {
    particle: u32,
    kappa: f64,
}

/// The particles that exchange heat with the outside; the others are not stored.
#[derive(Debug, Default)]
pub struct Surface {
    pub sigma_sb: f64,
    members: Vec<(Member, Exchange)>,
}

impl Surface {
    /// Keeps the particles for which something flows; `every` keeps the idle ones too.
    pub fn new(
        n: usize,
        sigma_sb: f64,
        every: bool,
        kappa: impl Fn(usize) -> f64,
        exchange: impl Fn(usize) -> Exchange,
    ) -> Result<Surface> {
        let wanted = |i: &usize| every || !exchange(*i).idle();
        let mut members = memory::reserved("surface", (0..n).filter(wanted).count())?;
        let member = |i: usize| Member { particle: i as u32, kappa: kappa(i) };
        members.extend((0..n).filter(wanted).map(|i| (member(i), exchange(i))));
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

    /// The particles that radiate.
    pub fn radiating(&self) -> impl Iterator<Item = usize> + '_ {
        let radiates = self.sigma_sb > 0.0;
        self.members
            .iter()
            .filter(move |(_, e)| radiates && e.emissivity > 0.0 && e.area > 0.0)
            .map(|(m, _)| m.particle as usize)
    }

    /// The bounds of what T may become that starts between these: the surroundings of what exchanges with them are in
    /// between as well, and nothing bounds the side on which a flux is given.
    pub fn reached(&self, low: f64, high: f64) -> (f64, f64) {
        let (mut low, mut high) = self.with_surroundings(low, high);
        for (_, e) in self.members.iter().filter(|(_, e)| e.area > 0.0) {
            low = if e.flux_in < 0.0 { f64::MIN } else { low };
            high = if e.flux_in > 0.0 { f64::MAX } else { high };
        }
        (low, high)
    }

    /// The same bounds with the temperatures of the surroundings between them.
    pub fn with_surroundings(&self, mut low: f64, mut high: f64) -> (f64, f64) {
        for (_, e) in self.members.iter().filter(|(_, e)| e.area > 0.0) {
            if e.h_conv > 0.0 || (e.emissivity > 0.0 && self.sigma_sb > 0.0) {
                (low, high) = (low.min(e.t_ambient), high.max(e.t_ambient));
            }
        }
        (low, high)
    }

    /// Calls `visit(i, power)` with the power that is given to each particle here, whatever its T, W.
    pub fn given(&self, mut visit: impl FnMut(usize, f64)) {
        self.members.iter().for_each(|(m, e)| visit(m.particle as usize, e.area * e.flux_in));
    }

    /// The same surface for temperatures that are counted from `origin`, where it is linear.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn counted_from(&self, origin: f64) -> Result<Surface> {
        let moved = |&(m, e): &(Member, Exchange)| (m, Exchange { t_ambient: e.t_ambient - origin, ..e });
        Ok(Surface { members: memory::collected("surface", self.members.iter().map(moved))?, ..*self })
    }

    /// rate_i += power_i / capacity_i; `inverse` holds 1/capacity, `kappa` kappa(T) where it depends on T. Answers the
    /// power into all whose T is free, W.
    pub fn add(&self, kappa: &[f64], t: &[f64], inverse: &[f64], rate: &mut [f64]) -> f64 {
        sum::compensated(self.members.iter().map(|(i, exchange)| {
            let (i, given) = (i.particle as usize, i.kappa);
            let kappa = kappa.get(i).copied().unwrap_or(given);
            let power = exchange.power(self.sigma_sb, kappa, t[i]);
            rate[i] += power * inverse[i];
            if inverse[i] > 0.0 { power } else { 0.0 }
        }))
    }

    /// Calls `visit(i, slope)` with W/K for each particle here.
    pub fn slopes(&self, kappa: &[f64], t: &[f64], mut visit: impl FnMut(usize, f64)) {
        for (i, exchange) in &self.members {
            let (i, given) = (i.particle as usize, i.kappa);
            let kappa = kappa.get(i).copied().unwrap_or(given);
            visit(i, exchange.slope(self.sigma_sb, kappa, t[i]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_and_slope_agree() {
        let sigma = 5.67e-8;
        for (depth, kappa) in [(0.0, 1.0), (0.3, 2.0), (1e-9, 3.0)] {
            let e = Exchange { area: 2.0, flux_in: 3.0, h_conv: 5.0, emissivity: 0.5, t_ambient: 300.0, depth };
            let d = 1e-3;
            let power = |t: f64| e.power(sigma, kappa, t);
            let slope = -(power(400.0 + d) - power(400.0 - d)) / (2.0 * d);
            // Central difference of a quartic: exact to rounding of the powers (1e3) over d. Behind a skin the slope is
            // that of the particle's own T, which is hotter than the skin: an upper bound, not far off.
            let bound = e.slope(sigma, kappa, 400.0);
            let off = if depth == 0.3 { 1.1 } else { 1.0 };
            assert!(bound > slope - 1e-7 && bound < off * slope + 1e-7, "{depth}: {slope} {bound}");
        }
    }

    #[test]
    fn what_comes_in_flows_on_to_the_centre() {
        let (sigma, kappa) = (5.67e-8, 1.5);
        for (flux_in, h_conv, emissivity, t_ambient, t) in [
            (3.0, 0.0, 0.0, 0.0, 400.0),
            (0.0, 1e9, 0.0, 300.0, 400.0),
            (-1e4, 2.0, 0.9, 3.0, 1.0),
            (1e6, 0.0, 1.0, 0.0, 0.0),
        ] {
            let e = Exchange { area: 1.0, flux_in, h_conv, emissivity, t_ambient, depth: 0.2 };
            let (power, surface) = (e.power(sigma, kappa, t), e.at_the_area(sigma, kappa, t));
            let flows = kappa / 0.2 * (surface - t);
            let scale = (h_conv * t_ambient).abs() + flux_in.abs() + flows.abs();
            assert!((power - flows).abs() < 1e-12 * scale, "{power} {flows}");
        }
        let held = Exchange { area: 1.0, h_conv: 1e12, t_ambient: 300.0, depth: 0.2, ..Exchange::default() };
        assert!((held.power(sigma, kappa, 400.0) / (-100.0 * kappa / 0.2) - 1.0).abs() < 1e-9);
        assert_eq!(held.power(sigma, 0.0, 400.0), 0.0);
    }

    #[test]
    fn idle_particles_are_left_out() {
        let one = |i: usize| Exchange { area: 1.0, h_conv: f64::from(i == 3), ..Exchange::default() };
        assert_eq!(Surface::new(10, 0.0, false, |_| 1.0, one).unwrap().len(), 1);
        assert_eq!(Surface::new(10, 0.0, true, |_| 1.0, one).unwrap().len(), 10);
    }
}
