//! Arrays whose size a host decides: reserved fallibly, because an abort on a failed allocation would take the host
//! with it.

use crate::error::{Error, Result};

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
        v.try_reserve(n - v.len()).map_err(|_| no_memory::<T>(what, n))?;
        v.resize(n, value);
    }
    Ok(())
}

/// Appends an item, or `NoMemory`.
pub fn pushed<T>(what: &str, v: &mut Vec<T>, item: T) -> Result<()> {
    v.try_reserve(1).map_err(|_| no_memory::<T>(what, v.len() + 1))?;
    v.push(item);
    Ok(())
}

/// An empty array with room for exactly `n`, or `NoMemory`.
pub fn reserved<T>(what: &str, n: usize) -> Result<Vec<T>> {
    let mut v = Vec::new();
    match v.try_reserve_exact(n) {
        Ok(()) => Ok(v),
        Err(_) => Err(no_memory::<T>(what, n)),
    }
}

/// The error for an array of `n` items that did not fit.
pub fn no_memory<T>(what: &str, n: usize) -> Error {
    let bytes = (n as u64).saturating_mul(size_of::<T>() as u64);
    Error::NoMemory { what: what.into(), bytes, available: available() }
}

/// Bytes of physical memory that this process may still take without pushing others out: Linux' own estimate where it
/// gives one, all of the machine's memory elsewhere.
pub fn available() -> u64 {
    let estimate = std::fs::read_to_string("/proc/meminfo").ok().and_then(|text| {
        let line = text.lines().find(|l| l.starts_with("MemAvailable:"))?;
        line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kib| kib * 1024)
    });
    estimate.unwrap_or_else(physical)
}

fn physical() -> u64 {
    // SAFETY: sysconf has no preconditions; it answers -1 for what it does not know.
    let (pages, size) = unsafe { (libc::sysconf(libc::_SC_PHYS_PAGES), libc::sysconf(libc::_SC_PAGESIZE)) };
    if pages > 0 && size > 0 { pages as u64 * size as u64 } else { u64::MAX }
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

    #[test]
    fn available_memory_is_known_here() {
        assert!(available() > 1 << 20);
    }
}
