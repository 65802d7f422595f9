//! Worker threads that belong to one solver: created with it, joined when it goes. Never rayon's global pool.
//!
//! All work is cut into fixed blocks whose results are combined in block order, so the number of threads never
//! changes a bit of a result.

use crate::error::{Error, Result};
use crate::memory;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, OnceLock};
use std::thread::JoinHandle;

/// Particles per block of parallel work. Fixed: results must not depend on the number of threads.
pub const BLOCK: usize = 1024;

/// Particles below which the caller's thread does alone what takes a few nanoseconds for each: to wake workers takes some
/// 20 µs. On two cores a compensated sum repays that from 20 blocks on, y += a x from 60.
pub const FEW: usize = 24 * BLOCK;

/// A result on its way from a worker: it is written by one thread and read by another, never shared.
struct Guarded<T>(T);

// SAFETY: nobody has a reference to a result before all workers are done.
unsafe impl<T: Send> Sync for Guarded<T> {}

pub struct Pool {
    threads: usize,
    workers: Option<rayon::ThreadPool>,
    handles: Handles,
    cancel: Arc<AtomicBool>,
}

type Handles = Arc<Mutex<Vec<JoinHandle<()>>>>;

impl Pool {
    /// `threads` workers; 0 means as many as this process may use (affinity and cgroups count) and the system starts. One
    /// thread makes no worker at all: the caller's thread does the work.
    ///
    /// # Errors
    /// `BadValue` where the system starts fewer than were asked for.
    pub fn new(threads: usize) -> Result<Pool> {
        Pool::starting(threads, spawn_workers)
    }

    fn starting(threads: usize, spawn: impl Fn(usize, &Handles) -> Result<rayon::ThreadPool>) -> Result<Pool> {
        let mut count = match threads {
            0 => std::thread::available_parallelism().map_or(1, |n| n.get()),
            n => n,
        };
        loop {
            let handles = Handles::default();
            if count <= 1 {
                return Ok(Pool { threads: 1, workers: None, handles, cancel: Arc::default() });
            }
            match spawn(count, &handles) {
                Ok(workers) => {
                    return Ok(Pool { threads: count, workers: Some(workers), handles, cancel: Arc::default() });
                }
                Err(e) => {
                    let started = join(&handles);
                    if threads > 0 {
                        return Err(e);
                    }
                    count = started.min(count - 1);
                }
            }
        }
    }

    pub fn threads(&self) -> usize {
        self.threads
    }

    /// Lets the same one cancel this pool's work as another's.
    pub fn obey(&mut self, cancel: Arc<AtomicBool>) {
        self.cancel = cancel;
    }

