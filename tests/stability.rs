//! The stability suite, as `diffusph study stability` runs it.
#![cfg(feature = "cli")]

use diffusph::study::stability::{self, Row};
use std::process::Command;

fn rows() -> Vec<Row> {
    stability::run(&stability::cases(), 1, Box::new(|_| true)).unwrap()
}

#[test]
fn nothing_fails_that_should_pass_and_what_should_fail_does() {
    let rows = rows();
    let wrong: Vec<&Row> = rows.iter().filter(|r| !r.verdict.is_right()).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn every_study_is_listed_and_an_unknown_one_is_answered() {
    let ask = |arguments: &[&str]| Command::new(env!("CARGO_BIN_EXE_diffusph")).args(arguments).output().unwrap();
    assert!(String::from_utf8_lossy(&ask(&["list", "studies"]).stdout).contains("stability"));
    let unknown = ask(&["study", "stabilty"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("did you mean 'stability'"));
}
