//! What a host can do wrong, in a table over every function of the header: each mistake is answered with its code and a
//! message that names it, and changes nothing.

use crate::common::header;
use crate::common::host::{Host, LEN, N, c, message, read};
use diffusph::ffi::*;
use diffusph::io::{self, Data, Field, Snapshot};
use std::collections::BTreeSet;
use std::ffi::{c_char, c_void};
use std::ptr::{null, null_mut};

/// A mistake: the function, what brings the solver into the state for it, the call, its code, and what the message says.
struct Row(&'static str, fn(&mut Host), unsafe fn(&mut Host) -> i32, i32, &'static str);

fn as_is(_: &mut Host) {}

/// Exchanges the solver for one that has nothing set.
fn empty(host: &mut Host) {
    *host = Host::new("heat dim=2 threads=1");
}

fn with<const M: usize>(host: &Host, i: usize, value: f64) -> [f64; M] {
    let mut values: [f64; M] = std::array::from_fn(|k| host.values[k % N]);
    values[i] = value;
    values
}

fn snapshot(host: &Host, name: &str, field: &str, values: Vec<f64>) -> *const c_char {
    let points = host.x.chunks(2).map(|x| [x[0], x[1], 0.0]).collect();
    let fields = vec![Field { name: field.into(), components: 1, data: Data::F64(values) }];
    let snapshot = Snapshot { points, fields, ..Snapshot::default() };
    io::write_vtu(host.dir.path().join(name), &snapshot.view(), io::Options::default()).unwrap();
    host.path(name)
}

fn truncated(host: &Host) -> *const c_char {
    let path = snapshot(host, "cut.vtu", "T", vec![1.0; N]);
    let file = host.dir.path().join("cut.vtu");
    let bytes = std::fs::read(&file).unwrap();
    std::fs::write(file, &bytes[..bytes.len() - 100]).unwrap();
    path
}

fn written(host: &Host, name: &str, bytes: &[u8]) -> *const c_char {
    std::fs::write(host.dir.path().join(name), bytes).unwrap();
    host.path(name)
}

unsafe extern "C-unwind" fn answers_42(
    _: *mut c_void,
    _: f64,
    _: i64,
    _: *const u32,
    _: *const f64,
    _: *mut f64,
) -> i32 {
    42
}

#[allow(non_snake_case)]
unsafe extern "C-unwind" fn fills_nan(
    _: *mut c_void,
    _: f64,
    n: i64,
    _: *const u32,
    _: *const f64,
    out: *mut f64,
) -> i32 {
    // SAFETY: the library's word.
    unsafe { std::slice::from_raw_parts_mut(out, n as usize) }.fill(f64::NAN);
    0
}

unsafe extern "C-unwind" fn says_stop(_: *mut c_void, _: f64, _: f64) -> i32 {
    1
}

fn kappa_42(h: &mut Host) {
    assert_eq!(unsafe { diffusph_set_kappa_callback(h.s, Some(answers_42), null_mut()) }, 0);
}

fn kappa_nan(h: &mut Host) {
    assert_eq!(unsafe { diffusph_set_kappa_callback(h.s, Some(fills_nan), null_mut()) }, 0);
}

fn source_nan(h: &mut Host) {
    assert_eq!(unsafe { diffusph_set_source_callback(h.s, Some(fills_nan), null_mut()) }, 0);
}

fn stopping(h: &mut Host) {
    assert_eq!(unsafe { diffusph_set_progress_callback(h.s, Some(says_stop), null_mut()) }, 0);
}

fn little_work(h: &mut Host) {
    *h = Host::ready("heat dim=2 threads=1 integrator=euler max_applications=3");
}

fn fewer(h: &mut Host) {
    assert_eq!(unsafe { diffusph_set_particles(h.s, LEN - 1, h.x.as_ptr(), 2, null(), null(), null()) }, 0);
}

