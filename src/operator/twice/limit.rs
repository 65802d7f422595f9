//! Limited exchanges: what a pair exchanges beyond a monotone operator is scaled down until no new extremum can appear
//! (Zalesak 1979; Kuzmin, Shashkov & Svyatskiy 2009 for anisotropic diffusion).
//!
//! A particle may gain from corrections at most Q⁺ = Σ q_ab (T_b − T_a)⁺ and lose at most Q⁻, so a local maximum gains
//! nothing. A pair takes the smaller share of both ends, with opposite signs: energy is kept to rounding.

use super::{Exchange, Twice};
use crate::error::Result;
use crate::memory;
use crate::operator::{Kappa, Matrix};
use crate::pool::Pool;

/// q_ab in units of the isotropic weights. On 2-D glass and jitter, kappa_perp = 0, 1 clipped smooth extrema (error
/// 0.25), 2 to 8 differed by less than a fifth; the explicit limit falls with it.
pub(super) const ROOM: f64 = 2.0;

impl Twice {
    pub(super) fn limited(
        &self,
        pool: &Pool,
        (matrix, kappa): (&Matrix, Kappa),
        t: &[f64],
        exchange: impl Fn(&Exchange) -> f64 + Sync + Send,
        out: &mut [f64],
        finish: impl Fn(usize, f64) -> f64 + Sync + Send,
    ) -> Result<()> {
        let low = |e: &Exchange| e.mean_kappa * e.low * (t[e.b] - t[e.a]);
        // The share of corrections up and down that each particle can take.
        let mut shares = memory::filled("shares", t.len(), [1.0; 2])?;
        self.each(pool, &mut shares, |a| {
            let (mut wanted, mut room) = ([0.0; 2], [0.0; 2]);
            for e in self.row(matrix, kappa, a) {
                let (correction, rise) = (exchange(&e) - low(&e), t[e.b] - t[e.a]);
                let may = ROOM * e.mean_kappa * e.coef * rise;
                wanted = [wanted[0] + correction.max(0.0), wanted[1] + correction.min(0.0)];
                room = [room[0] + may.max(0.0), room[1] + may.min(0.0)];
            }
            [0, 1].map(|k| if wanted[k] != 0.0 { (room[k] / wanted[k]).min(1.0) } else { 1.0 })
        })?;
        self.each(pool, out, |a| {
            let pairs = self.row(matrix, kappa, a).map(|e| {
                let (low, all) = (low(&e), exchange(&e));
                let up = usize::from(all < low);
                low + (all - low) * shares[e.a][up].min(shares[e.b][1 - up])
            });
            finish(a, pairs.sum())
        })?;
        Ok(())
    }
}
