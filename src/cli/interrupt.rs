//! Ctrl-C: the first asks the run to stop after its sub-step, the second ends the process.

use std::sync::atomic::{AtomicBool, Ordering};

static ASKED: AtomicBool = AtomicBool::new(false);

/// Whether the user wants the run to stop.
pub fn asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}

pub fn listen() {
    // SAFETY: the handler stores to an atomic and resets the signal, both allowed in a handler.
    unsafe { libc::signal(libc::SIGINT, heard as *const () as libc::sighandler_t) };
}

extern "C" fn heard(_: libc::c_int) {
    ASKED.store(true, Ordering::Relaxed);
    // SAFETY: as above.
    unsafe { libc::signal(libc::SIGINT, libc::SIG_DFL) };
}
