//! A point cloud with named arrays, owned: what reading a file gives.

use super::data::Data;
use super::view::{Column, Values, View};

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
}

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
