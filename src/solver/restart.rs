//! What a snapshot holds beside arrays, so that a run that starts from it goes on to the bit: what was given as one number,
//! what was given at all (rather than found, like h), laws, the box, and what the solver has learnt to expect.

use super::Solver;
use crate::error::{Error, Result};
use crate::integrator::Range;
use crate::io::Snapshot;
use crate::model::conductivity::Law;
use crate::model::fields::{self, Access, FIELDS, INPUTS, Slot};
use crate::plan::input::{Energy, Input};
use crate::plan::state::{Made, State};
use crate::space::Domain;
use crate::words::Words;
use std::fmt::Write;

/// Names of notes.
const VERSION: &str = "diffusph";
const GIVEN: &str = "given";
const LAW: &str = "law";
const CALLBACKS: &str = "callbacks";
const BOX: &str = "box";
const AXES: &str = "axes";
const HISTORY: &str = "history";

/// The array of smoothing lengths from which a search for h starts.
pub const H_START: &str = "h_start";

/// What the notes of a snapshot say.
pub struct Notes {
    /// Quantities given as one number.
    pub numbers: Vec<(Slot, f64)>,
    /// Quantities that an array was given for.
    pub arrays: Vec<Slot>,
    /// u was given: by an array, or as a number.
    pub energy: Option<Option<f64>>,
    sigma_sb: f64,
    law: Option<Law>,
    kappa_callback: bool,
    source_callback: bool,
    pub domain: Domain,
    history: History,
}

/// What a plan depends on, beside the particles.
#[derive(Default)]
struct History {
    steps: u64,
    rates: u64,
    moves: bool,
    kappa_changes: bool,
    was_done_here: bool,
    /// Between what temperatures T was set.
    span: Option<Range>,
    /// What an operator that does not conserve has done since.
    made: Made,
}

/// The axes of a snapshot, where it says which they are.
pub fn axes(snapshot: &Snapshot) -> Option<&str> {
    note(snapshot, AXES)
}

/// Whether a solver wrote it.
pub fn is_ours(snapshot: &Snapshot) -> bool {
    note(snapshot, GIVEN).is_some() && note(snapshot, VERSION).is_some()
}

fn note<'a>(snapshot: &'a Snapshot, name: &str) -> Option<&'a str> {
    snapshot.notes.iter().find(|(key, _)| key == name).map(|(_, text)| text.as_str())
}

impl Solver {
    /// The notes of a snapshot of this solver.
    pub(super) fn notes(&self) -> Vec<(String, String)> {
        let state = &self.state;
        let mut notes = vec![
            (VERSION, env!("CARGO_PKG_VERSION").to_string()),
            ("words", self.words().to_string()),
            (GIVEN, given(state)),
            (BOX, domain(&state.domain)),
            (AXES, self.frame.names().join(" ")),
            (HISTORY, history(state)),
        ];
        if let Some(law) = &state.law {
            notes.push((LAW, law.to_string()));
        }
        let functions = [("kappa", state.kappa_host.is_some()), ("source", state.source_host.is_some())];
        let functions: Vec<&str> = functions.iter().filter(|(_, set)| *set).map(|(name, _)| *name).collect();
        if !functions.is_empty() {
            notes.push((CALLBACKS, functions.join(" ")));
        }
        notes.into_iter().map(|(name, text)| (name.to_string(), text)).collect()
    }

    /// What a snapshot has otherwise than this solver, of all that steps do not change; none where both are of one run.
    ///
    /// # Errors
    /// `NoMemory`; `BadFile` for an array that cannot be used.
    pub fn difference(&mut self, snapshot: &Snapshot) -> Result<Option<String>> {
        for (name, own) in self.notes() {
            let kept = |text: &str| text.split_whitespace().filter(|w| !may_change(w)).collect::<Vec<_>>().join(" ");
            let (own, other) = (kept(&own), kept(note(snapshot, &name).unwrap_or_default()));
            if own != other && ![VERSION, HISTORY].contains(&name.as_str()) {
                return Ok(Some(format!("'{name}' is '{other}' there, and '{own}' here")));
            }
        }
        let here = self.fetch_all("x")?;
        let places = snapshot.points.iter().flat_map(|p| self.frame.inward(*p).collect::<Vec<_>>());
        if !places.eq(here) {
            return Ok(Some("its particles are elsewhere".into()));
        }
        for slot in (0..INPUTS).filter(|&slot| slot != fields::T) {
            if !self.state.inputs[slot].is_each() {
                continue;
            }
            let name = FIELDS[slot].name;
            let other = snapshot.usable(name)?.map(|field| field.data.to_f64()).transpose()?;
            if other != Some(self.fetch_all(name)?) {
                return Ok(Some(format!("{name} has other values there")));
            }
        }
        Ok(None)
    }

