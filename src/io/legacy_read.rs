//! Legacy `.vtk` files of points, ascii or binary, of every version: read from front to end, since only what comes before
//! tells where the next section begins. Cells are stepped over.
//!
//! The format: <https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html>.

use super::broken;
use super::data::{Data, Element, ReadValues};
use super::snapshot::{Field, Snapshot};
use crate::error::Result;
use crate::memory;

pub fn read(bytes: &[u8]) -> Result<Snapshot> {
    let mut reader = Reader { rest: bytes, binary: false, of: Of::File, found: Snapshot::default(), points: false };
    reader.header()?;
    while let Some(words) = reader.words()? {
        reader.section(&words)?;
    }
    if reader.points { Ok(reader.found) } else { Err(broken("it has no points")) }
}

/// What arrays belong to.
#[derive(Clone, Copy, PartialEq)]
enum Of {
    File,
    Points,
    Cells(usize),
}

struct Reader<'a> {
    rest: &'a [u8],
    binary: bool,
    of: Of,
    found: Snapshot,
    /// Whether there were any.
    points: bool,
}

impl<'a> Reader<'a> {
    fn header(&mut self) -> Result<()> {
        let (_version, _title) = (self.line(), self.line());
        self.binary = match self.line().to_ascii_uppercase().trim_ascii() {
            b"ASCII" => false,
            b"BINARY" => true,
            _ => return Err(broken("its third line is neither ASCII nor BINARY")),
        };
        Ok(())
    }

    /// The rest of a line, which a newline, or the file, ends.
    fn line(&mut self) -> &'a [u8] {
        let end = self.rest.iter().position(|b| *b == b'\n');
        let (line, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        self.rest = rest.get(1..).unwrap_or_default();
        line
    }

