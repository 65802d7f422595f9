//! What a scene gives a solution: numbers by name, with defaults from the material and from the solution's table.

use super::{Solution, slab};
use crate::error::{Error, Result};
use std::collections::BTreeMap;

/// Numbers by name.
pub type Parameters = BTreeMap<String, Vec<f64>>;

pub(super) struct Given<'a> {
    pub solution: &'static Solution,
    pub dim: usize,
    pub given: Parameters,
    pub material: &'a BTreeMap<String, f64>,
}

impl Given<'_> {
    fn values(&self, name: &str) -> Result<Vec<f64>> {
        let default = self.solution.parameters.iter().find(|p| p.0 == name).and_then(|p| p.1);
        let found = self.given.get(name).cloned();
        let found = found.or_else(|| self.material.get(name).map(|&v| vec![v])).or(default.map(<[f64]>::to_vec));
        let missing = || self.wrong(name, "missing", "give it in [exact]");
        let values = found.ok_or_else(missing)?;
        match values.iter().find(|v| !v.is_finite()) {
            Some(v) => Err(self.wrong(name, v, "it must be finite")),
            None => Ok(values),
        }
    }

    fn wrong(&self, name: &str, value: impl ToString, rule: &str) -> Error {
        Error::bad(&format!("{name} of {}", self.solution.name), value, rule)
    }

    pub fn rule(&self, name: &str, holds: bool, rule: &str) -> Result<()> {
        if holds { Ok(()) } else { Err(self.wrong(name, format!("{:?}", self.values(name)?), rule)) }
    }

    /// Number `i` of a list of `count`.
    pub fn at(&self, name: &str, i: usize, count: usize) -> Result<f64> {
        let values = self.values(name)?;
        match values.get(i) {
            Some(&v) if values.len() == count => Ok(v),
            _ => Err(self.wrong(name, format!("{values:?}"), &format!("it needs {count} number(s)"))),
        }
    }

    pub fn number(&self, name: &str) -> Result<f64> {
        self.at(name, 0, 1)
    }

    pub fn positive(&self, name: &str) -> Result<f64> {
        let value = self.number(name)?;
        self.rule(name, value > 0.0, "it must be positive")?;
        Ok(value)
    }

    pub fn two(&self, name: &str) -> Result<[f64; 2]> {
        Ok([self.at(name, 0, 2)?, self.at(name, 1, 2)?])
    }

    pub fn two_positive(&self, name: &str) -> Result<[f64; 2]> {
        let two = self.two(name)?;
        self.rule(name, two.iter().all(|&v| v > 0.0), "both must be positive")?;
        Ok(two)
    }

    /// One number per axis; axes beyond are 0.
    pub fn point(&self, name: &str) -> Result<[f64; 3]> {
        let values = self.values(name)?;
        if values.len() < self.dim {
            return Err(self.wrong(name, format!("{values:?}"), &format!("it needs {} number(s)", self.dim)));
        }
        Ok(std::array::from_fn(|a| if a < self.dim { values[a] } else { 0.0 }))
    }

    fn capacity(&self) -> Result<f64> {
        Ok(self.positive("rho")? * self.positive("c_v")?)
    }

    pub fn diffusivity(&self) -> Result<f64> {
        Ok(self.positive("kappa")? / self.capacity()?)
    }

    pub fn slab(&self) -> Result<slab::Slab> {
        let [a, b] = self.two("x")?;
        self.rule("x", a != b, "the faces must be apart")?;
        let needs_capacity = self.solution.parameters.iter().any(|p| p.0 == "c_v");
        let capacity = if needs_capacity { self.capacity()? } else { 1.0 };
        Ok(slab::Slab { a, b, kappa: self.positive("kappa")?, capacity })
    }
}
