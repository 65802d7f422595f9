//! VTK's XML files: points and point arrays of `.vtu` and `.vtp`, in every encoding that VTK writes.
//!
//! The format: <https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html>.

use super::data::{Data, Element, ReadValues, extend};
use super::payload::{Compressor, Layout, Payload};
use super::snapshot::{Field, Snapshot};
use super::split::{Appended, Split};
use super::{broken, in_file, legacy, system};
use crate::error::{Error, Result};
use roxmltree::Node;
use std::cell::Cell;
use std::fs::File;
use std::io::{Seek, SeekFrom};
use std::path::Path;

/// Reads an open file; `path` is for its neighbours. The pieces of a parallel file are not `whole`: they cannot list
/// further files, or a list of itself would have no end.
pub fn read(mut file: File, path: &Path, whole: bool) -> Result<Snapshot> {
    let split = Split::of(&mut file)?;
    let document = split.document()?;
    let root = document.root_element();
    let kind = root.attribute("type").filter(|_| root.has_tag_name("VTKFile"));
    let kind = kind.ok_or_else(|| broken("it is no VTK file: there is no VTKFile element with a type"))?;
    let grid = root.children().find(|c| c.has_tag_name(kind));
    let grid = grid.ok_or_else(|| broken(format!("it has no {kind} element")))?;
    match kind {
        "UnstructuredGrid" | "PolyData" => {
            Reader { file: &file, split: &split, layout: layout(root)?, taken: Cell::new(0) }.grid(grid)
        }
        "PUnstructuredGrid" | "PPolyData" if whole => parallel(grid, path),
        "PUnstructuredGrid" | "PPolyData" => Err(broken("a piece of a list is a list again")),
        "Collection" => Err(broken("it is a list of files; read one of those, or open it as a series")),
        "vtkMultiBlockDataSet" | "vtkPartitionedDataSet" | "vtkPartitionedDataSetCollection" => {
            Err(broken("it is a list of blocks; read the .vtu or .vtp of one of them"))
        }
        "ImageData" | "RectilinearGrid" | "PImageData" | "PRectilinearGrid" => {
            Err(broken(format!("the points of a {kind} are not in the file; save it as an unstructured grid, .vtu")))
        }
        // vtkio aborts the process on a forged compressed file, so it never sees one.
        _ if root.attributes().any(|a| a.name() == "compressor") => {
            Err(broken(format!("a compressed {kind} is not supported; re-save it without compression")))
        }
        _ => legacy::read_xml(path),
    }
}

fn layout(root: Node) -> Result<Layout> {
    let word = match root.attribute("header_type") {
        Some("UInt32") | None => 4,
        Some("UInt64") => 8,
        Some(other) => return Err(broken(format!("header_type '{other}' is neither UInt32 nor UInt64"))),
    };
    let swapped = match root.attribute("byte_order") {
        Some("LittleEndian") | None => cfg!(target_endian = "big"),
        Some("BigEndian") => cfg!(target_endian = "little"),
        Some(other) => return Err(broken(format!("byte_order '{other}' is neither LittleEndian nor BigEndian"))),
    };
    Ok(Layout { word, swapped, compressor: compressor(root)? })
}

fn compressor(root: Node) -> Result<Option<Compressor>> {
    match root.attribute("compressor") {
        None | Some("") => Ok(None),
        Some("vtkZLibDataCompressor") => Ok(Some(Compressor::Zlib)),
        Some("vtkLZ4DataCompressor") => Ok(Some(Compressor::Lz4)),
        Some(other) => Err(broken(format!("compressor {other} is not supported; re-save the file with zlib or lz4"))),
    }
}

/// A parallel file lists the files of its pieces, which lie beside it.
fn parallel(grid: Node, path: &Path) -> Result<Snapshot> {
    let mut pieces = Vec::new();
    for piece in grid.children().filter(|c| c.has_tag_name("Piece")) {
        let source = piece.attribute("Source").ok_or_else(|| broken("a piece names no file"))?;
        let source = super::atomic::folder_of(path).join(source);
        pieces.push(super::read_any(&source, false).map_err(|e| in_file(&source, e))?);
    }
    join(pieces)
}

struct Reader<'a> {
    file: &'a File,
    split: &'a Split,
    layout: Layout,
    /// Bytes of all arrays so far.
    taken: Cell<u64>,
}

