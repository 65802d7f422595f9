//! Weights that are conservative and consistent at once: of all weights that are symmetric and not negative, those nearest
//! to Brookshaw's whose first moments vanish and whose second moments are a Laplacian's, at every particle.
//!
//! With g_ab = V_a V_b w_ab, d = r_b − r_a and ψ_ab = (d, d dᵀ/2), the conditions at a are Σ_b g_ab ψ_ab = V_a (0, I): rates
//! are then exact for quadratic T. Least Σ (g − g⁰)²/g⁰ over the pairs means g = g⁰ max(0, 1 + ψ_ab·λ_a + ψ_ba·λ_b). The
//! multipliers λ of all particles together are found by Newton's method, on the pairs that are not at 0, each of its
//! equations by conjugate gradients preconditioned with every particle's own block. What is left of a defect when it
//! stops costs accuracy and nothing else: the exchanges of a pair are equal and opposite and no weight is negative
//! whatever λ is.
//!
//! Where neighbours are on one side, at a free surface, the conditions cannot hold, and insulation is natural: there λ
//! stays 0.

use super::assembly::Assembly;
use super::tensor::{self, Sym};
use super::{Matrix, apart};
use crate::error::Result;
use crate::memory;
use crate::pool::Pool;
use crate::sum;
use nalgebra::{Cholesky, Const, SMatrix, SVector};

const NEWTON: usize = 3;
/// Conjugate gradients for each of Newton's steps.
const ITERATIONS: usize = 8;
/// Root mean square of the moments' defects at which it stops.
const TOLERANCE: f64 = 0.01;
/// |Σ g d² d|² / (Σ g d² Σ g d⁴) above which a particle counts as being at a surface. It is 0.3 to 0.7 there, and where 40 %
/// jitter is all the disorder at most 0.017 in 2-D and 0.02 in 3-D (M4, 40 and 76 neighbours).
const ONE_SIDED: f64 = 0.02;
/// Below this ratio of a pivot to its diagonal neighbours do not tell the moments apart.
const FLAT: f64 = 1e-6;

/// Projects the normalised weights of a positive operator.
///
/// # Errors
/// `NoMemory`; `Cancelled`.
pub fn project(assembly: &Assembly, matrix: &mut Matrix, pool: &Pool) -> Result<()> {
    match assembly.kernel.dim() {
        1 => project_in::<1, 2>(assembly, matrix, pool),
        2 => project_in::<2, 5>(assembly, matrix, pool),
        _ => project_in::<3, 9>(assembly, matrix, pool),
    }
}

/// Bytes that [`project`] takes while it lasts, for each pair and for each particle: offsets and marks; the vectors of the
/// iterations and the blocks of the preconditioner.
pub fn bytes(dim: usize) -> [f64; 2] {
    let conditions = (dim + dim * (dim + 1) / 2) as f64;
    [4.0 * dim as f64 + 1.0, 8.0 * conditions * (6.0 + conditions)]
}

fn project_in<const D: usize, const C: usize>(assembly: &Assembly, matrix: &mut Matrix, pool: &Pool) -> Result<()> {
    let n = matrix.len();
    let unit = sum::max(pool, n, |i| assembly.rows.h[i]);
    // Single precision holds the conditions to 1e-7.
    let apart = apart::of(assembly.rows, matrix.length(), unit, pool)?;
    let shape = assembly.shape.filter(|_| assembly.operator.takes_tensors);
    let problem = Problem::<D, C> { pool, prior: matrix, apart: &apart, volume: assembly.volume, unit, shape };
    let lambda = problem.newton()?;
    let (apart, lambda) = (&apart[..], &lambda[..]);
    let length = matrix.length();
    matrix.update(pool, move |i, j, at, g| g * factor(&psi(&apart[i / length][at]), &lambda[i], &lambda[j]));
    Ok(())
}

/// A particle's multipliers, or moments: D first ones, then the second ones by rows of the upper triangle.
type Vector<const C: usize> = SVector<f64, C>;
type Block<const C: usize> = SMatrix<f64, C, C>;

/// ψ_ab
#[inline(always)]
fn psi<const D: usize, const C: usize>(d: &[f32; D]) -> Psi<D, C> {
    let (mut psi, mut at) = (Vector::zeros(), D);
    for k in 0..D {
        psi[k] = f64::from(d[k]);
        for l in k..D {
            psi[at] = 0.5 * f64::from(d[k]) * f64::from(d[l]);
            at += 1;
        }
    }
    Psi(psi)
}

struct Psi<const D: usize, const C: usize>(Vector<C>);

