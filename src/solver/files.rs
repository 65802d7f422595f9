//! Particles from and to VTK files.

use super::{Solver, expect};
use crate::array::Strided;
use crate::error::Result;
use crate::io::{self, Column, Entry, Options, Series, Snapshot, Values, View};
use crate::memory;
use crate::model::fields::{self, FIELDS, INPUTS};
use crate::plan::state::Input;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// What a snapshot always holds; inputs that were given per particle are added.
const ALWAYS: &[&str] = &["T", "m", "rho", "h", "kappa"];

impl Solver {
    /// Writes particles and their quantities as a `.vtu` (or legacy `.vtk`, by the name's ending) with the time.
    ///
    /// # Errors
    /// `Io`; `OutOfOrder` before T, m and kappa are known. An existing file stays whole.
    pub fn write_vtk(&mut self, path: impl AsRef<Path>) -> Result<()> {
        self.write_vtk_with(path, Options::default(), &[])
    }

    /// The same with a choice of encoding and further quantities.
    ///
    /// # Errors
    /// As [`Solver::write_vtk`]; `UnknownWord` for a quantity that does not exist.
    pub fn write_vtk_with(&mut self, path: impl AsRef<Path>, options: Options, extra: &[&str]) -> Result<()> {
        let path = path.as_ref();
        let mut names = ALWAYS.to_vec();
        let each = |slot: &usize| match &self.state.inputs[*slot] {
            Input::Each(_) => true,
            given => fields::TENSOR.contains(slot) && *given != Input::Unset,
        };
        names.extend((0..INPUTS).filter(each).map(|slot| FIELDS[slot].name).chain(extra.iter().copied()));
        let mut fields = Vec::new();
        for (at, &name) in names.iter().enumerate() {
            if !names[..at].contains(&name) {
                let components = if fields::field(name)?.vector { self.dim() } else { 1 };
                fields.push((name, components, self.get_all(name)?));
            }
        }
        let (n, dim, x) = (self.len(), self.dim(), self.get_all("x")?);
        let points = Values::computed(3 * n, |first, block: &mut [f64]| {
            for (k, value) in block.iter_mut().enumerate() {
                let (i, axis) = ((first + k) / 3, (first + k) % 3);
                *value = if axis < dim { x[i * dim + axis] } else { 0.0 };
            }
        });
        let column = |name, components, values| Column { name: Cow::Borrowed(name), components, values };
        let view = View {
            n,
            points,
            fields: fields.iter().map(|(name, c, v)| column(*name, *c, Values::stored(v))).collect(),
            time: Some(self.state.time),
            notes: vec![
                ("diffusph".into(), env!("CARGO_PKG_VERSION").into()),
                ("words".into(), self.words().to_string().into()),
            ],
        };
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("vtk")) {
            io::write_legacy(path, &view)
        } else {
            io::write_vtu(path, &view, options)
        }
    }

    /// Writes the next numbered snapshot beside a `.pvd` list and lists it; answers its path. Snapshots listed at this
    /// time or later are replaced: a run that was restarted goes on where it stands.
    ///
    /// # Errors
    /// As [`Solver::write_vtk`]; `BadFile` when the list is none.
    pub fn write_series(&mut self, list: impl AsRef<Path>) -> Result<PathBuf> {
        let list = list.as_ref();
        let mut series = Series::open_or_create(list)?;
        let earlier: Vec<&Entry> = series.entries().iter().filter(|e| e.time < self.state.time).collect();
        let taken = |name: &String| earlier.iter().any(|e| Path::new(&e.file).file_name() == Some(name.as_ref()));
        let stem = list.file_stem().unwrap_or_default().to_string_lossy();
        let names = (earlier.len()..).map(|number| format!("{stem}_{number:04}.vtu"));
        let path = list.with_file_name(names.filter(|name| !taken(name)).take(1).collect::<String>());
        self.write_vtk(&path)?;
        series.append(self.state.time, &path)?;
        Ok(path)
    }

    /// Particles from a VTK file: positions, every array that has the name of an input, and the time if there is one.
    ///
    /// # Errors
    /// `Io`, `BadFile`; `BadElement` naming the first bad value. Nothing is changed then.
    pub fn read_vtk(&mut self, path: impl AsRef<Path>) -> Result<()> {
        self.set_snapshot(&io::read(path)?)
    }

    /// The same from a snapshot in memory. Coordinates beyond `dim` are left aside.
    ///
    /// # Errors
    /// As [`Solver::read_vtk`].
    pub fn set_snapshot(&mut self, snapshot: &Snapshot) -> Result<()> {
        let (n, dim) = (snapshot.points.len(), self.dim());
        let x = memory::collected("x", (0..n * dim).map(|k| snapshot.points[k / dim][k % dim]))?;
        let mut found = Vec::new();
        for input in &FIELDS[..INPUTS] {
            let Some(field) = snapshot.field(input.name) else { continue };
            expect(input.name, field.components, 1, "one component")?;
            found.push((input.name, field.data.to_f64()?));
        }
        let given: Vec<_> = found.iter().map(|(name, values)| (*name, Strided::packed(values))).collect();
        self.set_particles_with(Strided::new("x", &x, n, dim, dim)?, &given)?;
        self.state.time = snapshot.time.unwrap_or(self.state.time);
        Ok(())
    }
}
