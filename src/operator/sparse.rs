//! Sparse matrices in compressed rows, gathered row by row: what the coarse levels of a [`Multigrid`] are made of.
//!
//! [`Multigrid`]: super::multigrid::Multigrid

use super::matrix::row_sum;
use crate::error::Result;
use crate::memory;
use crate::pool::{BLOCK, Pool};

/// Rows in blocks of [`BLOCK`], as they were made.
pub struct Sparse {
    rows: usize,
    columns: usize,
    blocks: Vec<Rows>,
}

/// Row k from `start[k]` to `start[k + 1]`.
struct Rows {
    start: Vec<u32>,
    col: Vec<u32>,
    coef: Vec<f64>,
}

/// The rows of a block as they are made: terms of the same column are added up, in the order in which they come.
///
/// Terms are counted on from block to block, so that a number tells whether it belongs to the present row.
#[derive(Default)]
pub struct Gather {
    /// The number of the term in which a column was met last; 0 where it never was.
    place: Vec<u32>,
    /// Numbers of the first terms of this block and of this row.
    base: u32,
    begin: u32,
    start: Vec<u32>,
    col: Vec<u32>,
    coef: Vec<f64>,
    full: bool,
}

impl Gather {
    fn begin(&mut self, columns: usize) -> Result<()> {
        let next = self.base as usize + self.col.len();
        if self.place.len() != columns {
            self.place = memory::filled("places of columns", columns, 0)?;
        }
        // No block has more terms than half of all numbers; when those run out, all columns are forgotten.
        self.base = next.max(1) as u32;
        if next > u32::MAX as usize / 2 {
            self.place.fill(0);
            self.base = 1;
        }
        (self.begin, self.full) = (self.base, false);
        self.start.clear();
        self.col.clear();
        self.coef.clear();
        memory::room("rows", &mut self.start, BLOCK + 1)?;
        self.start.push(0);
        Ok(())
    }

    #[inline(always)]
    pub fn add(&mut self, column: u32, value: f64) {
        let number = self.place[column as usize];
        if number >= self.begin {
            self.coef[(number - self.base) as usize] += value;
        } else {
            self.push(column, value);
        }
    }

    #[inline]
    fn push(&mut self, column: u32, value: f64) {
        let at = self.col.len();
        let room = memory::room("", &mut self.col, 1).and(memory::room("", &mut self.coef, 1));
        if room.is_err() || at >= u32::MAX as usize / 2 {
            return self.full = true;
        }
        self.place[column as usize] = self.base + at as u32;
        self.col.push(column);
        self.coef.push(value);
    }

    fn end_row(&mut self) {
        self.begin = self.base + self.col.len() as u32;
        self.start.push(self.col.len() as u32);
    }

    fn rows(&self) -> Result<Rows> {
        if self.full {
            return Err(memory::no_memory::<(u32, f64)>("a coarse level", self.col.len()));
        }
        let start = memory::copied("a coarse level", &self.start)?;
        let (col, coef) = (memory::copied("a coarse level", &self.col)?, memory::copied("a coarse level", &self.coef)?);
        Ok(Rows { start, col, coef })
    }
}

impl Sparse {
    /// The matrix whose row i is what `row` adds for it.
    ///
    /// # Errors
    /// `NoMemory`; `Cancelled`.
    pub fn gather(
        pool: &Pool,
        rows: usize,
        columns: usize,
        row: impl Fn(usize, &mut Gather) + Sync + Send,
    ) -> Result<Sparse> {
        let blocks = pool.map_init(rows.div_ceil(BLOCK), Gather::default, |gather, b| {
            pool.go_on()?;
            gather.begin(columns)?;
            for i in b * BLOCK..((b + 1) * BLOCK).min(rows) {
                row(i, gather);
                gather.end_row();
            }
            gather.rows()
        });
        Ok(Sparse { rows, columns, blocks: blocks.into_iter().collect::<Result<_>>()? })
    }

    pub fn rows(&self) -> usize {
        self.rows
    }

    pub fn columns(&self) -> usize {
        self.columns
    }

    pub fn entries(&self) -> usize {
        self.blocks.iter().map(|b| b.col.len()).sum()
    }

    pub fn bytes(&self) -> u64 {
        self.blocks.iter().map(|b| memory::bytes(&b.start) + memory::bytes(&b.col) + memory::bytes(&b.coef)).sum()
    }

    pub fn is_empty(&self, i: usize) -> bool {
        self.slices(i).0.is_empty()
    }

    /// Columns and coefficients of a row.
    #[inline]
    fn slices(&self, i: usize) -> (&[u32], &[f64]) {
        let (block, k) = (&self.blocks[i / BLOCK], i % BLOCK);
        let range = block.start[k] as usize..block.start[k + 1] as usize;
        (&block.col[range.clone()], &block.coef[range])
    }

