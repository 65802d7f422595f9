//! Writes a cloud as VTK's UnstructuredGrid, one VERTEX cell per particle: the form that VTK, ParaView, pyvista and
//! meshio all read to the bit. Little-endian, sizes in UInt64 (UInt32 ends at 4 GiB an array).

use super::view::{BLOCK, Values, View};
use flate2::{Compress, Compression, FlushCompress, Status};
use std::borrow::Cow;
use std::io::{self, Seek, SeekFrom, Write};

/// How the arrays are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    pub encoding: Encoding,
    /// Compress with zlib: smaller, and tens of times slower.
    pub zlib: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Encoding {
    /// Bare bytes after the XML: fastest and smallest.
    #[default]
    Raw,
    /// Base64 inside the XML: a third larger, for tools that want well-formed XML; meshio reads it faster.
    Base64,
}

pub fn write(sink: impl Write + Seek, view: &View, options: Options) -> io::Result<()> {
    // An empty array has no block to compress, and meshio cannot join no blocks.
    let options = Options { zlib: options.zlib && view.n > 0, ..options };
    let (cells, kind) = cells_of(view.n);
    let connectivity = Values::computed(view.n, |first, block: &mut [i64]| count_from(first, block));
    let offsets = Values::computed(cells, |first, block: &mut [i64]| match view.n {
        0 => block.fill(0),
        _ => count_from(first + 1, block),
    });
    let types = Values::computed(cells, |_, block: &mut [u8]| block.fill(kind));

    let mut file = VtuFile { sink, options, appended: Vec::new() };
    file.open(view)?;
    file.section("Points", [("Points", 3, &view.points)])?;
    file.section("Cells", [("connectivity", 1, &connectivity), ("offsets", 1, &offsets), ("types", 1, &types)])?;
    file.section("PointData", view.fields.iter().map(|f| (f.name.as_ref(), f.components, &f.values)))?;
    file.close()
}

/// Number and type of the cells of `n` points: VERTEX each. meshio cannot read a file without cells, so no points make one
/// POLY_VERTEX of no points, which meshio passes over.
fn cells_of(n: usize) -> (usize, u8) {
    if n == 0 { (1, 2) } else { (n, 1) }
}

fn count_from(first: usize, block: &mut [i64]) {
    block.iter_mut().enumerate().for_each(|(i, value)| *value = (first + i) as i64);
}

/// The text of an attribute's value.
pub(super) fn escaped(text: &str) -> Cow<'_, str> {
    if !text.contains(['&', '<', '>', '"']) {
        return text.into();
    }
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;").into()
}

struct VtuFile<'a, W> {
    sink: W,
    options: Options,
    /// Arrays that follow after the XML, and where their offsets are to be written.
    appended: Vec<(u64, &'a Values<'a>)>,
}

impl<'a, W: Write + Seek> VtuFile<'a, W> {
    fn open(&mut self, view: &View) -> io::Result<()> {
        let compressor = if self.options.zlib { " compressor=\"vtkZLibDataCompressor\"" } else { "" };
        let (n, cells) = (view.n, cells_of(view.n).0);
        writeln!(self.sink, "<?xml version=\"1.0\"?>")?;
        writeln!(
            self.sink,
            "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\"{compressor}>"
        )?;
        writeln!(self.sink, "<UnstructuredGrid>")?;
        writeln!(self.sink, "<FieldData>")?;
        if let Some(time) = view.time {
            self.metadata("Float64", "TimeValue", [time])?;
        }
        for (name, text) in &view.notes {
            // As characters, not as VTK's String: meshio refuses files with those.
            self.metadata("Int8", name, text.bytes().map(|b| b as i8))?;
        }
        writeln!(self.sink, "</FieldData>")?;
        writeln!(self.sink, "<Piece NumberOfPoints=\"{n}\" NumberOfCells=\"{cells}\">")
    }

    fn metadata<T: std::fmt::Debug>(
        &mut self,
        kind: &str,
        name: &str,
        values: impl IntoIterator<Item = T, IntoIter: ExactSizeIterator>,
    ) -> io::Result<()> {
        let values = values.into_iter();
        let (name, count) = (escaped(name), values.len());
        writeln!(self.sink, "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfTuples=\"{count}\" format=\"ascii\">")?;
        for value in values {
            write!(self.sink, "{value:?} ")?;
        }
        writeln!(self.sink, "\n</DataArray>")
    }

