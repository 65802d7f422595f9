//! What can be chosen, by name: one list per choice, the same for the C ABI, the command line and the tests.

use crate::error::{CODES, Error, Result};
use crate::integrator::METHODS;
use crate::kernel;
use crate::model::MODELS;
use crate::model::conductivity::LAWS;
use crate::model::fields::{Access, FIELDS, NUMBERS};
use crate::operator::mean::MEANS;
use crate::operator::table::OPERATORS;
use crate::plan::auto;
use crate::plan::choices::WORDS;
use crate::plan::rules::RULES;

/// An item of a catalogue: its name, and what it is, in a line.
#[derive(Debug, Clone, PartialEq)]
pub struct Item {
    pub name: String,
    pub about: String,
}

type List = fn() -> Vec<Item>;

/// Every catalogue.
pub static CATALOGUES: &[(&str, List)] = &[
    ("models", || MODELS.iter().map(|m| item(m.name, m.about)).collect()),
    ("words", || WORDS.iter().map(|(name, about)| item(name, filled_in(about))).collect()),
    ("kernels", || kernel::catalogue().map(|(name, about)| item(name, about)).collect()),
    ("operators", || OPERATORS.iter().map(|o| item(o.name, o.about)).collect()),
    ("means", || MEANS.iter().map(|(name, _, about)| item(name, *about)).collect()),
    ("integrators", || integrators().map(|(name, about)| item(name, about)).collect()),
    ("laws", || LAWS.iter().map(|(name, about)| item(name, *about)).collect()),
    ("fields", fields),
    ("numbers", || NUMBERS.iter().map(|n| item(n.name, format!("{} [{}]", n.about, n.unit))).collect()),
    ("rules", || RULES.iter().map(|r| item(r.name, r.reason)).collect()),
    ("errors", || CODES.iter().map(|(code, name)| item(name, code.to_string())).collect()),
];

/// The items of a catalogue.
///
/// # Errors
/// `UnknownWord` with the catalogues that exist.
pub fn catalogue(name: &str) -> Result<Vec<Item>> {
    let found = CATALOGUES.iter().find(|(known, _)| *known == name);
    found.map(|(_, list)| list()).ok_or_else(|| Error::unknown("catalogue", name, CATALOGUES.iter().map(|(n, _)| n)))
}

fn item(name: &str, about: impl Into<String>) -> Item {
    Item { name: name.into(), about: about.into() }
}

fn integrators() -> impl Iterator<Item = (&'static str, &'static str)> {
    METHODS.iter().map(|m| (m.name, m.about)).chain([("auto", auto::ABOUT)])
}

/// What a word means, with the names that the tables have today.
fn filled_in(about: &str) -> String {
    let join = |names: Vec<&str>| names.join(", ");
    let own = |(name, h_fac): (&str, f64)| format!("{name} {h_fac}");
    let mut text = about.to_string();
    for (hole, names) in [
        ("{kernels}", join(kernel::catalogue().map(|k| k.0).collect())),
        ("{h_fac}", kernel::own_h_fac().map(own).collect::<Vec<_>>().join(", ")),
        ("{operators}", join(OPERATORS.iter().map(|o| o.name).collect())),
        ("{tensors}", join(OPERATORS.iter().filter(|o| o.takes_tensors).map(|o| o.name).collect())),
        ("{integrators}", join(integrators().map(|i| i.0).collect())),
    ] {
        text = text.replace(hole, &names);
    }
    text
}

fn fields() -> Vec<Item> {
    let about = |f: &crate::model::fields::Field| {
        let (verb, default) = match f.access {
            Access::Input { default, .. } => ("set or get", default),
            Access::Output { settable: true } => ("set or get", None),
            Access::Output { settable: false } => ("get", None),
        };
        let components = if f.vector { ", dim components" } else { "" };
        let default = default.map_or(String::new(), |v| format!(", default {v}"));
        format!("{} [{}], {verb}{components}{default}", f.about, f.unit)
    };
    FIELDS.iter().map(|f| item(f.name, about(f))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::Solver;

    #[test]
    fn every_item_has_a_unique_name_and_says_what_it_is() {
        for (name, list) in CATALOGUES {
            let items = list();
            assert!(!items.is_empty(), "{name}");
            for (i, item) in items.iter().enumerate() {
                assert!(!item.name.is_empty() && !item.about.is_empty(), "{name} {item:?}");
                assert!(items[..i].iter().all(|other| other.name != item.name), "{name} {item:?} twice");
            }
        }
        let words = catalogue("words").unwrap();
        assert!(words.iter().all(|word| !word.about.contains(['{', '}'])), "a name that is in no table");
        for (word, list) in [("kernel", "kernels"), ("operator", "operators"), ("integrator", "integrators")] {
            let about = &words.iter().find(|w| w.name == word).unwrap().about;
            for item in catalogue(list).unwrap() {
                assert!(about.contains(&item.name), "{word} does not say {}", item.name);
                Solver::new(&format!("heat {word}={}", item.name)).unwrap();
            }
        }
        assert!(catalogue("kernel").unwrap_err().to_string().contains("'kernels'"));
    }
}
