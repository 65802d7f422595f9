//! Aggregates of strongly coupled points: the unknowns of the next coarser level (Vaněk, Mandel & Brezina 1996).

use super::{Kappa, Matrix};
use crate::error::Result;
use crate::memory;
use crate::pool::{BLOCK, Pool};

/// A point that belongs to no aggregate.
pub const NONE: u32 = u32::MAX;

/// Couplings weaker than this share of either point's strongest do not join points.
const STRONG: f64 = 0.1;

/// Points of an aggregate, in units of the square root of how many its first one is coupled to, itself included: in 1, 2
/// and 3 dimensions an aggregate is then some two spacings, and half as wide as a neighbourhood.
const SIZE: f64 = 1.3;

/// Who is coupled to whom.
pub trait Graph: Sync {
    fn points(&self) -> usize;

    /// Calls `f(j, coupling)` for everyone else coupled to `i`; couplings are symmetric and usually positive.
    fn visit(&self, i: usize, f: impl FnMut(usize, f64));
}

/// Particles, coupled by factor g_ab mean(kappa_a, kappa_b).
pub struct Couplings<'a> {
    pub matrix: &'a Matrix,
    pub kappa: Kappa<'a>,
    pub factor: f64,
}

impl Graph for Couplings<'_> {
    fn points(&self) -> usize {
        self.matrix.len()
    }

    #[inline]
    fn visit(&self, i: usize, mut f: impl FnMut(usize, f64)) {
        let pairs = self.matrix.columns(i).iter().map(|&j| j as usize).zip(self.matrix.coefficients(i));
        // An image of the particle itself exchanges nothing.
        let others = pairs.filter(|(j, _)| *j != i);
        match self.kappa {
            None => others.for_each(|(j, c)| f(j, self.factor * c)),
            Some((mean, k)) => others.for_each(|(j, c)| f(j, self.factor * c * mean.of(k[i], k[j]))),
        }
    }
}

/// For each point the first one of those that it is coupled to, directly or by way of others.
///
/// # Errors
/// `NoMemory`.
pub fn parts(graph: &impl Graph) -> Result<Vec<u32>> {
    let n = graph.points();
    let mut part = memory::filled("coupled parts", n, NONE)?;
    let mut ahead = memory::reserved("coupled parts", n)?;
    for first in 0..n {
        if part[first] == NONE {
            part[first] = first as u32;
            ahead.push(first);
        }
        while let Some(i) = ahead.pop() {
            graph.visit(i, |j, c| {
                if part[j] == NONE && c != 0.0 {
                    part[j] = first as u32;
                    ahead.push(j);
                }
            });
        }
    }
    Ok(part)
}

/// The aggregate of each point, and how many there are.
pub struct Aggregates {
    pub of: Vec<u32>,
    pub count: usize,
}

/// Joins points along their order, which on a space-filling curve leaves few gaps. Points for which `takes_part` is
/// false, or that are coupled to nobody, get no aggregate.
///
/// First each point that has enough free strong neighbours takes the strongest of them; then those left over join their
/// strongest neighbour, where there is room, or what is still free.
///
/// # Errors
/// `NoMemory`; `Cancelled`.
pub fn aggregates(
    pool: &Pool,
    graph: &impl Graph,
    takes_part: impl Fn(usize) -> bool + Sync + Send,
) -> Result<Aggregates> {
    let n = graph.points();
    let mut strongest = memory::filled("strongest couplings", n, 0.0f64)?;
    pool.chunks(&mut strongest, BLOCK, |start, part| {
        for (k, most) in part.iter_mut().enumerate().filter(|(k, _)| takes_part(start + k)) {
            graph.visit(start + k, |j, c| *most = if takes_part(j) { most.max(c) } else { *most });
        }
    });
    let mut made = Joining { strongest, of: memory::filled("aggregates", n, NONE)?, sizes: Vec::new() };
    let mut near = Vec::new();
    for enough in [true, false] {
        for i in 0..n {
            if i % BLOCK == 0 {
                pool.go_on()?;
            }
            made.join(graph, i, enough, &mut near)?;
        }
    }
    Ok(Aggregates { of: made.of, count: made.sizes.len() })
}

struct Joining {
    strongest: Vec<f64>,
    of: Vec<u32>,
    /// Points in each aggregate.
    sizes: Vec<u32>,
}

impl Joining {
    /// Finds an aggregate for point `i`, if it has none; where only `enough` free neighbours will do, perhaps not yet.
    fn join(&mut self, graph: &impl Graph, i: usize, enough: bool, near: &mut Vec<(f64, u32)>) -> Result<()> {
        if self.of[i] != NONE || self.strongest[i] == 0.0 {
            return Ok(());
        }
        let (size, host) = self.look(graph, i, near)?;
        if enough && near.len() + 1 < size {
            return Ok(());
        }
        // Bounded, so that no chain of latecomers grows without end.
        if !enough && host != NONE && (self.sizes[host as usize] as usize) < 2 * size {
            self.of[i] = host;
            self.sizes[host as usize] += 1;
            return Ok(());
        }
        if near.len() >= size {
            near.select_nth_unstable_by(size - 1, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            near.truncate(size - 1);
        }
        let new = self.sizes.len() as u32;
        memory::pushed("aggregates", &mut self.sizes, 1 + near.len() as u32)?;
        self.of[i] = new;
        near.iter().for_each(|&(_, j)| self.of[j as usize] = new);
        Ok(())
    }

    /// The size of an aggregate here, and the aggregate of the strongest neighbour that has one; `near` becomes the list of
    /// strong neighbours that are free.
    fn look(&self, graph: &impl Graph, i: usize, near: &mut Vec<(f64, u32)>) -> Result<(usize, u32)> {
        let (mut degree, mut best, mut host, mut room) = (0u32, 0.0, NONE, true);
        near.clear();
        graph.visit(i, |j, c| {
            degree += 1;
            let strong = self.strongest[j] > 0.0 && c >= STRONG * self.strongest[i].max(self.strongest[j]);
            match self.of[j] {
                _ if !strong => {}
                NONE => room &= memory::pushed("aggregates", near, (c, j as u32)).is_ok(),
                taken if c > best => (best, host) = (c, taken),
                _ => {}
            }
        });
        let size = (SIZE * f64::from(degree + 1).sqrt()).ceil() as usize;
        if room { Ok((size, host)) } else { Err(memory::no_memory::<(f64, u32)>("neighbours", near.len())) }
    }
}