    /// Refuses a snapshot that lived on functions of a host which are not there now.
    pub(super) fn refuse_missing_functions(&self, notes: &Notes) -> Result<()> {
        for (wanted, there, name) in [
            (notes.kappa_callback, self.state.kappa_host.is_some(), "kappa"),
            (notes.source_callback, self.state.source_host.is_some(), "source"),
        ] {
            if wanted && !there {
                let missing = format!("the {name} callback, which no file can hold: set_{name}_callback");
                return Err(Error::OutOfOrder { call: "read_vtk of this snapshot".into(), missing });
            }
        }
        Ok(())
    }

    /// Takes over what is not a quantity of the particles; these are in place.
    pub(super) fn resume(&mut self, notes: Notes, (last_h, found_h): (Vec<f64>, Vec<f64>)) {
        let state = &mut self.state;
        state.set_sigma_sb(notes.sigma_sb);
        if !notes.kappa_callback {
            state.set_kappa_of_t(notes.law, None);
        }
        if !notes.source_callback {
            state.source_host = None;
        }
        state.forget_geometry();
        (state.last_h, state.found_h) = (last_h, found_h);
        let History { steps, rates, moves, kappa_changes, was_done_here, span, made } = notes.history;
        (state.steps, state.rates, state.moves, state.kappa_changes) = (steps, rates, moves, kappa_changes);
        (state.was_done_here, state.span, state.made) = (was_done_here, span, made);
    }
}

/// Whether steps change what a word of a note says, or answers do not depend on it.
fn may_change(word: &str) -> bool {
    let name = word.split('=').next().unwrap_or_default();
    ["T", "u", "threads", "memory"].contains(&name)
}

/// `T m=0.01 kappa=0.6 sigma_SB=5.67e-8`: quantities with an array by their name, others with their number.
fn given(state: &State) -> String {
    let mut text = String::new();
    let mut add = |name: &str, input: &Input| {
        let _ = match input {
            Input::Unset => Ok(()),
            Input::Number(v) => write!(text, "{name}={v:?} "),
            Input::Each(_) => write!(text, "{name} "),
        };
    };
    for (slot, input) in state.inputs.iter().enumerate() {
        // Beneath a function of T it has no effect, and the array of its name is what that function gives.
        if !(slot == fields::KAPPA && input.is_each() && state.kappa_of_t()) {
            add(FIELDS[slot].name, input);
        }
    }
    match &state.energy {
        Energy::Follows => {}
        Energy::Given(u) => add("u", u),
        Energy::Moved => text.push_str("u "),
    }
    let _ = write!(text, "sigma_SB={:?}", state.sigma_sb);
    text
}

fn domain(domain: &Domain) -> String {
    let list = |values: &[f64; 3]| values[..domain.dim].iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(",");
    let periodic = domain.periodic.map(|p| f64::from(u8::from(p)));
    format!("lo={} hi={} periodic={}", list(&domain.lo), list(&domain.hi), list(&periodic))
}

fn history(state: &State) -> String {
    let number = |flag: bool| u8::from(flag);
    let (moves, changes, here) = (number(state.moves), number(state.kappa_changes), number(state.was_done_here));
    let span = state.span.map_or(String::new(), |span| format!(" span={:?},{:?}", span.low, span.high));
    let Made { energy, levelled } = state.made;
    let made = if levelled > 0.0 { format!(" made={energy:?},{levelled:?}") } else { String::new() };
    format!(
        "steps={} rates={} moves={moves} kappa_changes={changes} done_here={here}{span}{made}",
        state.steps, state.rates
    )
}