    /// The words of the next line that has any.
    fn words(&mut self) -> Result<Option<Vec<&'a str>>> {
        self.rest = self.rest.trim_ascii_start();
        if self.rest.is_empty() {
            return Ok(None);
        }
        let line = std::str::from_utf8(self.line()).map_err(|_| broken("a line of its text is not UTF-8"))?;
        Ok(Some(line.split_ascii_whitespace().collect()))
    }

    fn section(&mut self, words: &[&str]) -> Result<()> {
        let keyword = words.first().unwrap_or(&"").to_ascii_uppercase();
        match (keyword.as_str(), &words[1..]) {
            ("DATASET", [kind]) => has_points(kind),
            ("DIMENSIONS", [_, _, _]) => Ok(()),
            ("POINTS", [n, kind]) => self.coordinates(number(n)?, kind),
            ("VERTICES" | "LINES" | "POLYGONS" | "TRIANGLE_STRIPS" | "CELLS", [n, size]) => {
                self.cells(number(n)?, number(size)?)
            }
            ("CELL_TYPES", [n]) => self.values("int", number(n)?).map(drop),
            ("POINT_DATA", [n]) => self.attributes(Of::Points, number(n)?),
            ("CELL_DATA", [n]) => self.attributes(Of::Cells(number(n)?), 0),
            ("FIELD", [_, n]) => self.fields(number(n)?),
            ("SCALARS", [name, kind]) => self.scalars(name, kind, 1),
            ("SCALARS", [name, kind, components]) => self.scalars(name, kind, number(components)?),
            ("COLOR_SCALARS", [name, n]) => self.attribute(name, self.colour(), number(n)?),
            ("LOOKUP_TABLE", [_, n]) => self.colours(number(n)?),
            ("VECTORS" | "NORMALS", [name, kind]) => self.attribute(name, kind, 3),
            ("TENSORS", [name, kind]) => self.attribute(name, kind, 9),
            ("TENSORS6", [name, kind]) => self.attribute(name, kind, 6),
            ("TEXTURE_COORDINATES", [name, n, kind]) => self.attribute(name, kind, number(n)?),
            ("GLOBAL_IDS" | "PEDIGREE_IDS", [name, kind]) => self.attribute(name, kind, 1),
            ("METADATA", []) => self.step_over_metadata(),
            _ => Err(broken(format!("it has a line that cannot be understood: '{:.40}'", words.join(" ")))),
        }
    }

    fn coordinates(&mut self, n: usize, kind: &str) -> Result<()> {
        let data = self.values(kind, product(n, 3)?)?.ok_or_else(|| broken("its points are not numbers"))?;
        self.found.points = super::xml_read::coordinates(data)?;
        self.points = true;
        Ok(())
    }

    /// Two arrays with names since version 5, one list of counts and numbers before.
    fn cells(&mut self, n: usize, size: usize) -> Result<()> {
        if !self.next_is(b"OFFSETS") {
            return self.values("int", size).map(drop);
        }
        for count in [n, size] {
            match self.words()?.as_deref() {
                Some(["OFFSETS" | "CONNECTIVITY", kind]) => self.values(kind, count)?,
                _ => return Err(broken("its cells are not OFFSETS and CONNECTIVITY")),
            };
        }
        Ok(())
    }

    fn attributes(&mut self, of: Of, n: usize) -> Result<()> {
        self.of = of;
        match self.found.points.len() {
            points if of == Of::Points && n != points => {
                Err(broken(format!("it has data of {n} points, not {points}")))
            }
            _ => Ok(()),
        }
    }

    fn scalars(&mut self, name: &str, kind: &str, components: usize) -> Result<()> {
        if self.next_is(b"LOOKUP_TABLE") {
            self.words()?;
        }
        self.attribute(name, kind, components)
    }

    /// An array with a value for each point or cell.
    fn attribute(&mut self, name: &str, kind: &str, components: usize) -> Result<()> {
        let n = match self.of {
            Of::File => return Err(broken(format!("array '{name:.40}' belongs neither to points nor to cells"))),
            Of::Points => self.found.points.len(),
            Of::Cells(n) => n,
        };
        self.array(name, kind, components, n)
    }

    fn fields(&mut self, n: usize) -> Result<()> {
        for _ in 0..n {
            let mut words = self.words()?;
            while words.as_deref() == Some(&["METADATA"]) {
                self.step_over_metadata()?;
                words = self.words()?;
            }
            match words.as_deref() {
                Some([name, components, n, kind]) => self.array(name, kind, number(components)?, number(n)?)?,
                _ => return Err(broken("a field has fewer arrays than it says")),
            }
        }
        Ok(())
    }

    fn array(&mut self, name: &str, kind: &str, components: usize, n: usize) -> Result<()> {
        let (name, count) = (decoded(name), product(n, components)?);
        if kind == "string" {
            return self.texts(name, count);
        }
        let data = self.values(kind, count)?;
        match (self.of, data) {
            (Of::Points, Some(data)) if n == self.found.points.len() && components > 0 => {
                self.found.fields.push(Field { name, components, data });
            }
            (Of::Points, Some(_)) => {
                let points = self.found.points.len();
                return Err(broken(format!(
                    "array '{name}' has {count} values, not {components} for each of {points} points"
                )));
            }
            (Of::Points, None) => log::warn!("array '{name}' is not of numbers: left aside"),
            (Of::Cells(_), _) => self.found.of_cells.push(name),
            (Of::File, Some(data)) if name == "TimeValue" => self.found.time = data.to_f64()?.first().copied(),
            _ => {}
        }
        Ok(())
    }

    /// Texts of the file are notes; those of points are left aside, as in VTK's XML files.
    fn texts(&mut self, name: String, count: usize) -> Result<()> {
        let mut lines = Vec::new();
        for _ in 0..self.fits(count, 1)? {
            let text = if self.binary { self.measured_text()? } else { self.line() };
            if self.of == Of::File {
                lines.push(decoded(&String::from_utf8_lossy(text)));
            }
        }
        if self.of == Of::File {
            self.found.notes.push((name, lines.join("\n")));
        }
        Ok(())
    }

    /// A text after its length: the two highest bits tell of how many bytes that is.
    fn measured_text(&mut self) -> Result<&'a [u8]> {
        let bytes = match self.rest.first().map_or(0, |b| b >> 6) {
            3 => 1,
            2 => 2,
            1 => 4,
            _ => 8,
        };
        let length = self.take(bytes)?.iter().fold(0, |n, b| n << 8 | u64::from(*b)) & (u64::MAX >> (66 - 8 * bytes));
        self.take(usize::try_from(length).unwrap_or(usize::MAX))
    }

    fn colours(&mut self, n: usize) -> Result<()> {
        self.values(self.colour(), product(n, 4)?).map(drop)
    }

    fn colour(&self) -> &'static str {
        if self.binary { "unsigned_char" } else { "float" }
    }

    /// What is known of an array ends at an empty line.
    fn step_over_metadata(&mut self) -> Result<()> {
        while !self.line().trim_ascii().is_empty() {}
        Ok(())
    }

    fn next_is(&self, keyword: &[u8]) -> bool {
        self.rest.get(..keyword.len()).is_some_and(|next| next.eq_ignore_ascii_case(keyword))
    }

    /// So many values; none where they are bits.
    fn values(&mut self, kind: &str, count: usize) -> Result<Option<Data>> {
        if kind == "bit" {
            let done =
                if self.binary { self.take(count.div_ceil(8)).map(drop) } else { self.numbers::<u8>(count).map(drop) };
            return done.map(|()| None);
        }
        let data = Data::read_as(type_of(kind, self.binary), Values { reader: self, count });
        data.unwrap_or_else(|| Err(broken(format!("type '{kind:.40}' is unknown")))).map(Some)
    }

    /// The next so many bytes.
    fn take(&mut self, bytes: usize) -> Result<&'a [u8]> {
        let (taken, rest) = self.rest.split_at(self.fits(bytes, 1)?);
        self.rest = rest;
        Ok(taken)
    }

    /// `count`, if so many things of at least `size` bytes can still come.
    fn fits(&self, count: usize, size: usize) -> Result<usize> {
        let there = self.rest.len() / size;
        if count <= there { Ok(count) } else { Err(broken(format!("it ends before {count} values that it announces"))) }
    }

    fn numbers<T: Element>(&mut self, count: usize) -> Result<Vec<T>> {
        // A number takes a character and, but for the last, a space.
        self.fits(count.saturating_sub(1), 2)?;
        let mut values = memory::reserved("an array of the file", count)?;
        while values.len() < count {
            self.rest = self.rest.trim_ascii_start();
            let end = self.rest.iter().position(u8::is_ascii_whitespace).unwrap_or(self.rest.len());
            let (word, rest) = self.rest.split_at(end);
            let value = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
            let wrong = || match word {
                [] => broken(format!("it ends before {count} values that it announces")),
                _ => broken(format!("'{:.30}' is no {}", String::from_utf8_lossy(word), T::NAME)),
            };
            values.push(value.ok_or_else(wrong)?);
            self.rest = rest;
        }
        Ok(values)
    }

    fn big_endian<T: Element>(&mut self, count: usize) -> Result<Vec<T>> {
        let bytes = self.take(product(count, size_of::<T>())?)?;
        let mut values = memory::filled("an array of the file", count, T::zeroed())?;
        let raw: &mut [u8] = bytemuck::cast_slice_mut(&mut values);
        raw.copy_from_slice(bytes);
        if cfg!(target_endian = "little") {
            raw.chunks_exact_mut(size_of::<T>()).for_each(<[u8]>::reverse);
        }
        Ok(values)
    }
}

