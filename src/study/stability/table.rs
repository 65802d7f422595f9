//! The rows of the suite as text for people and as JSON for programs.

use super::{Case, Expect, Seen, Trial};
use crate::error::{Error, Result};
use crate::study::page::Page;
use crate::study::request::Answer;
use crate::study::table::{Cell, Table, column};
use serde::Serialize;
use std::fmt::Write;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    Pass,
    Fail,
    /// It fails, as it must by its nature.
    ExpectedFailure,
    /// It was expected to fail and does not: what was believed of it is wrong.
    UnexpectedPass,
    /// What it is about does not exist yet.
    Absent,
}

use Verdict::{Absent, ExpectedFailure, Fail, Pass, UnexpectedPass};

impl Verdict {
    const ALL: [(Verdict, &str); 5] = [
        (Pass, "pass"),
        (Fail, "FAIL"),
        (ExpectedFailure, "fails as expected"),
        (UnexpectedPass, "PASSES UNEXPECTEDLY"),
        (Absent, "not yet"),
    ];

    fn word(self) -> &'static str {
        Verdict::ALL.iter().find(|(v, _)| *v == self).map_or("", |(_, word)| word)
    }

    /// Whether this is as it should be.
    pub fn is_right(self) -> bool {
        !matches!(self, Fail | UnexpectedPass)
    }
}

/// One case tried with one choice of words.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    pub case: u32,
    pub title: &'static str,
    pub required: &'static str,
    pub source: &'static str,
    /// Empty for the default method.
    pub words: String,
    pub verdict: Verdict,
    pub seen: String,
    /// Why it is expected to fail, or what is missing.
    pub reason: String,
}

impl Row {
    pub fn new(case: &Case, trial: &Trial, seen: Option<Seen>) -> Row {
        let (verdict, reason) = match (trial.expect, &seen) {
            (Expect::Absent(missing), _) => (Absent, missing.to_string()),
            (_, None) => (Absent, format!("operator {}", trial.unknown_operator().unwrap_or("?"))),
            (Expect::Pass, Some(seen)) => (if seen.failed { Fail } else { Pass }, String::new()),
            (Expect::Fail(why), Some(seen)) => (if seen.failed { ExpectedFailure } else { UnexpectedPass }, why.into()),
        };
        let seen = seen.map_or_else(String::new, |seen| seen.text());
        let (words, Case { number, title, required, source, .. }) = (trial.words.clone(), case);
        Row { case: *number, title, required, source, words, verdict, seen, reason }
    }
}

/// The table, and how many rows are not as they should be.
///
/// # Errors
/// What serde finds wrong.
pub fn answer(rows: &[Row]) -> Result<Answer> {
    let json = serde_json::to_value(rows).map_err(|e| Error::bad("rows", e, "report this, please"))?;
    let failures = rows.iter().filter(|r| !r.verdict.is_right()).count();
    let files = vec![("stability.html".to_string(), page(rows).html()?)];
    Ok(Answer { text: text(rows), json, failures, files, ..Answer::default() })
}

/// A table for each case under what it requires.
fn page(rows: &[Row]) -> Page {
    let mut page = Page::new("stability", "Cases that break solvers: required and seen");
    page.find(counts(rows));
    for case in rows.chunk_by(|a, b| a.case == b.case) {
        let Row { case: number, title, required, .. } = &case[0];
        let columns = ["verdict", "words", "seen", "reason"].map(|name| column(name, ""));
        let mut table = Table::new("case", &columns).of(&format!("{number} {title}: {required}"));
        for row in case {
            let words = if row.words.is_empty() { "default" } else { &row.words };
            table.push([row.verdict.word(), words, &row.seen, &row.reason].map(Cell::from));
        }
        page.tables.push(table);
    }
    page
}

fn counts(rows: &[Row]) -> String {
    let count = |verdict| rows.iter().filter(|r| r.verdict == verdict).count();
    let counts: Vec<String> = Verdict::ALL.iter().map(|(v, word)| format!("{} {word}", count(*v))).collect();
    format!("{} rows: {}", rows.len(), counts.join(", "))
}

fn text(rows: &[Row]) -> String {
    let mut text = String::new();
    let mut last = 0;
    for row in rows {
        if row.case != last {
            let source = if row.source.is_empty() { String::new() } else { format!(" ({})", row.source) };
            let _ = writeln!(text, "{:>2} {}: {}{source}", row.case, row.title, row.required);
            last = row.case;
        }
        let words = if row.words.is_empty() { "default" } else { &row.words };
        let seen =
            [row.seen.as_str(), row.reason.as_str()].iter().filter(|s| !s.is_empty()).copied().collect::<Vec<_>>();
        let _ = writeln!(text, "   {:<17}  {words:<45}  {}", row.verdict.word(), seen.join(" | "));
    }
    let _ = writeln!(text, "{}", counts(rows));
    text
}
