//! VTK's XML files: points and point arrays of `.vtu` and `.vtp`, in every encoding that VTK writes.
//!
//! The format: <https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html>.

use super::data::{Data, Fault, Found, ReadValues, extend, unless_fatal};
use super::element::Element;
use super::payload::{Compressor, Layout, Payload};
use super::snapshot::{Field, LeftAside, Snapshot};
use super::split::{Appended, Split};
use super::{broken, in_file, system};
use crate::error::{Error, Result};
use roxmltree::Node;
use std::cell::Cell;
use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::io::{Seek, SeekFrom};
use std::path::{Path, PathBuf};

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
    let reader = || Ok::<_, Error>(Reader { file: &file, split: &split, layout: layout(root)?, taken: Cell::new(0) });
    match kind {
        "UnstructuredGrid" | "PolyData" => reader()?.grid(grid),
        "StructuredGrid" if grid.children().filter(|c| c.has_tag_name("Piece")).count() > 1 => {
            Err(broken("its pieces share points; save it as an unstructured grid, .vtu"))
        }
        "StructuredGrid" => reader()?.grid(grid),
        "PUnstructuredGrid" | "PPolyData" if whole => {
            let mut snapshot = parallel(grid, path)?;
            reader()?.about(grid, &mut snapshot)?;
            Ok(snapshot)
        }
        "PUnstructuredGrid" | "PPolyData" => Err(broken("a piece of a list is a list again")),
        "Collection" => Err(broken("it is a list of files; give one of those that it names")),
        "vtkMultiBlockDataSet" | "vtkPartitionedDataSet" | "vtkPartitionedDataSetCollection" => {
            Err(broken("it is a list of blocks; read the .vtu or .vtp of one of them"))
        }
        "ImageData" | "RectilinearGrid" | "PImageData" | "PRectilinearGrid" => {
            Err(broken(format!("the points of a {kind} are not in the file; save it as an unstructured grid, .vtu")))
        }
        _ => Err(broken(format!("a {kind} is not supported; save it as an unstructured grid, .vtu"))),
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
        Some("vtkLZMADataCompressor") => Ok(Some(Compressor::Lzma)),
        Some(other) => Err(broken(format!("compressor {other} is not supported; re-save the file with zlib or lz4"))),
    }
}

/// A parallel file lists the files of its pieces, which lie beside it.
fn parallel(grid: Node, path: &Path) -> Result<Snapshot> {
    let sources = grid.children().filter(|c| c.has_tag_name("Piece"));
    let sources: Vec<PathBuf> = sources.map(|piece| source_of(piece, path)).collect::<Result<_>>()?;
    let mut seen = HashSet::new();
    if let Some(twice) = sources.iter().find(|source| !seen.insert(*source)) {
        return Err(broken(format!("it names the piece {} twice; its particles are there once", twice.display())));
    }
    let read = |source: &PathBuf| super::read_any(source, false).map_err(|e| in_file(source, e));
    join(sources.iter().map(read).collect::<Result<_>>()?)
}

