//! The host's floating-point environment. Hosts run with traps (`gfortran -ffpe-trap`) or with subnormals flushed
//! (`-ffast-math`): the compiler may compute both sides of a condition and divide by zero on the side that is not
//! taken, which a trap makes fatal, and flushed subnormals change results.

/// Puts the default environment in place and the host's back when dropped. Threads started meanwhile have the default.
pub struct Environment(imp::Saved);

impl Environment {
    pub fn default_for_now() -> Environment {
        Environment(imp::save_and_reset())
    }
}

/// Puts the default environment in place again, after a function of the host that may have left another.
pub fn restore_default() {
    imp::save_and_reset();
}

impl Drop for Environment {
    fn drop(&mut self) {
        imp::restore(&self.0);
    }
}

#[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
mod imp {
    /// `fenv_t`: 32 bytes on x86-64, 8 on aarch64; room to spare.
    #[repr(C, align(16))]
    pub struct Saved([u64; 8]);

    unsafe extern "C" {
        fn fegetenv(into: *mut Saved) -> i32;
        fn fesetenv(from: *const Saved) -> i32;
    }

    /// `FE_DFL_ENV` of glibc and musl on both architectures.
    const DEFAULT: *const Saved = usize::MAX as *const Saved;

    pub fn save_and_reset() -> Saved {
        let mut saved = Saved([0; 8]);
        // SAFETY: the buffer holds any fenv_t; the second pointer is the C library's name for the default.
        unsafe {
            fegetenv(&mut saved);
            fesetenv(DEFAULT);
        }
        saved
    }

    pub fn restore(saved: &Saved) {
        // SAFETY: filled by fegetenv on this thread.
        unsafe { fesetenv(saved) };
    }
}

#[cfg(not(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64"))))]
mod imp {
    /// The layout of `fenv_t` and the value of `FE_DFL_ENV` are not known here: the host's environment stays.
    pub struct Saved;

    pub fn save_and_reset() -> Saved {
        Saved
    }

    pub fn restore(_: &Saved) {}
}
