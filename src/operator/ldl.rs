//! The factors L D Lᵀ of a small symmetric positive matrix, for fits around every particle: no memory is asked for, no
//! square roots are taken, and four lines are worked on side by side. For 34 unknowns it takes a third of the time of
//! nalgebra's Cholesky, which goes column by column.

use crate::error::Result;
use crate::memory;

/// Lines side by side: as many as an AVX2 register holds, on any machine, for the same bits.
pub const LANES: usize = 4;
pub type Lanes = [f64; LANES];

/// A square piece of a matrix: four columns, each of four lines.
pub type Tile = [Lanes; LANES];

/// A lower triangle in tiles, the matrix before [`Ldl::factor`] and L D after it.
#[derive(Default)]
pub struct Ldl {
    tiles: Vec<Tile>,
    /// 1 / D.
    inverse: Vec<Lanes>,
    /// L of the lines that the factorisation is at.
    unit: Vec<Tile>,
}

/// Where the tiles of a line of tiles begin.
fn line(at: usize) -> usize {
    at * (at + 1) / 2
}

impl Ldl {
    /// The tiles of a matrix of `blocks` times four lines, to be filled line by line up to the diagonal. What lies above the
    /// diagonal is not read; lines beyond the matrix have a diagonal of 1 and nothing else.
    pub fn reset(&mut self, blocks: usize) -> Result<&mut [Tile]> {
        memory::extended("a small matrix", &mut self.tiles, line(blocks), Tile::default())?;
        memory::extended("a small matrix", &mut self.unit, blocks, Tile::default())?;
        self.inverse.clear();
        memory::extended("a small matrix", &mut self.inverse, blocks, Lanes::default())?;
        Ok(&mut self.tiles[..line(blocks)])
    }

    /// Factors the matrix in place; answers false where a pivot is not above `flat` times the element that it came from.
    #[inline(always)]
    pub fn factor(&mut self, flat: f64) -> bool {
        for at in 0..self.inverse.len() {
            let (above, mut below) = self.tiles.split_at_mut(line(at + 1));
            let (left, [.., last]) = above[line(at)..].split_at_mut(at) else { return false };
            let unit = &mut self.unit[..at];
            for ((unit, left), inverse) in unit.iter_mut().zip(&*left).zip(&self.inverse) {
                *unit = std::array::from_fn(|k| times(left[k], inverse[k]));
            }
            let Some(pivots) = Pivots::new(minus(*last, left, unit), flat, last) else { return false };
            (*last, self.inverse[at]) = (pivots.tile, pivots.inverse);
            for other in at + 1..self.inverse.len() {
                let (line, rest) = below.split_at_mut(other + 1);
                let (left, right) = line.split_at_mut(at);
                right[0] = pivots.eliminate(minus(right[0], left, unit));
                below = rest;
            }
        }
        true
    }

    /// Solves for a right-hand side in place. Zeros at its beginning cost nothing.
    #[inline(always)]
    pub fn solve(&self, x: &mut [Lanes]) {
        let first = x.iter().position(|x| *x != Lanes::default()).unwrap_or(x.len());
        for at in first..x.len() {
            let (left, last) = self.tiles[line(at)..][first..=at].split_at(at - first);
            let (before, now) = x[first..].split_at_mut(at - first);
            let mut sum = now[0];
            for (tile, x) in left.iter().zip(&*before) {
                sum = (0..LANES).fold(sum, |sum, k| less(sum, tile[k], x[k]));
            }
            for k in 0..LANES {
                sum[k] *= self.inverse[at][k];
                (k + 1..LANES).for_each(|l| sum[l] -= last[0][k][l] * sum[k]);
            }
            now[0] = sum;
        }
        for at in (0..x.len()).rev() {
            let mut sums = Tile::default();
            for (other, x) in x.iter().enumerate().skip(at + 1) {
                let tile = &self.tiles[line(other) + at];
                for k in 0..LANES {
                    (0..LANES).for_each(|l| sums[k][l] += tile[k][l] * x[l]);
                }
            }
            let last = &self.tiles[line(at) + at];
            let mut totals = sums.map(|s| (s[0] + s[1]) + (s[2] + s[3]));
            for k in (0..LANES).rev() {
                let now = x[at][k] - self.inverse[at][k] * totals[k];
                (0..k).for_each(|p| totals[p] += last[p][k] * now);
                x[at][k] = now;
            }
        }
    }
}

/// The factors of a tile on the diagonal.
struct Pivots {
    tile: Tile,
    inverse: Lanes,
    unit: Tile,
}

