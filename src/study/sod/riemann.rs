//! The exact solution of the shock tube (Toro 2009, chapter 4).

/// A gas at rest or in motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gas {
    pub rho: f64,
    pub v: f64,
    pub p: f64,
}

impl Gas {
    pub fn sound(&self, gamma: f64) -> f64 {
        (gamma * self.p / self.rho).sqrt()
    }
}

/// Two gases that meet at x = 0 at time 0.
#[derive(Debug, Clone, Copy)]
pub struct Riemann {
    pub gamma: f64,
    left: Gas,
    right: Gas,
    /// Between the waves.
    pub p_star: f64,
    pub v_star: f64,
}

impl Riemann {
    pub fn new(gamma: f64, left: Gas, right: Gas) -> Riemann {
        // The velocities behind both waves must agree; their difference rises with p: bisection.
        let excess = |p: f64| jump(gamma, &left, p) + jump(gamma, &right, p) + right.v - left.v;
        let (mut low, mut high) = (0.0, 10.0 * left.p.max(right.p));
        for _ in 0..200 {
            let p = 0.5 * (low + high);
            if excess(p) > 0.0 { high = p } else { low = p }
        }
        let p_star = 0.5 * (low + high);
        let v_star = 0.5 * (left.v + right.v + jump(gamma, &right, p_star) - jump(gamma, &left, p_star));
        Riemann { gamma, left, right, p_star, v_star }
    }

    /// The density between the wave of a side and the contact.
    pub fn rho_star(&self, gas: &Gas) -> f64 {
        let (ratio, g) = (self.p_star / gas.p, (self.gamma - 1.0) / (self.gamma + 1.0));
        if ratio > 1.0 { gas.rho * (ratio + g) / (g * ratio + 1.0) } else { gas.rho * ratio.powf(1.0 / self.gamma) }
    }

    /// The density at x/t.
    pub fn density(&self, speed: f64) -> f64 {
        match speed < self.v_star {
            true => self.side(&self.left, speed, 1.0),
            false => self.side(&self.right, speed, -1.0),
        }
    }

    /// On one side of the contact; `sign` mirrors the right side onto the left.
    fn side(&self, gas: &Gas, speed: f64, sign: f64) -> f64 {
        let (gamma, c) = (self.gamma, gas.sound(self.gamma));
        let (s, v, v_star) = (sign * speed, sign * gas.v, sign * self.v_star);
        let ratio = self.p_star / gas.p;
        if ratio > 1.0 {
            let shock = v - c * ((gamma + 1.0) / (2.0 * gamma) * ratio + (gamma - 1.0) / (2.0 * gamma)).sqrt();
            return if s < shock { gas.rho } else { self.rho_star(gas) };
        }
        let tail = v_star - c * ratio.powf((gamma - 1.0) / (2.0 * gamma));
        match s {
            s if s < v - c => gas.rho,
            s if s > tail => self.rho_star(gas),
            s => {
                let fan = 2.0 / (gamma + 1.0) + (gamma - 1.0) / ((gamma + 1.0) * c) * (v - s);
                gas.rho * fan.powf(2.0 / (gamma - 1.0))
            }
        }
    }
}

/// How much faster the gas moves behind a wave into pressure p.
fn jump(gamma: f64, gas: &Gas, p: f64) -> f64 {
    match p > gas.p {
        true => {
            let (a, b) = (2.0 / ((gamma + 1.0) * gas.rho), (gamma - 1.0) / (gamma + 1.0) * gas.p);
            (p - gas.p) * (a / (p + b)).sqrt()
        }
        false => 2.0 * gas.sound(gamma) / (gamma - 1.0) * ((p / gas.p).powf((gamma - 1.0) / (2.0 * gamma)) - 1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{LEFT, RIGHT};
    use super::*;

    #[test]
    fn star_states_are_those_of_the_literature() {
        for (gamma, p, v, left, right) in
            [(1.4, 0.3031302, 0.9274526, 0.4263194, 0.2655737), (5.0 / 3.0, 0.2939452, 0.8411950, 0.4796891, 0.2298057)]
        {
            let tube = Riemann::new(gamma, LEFT, RIGHT);
            let found = [tube.p_star, tube.v_star, tube.rho_star(&LEFT), tube.rho_star(&RIGHT)];
            for (found, known) in found.into_iter().zip([p, v, left, right]) {
                assert!((found - known).abs() < 1e-6, "{found} {known}");
            }
        }
    }

    #[test]
    fn waves_are_where_they_are_known_to_be() {
        let tube = Riemann::new(1.4, LEFT, RIGHT);
        let close = |speed: f64, rho: f64| (tube.density(speed) - rho).abs() < 1e-4;
        assert!(close(-1.1833, 1.0) && close(-0.0702, 0.42632) && close(0.92, 0.42632));
        assert!(close(0.93, 0.26557) && close(1.7521, 0.26557) && close(1.7522, 0.125));
        assert!(tube.density(-0.6) < 0.99 && tube.density(-0.6) > 0.5);
    }
}
