//! Density by summation, and the smoothing length that belongs to it (Price 2012, section 2.2):
//!
//! ```text
//! rho_a = Σ_b m_b W_ab(h_a),    h_a = h_fac (m_a/rho_a)^(1/nu),    Omega_a = 1 + h_a/(nu rho_a) Σ_b m_b dW_ab(h_a)/dh
//! ```
//!
//! All three follow from one function, the weighted number of neighbours N(h) = Σ_b (m_b/m_a) sigma f(r_ab/h):
//! rho = m N / h^nu, the condition on h is N(h) = h_fac^nu, and Omega = h N'/(nu N). N grows with h, so the root is
//! unique and a bracketed Newton iteration always finds it.

use super::{Cloud, Row, Scratch, rows::Rows};
use crate::error::{Error, Result};
use crate::kernel::Kernel;
use crate::memory;
use crate::pool::{BLOCK, Pool};
use std::sync::Mutex;

/// Relative accuracy of h: far below what a density estimate means, above the rounding of N.
const ACCURACY: f64 = 1e-14;
const NEWTON: usize = 100;
/// How much a smoothing length that found too few neighbours is enlarged before the next search.
const GROWTH: f64 = 1.4;
/// And how much wider than the start the first search is.
const MARGIN: f64 = 1.1;
const SEARCHES: usize = 60;
/// Particles in the Morton cell that gives the first guess of the spacing.
const CROWD: usize = 8;

/// N(h) and N'(h) of one row.
#[derive(Default)]
struct Count {
    q: Vec<f64>,
    f: Vec<f64>,
}

impl Count {
    fn at(&mut self, kernel: &Kernel, mass: &[f64], row: &Row, h: f64) -> (f64, f64) {
        let Count { q, f } = self;
        q.clear();
        q.extend(row.r.iter().map(|r| r / h));
        f.resize(q.len(), 0.0);
        let own = mass[row.i];
        let share = |j: u32| mass[j as usize] / own;
        kernel.w(q, f);
        let n = row.j.iter().zip(&*f).fold(kernel.w_at(0.0), |n, (&j, f)| n + share(j) * f);
        kernel.slope_over_q(q, f);
        let by_h = row.j.iter().zip(&*f).zip(&*q).fold(0.0, |s, ((&j, f), q)| s - share(j) * f * (q * q));
        (n, by_h / h)
    }

    /// The root of N(h) = target up to `most`; none where N(most) is below the target.
    fn solve(&mut self, kernel: &Kernel, mass: &[f64], row: &Row, target: f64, most: f64) -> Option<f64> {
        let (n, _) = self.at(kernel, mass, row, most);
        if n < target {
            return None;
        }
        let (mut low, mut high) = (0.0, most);
        // Exact where the neighbours are a continuum.
        let mut h = most * (target / n).powf(1.0 / kernel.dim() as f64);
        for _ in 0..NEWTON {
            let (n, slope) = self.at(kernel, mass, row, h);
            if n > target {
                high = h
            } else {
                low = h
            }
            let newton = h - (n - target) / slope;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            let done = (next - h).abs() <= ACCURACY * h;
            h = next;
            if done {
                break;
            }
        }
        Some(h)
    }
}

/// Density of each particle with the given smoothing lengths.
pub fn sum(kernel: &Kernel, rows: &Rows, mass: &[f64], pool: &Pool) -> Result<Vec<f64>> {
    let mut rho = memory::filled("rho", mass.len(), 0.0)?;
    rows.map(pool, &mut rho, |count: &mut Count, row| {
        let h = rows.h[row.i];
        Ok(mass[row.i] * count.at(kernel, mass, &row, h).0 / h.powi(kernel.dim() as i32))
    })?;
    Ok(rho)
}

/// Omega of each particle, the factor that variable smoothing lengths bring into gradients.
pub fn omega(kernel: &Kernel, rows: &Rows, mass: &[f64], pool: &Pool) -> Result<Vec<f64>> {
    let mut omega = memory::filled("omega", mass.len(), 0.0)?;
    rows.map(pool, &mut omega, |count: &mut Count, row| {
        let h = rows.h[row.i];
        let (n, by_h) = count.at(kernel, mass, &row, h);
        Ok(h * by_h / (kernel.dim() as f64 * n))
    })?;
    Ok(omega)
}

