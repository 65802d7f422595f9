//! A file that grows beyond the limit of its process (`ulimit -f`) is an error of the write, and no signal's business: by
//! default that signal ends the process.

/// As long as it lives, this thread takes no SIGXFSZ, and none that a write has raised is left behind.
#[cfg(unix)]
pub struct Quiet {
    before: libc::sigset_t,
    /// One that was there before is the host's.
    pending: bool,
}

#[cfg(unix)]
impl Quiet {
    pub fn begin() -> Quiet {
        let (signals, mut before) = (the_signal(), empty());
        let pending = is_pending();
        // SAFETY: both sets are initialised, and ours.
        unsafe { libc::pthread_sigmask(libc::SIG_BLOCK, &signals, &mut before) };
        Quiet { before, pending }
    }
}

#[cfg(unix)]
impl Drop for Quiet {
    fn drop(&mut self) {
        let mut taken = 0;
        // SAFETY: the signal is blocked and pending, so that waiting for it returns at once.
        unsafe {
            if !self.pending && is_pending() {
                libc::sigwait(&the_signal(), &mut taken);
            }
            libc::pthread_sigmask(libc::SIG_SETMASK, &self.before, std::ptr::null_mut());
        }
    }
}

#[cfg(unix)]
fn empty() -> libc::sigset_t {
    let mut set = std::mem::MaybeUninit::uninit();
    // SAFETY: sigemptyset initialises it.
    unsafe {
        libc::sigemptyset(set.as_mut_ptr());
        set.assume_init()
    }
}

#[cfg(unix)]
fn the_signal() -> libc::sigset_t {
    let mut set = empty();
    // SAFETY: the set is initialised.
    unsafe { libc::sigaddset(&mut set, libc::SIGXFSZ) };
    set
}

#[cfg(unix)]
fn is_pending() -> bool {
    let mut set = empty();
    // SAFETY: the set is initialised.
    unsafe { libc::sigpending(&mut set) == 0 && libc::sigismember(&set, libc::SIGXFSZ) == 1 }
}

/// Other systems have no such signal.
#[cfg(not(unix))]
pub struct Quiet;

#[cfg(not(unix))]
impl Quiet {
    pub fn begin() -> Quiet {
        Quiet
    }
}
