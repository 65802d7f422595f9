//! Cell lists in levels: particles whose supports differ by less than two share a level, whose cells are as long as
//! the largest support in it. Only occupied cells are stored, so empty space costs nothing.

use super::{Axes, Cloud, morton};
use crate::error::Result;
use crate::memory;
use crate::pool::Pool;
use crate::sum;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::ops::RangeInclusive;

/// Levels below the largest support; particles smaller still share the last one.
const MAX_LEVEL: usize = 40;

#[derive(Debug)]
pub struct Cells {
    pub levels: Vec<Level>,
    pub h_max: f64,
    /// All smoothing lengths are the same.
    pub same_h: bool,
    /// Which of `levels` each number of a level is; those without particles are not kept.
    kept: Vec<usize>,
}

/// One level: its particles in internal order, cut into cells.
#[derive(Debug)]
pub struct Level {
    /// Largest smoothing length on this level.
    pub h_max: f64,
    members: Vec<u32>,
    /// Fine cells per cell and axis, as a power of two.
    shift: u32,
    keys: Vec<u64>,
    starts: Vec<u32>,
    index: HashMap<u64, u32, BuildHasherDefault<KeyHasher>>,
}

impl Cells {
    /// Sorts particles with smoothing lengths `h` and kernel support `radius` (in h) into cells.
    pub fn new(cloud: &Cloud, h: &[f64], radius: f64, pool: &Pool) -> Result<Cells> {
        let (h_max, h_min) = (sum::max(pool, h.len(), |i| h[i]), sum::min(pool, h.len(), |i| h[i]));
        let members = match h_max == h_min {
            true => vec![memory::collected("cell lists", 0..h.len() as u32)?],
            false => by_level(h, h_max)?,
        };
        let (mut kept, mut filled) = (Vec::new(), 0);
        for list in &members {
            kept.push(filled);
            filled += usize::from(!list.is_empty());
        }
        let filled = members.into_iter().filter(|m| !m.is_empty());
        let levels: Result<Vec<Level>> = filled.map(|m| Level::new(cloud, h, radius, m)).collect();
        Ok(Cells { levels: levels?, h_max, same_h: h_max == h_min, kept })
    }

    /// The key of particle i's cell on its own level: neighbours in internal order that share it are searched together.
    pub fn group_key(&self, cloud: &Cloud, i: usize, h: f64) -> (usize, u64) {
        let level = self.kept[level_of(h, self.h_max)];
        (level, self.levels[level].key(cloud, i))
    }
}

/// The particles of each level, in order.
fn by_level(h: &[f64], h_max: f64) -> Result<Vec<Vec<u32>>> {
    let mut members: Vec<Vec<u32>> = Vec::new();
    for (i, &hi) in h.iter().enumerate() {
        let level = level_of(hi, h_max);
        if members.len() <= level {
            members.resize_with(level + 1, Vec::new);
        }
        let list = &mut members[level];
        if list.len() == list.capacity() {
            let more = list.len().max(64).min(h.len() - i);
            memory::granted::<u32>("cell lists", more, || list.try_reserve_exact(more))?;
        }
        list.push(i as u32);
    }
    Ok(members)
}

fn level_of(h: f64, h_max: f64) -> usize {
    // 0 for equal lengths, without a logarithm; a length of 0 ends on the last level.
    if h == h_max { 0 } else { ((h_max / h).log2() as usize).min(MAX_LEVEL) }
}

/// A particle's key where cells are 2^shift fine ones long.
fn cell_key(cloud: &Cloud, i: usize, shift: u32) -> u64 {
    cloud.keys[i] >> (shift as usize * cloud.dim()).min(63)
}

impl Level {
    fn new(cloud: &Cloud, h: &[f64], radius: f64, members: Vec<u32>) -> Result<Level> {
        let dim = cloud.dim();
        let h_max = members.iter().map(|&i| h[i as usize]).fold(0.0, f64::max);
        // A cell may be a little shorter than the reach: the search visits every cell that the reach overlaps.
        let doublings = (radius * h_max / cloud.grid.edge).log2() - 0.05;
        let shift = (doublings.ceil().max(0.0) as u32).min(morton::bits(dim));
        let (mut keys, mut starts) = (Vec::new(), Vec::new());
        for (at, &i) in members.iter().enumerate() {
            let key = cell_key(cloud, i as usize, shift);
            if keys.last() != Some(&key) {
                memory::pushed("cell keys", &mut keys, key)?;
                memory::pushed("cell starts", &mut starts, at as u32)?;
            }
        }
        memory::pushed("cell starts", &mut starts, members.len() as u32)?;
        let mut index = HashMap::default();
        memory::granted::<(u64, u32)>("cell table", keys.len(), || index.try_reserve(keys.len()))?;
        index.extend(keys.iter().enumerate().map(|(at, &key)| (key, at as u32)));
        Ok(Level { h_max, members, shift, keys, starts, index })
    }

    /// The key of the cell in which a particle is on this level.
    fn key(&self, cloud: &Cloud, i: usize) -> u64 {
        cell_key(cloud, i, self.shift)
    }

    /// Calls `found` with the particles of every occupied cell that overlaps a box of positions inside the domain.
    pub fn overlapping(&self, cloud: &Cloud, from: Axes<f64>, to: Axes<f64>, mut found: impl FnMut(&[u32])) {
        let dim = cloud.dim();
        let range = |axis: usize| -> RangeInclusive<u64> {
            if axis >= dim {
                return 0..=0;
            }
            cloud.grid.coordinate(axis, from[axis]) >> self.shift..=cloud.grid.coordinate(axis, to[axis]) >> self.shift
        };
        let ranges = [range(0), range(1), range(2)];
        let count = ranges.iter().map(|r| (r.end() - r.start() + 1) as f64).product::<f64>();
        if count > self.keys.len() as f64 {
            // Fewer occupied cells than cells in the box: look at the occupied ones.
            for (at, &key) in self.keys.iter().enumerate() {
                let cell = morton::cell(dim, key);
                if (0..dim).all(|a| ranges[a].contains(&cell[a])) {
                    found(self.cell(at));
                }
            }
            return;
        }
        for z in ranges[2].clone() {
            for y in ranges[1].clone() {
                for x in ranges[0].clone() {
                    if let Some(&at) = self.index.get(&morton::key(dim, [x, y, z])) {
                        found(self.cell(at as usize));
                    }
                }
            }
        }
    }

    fn cell(&self, at: usize) -> &[u32] {
        &self.members[self.starts[at] as usize..self.starts[at + 1] as usize]
    }
}

/// Multiplies the key by an odd constant (Fibonacci hashing): Morton keys are already spread well.
#[derive(Default)]
pub struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn write(&mut self, bytes: &[u8]) {
        for &b in bytes {
            self.write_u64(u64::from(b));
        }
    }

    fn write_u64(&mut self, key: u64) {
        let mixed = (self.0 ^ key).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = mixed ^ (mixed >> 32);
    }

    fn finish(&self) -> u64 {
        self.0
    }
}
