//! Particles from and to VTK files.

use super::frame::Frame;
use super::restart::{self, Notes};
use super::{Solver, check, expect};
use crate::array::Strided;
use crate::error::{Error, Result};
use crate::io::atomic::Prepared;
use crate::io::{self, Column, Field, Options, Series, Snapshot, Values, View};
use crate::memory;
use crate::model::fields::{self, FIELDS, INPUTS};
use crate::plan::given::{Offer, Offered};
use crate::plan::input::{Energy, Input};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// What a snapshot always holds; inputs that were given per particle are added.
const ALWAYS: &[&str] = &["T", "m", "rho", "h", "kappa"];

impl Solver {
    /// Writes particles and their quantities as a `.vtu` (or legacy `.vtk`, by the name's ending) with the time. A `.vtu`
    /// holds all that decides how the solver goes on; legacy files are for other tools, and have no place for it.
    ///
    /// # Errors
    /// `BadValue` for another ending; `Io`; `OutOfOrder` before T, m and kappa are known. An existing file stays whole.
    pub fn write_vtk(&mut self, path: impl AsRef<Path>) -> Result<()> {
        self.write_vtk_with(path, Options::default(), &[])
    }

    /// The same with a choice of encoding and further quantities.
    ///
    /// # Errors
    /// As [`Solver::write_vtk`]; `UnknownWord` for a quantity that does not exist.
    pub fn write_vtk_with(&mut self, path: impl AsRef<Path>, options: Options, extra: &[&str]) -> Result<()> {
        self.prepare_vtk(path.as_ref(), options, extra, &[])?.publish()
    }

    fn prepare_vtk(
        &mut self,
        path: &Path,
        options: Options,
        extra: &[&str],
        more_notes: &[(&str, &str)],
    ) -> Result<Prepared> {
        let legacy = match ending(path).as_str() {
            "vtu" => false,
            "vtk" => true,
            _ => {
                let rule = "its name must end in .vtu, or in .vtk for a legacy file; write_series keeps a .pvd";
                return Err(Error::bad("path", format!("'{}'", path.display()), rule));
            }
        };
        self.state.cloud("write_vtk")?;
        self.state.refuse_lost("write_vtk", 0..INPUTS)?;
        let mut fields = Vec::new();
        for name in self.columns(extra) {
            fields.push((name, fields::field(name)?.vector, self.get_all(name)?));
        }
        let (n, dim, x) = (self.len(), self.dim(), self.get_all("x")?);
        let frame = &self.frame;
        let points = in_space(&x, dim, |point, axis| frame.outward(point, axis));
        let column = |name, components, values| Column { name: Cow::Borrowed(name), components, values };
        let columns = fields.iter().map(|(name, vector, v)| match vector {
            true if *name == "x" => column(name, 3, in_space(v, dim, |point, axis| frame.outward(point, axis))),
            // Other tools take two components for no vector.
            true => column(name, 3, in_space(v, dim, |vector, axis| frame.outward_vector(vector, axis))),
            false => column(name, 1, Values::stored(v)),
        });
        let mut fields: Vec<Column> = columns.collect();
        if self.state.last_h.len() == n && n > 0 && !legacy {
            fields.push(column(restart::H_START, 1, Values::stored(&self.state.last_h)));
        }
        let notes = self.notes().into_iter().map(|(name, text)| (name.into(), text.into()));
        let notes = notes.chain(more_notes.iter().map(|(name, text)| ((*name).into(), (*text).into()))).collect();
        let view = View { n, points, fields, time: Some(self.state.time), notes };
        if legacy { io::prepare_legacy(path, &view) } else { io::prepare_vtu(path, &view, options) }
    }

