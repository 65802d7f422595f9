//! r_b − r_a of every pair, kept for as long as all rows are worked on together.

use crate::error::Result;
use crate::memory;
use crate::pool::{BLOCK, Pool};
use crate::space::{Scratch, rows::Rows};

/// In single precision and lengths of `unit`, block by block in the order of a matrix made from the same rows. What the
/// two sides of a pair say is equal and opposite to the bit.
///
/// # Errors
/// `NoMemory`.
pub fn of<const D: usize>(rows: &Rows, unit: f64, pool: &Pool) -> Result<Vec<Vec<[f32; D]>>> {
    let n = rows.cloud.len();
    let blocks = pool.map_init(n.div_ceil(BLOCK), Scratch::default, |scratch, b| {
        let mut block = Vec::new();
        rows.visit(b * BLOCK..((b + 1) * BLOCK).min(n), scratch, |row| {
            memory::room("pairs", &mut block, row.len())?;
            block.extend(
                (0..row.len()).map(|k| std::array::from_fn(|a| row.d[a].get(k).map_or(0.0, |d| (d / unit) as f32))),
            );
            Ok(())
        })?;
        Ok(block)
    });
    blocks.into_iter().collect()
}
