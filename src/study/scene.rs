//! The scene file: TOML, every key of which is in [`KEYS`].

use crate::error::{Error, Result, nearest};
use crate::io::{Encoding, Options};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Every key: section, name, meaning.
pub static KEYS: &[(&str, &str, &str)] = &[
    ("", "title", "what the report is headed by"),
    ("", "words", "the solver's words: \"heat dim=2 kernel=M6\" (list words)"),
    ("box", "lo", "lower bounds, one number per axis"),
    ("box", "hi", "upper bounds"),
    ("box", "periodic", "true, false (default), or one of them per axis"),
    ("particles", "file", "a VTK file, looked for beside the scene; arrays with the names of quantities are taken"),
    ("particles", "lattice", "cubic, square, hexagonal or fcc, filling the box"),
    ("particles", "n", "cells of the lattice along the first axis"),
    ("particles", "jitter", "random displacement of every coordinate, at most this share of the spacing (default 0)"),
    ("particles", "seed", "of the displacements (default 1)"),
    (
        "set",
        "QUANTITY",
        "a number; the name of an array of the file; T = \"exact\"; kappa = \"power n=2.5\" (list fields, laws)",
    ),
    ("mark", "where", "which particles: all conditions together; later marks win over earlier ones"),
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
    ("time", "start", "default 0"),
    ("time", "end", "when it ends"),
    ("time", "steps", "steps of the host, each in as many sub-steps as the integrator needs (default 10)"),
    ("output", "pvd", "a series of snapshots for ParaView, under the folder of --out; without it no file is written"),
    ("output", "every", "steps between snapshots (default 1)"),
    ("output", "fields", "quantities beyond T, m, rho, h and kappa (list fields)"),
    ("output", "encoding", "raw (default), base64 or zlib"),
    ("exact", "name", "an exact solution (list exact); its parameters are further keys; T starts from it unless set"),
];

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    #[serde(default)]
    pub title: String,
    pub words: String,
    #[serde(rename = "box")]
    pub space: Option<Space>,
    pub particles: Particles,
    #[serde(default)]
    pub set: BTreeMap<String, Value>,
    #[serde(default)]
    pub mark: Vec<Mark>,
    pub time: Time,
    pub output: Option<Output>,
    pub exact: Option<Exact>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Space {
    pub lo: Vec<f64>,
    pub hi: Vec<f64>,
    #[serde(default)]
    pub periodic: Periodic,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(untagged, expecting = "expected true, false, or a list of them, one per axis")]
pub enum Periodic {
    All(bool),
    Each(Vec<bool>),
}

impl Default for Periodic {
    fn default() -> Periodic {
        Periodic::All(false)
    }
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Particles {
    pub file: Option<PathBuf>,
    pub lattice: Option<String>,
    pub n: Option<u32>,
    #[serde(default)]
    pub jitter: f64,
    #[serde(default = "one")]
    pub seed: u64,
}

/// What a quantity is set to.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged, expecting = "expected a number, true, false, or a text: the name of an array, \"exact\" or a law")]
pub enum Value {
    Flag(bool),
    Number(f64),
    Text(String),
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mark {
    #[serde(rename = "where")]
    pub place: Where,
    pub set: BTreeMap<String, Value>,
}

#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Where {
    pub x: Option<[f64; 2]>,
    pub y: Option<[f64; 2]>,
    pub z: Option<[f64; 2]>,
    pub r: Option<[f64; 2]>,
    #[serde(default)]
    pub centre: Vec<f64>,
    pub picture: Option<Vec<String>>,
    pub field: Option<String>,
    pub equals: Option<f64>,
    pub surface: Option<bool>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Time {
    #[serde(default)]
    pub start: f64,
    pub end: f64,
    #[serde(default = "ten")]
    pub steps: u32,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Output {
    pub pvd: PathBuf,
    #[serde(default = "one")]
    pub every: u64,
    #[serde(default)]
    pub fields: Vec<String>,
    #[serde(default)]
    pub encoding: Stored,
}

#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Stored {
    #[default]
    Raw,
    Base64,
    Zlib,
}

impl From<Stored> for Options {
    fn from(stored: Stored) -> Options {
        match stored {
            Stored::Raw => Options::default(),
            Stored::Base64 => Options { encoding: Encoding::Base64, zlib: false },
            Stored::Zlib => Options { encoding: Encoding::Raw, zlib: true },
        }
    }
}

#[derive(Debug, Clone, Deserialize)]
pub struct Exact {
    pub name: String,
    #[serde(flatten)]
    pub parameters: BTreeMap<String, Numbers>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(untagged, expecting = "expected a number or a list of numbers")]
pub enum Numbers {
    One(f64),
    List(Vec<f64>),
}

fn one() -> u64 {
    1
}

fn ten() -> u32 {
    10
}

impl Scene {
    /// Reads a scene file.
    ///
    /// # Errors
    /// `Io`; otherwise as [`Scene::parse`].
    pub fn read(path: &Path) -> Result<Scene> {
        let text = std::fs::read_to_string(path);
        let name = path.display().to_string();
        let text = text.map_err(|e| Error::Io { path: name.clone(), reason: format!("cannot read it: {e}") })?;
        Scene::parse(&name, &text)
    }

