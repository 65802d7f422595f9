//! What a host gets. A derived quantity is computed only when it is asked for.

use super::guard::{Handle, with};
use super::pointers::{copy_out, place, strided_mut, text};
use crate::error::Error;
use crate::model::fields;
use std::ffi::c_char;

/// A quantity of each particle, in the host's order; the catalogue "fields" lists them with their units. Vectors (x,
/// grad_T, flux, first_moment) have dim doubles per particle, all others one.
///
/// \param name   which
/// \param out    receives the values; particle i at out[i * stride]; doubles between are not touched
/// \param n      particles, as many as were set
/// \param stride doubles from one particle to the next
///
/// Errors: UNKNOWN_WORD, WRONG_COUNT, OUT_OF_ORDER naming what must be set first.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_get(s: *mut Handle, name: *const c_char, out: *mut f64, n: i64, stride: i64) -> i32 {
    unsafe {
        with(s, |inside| {
            let name = text("name", name)?;
            let components = if fields::field(name)?.vector { inside.solver.dim() } else { 1 };
            inside.solver.get(name, strided_mut("out", out, n, stride, components)?)
        })
    }
}

/// A number of the solver; the catalogue "numbers" lists them with their units.
///
/// \param name  which
/// \param value receives it
///
/// Errors: UNKNOWN_WORD, OUT_OF_ORDER.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_get_number(s: *mut Handle, name: *const c_char, value: *mut f64) -> i32 {
    unsafe {
        with(s, |inside| {
            let value = place("value", value)?;
            *value = inside.solver.get_number(text("name", name)?)?;
            Ok(())
        })
    }
}

/// Where the time went since the solver was created: the i-th pass (from 0), in the order in which they first ran.
///
/// \param i        which pass
/// \param name     receives its name
/// \param name_len bytes that fit there
/// \param seconds  receives its wall-clock time so far, s
///
/// Errors: BAD_VALUE when there are not so many.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_seconds(
    s: *mut Handle,
    i: i64,
    name: *mut c_char,
    name_len: i64,
    seconds: *mut f64,
) -> i32 {
    unsafe {
        with(s, |inside| {
            let place = place("seconds", seconds)?;
            let (passes, _) = inside.solver.spent();
            let found = usize::try_from(i).ok().and_then(|i| passes.get(i));
            let rule = format!("{} passes have run, counted from 0", passes.len());
            let (pass, spent) = found.ok_or_else(|| Error::bad("i", i, &rule))?;
            copy_out("name", name, name_len, pass)?;
            *place = *spent;
            Ok(())
        })
    }
}
