//! Functions that a host lends. They run on the thread of the call, never on a worker.

use super::environment::restore_default;
use super::guard::{Handle, with};
use super::log::{Log, User};
use crate::model::heat;
use std::ffi::{c_char, c_void};

/// Fills `out` for the temperatures `T`: kappa in W/(m K), or heat released per volume in W/m^3. The arrays are in the
/// solver's order; `particle[k]` is the host's number (from 0) of the k-th value. An answer other than 0 makes the call
/// fail with CALLBACK_FAILED.
#[allow(non_snake_case)]
pub type FieldCallback = Option<
    unsafe extern "C-unwind" fn(
        user: *mut c_void,
        time: f64,
        n: i64,
        particle: *const u32,
        T: *const f64,
        out: *mut f64,
    ) -> i32,
>;

/// Told between sub-steps which time is reached and which share (0 to 1) of the step is done. An answer other than 0
/// cancels the step.
pub type ProgressCallback = Option<unsafe extern "C-unwind" fn(user: *mut c_void, time: f64, share: f64) -> i32>;

/// Told what happens, at a level DIFFUSPH_LOG_*. The text lives until the callback returns.
pub type LogCallback = Option<unsafe extern "C-unwind" fn(user: *mut c_void, level: i32, text: *const c_char)>;

fn field(callback: FieldCallback, user: *mut c_void) -> Option<heat::Callback> {
    let (function, user) = (callback?, User(user));
    Some(Box::new(move |time, host: &[u32], t: &[f64], out: &mut [f64]| {
        // SAFETY: the slices are as long as is said; the rest is the host's word.
        let answer = unsafe { function(user.get(), time, t.len() as i64, host.as_ptr(), t.as_ptr(), out.as_mut_ptr()) };
        restore_default();
        answer
    }))
}

/// Conductivity as a function of the host; NULL takes it away. It is called for every stage, with `user`.
///
/// # Safety
/// The header's conventions; `user` is valid as long as the callback is set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_set_kappa_callback(
    s: *mut Handle,
    callback: FieldCallback,
    user: *mut c_void,
) -> i32 {
    unsafe {
        with(s, |inside| {
            inside.solver.set_kappa_callback(field(callback, user));
            Ok(())
        })
    }
}

/// Heat released per volume as a function of the host, in place of the field "source"; NULL takes it away, and so does
/// setting "source". It is called for every stage, with `user`, and at `looks=8` times of each step besides: where it changes
/// between stages, sub-steps are taken so short that it is followed. What is on for less than an eighth of a step may be
/// missed: take shorter steps, or more looks.
///
/// # Safety
/// As diffusph_set_kappa_callback.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_set_source_callback(
    s: *mut Handle,
    callback: FieldCallback,
    user: *mut c_void,
) -> i32 {
    unsafe {
        with(s, |inside| {
            inside.solver.set_source_callback(field(callback, user));
            Ok(())
        })
    }
}

/// A function told how far a step is, which can cancel it; NULL takes it away.
///
/// # Safety
/// As diffusph_set_kappa_callback.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_set_progress_callback(
    s: *mut Handle,
    callback: ProgressCallback,
    user: *mut c_void,
) -> i32 {
    let user = User(user);
    unsafe {
        with(s, |inside| {
            inside.solver.set_progress_callback(callback.map(|function| {
                Box::new(move |time, share| {
                    // SAFETY: the host's word.
                    let answer = function(user.get(), time, share);
                    restore_default();
                    answer
                }) as _
            }));
            Ok(())
        })
    }
}

/// A function told of failed calls, of what a file has that is not taken, of the plan when it changes, and of each step; NULL takes it away. Without it,
/// nothing is told: the library prints nothing.
///
/// # Safety
/// As diffusph_set_kappa_callback.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_set_log_callback(s: *mut Handle, callback: LogCallback, user: *mut c_void) -> i32 {
    unsafe {
        with(s, |inside| {
            inside.log = callback.map(|function| Log { function, user: User(user) });
            inside.logged_plan.clear();
            Ok(())
        })
    }
}
