//! Create, destroy, and what went wrong.

use super::guard::{Handle, alone, open, protected, status, with};
use super::pointers::{copy_out, place, text};
use crate::solver::Solver;
use std::ffi::c_char;

/// Creates a solver from words like "heat dim=3 kernel=M6 operator=brookshaw integrator=rkl2"; the catalogue "words"
/// lists them all. Worker threads are started now (as many as the process may use; the word threads= says otherwise)
/// and are joined by diffusph_destroy.
///
/// \param words   what to create
/// \param s       receives the solver
/// \param why     receives the message on failure; may be NULL
/// \param why_len bytes that fit there
///
/// Errors: UNKNOWN_WORD with the nearest known word, BAD_VALUE, NULL_POINTER.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_create(
    words: *const c_char,
    s: *mut *mut Handle,
    why: *mut c_char,
    why_len: i64,
) -> i32 {
    let made = protected(|| unsafe {
        let s = place("s", s)?;
        *s = Box::into_raw(Box::new(Handle::new(Solver::new(text("words", words)?)?)));
        Ok(())
    });
    if let Err(error) = &made
        && !why.is_null()
    {
        // A buffer without room is no reason to fail in another way.
        let _ = unsafe { copy_out("why", why, why_len, &error.to_string()) };
    }
    status(made)
}

/// Destroys a solver; its threads are gone when this returns. NULL is fine. In a forked child it frees what can be
/// freed and waits for nothing.
///
/// Errors: BUSY while another call uses the solver; it lives on then.
///
/// # Safety
/// The header's conventions; the solver is not used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_destroy(s: *mut Handle) -> i32 {
    let Some(handle) = (unsafe { s.as_ref() }) else { return 0 };
    alone(|| {
        // Nobody enters any more: the way in is kept.
        let entered = handle.enter().map(std::mem::forget);
        let forked = handle.check_process().is_err();
        match (entered, forked) {
            (Ok(()), false) => drop(unsafe { Box::from_raw(s) }),
            (Ok(()), true) => unsafe { Box::from_raw(s) }.into_solver().abandon(),
            // Forked in the middle of a call: nothing inside can be trusted to be whole.
            (Err(_), true) => {}
            (Err(busy), false) => return Err(busy),
        }
        Ok(())
    })
}

/// What the last failed call on this solver had to say: which argument, which index, which value, and what to do.
/// Empty if none has failed. Where the solver cannot be asked (NULL, BUSY, FORKED), the text says that, and so does
/// the status.
///
/// \param buf receives the text, cut where it does not fit
/// \param len bytes that fit there
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_message(s: *mut Handle, buf: *mut c_char, len: i64) -> i32 {
    alone(|| match unsafe { open(s) } {
        Ok(mut entered) => unsafe { copy_out("buf", buf, len, &entered.inside().message) },
        Err(error) => {
            unsafe { copy_out("buf", buf, len, &error.to_string()) }?;
            Err(error)
        }
    })
}

/// The number of particles; 0 before diffusph_set_particles.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_particles(s: *mut Handle, n: *mut i64) -> i32 {
    unsafe {
        with(s, |inside| {
            *place("n", n)? = inside.solver.len() as i64;
            Ok(())
        })
    }
}

/// The number of dimensions: 1, 2 or 3, as created.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_dimensions(s: *mut Handle, dim: *mut i64) -> i32 {
    unsafe {
        with(s, |inside| {
            *place("dim", dim)? = inside.solver.dim() as i64;
            Ok(())
        })
    }
}
