//! The box: open or periodic on each axis.

use super::Axes;
use crate::error::{Error, Result};
use std::ops::RangeInclusive;

/// Images of the box that a support may reach on each side. More would mean that each particle meets itself a dozen
/// times: the resolution is wrong, not the search.
pub const MAX_IMAGES: usize = 6;

/// Lengths l in so many dimensions whose weights 1/l^(nu + 2), volumes, and products of two volumes, are numbers.
pub fn lengths(dim: usize) -> RangeInclusive<f64> {
    [1e-100..=1e100, 1e-75..=1e75, 1e-60..=1e50][dim - 1].clone()
}

/// As an error says it, with what helps.
pub fn rule_of_lengths(dim: usize, remedy: &str) -> String {
    let (least, most) = lengths(dim).into_inner();
    format!(
        "in {dim}-D lengths must lie between {least:e} and {most:e}, so that weights and volumes are numbers: {remedy}"
    )
}

pub const OTHER_UNITS: &str = "choose other units";

#[derive(Debug, Clone, PartialEq)]
pub struct Domain {
    pub dim: usize,
    pub lo: Axes<f64>,
    pub hi: Axes<f64>,
    pub periodic: Axes<bool>,
}

impl Domain {
    /// Open space.
    pub fn open(dim: usize) -> Domain {
        Domain { dim, lo: [0.0; 3], hi: [0.0; 3], periodic: [false; 3] }
    }

    /// A box that is periodic on some axes; on the others its bounds only have to be numbers.
    ///
    /// # Errors
    /// `BadElement` for bounds that are not finite or a periodic axis whose length is none or not among [`lengths`].
    pub fn new(lo: &[f64], hi: &[f64], periodic: &[bool]) -> Result<Domain> {
        let mut domain = Domain::open(lo.len());
        for axis in 0..lo.len() {
            for (name, value) in [("lo", lo[axis]), ("hi", hi[axis])] {
                if !value.is_finite() {
                    return Err(Error::bad_at(name, axis, value, "the bounds of the box must be finite"));
                }
            }
            if periodic[axis] && hi[axis] <= lo[axis] {
                return Err(Error::bad_at("hi", axis, hi[axis], "a periodic box needs hi > lo"));
            }
            if periodic[axis] && !lengths(lo.len()).contains(&(hi[axis] - lo[axis])) {
                let ends = [("lo", lo[axis]), ("hi", hi[axis])];
                let (name, value) = if lo[axis].abs() > hi[axis].abs() { ends[0] } else { ends[1] };
                return Err(Error::bad_at(name, axis, value, &rule_of_lengths(lo.len(), OTHER_UNITS)));
            }
            (domain.lo[axis], domain.hi[axis], domain.periodic[axis]) = (lo[axis], hi[axis], periodic[axis]);
        }
        Ok(domain)
    }

    pub fn length(&self, axis: usize) -> f64 {
        self.hi[axis] - self.lo[axis]
    }

    /// A coordinate moved into the box; coordinates already inside are not touched.
    pub fn wrap(&self, axis: usize, x: f64) -> f64 {
        let (lo, hi, length) = (self.lo[axis], self.hi[axis], self.length(axis));
        if !self.periodic[axis] || (x >= lo && x < hi) {
            return x;
        }
        let inside = x - length * ((x - lo) / length).floor();
        if inside >= lo && inside < hi { inside } else { lo }
    }

    /// The images k (by k box lengths) of the box that an interval [from, to] touches on an axis.
    pub fn images(&self, axis: usize, from: f64, to: f64) -> std::ops::RangeInclusive<i64> {
        if !self.periodic[axis] {
            return 0..=0;
        }
        let image = |x: f64| ((x - self.lo[axis]) / self.length(axis)).floor() as i64;
        image(from)..=image(to)
    }

    /// The longest support that [`Domain::check_reach`] takes; infinite in open space.
    pub fn farthest(&self) -> f64 {
        let periodic = (0..self.dim).filter(|&a| self.periodic[a]);
        periodic.map(|a| Self::images_of(self.length(a))).fold(f64::INFINITY, f64::min)
    }

    fn images_of(length: f64) -> f64 {
        length * MAX_IMAGES as f64
    }

    /// Refuses a support that is not among [`lengths`] or so large that it reaches more than [`MAX_IMAGES`] images.
    pub fn check_reach(&self, reach: f64, index: usize) -> Result<()> {
        if !lengths(self.dim).contains(&reach) {
            let rule = rule_of_lengths(self.dim, "choose another h or h_fac, or other units");
            return Err(Error::bad_at("h", index, format!("of a support of {reach:e}"), &rule));
        }
        for axis in (0..self.dim).filter(|&a| self.periodic[a]) {
            let length = self.length(axis);
            if reach > Self::images_of(length) {
                return Err(Error::BoxTooSmall { axis, length, reach, index, images: MAX_IMAGES });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrapping_is_idempotent_and_stays_inside() {
        let d = Domain::new(&[-1.0], &[2.0], &[true]).unwrap();
        for x in [-1.0, 0.3, 2.0, 1e9 + 0.1, -7.3, 2.0f64.next_down(), (-1.0f64).next_down(), -1e-300] {
            let w = d.wrap(0, x);
            assert!((-1.0..2.0).contains(&w), "{x} -> {w}");
            assert_eq!(d.wrap(0, w), w);
        }
        assert_eq!(d.wrap(0, 0.3), 0.3);
    }

    #[test]
    fn images_of_a_small_box() {
        let d = Domain::new(&[0.0], &[1.0], &[true]).unwrap();
        assert_eq!(d.images(0, -0.2, 0.3), -1..=0);
        assert_eq!(d.images(0, -1.2, 2.3), -2..=2);
        for reach in [1e-101, 1e101, f64::INFINITY, f64::NAN] {
            let text = Domain::open(1).check_reach(reach, 7).unwrap_err().to_string();
            assert!(text.contains("h[7]") && text.contains("1e100"), "{text}");
        }
        for length in [1e-101, 1e101, 1.7e308] {
            assert!(
                Domain::new(&[0.0], &[length], &[true]).is_err() && Domain::new(&[0.0], &[length], &[false]).is_ok()
            );
        }
        assert!(Domain::new(&[-1.7e308], &[1.7e308], &[true]).unwrap_err().to_string().starts_with("hi[0] is 1.7"));
        assert!(Domain::new(&[-1.7e308], &[1.0], &[true]).unwrap_err().to_string().starts_with("lo[0] is -1.7"));
        for dim in 1..=3 {
            let (least, most) = lengths(dim).into_inner();
            let volume = most.powi(dim as i32);
            assert!((volume * volume).is_finite() && least.powi(-(dim as i32) - 2).is_finite(), "{dim}");
        }
        assert!(d.check_reach(100.0, 7).unwrap_err().to_string().contains("particle 7"));
        assert!(Domain::new(&[0.0], &[0.0], &[true]).is_err() && Domain::new(&[f64::NAN], &[0.0], &[false]).is_err());
    }
}
