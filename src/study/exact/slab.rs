//! A slab between x = a and x = b that exchanges heat at its faces.

use super::numbers::{biot_roots, root};
use std::f64::consts::PI;

/// Terms of the series. They are exact to rounding from t = 5e-6 L²/D on; before, only a layer of a few thousandths of
/// the slab is touched, and T at t = 0 is the given one.
const TERMS: usize = 1000;

/// e^(−x) is below the rounding of anything it is added to.
const NEGLIGIBLE: f64 = 45.0;

/// A material slab: from a to b.
#[derive(Debug, Clone, Copy)]
pub struct Slab {
    pub a: f64,
    pub b: f64,
    pub kappa: f64,
    /// rho c_v.
    pub capacity: f64,
}

impl Slab {
    fn length(&self) -> f64 {
        self.b - self.a
    }

    /// D t / L²
    fn fourier(&self, t: f64) -> f64 {
        self.kappa / self.capacity * t / self.length().powi(2)
    }

    /// 0 at a, 1 at b.
    fn share(&self, x: f64) -> f64 {
        (x - self.a) / self.length()
    }

    /// Both faces at fixed temperatures and heat released inside, steady: a parabola.
    pub fn between(&self, temperature: [f64; 2], source: f64, x: f64) -> f64 {
        let share = self.share(x);
        temperature[0]
            + (temperature[1] - temperature[0]) * share
            + source * self.length().powi(2) / (2.0 * self.kappa) * share * (1.0 - share)
    }

    /// Fixed temperature at a, loss h (T − T_ambient) at b, steady: a straight line.
    pub fn loses(&self, fixed: f64, h: f64, ambient: f64, x: f64) -> f64 {
        let biot = h * self.length() / self.kappa;
        fixed + (ambient - fixed) * biot / (1.0 + biot) * self.share(x)
    }

    /// Fixed temperature at a, radiation ε sigma (T⁴ − T_ambient⁴) at b, steady: a straight line to the root of a
    /// quartic.
    pub fn radiates(&self, fixed: f64, emissivity_sigma: f64, ambient: f64, x: f64) -> f64 {
        let g = self.kappa / self.length();
        let balance = |t: f64| {
            let gain = g * (fixed - t) - emissivity_sigma * (t.powi(4) - ambient.powi(4));
            (gain, -g - 4.0 * emissivity_sigma * t.powi(3))
        };
        let face = if fixed == ambient { fixed } else { root(fixed.min(ambient), fixed.max(ambient), balance) };
        fixed + (face - fixed) * self.share(x)
    }

    /// Insulated at a, heated by a constant flux q at b, from a uniform temperature.
    pub fn heated(&self, initial: f64, q: f64, x: f64, t: f64) -> f64 {
        if t <= 0.0 {
            return initial;
        }
        let (s, f) = (self.share(x), self.fourier(t));
        let series: f64 = (1..=TERMS)
            .map(|n| (n as f64 * PI, if n % 2 == 0 { 1.0 } else { -1.0 }))
            .take_while(|(z, _)| z * z * f < NEGLIGIBLE)
            .map(|(z, sign)| sign * (z * s).cos() * (-z * z * f).exp() / (z * z))
            .sum();
        initial + q * self.length() / self.kappa * (f + (3.0 * s * s - 1.0) / 6.0 - 2.0 * series)
    }
}

/// A slab at a uniform temperature, insulated at a, that from t = 0 on loses h (T − T_ambient) at b: Biot's series
/// over the roots of z tan z = h L/kappa.
#[derive(Debug, Clone)]
pub struct Cooling {
    slab: Slab,
    initial: f64,
    ambient: f64,
    roots: Vec<f64>,
}

impl Cooling {
    pub fn new(slab: Slab, initial: f64, h: f64, ambient: f64) -> Cooling {
        Cooling { slab, initial, ambient, roots: biot_roots(h * slab.length() / slab.kappa, TERMS) }
    }

    pub fn at(&self, x: f64, t: f64) -> f64 {
        if t <= 0.0 {
            return self.initial;
        }
        let (s, f) = (self.slab.share(x), self.slab.fourier(t));
        let terms = self.roots.iter().take_while(|z| *z * *z * f < NEGLIGIBLE);
        let series: f64 =
            terms.map(|z| 4.0 * z.sin() / (2.0 * z + (2.0 * z).sin()) * (z * s).cos() * (-z * z * f).exp()).sum();
        self.ambient + (self.initial - self.ambient) * series
    }
}

#[cfg(test)]
mod tests {
    use super::super::laws::{Medium, obeys};
    use super::*;

