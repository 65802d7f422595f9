//! Every way to fail: a code for programs, the numbers that explain it, and what to do next.
//!
//! The sign of a code follows SUNDIALS: `0` done, `> 0` recoverable (nothing changed; ask for less), `< 0` the call
//! or the world was wrong (nothing changed either). A number is never given a second meaning.

use thiserror::Error;

pub type Result<T> = std::result::Result<T, Error>;

#[derive(Debug, Clone, PartialEq, Error)]
pub enum Error {
    // Recoverable: the state is as it was.
    #[error(
        "step of {dt:e} needs some {needed:.1e} applications of the operator, more than max_applications={allowed}; take a smaller dt, raise max_applications, or {remedy}"
    )]
    StepTooLarge { dt: f64, needed: f64, allowed: u64, remedy: String },
    #[error(
        "{what} became {value} at particle {index}; nothing was changed: check what was set there (source, kappa, c_v, h_conv, flux_in), or take a smaller dt"
    )]
    NotFinite { what: String, index: usize, value: f64 },
    #[error(
        "T of particle {index} left its bounds: {value:e} is outside [{low:e}, {high:e}], which {promise}; nothing was changed: take a smaller dt, an operator that is positive (brookshaw, kernel, projected; limited or monotone for tensors), or say bounds=free"
    )]
    OutOfBounds { index: usize, value: f64, low: f64, high: f64, promise: String },
    #[error(
        "the step made T grow: its weighted norm rose from {before:e} to {after:e} where nothing heats; operator {operator} has growing modes on these particles: use operator=brookshaw or operator=kernel"
    )]
    Growth { before: f64, after: f64, operator: String },
    #[error("cancelled by the host; nothing was changed")]
    Cancelled,
    #[error(
        "{what} did not converge after {iterations} iterations (residual {residual:e}, wanted {wanted:e}); {remedy}"
    )]
    NotConverged { what: String, iterations: u64, residual: f64, wanted: f64, remedy: String },
    #[error("the {which} callback returned {code}; nothing was changed")]
    CallbackFailed { which: String, code: i32 },
    #[error(
        "no choice is known to err by less than {wanted:e} on these particles; the best is '{best}' with {error:e}, which includes what the reference may be wrong by, {reference:e}; ask for less, or use more particles"
    )]
    OutOfReach { wanted: f64, best: String, error: f64, reference: f64 },

    // The call was wrong.
    #[error("{argument} is NULL; pass {expected}")]
    NullPointer { argument: String, expected: String },
    #[error("{argument} is {value}; {rule}")]
    BadValue { argument: String, value: String, rule: String },
    #[error("{argument}[{index}] is {value}; {rule}")]
    BadElement { argument: String, index: usize, value: String, rule: String },
    #[error("{argument} has {got} values, expected {expected}; {remedy}")]
    WrongCount { argument: String, got: i64, expected: i64, remedy: String },
    #[error("{call} needs {missing} first")]
    OutOfOrder { call: String, missing: String },
    #[error("{}", unknown_word(.what, .word, .known))]
    UnknownWord { what: String, word: String, known: Vec<String> },
    #[error(
        "the box is {length:e} long on axis {axis}, but the support of particle {index} reaches {reach:e}, so more than {images} images of it would be needed; enlarge the box or lower h_fac"
    )]
    BoxTooSmall { axis: usize, length: f64, reach: f64, index: usize, images: usize },

    // The world was wrong.
    #[error("{path}: {reason}")]
    Io { path: String, reason: String },
    #[error("{path}: {reason}")]
    BadFile { path: String, reason: String },
    #[error(
        "there is no room for the {bytes} bytes of {what} ({available} are said to be available in all); use fewer particles, fewer neighbours (smaller h_fac), or raise memory= where that is the limit"
    )]
    NoMemory { what: String, bytes: u64, available: u64 },

    // The handle was used wrongly, or is broken.
    #[error("the solver is busy in another call; use one solver per thread, or wait")]
    Busy,
    #[error("an earlier call failed inside the library ({reason}); destroy this solver and create a new one")]
    Poisoned { reason: String },
    #[error(
        "this process was forked after the solver was created (pid {created}, now {now}); create the solver in the child"
    )]
    Forked { created: u32, now: u32 },
    #[error("internal error: {reason}; the solver is unusable now, destroy it, and please report this")]
    Panic { reason: String },
}

impl Error {
    /// The stable number of this error, as returned by every C function.
    pub fn code(&self) -> i32 {
        self.entry().0
    }

