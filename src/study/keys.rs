//! The keys of a scene file: what they mean, and what is said about one that does not exist.

use crate::error::{Error, nearest};

/// Every key: section, name, meaning.
pub static KEYS: &[(&str, &str, &str)] = &[
    ("", "title", "what the report is headed by"),
    ("", "words", "the solver's words: \"heat dim=2 kernel=M6\" (list words)"),
    ("box", "lo", "lower bounds, one number per axis"),
    ("box", "hi", "upper bounds"),
    ("box", "periodic", "true, false (default), or one of them per axis"),
    (
        "particles",
        "file",
        "a VTK file, looked for beside the scene; arrays with the names of quantities are taken, and from a snapshot all that it holds, its box and time included",
    ),
    ("particles", "lattice", "cubic, square, hexagonal or fcc, filling the box"),
    ("particles", "n", "cells of the lattice along the first axis"),
    ("particles", "jitter", "random displacement of every coordinate, at most this share of the spacing (default 0)"),
    ("particles", "seed", "of the displacements (default 1)"),
    (
        "particles",
        "glass",
        "true: displaced particles (jitter = 0.5) that have pushed each other apart until they are evenly spaced without a lattice; in a periodic box (default false)",
    ),
    (
        "set",
        "QUANTITY",
        "a number; the name of an array of the file; T = \"exact\"; kappa = \"power n=2.5\" (list fields, laws)",
    ),
    ("mark", "where", "which particles, at least one: all conditions together; later marks win over earlier ones"),
    (
        "mark",
        "set",
        "quantities for them: T, kappa, rho, source, flux_in, h_conv, T_ambient, emissivity, fixed = true …",
    ),
    ("where", "x", "[from, to]; y and z likewise"),
    ("where", "y", ""),
    ("where", "z", ""),
    ("where", "r", "distance from the centre, [from, to]"),
    ("where", "centre", "for r, one number per axis (default: the origin)"),
    (
        "where",
        "picture",
        "lines of text stretched over [x, y], or over the box: particles under a letter, not under a blank",
    ),
    ("where", "field", "the name of an array of the file"),
    ("where", "equals", "its value"),
    ("where", "surface", "true: particles at a free surface, where the support is cut off; false: the others"),
    ("time", "start", "default: the time of the file, or 0"),
    ("time", "end", "when it ends"),
    ("time", "steps", "steps of the host, each in as many sub-steps as the integrator needs (default 10)"),
    ("output", "pvd", "a series of snapshots for ParaView, under the folder of --out; without it no file is written"),
    ("output", "every", "steps between snapshots (default 1)"),
    ("output", "fields", "quantities beyond T, m, rho, h and kappa (list fields)"),
    ("output", "encoding", "raw (default), base64 or zlib"),
    ("exact", "name", "an exact solution (list exact); its parameters are further keys; T starts from it unless set"),
];

/// What TOML found wrong, in our words: the line, and the nearest known key.
pub fn explain(name: &str, text: &str, error: &toml::de::Error) -> Error {
    let line = error.span().map_or(1, |span| 1 + text.bytes().take(span.start).filter(|b| *b == b'\n').count());
    let message = error.message().trim().replace('\n', ", ");
    // serde says: unknown field `a`, expected one of `b`, `c`.
    let quoted: Vec<String> = message.split('`').skip(1).step_by(2).map(String::from).collect();
    let guess = match quoted.split_first() {
        Some((wrong, known)) if message.starts_with("unknown") => nearest(wrong, known),
        _ => None,
    };
    let guess = guess.map(|g| format!("; did you mean '{g}'?")).unwrap_or_default();
    let rule = format!("line {line}: {message}{guess} ('diffusph list scene' shows every key)");
    Error::bad(name, "not a scene", &rule)
}

#[cfg(test)]
mod tests {
    use super::super::scene::Scene;
    use super::*;

    /// The documented keys are those that are read: asked for a key that does not exist, serde lists the others.
    #[test]
    fn every_key_is_documented_and_every_documented_key_exists() {
        let sections = [
            ("", "zzz = 1\n"),
            ("box", "[box]\nzzz = 1\n"),
            ("particles", "[particles]\nzzz = 1\n"),
            ("mark", "[[mark]]\nzzz = 1\n"),
            ("where", "[[mark]]\nwhere = { zzz = 1 }\n"),
            ("time", "[time]\nzzz = 1\n"),
            ("output", "[output]\nzzz = 1\n"),
        ];
        for (section, text) in sections {
            let text = Scene::parse("a", text).err().map_or(String::new(), |e| e.to_string());
            let mut read: Vec<&str> = text.split('`').skip(3).step_by(2).collect();
            read.retain(|key| {
                !["box", "particles", "set", "mark", "time", "output", "exact"].contains(key) || section == "mark"
            });
            let documented: Vec<&str> = KEYS.iter().filter(|k| k.0 == section).map(|k| k.1).collect();
            assert_eq!(read, documented, "[{section}] {text}");
        }
    }
}
