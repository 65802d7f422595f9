//! `diffusph list`: the solver's catalogues, the scene's keys, the exact solutions.

use crate::error::{Error, Result};
use crate::solver::catalogue::{CATALOGUES, Item};
use crate::study::{catalogue::STUDIES, exact::SOLUTIONS, keys::KEYS, lattice::LATTICES};
use std::fmt::Write;

/// Lists of the program, beside those of the solver.
static OWN: &[(&str, &str)] = &[
    ("scene", "every key of a scene file"),
    ("demo", "the scene that comes with the program, to start from: list demo > my.toml"),
    ("exact", "exact solutions, with their parameters"),
    ("lattices", "lattices of particles"),
    ("studies", "what 'diffusph study' measures"),
];

/// A list, or all of them by name.
///
/// # Errors
/// `UnknownWord` with the lists that exist.
pub fn text(name: Option<&str>) -> Result<String> {
    let catalogue = CATALOGUES.iter().find(|(known, _)| Some(*known) == name);
    Ok(match (name, catalogue) {
        (_, Some((_, list))) => table(list().iter().map(|Item { name, about }| (name.as_str(), about.as_str()))),
        (Some("scene"), _) => scene(),
        (Some("demo"), _) => super::DEFAULT_SCENE.to_string(),
        (Some("exact"), _) => exact(),
        (Some("lattices"), _) => table(LATTICES.iter().map(|l| (l.name, l.about))),
        (Some("studies"), _) => table(STUDIES.iter().map(|s| (s.name, s.about))),
        (None, _) => {
            let names = |(name, list): &(&'static str, fn() -> Vec<Item>)| {
                (*name, list().iter().map(|i| i.name.as_str()).collect::<Vec<_>>().join(", "))
            };
            let lists: Vec<_> = CATALOGUES.iter().map(names).collect();
            table(lists.iter().map(|(name, items)| (*name, items.as_str())).chain(OWN.iter().copied()))
        }
        (Some(name), None) => {
            return Err(Error::unknown("list", name, CATALOGUES.iter().map(|c| c.0).chain(OWN.iter().map(|o| o.0))));
        }
    })
}

fn table<'a>(rows: impl Iterator<Item = (&'a str, &'a str)> + Clone) -> String {
    let width = rows.clone().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    rows.fold(String::new(), |mut text, (name, about)| {
        let line = format!("{name:<width$}  {about}");
        let _ = writeln!(text, "{}", line.trim_end());
        text
    })
}

fn scene() -> String {
    let mut text = String::new();
    let mut section = "";
    for (of, key, about) in KEYS {
        if *of != section {
            section = of;
            let _ = match *of {
                "mark" => writeln!(text, "[[mark]]"),
                "where" => writeln!(text, "where = {{ … }} of a [[mark]]"),
                _ => writeln!(text, "[{of}]"),
            };
        }
        let line = format!("  {key:<10}{about}");
        let _ = writeln!(text, "{}", line.trim_end());
    }
    text
}

fn exact() -> String {
    SOLUTIONS.iter().fold(String::new(), |mut text, solution| {
        let _ = writeln!(text, "{}\n  {}", solution.name, solution.about);
        for (name, default, about) in solution.parameters {
            let default = match default {
                None => String::new(),
                Some([one]) => format!(" [{one}]"),
                Some(many) => format!(" {many:?}"),
            };
            let _ = writeln!(text, "    {name:<12}{about}{default}");
        }
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_list_can_be_printed_and_is_named_where_one_is_unknown() {
        let all = text(None).unwrap();
        let complaint = text(Some("kernal")).unwrap_err().to_string();
        assert!(complaint.contains("did you mean 'kernels'"), "{complaint}");
        for name in CATALOGUES.iter().map(|c| c.0).chain(OWN.iter().map(|o| o.0)) {
            assert!(text(Some(name)).unwrap().lines().count() > 0, "{name}");
            assert!(all.contains(name) && complaint.contains(name), "{name}");
        }
    }
}