fn flat(h: &mut Host) {
    empty(h);
    h.x.iter_mut().skip(1).step_by(2).for_each(|y| *y = 0.5);
    let m = [1.0; N];
    assert_eq!(unsafe { diffusph_set_particles(h.s, LEN, h.x.as_ptr(), 2, m.as_ptr(), null(), null()) }, 0);
    assert_eq!(unsafe { diffusph_set_number(h.s, c("T"), 1.0) + diffusph_set_number(h.s, c("kappa"), 1.0) }, 0);
}

fn tiny_box(h: &mut Host) {
    let (lo, hi) = ([0.0, 0.0], [1e-3, 1.0]);
    assert_eq!(unsafe { diffusph_set_number(h.s, c("h"), 0.1) }, 0);
    assert_eq!(unsafe { diffusph_set_box(h.s, lo.as_ptr(), hi.as_ptr(), [1, 1].as_ptr()) }, 0);
}

const NAN: f64 = f64::NAN;
const INF: f64 = f64::INFINITY;
const ODD: usize = 4;

#[rustfmt::skip]
const TABLE: &[Row] = &[
    Row("diffusph_create", as_is, |h| unsafe { diffusph_create(null(), &mut h.made, h.why.as_mut_ptr(), 256) }, -1, "words is NULL"),
    Row("diffusph_create", as_is, |h| unsafe { diffusph_create(c("heat"), null_mut(), h.why.as_mut_ptr(), 256) }, -1, "s is NULL"),
    Row("diffusph_create", as_is, |h| unsafe { diffusph_create(c("heet"), &mut h.made, h.why.as_mut_ptr(), 256) }, -5, "did you mean 'heat'"),
    Row("diffusph_create", as_is, |h| unsafe { diffusph_create(c("heat dim=4"), &mut h.made, h.why.as_mut_ptr(), 256) }, -2, "dim is '4'"),
    Row("diffusph_create", as_is, |h| unsafe { diffusph_create(c("heat integrator=euler stages=5"), &mut h.made, h.why.as_mut_ptr(), 256) }, -2, "stages is 5; it has no effect here"),
    Row("diffusph_create", as_is, |h| unsafe { diffusph_create(c("heat dim=4"), &mut h.made, null_mut(), 256) }, -2, ""),
    Row("diffusph_create", as_is, |h| unsafe { diffusph_create(c("heat dim=4"), &mut h.made, h.why.as_mut_ptr(), -1) }, -2, ""),
    Row("diffusph_create", as_is, |h| unsafe { diffusph_create(c"heat \xff=1".as_ptr(), &mut h.made, h.why.as_mut_ptr(), 256) }, -2, "must be UTF-8"),
    Row("diffusph_destroy", as_is, |_| unsafe { diffusph_destroy(null_mut()) }, 0, ""),
    Row("diffusph_message", as_is, |h| unsafe { diffusph_message(h.s, null_mut(), 10) }, -1, ""),
    Row("diffusph_message", as_is, |h| unsafe { diffusph_message(h.s, h.text.as_mut_ptr(), 0) }, -2, ""),
    Row("diffusph_message", as_is, |h| unsafe { diffusph_message(h.s, h.text.as_mut_ptr(), -5) }, -2, ""),
    Row("diffusph_particles", as_is, |h| unsafe { diffusph_particles(h.s, null_mut()) }, -1, "n is NULL"),
    Row("diffusph_dimensions", as_is, |h| unsafe { diffusph_dimensions(h.s, null_mut()) }, -1, "dim is NULL"),

    Row("diffusph_set_box", as_is, |h| unsafe { diffusph_set_box(h.s, null(), [1.0; 2].as_ptr(), null()) }, -1, "lo is NULL"),
    Row("diffusph_set_box", as_is, |h| unsafe { diffusph_set_box(h.s, [0.0; 2].as_ptr(), null(), null()) }, -1, "hi is NULL"),
    Row("diffusph_set_box", as_is, |h| unsafe { diffusph_set_box(h.s, [0.0, NAN].as_ptr(), [1.0; 2].as_ptr(), null()) }, -2, "lo[1] is NaN"),
    Row("diffusph_set_box", as_is, |h| unsafe { diffusph_set_box(h.s, [0.0; 2].as_ptr(), [1.0, INF].as_ptr(), null()) }, -2, "hi[1] is inf"),
    Row("diffusph_set_box", as_is, |h| unsafe { diffusph_set_box(h.s, [0.0; 2].as_ptr(), [1.0, 0.0].as_ptr(), [1; 2].as_ptr()) }, -2, "hi[1] is 0"),

    Row("diffusph_set_particles", as_is, |h| unsafe { diffusph_set_particles(h.s, LEN, null(), 2, null(), null(), null()) }, -1, "x is NULL"),
    Row("diffusph_set_particles", as_is, |h| unsafe { diffusph_set_particles(h.s, -1, h.x.as_ptr(), 2, null(), null(), null()) }, -2, "n is -1"),
    Row("diffusph_set_particles", as_is, |h| unsafe { diffusph_set_particles(h.s, i64::MAX, h.x.as_ptr(), 2, null(), null(), null()) }, -2, "n is 9"),
    Row("diffusph_set_particles", as_is, |h| unsafe { diffusph_set_particles(h.s, LEN, h.x.as_ptr(), 1, null(), null(), null()) }, -2, "stride is 1"),
    Row("diffusph_set_particles", as_is, |h| unsafe { diffusph_set_particles(h.s, LEN, h.x.as_ptr(), -2, null(), null(), null()) }, -2, "stride is -2"),
    Row("diffusph_set_particles", as_is, |h| unsafe { diffusph_set_particles(h.s, LEN, h.x.as_ptr(), i64::MAX, null(), null(), null()) }, -2, "address space"),
    Row("diffusph_set_particles", as_is, |h| unsafe { diffusph_set_particles(h.s, LEN, h.x.as_ptr().byte_add(ODD), 2, null(), null(), null()) }, -2, "multiple of 8"),
    Row("diffusph_set_particles", as_is, |h| unsafe { diffusph_set_particles(h.s, LEN, with::<{ 2 * N }>(h, 7, NAN).as_ptr(), 2, null(), null(), null()) }, -2, "x[3] is NaN"),
    Row("diffusph_set_particles", as_is, |h| unsafe { diffusph_set_particles(h.s, LEN, h.x.as_ptr(), 2, with::<N>(h, 9, 0.0).as_ptr(), null(), null()) }, -2, "m[9] is 0"),
    Row("diffusph_set_particles", as_is, |h| unsafe { diffusph_set_particles(h.s, LEN, h.x.as_ptr(), 2, with::<N>(h, 9, -1.0).as_ptr(), null(), null()) }, -2, "m[9] is -1"),
    Row("diffusph_set_particles", as_is, |h| unsafe { diffusph_set_particles(h.s, LEN - 1, h.x.as_ptr(), 2, null(), with::<N>(h, 2, -INF).as_ptr(), null()) }, -2, "rho[2] is -inf"),
    Row("diffusph_set_particles", as_is, |h| unsafe { diffusph_set_particles(h.s, LEN, h.x.as_ptr(), 2, null(), null(), with::<N>(h, 0, NAN).as_ptr()) }, -2, "h[0] is NaN"),

    Row("diffusph_set", as_is, |h| unsafe { diffusph_set(h.s, null(), h.values.as_ptr(), LEN, 1) }, -1, "name is NULL"),
    Row("diffusph_set", as_is, |h| unsafe { diffusph_set(h.s, c("T"), null(), LEN, 1) }, -1, "T is NULL"),
    Row("diffusph_set", as_is, |h| unsafe { diffusph_set(h.s, c("T"), h.values.as_ptr(), LEN - 1, 1) }, -3, "T has 24 values, expected 25"),
    Row("diffusph_set", as_is, |h| unsafe { diffusph_set(h.s, c("T"), h.values.as_ptr(), -3, 1) }, -2, "n is -3"),
    Row("diffusph_set", as_is, |h| unsafe { diffusph_set(h.s, c("T"), h.values.as_ptr(), LEN, 0) }, -2, "stride is 0"),
    Row("diffusph_set", as_is, |h| unsafe { diffusph_set(h.s, c("T"), with::<N>(h, 24, INF).as_ptr(), LEN, 1) }, -2, "T[24] is inf"),
    Row("diffusph_set", as_is, |h| unsafe { diffusph_set(h.s, c("u"), with::<N>(h, 24, NAN).as_ptr(), LEN, 1) }, -2, "u[24] is NaN"),
    Row("diffusph_set", as_is, |h| unsafe { diffusph_set(h.s, c("kappa"), with::<N>(h, 1, -2.0).as_ptr(), LEN, 1) }, -2, "kappa[1] is -2"),
    Row("diffusph_set", as_is, |h| unsafe { diffusph_set(h.s, c("kapa"), h.values.as_ptr(), LEN, 1) }, -5, "did you mean 'kappa'"),
    Row("diffusph_set", as_is, |h| unsafe { diffusph_set(h.s, c("flux"), h.x.as_ptr(), LEN, 2) }, -2, "cannot be set"),
    Row("diffusph_set", as_is, |h| unsafe { diffusph_set(h.s, c("x"), h.x.as_ptr(), LEN, 1) }, -2, "stride is 1"),
    Row("diffusph_set", as_is, |h| unsafe { diffusph_set(h.s, c("x"), with::<{ 2 * N }>(h, 1, NAN).as_ptr(), LEN, 2) }, -2, "x[0] is NaN"),
    Row("diffusph_set", empty, |h| unsafe { diffusph_set(h.s, c("T"), h.values.as_ptr(), LEN, 1) }, -4, "set_particles first"),

    Row("diffusph_set_number", as_is, |h| unsafe { diffusph_set_number(h.s, null(), 1.0) }, -1, "name is NULL"),
    Row("diffusph_set_number", as_is, |h| unsafe { diffusph_set_number(h.s, c("m"), 0.0) }, -2, "m is 0"),
    Row("diffusph_set_number", as_is, |h| unsafe { diffusph_set_number(h.s, c("emissivity"), 1.5) }, -2, "from 0 to 1"),
    Row("diffusph_set_number", as_is, |h| unsafe { diffusph_set_number(h.s, c("u"), NAN) }, -2, "u is NaN"),
    Row("diffusph_set_number", as_is, |h| unsafe { diffusph_set_number(h.s, c("time"), INF) }, -2, "time is inf"),
    Row("diffusph_set_number", as_is, |h| unsafe { diffusph_set_number(h.s, c("energy"), 1.0) }, -2, "'energy'"),
    Row("diffusph_set_number", as_is, |h| unsafe { diffusph_set_number(h.s, c("tim"), 1.0) }, -5, "'tim'"),
    Row("diffusph_set_law", as_is, |h| unsafe { diffusph_set_law(h.s, null(), c("power")) }, -1, "name is NULL"),
    Row("diffusph_set_law", as_is, |h| unsafe { diffusph_set_law(h.s, c("kappa"), null()) }, -1, "words is NULL"),
    Row("diffusph_set_law", as_is, |h| unsafe { diffusph_set_law(h.s, c("m"), c("power kappa0=1 T0=300 n=1")) }, -5, "'m'"),
    Row("diffusph_set_law", as_is, |h| unsafe { diffusph_set_law(h.s, c("kappa"), c("powr kappa0=1")) }, -5, "did you mean 'power'"),
    Row("diffusph_set_law", as_is, |h| unsafe { diffusph_set_law(h.s, c("kappa"), c("power kappa0=-1 T0=300 n=1")) }, -2, "kappa0"),

    Row("diffusph_step", as_is, |h| unsafe { diffusph_step(h.s, NAN, &mut h.report) }, -2, "dt is NaN"),
    Row("diffusph_step", as_is, |h| unsafe { diffusph_step(h.s, -1.0, &mut h.report) }, -2, "dt is -1"),
    Row("diffusph_step", as_is, |h| unsafe { diffusph_step(h.s, INF, &mut h.report) }, -2, "dt is inf"),
    Row("diffusph_step", |h| h.report.size = 0, |h| unsafe { diffusph_step(h.s, 1e-3, &mut h.report) }, -2, "report.size is 0"),
    Row("diffusph_step", as_is, |h| unsafe { diffusph_step(h.s, 1e-3, (&raw mut h.report).byte_add(ODD)) }, -2, "multiple of 8"),
    Row("diffusph_step", empty, |h| unsafe { diffusph_step(h.s, 1e-3, &mut h.report) }, -4, "set_particles first"),
    Row("diffusph_step", little_work, |h| unsafe { diffusph_step(h.s, 1e3, &mut h.report) }, 1, "max_applications=3"),
    Row("diffusph_step", source_nan, |h| unsafe { diffusph_step(h.s, 1e-3, &mut h.report) }, 2, "NaN at particle 0"),
    Row("diffusph_step", stopping, |h| unsafe { diffusph_step(h.s, 1e-3, &mut h.report) }, 5, "cancelled"),
    Row("diffusph_step", kappa_42, |h| unsafe { diffusph_step(h.s, 1e-3, &mut h.report) }, 7, "kappa callback returned 42"),
    Row("diffusph_step", kappa_nan, |h| unsafe { diffusph_step(h.s, 1e-3, &mut h.report) }, -2, "is NaN (at T = "),
    Row("diffusph_step", fewer, |h| unsafe { diffusph_step(h.s, 1e-3, &mut h.report) }, -4, "T (or u), m for the 24 particles"),
    Row("diffusph_step", flat, |h| unsafe { diffusph_step(h.s, 1e-3, &mut h.report) }, -2, "flat along y"),
    Row("diffusph_step", tiny_box, |h| unsafe { diffusph_step(h.s, 1e-3, &mut h.report) }, -6, "on axis 0"),
    Row("diffusph_recommend", as_is, |h| unsafe { diffusph_recommend(h.s, NAN, 1e-3, h.text.as_mut_ptr(), 256, &mut h.value, &mut h.seconds) }, -2, "wanted is NaN"),
    Row("diffusph_recommend", as_is, |h| unsafe { diffusph_recommend(h.s, 0.1, 0.0, h.text.as_mut_ptr(), 256, &mut h.value, &mut h.seconds) }, -2, "dt is 0"),
    Row("diffusph_recommend", as_is, |h| unsafe { diffusph_recommend(h.s, 0.1, 1e-3, null_mut(), 256, &mut h.value, &mut h.seconds) }, -1, "words is NULL"),
    Row("diffusph_recommend", as_is, |h| unsafe { diffusph_recommend(h.s, 0.1, 1e-3, h.text.as_mut_ptr(), 0, &mut h.value, &mut h.seconds) }, -2, "words_len is 0"),
    Row("diffusph_recommend", as_is, |h| unsafe { diffusph_recommend(h.s, 0.1, 1e-3, h.text.as_mut_ptr(), 256, null_mut(), &mut h.seconds) }, -1, "error is NULL"),
    Row("diffusph_recommend", as_is, |h| unsafe { diffusph_recommend(h.s, 0.1, 1e-3, h.text.as_mut_ptr(), 256, &mut h.value, null_mut()) }, -1, "seconds is NULL"),
    Row("diffusph_recommend", as_is, |h| unsafe { diffusph_recommend(h.s, 1e-300, 1.0, h.text.as_mut_ptr(), 256, &mut h.value, &mut h.seconds) }, 8, "no choice is known to err by less than 1e-300"),
    Row("diffusph_recommend", empty, |h| unsafe { diffusph_recommend(h.s, 0.1, 1e-3, h.text.as_mut_ptr(), 256, &mut h.value, &mut h.seconds) }, -4, "set_particles first"),
    Row("diffusph_recommend", stopping, |h| unsafe { diffusph_recommend(h.s, 0.1, 1e-3, h.text.as_mut_ptr(), 256, &mut h.value, &mut h.seconds) }, 5, "cancelled"),
    Row("diffusph_recommend", kappa_42, |h| unsafe { diffusph_recommend(h.s, 0.1, 1e-3, h.text.as_mut_ptr(), 256, &mut h.value, &mut h.seconds) }, 7, "kappa callback returned 42"),

    Row("diffusph_limit", as_is, |h| unsafe { diffusph_limit(h.s, null_mut()) }, -1, "dt is NULL"),
    Row("diffusph_limit", empty, |h| unsafe { diffusph_limit(h.s, &mut h.value) }, -4, "set_particles first"),
    Row("diffusph_limit", kappa_42, |h| unsafe { diffusph_limit(h.s, &mut h.value) }, 7, "returned 42"),
    Row("diffusph_rate", as_is, |h| unsafe { diffusph_rate(h.s, null_mut(), LEN, 1) }, -1, "out is NULL"),
    Row("diffusph_rate", as_is, |h| unsafe { diffusph_rate(h.s, h.out.as_mut_ptr(), LEN + 1, 1) }, -3, "rate has 26 values, expected 25"),
    Row("diffusph_rate", as_is, |h| unsafe { diffusph_rate(h.s, h.out.as_mut_ptr(), LEN, 0) }, -2, "stride is 0"),
    Row("diffusph_rate", empty, |h| unsafe { diffusph_rate(h.s, h.out.as_mut_ptr(), LEN, 1) }, -4, "set_particles first"),
    Row("diffusph_plan", as_is, |h| unsafe { diffusph_plan(h.s, null_mut(), 0, null_mut()) }, -1, "buf is NULL"),
    Row("diffusph_plan", as_is, |h| unsafe { diffusph_plan(h.s, h.text.as_mut_ptr(), 0, &mut h.count) }, -2, "buf_len is 0"),
    Row("diffusph_plan", empty, |h| unsafe { diffusph_plan(h.s, h.text.as_mut_ptr(), 256, &mut h.count) }, -4, "set_particles first"),

    Row("diffusph_get", as_is, |h| unsafe { diffusph_get(h.s, null(), h.out.as_mut_ptr(), LEN, 1) }, -1, "name is NULL"),
    Row("diffusph_get", as_is, |h| unsafe { diffusph_get(h.s, c("T"), null_mut(), LEN, 1) }, -1, "out is NULL"),
    Row("diffusph_get", as_is, |h| unsafe { diffusph_get(h.s, c("temperature"), h.out.as_mut_ptr(), LEN, 1) }, -5, "'temperature'"),
    Row("diffusph_get", as_is, |h| unsafe { diffusph_get(h.s, c("T"), h.out.as_mut_ptr(), LEN - 5, 1) }, -3, "T has 20 values, expected 25"),
    Row("diffusph_get", as_is, |h| unsafe { diffusph_get(h.s, c("flux"), h.out.as_mut_ptr(), LEN, 1) }, -2, "at least 2 here"),
    Row("diffusph_get", as_is, |h| unsafe { diffusph_get(h.s, c("T"), h.out.as_mut_ptr(), i64::MIN, 1) }, -2, "n is -9"),
    Row("diffusph_get", as_is, |h| unsafe { diffusph_get(h.s, c("T"), h.out.as_mut_ptr().byte_add(ODD), LEN, 1) }, -2, "multiple of 8"),
    Row("diffusph_get", empty, |h| unsafe { diffusph_get(h.s, c("T"), h.out.as_mut_ptr(), 0, 1) }, -4, "set_particles first"),
    Row("diffusph_get_number", as_is, |h| unsafe { diffusph_get_number(h.s, null(), &mut h.value) }, -1, "name is NULL"),
    Row("diffusph_get_number", as_is, |h| unsafe { diffusph_get_number(h.s, c("energy"), null_mut()) }, -1, "value is NULL"),
    Row("diffusph_get_number", as_is, |h| unsafe { diffusph_get_number(h.s, c("enrgy"), &mut h.value) }, -5, "did you mean 'energy'"),
    Row("diffusph_get_number", empty, |h| unsafe { diffusph_get_number(h.s, c("energy"), &mut h.value) }, -4, "set_particles first"),
    Row("diffusph_seconds", as_is, |h| unsafe { diffusph_seconds(h.s, 99, h.text.as_mut_ptr(), 256, &mut h.value) }, -2, "i is 99"),
    Row("diffusph_seconds", as_is, |h| unsafe { diffusph_seconds(h.s, -1, h.text.as_mut_ptr(), 256, &mut h.value) }, -2, "i is -1"),
    Row("diffusph_seconds", as_is, |h| unsafe { diffusph_seconds(h.s, 0, null_mut(), 256, &mut h.value) }, -1, "name is NULL"),
    Row("diffusph_seconds", as_is, |h| unsafe { diffusph_seconds(h.s, 0, h.text.as_mut_ptr(), 0, &mut h.value) }, -2, "name_len is 0"),
    Row("diffusph_seconds", as_is, |h| unsafe { diffusph_seconds(h.s, 0, h.text.as_mut_ptr(), 256, null_mut()) }, -1, "seconds is NULL"),

    Row("diffusph_write_vtk", as_is, |h| unsafe { diffusph_write_vtk(h.s, null()) }, -1, "path is NULL"),
    Row("diffusph_write_vtk", as_is, |h| unsafe { diffusph_write_vtk(h.s, c("")) }, -2, ".vtu, or in .vtk"),
    Row("diffusph_write_vtk", as_is, |h| unsafe { diffusph_write_vtk(h.s, h.path("e.vtp")) }, -2, ".vtu, or in .vtk"),
    Row("diffusph_write_vtk", as_is, |h| unsafe { diffusph_write_vtk(h.s, c("/dev/full")) }, -2, "'/dev/full'"),
    Row("diffusph_write_vtk", as_is, |h| unsafe { diffusph_write_vtk(h.s, h.path("no/such/a.vtu")) }, -7, "no/such/a.vtu: cannot write"),
    Row("diffusph_write_vtk", empty, |h| unsafe { diffusph_write_vtk(h.s, h.path("a.vtu")) }, -4, "set_particles first"),
    Row("diffusph_write_series", as_is, |h| unsafe { diffusph_write_series(h.s, null()) }, -1, "pvd_path is NULL"),
    Row("diffusph_write_series", as_is, |h| unsafe { diffusph_write_series(h.s, h.path("run.vtu")) }, -2, "must end in .pvd"),
    Row("diffusph_write_series", as_is, |h| unsafe { diffusph_write_series(h.s, written(h, "bad.pvd", b"<VTKFile/>")) }, -8, "bad.pvd"),
    Row("diffusph_write_series", as_is, |h| unsafe { diffusph_write_series(h.s, h.path("no/such/a.pvd")) }, -7, "no/such"),
    Row("diffusph_read_vtk", as_is, |h| unsafe { diffusph_read_vtk(h.s, null()) }, -1, "path is NULL"),
    Row("diffusph_read_vtk", as_is, |h| unsafe { diffusph_read_vtk(h.s, h.path("none.vtu")) }, -7, "none.vtu: cannot read"),
    Row("diffusph_read_vtk", as_is, |h| unsafe { diffusph_read_vtk(h.s, h.path("")) }, -7, "cannot read"),
    Row("diffusph_read_vtk", as_is, |h| unsafe { diffusph_read_vtk(h.s, written(h, "text.vtu", b"not XML at all")) }, -8, "text.vtu"),
    Row("diffusph_read_vtk", as_is, |h| unsafe { diffusph_read_vtk(h.s, truncated(h)) }, -8, "cut.vtu"),
    Row("diffusph_read_vtk", as_is, |h| unsafe { diffusph_read_vtk(h.s, snapshot(h, "m.vtu", "m", with::<N>(h, 3, -1.0).to_vec())) }, -2, "m[3] is -1"),
    Row("diffusph_read_vtk", as_is, |h| unsafe { diffusph_read_vtk(h.s, snapshot(h, "T.vtu", "T", with::<N>(h, 8, NAN).to_vec())) }, -2, "T[8] is NaN"),

    Row("diffusph_count", as_is, |h| unsafe { diffusph_count(null(), &mut h.count) }, -1, ""),
    Row("diffusph_count", as_is, |_| unsafe { diffusph_count(c("kernels"), null_mut()) }, -1, ""),
    Row("diffusph_count", as_is, |h| unsafe { diffusph_count(c("kernel"), &mut h.count) }, -5, ""),
    Row("diffusph_name", as_is, |h| unsafe { diffusph_name(null(), 0, h.text.as_mut_ptr(), 256) }, -1, ""),
    Row("diffusph_name", as_is, |h| unsafe { diffusph_name(c("kernels"), 999, h.text.as_mut_ptr(), 256) }, -2, ""),
    Row("diffusph_name", as_is, |h| unsafe { diffusph_name(c("kernels"), -1, h.text.as_mut_ptr(), 256) }, -2, ""),
    Row("diffusph_name", as_is, |_| unsafe { diffusph_name(c("kernels"), 0, null_mut(), 256) }, -1, ""),
    Row("diffusph_about", as_is, |h| unsafe { diffusph_about(c("nothing"), 0, h.text.as_mut_ptr(), 256) }, -5, ""),
    Row("diffusph_about", as_is, |h| unsafe { diffusph_about(c("fields"), 0, h.text.as_mut_ptr(), 0) }, -2, ""),
    Row("diffusph_error_name", as_is, |h| unsafe { diffusph_error_name(1000, h.text.as_mut_ptr(), 256) }, -2, ""),
    Row("diffusph_error_name", as_is, |_| unsafe { diffusph_error_name(0, null_mut(), 256) }, -1, ""),
    Row("diffusph_version", as_is, |_| unsafe { diffusph_version(null_mut(), 256) }, -1, ""),
    Row("diffusph_version", as_is, |h| unsafe { diffusph_version(h.text.as_mut_ptr(), -256) }, -2, ""),
];

