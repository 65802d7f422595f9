//! Particles that conduct badly and that pairs of better ones reach over: a layer thinner than the supports of its
//! neighbours does not insulate them from each other.

use crate::error::Result;
use crate::memory;
use crate::pool::Pool;
use crate::space::{Axes, Row, rows::Rows};
use crate::sum;

/// How much better a neighbour conducts before it counts.
const CONTRAST: f64 = 10.0;
/// Of a support: pairs farther apart hardly exchange.
const WITHIN: f64 = 0.9;
/// −cos of the least angle between neighbours on opposite sides, 120 degrees.
const OPPOSITE: f64 = 0.5;

/// Of the particles beside ones that conduct ten times better, how many there are, and how many have such neighbours on
/// opposite sides that are near enough to exchange heat with each other. Where two thick bodies touch there are none but
/// at corners.
///
/// # Errors
/// `NoMemory`.
pub fn count(rows: &Rows, kappa: impl Fn(usize) -> f64 + Sync + Send, pool: &Pool) -> Result<(usize, usize)> {
    let mut sides = memory::filled("layers", rows.h.len(), 0.0)?;
    rows.map(pool, &mut sides, |better: &mut Vec<Axes<f64>>, row: Row| Ok(of_row(rows, &row, &kappa, better)))?;
    let number = |least: f64| sum::sum(pool, sides.len(), |i| f64::from(sides[i] >= least)) as usize;
    Ok((number(1.0), number(2.0)))
}

/// 0: no better neighbours; 1: some; 2: on opposite sides.
fn of_row(rows: &Rows, row: &Row, kappa: impl Fn(usize) -> f64, better: &mut Vec<Axes<f64>>) -> f64 {
    let own = kappa(row.i);
    let good = |&k: &usize| kappa(row.j[k] as usize) > CONTRAST * own && row.r[k] > 0.0;
    better.clear();
    better.extend((0..row.len()).filter(good).map(|k| row.d.map(|axis| axis.get(k).copied().unwrap_or(0.0))));
    let most = (WITHIN * rows.radius * rows.h[row.i]).powi(2);
    let dot = |a: &Axes<f64>, b: &Axes<f64>| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
    let over = |a: &Axes<f64>, b: &Axes<f64>| {
        let (aa, bb, ab) = (dot(a, a), dot(b, b), dot(a, b));
        ab < 0.0 && ab * ab > OPPOSITE * OPPOSITE * aa * bb && aa + bb - 2.0 * ab < most
    };
    let bypassed = better.iter().enumerate().any(|(k, a)| better[..k].iter().any(|b| over(a, b)));
    f64::from(u8::from(!better.is_empty()) + u8::from(bypassed))
}
