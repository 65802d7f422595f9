//! Monomials x^i y^j z^k of the neighbours of a particle: their sums, and sums over them. Four neighbours are worked on side
//! by side.
//!
//! Monomials of a degree and below come in lines of one i and j: k runs fastest, then j, then i. A scene of fewer dimensions
//! has z, or y and z.

use super::ldl::{LANES, Lanes};
use crate::error::Result;
use crate::memory;
use crate::space::Row;

/// Powers of a coordinate: up to 12, which the products of two monomials of degree 6 need.
const POWERS: usize = 13;

/// Calls a function of a constant, the number of sums that it keeps in registers, for a number known at run time.
macro_rules! by_count {
    ($count:expr, [$($n:literal)*] or $last:literal, $f:ident $arguments:tt) => {
        match $count {
            $($n => $f::<$n> $arguments,)*
            _ => $f::<$last> $arguments,
        }
    };
}

/// i, j and the number of k of each line of monomials up to a degree.
fn lines(dim: usize, degree: usize) -> impl Iterator<Item = (usize, usize, usize)> {
    let highest = move |wanted: bool, rest: usize| if wanted { rest } else { 0 };
    (0..=highest(dim > 2, degree)).flat_map(move |i| {
        let rest = degree - i;
        (0..=highest(dim > 1, rest)).map(move |j| (i, j, rest - j + 1))
    })
}

/// i, j and k of all monomials up to a degree.
pub fn monomials(dim: usize, degree: usize) -> impl Iterator<Item = [usize; 3]> {
    lines(dim, degree).flat_map(|(i, j, count)| (0..count).map(move |k| [i, j, k]))
}

/// Powers of the coordinates of a particle's neighbours and their weights, kept from row to row.
#[derive(Default)]
pub struct Powers {
    dim: usize,
    degree: usize,
    /// Neighbours in fours; those that fill up the last four have the weight 0.
    fours: usize,
    /// w x^i, y^j and z^k, each of all neighbours.
    values: Vec<Lanes>,
    sums: Vec<Lanes>,
}

impl Powers {
    /// Takes the coordinates times `scale` and the weights of a row's neighbours, and makes powers up to a degree, 12 at most.
    ///
    /// # Errors
    /// `NoMemory`.
    #[inline(always)]
    pub fn raise(&mut self, dim: usize, degree: usize, row: &Row, scale: f64, w: &[f64]) -> Result<()> {
        let fours = row.len().div_ceil(LANES);
        (self.dim, self.degree, self.fours) = (dim, degree, fours);
        let size = (degree + 1) * fours;
        memory::extended("powers", &mut self.values, 3 * size, Lanes::default())?;
        let unit = 1.0 / largest(w);
        for axis in 0..3 {
            let values = &mut self.values[axis * size..][..size];
            for (at, first) in values[..fours].iter_mut().enumerate() {
                *first = if axis == 0 { four(w, at, unit) } else { [1.0; LANES] };
            }
            if let Some(at) = (axis + dim).checked_sub(3) {
                climb(values, fours, row.d[at], scale);
            }
        }
        Ok(())
    }

    /// Fills the beginning of `out` with Σ w x^i y^j z^k for every monomial up to the degree, w in units of the largest.
    ///
    /// # Errors
    /// `NoMemory`.
    #[inline(always)]
    pub fn moments(&mut self, out: &mut [f64]) -> Result<()> {
        memory::extended("moments", &mut self.sums, out.len(), Lanes::default())?;
        let (mut sums, z) = (std::mem::take(&mut self.sums), self.z());
        let (mut lines, mut at) = (lines(self.dim, self.degree), 0);
        while let Some((i, j, count)) = lines.next() {
            let (x, y, out) = (self.power(0, i), self.power(1, j), &mut sums[at..]);
            if self.dim > 1 && (2..=6).contains(&count) {
                lines.next();
                by_count!(count, [2 3 4 5] or 6, sum_lines(x, [y, self.power(1, j + 1)], &z, out));
                at += 2 * count - 1;
            } else {
                by_count!(count, [1 2 3 4 5 6 7 8 9 10 11 12] or 13, sum_line(x, y, &z, out));
                at += count;
            }
        }
        // Apart from the sums, or they would be made by shuffles between registers.
        out.iter_mut().zip(&sums[..at]).for_each(|(out, s)| *out = (s[0] + s[1]) + (s[2] + s[3]));
        self.sums = sums;
        Ok(())
    }