impl Notes {
    /// Those of a snapshot of ours; none for a file of another program.
    ///
    /// # Errors
    /// `BadValue` naming what cannot be meant: a snapshot of a later version, or one that was edited.
    pub fn read(snapshot: &Snapshot, dim: usize) -> Result<Option<Notes>> {
        let Some(given) = note(snapshot, GIVEN).filter(|_| is_ours(snapshot)) else { return Ok(None) };
        let mut notes = Notes {
            numbers: Vec::new(),
            arrays: Vec::new(),
            energy: None,
            sigma_sb: fields::SIGMA_SB,
            law: note(snapshot, LAW).map(Law::parse).transpose()?,
            kappa_callback: false,
            source_callback: false,
            domain: note(snapshot, BOX).map_or(Ok(Domain::open(dim)), |text| read_domain(text, dim))?,
            history: note(snapshot, HISTORY).map_or(Ok(History::default()), read_history)?,
        };
        for word in given.split_whitespace() {
            notes.take(word)?;
        }
        for name in note(snapshot, CALLBACKS).into_iter().flat_map(str::split_whitespace) {
            match name {
                "kappa" => notes.kappa_callback = true,
                "source" => notes.source_callback = true,
                other => return Err(wrong(CALLBACKS, other, "this version knows callbacks of kappa and source")),
            }
        }
        Ok(Some(notes))
    }

    fn take(&mut self, word: &str) -> Result<()> {
        let Some((name, value)) = word.split_once('=') else {
            match word {
                "u" => self.energy = Some(None),
                name => self.arrays.push(known(name)?),
            }
            return Ok(());
        };
        let value: f64 = value.parse().map_err(|_| wrong(GIVEN, word, "it is no number"))?;
        match name {
            "u" => self.energy = Some(Some(value)),
            "sigma_SB" if value >= 0.0 && value.is_finite() => self.sigma_sb = value,
            "sigma_SB" => return Err(wrong(GIVEN, word, "it must be finite and not negative")),
            name => {
                let slot = known(name)?;
                if let Access::Input { domain, .. } = FIELDS[slot].access
                    && !domain.holds(value)
                {
                    return Err(wrong(GIVEN, word, domain.rule()));
                }
                self.numbers.push((slot, value));
            }
        }
        Ok(())
    }
}

fn known(name: &str) -> Result<Slot> {
    let found = FIELDS[..INPUTS].iter().position(|f| f.name == name);
    found.ok_or_else(|| wrong(GIVEN, name, "this version has no such quantity"))
}

fn wrong(note: &str, what: &str, rule: &str) -> Error {
    Error::bad(&format!("note '{note}' of the snapshot"), format!("'{what}'"), rule)
}

fn read_domain(text: &str, dim: usize) -> Result<Domain> {
    let mut words = Words::parse("the note 'box'", text)?;
    let mut list = |key: &'static str| -> Result<Vec<f64>> {
        let values = words.list(key)?.unwrap_or_default();
        super::expect(key, values.len(), dim, "the snapshot has another number of dimensions than the solver")?;
        Ok(values)
    };
    let (lo, hi, periodic) = (list("lo")?, list("hi")?, list("periodic")?);
    words.done()?;
    let periodic: Vec<bool> = periodic.iter().map(|p| *p != 0.0).collect();
    Domain::new(&lo, &hi, &periodic)
}

fn read_history(text: &str) -> Result<History> {
    let mut words = Words::parse("the note 'history'", text)?;
    let mut count = |key: &'static str, most: u64| words.count(key, 0..=most).map(|count| count.unwrap_or(0));
    let history = History {
        steps: count("steps", u64::MAX)?,
        rates: count("rates", u64::MAX)?,
        moves: count("moves", 1)? != 0,
        kappa_changes: count("kappa_changes", 1)? != 0,
        was_done_here: count("done_here", 1)? != 0,
        span: match words.list("span")?.as_deref() {
            None => None,
            Some([low, high]) if low <= high => Some(Range { low: *low, high: *high }),
            Some(_) => return Err(wrong(HISTORY, text, "span is the lowest and the highest temperature that was set")),
        },
        made: match words.list("made")?.as_deref() {
            None => Made::default(),
            Some([energy, levelled]) => Made { energy: *energy, levelled: *levelled },
            Some(_) => return Err(wrong(HISTORY, text, "made is an energy, and what there was to level out")),
        },
    };
    words.done()?;
    Ok(history)
}
