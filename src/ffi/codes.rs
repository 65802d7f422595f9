//! Numbers that C knows by name. A number is never given a second meaning.

/// Done.
pub const DIFFUSPH_DONE: i32 = 0;
/// The step needs more work than max_applications allows.
pub const DIFFUSPH_STEP_TOO_LARGE: i32 = 1;
/// A value became infinite or not a number.
pub const DIFFUSPH_NOT_FINITE: i32 = 2;
/// A value left the bounds that the method keeps.
pub const DIFFUSPH_OUT_OF_BOUNDS: i32 = 3;
/// T grew where nothing heats: the operator has growing modes on these particles.
pub const DIFFUSPH_GROWTH: i32 = 4;
/// Stopped by diffusph_cancel or by the progress callback.
pub const DIFFUSPH_CANCELLED: i32 = 5;
/// An iteration did not converge.
pub const DIFFUSPH_NOT_CONVERGED: i32 = 6;
/// A callback of the host answered with a code other than 0.
pub const DIFFUSPH_CALLBACK_FAILED: i32 = 7;
/// No choice is known to be as accurate as was asked for.
pub const DIFFUSPH_OUT_OF_REACH: i32 = 8;
/// A pointer that must not be NULL is.
pub const DIFFUSPH_NULL_POINTER: i32 = -1;
/// An argument, or an element of an array, has no meaning.
pub const DIFFUSPH_BAD_VALUE: i32 = -2;
/// An array has another number of values than is needed.
pub const DIFFUSPH_WRONG_COUNT: i32 = -3;
/// Something must be set first.
pub const DIFFUSPH_OUT_OF_ORDER: i32 = -4;
/// A name that does not exist; the message lists those that do.
pub const DIFFUSPH_UNKNOWN_WORD: i32 = -5;
/// Supports reach around the periodic box too often.
pub const DIFFUSPH_BOX_TOO_SMALL: i32 = -6;
/// The system refused to read or write a file.
pub const DIFFUSPH_IO: i32 = -7;
/// The content of a file is wrong.
pub const DIFFUSPH_BAD_FILE: i32 = -8;
/// Not enough memory.
pub const DIFFUSPH_NO_MEMORY: i32 = -9;
/// Another call is using this solver now.
pub const DIFFUSPH_BUSY: i32 = -10;
/// An earlier call returned DIFFUSPH_PANIC; the solver can only be destroyed.
pub const DIFFUSPH_POISONED: i32 = -11;
/// The process was forked after the solver was created; the child can only destroy it.
pub const DIFFUSPH_FORKED: i32 = -12;
/// A defect of the library; the solver can only be destroyed.
pub const DIFFUSPH_PANIC: i32 = -13;

/// A call failed, and the call was wrong.
pub const DIFFUSPH_LOG_ERROR: i32 = 1;
/// A call failed, and can be tried again with less.
pub const DIFFUSPH_LOG_WARNING: i32 = 2;
/// The plan, before the first step and whenever it has changed.
pub const DIFFUSPH_LOG_INFO: i32 = 3;
/// A line about each step.
pub const DIFFUSPH_LOG_DEBUG: i32 = 4;

pub const DIFFUSPH_VERSION_MAJOR: i32 = 0;
pub const DIFFUSPH_VERSION_MINOR: i32 = 1;
pub const DIFFUSPH_VERSION_PATCH: i32 = 0;
/// The version that this header belongs to, as diffusph_version_number answers for the library.
pub const DIFFUSPH_VERSION_NUMBER: i32 =
    DIFFUSPH_VERSION_MAJOR * 10000 + DIFFUSPH_VERSION_MINOR * 100 + DIFFUSPH_VERSION_PATCH;
/// Grows when a host that was compiled with an older header would no longer work; see diffusph_abi_version.
pub const DIFFUSPH_ABI: i32 = 1;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_is_the_package_s() {
        let parts = [DIFFUSPH_VERSION_MAJOR, DIFFUSPH_VERSION_MINOR, DIFFUSPH_VERSION_PATCH];
        assert_eq!(parts.map(|p| p.to_string()).join("."), env!("CARGO_PKG_VERSION"));
    }
}
