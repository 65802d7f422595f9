//! The stability suite, as `diffusph study stability` runs it.

use diffusph::study::stability::{self, Row, Verdict};
use std::process::Command;

/// Models that some cases wait for; an operator may be absent only while its words are not known.
const MISSING: &[&str] = &["model radiation", "model dust"];

#[test]
fn nothing_fails_that_should_pass_and_what_should_fail_does() {
    let (rows, _) = stability::run(&stability::cases(), 1, Box::new(|_| true)).unwrap();
    let wrong: Vec<&Row> = rows.iter().filter(|r| !r.verdict.is_right()).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
    let absent = rows.iter().filter(|r| r.verdict == Verdict::Absent && r.words.is_empty());
    assert!(absent.clone().count() > 0 && absent.clone().all(|r| MISSING.contains(&r.reason.as_str())));
    let failing = rows.iter().filter(|r| r.verdict == Verdict::ExpectedFailure);
    assert!(failing.clone().count() > 5 && failing.clone().all(|r| !r.reason.is_empty() && !r.seen.is_empty()));
}

/// Rows that pass with solvers that conduct `conducts` times as much as they are asked to.
fn blind(numbers: &[u32], conducts: f64) -> (Vec<Row>, usize) {
    let cases: Vec<_> = stability::cases().into_iter().filter(|case| numbers.contains(&case.number)).collect();
    let (rows, _) = stability::control(&cases, 1, conducts, Box::new(|_| true)).unwrap();
    let tried = rows.iter().filter(|r| matches!(r.verdict, Verdict::Pass | Verdict::Fail)).count();
    (rows.into_iter().filter(|r| r.verdict == Verdict::Pass).collect(), tried)
}

#[test]
fn a_solver_that_does_nothing_fails_where_something_must_move() {
    let (passing, tried) = blind(&[1, 2, 3, 4, 5, 14, 28, 30, 31, 32, 33, 41, 43, 44, 54], 0.0);
    assert!(passing.is_empty() && tried > 60, "of {tried}: {passing:#?}");
}

#[test]
fn a_solver_that_is_wrong_by_a_fifth_fails_where_a_rate_is_known() {
    let (passing, tried) = blind(&[1, 2, 3, 28, 30, 31, 32, 33, 44], 0.8);
    // Of the first three, methods that take one long step, or are of first order, are wrong by as much.
    let coarse = ["euler", "rkl1", "crank-nicolson", "sdirk2"];
    let first = |row: &&Row| row.case > 3 || !coarse.iter().any(|m| row.words.contains(m));
    let passing: Vec<&Row> = passing.iter().filter(first).collect();
    assert!(passing.is_empty() && tried > 40, "of {tried}: {passing:#?}");
}

#[test]
fn there_are_62_cases_each_with_a_number_of_its_own() {
    let numbers: Vec<u32> = stability::cases().iter().map(|case| case.number).collect();
    assert_eq!(numbers, (1..=62).collect::<Vec<_>>());
    for case in stability::cases() {
        assert!(!case.title.is_empty() && !case.required.is_empty() && !(case.trials)().is_empty(), "{}", case.number);
    }
}

#[test]
fn every_study_is_listed_and_an_unknown_one_is_answered() {
    let ask = |arguments: &[&str]| Command::new(env!("CARGO_BIN_EXE_diffusph")).args(arguments).output().unwrap();
    assert!(String::from_utf8_lossy(&ask(&["list", "studies"]).stdout).contains("stability"));
    let unknown = ask(&["study", "stabilty"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("did you mean 'stability'"));
}
