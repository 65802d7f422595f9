//! The floors of the house: a room uses only rooms below it.

use std::path::{Path, PathBuf};

/// From the ground up. Rooms on one floor do not know each other.
const FLOORS: &[&[&str]] = &[
    &["error"],
    &["memory"],
    &["pool", "array", "words"],
    &["sum"],
    &["kernel"],
    &["space"],
    &["operator"],
    &["integrator", "model"],
    &["plan", "io"],
    &["solver"],
    &["study"],
    &["ffi", "cli"],
];

fn floor(room: &str) -> Option<usize> {
    FLOORS.iter().position(|floor| floor.contains(&room))
}

/// What a source file of a room uses that it must not.
fn trespasses(room: &str, source: &str) -> Vec<String> {
    let own = floor(room).unwrap_or_else(|| panic!("room '{room}' has no floor"));
    let code: String = source.lines().map(|l| l.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n");
    let mut bad = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        let name: String = code[at + 7..].chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        let allowed = match floor(&name) {
            Some(theirs) => name == room || theirs < own,
            // The crate's own re-exports, its macros and constants.
            None => own >= FLOORS.len() - 2,
        };
        if !allowed {
            bad.push(format!("{room} uses {name}"));
        }
    }
    bad
}

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn a_room_uses_only_rooms_below_it() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut all = Vec::new();
    files(&src, &mut all);
    let mut bad = Vec::new();
    for path in all {
        let inside = path.strip_prefix(&src).unwrap();
        let first = inside.iter().next().unwrap().to_str().unwrap();
        let room = first.strip_suffix(".rs").unwrap_or(first);
        if room == "lib" || room == "main" {
            continue;
        }
        let source = std::fs::read_to_string(&path).unwrap();
        // Unit tests may look upstairs.
        let code = source.split("mod tests {").next().unwrap();
        let is_test = inside.file_name().is_some_and(|n| n == "tests.rs");
        bad.extend(
            trespasses(room, if is_test { "" } else { code }).into_iter().map(|b| format!("{}: {b}", inside.display())),
        );
    }
    assert!(bad.is_empty(), "{}", bad.join("\n"));
}

#[test]
fn the_check_can_fail() {
    assert_eq!(trespasses("kernel", "use crate::error::Error;\nuse crate::operator::Mean;"), ["kernel uses operator"]);
    assert_eq!(trespasses("model", "fn f() { crate::integrator::find(\"x\"); }"), ["model uses integrator"]);
    assert!(trespasses("plan", "use crate::model::heat; // crate::cli").is_empty());
}
