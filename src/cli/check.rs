//! `diffusph check`: what is in a particle file, and whether it can be used.

use crate::array::Strided;
use crate::error::{Error, Result};
use crate::io::{self, Field, LeftAside, OF_CELLS, Snapshot};
use crate::model::fields::{Access, FIELDS};
use crate::pool::Pool;
use crate::solver::Solver;
use crate::space::rows::Rows;
use crate::space::{Cloud, Domain, Scratch, density};
use std::fmt::Write;
use std::path::Path;

/// Describes a file.
///
/// # Errors
/// `Io`; `BadFile`, also for the first value that cannot be used.
pub fn text(path: &Path) -> Result<String> {
    let snapshot = io::read(path)?;
    if snapshot.points.is_empty() {
        return Err(Error::BadFile { path: path.display().to_string(), reason: "it holds no particles".into() });
    }
    let dim = Solver::dimensions_of(&snapshot);
    let mut solver = Solver::new(&format!("heat dim={dim} threads=1"))?;
    solver.set_snapshot(&snapshot).map_err(|e| io::in_file(path, e))?;
    let frame = solver.frame();
    let mut text = String::new();
    let time = snapshot.time.map_or(String::new(), |t| format!(", t = {t}"));
    let along = frame.about().map_or(String::new(), |about| format!(" along {about}"));
    let _ = writeln!(text, "{}: {} particles, {dim}-D{along}{time}", path.display(), snapshot.points.len());
    let arrays = snapshot.fields.iter().map(|f| &f.name);
    let others = snapshot.left_aside.iter().map(|l| &l.name).chain(&snapshot.of_cells);
    let width = arrays.chain(others).map(|name| name.chars().count()).max().unwrap_or(0).clamp(11, 40);
    let mut line = |name: &str, about: String| {
        let _ = writeln!(text, "  {:<width$} {about}", one_line(name));
    };
    let x: Vec<f64> = snapshot.points.iter().flat_map(|p| frame.inward(*p)).collect();
    for (axis, name) in frame.names().into_iter().enumerate() {
        line(name, Range::of(x.iter().skip(axis).step_by(dim).copied()).to_string());
    }
    if let Some((least, mean)) = spacing(&x, dim)? {
        let note = if least == 0.0 { " (some share one place)" } else { "" };
        line("spacing", format!("nearest neighbour {mean:.4e} on average, {least:.4e} at least{note}"));
    }
    for field in &snapshot.fields {
        line(&field.name, describe(field, snapshot.field("T").is_some()));
    }
    for LeftAside { name, reason } in &snapshot.left_aside {
        line(name, format!("left aside: {reason}"));
    }
    for name in &snapshot.of_cells {
        line(name, OF_CELLS.into());
    }
    for (name, note) in &snapshot.notes {
        line("note", format!("{name}: {}", one_line(note)));
    }
    for remark in &snapshot.remarks {
        line("remark", remark.clone());
    }
    let _ = writeln!(text, "usable; {}", missing(&snapshot));
    Ok(text)
}

/// A text of a file as a terminal can show it: its first characters, in one line.
fn one_line(text: &str) -> String {
    let mut shown: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(LONGEST).collect();
    if text.chars().nth(LONGEST).is_some() {
        shown.push('…');
    }
    shown
}

/// The most characters that are shown of a text.
const LONGEST: usize = 200;

fn describe(field: &Field, has_t: bool) -> String {
    let kind = format!("{} x {}", field.components, field.data.type_name());
    let role = match FIELDS.iter().find(|f| f.name == field.name).map(|f| f.access) {
        _ if field.name == "u" && field.components == 1 && !has_t => "taken: T is u / c_v",
        _ if field.name == "b" && field.components == 3 => "taken",
        Some(Access::Input { .. }) if field.components == 1 => "taken",
        Some(Access::Input { .. }) => "left aside: a quantity has one component",
        _ => "left aside",
    };
    match field.data.to_f64() {
        Ok(values) => format!("{kind:<12} {}, {role}", Range::of(values.into_iter())),
        Err(_) => format!("{kind:<12} beyond doubles, {role}"),
    }
}