    /// Whoever sets it makes the work that runs here end with `Cancelled`.
    pub fn canceller(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.cancel)
    }

    /// Forgets that earlier work was cancelled.
    pub fn begin(&self) {
        self.cancel.store(false, Relaxed);
    }

    /// To be asked every few ten milliseconds.
    ///
    /// # Errors
    /// `Cancelled` where somebody wants no more of it.
    pub fn go_on(&self) -> Result<()> {
        if self.cancel.load(Relaxed) { Err(Error::Cancelled) } else { Ok(()) }
    }

    /// `f(0), f(1), … f(n - 1)` in any order of execution, results in order.
    pub fn map<T: Send>(&self, n: usize, f: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
        self.map_init(n, || (), |(), i| f(i))
    }

    /// As [`Pool::map`], with scratch space that a worker makes once and reuses.
    pub fn map_init<S: Send, T: Send>(
        &self,
        n: usize,
        init: impl Fn() -> S + Sync + Send,
        f: impl Fn(&mut S, usize) -> T + Sync + Send,
    ) -> Vec<T> {
        if self.workers.is_none() || n <= 1 {
            let mut scratch = init();
            return (0..n).map(|i| f(&mut scratch, i)).collect();
        }
        let results: Vec<OnceLock<Guarded<T>>> = (0..n).map(|_| OnceLock::new()).collect();
        let spare = Mutex::new(Vec::new());
        self.each(n, &|i| {
            let kept = spare.lock().ok().and_then(|mut list| list.pop());
            let mut scratch = kept.unwrap_or_else(&init);
            let _ = results[i].set(Guarded(f(&mut scratch, i)));
            if let Ok(mut list) = spare.lock() {
                list.push(scratch);
            }
        });
        results.into_iter().filter_map(OnceLock::into_inner).map(|r| r.0).collect()
    }

    /// Calls `f(start, chunk)` for consecutive chunks of `data`, `chunk` items long (the last may be shorter).
    pub fn chunks<T: Send>(&self, data: &mut [T], chunk: usize, f: impl Fn(usize, &mut [T]) + Sync + Send) {
        if self.workers.is_none() || data.len() <= chunk {
            return data.chunks_mut(chunk).enumerate().for_each(|(i, part)| f(i * chunk, part));
        }
        let parts: Vec<Mutex<&mut [T]>> = data.chunks_mut(chunk).map(Mutex::new).collect();
        self.each(parts.len(), &|i| {
            if let Ok(mut part) = parts[i].lock() {
                f(i * chunk, &mut part);
            }
        });
    }

    /// As [`Pool::chunks`] with blocks, for what is made once and takes its time.
    ///
    /// # Errors
    /// `Cancelled`; some of `data` is then as it was.
    pub fn make<T: Send>(&self, data: &mut [T], f: impl Fn(usize, &mut [T]) + Sync + Send) -> Result<()> {
        self.chunks(data, BLOCK, |start, part| {
            if self.go_on().is_ok() {
                f(start, part);
            }
        });
        self.go_on()
    }

    /// The one door to the workers: whatever is done for blocks, the code that shares them out is compiled once.
    fn each(&self, n: usize, work: &(dyn Fn(usize) + Sync)) {
        match &self.workers {
            Some(pool) => pool.install(|| (0..n).into_par_iter().for_each(work)),
            None => (0..n).for_each(work),
        }
    }

    /// As [`Pool::chunks`] with blocks, where each item takes a few nanoseconds: [`FEW`] are not shared out.
    pub fn update<T: Send>(&self, data: &mut [T], f: impl Fn(usize, &mut [T]) + Sync + Send) {
        if data.len() < FEW {
            data.chunks_mut(BLOCK).enumerate().for_each(|(b, part)| f(b * BLOCK, part));
        } else {
            self.chunks(data, BLOCK, f);
        }
    }

    /// Sorts with these workers and no others.
    ///
    /// # Errors
    /// `Cancelled`; the items are then in some order.
    pub fn sort<T: Send>(&self, data: &mut [T], compare: impl Fn(&T, &T) -> Ordering + Sync) -> Result<()> {
        // The only way out of a sort on the way is to unwind from a comparison, which prints nothing.
        let compare = |a: &T, b: &T| match self.cancel.load(Relaxed) {
            true => resume_unwind(Box::new(Error::Cancelled)),
            false => compare(a, b),
        };
        let sorted = catch_unwind(AssertUnwindSafe(|| match &self.workers {
            Some(pool) => pool.install(|| data.par_sort_unstable_by(compare)),
            None => data.sort_unstable_by(compare),
        }));
        sorted.or_else(|payload| match payload.downcast::<Error>() {
            Ok(error) => Err(*error),
            Err(other) => resume_unwind(other),
        })
    }

    /// Forgets the workers without joining: in a forked child they do not exist.
    pub fn abandon(self) {
        std::mem::forget(self);
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        // Dropping rayon's pool only tells its threads to stop; a host that unloads the library needs them gone.
        self.workers = None;
        join(&self.handles);
    }
}

/// Waits for workers that have been told to stop; how many there were.
fn join(handles: &Handles) -> usize {
    let handles = handles.lock().map(|mut h| std::mem::take(&mut *h)).unwrap_or_default();
    handles.into_iter().map(JoinHandle::join).count()
}

/// What a worker takes beside its stack until it waits for work, generously, in bytes.
const WORKER: usize = 1 << 17;

