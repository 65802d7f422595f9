//! A point cloud with named arrays, owned: what reading a file gives.

use super::broken;
use super::data::{Data, keep};
use super::view::{Column, Values, View};
use crate::error::Result;
use std::collections::HashMap;

/// VTK's marks of points, and those of its bits that say whose a point is.
const GHOSTS: &str = "vtkGhostType";
const DUPLICATE: u8 = 1;
const HIDDEN: u8 = 2;

/// A point cloud with named arrays, as read from a file. Every field has one tuple per point.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Snapshot {
    pub points: Vec<[f64; 3]>,
    pub fields: Vec<Field>,
    /// The file's `TimeValue`.
    pub time: Option<f64>,
    /// Texts that belong to the whole file: (name, text).
    pub notes: Vec<(String, String)>,
    /// Names of arrays that belong to cells, not to points; they are not read.
    pub of_cells: Vec<String>,
    /// Arrays of points that cannot be used, and why.
    pub left_aside: Vec<LeftAside>,
    /// How many points of the file are none of its particles: copies that other pieces own, or hidden.
    pub ghosts: usize,
    /// What else a reader of the file should know.
    pub remarks: Vec<String>,
}

/// An array that a file has, and that is not read: it matters only to those who need it.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftAside {
    pub name: String,
    pub reason: String,
}

/// Why arrays of cells are not read, and what to do.
pub const OF_CELLS: &str =
    "of cells, not of points: left aside; make it one of points (ParaView: Cell Data to Point Data)";

/// The most bytes that are kept of one text of a file.
pub(super) const LONGEST_NOTE: usize = 1 << 24;

/// One array: `components` values per point, point after point.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    pub name: String,
    pub components: usize,
    pub data: Data,
}

impl Snapshot {
    /// The field of that name.
    pub fn field(&self, name: &str) -> Option<&Field> {
        self.fields.iter().find(|f| f.name == name)
    }

    /// What the file has that is not read, and what else is to be known of it, in words. `is_taken`: of the arrays that are
    /// read, which one is used.
    pub fn told(&self, is_taken: impl Fn(&Field) -> bool) -> Vec<String> {
        let unused = |l: &LeftAside| format!("array '{}' is left aside: {}", l.name, l.reason);
        let of_cells = |name: &String| format!("array '{name}' is one {OF_CELLS}");
        let unneeded = self.fields.iter().filter(|field| !is_taken(field)).map(|field| match field.components {
            1 => format!("array '{}' is left aside: it is none of the inputs", field.name),
            n => format!("array '{}' is left aside: an input has one component, not {n}", field.name),
        });
        let arrays = self.left_aside.iter().map(unused).chain(unneeded).chain(self.of_cells.iter().map(of_cells));
        self.remarks.iter().cloned().chain(arrays).collect()
    }

    /// The field of that name, if the file has one.
    ///
    /// # Errors
    /// `BadValue` where it has one that cannot be used.
    pub fn usable(&self, name: &str) -> Result<Option<&Field>> {
        let field = self.field(name);
        match self.left_aside.iter().find(|l| l.name == name) {
            Some(LeftAside { reason, .. }) if field.is_none() => {
                Err(broken(format!("array '{name}' is unusable: {reason}")))
            }
            _ => Ok(field),
        }
    }

    /// Takes the time from an array of the whole file that is one: VTK's, or that of VisIt and others.
    pub(super) fn take_time(&mut self, name: &str, data: &Data) {
        let first = || data.to_f64().ok().and_then(|values| values.first().copied());
        match (name, first()) {
            ("TimeValue" | "TIME", Some(time)) if !time.is_finite() => {
                self.remarks.push(format!("its {name} is {time}: left aside"));
            }
            ("TimeValue", Some(time)) => self.time = Some(time),
            ("TIME", time) => self.time = self.time.or(time),
            _ => {}
        }
    }

    /// Takes a text of the whole file.
    pub(super) fn take_note(&mut self, name: String, text: String) {
        match text.len() {
            0..=LONGEST_NOTE => self.notes.push((name, text)),
            _ => self.remarks.push(format!("the text '{name:.40}' is too long: left aside")),
        }
    }

    /// The particles that this file owns, with arrays that can be told apart.
    pub(super) fn settled(mut self) -> Result<Snapshot> {
        self.drop_namesakes();
        self.drop_ghosts()?;
        Ok(self)
    }

    /// Of arrays with one name, nobody knows which is meant.
    fn drop_namesakes(&mut self) {
        let mut seen = HashMap::new();
        self.fields.iter().for_each(|f| *seen.entry(f.name.clone()).or_insert(0) += 1);
        seen.retain(|_, count| *count > 1);
        self.fields.retain(|f| !seen.contains_key(&f.name));
        let mut names: Vec<String> = seen.into_keys().collect();
        names.sort_unstable();
        let reason = "several arrays have this name";
        self.left_aside.extend(names.into_iter().map(|name| LeftAside { name, reason: reason.into() }));
    }

    /// Points that VTK marks as another piece's, or as hidden, are no particles of this file.
    fn drop_ghosts(&mut self) -> Result<()> {
        let Some(at) = self.fields.iter().position(|f| f.name == GHOSTS && f.components == 1) else { return Ok(()) };
        let Some(owned) = self.fields[at].data.without_bits(DUPLICATE | HIDDEN)? else { return Ok(()) };
        self.fields.remove(at);
        self.ghosts = owned.iter().filter(|owned| !**owned).count();
        if self.ghosts > 0 {
            keep(&mut self.points, &owned, 1);
            self.fields.iter_mut().for_each(|f| f.data.keep(&owned, f.components));
        }
        Ok(())
    }

    /// The same content, borrowed for a writer.
    pub fn view(&self) -> View<'_> {
        View {
            n: self.points.len(),
            points: Values::stored(self.points.as_flattened()),
            fields: self.fields.iter().map(Field::column).collect(),
            time: self.time,
            notes: self.notes.iter().map(|(k, v)| (k.as_str().into(), v.as_str().into())).collect(),
        }
    }
}

impl Field {
    /// The same array, borrowed for a writer.
    pub fn column(&self) -> Column<'_> {
        Column { name: self.name.as_str().into(), components: self.components, values: self.data.values() }
    }
}