    fn section<'n>(
        &mut self,
        name: &str,
        arrays: impl IntoIterator<Item = (&'n str, usize, &'a Values<'a>)>,
    ) -> io::Result<()> {
        writeln!(self.sink, "<{name}>")?;
        for (name, components, values) in arrays {
            self.array(name, components, values)?;
        }
        writeln!(self.sink, "</{name}>")
    }

    fn array(&mut self, name: &str, components: usize, values: &'a Values<'a>) -> io::Result<()> {
        write!(self.sink, "<DataArray type=\"{}\" Name=\"{}\"", values.type_name, escaped(name))?;
        if components != 1 {
            write!(self.sink, " NumberOfComponents=\"{components}\"")?;
        }
        match self.options.encoding {
            Encoding::Base64 => {
                writeln!(self.sink, " format=\"binary\">")?;
                let mut text = Base64 { sink: &mut self.sink, waiting: Vec::with_capacity(CHUNK), text: String::new() };
                store(values, self.options.zlib, &mut text, |t| t.finish())?;
                writeln!(self.sink, "\n</DataArray>")
            }
            Encoding::Raw => {
                write!(self.sink, " format=\"appended\" ")?;
                self.appended.push((self.sink.stream_position()?, values));
                writeln!(self.sink, "{:OFFSET$}/>", "")
            }
        }
    }

    fn close(&mut self) -> io::Result<()> {
        writeln!(self.sink, "</Piece>\n</UnstructuredGrid>")?;
        if self.options.encoding == Encoding::Raw {
            write!(self.sink, "<AppendedData encoding=\"raw\">\n_")?;
            self.append()?;
            writeln!(self.sink, "\n</AppendedData>")?;
        }
        writeln!(self.sink, "</VTKFile>")
    }

    fn append(&mut self) -> io::Result<()> {
        let start = self.sink.stream_position()?;
        let mut offsets = Vec::new();
        for (place, values) in std::mem::take(&mut self.appended) {
            offsets.push((place, self.sink.stream_position()? - start));
            store(values, self.options.zlib, &mut self.sink, |_| Ok(()))?;
        }
        let end = self.sink.stream_position()?;
        for (place, offset) in offsets {
            self.sink.seek(SeekFrom::Start(place))?;
            write!(self.sink, "offset=\"{offset}\"")?;
        }
        self.sink.seek(SeekFrom::Start(end)).map(|_| ())
    }
}

/// Room for `offset="…"` with any number.
const OFFSET: usize = "offset=\"18446744073709551615\"".len();

/// Size and values; `pause` is called where readers expect base64 to be padded.
fn store<W: Write>(
    values: &Values,
    zlib: bool,
    sink: &mut W,
    pause: impl Fn(&mut W) -> io::Result<()>,
) -> io::Result<()> {
    if zlib {
        let (head, packed) = pack(values)?;
        head.iter().try_for_each(|word| sink.write_all(&word.to_le_bytes()))?;
        pause(sink)?;
        sink.write_all(&packed)?;
    } else {
        sink.write_all(&((values.count * values.width) as u64).to_le_bytes())?;
        values.blocks(|block| sink.write_all(block))?;
    }
    pause(sink)
}

/// The block sizes and the compressed blocks of an array.
fn pack(values: &Values) -> io::Result<(Vec<u64>, Vec<u8>)> {
    let bytes = (values.count * values.width) as u64;
    let mut head = vec![bytes.div_ceil(BLOCK as u64), BLOCK as u64, bytes % BLOCK as u64];
    let mut packed = Vec::new();
    let mut state = Compress::new(Compression::fast(), true);
    values.blocks(|block| {
        let before = packed.len();
        // Deflate adds five bytes to every 16 KiB that it cannot compress.
        packed.try_reserve(block.len() + block.len() / 1024 + 64).map_err(|_| io::ErrorKind::OutOfMemory)?;
        state.reset();
        match state.compress_vec(block, &mut packed, FlushCompress::Finish)? {
            Status::StreamEnd => head.push((packed.len() - before) as u64),
            _ => return Err(io::Error::other("zlib did not finish a block")),
        }
        Ok(())
    })?;
    Ok((head, packed))
}

