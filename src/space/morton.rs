//! The Morton curve: cell coordinates interleaved to one key, so that near in space is near in memory.

use super::Axes;

/// Bits of a coordinate in a 64-bit key.
pub fn bits(dim: usize) -> u32 {
    [62, 31, 21][dim - 1]
}

/// The key of a cell; each coordinate must fit [`bits`].
pub fn key(dim: usize, cell: Axes<u64>) -> u64 {
    match dim {
        1 => cell[0],
        2 => spread2(cell[0]) | spread2(cell[1]) << 1,
        _ => spread3(cell[0]) | spread3(cell[1]) << 1 | spread3(cell[2]) << 2,
    }
}

/// The cell of a key.
pub fn cell(dim: usize, key: u64) -> Axes<u64> {
    match dim {
        1 => [key, 0, 0],
        2 => [gather2(key), gather2(key >> 1), 0],
        _ => [gather3(key), gather3(key >> 1), gather3(key >> 2)],
    }
}

const STEPS2: [(u32, u64); 5] = [
    (16, 0x0000_ffff_0000_ffff),
    (8, 0x00ff_00ff_00ff_00ff),
    (4, 0x0f0f_0f0f_0f0f_0f0f),
    (2, 0x3333_3333_3333_3333),
    (1, 0x5555_5555_5555_5555),
];
const STEPS3: [(u32, u64); 5] = [
    (32, 0x001f_0000_0000_ffff),
    (16, 0x001f_0000_ff00_00ff),
    (8, 0x100f_00f0_0f00_f00f),
    (4, 0x10c3_0c30_c30c_30c3),
    (2, 0x1249_2492_4924_9249),
];

fn spread2(v: u64) -> u64 {
    STEPS2.iter().fold(v & 0x7fff_ffff, |v, (shift, mask)| (v | v << shift) & mask)
}

fn spread3(v: u64) -> u64 {
    STEPS3.iter().fold(v & 0x1f_ffff, |v, (shift, mask)| (v | v << shift) & mask)
}

fn gather2(key: u64) -> u64 {
    gather(&STEPS2, 0x0000_0000_ffff_ffff, key)
}

fn gather3(key: u64) -> u64 {
    gather(&STEPS3, 0x0000_0000_001f_ffff, key)
}

/// Undoes the spreading step by step: each shift is masked by the mask of the step before it.
fn gather(steps: &[(u32, u64); 5], all: u64, key: u64) -> u64 {
    (0..5).rev().fold(key & steps[4].1, |v, i| (v | v >> steps[i].0) & if i == 0 { all } else { steps[i - 1].1 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_and_cells_are_inverse_and_match_bit_by_bit_interleaving() {
        for dim in 1..=3 {
            let mut state = 1u64;
            for _ in 0..1000 {
                let mut c = [0u64; 3];
                for x in c.iter_mut().take(dim) {
                    state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                    *x = state >> (64 - bits(dim));
                }
                let mut slow = 0u64;
                for bit in 0..bits(dim) {
                    for (axis, x) in c.iter().enumerate().take(dim) {
                        slow |= (x >> bit & 1) << (bit as usize * dim + axis);
                    }
                }
                assert_eq!(key(dim, c), slow);
                assert_eq!(cell(dim, slow), c);
            }
        }
    }
}
