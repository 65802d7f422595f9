//! The Python module says the same as the header, and does what it says: a real interpreter imports it as it is installed.

use crate::common::header::{self, Argument};
use crate::common::{installed, root, run};
use std::path::{Path, PathBuf};
use std::process::Command;

fn interpreter() -> PathBuf {
    std::env::var_os("DIFFUSPH_PYTHON").map_or(root().join("target/venv/bin/python"), PathBuf::from)
}

/// Runs a script in a folder with the library installed there; answers what it printed.
fn python(folder: &Path, arguments: &[&str]) -> String {
    let prefix = installed(folder);
    let mut python = Command::new(interpreter());
    python.args(arguments).current_dir(folder).env("PYTHONPATH", prefix.join("include"));
    let done = run(python.env("PYTHONDONTWRITEBYTECODE", "1").env("MPLBACKEND", "agg"));
    let (out, err) = (String::from_utf8_lossy(&done.stdout), String::from_utf8_lossy(&done.stderr));
    assert!(done.status.success(), "{arguments:?}: {}\n{out}\n{err}", done.status);
    out.into_owned()
}

fn check(name: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    python(folder.path(), &[root().join("tests/hosts/host.py").to_str().unwrap(), name])
}

/// A C type as ctypes tells it: what a pointer to something of ours points to, it does not know.
fn as_ctypes(argument: &Argument) -> String {
    match argument.kind.as_str() {
        "diffusph_solver *" => "void *".into(),
        "diffusph_solver * *" => "void * *".into(),
        "uint32_t *" => "uint32_t *".into(),
        kind => kind.into(),
    }
}

#[test]
fn its_functions_and_report_are_the_header_s() {
    let said: serde_json::Value = serde_json::from_str(&check("tables")).unwrap();
    let functions = header::functions();
    assert_eq!(said["functions"].as_object().unwrap().len(), functions.len());
    for function in functions {
        let arguments: Vec<String> = function.arguments.iter().map(as_ctypes).collect();
        assert_eq!(said["functions"][&function.name], serde_json::json!(arguments), "{}", function.name);
        assert_eq!(function.result, "int32_t");
    }
    let report: Vec<[String; 2]> = header::report().into_iter().map(|m| [m.kind, m.name]).collect();
    assert_eq!(said["report"], serde_json::json!(report));
    assert_eq!(said["abi"], header::value_of("DIFFUSPH_ABI").unwrap());
    assert_eq!(said["version"], env!("CARGO_PKG_VERSION"));
    // pip's file has the crate's version.
    let pyproject = std::fs::read_to_string(root().join("pyproject.toml")).unwrap();
    assert!(pyproject.contains(&format!("\nversion = \"{}\"\n", env!("CARGO_PKG_VERSION"))));
}

#[test]
fn arrays_of_any_layout_are_read_and_written_in_place() {
    check("arrays");
}

#[test]
fn errors_carry_code_and_message_and_nothing_is_read_behind_an_array() {
    check("errors");
}

#[test]
fn callbacks_work_and_what_they_raise_is_raised() {
    check("callbacks");
}

#[test]
fn other_threads_run_and_may_cancel() {
    check("threads");
}

#[test]
fn solvers_end_and_files_go_on() {
    check("ends");
}

#[test]
fn everything_public_is_documented() {
    check("documented");
}

#[test]
fn the_examples_run() {
    for (name, says) in [("heat.py", "energy 312.6"), ("moving.py", "t = 0.20 s")] {
        let folder = tempfile::tempdir().unwrap();
        let out = python(folder.path(), &[root().join("c_examples").join(name).to_str().unwrap()]);
        assert!(out.contains(says), "{name}: {out}");
    }
}
