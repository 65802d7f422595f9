//! What can be chosen, by name: one list per choice, the same for the C ABI, the command line and the tests.

use crate::error::{CODES, Error, Result};
use crate::integrator::METHODS;
use crate::kernel;
use crate::model::MODELS;
use crate::model::conductivity::LAWS;
use crate::model::fields::{Access, FIELDS, NUMBERS};
use crate::operator::mean::MEANS;
use crate::operator::table::OPERATORS;
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
    ("words", || WORDS.iter().map(|(name, about)| item(name, *about)).collect()),
    ("kernels", || kernel::catalogue().map(|(name, about)| item(name, about)).collect()),
    ("operators", || OPERATORS.iter().map(|o| item(o.name, o.about)).collect()),
    ("means", || MEANS.iter().map(|(name, _, about)| item(name, *about)).collect()),
    ("integrators", || METHODS.iter().map(|m| item(m.name, m.about)).collect()),
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

fn fields() -> Vec<Item> {
    let about = |f: &crate::model::fields::Field| match f.access {
        Access::Input { default: Some(v), .. } => format!("{} [{}], set or get, default {v}", f.about, f.unit),
        Access::Input { default: None, .. } => format!("{} [{}], set or get", f.about, f.unit),
        Access::Output if f.vector => format!("{} [{}], get, dim components", f.about, f.unit),
        Access::Output => format!("{} [{}], get", f.about, f.unit),
    };
    FIELDS.iter().map(|f| item(f.name, about(f))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert!(catalogue("kernel").unwrap_err().to_string().contains("'kernels'"));
    }
}