/// The smoothing length of each particle that satisfies h = h_fac (m/rho)^(1/nu) together with the density sum, searched
/// for from `start` on.
///
/// # Errors
/// `BadElement` naming h of a particle for which no length has enough neighbours; `BoxTooSmall`; `NoMemory`.
pub fn smoothing_lengths(
    kernel: &Kernel,
    h_fac: f64,
    cloud: &Cloud,
    mass: &[f64],
    start: Vec<f64>,
    pool: &Pool,
) -> Result<Vec<f64>> {
    let target = h_fac.powi(kernel.dim() as i32);
    let mut tried = start;
    tried.iter_mut().for_each(|h| *h *= MARGIN);
    let mut h = memory::filled("h", cloud.len(), 0.0)?;
    for _ in 0..SEARCHES {
        let rows = Rows::new(cloud, &tried, kernel.radius(), pool)?;
        solve_open(kernel, target, &rows, mass, pool, &mut h)?;
        let mut open = 0;
        for (tried, &h) in tried.iter_mut().zip(&h) {
            open += usize::from(h == 0.0);
            *tried = if h == 0.0 { *tried * GROWTH } else { h };
        }
        if open == 0 {
            return Ok(h);
        }
        if open < cloud.len() || tried.iter().all(|t| *t < 1e3 * extent(cloud)) {
            continue;
        }
        break;
    }
    let lost = h.iter().position(|&h| h == 0.0).map_or(0, |i| cloud.host[i] as usize);
    let rule = format!("no smoothing length has enough neighbours for h_fac = {h_fac}; give h, or lower h_fac");
    Err(Error::bad_at("h", lost, "undetermined", &rule))
}

/// Finds h for every particle that has none yet and whose search was wide enough.
fn solve_open(kernel: &Kernel, target: f64, rows: &Rows, mass: &[f64], pool: &Pool, h: &mut [f64]) -> Result<()> {
    let failed = Mutex::new(None);
    pool.chunks(h, BLOCK, |start, part| {
        if part.iter().all(|&h| h > 0.0) {
            return;
        }
        let (mut count, range) = (Count::default(), start..start + part.len());
        let open: Vec<bool> = part.iter().map(|&h| h == 0.0).collect();
        let done = rows.visit_where(
            range,
            &mut Scratch::default(),
            |i| open[i - start],
            |row| {
                let found = count.solve(kernel, mass, &row, target, rows.h[row.i]);
                part[row.i - start] = found.unwrap_or(0.0);
            },
        );
        if let (Err(e), Ok(mut slot)) = (done, failed.lock()) {
            *slot = Some(e);
        }
    });
    failed.into_inner().ok().flatten().map_or(Ok(()), Err)
}

/// A first guess: h_fac times the spacing in the smallest Morton cell around a particle that holds a crowd.
pub fn guess(cloud: &Cloud, h_fac: f64) -> Result<Vec<f64>> {
    let dim = cloud.dim();
    let keys = &cloud.keys;
    let crowd = CROWD.min(cloud.len());
    let bits = super::morton::bits(dim);
    let spacing = |i: usize| {
        // The first level at which the cell around i holds a crowd; cells are runs of equal prefixes.
        let count = |level: u32| {
            let shift = level as usize * dim;
            let prefix = keys[i] >> shift;
            let first = keys[..i].partition_point(|k| k >> shift < prefix);
            let last = i + keys[i..].partition_point(|k| k >> shift <= prefix);
            last - first
        };
        let (mut low, mut high) = (0, bits);
        while low < high {
            let middle = (low + high) / 2;
            if count(middle) >= crowd { high = middle } else { low = middle + 1 }
        }
        cloud.grid.edge * 2f64.powi(low as i32) / (count(low) as f64).powf(1.0 / dim as f64)
    };
    let least = extent(cloud) * 1e-12;
    memory::collected("h", (0..cloud.len()).map(|i| (h_fac * spacing(i)).max(least).max(f64::MIN_POSITIVE)))
}

