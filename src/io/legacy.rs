//! What vtkio does: legacy `.vtk` files to write, and XML grids that our reader does not know.
//!
//! vtkio can panic on a damaged file, so each call is guarded; and it writes into memory, since it does not notice a full
//! disk.

use super::data::Data;
use super::snapshot::{Field, Snapshot};
use super::view::{Values, View};
use super::{broken, system};
use crate::error::{Error, Result};
use crate::memory;
use std::borrow::Cow;
use std::fmt::Display;
use std::fs::File;
use std::io::BufReader;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use vtkio::model::{
    Attribute, Attributes, ByteOrder, CellType, Cells, DataSet, FieldArray, IOBuffer, Piece, ScalarType,
    UnstructuredGridPiece, Version, VertexNumbers, Vtk,
};

/// An XML file of another kind; it must not be compressed.
pub fn read_xml(path: &Path) -> Result<Snapshot> {
    let file = BufReader::new(File::open(path).map_err(system)?);
    guarded(|| cloud(Vtk::parse_xml(file).map_err(unreadable)?.data))
}

/// The file's bytes.
pub fn encode(view: &View) -> Result<Vec<u8>> {
    let file = Vtk {
        version: Version::new_legacy(4, 2),
        title: "diffusph".into(),
        byte_order: ByteOrder::BigEndian,
        data: grid(view)?,
        file_path: None,
    };
    guarded(|| {
        let mut bytes = Vec::new();
        let done = file.write_legacy(&mut bytes);
        done.map(|()| bytes).map_err(|e| Error::Io { path: String::new(), reason: format!("cannot write it: {e}") })
    })
}

fn guarded<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| Err(unreadable("the parser stumbled")))
}

fn unreadable(reason: impl Display) -> Error {
    broken(format!("vtkio cannot read it ({reason}); re-save it as .vtu"))
}

fn cloud(data: DataSet) -> Result<Snapshot> {
    let (points, arrays) = match data {
        DataSet::UnstructuredGrid { pieces, .. } => only(pieces).map(|p| (p.points, p.data)),
        DataSet::PolyData { pieces, .. } => only(pieces).map(|p| (p.points, p.data)),
        DataSet::StructuredGrid { pieces, .. } => only(pieces).map(|p| (p.points, p.data)),
        _ => Err(broken("the points of this kind of grid are not stored; save it as an unstructured grid")),
    }?;
    let points = super::xml_read::coordinates(data_of("points", points)?)?;
    let mut fields = Vec::new();
    for array in arrays.point {
        match array {
            Attribute::DataArray(a) => fields.push(field(&a.name, a.elem.num_comp() as usize, a.data, points.len())?),
            Attribute::Field { data_array, .. } => {
                for a in data_array {
                    fields.push(field(&a.name, a.elem as usize, a.data, points.len())?);
                }
            }
        }
    }
    Ok(Snapshot { points, fields, ..Snapshot::default() })
}

fn only<P>(pieces: Vec<Piece<P>>) -> Result<P> {
    match <[Piece<P>; 1]>::try_from(pieces) {
        Ok([Piece::Inline(piece)]) => Ok(*piece),
        _ => Err(broken("a grid of this kind must be in one piece; save it as an unstructured grid")),
    }
}

fn field(name: &str, components: usize, values: IOBuffer, n: usize) -> Result<Field> {
    let data = data_of(name, values)?;
    match n.checked_mul(components) {
        Some(count) if count == data.len() && components > 0 => Ok(Field { name: name.into(), components, data }),
        _ => Err(broken(format!("array '{name}' has {} values, not {components} for each of {n} points", data.len()))),
    }
}

fn data_of(name: &str, values: IOBuffer) -> Result<Data> {
    data(values).ok_or_else(|| broken(format!("array '{name}' is of bits; save it as numbers")))
}

pub(super) fn data(values: IOBuffer) -> Option<Data> {
    Some(match values {
        IOBuffer::Bit(_) => return None,
        IOBuffer::U8(v) => Data::U8(v),
        IOBuffer::I8(v) => Data::I8(v),
        IOBuffer::U16(v) => Data::U16(v),
        IOBuffer::I16(v) => Data::I16(v),
        IOBuffer::U32(v) => Data::U32(v),
        IOBuffer::I32(v) => Data::I32(v),
        IOBuffer::U64(v) => Data::U64(v),
        IOBuffer::I64(v) => Data::I64(v),
        IOBuffer::F32(v) => Data::F32(v),
        IOBuffer::F64(v) => Data::F64(v),
    })
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
    IOBuffer::from_byte_vec(bytes, kind, ByteOrder::LittleEndian).map_err(unreadable)
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