/// Where the file of a piece is, with one name for each file.
fn source_of(piece: Node, list: &Path) -> Result<PathBuf> {
    let source = piece.attribute("Source").ok_or_else(|| broken("a piece names no file"))?;
    let folder = super::atomic::folder_of(list);
    // Lists from Windows have its separators.
    let path = [source, &source.replace('\\', "/")].map(|name| folder.join(name)).into_iter().find(|p| p.exists());
    let path = path.unwrap_or_else(|| folder.join(source));
    path.canonicalize().map_err(|e| in_file(&path, system(e)))
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
        self.about(grid, &mut snapshot)?;
        Ok(snapshot)
    }

    /// What belongs to the whole file: its time and its texts.
    fn about(&self, grid: Node, snapshot: &mut Snapshot) -> Result<()> {
        let times = || grid.attribute("TimeValues").unwrap_or_default().split_ascii_whitespace();
        if let Some(first) = times().next() {
            snapshot.time = first.parse().ok().filter(|t: &f64| t.is_finite());
            if times().nth(1).is_some() {
                let count = times().count();
                snapshot.remarks.push(format!("it holds {count} time steps: the first is read, t = {first}"));
            }
        }
        for array in arrays(grid, "FieldData") {
            let name = array.attribute("Name").unwrap_or_default();
            if matches!(name, "TimeValue" | "TIME") {
                let one = self.data(array, 1);
                let time = unless_fatal(one)?.map_err(|reason| snapshot.remarks.push(format!("{name}: {reason}")));
                time.into_iter().for_each(|time| snapshot.take_time(name, &time));
            } else if let Some(text) = self.note(array)? {
                snapshot.take_note(name.to_string(), text);
            }
        }
        Ok(())
    }

    fn piece(&self, piece: Node) -> Result<Snapshot> {
        let n = points_of(piece)?;
        let points = match arrays(piece, "Points").next() {
            Some(array) => self.field(array, n).map_err(|fault| match fault {
                // What is fatal has the name of its array.
                Fault::Fatal(error) => error,
                unfit => in_array(array, unfit.error()),
            })?,
            None if n == 0 => Field { name: String::new(), components: 3, data: Data::F64(Vec::new()) },
            None => return Err(broken("a piece has no Points")),
        };
        if points.components != 3 {
            return Err(broken(format!("its points have {} coordinates, not 3", points.components)));
        }
        let name = |a: Node| a.attribute("Name").unwrap_or_default().to_string();
        let of_cells = arrays(piece, "CellData").map(name).collect();
        let mut found = Snapshot { points: coordinates(points.data)?, of_cells, ..Snapshot::default() };
        for array in arrays(piece, "PointData") {
            match unless_fatal(self.field(array, n))? {
                Ok(field) => found.fields.push(field),
                Err(reason) => found.left_aside.push(LeftAside { name: name(array), reason }),
            }
        }
        found.settled()
    }

    fn field(&self, array: Node, n: usize) -> Found<Field> {
        let name = array.attribute("Name").unwrap_or_default().to_string();
        let unfit = || Fault::Unfit(format!("it cannot have the components of its head for each of {n} points"));
        let components = number(array, "NumberOfComponents").map_err(|_| unfit())?.unwrap_or(1);
        let count = n.checked_mul(components).filter(|_| components > 0).ok_or_else(unfit)?;
        Ok(Field { name, components, data: self.data(array, count)? })
    }

    fn data(&self, array: Node, count: usize) -> Found<Data> {
        let kind = match array.has_tag_name("DataArray") {
            true => array.attribute("type").unwrap_or_default(),
            false => array.tag_name().name(), // an Array of texts or such
        };
        Data::read_as(kind, Array { reader: self, array, count }).map_err(|fault| match fault {
            Fault::Fatal(error) => Fault::Fatal(in_array(array, error)),
            unfit => unfit,
        })
    }

    /// The text of an array of characters; `None` for any other array.
    fn note(&self, array: Node) -> Result<Option<String>> {
        if !matches!(array.attribute("type"), Some("Int8" | "String")) {
            return Ok(None);
        }
        let bytes = match self.payload(array)? {
            Some(payload) => unless_fatal(payload.text(&self.layout))?,
            None => codes(text_of(array)),
        };
        let Ok(bytes) = bytes else { return Ok(None) };
        self.take(bytes.len(), 1)?;
        // VTK ends each of several strings with a NUL.
        Ok(String::from_utf8(bytes).ok().map(|text| text.trim_end_matches('\0').replace('\0', "\n")))
    }

    /// The bytes of an array; none where it is in digits. As in VTK, an offset says that they are appended, "binary" that
    /// they are in base64, and anything else is not looked at.
    fn payload<'p>(&'p self, array: Node<'p, '_>) -> Result<Option<Payload<'p>>> {
        let Some(offset) = number(array, "offset")? else {
            let binary = array.attribute("format") == Some("binary");
            return Ok(binary.then(|| Payload::base64(text_of(array).trim().as_bytes())));
        };
        let outside = || broken(format!("its offset {offset} lies outside the file"));
        match &self.split.appended {
            Appended::None => Err(broken("the file has no appended section")),
            Appended::Base64(text) => text.get(offset..).map(Payload::base64).map(Some).ok_or_else(outside),
            Appended::Raw(start) => {
                let place = start.checked_add(offset as u64).filter(|p| p <= &self.split.length).ok_or_else(outside)?;
                let mut file = self.file;
                file.seek(SeekFrom::Start(place)).map_err(system)?;
                Ok(Some(Payload::bare(file, self.split.length - place)))
            }
        }
    }
}