/// Writes bytes as base64, a chunk at a time.
struct Base64<W> {
    sink: W,
    waiting: Vec<u8>,
    text: String,
}

/// Bytes encoded at once: whole groups of three.
const CHUNK: usize = 3 << 14;

impl<W: Write> Base64<W> {
    fn finish(&mut self) -> io::Result<()> {
        self.text.clear();
        base64_simd::STANDARD.encode_append(&self.waiting, &mut self.text);
        self.waiting.clear();
        self.sink.write_all(self.text.as_bytes())
    }
}

impl<W: Write> Write for Base64<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = bytes.len().min(CHUNK - self.waiting.len());
        self.waiting.extend_from_slice(&bytes[..taken]);
        if self.waiting.len() == CHUNK {
            self.finish()?;
        }
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.sink.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Snapshot, read, samples, write_vtu};
    use super::*;
    use proptest::prelude::*;

    const ALL: [Options; 4] = [
        Options { encoding: Encoding::Raw, zlib: false },
        Options { encoding: Encoding::Raw, zlib: true },
        Options { encoding: Encoding::Base64, zlib: false },
        Options { encoding: Encoding::Base64, zlib: true },
    ];

    fn there_and_back(snapshot: &Snapshot, options: Options) -> Snapshot {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.vtu");
        write_vtu(&path, &snapshot.view(), options).unwrap();
        read(&path).unwrap()
    }

    #[test]
    fn every_type_goes_there_and_back_in_every_encoding() {
        // The last one has whole blocks only in its array of doubles.
        for n in [0, 1, 7, 1000, BLOCK / 8] {
            let snapshot = samples::cloud(n);
            for options in ALL {
                assert!(samples::same(&there_and_back(&snapshot, options), &snapshot), "{n} {options:?}");
            }
        }
    }

    #[test]
    fn computed_columns_make_the_same_file_as_stored_ones() {
        let snapshot = samples::cloud(2 * BLOCK / 8 + 1);
        let stored = bytemuck::cast_slice::<[f64; 3], f64>(&snapshot.points);
        for options in ALL {
            let mut view = snapshot.view();
            view.points = Values::computed(stored.len(), |first, block: &mut [f64]| {
                block.copy_from_slice(&stored[first..first + block.len()]);
            });
            let mut files = [view, snapshot.view()].map(|view| {
                let mut file = io::Cursor::new(Vec::new());
                write(&mut file, &view, options).unwrap();
                file.into_inner()
            });
            assert!(std::mem::take(&mut files[0]) == files[1], "{options:?}");
        }
    }

    #[test]
    fn a_full_disk_leaves_the_old_file() {
        struct Full(io::Cursor<Vec<u8>>);
        impl Write for Full {
            fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
                if self.0.get_ref().len() > 5000 { Err(io::ErrorKind::StorageFull.into()) } else { self.0.write(bytes) }
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        impl Seek for Full {
            fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
                self.0.seek(to)
            }
        }
        let snapshot = samples::cloud(1000);
        for options in ALL {
            let error = write(Full(io::Cursor::default()), &snapshot.view(), options).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::StorageFull);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn any_bits_any_name_any_note(
            bits in proptest::collection::vec(any::<u64>(), 0..50), name in "\\PC{1,20}", note in "[^\u{0}]{0,30}",
            time in proptest::num::f64::NORMAL | proptest::num::f64::SUBNORMAL | proptest::num::f64::ZERO, option in 0usize..4,
        ) {
            let values: Vec<f64> = bits.iter().map(|b| f64::from_bits(*b)).collect();
            let data = super::super::Data::F64(values.clone());
            let snapshot = Snapshot {
                points: values.iter().map(|v| [*v, -v, 1.0]).collect(),
                fields: vec![super::super::Field { name, components: 1, data }],
                time: Some(time),
                notes: vec![("note".into(), note)],
                ..Snapshot::default()
            };
            prop_assert!(samples::same(&there_and_back(&snapshot, ALL[option]), &snapshot));
        }
    }
}