    #[inline]
    pub fn row(&self, i: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        let (col, coef) = self.slices(i);
        col.iter().copied().zip(coef.iter().copied())
    }

    /// Σ_j a_ij (x_j − own).
    #[inline]
    pub fn differences(&self, i: usize, x: &[f64], own: f64) -> f64 {
        assert!(x.len() == self.columns, "one value for each column");
        let (col, coef) = self.slices(i);
        row_sum(col, coef, x, own, |_, a| a)
    }

    /// Σ_j a_ij x_j.
    #[inline]
    pub fn times(&self, i: usize, x: &[f64]) -> f64 {
        self.differences(i, x, 0.0)
    }

    pub fn get(&self, i: usize, j: usize) -> f64 {
        self.row(i).find(|(column, _)| *column as usize == j).map_or(0.0, |(_, a)| a)
    }

    /// # Errors
    /// `NoMemory`.
    pub fn transposed(&self) -> Result<Sparse> {
        let blocks = self.columns.div_ceil(BLOCK);
        let mut made: Vec<Rows> = memory::reserved("a coarse level", blocks)?;
        for b in 0..blocks {
            let rows = BLOCK.min(self.columns - b * BLOCK);
            made.push(Rows { start: memory::filled("rows", rows + 2, 0)?, col: Vec::new(), coef: Vec::new() });
        }
        let of = |j: u32| (j as usize / BLOCK, j as usize % BLOCK);
        let all = || self.blocks.iter().flat_map(|b| &b.col);
        all().for_each(|&j| made[of(j).0].start[of(j).1 + 2] += 1);
        for rows in &mut made {
            (2..rows.start.len()).for_each(|k| rows.start[k] += rows.start[k - 1]);
            let size = rows.start.last().map_or(0, |&n| n as usize);
            (rows.col, rows.coef) =
                (memory::filled("a coarse level", size, 0)?, memory::filled("a coarse level", size, 0.0)?);
        }
        for i in 0..self.rows {
            for (j, a) in self.row(i) {
                let (rows, k) = (&mut made[of(j).0], of(j).1);
                let at = rows.start[k + 1] as usize;
                (rows.col[at], rows.coef[at]) = (i as u32, a);
                rows.start[k + 1] += 1;
            }
        }
        made.iter_mut().for_each(|rows| rows.start.truncate(rows.start.len() - 1));
        Ok(Sparse { rows: self.columns, columns: self.rows, blocks: made })
    }

    /// self · other (Gustavson 1978).
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn product(&self, pool: &Pool, other: &Sparse) -> Result<Sparse> {
        Sparse::gather(pool, self.rows, other.columns, |i, gather| {
            for (k, a) in self.row(i) {
                other.row(k as usize).for_each(|(j, b)| gather.add(j, a * b));
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The periodic second difference on n points, each coefficient in two parts.
    fn chain(pool: &Pool, n: usize) -> Sparse {
        let row = |i: usize, gather: &mut Gather| {
            for j in [i + 1, i + n - 1] {
                gather.add((j % n) as u32, -1.0);
                gather.add(i as u32, 1.0);
            }
        };
        Sparse::gather(pool, n, n, row).unwrap()
    }

    #[test]
    fn products_are_those_of_the_definition_for_any_number_of_threads() {
        let n = 2500;
        let (one, two) = (Pool::new(1).unwrap(), Pool::new(2).unwrap());
        let (a, b) = (chain(&one, n), chain(&two, n));
        assert_eq!((a.rows(), a.columns(), a.entries(), a.get(7, 7)), (n, n, 3 * n, 2.0));
        let square = a.product(&two, &b).unwrap();
        let x: Vec<f64> = (0..n).map(|i| ((i * 37) % 11) as f64).collect();
        let (mut y, mut z, mut direct) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        (0..n).for_each(|i| y[i] = a.times(i, &x));
        (0..n).for_each(|i| z[i] = b.times(i, &y));
        (0..n).for_each(|i| direct[i] = square.times(i, &x));
        assert_eq!(z, direct);
        assert_eq!(square.get(0, 0), 6.0);
    }

    #[test]
    fn transposed_twice_is_the_same() {
        let pool = Pool::new(1).unwrap();
        let a =
            Sparse::gather(&pool, 5, 3, |i, g| (0..i.min(3)).for_each(|j| g.add(j as u32, (i + j) as f64))).unwrap();
        let b = a.transposed().unwrap();
        assert_eq!((b.rows(), b.columns()), (3, 5));
        assert_eq!(b.row(1).collect::<Vec<_>>(), [(2, 3.0), (3, 4.0), (4, 5.0)]);
        let c = b.transposed().unwrap();
        assert!((0..5).all(|i| a.row(i).eq(c.row(i))));
    }
}
