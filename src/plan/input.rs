//! What a host gives for a quantity: nothing, one number, or one value per particle.

use crate::error::Result;
use crate::memory;
use crate::model::fields::{Access, FIELDS, Slot};
use std::borrow::Cow;

/// An input: one number for all, or one per particle in internal order.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Input {
    #[default]
    Unset,
    Number(f64),
    Each(Vec<f64>),
}

impl Input {
    pub fn default_of(slot: Slot) -> Input {
        match FIELDS[slot].access {
            Access::Input { default: Some(v), .. } => Input::Number(v),
            _ => Input::Unset,
        }
    }

    pub fn at(&self, i: usize) -> Option<f64> {
        match self {
            Input::Unset => None,
            Input::Number(v) => Some(*v),
            Input::Each(v) => v.get(i).copied(),
        }
    }

    /// As an array of n; one that is held is borrowed, a number is repeated.
    pub fn view(&self, n: usize) -> Result<Cow<'_, [f64]>> {
        match self {
            Input::Each(v) => Ok(Cow::Borrowed(v)),
            Input::Number(v) => Ok(Cow::Owned(memory::filled("particle data", n, *v)?)),
            Input::Unset => Ok(Cow::Owned(memory::filled("particle data", n, 0.0)?)),
        }
    }

    /// `f` of this and another, particle by particle; unset where one of them is.
    pub fn with(&self, other: &Input, f: impl Fn(f64, f64) -> f64) -> Result<Input> {
        Ok(match (self, other) {
            (Input::Unset, _) | (_, Input::Unset) => Input::Unset,
            (Input::Number(a), Input::Number(b)) => Input::Number(f(*a, *b)),
            (Input::Each(a), Input::Number(b)) => {
                Input::Each(memory::collected("particle data", a.iter().map(|a| f(*a, *b)))?)
            }
            (Input::Number(a), Input::Each(b)) => {
                Input::Each(memory::collected("particle data", b.iter().map(|b| f(*a, *b)))?)
            }
            (Input::Each(a), Input::Each(b)) => {
                Input::Each(memory::collected("particle data", a.iter().zip(b).map(|(a, b)| f(*a, *b)))?)
            }
        })
    }

    /// The values of particles in another order: the i-th was the `was(i)`-th. None where all have the same.
    pub fn moved(&self, n: usize, was: impl Fn(usize) -> usize) -> Result<Option<Input>> {
        let Input::Each(v) = self else { return Ok(None) };
        memory::collected("particle data", (0..n).map(|i| v[was(i)])).map(|v| Some(Input::Each(v)))
    }

    /// One number where all values are the same.
    pub fn compressed(values: Vec<f64>) -> Input {
        match values.first() {
            Some(&first) if values.iter().all(|&v| v == first) => Input::Number(first),
            _ => Input::Each(values),
        }
    }

    pub fn is_each(&self) -> bool {
        matches!(self, Input::Each(_))
    }

    pub fn bytes(&self) -> u64 {
        if let Input::Each(v) = self { memory::bytes(v) } else { 0 }
    }
}

/// Which of T and u = c_v T the host gave: the other follows where c_v becomes another.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Energy {
    /// T was given.
    #[default]
    Follows,
    /// u was given, and these are its values.
    Given(Input),
    /// u was given, and has moved with T since.
    Moved,
}

impl Energy {
    pub fn bytes(&self) -> u64 {
        if let Energy::Given(input) = self { input.bytes() } else { 0 }
    }
}
