//! A small host of the C ABI: a solver with everything set, places for results, and one valid call of every function.

use diffusph::ffi::*;
use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr::{null, null_mut};

pub const SIDE: usize = 5;
pub const N: usize = SIDE * SIDE;
pub const LEN: i64 = N as i64;
/// What places for results hold before a call; it must still be there after a call that fails.
const UNTOUCHED: f64 = -12345.678;

pub struct Host {
    pub s: *mut Handle,
    pub x: Vec<f64>,
    pub values: Vec<f64>,
    pub out: Vec<f64>,
    pub value: f64,
    pub seconds: f64,
    pub count: i64,
    pub text: [c_char; 256],
    pub why: [c_char; 256],
    pub made: *mut Handle,
    pub report: Report,
    pub dir: tempfile::TempDir,
}

// SAFETY: tests hand a host to one thread at a time, except for its solver, which may be called from any.
unsafe impl Send for Host {}
unsafe impl Sync for Host {}

/// A string that lives on.
pub fn c(text: &str) -> *const c_char {
    CString::new(text).unwrap().into_raw()
}

pub fn created(words: &str) -> *mut Handle {
    let (mut s, mut why) = (null_mut(), [0; 256]);
    // SAFETY: all places are ours.
    let code = unsafe { diffusph_create(c(words), &mut s, why.as_mut_ptr(), 256) };
    assert_eq!(code, 0, "{}", read(&why));
    s
}

pub fn read(text: &[c_char]) -> String {
    // SAFETY: the buffers of these tests end with a NUL.
    unsafe { CStr::from_ptr(text.as_ptr()) }.to_str().unwrap().to_string()
}

pub fn message(s: *mut Handle) -> String {
    let mut text = [0; 1024];
    // SAFETY: the buffer is ours.
    unsafe { diffusph_message(s, text.as_mut_ptr(), 1024) };
    read(&text)
}

impl Host {
    /// Nothing is set.
    pub fn new(words: &str) -> Host {
        // Numbers without rounding: a host in another rounding mode has the same.
        let middle = |k: usize| k as f64 + 0.5;
        Host {
            s: created(words),
            x: (0..N).flat_map(|i| [middle(i % SIDE), middle(i / SIDE)]).collect(),
            values: (0..N).map(|i| 300.0 + (i * i % 7) as f64).collect(),
            out: vec![UNTOUCHED; 2 * N],
            value: UNTOUCHED,
            seconds: UNTOUCHED,
            count: -777,
            text: [b'?' as c_char; 256],
            why: [0; 256],
            made: null_mut(),
            report: Report { size: size_of::<Report>() as i64, time: UNTOUCHED, ..Report::default() },
            dir: tempfile::tempdir().unwrap(),
        }
    }

    /// Ready to step, in a periodic box.
    pub fn ready(words: &str) -> Host {
        let host = Host::new(words);
        let (s, m) = (host.s, vec![1.0; N]);
        // SAFETY: the arrays have the lengths that are said.
        let codes = unsafe {
            [
                diffusph_set_box(s, [0.0; 2].as_ptr(), [SIDE as f64; 2].as_ptr(), [1; 2].as_ptr()),
                diffusph_set_particles(s, LEN, host.x.as_ptr(), 2, m.as_ptr(), null(), null()),
                diffusph_set(s, c("T"), host.values.as_ptr(), LEN, 1),
                diffusph_set_number(s, c("kappa"), 1.0),
            ]
        };
        assert_eq!(codes, [0; 4], "{}", message(s));
        host
    }

    pub fn path(&self, name: &str) -> *const c_char {
        c(self.dir.path().join(name).to_str().unwrap())
    }

    /// Whether every place for a result is as it was.
    pub fn is_untouched(&self) -> bool {
        self.out.iter().chain([&self.value, &self.seconds, &self.report.time]).all(|v| *v == UNTOUCHED)
            && self.count == -777
            && self.text.iter().all(|b| *b == b'?' as c_char)
            && self.made.is_null()
    }

