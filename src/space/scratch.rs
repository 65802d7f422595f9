//! Who is near enough: candidates collected from cells, and those within reach picked out, for one particle at a time.

use super::{Axes, Cloud};
use crate::error::Result;
use crate::memory;

/// The neighbours of particle `i`, itself excluded (its periodic images included), in a fixed order.
pub struct Row<'a> {
    pub i: usize,
    /// Internal indices of the neighbours.
    pub j: &'a [u32],
    /// Distances.
    pub r: &'a [f64],
    /// r_b − r_a by axis; axes beyond `dim` are empty.
    pub d: Axes<&'a [f64]>,
}

impl Row<'_> {
    pub fn len(&self) -> usize {
        self.j.len()
    }

    /// The unit vector towards neighbour k; zero where it is at the same place.
    pub fn direction(&self, k: usize) -> Axes<f64> {
        let r = self.r[k];
        let unit = |axis: &[f64]| if r > 0.0 && !axis.is_empty() { axis[k] / r } else { 0.0 };
        self.d.map(unit)
    }

    pub fn is_empty(&self) -> bool {
        self.j.is_empty()
    }
}

/// Buffers of one worker, reused from row to row.
#[derive(Default)]
pub struct Scratch {
    j: Vec<u32>,
    x: Axes<Vec<f64>>,
    shift: Axes<Vec<f64>>,
    cut2: Vec<f64>,
    r2: Vec<f64>,
    hits: Vec<u32>,
    row_j: Vec<u32>,
    row_r: Vec<f64>,
    row_d: Axes<Vec<f64>>,
}

