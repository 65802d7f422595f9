//! A conductivity that depends on direction: kappa_par along b and kappa_perp across it, or a symmetric tensor, as one
//! number and one shape for each particle, K = kappa S with tr S = nu.

use super::fields::{B, FIELDS, KAPPA_IJ, KAPPA_PAR, KAPPA_PERP, Slot, TENSOR};
use crate::error::{Error, Result};
use crate::memory;
use crate::operator::{Sym, tensor};

/// How negative an eigenvalue may be, relative to the trace: rounding of a host's products b_i b_j.
const ROUNDING: f64 = 1e-12;

/// kappa = tr K / nu and S = K / kappa of each particle.
#[derive(Debug, Clone, PartialEq)]
pub struct Tensor {
    pub kappa: Vec<f64>,
    pub shape: Vec<Sym>,
}

impl Tensor {
    /// From what the host has set: `at(slot, i)`, with `set(slot)` telling what there is. None where nothing makes a
    /// tensor.
    ///
    /// # Errors
    /// `BadValue` where inputs contradict each other or one is missing; `BadElement` for a tensor with a negative
    /// eigenvalue, naming the host's particle; `NoMemory`.
    pub fn read(
        n: usize,
        dim: usize,
        set: impl Fn(Slot) -> bool,
        at: impl Fn(Slot, usize) -> f64,
        host: impl Fn(usize) -> usize,
    ) -> Result<Option<Tensor>> {
        let Some(first) = TENSOR.clone().find(|&slot| set(slot)) else { return Ok(None) };
        let by_components = (KAPPA_IJ..KAPPA_IJ + 6).any(&set);
        if by_components && (KAPPA_PAR..KAPPA_IJ).any(&set) {
            let rule = "give kappa_par, kappa_perp and b, or kappa_xx, …, not both";
            return Err(Error::bad(FIELDS[first].name, "set", rule));
        }
        let by_direction = set(KAPPA_PAR) && (B..B + 3).any(&set);
        if !(by_components || by_direction) {
            return Err(Error::bad(FIELDS[first].name, "set", "it needs kappa_par and b too"));
        }
        let mut kappa = memory::reserved("kappa", n)?;
        let mut shape = memory::reserved("kappa", n)?;
        for i in 0..n {
            let k = match by_components {
                true => std::array::from_fn(|c| if within(c, dim) { at(KAPPA_IJ + c, i) } else { 0.0 }),
                false => along(
                    [0, 1, 2].map(|a| if a < dim { at(B + a, i) } else { 0.0 }),
                    at(KAPPA_PAR, i),
                    at(KAPPA_PERP, i),
                    dim,
                ),
            };
            let mean = tensor::trace(&k) / dim as f64;
            if by_components && tensor::smallest(&k, dim) < -ROUNDING * mean {
                let rule = "a conductivity tensor must have no negative eigenvalue";
                return Err(Error::bad_at("kappa_ij", host(i), format!("{k:?}"), rule));
            }
            kappa.push(mean);
            shape.push(if mean > 0.0 { k.map(|k| k / mean) } else { tensor::unit(dim) });
        }
        Ok(Some(Tensor { kappa, shape }))
    }

    /// Whether every particle conducts alike in all directions.
    pub fn is_isotropic(&self, dim: usize) -> bool {
        self.shape.iter().all(|s| *s == tensor::unit(dim))
    }

    /// The first particle whose tensor Espanol & Revenga's weights do not follow with positive weights: an eigenvalue
    /// below tr K / (nu + 2), in two and three dimensions kappa_par > 3 kappa_perp.
    pub fn beyond_espanol_revenga(&self, dim: usize) -> Option<usize> {
        let least = dim as f64 / (dim as f64 + 2.0);
        self.shape.iter().position(|s| tensor::smallest(s, dim) < least * (1.0 - 1e-12))
    }
}

fn within(component: usize, dim: usize) -> bool {
    [1, 2, 3, 2, 3, 3][component] <= dim
}

/// kappa_perp I + (kappa_par − kappa_perp) b bᵀ, b of any length; kappa_perp I where b is 0.
fn along(b: [f64; 3], par: f64, perp: f64, dim: usize) -> Sym {
    let largest = b.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let unit = tensor::unit(dim);
    if largest == 0.0 {
        return unit.map(|u| perp * u);
    }
    let b = b.map(|v| v / largest);
    let length2 = tensor::dot(b, b);
    let more = (par - perp) / length2;
    let [x, y, z] = b;
    let outer = [x * x, y * y, z * z, x * y, y * z, x * z];
    std::array::from_fn(|k| perp * unit[k] + more * outer[k])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    fn read(given: &[(Slot, f64)], dim: usize) -> Result<Option<Tensor>> {
        let given: HashMap<Slot, f64> = given.iter().copied().collect();
        Tensor::read(1, dim, |s| given.contains_key(&s), |s, _| given.get(&s).copied().unwrap_or(0.0), |i| i)
    }

    #[test]
    fn both_ways_to_give_a_tensor_agree() {
        let by_b = read(&[(KAPPA_PAR, 3.0), (KAPPA_PERP, 1.0), (B, 6.0), (B + 1, -8.0)], 2).unwrap().unwrap();
        let by_components = read(&[(KAPPA_IJ, 1.72), (KAPPA_IJ + 1, 2.28), (KAPPA_IJ + 3, -0.96)], 2).unwrap().unwrap();
        assert!((by_b.kappa[0] - 2.0).abs() < 1e-15 && (by_components.kappa[0] - 2.0).abs() < 1e-15);
        let difference = |k: usize| (by_b.shape[0][k] - by_components.shape[0][k]).abs();
        assert!((0..6).all(|k| difference(k) < 1e-15));
        assert_eq!(by_b.beyond_espanol_revenga(2), None);
        let four = read(&[(KAPPA_PAR, 3.1), (KAPPA_PERP, 1.0), (B, 1.0)], 3).unwrap().unwrap();
        assert_eq!(four.beyond_espanol_revenga(3), Some(0));
    }

    #[test]
    fn a_direction_of_length_zero_conducts_across_in_all_directions() {
        let zero = read(&[(KAPPA_PAR, 3.0), (KAPPA_PERP, 1.0), (B, 0.0)], 3).unwrap().unwrap();
        assert!(zero.is_isotropic(3) && zero.kappa == [1.0]);
        let tiny = read(&[(KAPPA_PAR, 3.0), (B, 1e-300)], 3).unwrap().unwrap();
        assert_eq!(tiny.shape[0], [3.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn contradictions_are_errors() {
        assert!(read(&[], 2).unwrap().is_none());
        for (given, expected) in [
            (vec![(KAPPA_PAR, 1.0)], "needs kappa_par and b"),
            (vec![(B, 1.0)], "needs kappa_par and b"),
            (vec![(KAPPA_PAR, 1.0), (B, 1.0), (KAPPA_IJ, 1.0)], "not both"),
            (vec![(KAPPA_IJ, 1.0), (KAPPA_IJ + 1, 1.0), (KAPPA_IJ + 3, 2.0)], "no negative eigenvalue"),
        ] {
            let text = read(&given, 2).unwrap_err().to_string();
            assert!(text.contains(expected), "{text}");
        }
    }
}
