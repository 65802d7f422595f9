//! The words that make every choice: `heat dim=3 kernel=M6 operator=kernel`. The same spelling in C, Fortran, scene
//! files, the command line, file metadata and reports.

use crate::error::{Error, Result};
use std::collections::HashSet;

/// A line of words: bare ones, and `key=value` pairs. Every word must be used, or it is an error.
#[derive(Debug, Clone)]
pub struct Words<'a> {
    what: &'a str,
    bare: Vec<&'a str>,
    pairs: Vec<(&'a str, &'a str)>,
    known: Vec<&'static str>,
}

impl<'a> Words<'a> {
    /// Splits at white space and at the first `=` of each word. `what` names the line in errors.
    pub fn parse(what: &'a str, line: &'a str) -> Result<Words<'a>> {
        let mut words = Words { what, bare: Vec::new(), pairs: Vec::new(), known: Vec::new() };
        let mut keys = HashSet::new();
        for word in line.split_whitespace() {
            match word.split_once('=') {
                None => words.bare.push(word),
                Some((key, value)) if key.is_empty() || value.is_empty() => {
                    return Err(Error::bad(what, format!("'{word}'"), "write key=value without spaces around the ="));
                }
                Some((key, _)) if !keys.insert(key) => {
                    return Err(Error::bad(what, format!("'{line}'"), &format!("{key} is given twice")));
                }
                Some(pair) => words.pairs.push(pair),
            }
        }
        Ok(words)
    }

    /// Takes the next bare word.
    pub fn bare(&mut self) -> Option<&'a str> {
        if self.bare.is_empty() { None } else { Some(self.bare.remove(0)) }
    }

    /// Takes the value of a key.
    pub fn take(&mut self, key: &'static str) -> Option<&'a str> {
        self.known.push(key);
        let at = self.pairs.iter().position(|(k, _)| *k == key)?;
        Some(self.pairs.remove(at).1)
    }

    /// Takes a number that must obey `rule`, described by `sentence`.
    pub fn number(&mut self, key: &'static str, sentence: &str, rule: impl Fn(f64) -> bool) -> Result<Option<f64>> {
        let Some(text) = self.take(key) else { return Ok(None) };
        match text.parse::<f64>() {
            Ok(value) if rule(value) => Ok(Some(value)),
            Ok(_) => Err(Error::bad(key, format!("'{text}'"), sentence)),
            Err(_) => Err(Error::bad(key, format!("'{text}'"), &format!("it must be a number; {sentence}"))),
        }
    }

    /// Takes a whole number within a range.
    pub fn count(&mut self, key: &'static str, range: std::ops::RangeInclusive<u64>) -> Result<Option<u64>> {
        let Some(text) = self.take(key) else { return Ok(None) };
        match text.parse::<u64>() {
            Ok(value) if range.contains(&value) => Ok(Some(value)),
            _ => {
                let rule = format!("{key} must be a whole number from {} to {}", range.start(), range.end());
                Err(Error::bad(key, format!("'{text}'"), &rule))
            }
        }
    }

    /// Takes a comma-separated list of finite numbers.
    pub fn list(&mut self, key: &'static str) -> Result<Option<Vec<f64>>> {
        let Some(text) = self.take(key) else { return Ok(None) };
        let parse = |item: &str| item.parse::<f64>().ok().filter(|v| v.is_finite());
        let values: Option<Vec<f64>> = text.split(',').map(parse).collect();
        let rule = format!("{key} must be finite numbers separated by commas, like {key}=300,400");
        values.map(Some).ok_or_else(|| Error::bad(key, format!("'{text}'"), &rule))
    }

    /// Fails on the first word that nobody took, naming the nearest known one.
    pub fn done(self) -> Result<()> {
        match (self.bare.first(), self.pairs.first()) {
            (Some(word), _) => Err(Error::bad(self.what, format!("'{word}'"), "expected key=value here")),
            (None, Some((key, _))) => Err(Error::unknown(&format!("key in {}", self.what), key, self.known)),
            (None, None) => Ok(()),
        }
    }
}

/// One of a few words, whatever its case.
pub fn choice<T: Copy>(what: &str, word: &str, table: &[(&'static str, T)]) -> Result<T> {
    let found = table.iter().find(|(name, _)| name.eq_ignore_ascii_case(word));
    found.map(|(_, value)| *value).ok_or_else(|| Error::unknown(what, word, table.iter().map(|(name, _)| name)))
}

/// A line with these words in place of its own of the same keys, and without those of the keys in `dropped`.
pub fn replaced(line: &str, words: &str, dropped: &[&str]) -> String {
    let key = |word: &'_ str| word.split_once('=').map(|(key, _)| key.to_string());
    let new: Vec<String> = words.split_whitespace().filter_map(key).collect();
    let stays = |word: &&str| key(word).is_none_or(|key| !new.contains(&key) && !dropped.contains(&key.as_str()));
    line.split_whitespace().filter(stays).chain(words.split_whitespace()).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_take_the_place_of_those_of_their_key() {
        let line = replaced("heat dim=2 kernel=M4 normalise=pair", "kernel=C2 order=4", &["normalise"]);
        assert_eq!(line, "heat dim=2 kernel=C2 order=4");
    }

    #[test]
    fn every_word_is_used_or_refused() {
        let mut w = Words::parse("words", "heat dim=3 h_fac=1.2 kernl=M6").unwrap();
        assert_eq!(w.bare(), Some("heat"));
        assert_eq!(w.count("dim", 1..=3).unwrap(), Some(3));
        assert_eq!(w.number("h_fac", "positive", |v| v > 0.0).unwrap(), Some(1.2));
        assert_eq!(w.take("kernel"), None);
        let text = w.done().unwrap_err().to_string();
        assert!(text.contains("'kernl'") && text.contains("did you mean 'kernel'"), "{text}");
    }

    #[test]
    fn malformed_words_are_errors() {
        for line in ["dim=", "=3", "dim=3 dim=2"] {
            assert!(Words::parse("words", line).is_err(), "{line}");
        }
        let mut w = Words::parse("words", "dim=4 T=1,x stages=-1").unwrap();
        let text = Words::parse("words", "h_fac=abc")
            .unwrap()
            .number("h_fac", "positive", |v| v > 0.0)
            .unwrap_err()
            .to_string();
        assert!(text.contains("must be a number"), "{text}");
        assert!(w.count("dim", 1..=3).is_err() && w.list("T").is_err() && w.count("stages", 1..=9).is_err());
    }
}
