//! The conductivity between two particles from the conductivities at them.

use crate::error::{Error, Result};

/// An average that is symmetric to the bit and equals k for equal values k.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mean {
    /// 2ab/(a+b): continuous flux across a jump (Cleary & Monaghan 1999); 0 insulates.
    Harmonic,
    /// (a+b)/2: for fronts that run into a medium that does not conduct yet.
    Arithmetic,
    /// sqrt(ab)
    Geometric,
}

pub static MEANS: &[(&str, Mean, &str)] = &[
    ("harmonic", Mean::Harmonic, "2ab/(a+b): continuous flux across a jump (Cleary & Monaghan 1999); 0 insulates"),
    ("arithmetic", Mean::Arithmetic, "(a+b)/2: for kappa(T) fronts that run into a cold medium"),
    ("geometric", Mean::Geometric, "sqrt(ab)"),
];

impl Mean {
    pub fn find(name: &str) -> Result<Mean> {
        let found = MEANS.iter().find(|(n, ..)| n.eq_ignore_ascii_case(name));
        found.map(|(_, mean, _)| *mean).ok_or_else(|| Error::unknown("mean", name, MEANS.iter().map(|(n, ..)| n)))
    }

    pub fn name(self) -> &'static str {
        MEANS.iter().find(|(_, mean, _)| *mean == self).map_or("", |(name, ..)| name)
    }

    /// What a gradient at a particle of conductivity `a` makes of its difference to one of conductivity `b`, so that `a`
    /// times it is what flows: mean/a for the harmonic mean, whose differences lie mostly on the side that conducts less;
    /// 1 for the arithmetic mean, which is that of the fluxes on both sides. Between 0 and 2.
    #[inline(always)]
    pub fn share(self, a: f64, b: f64) -> f64 {
        match self {
            Mean::Harmonic if a < b => 2.0 / (1.0 + a / b),
            Mean::Harmonic if b > 0.0 => 2.0 * (b / a / (1.0 + b / a)),
            Mean::Harmonic => 0.0,
            Mean::Arithmetic | Mean::Geometric => 1.0,
        }
    }

    #[inline(always)]
    pub fn of(self, a: f64, b: f64) -> f64 {
        match self {
            Mean::Harmonic => harmonic(a, b),
            Mean::Arithmetic => 0.5 * (a + b),
            Mean::Geometric => (a * b).sqrt(),
        }
    }
}

/// Written with the smaller and the larger value, so that it neither overflows nor divides 0 by 0.
#[inline(always)]
fn harmonic(a: f64, b: f64) -> f64 {
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    2.0 * low * (high / (low + high).max(f64::MIN_POSITIVE))
}

/// An average, and the conductivity of each particle; none where it is one for all, or in the coefficients already.
pub type Kappa<'a> = Option<(Mean, &'a [f64])>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_symmetric_and_keep_equal_values_exactly() {
        for (_, mean, _) in MEANS {
            for a in [0.0, 1e-100, 0.3, 1.0, 7.7, 1e100] {
                assert_eq!(mean.of(a, a), a, "{mean:?} of {a}");
                for b in [0.0, 1e-3, 2.0, 1e90] {
                    assert_eq!(mean.of(a, b).to_bits(), mean.of(b, a).to_bits());
                    assert!(mean.of(a, b) >= a.min(b) * (1.0 - 1e-15) && mean.of(a, b) <= a.max(b) * (1.0 + 1e-15));
                }
            }
            assert_eq!(Mean::find(mean.name()).unwrap(), *mean);
        }
        for (a, b) in [(1.0, 3.0), (3.0, 1.0), (1e-200, 1e200), (1e200, 1e-100), (2.0, 0.0)] {
            let share = Mean::Harmonic.share(a, b);
            assert!((0.0..=2.0).contains(&share), "{share}");
            assert!((a * share - Mean::Harmonic.of(a, b)).abs() <= 4e-16 * a * share, "{a} {b}");
        }
        assert_eq!([Mean::Harmonic.share(0.0, 0.0), Mean::Harmonic.share(7.7, 7.7)], [0.0, 1.0]);
        assert_eq!(Mean::Harmonic.of(1.0, 3.0), 1.5);
        assert_eq!(Mean::Harmonic.of(0.0, 3.0), 0.0);
        assert!(Mean::find("harmonik").is_err());
    }
}
