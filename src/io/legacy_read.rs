//! Legacy `.vtk` files of points, ascii or binary, of every version: read from front to end, since only what comes before
//! tells where the next section begins. As in VTK, what counts are words, in either case; lines end only the title, texts and
//! what comes before binary values. Cells are stepped over.
//!
//! The format: <https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html>.

use super::broken;
use super::data::{Data, Fault, Found, ReadValues, unless_fatal};
use super::element::Element;
use super::snapshot::{Field, LONGEST_NOTE, LeftAside, Snapshot};
use crate::error::{Error, Result};
use crate::memory;

pub fn read(bytes: &[u8]) -> Result<Snapshot> {
    let mut reader =
        Reader { rest: bytes, binary: false, of: Of::File, found: Snapshot::default(), points: false, announced: None };
    reader.header()?;
    while let Some(word) = reader.word() {
        reader.section(word)?;
    }
    reader.whole()
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
    /// A section that has to come yet.
    announced: Option<&'static str>,
}

/// What a colour is in a text, of 255: a kind that no file can name, for words have no spaces.
const SHARE: &str = "share of 255";

/// What is to be known of a legacy file of ours.
const OURS: &str = "a legacy file has no place for the time, the box, laws and what was one number: they stay as they are; \
                    and what was found, like h, is there as if it had been given: write a .vtu to go on from";

/// What no number can be taken for: an array that meets one of these has ended early.
const KEYWORDS: &[&str] = &[
    "DATASET",
    "POINTS",
    "VERTICES",
    "LINES",
    "POLYGONS",
    "TRIANGLE_STRIPS",
    "CELLS",
    "CELL_TYPES",
    "POINT_DATA",
    "CELL_DATA",
    "FIELD",
    "SCALARS",
    "COLOR_SCALARS",
    "LOOKUP_TABLE",
    "VECTORS",
    "NORMALS",
    "TENSORS",
    "TENSORS6",
    "TEXTURE_COORDINATES",
    "GLOBAL_IDS",
    "PEDIGREE_IDS",
    "EDGE_FLAGS",
    "METADATA",
];

/// Whatever holds values: what the data of points or cells begin with.
const AN_ARRAY: &str = "an array";

