//! What a case saw: measured numbers beside their bounds, in one line, and whether all of it holds.

/// Grows by one requirement after the other.
#[derive(Debug, Default)]
pub struct Seen {
    parts: Vec<String>,
    /// Whether a requirement was not met.
    pub failed: bool,
    /// All that was measured, to the bit.
    pub bits: u64,
}

impl Seen {
    /// A number that must not exceed its bound; NaN does.
    pub fn at_most(&mut self, what: &str, value: f64, bound: f64) {
        self.number(what, value, value <= bound, &format!("> {}", short(bound)));
    }

    /// A number that must not fall below its bound; NaN does.
    pub fn at_least(&mut self, what: &str, value: f64, bound: f64) {
        self.number(what, value, value >= bound, &format!("< {}", short(bound)));
    }

    fn number(&mut self, what: &str, value: f64, holds: bool, broken: &str) {
        self.remember(&[value]);
        self.failed |= !holds;
        let verdict = if holds { String::new() } else { format!(" {broken}") };
        self.parts.push(format!("{what} {}{verdict}", short(value)));
    }

    /// A statement that must be true.
    pub fn require(&mut self, what: &str, holds: bool) {
        self.remember(&[f64::from(u8::from(holds))]);
        self.failed |= !holds;
        self.parts.push(if holds { what.to_string() } else { format!("NOT {what}") });
    }

    /// A remark that decides nothing.
    pub fn note(&mut self, what: impl Into<String>) {
        self.parts.push(what.into());
    }

    /// Values that must be the same for any number of threads (FNV-1a of their bits).
    pub fn remember(&mut self, values: &[f64]) {
        for byte in values.iter().flat_map(|v| v.to_bits().to_le_bytes()) {
            self.bits = (self.bits ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        }
    }

    pub fn text(&self) -> String {
        self.parts.join(", ")
    }
}

/// A number as a table shows it: two digits, an exponent where it is far from 1.
pub fn short(value: f64) -> String {
    let size = value.abs();
    match size == 0.0 || (1e-3..1e5).contains(&size) {
        true => format!("{}", (value * 1e4).round() / 1e4),
        false => format!("{value:.1e}"),
    }
}
