//! The one door that every call goes through. It refuses NULL, a handle in use, a forked process and a broken solver; it
//! puts the host's floating-point environment aside; and it turns a panic into a code, silently.

use super::codes::{DIFFUSPH_LOG_ERROR, DIFFUSPH_LOG_WARNING};
use super::environment::Environment;
use super::log::Log;
use crate::error::{Error, Result};
use crate::solver::Solver;
use std::any::Any;
use std::cell::{Cell, UnsafeCell};
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Once};

/// A solver. Use it from any thread, one call at a time.
pub struct Handle {
    busy: AtomicBool,
    cancel: Arc<AtomicBool>,
    created_by: Process,
    inside: UnsafeCell<Inside>,
}

/// What a call that has come through the door works on.
pub struct Inside {
    pub solver: Solver,
    /// What the last call that failed had to say.
    pub message: String,
    pub log: Option<Log>,
    /// The plan as last logged.
    pub logged_plan: String,
    /// Why the solver is unusable.
    broken: Option<String>,
}

/// A process, told from the one that it was forked from also where both have the same number, as the first processes of
/// containers have.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Process {
    id: u32,
    /// How often a process has been forked on the way here.
    generation: u64,
}

impl Process {
    fn this() -> Process {
        static GENERATION: AtomicU64 = AtomicU64::new(0);
        static COUNTED: Once = Once::new();
        extern "C" fn count() {
            GENERATION.fetch_add(1, Ordering::Relaxed);
        }
        // SAFETY: the function does one atomic addition, which a forked child may do.
        COUNTED.call_once(|| _ = unsafe { libc::pthread_atfork(None, None, Some(count)) });
        Process { id: std::process::id(), generation: GENERATION.load(Ordering::Relaxed) }
    }
}

// SAFETY: `inside` is reached only by whoever has set `busy`.
unsafe impl Sync for Handle {}

impl Handle {
    pub fn new(solver: Solver) -> Handle {
        let cancel = solver.canceller();
        let inside = Inside { solver, message: String::new(), log: None, logged_plan: String::new(), broken: None };
        Handle { busy: AtomicBool::new(false), cancel, created_by: Process::this(), inside: UnsafeCell::new(inside) }
    }

    /// Stops the running call, if there is one; atomics and nothing else, so that signal handlers may do it.
    pub fn cancel(&self) {
        if self.busy.load(Ordering::Relaxed) {
            self.cancel.store(true, Ordering::Relaxed);
        }
    }

    /// Whether this process has the handle's threads.
    pub fn check_process(&self) -> Result<()> {
        let (created, now) = (self.created_by, Process::this());
        if created == now { Ok(()) } else { Err(Error::Forked { created: created.id, now: now.id }) }
    }

    /// Enters, unless another call is inside.
    pub fn enter(&self) -> Result<Entered<'_>> {
        match self.busy.swap(true, Ordering::Acquire) {
            true => Err(Error::Busy),
            false => {
                // What was cancelled was an earlier call.
                self.cancel.store(false, Ordering::Relaxed);
                Ok(Entered(self))
            }
        }
    }

    pub fn into_solver(self) -> Solver {
        self.inside.into_inner().solver
    }
}

/// The right to be inside; given back when dropped.
pub struct Entered<'a>(&'a Handle);

impl Entered<'_> {
    pub fn inside(&mut self) -> &mut Inside {
        // SAFETY: there is one `Entered` of a handle at a time, and this borrows it.
        unsafe { &mut *self.0.inside.get() }
    }
}

impl Drop for Entered<'_> {
    fn drop(&mut self) {
        self.0.busy.store(false, Ordering::Release);
    }
}

impl Inside {
    fn run(&mut self, work: impl FnOnce(&mut Inside) -> Result<()>) -> Result<()> {
        let result = match &self.broken {
            Some(reason) => Err(Error::Poisoned { reason: reason.clone() }),
            None => protected(|| work(self)),
        };
        if let Err(error) = &result {
            if let Error::Panic { reason } = error {
                self.broken = Some(reason.clone());
            }
            self.message = error.to_string();
            let level = if error.code() > 0 { DIFFUSPH_LOG_WARNING } else { DIFFUSPH_LOG_ERROR };
            // The host's function is the only thing that can go wrong here, and the call has failed already.
            let _ = protected(|| {
                self.tell(level, &self.message);
                Ok(())
            });
        }
        result
    }