impl Scratch {
    /// The row of particle i at `centre`: candidates with r² < max(own, cut2), `shifted` where some are images.
    ///
    /// # Errors
    /// `NoMemory`.
    pub fn near<const D: usize>(&mut self, i: usize, centre: [f64; D], own: f64, shifted: bool) -> Result<Row<'_>> {
        self.reserve_row(self.j.len(), D)?;
        let n = if shifted { self.pick::<D, true>(i, centre, own) } else { self.pick::<D, false>(i, centre, own) };
        let d = [0, 1, 2].map(|a| if a < D { &self.row_d[a][..n] } else { &[] });
        Ok(Row { i, j: &self.row_j[..n], r: &self.row_r[..n], d })
    }

    fn pick<const D: usize, const SHIFTED: bool>(&mut self, i: usize, centre: [f64; D], own: f64) -> usize {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: this processor has AVX2.
            return unsafe { self.select_avx2::<D, SHIFTED>(i, centre, own) };
        }
        self.select::<D, SHIFTED>(i, centre, own)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn select_avx2<const D: usize, const SHIFTED: bool>(&mut self, i: usize, centre: [f64; D], own: f64) -> usize {
        self.select::<D, SHIFTED>(i, centre, own)
    }

    /// Moves the candidates with r² < max(own, cut2) into the row. No closures here: they would be compiled once,
    /// without the caller's processor features.
    #[inline(always)]
    fn select<const D: usize, const SHIFTED: bool>(&mut self, i: usize, centre: [f64; D], own: f64) -> usize {
        let (n, same_h) = (self.j.len(), self.cut2.is_empty());
        let (r2, hits) = (&mut self.r2[..n], &mut self.hits[..n]);
        r2.fill(0.0);
        for (a, centre) in centre.iter().enumerate() {
            let x = &self.x[a][..n];
            if SHIFTED {
                for ((r2, x), shift) in r2.iter_mut().zip(x).zip(&self.shift[a][..n]) {
                    let d = (x - centre) + shift;
                    *r2 += d * d;
                }
            } else {
                for (r2, x) in r2.iter_mut().zip(x) {
                    let d = x - centre;
                    *r2 += d * d;
                }
            }
        }
        // Every candidate is written, and the end moves on only for a hit: no branch to mispredict.
        let mut found = 0;
        for (c, r2) in r2.iter().enumerate() {
            let cut2 = if same_h { own } else { own.max(self.cut2[c]) };
            // SAFETY: found <= c < n, the length of hits.
            unsafe { *hits.get_unchecked_mut(found) = c as u32 };
            found += usize::from(*r2 < cut2);
        }
        self.fill_row::<D, SHIFTED>(i, centre, found)
    }

    #[inline(always)]
    fn fill_row<const D: usize, const SHIFTED: bool>(&mut self, i: usize, centre: [f64; D], found: usize) -> usize {
        let mut len = 0;
        for k in 0..found {
            // The particle itself is a candidate too, but not its own neighbour; its images are.
            let c = self.hits[k] as usize;
            let mut here = self.j[c] as usize == i;
            for a in 0..D {
                here &= !SHIFTED || self.shift[a][c] == 0.0;
            }
            self.hits[len] = c as u32;
            len += usize::from(!here);
        }
        let hits = &self.hits[..len];
        for (j, &c) in self.row_j[..len].iter_mut().zip(hits) {
            *j = self.j[c as usize];
        }
        for (r, &c) in self.row_r[..len].iter_mut().zip(hits) {
            *r = self.r2[c as usize];
        }
        for r in &mut self.row_r[..len] {
            *r = r.sqrt();
        }
        for (a, centre) in centre.iter().enumerate() {
            let (x, shift) = (&self.x[a], &self.shift[a]);
            for (d, &c) in self.row_d[a][..len].iter_mut().zip(hits) {
                let apart = x[c as usize] - centre;
                *d = if SHIFTED { apart + shift[c as usize] } else { apart };
            }
        }
        len
    }

    /// Forgets all candidates.
    pub fn clear(&mut self) {
        self.j.clear();
        self.cut2.clear();
        self.x.iter_mut().chain(&mut self.shift).for_each(Vec::clear);
    }

    /// Makes every candidate so far an image that is not shifted.
    pub fn add_zero_shifts(&mut self) -> Result<()> {
        let n = self.j.len();
        for shift in &mut self.shift {
            shift.try_reserve(n).map_err(|_| memory::no_memory::<f64>("neighbour candidates", n))?;
            shift.resize(n, 0.0);
        }
        Ok(())
    }

    /// Adds the particles of a cell. `shift`: where some candidates are images; `lengths`: smoothing lengths and kernel
    /// radius, where they differ.
    pub fn add(
        &mut self,
        cloud: &Cloud,
        cell: &[u32],
        shift: Option<Axes<f64>>,
        lengths: Option<(&[f64], f64)>,
    ) -> Result<()> {
        let failed = |_| memory::no_memory::<f64>("neighbour candidates", cell.len());
        self.j.try_reserve(cell.len()).map_err(failed)?;
        self.j.extend_from_slice(cell);
        for (a, x) in self.x.iter_mut().enumerate().take(cloud.dim()) {
            x.try_reserve(cell.len()).map_err(failed)?;
            x.extend(cell.iter().map(|&j| cloud.x[a][j as usize]));
        }
        for (all, by) in self.shift.iter_mut().zip(shift.iter().flatten()) {
            all.try_reserve(cell.len()).map_err(failed)?;
            all.resize(all.len() + cell.len(), *by);
        }
        if let Some((h, radius)) = lengths {
            self.cut2.try_reserve(cell.len()).map_err(failed)?;
            self.cut2.extend(cell.iter().map(|&j| (radius * h[j as usize]).powi(2)));
        }
        Ok(())
    }

    fn reserve_row(&mut self, n: usize, dim: usize) -> Result<()> {
        fn grow<T: Clone + Default>(v: &mut Vec<T>, n: usize) -> Result<()> {
            if n > v.len() {
                v.try_reserve(n - v.len()).map_err(|_| memory::no_memory::<T>("a row of neighbours", n))?;
                v.resize(n, T::default());
            }
            Ok(())
        }
        grow(&mut self.r2, n)?;
        grow(&mut self.hits, n)?;
        grow(&mut self.row_j, n)?;
        grow(&mut self.row_r, n)?;
        self.row_d.iter_mut().take(dim).try_for_each(|d| grow(d, n))
    }
}