    /// The quantities of a snapshot: what is always there, what was given per particle, and `extra`.
    fn columns<'a>(&self, extra: &[&'a str]) -> Vec<&'a str> {
        let each = |slot: &usize| {
            let input = &self.state.inputs[*slot];
            input.is_each() || (fields::TENSOR.contains(slot) && *input != Input::Unset)
        };
        let given = (0..INPUTS).filter(each).map(|slot| FIELDS[slot].name);
        let energy = match &self.state.energy {
            Energy::Given(Input::Each(_)) | Energy::Moved => Some("u"),
            _ => None,
        };
        let mut names: Vec<&str> = Vec::new();
        for name in ALWAYS.iter().copied().chain(given).chain(energy).chain(extra.iter().copied()) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        names
    }

    /// Writes the next numbered snapshot beside a `.pvd` list and lists it; answers its path. Snapshots listed at this
    /// time or later are replaced: a run that was restarted goes on where it stands, and touches no file that an earlier
    /// entry needs. Whenever it is killed, the list on disk names files of its times.
    ///
    /// # Errors
    /// As [`Solver::write_vtk`]; `BadFile` when the list is none.
    pub fn write_series(&mut self, list: impl AsRef<Path>) -> Result<PathBuf> {
        let list = list.as_ref();
        if list.extension().is_none_or(|ending| ending != "pvd") {
            return Err(Error::bad("pvd_path", format!("'{}'", list.display()), "its name must end in .pvd"));
        }
        self.write_in(&mut Series::open_or_create(list)?, Options::default(), &[])
    }

    /// The same for a list that is open, as [`Solver::write_vtk_with`] writes.
    ///
    /// # Errors
    /// As [`Solver::write_vtk_with`].
    pub fn write_in(&mut self, series: &mut Series, options: Options, extra: &[&str]) -> Result<PathBuf> {
        self.write_with_notes(series, options, extra, &[])
    }

    /// The same with notes of the caller's.
    pub(crate) fn write_with_notes(
        &mut self,
        series: &mut Series,
        options: Options,
        extra: &[&str],
        notes: &[(&str, &str)],
    ) -> Result<PathBuf> {
        series.write(self.state.time, |path| self.prepare_vtk(path, options, extra, notes))
    }

    /// Particles from a VTK file. From a snapshot of ours: all that it holds, in place of what was set before, so that the
    /// solver goes on as the one that wrote it; its words and callbacks stay. From the file of another program: positions,
    /// every array of one component that has the name of an input, u where there is no T, b, and the time if there is one. Where fewer than three dimensions are
    /// filled, they may be along any axes. Answers what the file has that was left aside.
    ///
    /// # Errors
    /// `Io`, `BadFile`; `BadElement` naming the first bad value; `BadValue` where the particles fill more dimensions than
    /// the solver has; `OutOfOrder` naming a callback that the snapshot needs. Nothing is changed then.
    pub fn read_vtk(&mut self, path: impl AsRef<Path>) -> Result<Vec<String>> {
        let path = path.as_ref();
        let snapshot = io::read(path)?;
        self.set_snapshot(&snapshot).map_err(|e| match e {
            damaged @ Error::BadFile { .. } => io::in_file(path, damaged),
            other => other,
        })?;
        // What a snapshot of ours holds beside the inputs can be found again.
        let ours = restart::is_ours(&snapshot);
        let has_t = snapshot.field("T").is_some();
        let is_input = |name: &str| FIELDS[..INPUTS].iter().any(|f| f.name == name) || (name == "u" && !has_t);
        let is_vector = |field: &Field| field.components == 3 && field.name == "b";
        Ok(snapshot.told(|field| ours || is_vector(field) || (field.components == 1 && is_input(&field.name))))
    }

    /// The same from a snapshot in memory.
    ///
    /// # Errors
    /// As [`Solver::read_vtk`].
    pub fn set_snapshot(&mut self, snapshot: &Snapshot) -> Result<()> {
        let (n, dim) = (snapshot.points.len(), self.dim());
        if n == 0 {
            return Err(Error::bad("points", 0, "it holds no particles; nothing was changed"));
        }
        let notes = Notes::read(snapshot, dim)?;
        let frame = Frame::of(&snapshot.points, dim, restart::axes(snapshot))?;
        let mut x = memory::reserved("x", n * dim)?;
        snapshot.points.iter().for_each(|p| x.extend(frame.inward(*p)));
        let x = Strided::new("x", &x, n, dim, dim)?;
        x.check("x", "coordinates must be finite", f64::is_finite)?;
        let mut found = Vec::new();
        for (slot, input) in FIELDS[..INPUTS].iter().enumerate() {
            let wanted = notes.as_ref().is_none_or(|notes| notes.arrays.contains(&slot));
            // An array of vectors is not the quantity of that name.
            let field = if wanted { snapshot.usable(input.name)?.filter(|f| f.components == 1) } else { None };
            match field {
                Some(field) => found.push((slot, doubles(field)?)),
                None if notes.is_some() && wanted => return Err(lacks(input.name)),
                None => {}
            }
        }
        if notes.is_none() && !found.iter().any(|(slot, _)| (fields::B..fields::B + 3).contains(slot)) {
            found.extend(directions(snapshot, &frame)?);
        }
        let mut given: Vec<(usize, Offered)> = Vec::new();
        for (slot, values) in &found {
            let values = Strided::packed(values);
            check(*slot, FIELDS[*slot].name, &values, (n, dim))?;
            given.push((*slot, Offered::Each(values)));
        }
        let Some(notes) = notes else {
            let domain = self.state.domain.clone();
            let has_t = found.iter().any(|(slot, _)| *slot == fields::T);
            let u = if has_t { None } else { snapshot.usable("u")?.filter(|f| f.components == 1) };
            let u = u.map(doubles).transpose()?;
            u.iter().try_for_each(|u| check(fields::T, "u", &Strided::packed(u), (n, dim)))?;
            let energy = u.as_ref().map(|u| Offered::Each(Strided::packed(u)));
            self.state.accept(&Offer { domain, x, given: &given, energy, anew: false })?;
            self.state.time = snapshot.time.unwrap_or(self.state.time);
            self.frame = frame;
            return Ok(());
        };
        self.refuse_missing_functions(&notes)?;
        let array = |name: &str, like: usize| {
            let values = snapshot.usable(name)?.map(doubles).transpose()?;
            values.map(|values| check(like, name, &Strided::packed(&values), (n, dim)).map(|()| values)).transpose()
        };
        let last_h = array(restart::H_START, fields::H)?.unwrap_or_default();
        // Where particles move before anything is asked for, the search for h starts from those that were found.
        let finds = [fields::RHO, fields::H].iter().all(|slot| given.iter().all(|(other, _)| other != slot));
        let found_h = if finds { array("h", fields::H)?.unwrap_or_default() } else { Vec::new() };
        let u = match notes.energy {
            Some(None) => array("u", fields::T)?.ok_or_else(|| lacks("u")).map(Some)?,
            _ => None,
        };
        given.extend(notes.numbers.iter().map(|(slot, v)| (*slot, Offered::Number(*v))));
        let energy = match (&u, notes.energy) {
            (Some(u), _) => Some(Offered::Each(Strided::packed(u))),
            (None, Some(Some(u))) => Some(Offered::Number(u)),
            _ => None,
        };
        self.state.accept(&Offer { domain: notes.domain.clone(), x, given: &given, energy, anew: true })?;
        self.resume(notes, (last_h, found_h));
        self.state.time = snapshot.time.unwrap_or(self.state.time);
        self.frame = frame;
        Ok(())
    }

    /// How many dimensions the particles of a snapshot fill, or are said to.
    pub fn dimensions_of(snapshot: &Snapshot) -> usize {
        let named = restart::axes(snapshot).map(|axes| axes.split_whitespace().count());
        named.unwrap_or_else(|| super::frame::varying(&snapshot.points).len()).clamp(1, 3)
    }

    /// How the solver's axes lie in those of its files.
    pub fn frame(&self) -> &Frame {
        &self.frame
    }
}

