//! The scene file: TOML, every key of which is in [`super::keys::KEYS`].

use super::keys::explain;
use crate::error::{Error, Result};
use crate::io::{self, Encoding, Options};
use crate::words::{Words, replaced};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

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
    #[serde(default)]
    pub glass: bool,
    /// Coordinates that were made before, in place of the lattice.
    #[serde(skip)]
    pub made: Option<Arc<Vec<f64>>>,
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
    /// Where it is not said, the time of the file, or 0.
    pub start: Option<f64>,
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
    /// `Io`, `BadFile`; otherwise as [`Scene::parse`].
    pub fn read(path: &Path) -> Result<Scene> {
        const ADVICE: &str =
            "a scene is a text in TOML ('diffusph list demo' prints one; 'check' looks into particle files)";
        let text = io::words(path).map_err(|e| io::advised(e, ADVICE))?;
        Scene::parse(&path.display().to_string(), &text)
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
        let Time { start, steps, .. } = self.time;
        self.check_end(start.unwrap_or(if self.particles.file.is_some() { f64::MIN } else { 0.0 }))?;
        if steps == 0 {
            return Err(Error::bad("time.steps", 0, "take at least one step"));
        }
        let Particles { file, lattice, n, jitter, glass, seed, .. } = &self.particles;
        if file.is_some() == lattice.is_some() {
            return Err(Error::bad("particles", "no clear choice", "give either file, or lattice and n"));
        }
        if file.is_some() && (n.is_some() || *jitter != 0.0 || *glass || *seed != one()) {
            let rule = "n, jitter, seed and glass are of a lattice; the particles of a file lie where it says";
            return Err(Error::bad("particles", "a file with words for a lattice", rule));
        }
        if *glass && *jitter == 0.0 {
            let rule = "it has no effect on a lattice without disorder, where every push is 0: give jitter, like 0.4";
            return Err(Error::bad("particles.glass", true, rule));
        }
        if lattice.is_some() && (n.is_none_or(|n| n == 0) || self.space.is_none()) {
            return Err(Error::bad("particles", "incomplete", "a lattice needs n > 0 and a [box] to fill"));
        }
        if !(0.0..=1.0).contains(jitter) {
            return Err(Error::bad("particles.jitter", jitter, "it is a share of the spacing, 0 to 1"));
        }
        match &self.output {
            Some(Output { pvd, .. }) if pvd.extension().is_none_or(|e| e != "pvd") => {
                Err(Error::bad("output.pvd", format!("'{}'", pvd.display()), "its name must end in .pvd"))
            }
            Some(Output { pvd, .. })
                if !pvd.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir)) =>
            {
                let rule =
                    "it must lie in the folder of the output, --out: a path without .. that does not begin with /";
                Err(Error::bad("output.pvd", format!("'{}'", pvd.display()), rule))
            }
            Some(output) if output.every == 0 => Err(Error::bad("output.every", 0, "it must be at least 1")),
            _ => Ok(()),
        }
    }

    /// Whether the end comes after the start.
    ///
    /// # Errors
    /// `BadValue`.
    pub fn check_end(&self, start: f64) -> Result<()> {
        let end = self.time.end;
        match start.is_finite() && end.is_finite() && end > start {
            true => Ok(()),
            false => {
                let rule = format!("it must be finite and later than the start, t = {start}");
                Err(Error::bad("time.end", end, &rule))
            }
        }
    }

    /// Replaces words of `words`, or adds them: `kernel=M4 operator=kernel`.
    ///
    /// # Errors
    /// `BadValue` unless each has the form `key=value`, and for a key that is given twice.
    pub fn set_words(&mut self, words: &str) -> Result<()> {
        if let Some(bare) = Words::parse("--set", words)?.bare() {
            return Err(Error::bad("--set", format!("'{bare}'"), "write key=value, like kernel=M4"));
        }
        self.words = replaced(&self.words, words, &[]);
        Ok(())
    }
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
        assert_eq!((scene.time.steps, scene.time.start, scene.particles.seed), (10, None, 1));
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
            ("lattice = \"cubic\"", "file = \"a.vtu\"", "of a lattice"),
            ("n = 8", "n = 8\njitter = 2", "0 to 1"),
            ("[time]\nend = 1", "", "missing field `time`"),
            ("T = 1", "T = ", "line 9"),
            ("end = 1", "end = 1\n[output]\npvd = \"..\"", "end in .pvd"),
            ("end = 1", "end = 1\n[output]\npvd = \"../a.pvd\"", "folder of the output"),
            ("end = 1", "end = 1\n[output]\npvd = \"/tmp/a.pvd\"", "folder of the output"),
        ] {
            let text = complaint(&SMALL.replace(from, to));
            assert!(text.contains(expected), "{to}: {text}");
        }
    }

    #[test]
    fn words_are_replaced_or_added() {
        let mut scene = Scene::parse("a.toml", SMALL).unwrap();
        scene.set_words("kernel=M4").unwrap();
        scene.set_words("dim=2").unwrap();
        assert_eq!(scene.words, "heat kernel=M4 dim=2");
        assert!(scene.set_words("kernel").is_err() && scene.set_words("=1").is_err());
    }
}
