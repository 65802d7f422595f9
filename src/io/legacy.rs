//! Legacy `.vtk` both ways, and XML grids that our reader does not know, through vtkio.
//!
//! vtkio can panic on a damaged file, so each call is guarded; it passes over what it cannot parse, so whatever it leaves
//! unread is an error here; and it writes into memory, since it does not notice a full disk.

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

pub fn read(path: &Path) -> Result<Snapshot> {
    let bytes = std::fs::read(path).map_err(system)?;
    guarded(|| decode(&older_types(&bytes)))
}

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

fn decode(bytes: &[u8]) -> Result<Snapshot> {
    let Some((start, dataset, body)) = split_field_data(bytes) else {
        return cloud(parse(bytes)?.data);
    };
    // vtkio knows field data only as a data set of its own: read it as one, then the rest without it.
    let alone = [start, body].concat();
    let (rest, fields) = parse_start(&alone)?;
    let mut snapshot = cloud(parse(&[start, dataset, rest].concat())?.data)?;
    if let DataSet::Field { data_array, .. } = fields.data {
        let time = data_array.into_iter().find(|f| f.name == "TimeValue");
        snapshot.time =
            time.and_then(|f| data(f.data)).map(|d| d.to_f64()).transpose()?.and_then(|t| t.first().copied());
    }
    Ok(snapshot)
}

/// VTK and meshio name integers by their size now; vtkio knows that only in lists of cells, which have no number before
/// it.
fn older_types(bytes: &[u8]) -> Cow<'_, [u8]> {
    const NEW: &[u8] = b" vtktype";
    let mut out = Vec::new();
    let mut done = 0;
    for i in 1..bytes.len().saturating_sub(NEW.len()) {
        if bytes[i] != b' ' || !bytes[i..].starts_with(NEW) || !bytes[i - 1].is_ascii_digit() {
            continue;
        }
        let rest = &bytes[i + NEW.len()..];
        let line = rest.split(|b| *b == b'\n').next().unwrap_or_default();
        let Some((_, old)) = OLDER.iter().find(|(new, _)| new.as_bytes() == line.trim_ascii_end()) else { continue };
        out.extend_from_slice(&bytes[done..=i]);
        out.extend_from_slice(old.as_bytes());
        done = i + NEW.len() + line.len();
    }
    if done == 0 {
        return bytes.into();
    }
    out.extend_from_slice(&bytes[done..]);
    out.into()
}

static OLDER: &[(&str, &str)] = &[
    ("int8", "char"),
    ("uint8", "unsigned_char"),
    ("int16", "short"),
    ("int32", "int"),
    ("uint32", "unsigned_int"),
    ("int64", "long"),
    ("uint64", "unsigned_long"),
];

/// The three opening lines, the DATASET line and the rest, if that begins with field data.
fn split_field_data(bytes: &[u8]) -> Option<(&[u8], &[u8], &[u8])> {
    let mut ends = bytes.iter().enumerate().filter(|(_, b)| **b == b'\n').map(|(i, _)| i + 1);
    let (start, dataset) = (ends.nth(2)?, ends.next()?);
    let body = &bytes[dataset..];
    body.trim_ascii_start().starts_with(b"FIELD").then_some((&bytes[..start], &bytes[start..dataset], body))
}

fn parse(bytes: &[u8]) -> Result<Vtk> {
    match parse_start(bytes)? {
        ([], vtk) => Ok(vtk),
        (rest, _) => Err(unreadable(format!("it understands nothing from byte {} on", bytes.len() - rest.len()))),
    }
}

fn parse_start(bytes: &[u8]) -> Result<(&[u8], Vtk)> {
    vtkio::parser::parse_be(bytes).map_err(|_| unreadable("its structure is not that of a legacy file"))
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
    Ok(Snapshot { points, fields, time: None, notes: Vec::new() })
}

fn only<P>(pieces: Vec<Piece<P>>) -> Result<P> {
    match <[Piece<P>; 1]>::try_from(pieces) {
        Ok([Piece::Inline(piece)]) => Ok(*piece),
        _ => Err(broken("a grid of this kind must be in one piece; save it as an unstructured grid")),
    }
}

fn field(name: &str, components: usize, values: IOBuffer, n: usize) -> Result<Field> {
    let name = decoded(name);
    let data = data_of(&name, values)?;
    match n.checked_mul(components) {
        Some(count) if count == data.len() && components > 0 => Ok(Field { name, components, data }),
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
fn encoded(name: &str) -> Cow<'_, str> {
    let special = |c: char| matches!(c, ' ' | '%' | '"') || !c.is_ascii();
    if !name.contains(special) {
        return name.into();
    }
    let code = |b: u8| if special(b as char) { format!("%{b:02X}") } else { (b as char).to_string() };
    name.bytes().map(code).collect::<String>().into()
}

fn decoded(name: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = name.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let code = after.get(..2).filter(|c| first == b'%' && c.iter().all(u8::is_ascii_hexdigit));
        let code = code.and_then(|c| u8::from_str_radix(std::str::from_utf8(c).ok()?, 16).ok());
        bytes.push(code.unwrap_or(first));
        rest = if code.is_some() { &after[2..] } else { after };
    }
    String::from_utf8(bytes).unwrap_or_else(|_| name.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_survive_the_code_of_legacy_files() {
        for name in ["T", "velocity m/s", "100%", "%41", "a\"b", "κ ∇T"] {
            let code = encoded(name);
            assert!(code.is_ascii() && !code.contains(' ') && decoded(&code) == name, "{code}");
        }
        assert_eq!(decoded("%zz%4"), "%zz%4");
    }

    #[test]
    fn what_vtkio_would_silently_leave_out_is_an_error() {
        let text = "# vtk DataFile Version 4.2\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 1 double\n0 1 2\n\
                    CELLS 1 2\n1 0\nCELL_TYPES 1\n1\nPOINT_DATA 1\nSCALARS T double 1\nLOOKUP_TABLE default\n7\n";
        let good = decode(text.as_bytes()).unwrap();
        assert_eq!((good.points, &good.fields[0].data), (vec![[0.0, 1.0, 2.0]], &Data::F64(vec![7.0])));
        for broken in [text.replace("SCALARS T", "SCALARS T x"), text.replace("\n7\n", "\n"), format!("{text} more")] {
            assert_eq!(decode(broken.as_bytes()).unwrap_err().name(), "BAD_FILE", "{broken}");
        }
    }

    #[test]
    fn only_types_are_renamed_not_lists_of_cells() {
        let text = b"OFFSETS vtktypeint64\n0 1\nid 1 1 vtktypeint64\n7\nk 1 1 vtktypeuint8 \n8\n";
        let older = b"OFFSETS vtktypeint64\n0 1\nid 1 1 long\n7\nk 1 1 unsigned_char\n8\n";
        assert_eq!(&older_types(text)[..], older);
        assert!(matches!(older_types(older), Cow::Borrowed(b) if b == older));
    }

    #[test]
    fn every_type_goes_there_and_back() {
        for n in [0, 1, 1000] {
            let mut snapshot = super::super::samples::cloud(n);
            // vtkio does not know its own `unsigned_short` when it reads.
            let back_of = |s: &Snapshot| decode(&encode(&s.view()).unwrap());
            assert_eq!(back_of(&snapshot).unwrap_err().name(), "BAD_FILE");
            snapshot.fields.retain(|f| f.name != "u16");
            let back = back_of(&snapshot).unwrap();
            (snapshot.time, snapshot.notes) = (None, Vec::new()); // the format has no place for them
            assert!(super::super::samples::same(&back, &snapshot), "{n}: {back:?}");
        }
    }
}