impl Reader<'_> {
    /// Notes that an array of so many bytes is read. Together they cannot hold more than the file, unless it has been
    /// forged to give the same bytes again and again.
    fn take(&self, count: usize, size: usize) -> Result<()> {
        let taken = (count as u64).saturating_mul(size as u64).saturating_add(self.taken.get());
        self.taken.set(taken);
        if taken > self.layout.capacity(self.split.length) {
            return Err(broken("its arrays claim more than the file holds"));
        }
        Ok(())
    }

    fn grid(&self, grid: Node) -> Result<Snapshot> {
        let pieces = grid.children().filter(|c| c.has_tag_name("Piece"));
        let mut snapshot = join(pieces.map(|piece| self.piece(piece)).collect::<Result<_>>()?)?;
        for array in arrays(grid, "FieldData") {
            match array.attribute("Name").unwrap_or_default() {
                "TimeValue" => snapshot.time = self.data(array, 1)?.to_f64()?.first().copied(),
                name => snapshot.notes.extend(self.note(array)?.map(|text| (name.to_string(), text))),
            }
        }
        Ok(snapshot)
    }

    fn piece(&self, piece: Node) -> Result<Snapshot> {
        let n = number(piece, "NumberOfPoints")?.ok_or_else(|| broken("a piece has no NumberOfPoints"))?;
        let points = match arrays(piece, "Points").next() {
            Some(array) => self.field(array, n)?,
            None if n == 0 => Field { name: String::new(), components: 3, data: Data::F64(Vec::new()) },
            None => return Err(broken("a piece has no Points")),
        };
        if points.components != 3 {
            return Err(broken(format!("its points have {} coordinates, not 3", points.components)));
        }
        let numeric = |a: &Node| {
            let is = a.has_tag_name("DataArray") && !matches!(a.attribute("type"), Some("String" | "Bit"));
            if !is {
                log::warn!("array '{}' is not of numbers: left aside", a.attribute("Name").unwrap_or_default());
            }
            is
        };
        let fields = arrays(piece, "PointData").filter(numeric).map(|array| self.field(array, n));
        let fields = fields.collect::<Result<_>>()?;
        let name = |a: Node| a.attribute("Name").unwrap_or_default().to_string();
        let of_cells = arrays(piece, "CellData").map(name).collect();
        Ok(Snapshot { points: coordinates(points.data)?, fields, of_cells, ..Snapshot::default() })
    }

    fn field(&self, array: Node, n: usize) -> Result<Field> {
        let name = array.attribute("Name").unwrap_or_default().to_string();
        let components = number(array, "NumberOfComponents")?.unwrap_or(1);
        let count = n.checked_mul(components).filter(|_| components > 0);
        let count = count.ok_or_else(|| broken(format!("array '{name}' cannot have {n} tuples of {components}")))?;
        Ok(Field { name, components, data: self.data(array, count)? })
    }

    fn data(&self, array: Node, count: usize) -> Result<Data> {
        let kind = array.attribute("type").unwrap_or_default();
        let data = Data::read_as(kind, Array { reader: self, array, count });
        let data = data.unwrap_or_else(|| Err(broken(format!("type '{kind}' is unknown"))));
        data.map_err(|e| in_array(array, e))
    }

    /// The text of an array of characters; `None` for any other array.
    fn note(&self, array: Node) -> Result<Option<String>> {
        let ascii = matches!(array.attribute("format"), Some("ascii") | None);
        let bytes = match array.attribute("type") {
            Some("Int8" | "String") if ascii => {
                let codes = text_of(array).split_ascii_whitespace().map(|c| c.parse::<i16>().map(|c| c as u8));
                codes.collect::<std::result::Result<_, _>>().map_err(|_| broken("a text is not in character codes"))
            }
            Some("Int8" | "String") => self.payload(array).and_then(|p| p.text(&self.layout)),
            _ => return Ok(None),
        };
        let bytes: Vec<u8> = bytes.map_err(|e| in_array(array, e))?;
        self.take(bytes.len(), 1)?;
        // VTK ends each of several strings with a NUL.
        Ok(String::from_utf8(bytes).ok().map(|text| text.trim_end_matches('\0').replace('\0', "\n")))
    }

    fn payload<'p>(&'p self, array: Node<'p, '_>) -> Result<Payload<'p>> {
        if array.attribute("format") == Some("binary") {
            return Ok(Payload::base64(text_of(array).trim().as_bytes()));
        }
        let offset = number(array, "offset")?.ok_or_else(|| broken("it has no offset"))?;
        let outside = || broken(format!("its offset {offset} lies outside the file"));
        match &self.split.appended {
            Appended::None => Err(broken("the file has no appended section")),
            Appended::Base64(text) => text.get(offset..).map(Payload::base64).ok_or_else(outside),
            Appended::Raw(start) => {
                let place = start.checked_add(offset as u64).filter(|p| p <= &self.split.length).ok_or_else(outside)?;
                let mut file = self.file;
                file.seek(SeekFrom::Start(place)).map_err(system)?;
                Ok(Payload::bare(file, self.split.length - place))
            }
        }
    }
}