    /// Adds w Σ c x^i y^j z^k over the monomials up to a degree to each neighbour, w in units of the largest.
    #[inline(always)]
    pub fn combine(&self, degree: usize, c: &[f64], out: &mut [Lanes]) {
        let z = self.z();
        let mut at = 0;
        for (i, j, count) in lines(self.dim, degree) {
            let (x, y, c) = (self.power(0, i), self.power(1, j), &c[at..]);
            by_count!(count, [1 2 3 4 5 6] or 7, add_line(x, y, &z, c, out));
            at += count;
        }
    }

    #[inline(always)]
    fn power(&self, axis: usize, power: usize) -> &[Lanes] {
        &self.values[(axis * (self.degree + 1) + power) * self.fours..][..self.fours]
    }

    #[inline(always)]
    fn z(&self) -> [&[Lanes]; POWERS] {
        std::array::from_fn(|k| if k <= self.degree { self.power(2, k) } else { &[] })
    }
}

/// Makes the columns of `values` after the first, each the one before times a coordinate.
#[inline(always)]
fn climb(values: &mut [Lanes], fours: usize, x: &[f64], scale: f64) {
    for at in 0..fours {
        let x = four(x, at, scale);
        let mut power = values[at];
        let mut place = at + fours;
        while let Some(next) = values.get_mut(place) {
            power = times(power, x);
            *next = power;
            place += fours;
        }
    }
}

/// Σ w x^i y^j z^k for k below L.
#[inline(always)]
fn sum_line<const L: usize>(x: &[Lanes], y: &[Lanes], z: &[&[Lanes]; POWERS], out: &mut [Lanes]) {
    let y = &y[..x.len()];
    let z: [&[Lanes]; L] = std::array::from_fn(|k| &z[k][..x.len()]);
    let mut sums = [Lanes::default(); L];
    for at in 0..x.len() {
        let xy = times(x[at], y[at]);
        for (sum, z) in sums.iter_mut().zip(z) {
            add(sum, times(xy, z[at]));
        }
    }
    out[..L].copy_from_slice(&sums);
}

/// The sums of two lines, of L and L − 1: each z^k is loaded once for both.
#[inline(always)]
fn sum_lines<const L: usize>(x: &[Lanes], y: [&[Lanes]; 2], z: &[&[Lanes]; POWERS], out: &mut [Lanes]) {
    let y = y.map(|y| &y[..x.len()]);
    let z: [&[Lanes]; L] = std::array::from_fn(|k| &z[k][..x.len()]);
    let mut sums = [[Lanes::default(); L]; 2];
    for at in 0..x.len() {
        let xy = [times(x[at], y[0][at]), times(x[at], y[1][at])];
        for k in 0..L {
            add(&mut sums[0][k], times(xy[0], z[k][at]));
            if k + 1 < L {
                add(&mut sums[1][k], times(xy[1], z[k][at]));
            }
        }
    }
    out[..L].copy_from_slice(&sums[0]);
    out[L..2 * L - 1].copy_from_slice(&sums[1][..L - 1]);
}

/// Adds w x^i y^j Σ c z^k, k below L.
#[inline(always)]
fn add_line<const L: usize>(x: &[Lanes], y: &[Lanes], z: &[&[Lanes]; POWERS], c: &[f64], out: &mut [Lanes]) {
    let (y, c, out) = (&y[..x.len()], &c[..L], &mut out[..x.len()]);
    let z: [&[Lanes]; L] = std::array::from_fn(|k| &z[k][..x.len()]);
    for at in 0..x.len() {
        let mut sum = Lanes::default();
        for (c, z) in c.iter().zip(z) {
            add(&mut sum, z[at].map(|z| c * z));
        }
        add(&mut out[at], times(times(x[at], y[at]), sum));
    }
}