impl<'a> Reader<'a> {
    fn header(&mut self) -> Result<()> {
        let (_version, title) = (self.line(), self.line());
        if title.trim_ascii() == super::legacy::TITLE.as_bytes() {
            self.found.remarks.push(OURS.into());
        }
        self.binary = match self.word() {
            Some(word) if word.eq_ignore_ascii_case(b"ASCII") => false,
            Some(word) if word.eq_ignore_ascii_case(b"BINARY") => true,
            _ => return Err(broken("the word after its title is neither ASCII nor BINARY")),
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

    fn word(&mut self) -> Option<&'a [u8]> {
        let (word, rest) = first_word(self.rest);
        self.rest = rest;
        (!word.is_empty()).then_some(word)
    }

    fn text(&mut self) -> Result<String> {
        let word = self.word().ok_or_else(|| broken("it ends within the head of a section"))?;
        Ok(String::from_utf8_lossy(word).into_owned())
    }

    fn count(&mut self) -> Result<usize> {
        number(&self.text()?)
    }

    fn next_is(&self, keyword: &str) -> bool {
        first_word(self.rest).0.eq_ignore_ascii_case(keyword.as_bytes())
    }

    fn section(&mut self, word: &[u8]) -> Result<()> {
        let keyword = String::from_utf8_lossy(word).to_ascii_uppercase();
        if self.announced.is_some_and(|next| next == keyword || next == AN_ARRAY) {
            self.announced = None;
        }
        match keyword.as_str() {
            "DATASET" => has_points(&self.text()?),
            "DIMENSIONS" => (0..3).try_for_each(|_| self.count().map(drop)),
            "POINTS" => self.coordinates(),
            "VERTICES" | "LINES" | "POLYGONS" | "TRIANGLE_STRIPS" => self.cells().map(drop),
            "CELLS" => {
                self.announced = (self.cells()? > 0).then_some("CELL_TYPES");
                Ok(())
            }
            "CELL_TYPES" => {
                let count = self.count()?;
                self.step_over("int", count)
            }
            "POINT_DATA" => {
                let n = self.count()?;
                self.attributes(Of::Points, n)
            }
            "CELL_DATA" => {
                let n = self.count()?;
                self.attributes(Of::Cells(n), n)
            }
            "FIELD" => self.fields(),
            "SCALARS" => self.scalars(),
            "COLOR_SCALARS" => {
                let (name, components) = (self.text()?, self.count()?);
                self.attribute(&name, self.colour(), components)
            }
            "LOOKUP_TABLE" => {
                let (_name, n) = (self.text()?, self.count()?);
                self.step_over(self.colour(), product(n, 4)?)
            }
            "VECTORS" | "NORMALS" => self.typed(3),
            "TENSORS" => self.typed(9),
            "TENSORS6" => self.typed(6),
            "TEXTURE_COORDINATES" => {
                let (name, components, kind) = (self.text()?, self.count()?, self.text()?);
                self.attribute(&name, &kind, components)
            }
            "GLOBAL_IDS" | "PEDIGREE_IDS" | "EDGE_FLAGS" => self.typed(1),
            "METADATA" => {
                self.step_over_metadata();
                Ok(())
            }
            _ => Err(broken(format!("it has a word that cannot be understood: '{keyword:.40}'"))),
        }
    }

    fn coordinates(&mut self) -> Result<()> {
        let (n, kind) = (self.count()?, self.text()?);
        let data = unless_fatal(self.values(&kind, product(n, 3)?))?;
        let data = data.map_err(|reason| broken(format!("its points: {reason}")))?;
        self.found.points = super::xml_read::coordinates(data)?;
        self.points = true;
        Ok(())
    }

    /// Two arrays with names since version 5, one list of counts and numbers before.
    fn cells(&mut self) -> Result<usize> {
        let (n, size) = (self.count()?, self.count()?);
        if !self.next_is("OFFSETS") {
            return self.step_over("int", size).map(|()| n);
        }
        for (keyword, count) in [("OFFSETS", n), ("CONNECTIVITY", size)] {
            if !self.next_is(keyword) {
                return Err(broken("its cells are not OFFSETS and CONNECTIVITY"));
            }
            let (_keyword, kind) = (self.word(), self.text()?);
            self.step_over(&kind, count)?;
        }
        Ok(n)
    }

    fn attributes(&mut self, of: Of, n: usize) -> Result<()> {
        self.of = of;
        // Some writers end with an empty section for cells.
        self.announced = (n > 0 && of == Of::Points).then_some(AN_ARRAY);
        match self.found.points.len() {
            points if of == Of::Points && n != points => {
                Err(broken(format!("it has data of {n} points, not {points}")))
            }
            _ => Ok(()),
        }
    }

    /// The number of components may be left out, and so may, in what others than VTK write, the name of a table; a number
    /// counts components if it stands on the line of the head, or before that name.
    fn scalars(&mut self) -> Result<()> {
        let (name, kind) = (self.text()?, self.text()?);
        let mut components = 1;
        if !self.next_is("LOOKUP_TABLE") && (self.is_within_line() || self.is_before("LOOKUP_TABLE")) {
            components = self.count()?;
        }
        if self.next_is("LOOKUP_TABLE") {
            let (_keyword, _table) = (self.word(), self.text()?);
        }
        self.attribute(&name, &kind, components)
    }

    fn is_within_line(&self) -> bool {
        let space = self.rest.iter().take_while(|b| is_space(b));
        space.clone().count() < self.rest.len() && space.clone().all(|b| *b != b'\n')
    }

    /// Whether the word after the next is the keyword.
    fn is_before(&self, keyword: &str) -> bool {
        first_word(first_word(self.rest).1).0.eq_ignore_ascii_case(keyword.as_bytes())
    }

    fn typed(&mut self, components: usize) -> Result<()> {
        let (name, kind) = (self.text()?, self.text()?);
        self.attribute(&name, &kind, components)
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

    fn fields(&mut self) -> Result<()> {
        let (_name, n) = (self.text()?, self.count()?);
        for _ in 0..n {
            while self.next_is("METADATA") {
                self.word();
                self.step_over_metadata();
            }
            if self.next_is("NULL_ARRAY") {
                self.word();
                continue;
            }
            let end = |_| broken("a field has fewer arrays than it says");
            let name = self.text().map_err(end)?;
            let (components, n) = (self.count()?, self.count()?);
            let kind = self.text()?;
            self.array(&name, &kind, components, n)?;
        }
        Ok(())
    }

    fn array(&mut self, name: &str, kind: &str, components: usize, n: usize) -> Result<()> {
        let (name, count) = (decoded(name), product(n, components)?);
        if matches!(kind.to_ascii_lowercase().as_str(), "string" | "utf8_string" | "unicode_string" | "variant") {
            return self.texts(name, kind, count);
        }
        match (self.of, unless_fatal(self.values(kind, count))?) {
            (Of::Points, Ok(data)) if n == self.found.points.len() && components > 0 => {
                self.found.fields.push(Field { name, components, data });
            }
            (Of::Points, Ok(_)) => {
                let points = self.found.points.len();
                let reason = format!("it has {count} values, not {components} for each of {points} points");
                self.found.left_aside.push(LeftAside { name, reason });
            }
            (Of::Points, Err(reason)) => self.found.left_aside.push(LeftAside { name, reason }),
            (Of::Cells(_), _) => self.found.of_cells.push(name),
            // Characters, as VTK keeps the texts of its XML files.
            (Of::File, Ok(Data::I8(codes))) => {
                let bytes = codes.iter().map(|&c| c as u8).collect();
                let text = String::from_utf8(bytes).unwrap_or_default();
                self.found.take_note(name, text.trim_end_matches('\0').replace('\0', "\n"));
            }
            (Of::File, Ok(data)) => self.found.take_time(&name, &data),
            (Of::File, Err(_)) => {}
        }
        Ok(())
    }

    /// Texts of the file are notes; those of points are left aside, as in VTK's XML files.
    fn texts(&mut self, name: String, kind: &str, count: usize) -> Result<()> {
        let measured = self.binary && !kind.eq_ignore_ascii_case("variant");
        self.line();
        let mut note = String::new();
        for i in 0..self.fits(count, 1)? {
            let text = if measured { self.measured_text()? } else { self.line() };
            if self.of == Of::File && note.len() <= LONGEST_NOTE {
                note.push_str(if i > 0 { "\n" } else { "" });
                note.push_str(&decoded(&String::from_utf8_lossy(text.trim_ascii_end())));
            }
        }
        match self.of {
            Of::File => self.found.take_note(name, note),
            Of::Points => self.found.left_aside.push(LeftAside { name, reason: "it holds texts, not numbers".into() }),
            Of::Cells(_) => self.found.of_cells.push(name),
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

    fn colour(&self) -> &'static str {
        if self.binary { "unsigned_char" } else { SHARE }
    }

    /// What is known of an array ends at an empty line.
    fn step_over_metadata(&mut self) {
        self.line();
        while !self.line().trim_ascii().is_empty() {}
    }

    fn step_over(&mut self, kind: &str, count: usize) -> Result<()> {
        unless_fatal(self.values(kind, count)).map(drop)
    }

    /// So many values, of which the last is passed in any case.
    fn values(&mut self, kind: &str, count: usize) -> Found<Data> {
        if self.binary {
            self.line();
        }
        match kind.to_ascii_lowercase().as_str() {
            "bit" if self.binary => self.take(count.div_ceil(8)).map(drop)?,
            "bit" => self.numbers::<u8>(count).map(drop)?,
            SHARE => {
                let whole = |share: f64| (255.0 * share + 0.5) as u8;
                return Ok(Data::U8(self.numbers(count)?.into_iter().map(whole).collect()));
            }
            kind => match type_of(kind, self.binary) {
                Some(name) => return Data::read_as(name, Values { reader: self, count }),
                None if self.binary => {
                    return Err(broken(format!(
                        "type '{kind:.40}' is unknown, and so is where its values end; re-save it as .vtu"
                    ))
                    .into());
                }
                None => {
                    return self.numbers::<f64>(count).and(Err(Fault::Unfit(format!("type '{kind:.40}' is unknown"))));
                }
            },
        }
        Err(Fault::Unfit("it holds bits, not numbers".into()))
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
        if count <= there { Ok(count) } else { Err(ends_before(count)) }
    }

    fn numbers<T: Element>(&mut self, count: usize) -> Found<Vec<T>> {
        // A number takes a character and, but for the last, a space.
        self.fits(count.saturating_sub(1), 2)?;
        let mut values = memory::reserved("an array of the file", count)?;
        let mut unfit = None;
        for _ in 0..count {
            let word = self.word().ok_or_else(|| ends_before(count))?;
            match std::str::from_utf8(word).ok().and_then(|word| word.parse().ok()) {
                Some(value) => values.push(value),
                None if KEYWORDS.iter().any(|k| word.eq_ignore_ascii_case(k.as_bytes())) => {
                    return Err(ends_before(count).into());
                }
                None => {
                    unfit.get_or_insert(word);
                }
            }
        }
        match unfit {
            None => Ok(values),
            Some(word) => Err(Fault::Unfit(format!("'{:.30}' is no {}", String::from_utf8_lossy(word), T::NAME))),
        }
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

    /// What was found, unless the file was cut where a section ends.
    fn whole(self) -> Result<Snapshot> {
        match self.announced {
            Some(next) => {
                Err(broken(format!("it ends where {next} should begin: it was cut, or is still being written")))
            }
            None if !self.points => Err(broken("it has no points")),
            None => self.found.settled(),
        }
    }
}

/// A request for the values of one array, whatever their type.
struct Values<'r, 'a> {
    reader: &'r mut Reader<'a>,
    count: usize,
}

impl ReadValues for Values<'_, '_> {
    fn values<T: Element>(self) -> Found<Vec<T>> {
        if self.reader.binary { Ok(self.reader.big_endian(self.count)?) } else { self.reader.numbers(self.count) }
    }
}

/// What C takes for white space.
fn is_space(byte: &u8) -> bool {
    matches!(byte, b' ' | b'\t'..=b'\r')
}

/// The first word, empty where there is none, and what follows it.
fn first_word(bytes: &[u8]) -> (&[u8], &[u8]) {
    let start = bytes.iter().position(|b| !is_space(b)).unwrap_or(bytes.len());
    let bytes = &bytes[start..];
    bytes.split_at(bytes.iter().position(is_space).unwrap_or(bytes.len()))
}

fn ends_before(count: usize) -> Error {
    broken(format!("it ends before {count} values that it announces"))
}

fn has_points(kind: &str) -> Result<()> {
    match kind.to_ascii_uppercase().as_str() {
        "UNSTRUCTURED_GRID" | "POLYDATA" | "STRUCTURED_GRID" => Ok(()),
        _ => Err(broken("the points of this kind of grid are not stored; save it as an unstructured grid")),
    }
}

/// The name that VTK's XML files have for a type; ids are shortened in binary files.
fn type_of(kind: &str, binary: bool) -> Option<&'static str> {
    Some(match kind {
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
        "long" | "long_long" | "__int64" | "vtktypeint64" => "Int64",
        "unsigned_long" | "unsigned_long_long" | "unsigned___int64" | "vtktypeuint64" => "UInt64",
        "float" | "vtktypefloat32" => "Float32",
        "double" | "vtktypefloat64" => "Float64",
        _ => return None,
    })
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
            ("SCALARS T", "SCALARS T x", "'double' is no count"),
            ("\n7\n", "\n", "ends before 1 values"),
            ("\n7\n", "\n7 8\n", "cannot be understood: '8'"),
            ("\n7\n", "\nVECTORS v double 1 2 3\n", "ends before 1 values"),
            ("SCALARS T double 1\nLOOKUP_TABLE default\n7\n", "", "ends where an array should begin"),
            ("POINT_DATA 1", "POINT_DATA 2", "data of 2 points, not 1"),
            ("POINT_DATA 1\n", "", "belongs neither to points nor to cells"),
            ("POINTS 1", "POINTS 99999999999999999999", "is no count"),
            ("POINTS 1", "POINTS 9999999999999999999", "do not fit"),
            ("UNSTRUCTURED_GRID", "STRUCTURED_POINTS", "save it as an unstructured grid"),
            ("ASCII", "ASKII", "neither ASCII nor BINARY"),
            ("POINTS 1 double", "POINTS 1 bit", "not numbers"),
            ("0 1 2", "0 one 2", "'one' is no Float64"),
        ] {
            let error = read(TEXT.replace(from, to).as_bytes()).unwrap_err();
            assert!(error.name() == "BAD_FILE" && error.to_string().contains(expected), "{to}: {error}");
        }
    }

    #[test]
    fn a_file_cut_where_a_section_ends_is_refused() {
        for (from, expected) in [("CELL_TYPES", "where CELL_TYPES should"), ("SCALARS", "where an array should")] {
            let error = read(&TEXT.as_bytes()[..TEXT.find(from).unwrap()]).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }

    #[test]
    fn an_array_that_is_no_numbers_is_left_aside() {
        for (from, to, expected) in [
            ("T double", "T complex", "type 'complex' is unknown"),
            ("\n7\n", "\nseven\n", "'seven' is no Float64"),
            (
                "SCALARS T double 1\nLOOKUP_TABLE default\n7\n",
                "FIELD f 1 T 1 2 double 1 2",
                "2 values, not 1 for each of 1",
            ),
            ("SCALARS T double 1\nLOOKUP_TABLE default\n7\n", "FIELD f 2 T 1 1 int 1 T 1 1 int 2", "several arrays"),
        ] {
            let text = TEXT.replace(from, to) + "\nVECTORS v float\n1 2 3\n";
            let got = read(text.as_bytes()).unwrap();
            assert_eq!(got.field("v").unwrap().data, Data::F32(vec![1.0, 2.0, 3.0]), "{to}");
            let error = got.usable("T").unwrap_err().to_string();
            assert!(got.field("T").is_none() && error.contains(expected), "{to}: {error}");
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
        // As VTK reads it, to bytes.
        assert_eq!(got.field("c").unwrap().data, Data::U8(vec![128]));
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