/// What is wrong with the answer to a mistake.
fn complaints(Row(function, before, call, code, says): &Row) -> Vec<String> {
    let mut host = Host::ready("heat dim=2 threads=1");
    before(&mut host);
    let (state, mut found) = (host.state(), Vec::new());
    // SAFETY: the mistakes are of the kinds that the header promises to answer.
    let got = unsafe { call(&mut host) };
    let text = if *function == "diffusph_create" { read(&host.why) } else { message(host.s) };
    if got != *code {
        found.push(format!("code {got}, not {code}"));
    }
    if !text.contains(says) {
        found.push(format!("message '{text}'"));
    }
    if !host.is_untouched() {
        found.push("a place for results was written".into());
    }
    if host.state() != state {
        found.push("the solver was changed".into());
    }
    found
}

#[test]
fn every_mistake_is_named_and_changes_nothing() {
    let wrong: Vec<String> = TABLE
        .iter()
        .map(|row| (row, complaints(row)))
        .filter(|(_, found)| !found.is_empty())
        .map(|(row, found)| format!("{} '{}': {}", row.0, row.4, found.join(", ")))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // A control: calls that are no mistakes are seen to change and to write.
    let sets = Row("diffusph_set", as_is, |h| unsafe { diffusph_set(h.s, c("T"), h.x.as_ptr(), LEN, 1) }, -2, "T[0]");
    let found = complaints(&sets);
    assert_eq!((found[0].as_str(), found[2].as_str(), found.len()), ("code 0, not -2", "the solver was changed", 3));
    let gets = Row("diffusph_limit", as_is, |h| unsafe { diffusph_limit(h.s, &mut h.value) }, 0, "");
    assert_eq!(complaints(&gets), ["a place for results was written"]);
}

/// Functions that need no row: these cannot fail, or only with NULL or a bad solver, which `guard.rs` tests for all.
const NO_ROW: &[&str] = &[
    "diffusph_version_number",
    "diffusph_abi_version",
    "diffusph_cancel",
    "diffusph_set_kappa_callback",
    "diffusph_set_source_callback",
    "diffusph_set_progress_callback",
    "diffusph_set_log_callback",
];

#[test]
fn every_function_has_a_row() {
    let covered: BTreeSet<&str> = TABLE.iter().map(|row| row.0).chain(NO_ROW.iter().copied()).collect();
    let functions = header::functions();
    let exported: BTreeSet<&str> = functions.iter().map(|f| f.name.as_str()).collect();
    assert_eq!(covered, exported);
}