/// Four values times a factor; zeros beyond the end.
#[inline(always)]
fn four(values: &[f64], at: usize, by: f64) -> Lanes {
    let rest = &values[LANES * at..];
    let value = |k: usize| rest.get(k).map_or(0.0, |value| value * by);
    rest.first_chunk().map_or_else(|| std::array::from_fn(value), |four: &Lanes| four.map(|value| value * by))
}

#[inline(always)]
fn largest(values: &[f64]) -> f64 {
    let (fours, rest) = values.as_chunks::<LANES>();
    let larger = |a: f64, b: f64| if b > a { b } else { a };
    let tops = fours.iter().fold(Lanes::default(), |tops, four| std::array::from_fn(|k| larger(tops[k], four[k])));
    tops.iter().chain(rest).copied().fold(0.0, larger)
}

#[inline(always)]
fn times(a: Lanes, b: Lanes) -> Lanes {
    std::array::from_fn(|k| a[k] * b[k])
}

/// Adds to each of four sums.
#[inline(always)]
pub fn add(sum: &mut Lanes, by: Lanes) {
    *sum = std::array::from_fn(|k| sum[k] + by[k]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_of_the_definition() {
        let values = |of: f64| (0..14).map(move |b| (of * f64::from(b) + 0.3).sin()).collect::<Vec<_>>();
        let (x, y, z) = (values(1.1), values(1.7), values(2.3));
        let w: Vec<f64> = values(0.7).iter().map(|v| 2.0 + v).collect();
        let mut powers = Powers::default();
        // Larger rows first: what they leave must not count.
        for (dim, n, degree) in [(3, 14, 12), (3, 13, 8), (3, 4, 4), (2, 11, 8), (2, 1, 4), (1, 6, 12), (3, 0, 4)] {
            let axes: [&[f64]; 3] = [&x[..n], &y[..n], &z[..n]];
            let d: [&[f64]; 3] = std::array::from_fn(|a| if a < dim { axes[a] } else { &[] });
            let top = w[..n].iter().copied().fold(0.0, f64::max);
            let row = Row { i: 0, j: &vec![0; n], r: &vec![0.0; n], d };
            powers.raise(dim, degree, &row, 0.5, &w[..n]).unwrap();
            let mut moments = vec![f64::NAN; monomials(dim, degree).count()];
            powers.moments(&mut moments).unwrap();
            let monomial = |e: [usize; 3], b: usize| {
                let power = |a: usize| (0.5 * d[a][b]).powi(e[a + 3 - dim] as i32);
                (0..dim).map(power).product::<f64>()
            };
            for (e, moment) in monomials(dim, degree).zip(&moments) {
                let exact: f64 = (0..n).map(|b| w[b] / top * monomial(e, b)).sum();
                // Rounding of n products of up to 14 factors that are below 1.
                assert!((moment - exact).abs() <= 1e-14 * n as f64, "dim {dim} n {n} {e:?}: {moment} {exact}");
            }
            // Of degree 0 up to half the degree: any factors.
            let low: Vec<_> = monomials(dim, degree / 2).collect();
            let c: Vec<f64> = (0..low.len()).map(|m| (m as f64).cos()).collect();
            let mut out = vec![Lanes::default(); n.div_ceil(LANES)];
            powers.combine(degree / 2, &c, &mut out);
            for (b, &value) in out.as_flattened().iter().enumerate() {
                let sum = |b: usize| low.iter().zip(&c).map(|(e, c)| c * monomial(*e, b)).sum::<f64>();
                let exact = if b < n { w[b] / top * sum(b) } else { 0.0 };
                assert!((value - exact).abs() <= 1e-14 * low.len() as f64, "dim {dim} n {n} {b}: {value} {exact}");
            }
        }
    }
}
