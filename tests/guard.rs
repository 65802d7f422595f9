//! What every function of the C ABI answers when its solver cannot be used, and what it leaves alone: the host's threads,
//! floating-point environment, output and forked children.

mod common;

use common::header;
use common::host::{Host, LEN, N, c, created, message, user};
use diffusph::ffi::*;
use std::collections::BTreeSet;
use std::ffi::{c_char, c_void};
use std::process::Command;
use std::ptr::null_mut;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Barrier, Mutex};

fn codes(calls: &[(&'static str, i32)]) -> BTreeSet<i32> {
    calls.iter().map(|(_, code)| *code).collect()
}

#[test]
fn every_function_works_and_answers_null() {
    let mut host = Host::ready("heat dim=2 threads=1");
    let calls = host.every_call(host.s);
    assert_eq!(codes(&calls), [0].into(), "{calls:?} {}", message(host.s));
    let calls = host.every_call(null_mut());
    assert_eq!(codes(&calls), [-1].into(), "{calls:?}");
    // SAFETY: NULL is to be answered.
    assert_eq!(unsafe { (diffusph_cancel(null_mut()), diffusph_destroy(null_mut())) }, (-1, 0));

    let mut covered: BTreeSet<&str> = calls.iter().map(|(name, _)| *name).collect();
    covered.extend(["diffusph_cancel", "diffusph_destroy"]);
    let functions = header::functions();
    let of_a_solver = functions.iter().filter(|f| f.arguments.first().is_some_and(|a| a.kind == "diffusph_solver *"));
    assert_eq!(covered, of_a_solver.map(|f| f.name.as_str()).collect());
}

/// Holds the step in its first callback until the test has looked at the solver from outside.
struct Gate {
    inside: Barrier,
    looked: Barrier,
    passed: AtomicBool,
}

#[allow(non_snake_case)]
unsafe extern "C-unwind" fn waits(
    gate: *mut c_void,
    _: f64,
    n: i64,
    _: *const u32,
    _: *const f64,
    out: *mut f64,
) -> i32 {
    // SAFETY: the library's word, and the test's.
    let (gate, out) = unsafe { (&*gate.cast::<Gate>(), std::slice::from_raw_parts_mut(out, n as usize)) };
    if !gate.passed.swap(true, Ordering::SeqCst) {
        gate.inside.wait();
        gate.looked.wait();
    }
    out.fill(1.0);
    0
}

#[test]
fn a_second_thread_finds_it_busy_and_can_cancel() {
    let mut host = Host::ready("heat dim=2 threads=2");
    let before = host.state();
    let gate = Gate { inside: Barrier::new(2), looked: Barrier::new(2), passed: AtomicBool::new(false) };
    // SAFETY: the gate outlives the step.
    assert_eq!(unsafe { diffusph_set_kappa_callback(host.s, Some(waits), user(&gate)) }, 0);
    let s = host.s as usize;
    // SAFETY: the solver lives until the end of the test.
    let step = std::thread::spawn(move || unsafe { diffusph_step(s as *mut Handle, 1e-2, null_mut()) });
    gate.inside.wait();
    let calls = host.every_call(host.s);
    assert_eq!(codes(&calls), [-10].into(), "{calls:?}");
    assert!(message(host.s).contains("busy"));
    // SAFETY: destroy must refuse a solver in use.
    assert_eq!(unsafe { (diffusph_destroy(host.s), diffusph_cancel(host.s)) }, (-10, 0));
    gate.looked.wait();
    assert_eq!(step.join().unwrap(), 5);
    assert!(message(host.s).contains("cancelled"));
    // SAFETY: as above. The callback goes, and everything is as it was.
    unsafe {
        assert_eq!(diffusph_set_kappa_callback(host.s, None, null_mut()), 0);
        assert_eq!(diffusph_set_number(host.s, c("kappa"), 1.0), 0);
    }
    assert!(host.state() == before);
}

unsafe extern "C-unwind" fn panics(_: *mut c_void, _: f64, _: i64, _: *const u32, _: *const f64, _: *mut f64) -> i32 {
    panic!("the callback gave up");
}

unsafe extern "C-unwind" fn log_panics(_: *mut c_void, _: i32, _: *const c_char) {
    panic!("and so did the log");
}

#[test]
fn after_a_panic_only_destroy_is_left() {
    for threads in [1, 2] {
        let mut host = Host::ready(&format!("heat dim=2 threads={threads}"));
        // SAFETY: all places are ours.
        unsafe {
            assert_eq!(diffusph_set_kappa_callback(host.s, Some(panics), null_mut()), 0);
            assert_eq!(diffusph_set_log_callback(host.s, Some(log_panics), null_mut()), 0);
            assert_eq!(diffusph_step(host.s, 1e-3, null_mut()), -13);
        }
        assert!(message(host.s).contains("the callback gave up"), "{}", message(host.s));
        let calls = host.every_call(host.s);
        // The message can still be had.
        assert!(
            calls.iter().all(|(name, code)| *code == if *name == "diffusph_message" { 0 } else { -11 }),
            "{calls:?}"
        );
        assert!(message(host.s).contains("the callback gave up") && message(host.s).contains("destroy"));
    }
}

/// Runs `work` in a forked child that is killed if it hangs; whether it answered true.
fn in_a_child(work: impl FnOnce() -> bool) -> bool {
    // What the library does once in a process is done: no other thread is in the middle of it when this one forks.
    unsafe { diffusph_version([0].as_mut_ptr(), 1) };
    // SAFETY: the child does its work and leaves without returning into the test harness.
    unsafe {
        let child = libc::fork();
        if child == 0 {
            libc::alarm(20);
            libc::_exit(if work() { 0 } else { 1 });
        }
        let mut status = 0;
        libc::waitpid(child, &mut status, 0);
        libc::WIFEXITED(status) && libc::WEXITSTATUS(status) == 0
    }
}

#[test]
fn a_forked_child_is_told_and_does_not_hang() {
    let mut host = Host::ready("heat dim=2 threads=2");
    assert!(in_a_child(|| {
        let forked = codes(&host.every_call(host.s)) == [-12].into() && message(host.s).contains("forked");
        // SAFETY: the child's copy is not used afterwards.
        let destroyed = unsafe { diffusph_destroy(host.s) } == 0;
        let mut own = Host::ready("heat dim=2 threads=2");
        forked && destroyed && codes(&own.every_call(own.s)) == [0].into()
    }));
    assert!(!in_a_child(|| false) && !in_a_child(|| std::process::abort()), "a control");
    assert_eq!(codes(&host.every_call(host.s)), [0].into());
}

#[test]
fn a_disk_that_fills_up_leaves_the_old_file() {
    assert!(in_a_child(|| {
        let host = Host::ready("heat dim=2 threads=1");
        let write = || unsafe { diffusph_write_vtk(host.s, host.path("a.vtu")) };
        let file = host.dir.path().join("a.vtu");
        let (first, old) = (write(), std::fs::read(&file).unwrap_or_default());
        no_file_may_grow_beyond(100);
        let whole = files(&host) == 1;
        let second = write();
        let same = std::fs::read(&file).is_ok_and(|now| now == old && now.len() > 100);
        let alone = files(&host) == 1;
        first == 0 && second == -7 && message(host.s).contains("a.vtu: cannot write") && whole && same && alone
    }));
}

#[test]
fn a_disk_with_room_for_a_snapshot_but_not_for_its_list_gets_neither() {
    assert!(in_a_child(|| {
        let host = Host::ready("heat dim=2 threads=1");
        let list = host.dir.path().join("run.pvd");
        let write = || unsafe { diffusph_write_series(host.s, host.path("run.pvd")) };
        // SAFETY: the string is ours.
        let listed = unsafe { diffusph_write_vtk(host.s, host.path("a.vtu")) };
        let entries: String =
            (0..999).map(|i| format!("<DataSet timestep=\"{}\" file=\"a.vtu\"/>\n", i - 1000)).collect();
        let text = format!("<VTKFile type=\"Collection\"><Collection>{entries}</Collection></VTKFile>");
        std::fs::write(&list, &text).unwrap();
        no_file_may_grow_beyond(30_000);
        let code = write();
        let same = std::fs::read_to_string(&list).is_ok_and(|now| now == text);
        listed == 0 && code == -7 && message(host.s).contains("run.pvd: cannot write") && same && files(&host) == 2
    }));
}

fn files(host: &Host) -> usize {
    std::fs::read_dir(host.dir.path()).map_or(0, |files| files.count())
}

/// From here on, for this process.
fn no_file_may_grow_beyond(bytes: u64) {
    let most = libc::rlimit { rlim_cur: bytes, rlim_max: bytes };
    // SAFETY: plain system calls.
    unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
        libc::setrlimit(libc::RLIMIT_FSIZE, &most);
    }
}

fn workers() -> usize {
    let tasks = std::fs::read_dir("/proc/self/task").unwrap();
    let names = tasks.filter_map(|t| std::fs::read_to_string(t.ok()?.path().join("comm")).ok());
    names.filter(|name| name.trim_end() == "diffusph-8").count()
}

#[test]
fn threads_are_gone_after_destroy() {
    // No other test here has a ninth worker.
    let s = created("heat threads=9");
    let start = std::time::Instant::now();
    while workers() == 0 && start.elapsed().as_secs() < 10 {
        std::thread::yield_now();
    }
    assert_eq!(workers(), 1);
    // SAFETY: made above.
    assert_eq!(unsafe { diffusph_destroy(s) }, 0);
    assert_eq!(workers(), 0);
}

#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
mod environment {
    use super::*;

    unsafe extern "C" {
        fn feenableexcept(traps: i32) -> i32;
        fn fedisableexcept(traps: i32) -> i32;
        fn fegetexcept() -> i32;
        fn fesetround(mode: i32) -> i32;
        fn fegetround() -> i32;
    }

    /// FE_INVALID, FE_DIVBYZERO and FE_OVERFLOW of x86.
    const TRAPS: i32 = 0x01 | 0x04 | 0x08;
    const UPWARD: i32 = 0x800;

    unsafe extern "C-unwind" fn looks(seen: *mut c_void, _: i32, _: *const c_char) {
        // SAFETY: the test's word.
        unsafe { (*seen.cast::<Mutex<Vec<i32>>>()).lock().unwrap().push(fegetexcept()) };
    }

    unsafe extern "C-unwind" fn halves(
        _: *mut c_void,
        _: f64,
        n: i64,
        _: *const u32,
        t: *const f64,
        out: *mut f64,
    ) -> i32 {
        // SAFETY: the library's word.
        (0..n as usize).for_each(|i| unsafe { *out.add(i) = -0.5 * *t.add(i) });
        0
    }

    unsafe extern "C-unwind" fn halves_and_rounds(
        user: *mut c_void,
        time: f64,
        n: i64,
        particle: *const u32,
        t: *const f64,
        out: *mut f64,
    ) -> i32 {
        // SAFETY: the library's word.
        let answer = unsafe { halves(user, time, n, particle, t, out) };
        unsafe { fesetround(UPWARD) };
        answer
    }

    #[test]
    fn what_a_callback_leaves_of_the_environment_changes_nothing() {
        let temperatures = |callback: FieldCallback| {
            let host = Host::ready("heat dim=2 threads=1");
            // SAFETY: the callback uses nothing of the host's.
            assert_eq!(unsafe { diffusph_set_source_callback(host.s, callback, null_mut()) }, 0);
            steps(&host)
        };
        let usual = temperatures(Some(halves));
        assert!(usual == temperatures(Some(halves_and_rounds)));
        assert!(usual != temperatures(None), "a control");
        // SAFETY: this thread's own environment.
        assert_eq!(unsafe { fegetround() }, 0);
    }

    fn steps(host: &Host) -> Vec<Result<Vec<u64>, i32>> {
        // SAFETY: the places are the host's.
        assert_eq!(unsafe { diffusph_step(host.s, 1e-2, null_mut()) }, 0);
        let nan = [f64::NAN; N];
        // SAFETY: as above; a mistake, whose check compares NaNs and so would trap.
        assert_eq!(unsafe { diffusph_set(host.s, c("T"), nan.as_ptr(), LEN, 1) }, -2);
        host.state()
    }

    #[test]
    fn traps_and_rounding_of_the_host_are_put_aside_and_come_back() {
        let usual = steps(&Host::ready("heat dim=2 threads=2"));
        let seen = Mutex::new(Vec::<i32>::new());
        // SAFETY: this thread's own environment, restored below.
        unsafe {
            feenableexcept(TRAPS);
            fesetround(UPWARD);
        }
        // Created here: its workers must not inherit the environment.
        let host = Host::ready("heat dim=2 threads=2");
        // SAFETY: `seen` outlives the solver's use of it.
        assert_eq!(unsafe { diffusph_set_log_callback(host.s, Some(looks), user(&seen)) }, 0);
        let trapped = steps(&host);
        // SAFETY: as above.
        let (traps, rounding) = unsafe { (fegetexcept(), fegetround()) };
        unsafe {
            fedisableexcept(TRAPS);
            fesetround(0);
            diffusph_set_log_callback(host.s, None, null_mut());
        }
        assert_eq!((traps, rounding), (TRAPS, UPWARD));
        assert!(trapped == usual, "the host's rounding changed results");
        let seen = seen.lock().unwrap();
        assert!(!seen.is_empty() && seen.iter().all(|traps| *traps == 0), "{seen:?}");
    }
}

#[test]
fn a_refused_solver_leaves_no_threads_and_says_why() {
    let (mut s, mut why) = (null_mut(), [0 as c_char; 200]);
    // No other test here has a tenth worker.
    for words in
        ["heat threads=10 kernel=M9", "heat threads=10 dim=4", "heat threads=10 h_fac=-1", "heat threads=10 x=1"]
    {
        // SAFETY: the places are ours.
        assert!(unsafe { diffusph_create(c(words), &mut s, why.as_mut_ptr(), 200) } < 0 && s.is_null());
        assert_ne!(why[0], 0, "{words}");
        let tasks = std::fs::read_dir("/proc/self/task").unwrap();
        let names = tasks.filter_map(|t| std::fs::read_to_string(t.ok()?.path().join("comm")).ok());
        assert_eq!(names.filter(|name| name.trim_end() == "diffusph-9").count(), 0, "{words}");
    }
}

#[test]
fn cancel_stops_what_runs_and_nothing_else() {
    let host = Host::ready("heat dim=2 threads=2 integrator=euler");
    let mut limit = 0.0;
    // SAFETY: the place is ours.
    assert_eq!(unsafe { diffusph_limit(host.s, &mut limit) }, 0);
    // Long enough to be stopped on the way, and never from where nothing is left to do.
    let step = || unsafe {
        assert_eq!(diffusph_set(host.s, c("T"), host.values.as_ptr(), LEN, 1), 0);
        diffusph_step(host.s, 50.0 * limit, null_mut())
    };
    // SAFETY: the solver is the host's.
    assert_eq!(unsafe { diffusph_cancel(host.s) }, 0);
    assert_eq!(step(), 0, "nothing ran when it was cancelled");
    unsafe extern "C-unwind" fn cancels(s: *mut c_void, _: f64, _: f64) -> i32 {
        // SAFETY: the test's word.
        unsafe { diffusph_cancel(s.cast()) };
        0
    }
    // SAFETY: as above.
    assert_eq!(unsafe { diffusph_set_progress_callback(host.s, Some(cancels), host.s.cast()) }, 0);
    assert_eq!(step(), 5);
    unsafe { diffusph_set_progress_callback(host.s, None, null_mut()) };
    assert_eq!(step(), 0, "it was another step that was cancelled");
}

/// Runs all other tests here again, mistakes and panics included, and looks at what reaches the terminal.
#[test]
fn nothing_is_printed() {
    let inner = "DIFFUSPH_INNER_TEST_RUN";
    if std::env::var_os(inner).is_some() {
        return;
    }
    let mut again = Command::new(std::env::current_exe().unwrap());
    let done = again.arg("--nocapture").env(inner, "1").env("RUST_BACKTRACE", "1").output().unwrap();
    let (out, err) = (String::from_utf8_lossy(&done.stdout), String::from_utf8_lossy(&done.stderr));
    assert!(done.status.success(), "{out}{err}");
    assert_eq!(err, "");
    let ours = |line: &&str| !(line.is_empty() || line.starts_with("running ") || line.starts_with("test "));
    assert_eq!(out.lines().filter(ours).collect::<Vec<_>>(), Vec::<&str>::new());
}
