use super::*;
use crate::error::Error;

const BAD: Case = Case {
    number: 1,
    title: "a control",
    required: "the impossible",
    source: "",
    trials: || {
        vec![Trial::pass(""), Trial::fail("", "by design"), Trial::absent("everything"), Trial::pass("operator=no")]
    },
    check: |_, seen| {
        seen.at_most("NaN", f64::NAN, 1.0);
        Ok(())
    },
};

const GOOD: Case = Case {
    check: |_, seen| {
        seen.at_most("one", 1.0, 1.0);
        Ok(())
    },
    ..BAD
};

fn verdicts(case: &Case) -> Vec<Verdict> {
    run(&[case], 1, Box::new(|_| true)).unwrap().0.iter().map(|r| r.verdict).collect()
}

#[test]
fn what_fails_is_seen_to_fail_and_what_is_expected_is_told_from_what_is_not() {
    use Verdict::*;
    assert_eq!(verdicts(&BAD), [Fail, ExpectedFailure, Absent, Absent]);
    assert_eq!(verdicts(&GOOD), [Pass, UnexpectedPass, Absent, Absent]);
    let (rows, complete) = run(&[&BAD, &GOOD], 1, Box::new(|_| true)).unwrap();
    let answer = table::answer(&rows).unwrap();
    assert!(complete);
    assert_eq!(answer.failures, 2);
    assert!(answer.text.contains("2 not yet") || answer.text.contains("4 not yet"), "{}", answer.text);
    assert!(answer.text.contains("PASSES UNEXPECTEDLY") && answer.text.contains("NaN > 1"), "{}", answer.text);
}

#[test]
fn an_error_and_a_difference_between_threads_are_failures() {
    let errs = Case { check: |_, _| Err(Error::Cancelled), ..BAD };
    assert_eq!(verdicts(&errs)[0], Verdict::Fail);
    let differs = Case {
        check: |setting, seen| {
            seen.remember(&[setting.threads as f64]);
            Ok(())
        },
        ..BAD
    };
    assert_eq!(verdicts(&differs)[0], Verdict::Fail);
}

#[test]
fn a_study_that_is_stopped_keeps_what_it_has() {
    // More than are tried at once on any number of processors.
    let many = [&BAD; 500];
    let (rows, complete) = run(&many, 1, Box::new(|share| share < 0.5)).unwrap();
    assert!(!rows.is_empty() && rows.len() < many.len() * (BAD.trials)().len() && !complete);
}