/// What must still be given before it can run, and which arrays may be it.
fn missing(snapshot: &Snapshot) -> String {
    let given = |name: &&str| snapshot.field(name).is_some_and(|f| f.components == 1);
    let absent = ["m", "T", "kappa"].into_iter().filter(|name| !(given(name) || (*name == "T" && given(&"u"))));
    let absent: Vec<&str> = absent.collect();
    let hint = |name: &&str| {
        let meant = snapshot.fields.iter().find(|f| f.components == 1 && may_be(&f.name, name))?;
        Some(format!("; perhaps {name} = {:?}", one_line(&meant.name)))
    };
    let hints: String = absent.iter().filter_map(hint).collect();
    match absent.is_empty() {
        true => "nothing is missing".into(),
        false => format!("still to be given in [set]: {}{hints}", absent.join(", ")),
    }
}

/// Whether an array of this name may hold the quantity: it is its name in another case, or has the word that tells of it.
fn may_be(array: &str, quantity: &str) -> bool {
    if FIELDS.iter().any(|f| f.name == array) {
        return false;
    }
    let array = array.to_lowercase();
    let about = FIELDS.iter().find(|f| f.name == quantity).map_or("", |f| f.about);
    let told = about.split(' ').next_back().is_some_and(|noun| array.contains(noun));
    told || array == quantity.to_lowercase() || (quantity == "T" && array.starts_with("temp"))
}

struct Range {
    low: f64,
    high: f64,
    odd: usize,
}

impl Range {
    fn of(values: impl Iterator<Item = f64>) -> Range {
        let start = Range { low: f64::INFINITY, high: f64::NEG_INFINITY, odd: 0 };
        values.fold(start, |range, v| match v.is_finite() {
            true => Range { low: range.low.min(v), high: range.high.max(v), ..range },
            false => Range { odd: range.odd + 1, ..range },
        })
    }
}

impl std::fmt::Display for Range {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self.low <= self.high {
            true => write!(f, "{} to {}", self.low, self.high)?,
            false => write!(f, "no number")?,
        }
        if self.odd > 0 { write!(f, ", {} not finite", self.odd) } else { Ok(()) }
    }
}

/// The least and the mean distance to the nearest neighbour, in open space; none without two particles.
fn spacing(x: &[f64], dim: usize) -> Result<Option<(f64, f64)>> {
    let n = x.len() / dim;
    if n < 2 {
        return Ok(None);
    }
    let x = Strided::new("x", x, n, dim, dim)?;
    let pool = Pool::new(1)?;
    let volume: f64 = (0..dim).map(|a| Range::of((0..n).map(|i| x.at(i, a)))).map(|r| r.high - r.low).product();
    if volume == 0.0 {
        return Ok(Some((0.0, 0.0))); // all in one place
    }
    let mut cloud = Cloud::sort(&Domain::open(dim), x, 2.0 * (volume / n as f64).powf(1.0 / dim as f64), &pool)?;
    let mut h = density::guess(&cloud, 2.0, &pool)?;
    // One particle far away makes for cells in which all others are.
    let least = |h: &[f64]| h.iter().copied().fold(f64::INFINITY, f64::min);
    while cloud.is_coarse_for(least(&h)) {
        let before = std::mem::replace(&mut cloud, Cloud::sort(&Domain::open(dim), x, least(&h), &pool)?);
        h = density::guess(&cloud, 2.0, &pool)?;
        if cloud.grid.edge >= before.grid.edge {
            break;
        }
    }
    let mut found = vec![f64::INFINITY; n];
    // Particles without a neighbour yet are given a wider search.
    while found.contains(&f64::INFINITY) {
        let rows = Rows::new(&cloud, &h, 1.0, &pool)?;
        let open: Vec<bool> = found.iter().map(|r| r.is_infinite()).collect();
        rows.visit_where(
            0..n,
            &mut Scratch::default(),
            |i| open[i],
            |row| {
                found[row.i] = row.r.iter().copied().fold(f64::INFINITY, f64::min);
                Ok(())
            },
        )?;
        h.iter_mut().zip(&found).filter(|(_, r)| r.is_infinite()).for_each(|(h, _)| *h *= 2.0);
        if h.iter().any(|h| h.is_infinite()) {
            return Err(Error::bad("x", "too far apart", "no neighbour can be found"));
        }
    }
    let least = found.iter().copied().fold(f64::INFINITY, f64::min);
    Ok(Some((least, found.iter().sum::<f64>() / n as f64)))
}
