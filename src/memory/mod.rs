//! Arrays whose size a host decides: reserved fallibly, because an abort on a failed allocation would take the host
//! with it.

mod huge;
mod limits;
// Without the feature all that is asked is whether it is low, and it never is.
#[cfg_attr(not(feature = "reserve"), allow(dead_code))]
mod reserve;

use crate::error::{Error, Result};
pub use limits::available;
use reserve::{is_low, refusable};
use std::collections::TryReserveError;

#[cfg(feature = "reserve")]
#[global_allocator]
static ALLOCATOR: reserve::Allocator = reserve::Allocator;

/// An array of `n` copies of `value`, or `NoMemory`.
pub fn filled<T: Clone>(what: &str, n: usize, value: T) -> Result<Vec<T>> {
    let mut v = reserved(what, n)?;
    v.resize(n, value);
    Ok(v)
}

/// A copy of a slice, or `NoMemory`.
pub fn copied<T: Copy>(what: &str, from: &[T]) -> Result<Vec<T>> {
    let mut v = reserved(what, from.len())?;
    v.extend_from_slice(from);
    Ok(v)
}

/// An array from an iterator of known length, or `NoMemory`.
pub fn collected<T>(what: &str, items: impl ExactSizeIterator<Item = T>) -> Result<Vec<T>> {
    let mut v = reserved(what, items.len())?;
    v.extend(items);
    Ok(v)
}

/// Makes an array at least `n` long with copies of `value`, or `NoMemory`.
pub fn extended<T: Clone>(what: &str, v: &mut Vec<T>, n: usize, value: T) -> Result<()> {
    if n > v.len() {
        room(what, v, n - v.len())?;
        v.resize(n, value);
    }
    Ok(())
}

/// Appends an item, or `NoMemory`.
pub fn pushed<T>(what: &str, v: &mut Vec<T>, item: T) -> Result<()> {
    room(what, v, 1)?;
    v.push(item);
    Ok(())
}

/// Appends copies of a slice, or `NoMemory`.
pub fn appended<T: Copy>(what: &str, v: &mut Vec<T>, from: &[T]) -> Result<()> {
    room(what, v, from.len())?;
    v.extend_from_slice(from);
    Ok(())
}

/// Makes room for `more` items behind those that are there, or `NoMemory`.
pub fn room<T>(what: &str, v: &mut Vec<T>, more: usize) -> Result<()> {
    if v.capacity() - v.len() >= more {
        return Ok(());
    }
    granted::<T>(what, v.len() + more, || v.try_reserve(more))?;
    huge::advise(v);
    Ok(())
}

/// An empty array with room for exactly `n`, or `NoMemory`.
pub fn reserved<T>(what: &str, n: usize) -> Result<Vec<T>> {
    let mut v = Vec::new();
    granted::<T>(what, n, || v.try_reserve_exact(n))?;
    huge::advise(&v);
    Ok(v)
}

/// Asks for room for `n` items; `NoMemory` where the system has none, or only the reserve is left.
pub fn granted<T>(what: &str, n: usize, ask: impl FnOnce() -> std::result::Result<(), TryReserveError>) -> Result<()> {
    if is_low() || refusable(ask).is_err() { Err(no_memory::<T>(what, n)) } else { Ok(()) }
}

/// The error for an array of `n` items that did not fit.
pub fn no_memory<T>(what: &str, n: usize) -> Error {
    let bytes = (n as u64).saturating_mul(size_of::<T>() as u64);
    Error::NoMemory { what: what.into(), bytes, available: available() }
}

/// Bytes held by an array.
pub fn bytes<T>(v: &Vec<T>) -> u64 {
    (v.capacity() * size_of::<T>()) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_large_an_array_is_an_error_not_an_abort() {
        let e = filled("weights", usize::MAX / 16, 0.0f64).unwrap_err();
        assert_eq!(e.code(), -9);
        assert!(e.to_string().contains("weights"), "{e}");
    }
}