    /// The stable name of this error's code, e.g. `BAD_VALUE`.
    pub fn name(&self) -> &'static str {
        self.entry().1
    }

    fn entry(&self) -> (i32, &'static str) {
        let code = match self {
            Error::StepTooLarge { .. } => 1,
            Error::NotFinite { .. } => 2,
            Error::OutOfBounds { .. } => 3,
            Error::Growth { .. } => 4,
            Error::Cancelled => 5,
            Error::NotConverged { .. } => 6,
            Error::CallbackFailed { .. } => 7,
            Error::OutOfReach { .. } => 8,
            Error::NullPointer { .. } => -1,
            Error::BadValue { .. } | Error::BadElement { .. } => -2,
            Error::WrongCount { .. } => -3,
            Error::OutOfOrder { .. } => -4,
            Error::UnknownWord { .. } => -5,
            Error::BoxTooSmall { .. } => -6,
            Error::Io { .. } => -7,
            Error::BadFile { .. } => -8,
            Error::NoMemory { .. } => -9,
            Error::Busy => -10,
            Error::Poisoned { .. } => -11,
            Error::Forked { .. } => -12,
            Error::Panic { .. } => -13,
        };
        (code, name_of(code).unwrap_or("UNKNOWN"))
    }

    /// Shorthand for a scalar argument that breaks its rule.
    pub fn bad(argument: &str, value: impl ToString, rule: &str) -> Error {
        Error::BadValue { argument: argument.into(), value: shown(value), rule: rule.into() }
    }

    /// Shorthand for an array element that breaks its rule.
    pub fn bad_at(argument: &str, index: usize, value: impl ToString, rule: &str) -> Error {
        Error::BadElement { argument: argument.into(), index, value: shown(value), rule: rule.into() }
    }

    /// Shorthand for a word that is in none of the known ones.
    pub fn unknown(what: &str, word: &str, known: impl IntoIterator<Item = impl ToString>) -> Error {
        let known = known.into_iter().map(|k| k.to_string()).collect();
        Error::UnknownWord { what: what.into(), word: word.into(), known }
    }
}

/// A value as people write it: Rust writes 1e300 with all its zeros.
fn shown(value: impl ToString) -> String {
    let text = value.to_string();
    match text.parse::<f64>() {
        Ok(number) if text.len() > 24 => format!("{number:e}"),
        _ => text,
    }
}

/// Every code with its name: the single list behind the C macros, the catalogue `errors` and `Error::name`.
pub static CODES: &[(i32, &str)] = &[
    (0, "DONE"),
    (1, "STEP_TOO_LARGE"),
    (2, "NOT_FINITE"),
    (3, "OUT_OF_BOUNDS"),
    (4, "GROWTH"),
    (5, "CANCELLED"),
    (6, "NOT_CONVERGED"),
    (7, "CALLBACK_FAILED"),
    (8, "OUT_OF_REACH"),
    (-1, "NULL_POINTER"),
    (-2, "BAD_VALUE"),
    (-3, "WRONG_COUNT"),
    (-4, "OUT_OF_ORDER"),
    (-5, "UNKNOWN_WORD"),
    (-6, "BOX_TOO_SMALL"),
    (-7, "IO"),
    (-8, "BAD_FILE"),
    (-9, "NO_MEMORY"),
    (-10, "BUSY"),
    (-11, "POISONED"),
    (-12, "FORKED"),
    (-13, "PANIC"),
];

/// The name of a code, if there is such a code.
pub fn name_of(code: i32) -> Option<&'static str> {
    CODES.iter().find(|(c, _)| *c == code).map(|(_, name)| *name)
}

fn unknown_word(what: &str, word: &str, known: &[String]) -> String {
    let list = known.join(", ");
    match nearest(word, known) {
        Some(guess) => format!("unknown {what} '{word}'; did you mean '{guess}'? Known: {list}"),
        None => format!("unknown {what} '{word}'; known: {list}"),
    }
}

/// The known word that a typing error most likely meant: the smallest edit distance, at most a third of the length.
pub fn nearest<'a>(word: &str, known: &'a [String]) -> Option<&'a str> {
    let distance = |k: &str| edit_distance(&word.to_lowercase(), &k.to_lowercase());
    let best = known.iter().min_by_key(|k| distance(k))?;
    (distance(best) <= word.chars().count().max(3).div_ceil(3)).then_some(best.as_str())
}

fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &cb) in b.iter().enumerate() {
            let substitution = diagonal + usize::from(ca != cb);
            diagonal = row[j + 1];
            row[j + 1] = substitution.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_unique_and_named() {
        for (i, (code, name)) in CODES.iter().enumerate() {
            assert!(CODES[..i].iter().all(|(c, n)| c != code && n != name), "{code} {name} twice");
        }
        assert_eq!(Error::Busy.name(), "BUSY");
        assert_eq!(Error::bad("dt", -1.0, "dt must be positive").code(), -2);
        assert_eq!(Error::bad("dt", 1e300, "too long").to_string(), "dt is 1e300; too long");
    }

    #[test]
    fn a_typing_error_gets_the_nearest_word() {
        let known: Vec<String> = ["brookshaw", "direct", "kernel"].map(String::from).to_vec();
        assert_eq!(nearest("brokshaw", &known), Some("brookshaw"));
        assert_eq!(nearest("Kernal", &known), Some("kernel"));
        assert_eq!(nearest("zzz", &known), None);
        let text = Error::unknown("operator", "brokshaw", &known).to_string();
        assert!(text.contains("did you mean 'brookshaw'") && text.contains("direct"), "{text}");
    }
}