    const SLAB: Slab = Slab { a: -0.2, b: 0.5, kappa: 0.6, capacity: 2.0 };

    /// The slope at x by one-sided differences of second order into the slab.
    fn slope(f: impl Fn(f64) -> f64, x: f64, d: f64) -> f64 {
        (-1.5 * f(x) + 2.0 * f(x + d) - 0.5 * f(x + 2.0 * d)) / d
    }

    #[test]
    fn steady_slabs_meet_their_equation_and_both_faces() {
        let heated = |x: [f64; 3], _: f64| SLAB.between([3.0, 5.0], 7.0, x[0]);
        let medium = Medium { kappa: &|_| 0.6, capacity: 2.0, source: 7.0 };
        obeys(1, medium, heated, [0.1, 0.0, 0.0], 0.0);
        assert_eq!((heated([-0.2, 0.0, 0.0], 0.0), heated([0.5, 0.0, 0.0], 0.0)), (3.0, 5.0));

        let loses = |x: f64| SLAB.loses(400.0, 2.5, 300.0, x);
        let flux = -0.6 * slope(loses, 0.5, -1e-3);
        assert_eq!(loses(-0.2), 400.0);
        assert!((flux / (2.5 * (loses(0.5) - 300.0)) - 1.0).abs() < 1e-10);

        let sigma = 0.8 * 5.67e-8;
        let radiates = |x: f64| SLAB.radiates(1000.0, sigma, 300.0, x);
        let flux = -0.6 * slope(radiates, 0.5, -1e-3);
        let lost = sigma * (radiates(0.5).powi(4) - 300f64.powi(4));
        assert!(radiates(0.5) > 300.0 && (flux / lost - 1.0).abs() < 1e-9, "{flux} {lost}");
        assert_eq!(SLAB.radiates(300.0, sigma, 300.0, 0.1), 300.0);
    }

    #[test]
    fn a_slab_heated_by_a_flux_takes_in_just_that() {
        let at = |x: f64, t: f64| SLAB.heated(300.0, 50.0, x, t);
        for (x, t) in [(0.0, 0.05), (0.3, 0.2), (0.45, 3.0)] {
            obeys(1, Medium { kappa: &|_| 0.6, capacity: 2.0, source: 0.0 }, |x, t| at(x[0], t), [x, 0.0, 0.0], t);
        }
        for t in [0.02, 0.4] {
            assert!((0.6 * slope(|x| at(x, t), 0.5, -1e-4) / -50.0 + 1.0).abs() < 1e-5, "flux in at b");
            assert!(slope(|x| at(x, t), -0.2, 1e-4).abs() < 1e-3, "none at a");
            let n = 2000;
            let mean: f64 = (0..n).map(|i| at(-0.2 + 0.7 * (i as f64 + 0.5) / n as f64, t)).sum::<f64>() / n as f64;
            // The midpoint rule: q d²/(24 kappa L) = 6e-7.
            assert!((mean - 300.0 - 50.0 * t / (2.0 * 0.7)).abs() < 1e-6, "heat is kept");
        }
        // Soon after the start only the heated face knows: the half-space's 2 q sqrt(t/(pi kappa rho c)).
        let t = 1e-4;
        assert!((at(0.5, t) - 300.0 - 2.0 * 50.0 * (t / (PI * 0.6 * 2.0)).sqrt()).abs() < 1e-9);
        assert!((at(-0.2, t) - 300.0).abs() < 1e-9);
    }

    #[test]
    fn a_cooling_slab_obeys_its_equation_and_its_face() {
        for h in [0.05, 3.0, 400.0] {
            let c = Cooling::new(SLAB, 400.0, h, 300.0);
            let medium = Medium { kappa: &|_| 0.6, capacity: 2.0, source: 0.0 };
            for (x, t) in [(0.0, 0.05), (0.3, 0.2), (0.45, 1.0)] {
                obeys(1, medium, |x, t| c.at(x[0], t), [x, 0.0, 0.0], t);
            }
            let flux = 0.6 * slope(|x| c.at(x, 0.3), 0.5, -1e-4);
            let lost = h * (c.at(0.5, 0.3) - 300.0);
            assert!((-flux / lost - 1.0).abs() < 1e-4, "{flux} {lost}");
            assert!(slope(|x| c.at(x, 0.3), -0.2, 1e-4).abs() < 1e-3 * h.max(1.0));
            // Far from the face nothing has happened yet.
            assert!((c.at(-0.2, 1e-3) - 400.0).abs() < 1e-9, "{}", c.at(-0.2, 1e-3));
        }
    }
}
