//! What can be chosen, by name, and which version this is.

use super::codes::{DIFFUSPH_ABI, DIFFUSPH_VERSION_NUMBER};
use super::guard::alone;
use super::pointers::{copy_out, place, text};
use crate::error::{Error, Result, name_of};
use crate::solver::catalogue::{Item, catalogue};
use std::ffi::c_char;

/// The number of items in a catalogue: "models", "words", "kernels", "operators", "means", "integrators", "laws",
/// "fields", "numbers", "rules" or "errors".
///
/// \param list  which catalogue
/// \param count receives the number
///
/// Errors: UNKNOWN_WORD.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_count(list: *const c_char, count: *mut i64) -> i32 {
    alone(|| unsafe {
        let place = place("count", count)?;
        *place = catalogue(text("list", list)?)?.len() as i64;
        Ok(())
    })
}

/// The name of the i-th item (from 0) of a catalogue.
///
/// Errors: UNKNOWN_WORD, BAD_VALUE when there are not so many.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_name(list: *const c_char, i: i64, buf: *mut c_char, len: i64) -> i32 {
    alone(|| unsafe { copy_out("buf", buf, len, &item(text("list", list)?, i)?.name) })
}

/// What the i-th item (from 0) of a catalogue is, in a line; for fields and numbers with the unit in brackets.
///
/// Errors: as diffusph_name.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_about(list: *const c_char, i: i64, buf: *mut c_char, len: i64) -> i32 {
    alone(|| unsafe { copy_out("buf", buf, len, &item(text("list", list)?, i)?.about) })
}

fn item(list: &str, i: i64) -> Result<Item> {
    let mut items = catalogue(list)?;
    match usize::try_from(i).ok().filter(|i| *i < items.len()) {
        Some(i) => Ok(items.swap_remove(i)),
        None => Err(Error::bad("i", i, &format!("'{list}' has {} items, counted from 0", items.len()))),
    }
}

/// The name of a status, like "BAD_VALUE".
///
/// Errors: BAD_VALUE when there is no such status.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_error_name(code: i32, buf: *mut c_char, len: i64) -> i32 {
    alone(|| {
        let name = name_of(code).ok_or_else(|| Error::bad("code", code, "there is no such status"))?;
        unsafe { copy_out("buf", buf, len, name) }
    })
}

/// The version of the library, like "0.1.0".
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_version(buf: *mut c_char, len: i64) -> i32 {
    alone(|| unsafe { copy_out("buf", buf, len, env!("CARGO_PKG_VERSION")) })
}

/// The version of the library as a number, major * 10000 + minor * 100 + patch; not a status.
#[unsafe(no_mangle)]
pub extern "C" fn diffusph_version_number() -> i32 {
    DIFFUSPH_VERSION_NUMBER
}

/// The version of the binary interface; not a status. A host works with any library that answers DIFFUSPH_ABI.
#[unsafe(no_mangle)]
pub extern "C" fn diffusph_abi_version() -> i32 {
    DIFFUSPH_ABI
}