/// A text as its characters' codes.
fn codes(text: &str) -> std::result::Result<Vec<u8>, String> {
    let codes = text.split_ascii_whitespace().map(|c| c.parse::<i16>().map(|c| c as u8));
    codes.collect::<std::result::Result<_, _>>().map_err(|e| e.to_string())
}

/// The number of points of a piece; a structured one has its extent in place of a count.
fn points_of(piece: Node) -> Result<usize> {
    if let Some(n) = number(piece, "NumberOfPoints")? {
        return Ok(n);
    }
    let extent = piece.attribute("Extent").ok_or_else(|| broken("a piece has neither NumberOfPoints nor Extent"))?;
    let ends = extent.split_ascii_whitespace().map(|end| end.parse::<i64>().ok()).collect::<Option<Vec<_>>>();
    let along = |ends: &[i64; 2]| ends[1].checked_sub(ends[0])?.checked_add(1)?.try_into().ok();
    let n = ends
        .filter(|ends| ends.len() == 6)
        .and_then(|ends| ends.as_chunks().0.iter().try_fold(1usize, |n, ends| n.checked_mul(along(ends)?)));
    n.ok_or_else(|| broken(format!("Extent '{extent:.60}' is not that of a grid")))
}

/// A request for the values of one array, whatever their type.
struct Array<'r, 'a, 'input> {
    reader: &'r Reader<'r>,
    array: Node<'a, 'input>,
    count: usize,
}

impl ReadValues for Array<'_, '_, '_> {
    fn values<T: Element>(self) -> Found<Vec<T>> {
        // What is damaged in its own element is missed by those who need it; appended bytes that lack end with the file.
        let inline = !self.array.has_attribute("offset");
        let damaged = |fault| match fault {
            Fault::Fatal(Error::BadFile { reason, .. }) if inline => Fault::Unfit(reason),
            other => other,
        };
        match self.reader.payload(self.array)? {
            None => ascii(text_of(self.array), self.count),
            Some(payload) => {
                self.reader.take(self.count, size_of::<T>())?;
                payload.values(&self.reader.layout, self.count).map_err(damaged)
            }
        }
    }
}

fn ascii<T: Element>(text: &str, count: usize) -> Found<Vec<T>> {
    // A number takes a character and a space: there are no more than so many, whatever the count.
    let mut values = crate::memory::reserved("an array of the file", count.min(text.len() / 2 + 1))?;
    for word in text.split_ascii_whitespace() {
        if values.len() == count {
            return Err(Fault::Unfit(format!("it has more than {count} numbers")));
        }
        values.push(word.parse().map_err(|_| Fault::Unfit(format!("'{word:.30}' is no {}", T::NAME)))?);
    }
    match values.len() {
        n if n == count => Ok(values),
        n => Err(Fault::Unfit(format!("it has {n} numbers where {count} are expected"))),
    }
}

