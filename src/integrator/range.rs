//! What y must not leave, where a maximum principle bounds it.
//!
//! Stabilised and implicit methods of second order are not positive: beside a steep front they leave the bounds of their
//! start a little, however well they resolve it. A little is given back by all that exchange with one another, in
//! proportion to what each has above the bound, so that sums are kept; more than a little is a sub-step that is too long.

use crate::error::Result;
use crate::memory;
use crate::pool::Pool;
use crate::sum;

/// The values that y may take; all finite numbers where nothing bounds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    pub low: f64,
    pub high: f64,
}

impl Range {
    pub const FINITE: Range = Range { low: f64::MIN, high: f64::MAX };

    /// Whether it bounds y at all.
    pub fn is_bound(&self) -> bool {
        *self != Range::FINITE
    }

    /// The first value outside; NaN is.
    pub fn first_outside(&self, pool: &Pool, y: &[f64]) -> Option<usize> {
        sum::first(pool, y.len(), |i| !(y[i] >= self.low && y[i] <= self.high))
    }

    /// Moves values that are outside to the bound, if none is farther than `room`: what rounding makes of values that
    /// have come to rest there.
    pub fn clamp(&self, pool: &Pool, room: f64, y: &mut [f64]) -> bool {
        let nearly = Range { low: self.low - room, high: self.high + room };
        let may = room.is_finite() && nearly.first_outside(pool, y).is_none();
        if may {
            pool.update(y, |_, part| part.iter_mut().for_each(|y| *y = y.clamp(self.low, self.high)));
        }
        may
    }

    /// Moves values that are outside to the bound and takes what that gives, or costs, from the others of the same part,
    /// each in proportion to its distance from the bound: Σ weight y of a part stays the same. `part` numbers the parts,
    /// which exchange nothing with one another. Answers false, with y partly changed, where a part would have to give
    /// more than the share `most` of what it has.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn confine(&self, part: &[u32], weight: &[f64], most: f64, y: &mut [f64]) -> Result<bool> {
        Ok(self.is_bound()
            && y.iter().all(|v| v.is_finite())
            && level(self.low, 1.0, part, weight, most, y)?
            && level(self.high, -1.0, part, weight, most, y)?)
    }
}

/// One bound: `sign` points inside.
fn level(bound: f64, sign: f64, part: &[u32], weight: &[f64], most: f64, y: &mut [f64]) -> Result<bool> {
    let inside = |y: f64| sign * (y - bound);
    // What each part lacks, and what it has.
    let mut sums = memory::filled("parts", y.len(), [0.0f64; 2])?;
    for ((&y, &w), &p) in y.iter().zip(weight).zip(part) {
        sums[p as usize][usize::from(inside(y) > 0.0)] += w * inside(y).abs();
    }
    if sums.iter().any(|[lacks, has]| *lacks > most * has) {
        return Ok(false);
    }
    for (y, &p) in y.iter_mut().zip(part) {
        let [lacks, has] = sums[p as usize];
        if lacks > 0.0 {
            *y = bound + sign * (inside(*y).max(0.0) * (1.0 - lacks / has));
        }
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_outside_comes_back_and_sums_of_parts_stay() {
        let range = Range { low: 1.0, high: 4.0 };
        let (part, weight) = ([0, 0, 0, 3, 3, 3], [1.0, 2.0, 1.0, 5.0, 1.0, 1.0]);
        let start = [0.999, 2.0, 3.0, 1.0, 4.001, 2.0];
        let mut y = start;
        assert!(range.confine(&part, &weight, 0.01, &mut y).unwrap());
        assert_eq!(range.first_outside(&Pool::new(1).unwrap(), &y), None);
        assert_eq!((y[0], y[4]), (1.0, 4.0));
        for of in [0, 3] {
            let sum = |y: &[f64]| (0..6).filter(|&i| part[i] == of).map(|i| weight[i] * y[i]).sum::<f64>();
            assert!((sum(&y) - sum(&start)).abs() < 1e-14, "{y:?}");
        }
        // A part in which nothing is outside keeps its bits, and so does everything where all is inside.
        let mut y = [0.999, 2.0, 3.0, 1.1, 3.3, 2.0];
        assert!(range.confine(&part, &weight, 0.01, &mut y).unwrap() && y[3..] == [1.1, 3.3, 2.0]);
        let still = y;
        assert!(range.confine(&part, &weight, 0.0, &mut y).unwrap() && y == still);
    }

    #[test]
    fn more_than_a_little_is_refused() {
        let range = Range { low: 0.0, high: f64::MAX };
        for bad in [[-0.2, 1.0], [f64::NAN, 1.0], [-1.0, 0.0]] {
            assert!(!range.confine(&[0, 0], &[1.0; 2], 0.1, &mut bad.clone()).unwrap(), "{bad:?}");
        }
        // What does not move, and another part, give nothing.
        assert!(!range.confine(&[0, 0], &[1.0, 0.0], 0.1, &mut [-0.01, 1.0]).unwrap());
        assert!(!range.confine(&[0, 1], &[1.0; 2], 0.1, &mut [-0.01, 1.0]).unwrap());
        assert!(!Range::FINITE.confine(&[0, 0], &[1.0; 2], 0.1, &mut [f64::INFINITY, 1.0]).unwrap());
        assert_eq!(Range::FINITE.first_outside(&Pool::new(1).unwrap(), &[1.0, f64::NAN]), Some(1));
    }
}