/// The three components that a file has for each `dim` of the solver.
fn in_space<'a>(v: &'a [f64], dim: usize, component: impl Fn(&[f64], usize) -> f64 + 'a) -> Values<'a> {
    Values::computed(v.len() / dim * 3, move |first, block: &mut [f64]| {
        for (k, value) in (first..).zip(block) {
            *value = component(&v[k / 3 * dim..][..dim], k % 3);
        }
    })
}

/// The components of an array `b` of vectors.
fn directions(snapshot: &Snapshot, frame: &Frame) -> Result<Vec<(usize, Vec<f64>)>> {
    let Some(field) = snapshot.usable("b")?.filter(|f| f.components == 3) else { return Ok(Vec::new()) };
    let values = field.data.to_f64()?;
    let axes = (0..frame.dim()).filter_map(|axis| Some((fields::B + axis, frame.file_axis(axis)?)));
    axes.map(|(slot, axis)| Ok((slot, memory::collected("b", values.chunks(3).map(|b| b[axis]))?))).collect()
}

fn doubles(field: &Field) -> Result<Vec<f64>> {
    expect(&field.name, field.components, 1, "one component")?;
    field.data.to_f64().map_err(|e| match e {
        Error::BadElement { index, value, .. } => {
            Error::bad_at(&field.name, index, value, "an integer without an exact double: save the array as doubles")
        }
        other => other,
    })
}

fn lacks(name: &str) -> Error {
    let rule = "the snapshot's notes say that it was given per particle; it was changed since";
    Error::bad("snapshot", format!("without an array {name}"), rule)
}

/// Of a file's name; a path that ends in a separator names a folder.
fn ending(path: &Path) -> String {
    if path.as_os_str().to_string_lossy().ends_with(std::path::is_separator) {
        return String::new();
    }
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}