    /// Every field and number of the solver, to the bit, or the code that says why there is none.
    pub fn state(&self) -> Vec<Result<Vec<u64>, i32>> {
        let mut all = Vec::new();
        // SAFETY: the places are ours and large enough.
        unsafe {
            let mut n = -1;
            assert_eq!(diffusph_particles(self.s, &mut n), 0);
            for field in diffusph::solver::catalogue::catalogue("fields").unwrap() {
                let mut values = vec![0.0; 2 * n as usize];
                let code = diffusph_get(self.s, c(&field.name), values.as_mut_ptr(), n, 2);
                all.push(if code == 0 { Ok(values.iter().map(|v| v.to_bits()).collect()) } else { Err(code) });
            }
            for number in diffusph::solver::catalogue::catalogue("numbers").unwrap() {
                let mut value = 0.0;
                let code = diffusph_get_number(self.s, c(&number.name), &mut value);
                // What is held in memory may differ: derived data is made when it is asked for.
                let value = if number.name == "bytes" { 0.0 } else { value };
                all.push(if code == 0 { Ok(vec![value.to_bits()]) } else { Err(code) });
            }
        }
        all
    }

    /// One valid call of every function that has a solver, but `diffusph_cancel` and `diffusph_destroy`, on `s`.
    pub fn every_call(&mut self, s: *mut Handle) -> Vec<(&'static str, i32)> {
        let (x, t, m) = (self.x.as_ptr(), self.values.as_ptr(), vec![1.0; N]);
        let (out, value, count) = (self.out.as_mut_ptr(), &raw mut self.value, &raw mut self.count);
        let mut text = [0; 4096];
        let (vtu, pvd) = (self.path("a.vtu"), self.path("a.pvd"));
        let buf = text.as_mut_ptr();
        // SAFETY: the arrays have the lengths that are said.
        unsafe {
            vec![
                ("diffusph_message", diffusph_message(s, buf, 4096)),
                ("diffusph_particles", diffusph_particles(s, count)),
                ("diffusph_dimensions", diffusph_dimensions(s, count)),
                (
                    "diffusph_set_box",
                    diffusph_set_box(s, [0.0; 2].as_ptr(), [SIDE as f64; 2].as_ptr(), [1; 2].as_ptr()),
                ),
                ("diffusph_set_particles", diffusph_set_particles(s, LEN, x, 2, m.as_ptr(), null(), null())),
                ("diffusph_set", diffusph_set(s, c("T"), t, LEN, 1)),
                ("diffusph_set_number", diffusph_set_number(s, c("kappa"), 1.0)),
                ("diffusph_set_law", diffusph_set_law(s, c("kappa"), c("power kappa0=1 T0=300 n=2.5"))),
                ("diffusph_set_kappa_callback", diffusph_set_kappa_callback(s, None, null_mut())),
                ("diffusph_set_number", diffusph_set_number(s, c("kappa"), 1.0)),
                ("diffusph_set_source_callback", diffusph_set_source_callback(s, None, null_mut())),
                ("diffusph_set_progress_callback", diffusph_set_progress_callback(s, None, null_mut())),
                ("diffusph_set_log_callback", diffusph_set_log_callback(s, None, null_mut())),
                ("diffusph_step", diffusph_step(s, 1e-3, &mut self.report)),
                ("diffusph_limit", diffusph_limit(s, value)),
                ("diffusph_rate", diffusph_rate(s, out, LEN, 1)),
                ("diffusph_plan", diffusph_plan(s, buf, 4096, count)),
                ("diffusph_recommend", diffusph_recommend(s, 0.5, 1e-3, buf, 4096, value, &mut self.seconds)),
                ("diffusph_get", diffusph_get(s, c("flux"), out, LEN, 2)),
                ("diffusph_get_number", diffusph_get_number(s, c("energy"), value)),
                ("diffusph_seconds", diffusph_seconds(s, 0, buf, 64, value)),
                ("diffusph_write_vtk", diffusph_write_vtk(s, vtu)),
                ("diffusph_write_series", diffusph_write_series(s, pvd)),
                ("diffusph_read_vtk", diffusph_read_vtk(s, vtu)),
            ]
        }
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        // SAFETY: made by `created`, and not used any more.
        unsafe { diffusph_destroy(self.s) };
    }
}

/// A host's pointer to something of Rust.
pub fn user<T>(value: &T) -> *mut c_void {
    std::ptr::from_ref(value).cast_mut().cast()
}
