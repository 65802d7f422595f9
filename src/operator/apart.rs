//! r_b − r_a of every pair, kept for as long as all rows are worked on together.

use crate::error::Result;
use crate::memory;
use crate::pool::Pool;
use crate::space::{Scratch, rows::Rows};

/// In single precision and lengths of `unit`, in stretches of `length` rows and in the order of a matrix made from the same rows. What the
/// two sides of a pair say is equal and opposite to the bit.
///
/// # Errors
/// `NoMemory`.
pub fn of<const D: usize>(rows: &Rows, length: usize, unit: f64, pool: &Pool) -> Result<Vec<Vec<[f32; D]>>> {
    let n = rows.cloud.len();
    let stretches = pool.map_init(n.div_ceil(length), Scratch::default, |scratch, s| {
        let mut stretch = Vec::new();
        rows.visit(s * length..((s + 1) * length).min(n), scratch, |row| {
            memory::room("pairs", &mut stretch, row.len())?;
            stretch.extend(
                (0..row.len()).map(|k| std::array::from_fn(|a| row.d[a].get(k).map_or(0.0, |d| (d / unit) as f32))),
            );
            Ok(())
        })?;
        Ok(stretch)
    });
    stretches.into_iter().collect()
}
