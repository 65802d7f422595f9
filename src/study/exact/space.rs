//! Solutions in a periodic box and in open space.

use super::numbers::erf;

/// T = mean + A Π sin(k_i x_i) e^(−D k² t), the product over the axes with k_i ≠ 0.
#[derive(Debug, Clone, Copy)]
pub struct Sine {
    pub mean: f64,
    pub amplitude: f64,
    pub k: [f64; 3],
    pub diffusivity: f64,
}

impl Sine {
    pub fn at(&self, x: [f64; 3], t: f64) -> f64 {
        let waves = self.k.iter().zip(x).filter(|(k, _)| **k != 0.0);
        let shape: f64 = waves.map(|(k, x)| (k * x).sin()).product();
        let k2: f64 = self.k.iter().map(|k| k * k).sum();
        self.mean + self.amplitude * shape * (-self.diffusivity * k2 * t).exp()
    }
}

/// A Gaussian of variance s² that spreads: s² + 2 D t, with its integral kept.
#[derive(Debug, Clone, Copy)]
pub struct Gaussian {
    pub mean: f64,
    /// Height above the mean at t = 0.
    pub amplitude: f64,
    pub s: f64,
    pub centre: [f64; 3],
    pub dim: usize,
    pub diffusivity: f64,
}

impl Gaussian {
    pub fn at(&self, x: [f64; 3], t: f64) -> f64 {
        let s2 = self.s * self.s;
        let wide = s2 + 2.0 * self.diffusivity * t;
        let r2: f64 = (0..self.dim).map(|a| (x[a] - self.centre[a]).powi(2)).sum();
        self.mean + self.amplitude * (s2 / wide).powf(0.5 * self.dim as f64) * (-0.5 * r2 / wide).exp()
    }
}

/// Two half-spaces of different material and temperature, in touch at x = `at` from t = 0 on. The contact takes
/// (e_L T_L + e_R T_R)/(e_L + e_R) at once, with e = √(kappa rho c), and on each side an error function spreads with
/// that side's diffusivity. Equal materials make it the decay of a step.
#[derive(Debug, Clone, Copy)]
pub struct Contact {
    pub at: f64,
    pub temperature: [f64; 2],
    pub kappa: [f64; 2],
    /// rho c_v.
    pub capacity: [f64; 2],
}

impl Contact {
    /// The temperature of the contact, the same at all times.
    pub fn interface(&self) -> f64 {
        let e = |side: usize| (self.kappa[side] * self.capacity[side]).sqrt();
        (e(0) * self.temperature[0] + e(1) * self.temperature[1]) / (e(0) + e(1))
    }

    pub fn at(&self, x: [f64; 3], t: f64) -> f64 {
        let from = x[0] - self.at;
        let side = usize::from(from >= 0.0);
        if t <= 0.0 {
            return self.temperature[side];
        }
        let reach = (4.0 * self.kappa[side] / self.capacity[side] * t).sqrt();
        let contact = self.interface();
        contact + (self.temperature[side] - contact) * erf(from.abs() / reach)
    }
}

/// The wave of Zel'dovich and Barenblatt: heat released in one point, with kappa = a rho c T^n. It keeps a sharp front
/// at r_f² = 2 a C t^(2β)/(n β); T = t^(−nu β) [C − n β r² t^(−2β)/(2a)]^(1/n) inside, β = 1/(nu n + 2).
#[derive(Debug, Clone, Copy)]
pub struct Barenblatt {
    pub a: f64,
    pub n: f64,
    /// C: sets the heat released.
    pub strength: f64,
    pub centre: [f64; 3],
    pub dim: usize,
}

impl Barenblatt {
    fn beta(&self) -> f64 {
        1.0 / (self.dim as f64 * self.n + 2.0)
    }

    /// The radius of the front.
    pub fn front(&self, t: f64) -> f64 {
        (2.0 * self.a * self.strength / (self.n * self.beta())).sqrt() * t.powf(self.beta())
    }

    pub fn at(&self, x: [f64; 3], t: f64) -> f64 {
        let r2: f64 = (0..self.dim).map(|a| (x[a] - self.centre[a]).powi(2)).sum();
        let beta = self.beta();
        let inside = self.strength - self.n * beta * r2 * t.powf(-2.0 * beta) / (2.0 * self.a);
        t.powf(-(self.dim as f64) * beta) * inside.max(0.0).powf(1.0 / self.n)
    }
}

