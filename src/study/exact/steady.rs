//! Steady states between two fixed temperatures in other shapes than a slab, and bodies without inner resistance.

/// Two layers with a common face at x[1], their outer faces at fixed temperatures: one flux through both, a straight
/// line in each.
#[derive(Debug, Clone, Copy)]
pub struct Layers {
    pub x: [f64; 3],
    pub kappa: [f64; 2],
    pub temperature: [f64; 2],
}

impl Layers {
    /// The flux along x: ΔT over the sum of the resistances.
    pub fn flux(&self) -> f64 {
        let resistance = |i: usize| (self.x[i + 1] - self.x[i]) / self.kappa[i];
        (self.temperature[0] - self.temperature[1]) / (resistance(0) + resistance(1))
    }

    pub fn at(&self, x: f64) -> f64 {
        if x < self.x[1] {
            self.temperature[0] - self.flux() * (x - self.x[0]) / self.kappa[0]
        } else {
            self.temperature[1] + self.flux() * (self.x[2] - x) / self.kappa[1]
        }
    }
}

/// Between two concentric circles (2-D: T is linear in log r) or spheres (3-D: in 1/r) of fixed temperature; continued
/// to half the inner and twice the outer radius, for the particles that hold the temperatures.
#[derive(Debug, Clone, Copy)]
pub struct Shell {
    pub radius: [f64; 2],
    pub temperature: [f64; 2],
    pub centre: [f64; 3],
    pub dim: usize,
}

impl Shell {
    pub fn at(&self, x: [f64; 3]) -> f64 {
        let r = (0..self.dim).map(|a| (x[a] - self.centre[a]).powi(2)).sum::<f64>().sqrt();
        let r = r.clamp(0.5 * self.radius[0], 2.0 * self.radius[1]);
        let potential = |r: f64| match self.dim {
            1 => r,
            2 => r.ln(),
            _ => -1.0 / r,
        };
        let [inner, outer] = self.radius.map(potential);
        let share = (potential(r) - inner) / (outer - inner);
        self.temperature[0] + (self.temperature[1] - self.temperature[0]) * share
    }
}

/// A body of one temperature that radiates into the cold: dT/dt = −r T⁴ with r = area ε sigma / (m c_v).
pub fn radiative_cooling(initial: f64, r: f64, t: f64) -> f64 {
    initial / (1.0 + 3.0 * r * initial.powi(3) * t).cbrt()
}

#[cfg(test)]
mod tests {
    use super::super::laws::{Medium, obeys};
    use super::*;

    #[test]
    fn layers_carry_one_flux() {
        let l = Layers { x: [0.0, 0.3, 1.0], kappa: [2.0, 0.1], temperature: [400.0, 300.0] };
        assert_eq!((l.at(0.0), l.at(1.0)), (400.0, 300.0));
        assert!((l.at(0.3f64.next_down()) - l.at(0.3)).abs() < 1e-12);
        let flux = |x: f64, kappa: f64| -kappa * (l.at(x + 0.01) - l.at(x)) / 0.01;
        assert!((flux(0.1, 2.0) / flux(0.6, 0.1) - 1.0).abs() < 1e-10);
        assert!((flux(0.6, 0.1) - l.flux()).abs() < 1e-10);
    }

    #[test]
    fn shells_are_harmonic_and_end_at_their_temperatures() {
        for dim in 1..=3 {
            let s = Shell { radius: [0.2, 1.1], temperature: [5.0, 3.0], centre: [0.1, 0.0, -0.1], dim };
            for x in [[0.6, 0.1, 0.2], [0.5, -0.4, 0.1]] {
                obeys(dim, Medium::uniform(0.7), |x, _| s.at(x), x, 0.0);
            }
            let ends = [(0.3, 5.0), (1.2, 3.0)].map(|(x, known)| (s.at([x, 0.0, -0.1]) - known).abs());
            assert!(ends.iter().all(|e| *e < 1e-14), "{ends:?}");
        }
    }

    #[test]
    fn a_radiating_body_cools_at_its_rate() {
        let (r, t, d) = (2e-9, 0.3, 1e-4);
        let at = |t: f64| radiative_cooling(900.0, r, t);
        let rate = (at(t + d) - at(t - d)) / (2.0 * d);
        // Central differences: d² T'''/6, relative 1e-8 · (rate/T)² with rate/T = 1.5.
        assert!((rate / (-r * at(t).powi(4)) - 1.0).abs() < 1e-6);
        assert_eq!(at(0.0), 900.0);
    }
}