/// A request for the values of one array, whatever their type.
struct Values<'r, 'a> {
    reader: &'r mut Reader<'a>,
    count: usize,
}

impl ReadValues for Values<'_, '_> {
    fn values<T: Element>(self) -> Result<Vec<T>> {
        if self.reader.binary { self.reader.big_endian(self.count) } else { self.reader.numbers(self.count) }
    }
}

fn has_points(kind: &str) -> Result<()> {
    match kind.to_ascii_uppercase().as_str() {
        "UNSTRUCTURED_GRID" | "POLYDATA" | "STRUCTURED_GRID" => Ok(()),
        _ => Err(broken("the points of this kind of grid are not stored; save it as an unstructured grid")),
    }
}

/// The name that VTK's XML files have for a type; ids are shortened in binary files.
fn type_of(kind: &str, binary: bool) -> &'static str {
    match kind.to_ascii_lowercase().as_str() {
        "vtkidtype" => {
            if binary {
                "Int32"
            } else {
                "Int64"
            }
        }
        "char" | "signed_char" | "vtktypeint8" => "Int8",
        "unsigned_char" | "vtktypeuint8" => "UInt8",
        "short" | "vtktypeint16" => "Int16",
        "unsigned_short" | "vtktypeuint16" => "UInt16",
        "int" | "vtktypeint32" => "Int32",
        "unsigned_int" | "vtktypeuint32" => "UInt32",
        "long" | "vtktypeint64" => "Int64",
        "unsigned_long" | "vtktypeuint64" => "UInt64",
        "float" | "vtktypefloat32" => "Float32",
        "double" | "vtktypefloat64" => "Float64",
        _ => "",
    }
}

fn number(word: &str) -> Result<usize> {
    word.parse().map_err(|_| broken(format!("'{word:.30}' is no count")))
}

fn product(a: usize, b: usize) -> Result<usize> {
    a.checked_mul(b).ok_or_else(|| broken(format!("{a} times {b} values do not fit")))
}

