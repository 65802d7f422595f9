//! What a host is told, and the pointer that goes with its functions.

use super::environment::restore_default;
use std::ffi::{CString, c_char, c_void};

/// The host's pointer, handed back to its own functions and not touched otherwise.
#[derive(Clone, Copy)]
pub struct User(pub *mut c_void);

// SAFETY: the host may call from any thread, so its functions must accept its pointer on any.
unsafe impl Send for User {}

impl User {
    pub fn get(self) -> *mut c_void {
        self.0
    }
}

/// A host's log function with its pointer.
pub struct Log {
    pub function: unsafe extern "C-unwind" fn(*mut c_void, i32, *const c_char),
    pub user: User,
}

impl Log {
    pub fn tell(&self, level: i32, text: &str) {
        // A damaged file's name for something may contain any character.
        if let Ok(text) = CString::new(text.replace('\0', " ")) {
            // SAFETY: the host's word.
            unsafe { (self.function)(self.user.get(), level, text.as_ptr()) };
            restore_default();
        }
    }
}
