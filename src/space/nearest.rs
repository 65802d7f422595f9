//! From one particle to another without a search, where at most one image of each can be near.

use super::Domain;

/// r_b − r_a by the nearest image: the same bits as a search's, for particles that are neighbours.
#[derive(Clone, Copy)]
pub struct Nearest<const D: usize> {
    /// Half the length of the box; infinite where it is open.
    half: [f64; D],
    length: [f64; D],
}

impl<const D: usize> Nearest<D> {
    /// None where a particle may have two images within `reach`.
    pub fn new(domain: &Domain, reach: f64) -> Option<Nearest<D>> {
        let wide = |a: usize| !domain.periodic[a] || domain.length(a) * (1.0 - 1e-9) > 2.0 * reach;
        let half = |a: usize| if domain.periodic[a] { 0.5 * domain.length(a) } else { f64::INFINITY };
        let made = || Nearest { half: std::array::from_fn(half), length: std::array::from_fn(|a| domain.length(a)) };
        (0..D).all(wide).then(made)
    }

    #[inline(always)]
    pub fn apart(&self, from: &[f64; D], to: &[f64; D]) -> [f64; D] {
        std::array::from_fn(|a| {
            let (d, length) = (to[a] - from[a], self.length[a]);
            let shift = if d > self.half[a] { -length } else { 0.0 };
            let shift = if d < -self.half[a] { length } else { shift };
            d + shift
        })
    }
}