/// A request for the values of one array, whatever their type.
struct Array<'r, 'a, 'input> {
    reader: &'r Reader<'r>,
    array: Node<'a, 'input>,
    count: usize,
}

impl ReadValues for Array<'_, '_, '_> {
    fn values<T: Element>(self) -> Result<Vec<T>> {
        match self.array.attribute("format") {
            Some("ascii") | None => ascii(text_of(self.array), self.count),
            Some("binary" | "appended") => {
                self.reader.take(self.count, size_of::<T>())?;
                self.reader.payload(self.array)?.values(&self.reader.layout, self.count)
            }
            Some(other) => Err(broken(format!("format '{other}' is unknown"))),
        }
    }
}

fn ascii<T: Element>(text: &str, count: usize) -> Result<Vec<T>> {
    // A number takes a character and a space.
    if count > text.len() / 2 + 1 {
        return Err(broken(format!("{count} numbers do not fit into {} characters", text.len())));
    }
    let mut values = crate::memory::reserved("an array of the file", count)?;
    for word in text.split_ascii_whitespace() {
        if values.len() == count {
            return Err(broken(format!("it has more than {count} numbers")));
        }
        values.push(word.parse().map_err(|_| broken(format!("'{word:.30}' is no {}", T::NAME)))?);
    }
    match values.len() {
        n if n == count => Ok(values),
        n => Err(broken(format!("it has {n} numbers where {count} are expected"))),
    }
}

pub(super) fn coordinates(data: Data) -> Result<Vec<[f64; 3]>> {
    let flat = match data {
        Data::F64(flat) => flat,
        Data::F32(_) => data.to_f64()?,
        other => return Err(broken(format!("its points are {}, not floating-point numbers", other.type_name()))),
    };
    match bytemuck::try_cast_vec(flat) {
        Ok(points) => Ok(points),
        Err((_, flat)) => {
            let points = flat.as_chunks::<3>().0;
            crate::memory::copied("the points of the file", points)
        }
    }
}

/// One cloud from the pieces of a file, in their order.
fn join(pieces: Vec<Snapshot>) -> Result<Snapshot> {
    // A piece without points often comes without arrays; it matters only if there is no other.
    let all_empty = pieces.iter().all(|p| p.points.is_empty());
    let mut pieces = pieces.into_iter().filter(|p| all_empty || !p.points.is_empty());
    let mut whole = pieces.next().unwrap_or_default();
    for piece in pieces {
        extend(&mut whole.points, &piece.points)?;
        for field in &mut whole.fields {
            let same = piece.field(&field.name).filter(|f| f.components == field.components);
            let joined = same.map_or(Ok(false), |f| field.data.append(&f.data))?;
            if !joined && !all_empty {
                return Err(broken(format!("array '{}' is not the same in all pieces", field.name)));
            }
        }
    }
    Ok(whole)
}

/// The arrays in the sections of that name.
fn arrays<'a, 'input: 'a>(parent: Node<'a, 'input>, section: &'static str) -> impl Iterator<Item = Node<'a, 'input>> {
    parent.children().filter(move |c| c.has_tag_name(section)).flat_map(|s| s.children().filter(Node::is_element))
}

fn number(node: Node, attribute: &str) -> Result<Option<usize>> {
    let parse = |text: &str| text.trim().parse().map_err(|_| broken(format!("{attribute} '{text:.30}' is no count")));
    node.attribute(attribute).map(parse).transpose()
}

fn text_of<'a>(array: Node<'a, '_>) -> &'a str {
    array.text().unwrap_or_default()
}

fn in_array(array: Node, error: Error) -> Error {
    let name = array.attribute("Name").unwrap_or_default();
    match error {
        Error::BadFile { path, reason } => Error::BadFile { path, reason: format!("array '{name}': {reason}") },
        other => in_file(Path::new(""), other),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn files_without_points_of_their_own_say_what_to_do() {
        let dir = tempfile::tempdir().unwrap();
        for (kind, advice) in [
            ("ImageData", "save it as an unstructured grid"),
            ("PRectilinearGrid", "save it as an unstructured grid"),
            ("vtkMultiBlockDataSet", "read the .vtu or .vtp of one"),
            ("StructuredGrid", "re-save it without compression"),
            ("Collection", "open it as a series"),
        ] {
            let path = dir.path().join(kind);
            let text =
                format!("<VTKFile type=\"{kind}\" compressor=\"vtkLZ4DataCompressor\"><{kind}></{kind}></VTKFile>");
            std::fs::write(&path, text).unwrap();
            let e = super::super::read(&path).unwrap_err().to_string();
            assert!(e.contains(advice) && e.contains(kind), "{e}");
        }
    }
}
