//! C pointers, counts and strings to Rust and back. Everything that can be checked is: NULL, alignment, sign, overflow.

use crate::array::{Strided, StridedMut, span};
use crate::error::{Error, Result};
use std::ffi::{CStr, c_char};
use std::path::Path;

fn not_null<T>(argument: &str, pointer: *const T, expected: &str) -> Result<()> {
    if pointer.is_null() {
        return Err(Error::NullPointer { argument: argument.into(), expected: expected.into() });
    }
    if !pointer.is_aligned() {
        let rule = format!("its address must be a multiple of {}", align_of::<T>());
        return Err(Error::bad(argument, format!("{pointer:p}"), &rule));
    }
    Ok(())
}

/// A C string.
///
/// # Safety
/// `from` is NULL or ends with a NUL, and lives through the call.
pub unsafe fn string<'a>(argument: &str, from: *const c_char) -> Result<&'a CStr> {
    not_null(argument, from, "a string")?;
    // SAFETY: not NULL; the rest is the caller's word.
    Ok(unsafe { CStr::from_ptr(from) })
}

/// A C string that must be text.
///
/// # Safety
/// As [`string`].
pub unsafe fn text<'a>(argument: &str, from: *const c_char) -> Result<&'a str> {
    // SAFETY: passed on to the caller.
    let string = unsafe { string(argument, from) }?;
    string.to_str().map_err(|_| Error::bad(argument, format!("'{}'", string.to_string_lossy()), "it must be UTF-8"))
}

/// A path: any bytes on Unix, UTF-8 elsewhere.
///
/// # Safety
/// As [`string`].
pub unsafe fn file<'a>(argument: &str, from: *const c_char) -> Result<&'a Path> {
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;
        // SAFETY: passed on to the caller.
        let bytes = unsafe { string(argument, from) }?.to_bytes();
        Ok(Path::new(std::ffi::OsStr::from_bytes(bytes)))
    }
    #[cfg(not(unix))]
    // SAFETY: passed on to the caller.
    Ok(Path::new(unsafe { text(argument, from) }?))
}

/// A place for one result.
///
/// # Safety
/// `to` is NULL or writable, and lives through the call.
pub unsafe fn place<'a, T>(argument: &str, to: *mut T) -> Result<&'a mut T> {
    not_null(argument, to, "the address of a variable")?;
    // SAFETY: not NULL and aligned; the rest is the caller's word.
    Ok(unsafe { &mut *to })
}

/// An array of `n` items.
///
/// # Safety
/// `data` is NULL or has `n` readable items.
pub unsafe fn slice<'a, T>(argument: &str, data: *const T, n: usize) -> Result<&'a [T]> {
    if n == 0 {
        return Ok(&[]);
    }
    not_null(argument, data, &format!("an array of {n}"))?;
    // SAFETY: not NULL and aligned; the rest is the caller's word.
    Ok(unsafe { std::slice::from_raw_parts(data, n) })
}

/// A host's array of `n` particles.
///
/// # Safety
/// `data` is NULL or has `(n - 1) * stride + components` readable doubles.
pub unsafe fn strided<'a>(name: &str, data: *const f64, n: i64, stride: i64, components: usize) -> Result<Strided<'a>> {
    let (n, stride, doubles) = layout(n, stride, components)?;
    // SAFETY: passed on to the caller.
    Strided::new(name, unsafe { slice(name, data, doubles) }?, n, stride, components)
}

/// A host's array to be written.
///
/// # Safety
/// As [`strided`], and writable; nobody else uses it during the call.
pub unsafe fn strided_mut<'a>(
    name: &str,
    data: *mut f64,
    n: i64,
    stride: i64,
    components: usize,
) -> Result<StridedMut<'a>> {
    let (n, stride, doubles) = layout(n, stride, components)?;
    if doubles == 0 {
        return StridedMut::new(name, &mut [], n, stride, components);
    }
    not_null(name, data, &format!("an array of {doubles}"))?;
    // SAFETY: not NULL and aligned; the rest is the caller's word.
    StridedMut::new(name, unsafe { std::slice::from_raw_parts_mut(data, doubles) }, n, stride, components)
}

/// A number of particles.
pub fn count(n: i64) -> Result<usize> {
    usize::try_from(n).map_err(|_| Error::bad("n", n, "a number of particles cannot be negative"))
}

fn layout(n: i64, stride: i64, components: usize) -> Result<(usize, usize, usize)> {
    let particles = count(n)?;
    let short = || format!("it counts the doubles from one particle to the next, at least {components} here");
    let step = usize::try_from(stride).ok().filter(|s| *s >= components);
    let step = step.ok_or_else(|| Error::bad("stride", stride, &short()))?;
    let doubles = span(particles, step, components).filter(|d| *d <= isize::MAX as usize / size_of::<f64>());
    Ok((particles, step, doubles.ok_or_else(|| Error::bad("n", n, "n * stride does not fit the address space"))?))
}

/// Bytes for text in the host's buffer, beside the NUL.
pub fn room(argument: &str, buf: *mut c_char, len: i64) -> Result<usize> {
    not_null(argument, buf, "a buffer for text")?;
    let bytes = usize::try_from(len).ok().filter(|bytes| *bytes > 0);
    let bytes = bytes.ok_or_else(|| Error::bad(&format!("{argument}_len"), len, "a buffer needs at least one byte"))?;
    Ok(bytes - 1)
}

/// Copies a text into the host's buffer, cut where it does not fit, always with a NUL at the end.
///
/// # Safety
/// `buf` is NULL or has `len` writable bytes.
pub unsafe fn copy_out(argument: &str, buf: *mut c_char, len: i64, text: &str) -> Result<()> {
    let fits = text.floor_char_boundary(room(argument, buf, len)?);
    // SAFETY: not NULL, and `fits` + 1 <= `len`; the rest is the caller's word.
    unsafe {
        std::ptr::copy_nonoverlapping(text.as_ptr(), buf.cast(), fits);
        *buf.add(fits) = 0;
    }
    Ok(())
}