/// Names end at white space, so VTK codes it as in URLs.
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
    use super::super::{legacy, samples};
    use super::*;

    const TEXT: &str = "# vtk DataFile Version 4.2\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 1 double\n0 1 2\n\
                        CELLS 1 2\n1 0\nCELL_TYPES 1\n1\nPOINT_DATA 1\nSCALARS T double 1\nLOOKUP_TABLE default\n7\n";

    #[test]
    fn names_survive_the_code_of_legacy_files() {
        for name in ["T", "velocity m/s", "100%", "%41", "a\"b", "κ ∇T"] {
            let code = legacy::encoded(name);
            assert!(code.is_ascii() && !code.contains(' ') && decoded(&code) == name, "{code}");
        }
        assert_eq!(decoded("%zz%4"), "%zz%4");
    }

    #[test]
    fn what_cannot_be_understood_is_an_error() {
        let good = read(TEXT.as_bytes()).unwrap();
        assert_eq!((good.points, &good.fields[0].data), (vec![[0.0, 1.0, 2.0]], &Data::F64(vec![7.0])));
        for (from, to, expected) in [
            ("SCALARS T", "SCALARS T x", "cannot be understood: 'SCALARS T x double 1'"),
            ("T double", "T complex", "type 'complex' is unknown"),
            ("\n7\n", "\n", "ends before 1 values"),
            ("\n7\n", "\n7 8\n", "cannot be understood: '8'"),
            ("\n7\n", "\nseven\n", "'seven' is no Float64"),
            ("POINT_DATA 1", "POINT_DATA 2", "data of 2 points, not 1"),
            ("POINT_DATA 1\n", "", "belongs neither to points nor to cells"),
            ("POINTS 1", "POINTS 99999999999999999999", "is no count"),
            ("POINTS 1", "POINTS 9999999999999999999", "do not fit"),
            ("UNSTRUCTURED_GRID", "STRUCTURED_POINTS", "save it as an unstructured grid"),
            ("ASCII", "ASKII", "neither ASCII nor BINARY"),
            ("POINTS 1 double", "POINTS 1 bit", "not numbers"),
        ] {
            let error = read(TEXT.replace(from, to).as_bytes()).unwrap_err();
            assert!(error.name() == "BAD_FILE" && error.to_string().contains(expected), "{to}: {error}");
        }
    }

    #[test]
    fn what_is_not_about_points_is_stepped_over() {
        let more = "METADATA\nCOMPONENT_NAMES\nT\n\nTENSORS6 t float\n1 2 3 4 5 6\nCOLOR_SCALARS c 1\n0.5\n\
                    LOOKUP_TABLE l 1\n0 0 0 1\nGLOBAL_IDS id vtkIdType\n5000000000\nFIELD f 3\nwords 1 1 string\na%20b\n\
                    bits 1 1 bit\n1\nMETADATA\n\nlast 2 1 unsigned_short\n1 2\nCELL_DATA 2\nSCALARS T double\n\
                    LOOKUP_TABLE default\n1 2\n";
        let got = read((TEXT.to_string() + more).as_bytes()).unwrap();
        let names: Vec<_> = got.fields.iter().map(|f| (f.name.as_str(), f.components)).collect();
        assert_eq!(names, [("T", 1), ("t", 6), ("c", 1), ("id", 1), ("last", 2)]);
        assert_eq!(got.field("id").unwrap().data, Data::I64(vec![5_000_000_000]));
        assert_eq!(read(TEXT.replace('\n', "\r\n").as_bytes()).unwrap().fields, got.fields[..1]);
    }

    #[test]
    fn every_type_goes_there_and_back() {
        for n in [0, 1, 1000] {
            let mut snapshot = samples::cloud(n);
            let back = read(&legacy::encode(&snapshot.view()).unwrap()).unwrap();
            (snapshot.time, snapshot.notes) = (None, Vec::new()); // what vtkio writes has no place for them
            assert!(samples::same(&back, &snapshot), "{n}: {back:?}");
        }
    }

    #[test]
    fn long_texts_have_longer_lengths() {
        for n in [0, 63, 64, 16383, 16384] {
            let text = "x".repeat(n);
            let length = match n {
                0..64 => vec![3 << 6 | n as u8],
                64..16384 => (2 << 14 | n as u16).to_be_bytes().to_vec(),
                _ => (1 << 30 | n as u32).to_be_bytes().to_vec(),
            };
            let mut file =
                b"# vtk DataFile Version 5.1\n\nBINARY\nDATASET POLYDATA\nFIELD f 1\nnote 1 1 string\n".to_vec();
            file.extend([&length, text.as_bytes(), b"\nPOINTS 0 float\n\n"].concat());
            assert_eq!(read(&file).unwrap().notes, [("note".to_string(), text)]);
        }
    }
}
