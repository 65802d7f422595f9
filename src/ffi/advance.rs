//! Step, and what a host that steps itself needs.

use super::codes::{DIFFUSPH_LOG_DEBUG, DIFFUSPH_LOG_INFO};
use super::guard::{Handle, Inside, with};
use super::pointers::{copy_out, place, room, strided_mut};
use super::report::{Place, Report};
use crate::error::{Error, Result};
use crate::solver::recommend;
use std::ffi::c_char;

/// Advances by exactly dt, in as many sub-steps as the method needs. Whatever goes wrong, the solver is as it was before.
///
/// \param dt     s, finite, not negative
/// \param report receives what was done; start with DIFFUSPH_REPORT_INIT; may be NULL
///
/// Errors: all codes above 0, OUT_OF_ORDER before T, m and kappa are set, BAD_VALUE, BOX_TOO_SMALL, NO_MEMORY.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_step(s: *mut Handle, dt: f64, report: *mut Report) -> i32 {
    unsafe {
        with(s, |inside| {
            let place = Place::new(report)?;
            let done = Report::from(inside.solver.step(dt)?);
            log_step(inside, &done)?;
            if let Some(place) = place {
                place.write(&done);
            }
            Ok(())
        })
    }
}

fn log_step(inside: &mut Inside, r: &Report) -> Result<()> {
    if inside.log.is_none() {
        return Ok(());
    }
    // The step is done: it is too late to cancel it.
    inside.solver.begin();
    let plan = inside.solver.plan()?.to_string();
    if plan != inside.logged_plan {
        inside.tell(DIFFUSPH_LOG_INFO, &plan);
        inside.logged_plan = plan;
    }
    let line = format!(
        "step to t = {:e} by {:e}: {} sub-steps of {} stages, {} applications, T from {:e} to {:e}, {:.3e} s",
        r.time, r.dt, r.substeps, r.stages, r.applications, r.T_min, r.T_max, r.seconds
    );
    inside.tell(DIFFUSPH_LOG_DEBUG, &line);
    Ok(())
}

/// Makes the call that is running now return CANCELLED, with nothing changed; one whose work is nearly done may end as it
/// would have. From any thread, also from a callback and from a signal handler; the solver must not be destroyed meanwhile.
/// Does nothing if none is running.
///
/// Errors: NULL_POINTER.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_cancel(s: *mut Handle) -> i32 {
    match unsafe { s.as_ref() } {
        Some(handle) => {
            handle.cancel();
            0
        }
        None => super::codes::DIFFUSPH_NULL_POINTER,
    }
}

/// The largest stable explicit Euler step now, s; infinite where nothing diffuses.
///
/// \param dt receives it
///
/// Errors: as diffusph_step.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_limit(s: *mut Handle, dt: *mut f64) -> i32 {
    unsafe {
        with(s, |inside| {
            let place = place("dt", dt)?;
            *place = inside.solver.limit()?;
            Ok(())
        })
    }
}

/// du/dt of each particle now, W/kg, for hosts that integrate themselves.
///
/// \param out    receives the values; particle i at out[i * stride]
/// \param n      particles, as many as were set
/// \param stride doubles from one particle to the next; 1 if packed
///
/// Errors: as diffusph_get.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_rate(s: *mut Handle, out: *mut f64, n: i64, stride: i64) -> i32 {
    unsafe { with(s, |inside| inside.solver.rate(strided_mut("out", out, n, stride, 1)?)) }
}

/// What a step will do, what it leaves out and why, with bytes and pair operations; for people to read.
///
/// \param buf    receives the text, cut where it does not fit; NULL if only its length is wanted
/// \param len    bytes that fit there
/// \param needed receives the bytes of the whole text with its NUL; may be NULL
///
/// Errors: OUT_OF_ORDER before diffusph_set_particles and masses.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_plan(s: *mut Handle, buf: *mut c_char, len: i64, needed: *mut i64) -> i32 {
    unsafe {
        with(s, |inside| {
            if buf.is_null() && needed.is_null() {
                return Err(Error::NullPointer { argument: "buf".into(), expected: "a buffer, or needed".into() });
            }
            let text = inside.solver.plan()?.to_string();
            if !buf.is_null() {
                copy_out("buf", buf, len, &text)?;
            }
            if !needed.is_null() {
                *place("needed", needed)? = text.len() as i64 + 1;
            }
            Ok(())
        })
    }
}

/// Which operator, kernel, h_fac and integrator reach an error cheapest on these particles, with T, kappa and all else as
/// they are now: many choices are tried on solvers of their own, which lasts as long as some hundred steps of dt. This
/// solver stays as it is. A given h is left aside, since h_fac is part of the choice; the progress callback is told the
/// share of choices tried, and callbacks of kappa and of the source are called for each.
///
/// \param wanted    the most that T may be wrong by after dt: sqrt(sum (T - known)^2 / sum (known - mean)^2)
/// \param dt        s, positive; a step that is typical for the host
/// \param words     receives what to create a solver with
/// \param words_len bytes that fit there
/// \param error     receives what that choice errs by, the doubt of the reference included: weights that are exact for
///                  polynomials of degree 6, or 4 where that fails
/// \param seconds   receives its wall-clock time from particles to answer, s: neighbours, weights, and a step of dt
///
/// Errors: OUT_OF_REACH naming the most accurate choice; BAD_VALUE, also for a tensor kappa, for which there is no
/// reference; CANCELLED; as diffusph_step.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_recommend(
    s: *mut Handle,
    wanted: f64,
    dt: f64,
    words: *mut c_char,
    words_len: i64,
    error: *mut f64,
    seconds: *mut f64,
) -> i32 {
    unsafe {
        with(s, |inside| {
            let (error, seconds) = (place("error", error)?, place("seconds", seconds)?);
            room("words", words, words_len)?;
            let found = recommend::recommend(&mut inside.solver, wanted, dt)?;
            copy_out("words", words, words_len, &found.words)?;
            (*error, *seconds) = (found.error, found.seconds);
            Ok(())
        })
    }
}
