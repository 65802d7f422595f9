//! What the C ABI tells: the log, texts in short buffers, catalogues, versions, series of files.

use crate::common::host::{Host, c, created, message, read, user};
use diffusph::ffi::*;
use std::ffi::{c_char, c_void};
use std::ptr::{null, null_mut};
use std::sync::Mutex;

unsafe extern "C-unwind" fn notes(lines: *mut c_void, level: i32, text: *const c_char) {
    // SAFETY: the library's word, and the test's.
    unsafe {
        let text = std::ffi::CStr::from_ptr(text).to_str().unwrap().to_string();
        (*lines.cast::<Mutex<Vec<(i32, String)>>>()).lock().unwrap().push((level, text));
    }
}

#[test]
fn the_log_tells_mistakes_plan_and_steps() {
    let host = Host::ready("heat dim=2 threads=1");
    let lines = Mutex::new(Vec::<(i32, String)>::new());
    // SAFETY: `lines` outlives the solver's use of it.
    unsafe {
        assert_eq!(diffusph_set_log_callback(host.s, Some(notes), user(&lines)), 0);
        assert_eq!(diffusph_step(host.s, 1e-3, null_mut()), 0);
        assert_eq!(diffusph_step(host.s, 1e-3, null_mut()), 0);
        assert_eq!(diffusph_set_number(host.s, c("kappa"), -1.0), -2);
        assert_eq!(diffusph_set_log_callback(host.s, None, null_mut()), 0);
        assert_eq!(diffusph_step(host.s, 1e-3, null_mut()), 0);
    }
    let lines = lines.into_inner().unwrap();
    let levels: Vec<i32> = lines.iter().map(|line| line.0).collect();
    assert_eq!(levels, [DIFFUSPH_LOG_INFO, DIFFUSPH_LOG_DEBUG, DIFFUSPH_LOG_DEBUG, DIFFUSPH_LOG_ERROR], "{lines:?}");
    assert!(lines[0].1.contains("left out") && lines[1].1.starts_with("step to t = 1e-3"), "{lines:?}");
    assert_eq!(lines[3].1, message(host.s));
}

#[test]
fn texts_are_cut_to_fit() {
    let host = Host::ready("heat dim=2 threads=1");
    let (mut needed, mut short, mut all) = (0, [b'?' as c_char; 9], vec![b'?' as c_char; 9999]);
    // SAFETY: the buffers have the lengths that are said.
    unsafe {
        assert_eq!(diffusph_plan(host.s, null_mut(), 0, &mut needed), 0);
        assert_eq!(diffusph_plan(host.s, short.as_mut_ptr(), 8, null_mut()), 0);
        assert_eq!(diffusph_plan(host.s, all.as_mut_ptr(), 9999, null_mut()), 0);
        assert_eq!((read(&short), short[8]), ("heat: 2".into(), b'?' as c_char));
        assert_eq!(read(&all).len() as i64 + 1, needed);
        // A letter of two bytes is not cut in half: the error repeats the word.
        let mut why = [b'?' as c_char; 19];
        assert_eq!(diffusph_create(c("héat"), &mut null_mut(), why.as_mut_ptr(), 17), -5);
        assert_eq!(read(&why), "unknown model 'h");
    }
}

#[test]
fn catalogues_and_versions_are_rust_s() {
    for (list, items) in diffusph::solver::catalogue::CATALOGUES {
        let (mut count, items) = (0, items());
        // SAFETY: all places are ours.
        unsafe {
            assert_eq!(diffusph_count(c(list), &mut count), 0);
            assert_eq!(count, items.len() as i64);
            for (i, item) in (0..).zip(&items) {
                let (mut name, mut about) = ([0; 256], [0; 256]);
                assert_eq!(diffusph_name(c(list), i, name.as_mut_ptr(), 256), 0);
                assert_eq!(diffusph_about(c(list), i, about.as_mut_ptr(), 256), 0);
                assert_eq!((read(&name), read(&about)), (item.name.clone(), item.about.clone()));
            }
        }
    }
    let mut text = [0; 64];
    // SAFETY: the buffer is ours.
    unsafe {
        assert_eq!(diffusph_version(text.as_mut_ptr(), 64), 0);
        assert_eq!(read(&text), env!("CARGO_PKG_VERSION"));
        assert_eq!(diffusph_error_name(-3, text.as_mut_ptr(), 64), 0);
        assert_eq!(read(&text), "WRONG_COUNT");
    }
    assert_eq!((diffusph_version_number(), diffusph_abi_version()), (DIFFUSPH_VERSION_NUMBER, DIFFUSPH_ABI));
}

#[test]
fn a_series_goes_on_after_a_restart() {
    let mut host = Host::ready("heat dim=2 threads=1");
    let times = |host: &Host| -> Vec<(String, f64)> {
        let series = diffusph::io::Series::read(host.dir.path().join("run.pvd")).unwrap();
        series.entries().iter().map(|e| (e.file.clone(), e.time)).collect()
    };
    let pvd = host.path("run.pvd");
    // SAFETY: the strings are ours.
    let write = |host: &mut Host, time: f64| unsafe {
        assert_eq!(diffusph_set_number(host.s, c("time"), time), 0);
        assert_eq!(diffusph_write_series(host.s, pvd), 0);
    };
    [0.0, 1.0, 2.0].into_iter().for_each(|time| write(&mut host, time));
    let first = ("run_0000.vtu".to_string(), 0.0);
    assert_eq!(times(&host), [first.clone(), ("run_0001.vtu".into(), 1.0), ("run_0002.vtu".into(), 2.0)]);
    // SAFETY: the string is ours. From the first snapshot on, anew.
    assert_eq!(unsafe { diffusph_read_vtk(host.s, host.path("run_0000.vtu")) }, 0);
    write(&mut host, 0.5);
    assert_eq!(times(&host), [first, ("run_0001.vtu".into(), 0.5)]);
}

#[test]
fn null_reports_and_empty_clouds_are_fine() {
    let s = created("heat dim=2 threads=1");
    // SAFETY: there are no particles to read.
    unsafe {
        assert_eq!(diffusph_set_particles(s, 0, null(), 2, null(), null(), null()), 0);
        assert_eq!(diffusph_step(s, 1.0, null_mut()), 0, "{}", message(s));
        assert_eq!(diffusph_get(s, c("T"), null_mut(), 0, 1), 0);
        assert_eq!(diffusph_destroy(s), 0);
    }
}