pub(super) fn coordinates(data: Data) -> Result<Vec<[f64; 3]>> {
    let flat = match data {
        Data::F64(flat) => flat,
        other => other.to_f64()?,
    };
    match bytemuck::try_cast_vec(flat) {
        Ok(points) => Ok(points),
        Err((_, flat)) => {
            let points = flat.as_chunks::<3>().0;
            crate::memory::copied("the points of the file", points)
        }
    }
}

/// One cloud from the pieces of a file, in their order, with the arrays that all of them have.
fn join(pieces: Vec<Snapshot>) -> Result<Snapshot> {
    // A piece without points often comes without arrays; it matters only if there is no other.
    let all_empty = pieces.iter().all(|p| p.points.is_empty());
    let ghosts = pieces.iter().map(|p| p.ghosts).sum();
    let mut pieces = pieces.into_iter().filter(|p| all_empty || !p.points.is_empty());
    let mut whole = pieces.next().unwrap_or_default();
    for piece in pieces {
        extend(&mut whole.points, &piece.points)?;
        let mut others: HashMap<String, Field> = piece.fields.into_iter().map(|f| (f.name.clone(), f)).collect();
        let mut apart = piece.left_aside;
        for mut field in std::mem::take(&mut whole.fields) {
            let other = others.remove(&field.name).filter(|other| other.components == field.components);
            match other.map_or(Ok(false), |other| field.data.join(&other.data))? {
                true => whole.fields.push(field),
                false => apart.push(not_everywhere(field.name)),
            }
        }
        apart.extend(others.into_keys().map(not_everywhere));
        whole.left_aside.extend(apart);
        whole.remarks.extend(piece.remarks);
    }
    let mut seen = HashSet::new();
    whole.left_aside.retain(|l| seen.insert(l.name.clone()));
    whole.remarks.dedup();
    Ok(Snapshot { ghosts, ..whole })
}

fn not_everywhere(name: String) -> LeftAside {
    LeftAside { name, reason: "it is not the same in all pieces".into() }
}

/// The arrays in the sections of that name, of several time steps those of the first.
fn arrays<'a, 'input: 'a>(parent: Node<'a, 'input>, section: &'static str) -> impl Iterator<Item = Node<'a, 'input>> {
    let sections = parent.children().filter(move |c| c.has_tag_name(section));
    sections.flat_map(|s| s.children().filter(|array| array.is_element() && is_of_first_step(*array)))
}

/// Steps are numbered where the grid gives their times.
fn is_of_first_step(array: Node) -> bool {
    let is_first = |steps: &str| steps.split_ascii_whitespace().any(|step| step == "0");
    array.attribute("TimeStep").is_none_or(is_first) || !array.ancestors().any(|a| a.has_attribute("TimeValues"))
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
    fn a_damaged_array_of_points_is_named_once() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.vtu");
        let inline = |values: &str| format!("format=\"ascii\">{values}");
        for array in [inline("0 0"), inline("0 0 x"), "format=\"appended\" offset=\"9\">".into()] {
            let text = format!(
                "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><Piece NumberOfPoints=\"1\"><Points><DataArray \
                 type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\" {array}</DataArray></Points></Piece>\
                 </UnstructuredGrid></VTKFile>"
            );
            std::fs::write(&path, text).unwrap();
            let e = super::super::read(&path).unwrap_err().to_string();
            assert_eq!(e.matches("array 'Points'").count(), 1, "{e}");
            assert!(e.ends_with("no particle was read"), "{e}");
        }
    }

    #[test]
    fn files_without_points_of_their_own_say_what_to_do() {
        let dir = tempfile::tempdir().unwrap();
        for (kind, advice) in [
            ("ImageData", "save it as an unstructured grid"),
            ("PRectilinearGrid", "save it as an unstructured grid"),
            ("vtkMultiBlockDataSet", "read the .vtu or .vtp of one"),
            ("PStructuredGrid", "save it as an unstructured grid"),
            ("Table", "save it as an unstructured grid"),
            ("Collection", "give one of those that it names"),
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