impl Pivots {
    #[inline(always)]
    fn new(tile: Tile, flat: f64, before: &Tile) -> Option<Pivots> {
        let (mut tile, mut inverse, mut unit) = (tile, Lanes::default(), Tile::default());
        for k in 0..LANES {
            tile[k] = (0..k).fold(tile[k], |column, p| less(column, tile[p], unit[p][k]));
            inverse[k] = 1.0 / tile[k][k];
            unit[k] = times(tile[k], inverse[k]);
        }
        // Written so that it fails for NaN.
        (0..LANES).all(|k| tile[k][k] > flat * before[k][k]).then_some(Pivots { tile, inverse, unit })
    }

    /// L D of a tile below.
    #[inline(always)]
    fn eliminate(&self, tile: Tile) -> Tile {
        let mut out = tile;
        for k in 1..LANES {
            out[k] = (0..k).fold(out[k], |column, p| less(column, out[p], self.unit[p][k]));
        }
        out
    }
}

/// tile − Σ left unitᵀ.
#[inline(always)]
fn minus(tile: Tile, left: &[Tile], unit: &[Tile]) -> Tile {
    let mut out = tile;
    for (left, unit) in left.iter().zip(unit) {
        for k in 0..LANES {
            out = std::array::from_fn(|c| less(out[c], left[k], unit[k][c]));
        }
    }
    out
}

#[inline(always)]
fn times(a: Lanes, by: f64) -> Lanes {
    a.map(|a| a * by)
}

/// a − b by.
#[inline(always)]
fn less(a: Lanes, b: Lanes, by: f64) -> Lanes {
    std::array::from_fn(|l| a[l] - b[l] * by)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Cholesky, DMatrix, DVector};

    /// A positive matrix of n lines, eigenvalues 1 and up.
    fn positive(n: usize) -> DMatrix<f64> {
        let a = DMatrix::from_fn(n, n, |i, j| ((3 * i * i + 5 * j + i * j) % 17) as f64 / 17.0 - 0.5);
        &a * a.transpose() + DMatrix::identity(n, n)
    }

    fn fill(ldl: &mut Ldl, matrix: &DMatrix<f64>) {
        let blocks = matrix.nrows().div_ceil(LANES);
        let mut tiles = ldl.reset(blocks).unwrap().iter_mut();
        for r in 0..blocks {
            for c in 0..=r {
                let value = |k: usize, l: usize| match matrix.get((4 * r + l, 4 * c + k)) {
                    Some(&value) => value,
                    None => f64::from(u8::from(4 * r + l == 4 * c + k)),
                };
                *tiles.next().unwrap() = std::array::from_fn(|k| std::array::from_fn(|l| value(k, l)));
            }
        }
    }

    #[test]
    fn solves_as_nalgebra_does() {
        let mut ldl = Ldl::default();
        for n in [34, 1, 2, 3, 4, 5, 14, 83] {
            let matrix = positive(n);
            fill(&mut ldl, &matrix);
            assert!(ldl.factor(1e-12), "{n}");
            for zeros in [0, n / 2] {
                let b = DVector::from_fn(n, |i, _| if i < zeros { 0.0 } else { i as f64 - 0.3 * n as f64 });
                let mut x = vec![Lanes::default(); n.div_ceil(LANES)];
                x.as_flattened_mut()[..n].copy_from_slice(b.as_slice());
                ldl.solve(&mut x);
                let exact = Cholesky::new(matrix.clone()).unwrap().solve(&b);
                let wrong = (0..n).map(|i| (x[i / 4][i % 4] - exact[i]).abs()).fold(0.0, f64::max);
                // The condition number is below 1e3; the rest is rounding of n sums.
                assert!(wrong < 1e-11 * exact.amax(), "{n}: {wrong:e}");
                assert!(x.as_flattened()[n..].iter().all(|&x| x == 0.0));
            }
        }
    }

    #[test]
    fn a_flat_direction_or_nan_is_refused() {
        let mut ldl = Ldl::default();
        for n in [1, 6, 34] {
            for wrong in [0, n / 2, n - 1] {
                for worth in [0.0, -1.0, f64::NAN] {
                    let mut matrix = positive(n);
                    // A line that repeats another one is as flat as a line of zeros.
                    matrix.row_mut(wrong).fill(0.0);
                    matrix.column_mut(wrong).fill(0.0);
                    matrix[(wrong, wrong)] = worth;
                    fill(&mut ldl, &matrix);
                    assert!(!ldl.factor(1e-6), "{n} {wrong} {worth}");
                }
            }
        }
        let mut twin = positive(9);
        let line = twin.row(2).clone_owned();
        twin.set_row(7, &line);
        let column = twin.column(2).clone_owned();
        twin.set_column(7, &column);
        fill(&mut ldl, &twin);
        assert!(!ldl.factor(1e-6));
    }
}
