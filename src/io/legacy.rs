//! Legacy `.vtk` files to write, through vtkio: into memory, since it does not notice a full disk.

use super::view::{Values, View};
use crate::error::{Error, Result};
use crate::memory;
use std::borrow::Cow;
use std::fmt::Display;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use vtkio::model::{
    Attribute, Attributes, ByteOrder, CellType, Cells, DataSet, FieldArray, IOBuffer, ScalarType,
    UnstructuredGridPiece, Version, VertexNumbers, Vtk,
};

/// The second line of our files.
pub const TITLE: &str = "diffusph";

/// The file's bytes.
pub fn encode(view: &View) -> Result<Vec<u8>> {
    let file = Vtk {
        version: Version::new_legacy(4, 2),
        title: TITLE.into(),
        byte_order: ByteOrder::BigEndian,
        data: grid(view)?,
        file_path: None,
    };
    guarded(|| {
        let mut text = Text::default();
        let done = file.write_legacy(&mut text);
        let why = |e: vtkio::Error| Error::Io { path: String::new(), reason: format!("cannot write it: {e}") };
        match text.refused {
            Some(error) => Err(error),
            None => done.map(|()| text.bytes).map_err(why),
        }
    })
}

/// The text so far; where there is no room for more, it says so.
#[derive(Default)]
struct Text {
    bytes: Vec<u8>,
    refused: Option<Error>,
}

impl io::Write for Text {
    fn write(&mut self, more: &[u8]) -> io::Result<usize> {
        if let Err(error) = memory::appended("a legacy file", &mut self.bytes, more) {
            self.refused = Some(error);
            return Err(io::ErrorKind::OutOfMemory.into());
        }
        Ok(more.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn guarded<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| Err(unwritable("vtkio stumbled")))
}

fn unwritable(reason: impl Display) -> Error {
    Error::Io { path: String::new(), reason: format!("cannot write it as a legacy file ({reason}); write a .vtu") }
}

fn grid(view: &View) -> Result<DataSet> {
    let n = u32::try_from(view.n).ok().filter(|n| *n <= i32::MAX as u32 / 2);
    let n = n.ok_or_else(|| Error::bad("particles", view.n, "a legacy file counts in 32 bits; write a .vtu"))?;
    let mut vertices = memory::reserved("the cells of a legacy file", 2 * view.n)?;
    vertices.extend((0..n).flat_map(|i| [1, i]));
    let types = memory::filled("the cells of a legacy file", view.n, CellType::Vertex)?;
    let cells = Cells { cell_verts: VertexNumbers::Legacy { num_cells: n, vertices }, types };
    let mut data_array = Vec::new();
    for column in &view.fields {
        let name = encoded(&column.name).into_owned();
        data_array.push(FieldArray { name, elem: column.components as u32, data: buffer(&column.values)? });
    }
    let point = if data_array.is_empty() {
        Vec::new()
    } else {
        vec![Attribute::Field { name: "FieldData".into(), data_array }]
    };
    let points = buffer(&view.points)?;
    Ok(DataSet::inline(UnstructuredGridPiece { points, cells, data: Attributes { point, cell: Vec::new() } }))
}

fn buffer(values: &Values) -> Result<IOBuffer> {
    let bytes = values.bytes()?;
    let kind = match values.type_name {
        "Float64" => ScalarType::F64,
        "Float32" => ScalarType::F32,
        "Int64" => ScalarType::I64,
        "UInt64" => ScalarType::U64,
        "Int32" => ScalarType::I32,
        "UInt32" => ScalarType::U32,
        "Int16" => ScalarType::I16,
        "UInt16" => ScalarType::U16,
        "Int8" => ScalarType::I8,
        _ => ScalarType::U8,
    };
    IOBuffer::from_byte_vec(bytes, kind, ByteOrder::LittleEndian).map_err(unwritable)
}

/// Names in legacy files end at white space, so VTK codes it as in URLs.
pub(super) fn encoded(name: &str) -> Cow<'_, str> {
    let special = |c: char| matches!(c, ' ' | '%' | '"') || !c.is_ascii();
    if !name.contains(special) {
        return name.into();
    }
    let code = |b: u8| if special(b as char) { format!("%{b:02X}") } else { (b as char).to_string() };
    name.bytes().map(code).collect::<String>().into()
}

#[cfg(test)]
mod tests {
    use super::super::samples;
    use super::*;
    use vtkio::model::Piece;

    #[test]
    fn vtkio_reads_the_same_from_what_it_writes_for_us() {
        let mut snapshot = samples::cloud(1000);
        snapshot.fields.retain(|f| f.data.type_name().starts_with("Float")); // it cannot read all types that it writes
        let file = encode(&snapshot.view()).unwrap();
        let DataSet::UnstructuredGrid { pieces, .. } = Vtk::parse_legacy_be(&file[..]).unwrap().data else {
            panic!("another kind")
        };
        let [Piece::Inline(piece)] = &pieces[..] else { panic!("not one piece") };
        assert_eq!(piece.points.clone().into_vec::<f64>().unwrap(), snapshot.points.as_flattened());
        assert_eq!(piece.cells.types, vec![CellType::Vertex; 1000]);
        let [Attribute::Field { data_array, .. }] = &piece.data.point[..] else { panic!("not one field") };
        for (array, column) in data_array.iter().zip(snapshot.view().fields) {
            assert_eq!((array.name.as_str(), array.elem as usize), (&*encoded(&column.name), column.components));
            // NaN is no number's equal, not even its own.
            let (theirs, ours) = (format!("{:?}", array.data), format!("{:?}", buffer(&column.values).unwrap()));
            assert_eq!(theirs, ours, "{}", column.name);
        }
        assert_eq!(data_array.len(), snapshot.fields.len());
    }
}