    /// Reads a scene; `name` names it in errors.
    ///
    /// # Errors
    /// `BadValue` with the line, and with the nearest known key for one that does not exist.
    pub fn parse(name: &str, text: &str) -> Result<Scene> {
        let scene: Scene = toml::from_str(text).map_err(|e| explain(name, text, &e))?;
        scene.check()?;
        Ok(scene)
    }

    fn check(&self) -> Result<()> {
        let Time { start, end, steps } = self.time;
        if !(start.is_finite() && end.is_finite() && end > start) {
            return Err(Error::bad("time.end", end, &format!("it must be finite and later than time.start = {start}")));
        }
        if steps == 0 {
            return Err(Error::bad("time.steps", 0, "take at least one step"));
        }
        let Particles { file, lattice, n, jitter, .. } = &self.particles;
        if file.is_some() == lattice.is_some() {
            return Err(Error::bad("particles", "no clear choice", "give either file, or lattice and n"));
        }
        if lattice.is_some() && (n.is_none_or(|n| n == 0) || self.space.is_none()) {
            return Err(Error::bad("particles", "incomplete", "a lattice needs n > 0 and a [box] to fill"));
        }
        if !(0.0..=1.0).contains(jitter) {
            return Err(Error::bad("particles.jitter", jitter, "it is a share of the spacing, 0 to 1"));
        }
        match &self.output {
            Some(output) if output.every == 0 => Err(Error::bad("output.every", 0, "it must be at least 1")),
            _ => Ok(()),
        }
    }

    /// Replaces a word of `words`, or adds it: `kernel=M4`.
    ///
    /// # Errors
    /// `BadValue` unless it has the form `key=value`.
    pub fn set_word(&mut self, word: &str) -> Result<()> {
        let Some((key, value)) = word.split_once('=').filter(|(k, v)| !k.is_empty() && !v.is_empty()) else {
            return Err(Error::bad("--set", format!("'{word}'"), "write key=value, like kernel=M4"));
        };
        let other = |w: &&str| w.split_once('=').is_none_or(|(k, _)| k != key);
        let mut words: Vec<&str> = self.words.split_whitespace().filter(other).collect();
        let word = format!("{key}={value}");
        words.push(&word);
        self.words = words.join(" ");
        Ok(())
    }
}

/// What TOML found wrong, in our words: the line, and the nearest known key.
fn explain(name: &str, text: &str, error: &toml::de::Error) -> Error {
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
    use super::*;

    const SMALL: &str = "words = \"heat dim=1\"\n[box]\nlo = [0]\nhi = [1]\n[particles]\nlattice = \"cubic\"\nn = 8\n\
                         [set]\nT = 1\nkappa = 1\n[time]\nend = 1\n";

    fn complaint(text: &str) -> String {
        Scene::parse("a.toml", text).err().map(|e| e.to_string()).unwrap_or_default()
    }

    #[test]
    fn a_small_scene_is_short_and_its_defaults_are_as_documented() {
        let scene = Scene::parse("a.toml", SMALL).unwrap();
        assert_eq!((scene.time.steps, scene.time.start, scene.particles.seed), (10, 0.0, 1));
        assert!(matches!(scene.space.unwrap().periodic, Periodic::All(false)) && scene.output.is_none());
        assert_eq!(scene.set["T"], Value::Number(1.0));
    }

    #[test]
    fn a_typing_error_gets_its_line_and_the_nearest_key() {
        let text = complaint(&SMALL.replace("lattice", "latice"));
        assert!(
            text.contains("a.toml") && text.contains("line 6") && text.contains("did you mean 'lattice'"),
            "{text}"
        );
        let text = complaint(&format!("{SMALL}[output]\npvd = \"a\"\nencoding = \"zip\"\n"));
        assert!(text.contains("line 15") && text.contains("`zlib`"), "{text}");
        for (from, to, expected) in [
            ("n = 8", "n = -1", "line 7"),
            ("T = 1", "T = [1]", "expected a number"),
            ("end = 1", "end = 0", "later than"),
            ("end = 1", "end = nan", "later than"),
            ("end = 1", "end = 1\nsteps = 0", "at least one"),
            ("n = 8", "", "needs n > 0"),
            ("lattice = \"cubic\"", "", "either file, or lattice"),
            ("n = 8", "n = 8\njitter = 2", "0 to 1"),
            ("[time]\nend = 1", "", "missing field `time`"),
            ("T = 1", "T = ", "line 9"),
        ] {
            let text = complaint(&SMALL.replace(from, to));
            assert!(text.contains(expected), "{to}: {text}");
        }
    }

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
            let text = complaint(text);
            let mut read: Vec<&str> = text.split('`').skip(3).step_by(2).collect();
            read.retain(|key| {
                !["box", "particles", "set", "mark", "time", "output", "exact"].contains(key) || section == "mark"
            });
            let documented: Vec<&str> = KEYS.iter().filter(|k| k.0 == section).map(|k| k.1).collect();
            assert_eq!(read, documented, "[{section}] {text}");
        }
    }

    #[test]
    fn words_are_replaced_or_added() {
        let mut scene = Scene::parse("a.toml", SMALL).unwrap();
        scene.set_word("kernel=M4").unwrap();
        scene.set_word("dim=2").unwrap();
        assert_eq!(scene.words, "heat kernel=M4 dim=2");
        assert!(scene.set_word("kernel").is_err() && scene.set_word("=1").is_err());
    }
}