#[cfg(test)]
mod tests {
    use super::super::laws::{Medium, obeys};
    use super::*;

    const SOMEWHERE: [[f64; 3]; 4] = [[0.13, -0.2, 0.31], [0.4, 0.1, -0.1], [-0.3, 0.22, 0.05], [-0.05, -0.4, 0.2]];

    #[test]
    fn waves_gaussians_and_steps_obey_the_heat_equation() {
        for dim in 1..=3 {
            let mut k = [0.0; 3];
            k[..dim].copy_from_slice(&[3.0, -2.0, 4.0][..dim]);
            let sine = Sine { mean: 2.0, amplitude: 0.7, k, diffusivity: 0.3 };
            let centre = [0.1, -0.1, 0.05];
            let gaussian = Gaussian { mean: 1.0, amplitude: 3.0, s: 0.3, centre, dim, diffusivity: 0.3 };
            for x in SOMEWHERE {
                obeys(dim, Medium::uniform(0.3), |x, t| sine.at(x, t), x, 0.2);
                obeys(dim, Medium::uniform(0.3), |x, t| gaussian.at(x, t), x, 0.2);
            }
        }
        let step = Contact { at: 0.02, temperature: [1.0, 2.0], kappa: [0.3; 2], capacity: [1.0; 2] };
        for x in SOMEWHERE {
            obeys(1, Medium::uniform(0.3), |x, t| step.at(x, t), x, 0.2);
            let known = 1.5 + 0.5 * erf((x[0] - 0.02) / (4.0f64 * 0.3 * 0.2).sqrt());
            assert!((step.at(x, 0.2) - known).abs() < 1e-15);
        }
    }

    #[test]
    fn a_gaussian_keeps_its_heat() {
        let g = Gaussian { mean: 0.0, amplitude: 2.0, s: 0.1, centre: [0.0; 3], dim: 2, diffusivity: 1.0 };
        let heat = |t: f64| (0..4000).map(|i| (i as f64 + 0.5) * 1e-3).map(|r| r * g.at([r, 0.0, 0.0], t)).sum::<f64>();
        // The midpoint rule in r, whose end correction is f'(0) d²/24 = 1e-7 of the integral 0.02.
        assert!((heat(0.03) / heat(0.0) - 1.0).abs() < 1e-5);
    }

    #[test]
    fn two_materials_meet_with_one_temperature_and_one_flux() {
        let c = Contact { at: 0.0, temperature: [400.0, 300.0], kappa: [10.0, 0.2], capacity: [2.0, 5.0] };
        let (t, d) = (0.1, 1e-5);
        for (x, side) in [([-0.3, 0.0, 0.0], 0), ([0.04, 0.0, 0.0], 1)] {
            obeys(1, Medium::uniform(c.kappa[side] / c.capacity[side]), |x, t| c.at(x, t), x, t);
        }
        let left = c.kappa[0] * (c.at([0.0; 3], t) - c.at([-d, 0.0, 0.0], t)) / d;
        let right = c.kappa[1] * (c.at([d, 0.0, 0.0], t) - c.at([0.0; 3], t)) / d;
        // One-sided differences: relative error of order d² / (D t) = 2.5e-8 on the slower side.
        assert!((left / right - 1.0).abs() < 1e-6, "{left} {right}");
        assert_eq!((c.at([-1.0, 0.0, 0.0], 0.0), c.at([1.0, 0.0, 0.0], 0.0)), (400.0, 300.0));
    }

    #[test]
    fn the_nonlinear_wave_obeys_its_equation_behind_the_front_and_is_nothing_ahead() {
        for dim in 1..=3 {
            for n in [1.0, 2.5, 6.0] {
                let w = Barenblatt { a: 0.7, n, strength: 1.3, centre: [0.0; 3], dim };
                let medium = Medium { kappa: &move |t: f64| 0.7 * t.powf(n), capacity: 1.0, source: 0.0 };
                for share in [0.1, 0.5, 0.8] {
                    let x = [share * w.front(0.4), 0.0, 0.0];
                    obeys(dim, medium, |x, t| w.at(x, t), x, 0.4);
                }
                assert_eq!(w.at([w.front(0.4) * 1.0001, 0.0, 0.0], 0.4), 0.0);
            }
        }
    }
}