/// The stack of a worker, in bytes: the environment (RUST_MIN_STACK) has no say.
const STACK: usize = 2 << 20;

/// Workers that run: all that they need to begin is there when this returns.
fn spawn_workers(threads: usize, handles: &Handles) -> Result<rayon::ThreadPool> {
    // Where a few bytes for a thread are missing, those who make it end the process: see whether there are some.
    drop(memory::reserved::<u8>("worker threads", threads.saturating_mul(WORKER))?);
    let kept = Arc::clone(handles);
    let workers = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .spawn_handler(move |thread| {
            let name = format!("diffusph-{}", thread.index());
            let handle = std::thread::Builder::new().name(name).stack_size(STACK).spawn(|| thread.run())?;
            if let Ok(mut list) = kept.lock() {
                list.push(handle);
            }
            Ok(())
        })
        .build()
        .map_err(|e| {
            Error::bad("threads", threads, &format!("the system would not start them ({e}); ask for fewer"))
        })?;
    workers.broadcast(|_| ());
    Ok(workers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_order_for_any_number_of_threads() {
        for threads in [1, 2, 5] {
            let pool = Pool::new(threads).unwrap();
            assert_eq!(pool.map(1000, |i| i * i), (0..1000).map(|i| i * i).collect::<Vec<_>>());
            let mut data = vec![0usize; 5000];
            pool.chunks(&mut data, BLOCK, |start, part| part.iter_mut().enumerate().for_each(|(i, x)| *x = start + i));
            assert!(data.iter().enumerate().all(|(i, &x)| i == x));
        }
    }

    #[test]
    fn without_a_number_fewer_threads_will_do() {
        let at_most = |most: usize| {
            move |count: usize, handles: &Handles| match count <= most {
                true => spawn_workers(count, handles),
                false => {
                    // As many as start; they end at once.
                    (0..most).for_each(|_| handles.lock().unwrap().push(std::thread::spawn(|| ())));
                    Err(Error::bad("threads", count, "too many"))
                }
            }
        };
        let usable = std::thread::available_parallelism().map_or(1, |n| n.get());
        for most in [0, 1, 2] {
            let pool = Pool::starting(0, at_most(most)).unwrap();
            assert_eq!(pool.threads(), most.clamp(1, usable));
            assert_eq!(pool.map(9, |i| i), (0..9).collect::<Vec<_>>());
        }
        assert!(Pool::starting(3, at_most(2)).is_err() && Pool::starting(2, at_most(2)).is_ok());
    }

    #[test]
    fn sorting_can_be_cancelled() {
        for threads in [1, 3] {
            let pool = Pool::new(threads).unwrap();
            let mut data: Vec<u64> = (0..100_000).map(|i| i * 2_654_435_761 % 100_003).collect();
            let cancel = pool.canceller();
            let done = pool.sort(&mut data, |a, b| {
                cancel.store(*a == 7 || cancel.load(Relaxed), Relaxed);
                a.cmp(b)
            });
            assert!(done == Err(Error::Cancelled) && !data.is_sorted());
            pool.begin();
            pool.sort(&mut data, u64::cmp).unwrap();
            assert!(data.is_sorted());
            let panics = AssertUnwindSafe(|| pool.sort(&mut [3, 1, 2], |_, _| resume_unwind(Box::new("ours"))));
            assert!(catch_unwind(panics).is_err());
        }
    }

    #[test]
    fn workers_are_gone_after_drop() {
        let workers = || {
            let tasks = std::fs::read_dir("/proc/self/task").unwrap();
            tasks
                .filter_map(|t| std::fs::read_to_string(t.ok()?.path().join("comm")).ok())
                .filter(|c| c.starts_with("diffusph-9"))
                .count()
        };
        // The tenth worker's name is this test's alone: other tests in this process use fewer threads.
        let pool = Pool::new(10).unwrap();
        // A worker names itself when it starts to run: let each do something first.
        pool.workers.as_ref().unwrap().broadcast(|_| ());
        assert_eq!(workers(), 1);
        drop(pool);
        assert_eq!(workers(), 0);
    }
}