fn extent(cloud: &Cloud) -> f64 {
    let span = |axis: &Vec<f64>| {
        let range = axis.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), &v| (lo.min(v), hi.max(v)));
        range.1 - range.0
    };
    cloud.x.iter().take(cloud.dim()).map(span).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::array::Strided;
    use crate::space::Domain;

    fn lattice(n: usize, dim: usize, jitter: f64) -> Vec<f64> {
        let mut state = 3u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let coordinate = |p: usize, a: usize| ((p / n.pow(a as u32)) % n) as f64 + 0.5;
        (0..n.pow(dim as u32))
            .flat_map(|p| (0..dim).map(move |a| (p, a)))
            .map(|(p, a)| (coordinate(p, a) + jitter * next()) / n as f64)
            .collect()
    }

    #[test]
    fn h_and_rho_satisfy_their_definition() {
        let pool = Pool::new(2).unwrap();
        for (dim, n) in [(1, 50), (2, 20), (3, 10)] {
            for (name, jitter, periodic) in [("M4", 0.0, true), ("M6", 0.9, true), ("C2", 0.9, false)] {
                let kernel = Kernel::new(name, dim).unwrap();
                let x = lattice(n, dim, jitter);
                let domain = Domain::new(&[0.0; 3][..dim], &[1.0; 3][..dim], &[periodic; 3][..dim]).unwrap();
                let particles = n.pow(dim as u32);
                let cloud =
                    Cloud::sort(&domain, Strided::new("x", &x, particles, dim, dim).unwrap(), 0.0, &pool).unwrap();
                // Unequal masses: N(h) weighs neighbours by their mass.
                let mass: Vec<f64> = (0..particles).map(|i| 1.0 + 0.3 * ((i % 7) as f64)).collect();
                let h = smoothing_lengths(
                    &kernel,
                    kernel.h_fac(),
                    &cloud,
                    &mass,
                    guess(&cloud, kernel.h_fac()).unwrap(),
                    &pool,
                )
                .unwrap();
                let rows = Rows::new(&cloud, &h, kernel.radius(), &pool).unwrap();
                let rho = sum(&kernel, &rows, &mass, &pool).unwrap();
                for i in 0..particles {
                    let expected = kernel.h_fac() * (mass[i] / rho[i]).powf(1.0 / dim as f64);
                    // Two solves to 1e-14 and a sum of some hundred terms.
                    assert!((h[i] / expected - 1.0).abs() < 1e-12, "{name} {dim} {i}: {} {expected}", h[i]);
                }
            }
        }
    }

    #[test]
    fn omega_is_the_derivative_of_the_density() {
        let (pool, dim) = (Pool::new(1).unwrap(), 2);
        let kernel = Kernel::new("M6", dim).unwrap();
        let x = lattice(12, dim, 0.8);
        let domain = Domain::new(&[0.0; 2], &[1.0; 2], &[true; 2]).unwrap();
        let cloud = Cloud::sort(&domain, Strided::new("x", &x, 144, 2, 2).unwrap(), 0.0, &pool).unwrap();
        let mass = vec![1.0; 144];
        let h = vec![0.1; 144];
        let density = |h: &[f64]| {
            let rows = Rows::new(&cloud, h, kernel.radius(), &pool).unwrap();
            (sum(&kernel, &rows, &mass, &pool).unwrap(), omega(&kernel, &rows, &mass, &pool).unwrap())
        };
        let (rho, omega) = density(&h);
        let e = 1e-5;
        let (more, less) = (density(&vec![0.1 + e; 144]).0, density(&vec![0.1 - e; 144]).0);
        for i in 0..144 {
            let by_h = (more[i] - less[i]) / (2.0 * e);
            let expected = 1.0 + 0.1 / (dim as f64 * rho[i]) * by_h;
            // Central difference: e² times the third derivative, relative to 1/h³.
            assert!((omega[i] - expected).abs() < 1e-6, "{} {expected}", omega[i]);
        }
    }

    #[test]
    fn clusters_and_outliers_are_solved_or_refused() {
        let pool = Pool::new(1).unwrap();
        let kernel = Kernel::new("M4", 1).unwrap();
        let solve = |x: &[f64]| {
            let cloud = Cloud::sort(&Domain::open(1), Strided::packed(x), 0.0, &pool).unwrap();
            smoothing_lengths(&kernel, 1.2, &cloud, &vec![1.0; x.len()], guess(&cloud, 1.2).unwrap(), &pool)
        };
        let mut x: Vec<f64> = (0..100).map(|i| f64::from(i) * 1e-6).collect();
        x.push(1e3);
        let h = solve(&x).unwrap();
        assert!(h.iter().copied().fold(0.0, f64::max) > 100.0 && h.iter().copied().fold(1.0, f64::min) < 2e-6);
        assert!(solve(&[0.0]).unwrap_err().to_string().contains("h[0]"));
        assert!(solve(&[]).unwrap().is_empty());
    }
}