impl<const D: usize, const C: usize> Psi<D, C> {
    /// ψ_ab·a + ψ_ba·b: the same bits from both sides.
    #[inline(always)]
    fn of(&self, a: &Vector<C>, b: &Vector<C>) -> f64 {
        let mut sum = 0.0;
        for k in 0..C {
            sum += self.0[k] * if k < D { a[k] - b[k] } else { a[k] + b[k] };
        }
        sum
    }
}

/// What becomes of a pair's coefficient.
#[inline(always)]
fn factor<const D: usize, const C: usize>(psi: &Psi<D, C>, a: &Vector<C>, b: &Vector<C>) -> f64 {
    (1.0 + psi.of(a, b)).max(0.0)
}

struct Problem<'a, const D: usize, const C: usize> {
    pool: &'a Pool,
    prior: &'a Matrix,
    /// d of every pair, stretch by stretch.
    apart: &'a [Vec<[f32; D]>],
    volume: &'a [f64],
    /// Of length.
    unit: f64,
    /// The second moments wanted, where they are not I.
    shape: Option<&'a [Sym]>,
}

/// Particles a and b, the place of the pair in a's stretch, and g_ab.
struct Pair {
    a: usize,
    b: usize,
    at: usize,
    g: f64,
}

impl<const D: usize, const C: usize> Problem<'_, D, C> {
    /// The multipliers with the smallest defect that was found.
    fn newton(&self) -> Result<Vec<Vector<C>>> {
        let (mut lambda, mut next, mut lacks) = (self.zeros()?, self.zeros()?, self.zeros()?);
        let waived = self.one_sided()?;
        // Of all pairs: as good a preconditioner when some are no longer in use.
        let inverse = self.inverse_blocks(&waived)?;
        let mut defect = self.defect(&lambda, &waived, &mut lacks)?;
        for _ in 0..NEWTON {
            if defect <= TOLERANCE {
                break;
            }
            let used = self.used(&lambda)?;
            self.solve(&used, &inverse, &mut lacks, &mut next)?;
            self.each(&mut next, |i, step| *step += lambda[i])?;
            let reached = self.defect(&next, &waived, &mut lacks)?;
            if reached >= defect || reached.is_nan() {
                break;
            }
            std::mem::swap(&mut lambda, &mut next);
            defect = reached;
        }
        Ok(lambda)
    }

    fn zeros(&self) -> Result<Vec<Vector<C>>> {
        memory::filled("multipliers", self.prior.len(), Vector::zeros())
    }

    fn each<T: Send>(&self, items: &mut [T], f: impl Fn(usize, &mut T) + Sync + Send) -> Result<()> {
        self.pool.make(items, |start, part| part.iter_mut().enumerate().for_each(|(k, v)| f(start + k, v)))
    }

    /// The pairs of a particle.
    #[inline(always)]
    fn pairs(&self, a: usize) -> impl Iterator<Item = (Psi<D, C>, Pair)> {
        let places = self.prior.places(a);
        let apart = &self.apart[self.prior.stretch(a)][places.clone()];
        let others = self.prior.columns(a).iter().zip(self.prior.coefficients(a));
        apart.iter().zip(others).zip(places).map(move |((d, (&b, &g)), at)| (psi(d), Pair { a, b: b as usize, at, g }))
    }

    /// Adds up `f(sum, ψ, pair)` over the pairs of each particle.
    fn over_pairs<T: Copy + Send>(
        &self,
        sums: &mut [T],
        f: impl Fn(&mut T, Psi<D, C>, Pair) + Sync + Send,
    ) -> Result<()> {
        self.each(sums, |a, sum| {
            // A copy, which can stay in registers.
            let mut own = *sum;
            self.pairs(a).for_each(|(psi, pair)| f(&mut own, psi, pair));
            *sum = own;
        })
    }

    /// Which particles have their neighbours on one side.
    fn one_sided(&self) -> Result<Vec<bool>> {
        // Far neighbours tell a surface from disorder, which is where near ones are: g d² weighs them.
        let mut sums = memory::filled("moments", self.prior.len(), (Vector::zeros(), 0.0))?;
        self.over_pairs(&mut sums, |(moments, total), Psi(psi), pair| {
            let weight = pair.g * squares::<D>().map(|at| psi[at]).sum::<f64>();
            *moments += psi * weight;
            *total += weight;
        })?;
        let skewed = |(moments, total): &(Vector<C>, f64)| {
            let second: f64 = 2.0 * squares::<D>().map(|at| moments[at]).sum::<f64>();
            moments.rows(0, D).norm_squared() > ONE_SIDED * total * second
        };
        memory::collected("particles at a surface", sums.iter().map(skewed))
    }

    /// Sets each vector to what moments lack; answers its root mean square.
    fn defect(&self, lambda: &[Vector<C>], waived: &[bool], lacks: &mut [Vector<C>]) -> Result<f64> {
        lacks.fill(Vector::zeros());
        self.over_pairs(lacks, |lacks, psi, Pair { a, b, g, .. }| {
            *lacks -= psi.0 * (g * factor(&psi, &lambda[a], &lambda[b]));
        })?;
        let target = |i: usize| self.volume[i] / (self.unit * self.unit);
        self.each(lacks, |i, lacks| match waived[i] {
            true => lacks.fill(0.0),
            false => *lacks += self.second(i) * target(i),
        })?;
        let squared = |i: usize| (lacks[i] / target(i)).norm_squared();
        Ok((sum::sum(self.pool, lacks.len(), squared) / (lacks.len() * C).max(1) as f64).sqrt())
    }

    /// The moments that a particle is to have, per volume: no first ones, and S or I.
    fn second(&self, i: usize) -> Vector<C> {
        let (mut moments, mut at) = (Vector::zeros(), D);
        for k in 0..D {
            for l in k..D {
                moments[at] =
                    self.shape.map_or(f64::from(u8::from(k == l)), |shape| tensor::component(&shape[i], k, l));
                at += 1;
            }
        }
        moments
    }

    /// Which pairs are not at 0.
    fn used(&self, lambda: &[Vector<C>]) -> Result<Vec<Vec<bool>>> {
        let mut used = memory::reserved("pairs in use", self.apart.len())?;
        for apart in self.apart {
            used.push(memory::filled("pairs in use", apart.len(), false)?);
        }
        let length = self.prior.length();
        self.pool.chunks(&mut used, 1, |stretch, used| {
            if self.pool.go_on().is_err() {
                return;
            }
            for a in stretch * length..((stretch + 1) * length).min(self.prior.len()) {
                for (psi, Pair { b, at, .. }) in self.pairs(a) {
                    used[0][at] = factor(&psi, &lambda[a], &lambda[b]) > 0.0;
                }
            }
        });
        self.pool.go_on().map(|()| used)
    }

    /// The inverse of each particle's own Σ g ψ ψᵀ; 0 where nothing is to be solved for, or cannot be.
    fn inverse_blocks(&self, waived: &[bool]) -> Result<Vec<Block<C>>> {
        let mut blocks = memory::filled("blocks of moments", self.prior.len(), Block::zeros())?;
        // The lower triangle, which is all that is looked at.
        self.over_pairs(&mut blocks, |block: &mut Block<C>, Psi(psi), Pair { g, .. }| {
            for k in 0..C {
                for l in k..C {
                    block[(l, k)] += psi[l] * (psi[k] * g);
                }
            }
        })?;
        self.each(&mut blocks, |i, block| {
            let spread = block.diagonal();
            let factors = Cholesky::<f64, Const<C>>::new(*block).filter(|_| !waived[i]);
            let safe = |f: &Cholesky<f64, Const<C>>| (0..C).all(|k| f.l_dirty()[(k, k)].powi(2) >= FLAT * spread[k]);
            *block = factors.filter(safe).map_or(Block::zeros(), |f| f.inverse());
        })?;
        Ok(blocks)
    }

    /// Sets x to the multipliers whose moments, to first order in them, are r, as far as a few iterations find them.
    fn solve(&self, used: &[Vec<bool>], inverse: &[Block<C>], r: &mut [Vector<C>], x: &mut [Vector<C>]) -> Result<()> {
        let (mut z, mut p, mut q) = (self.zeros()?, self.zeros()?, self.zeros()?);
        let dot = |v: &[Vector<C>], w: &[Vector<C>]| sum::sum(self.pool, v.len(), |i| v[i].dot(&w[i]));
        x.fill(Vector::zeros());
        let mut before = f64::INFINITY;
        for _ in 0..ITERATIONS {
            self.each(&mut z, |i, z| *z = inverse[i] * r[i])?;
            let rz = dot(r, &z);
            self.each(&mut p, |i, p| *p = z[i] + *p * (rz / before))?;
            q.fill(Vector::zeros());
            self.over_pairs(&mut q, |q, psi, Pair { a, b, at, g }| {
                if used[self.prior.stretch(a)][at] {
                    *q += psi.0 * (g * psi.of(&p[a], &p[b]));
                }
            })?;
            let pq = dot(&p, &q);
            if pq <= 0.0 || pq.is_nan() {
                break;
            }
            let alpha = rz / pq;
            self.each(x, |i, x| *x += p[i] * alpha)?;
            self.each(r, |i, r| *r -= q[i] * alpha)?;
            before = rz;
        }
        Ok(())
    }
}

/// Where the moments xx, yy, zz are.
fn squares<const D: usize>() -> impl Iterator<Item = usize> {
    (0..D).map(|k| D + (0..k).map(|l| D - l).sum::<usize>())
}