    /// Hands a line to the host's log, if there is one.
    pub fn tell(&self, level: i32, text: &str) {
        if let Some(log) = &self.log {
            log.tell(level, text);
        }
    }
}

/// A call on a handle: all checks, then `work`; the status is the answer, the handle keeps the message.
///
/// # Safety
/// `s` is NULL or came from `diffusph_create` and was not destroyed.
pub unsafe fn with(s: *mut Handle, work: impl FnOnce(&mut Inside) -> Result<()>) -> i32 {
    // SAFETY: passed on to the caller.
    status(unsafe { open(s) }.and_then(|mut entered| entered.inside().run(work)))
}

/// A call without a handle.
pub fn alone(work: impl FnOnce() -> Result<()>) -> i32 {
    status(protected(work))
}

/// The door itself: not NULL, not forked, not busy.
///
/// # Safety
/// As [`with`].
pub unsafe fn open<'a>(s: *mut Handle) -> Result<Entered<'a>> {
    let null = || Error::NullPointer { argument: "s".into(), expected: "a solver from diffusph_create".into() };
    // SAFETY: passed on to the caller.
    let handle = unsafe { s.as_ref() }.ok_or_else(null)?;
    handle.check_process()?;
    handle.enter()
}

pub fn status(result: Result<()>) -> i32 {
    result.map_or_else(|error| error.code(), |()| 0)
}

/// Runs `work` in the default floating-point environment, and turns a panic into an error without printing it.
pub fn protected<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    silence_our_panics();
    let _environment = Environment::default_for_now();
    let outer = GUARDED.replace(true);
    let caught = catch_unwind(AssertUnwindSafe(work));
    GUARDED.set(outer);
    caught.unwrap_or_else(|payload| Err(Error::Panic { reason: reason(payload) }))
}

fn reason(payload: Box<dyn Any + Send>) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no reason given").to_string()
}

thread_local! {
    /// Whether this thread is inside a guarded call.
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Panics that a guarded call will catch print nothing; all others go where they went before. A Rust program that never
/// calls the C ABI keeps its hook untouched.
fn silence_our_panics() {
    static INSTALLED: Once = Once::new();
    if std::thread::panicking() {
        return; // the hook cannot be changed now
    }
    INSTALLED.call_once(|| {
        let previous = take_hook();
        set_hook(Box::new(move |info| {
            let worker = || std::thread::current().name().is_some_and(|name| name.starts_with("diffusph-"));
            if !GUARDED.get() && !worker() {
                previous(info);
            }
        }));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_a_code_and_the_solver_is_broken_from_then_on() {
        let mut handle = Handle::new(Solver::new("heat threads=2").unwrap());
        // SAFETY: the handle lives until the end of the test.
        let mut call = |work: &dyn Fn(&mut Inside)| unsafe {
            with(&mut handle, |inside| {
                work(inside);
                Ok(())
            })
        };
        assert_eq!(call(&|_| ()), 0);
        assert_eq!(call(&|_| panic!("number {}", 7)), -13);
        assert_eq!(call(&|_| ()), -11);
        let mut entered = handle.enter().unwrap();
        let text = &entered.inside().message;
        assert!(text.contains("number 7") && text.contains("destroy"), "{text}");
    }

    #[test]
    fn a_child_is_another_process_whatever_its_number() {
        let parent = Process::this();
        // SAFETY: the child compares two numbers and leaves.
        unsafe {
            let child = libc::fork();
            if child == 0 {
                libc::_exit(i32::from(Process { id: parent.id, ..Process::this() } == parent));
            }
            let mut status = 0;
            libc::waitpid(child, &mut status, 0);
            assert!(libc::WIFEXITED(status) && libc::WEXITSTATUS(status) == 0);
        }
        assert_eq!(Process::this(), parent);
    }

    #[test]
    fn a_handle_in_use_is_busy() {
        let mut handle = Handle::new(Solver::new("heat threads=1").unwrap());
        let s: *mut Handle = &mut handle;
        // SAFETY: the handle lives until the end of the test.
        unsafe {
            let entered = open(s).unwrap();
            assert_eq!(with(s, |_| Ok(())), -10);
            drop(entered);
            assert_eq!(with(s, |_| Ok(())), 0);
        }
    }
}
