//! Files: what a host's tools read and write.
//!
//! | file | what it does |
//! |---|---|
//! | `snapshot`, `data` | a cloud as read: points, fields, time, notes; numbers of every type |
//! | `view` | a cloud to write: borrowed, or computed a block at a time |
//! | `xml_read` | `.vtu`, `.vtp` and their parallel lists, in all of VTK's encodings |
//! | `xml` | the text of XML and its tree, within bounds |
//! | `split` | an XML file cut into its head and its appended section |
//! | `payload` | the bytes of one array: base64, block headers, decompression |
//! | `xml_write` | `.vtu`, streamed |
//! | `legacy_read` | legacy `.vtk` |
//! | `legacy` | legacy `.vtk` to write, through vtkio |
//! | `pvd`, `collection` | time series of files; the text of their list |
//! | `in_use` | which files a time series needs |
//! | `atomic`, `temporary` | every file appears whole or not at all; what is unfinished, and its end |

pub mod atomic;
mod collection;
mod data;
mod element;
mod in_use;
#[cfg(test)]
mod killed;
mod legacy;
mod legacy_read;
mod limit;
mod payload;
mod pvd;
#[cfg(test)]
mod samples;
mod snapshot;
mod split;
mod temporary;
mod view;
mod xml;
mod xml_read;
mod xml_write;

pub use collection::Entry;
pub use data::Data;
pub use element::Element;
pub use pvd::Series;
pub use snapshot::{Field, LeftAside, OF_CELLS, Snapshot};
pub use view::{Column, Values, View};
pub use xml_write::{Encoding, Options};

use crate::error::{Error, Result};
use crate::memory;
use atomic::Prepared;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Reads a particle file: `.vtu`, `.vtp`, `.vts`, `.pvtu`, `.pvtp` (ascii, base64 or raw; plain, zlib or lz4) and legacy
/// `.vtk`. The content decides, not the name. Cells are left aside: particles are points; and so are arrays that are not
/// what they say, see [`Snapshot::left_aside`].
///
/// Errors: `IO` when the system refuses, `BAD_FILE` when the content is wrong, `NO_MEMORY`.
pub fn read(path: impl AsRef<Path>) -> Result<Snapshot> {
    let path = path.as_ref();
    let mut snapshot = read_any(path, true).map_err(|e| advised(in_file(path, e), "no particle was read"))?;
    if snapshot.ghosts > 0 {
        snapshot.remarks.push(format!("{} points are ghosts (vtkGhostType): left aside", snapshot.ghosts));
    }
    Ok(snapshot)
}

/// Writes a `.vtu`: an unstructured grid with one VERTEX cell per particle.
pub fn write_vtu(path: impl AsRef<Path>, view: &View, options: Options) -> Result<()> {
    prepare_vtu(path.as_ref(), view, options)?.publish()
}

/// Writes a legacy `.vtk` (version 4.2, big-endian), for tools that read nothing newer. The format has no place for time
/// and notes.
pub fn write_legacy(path: impl AsRef<Path>, view: &View) -> Result<()> {
    prepare_legacy(path.as_ref(), view)?.publish()
}

/// [`write_vtu`] up to where the file gets its name.
pub fn prepare_vtu(path: &Path, view: &View, options: Options) -> Result<Prepared> {
    view.check()?;
    atomic::prepare(path, |sink| xml_write::write(sink, view, options))
}

/// [`write_legacy`] up to where the file gets its name.
pub fn prepare_legacy(path: &Path, view: &View) -> Result<Prepared> {
    view.check()?;
    let bytes = legacy::encode(view).map_err(|e| in_file(path, e))?;
    atomic::prepare(path, |sink| std::io::Write::write_all(sink, &bytes))
}

fn read_any(path: &Path, whole: bool) -> Result<Snapshot> {
    let mut file = open(path)?;
    let mut start = Vec::new();
    file.by_ref().take(16).read_to_end(&mut start).map_err(system)?;
    if !start.starts_with(b"# vtk DataFile") {
        return xml_read::read(file, path, whole);
    }
    let bytes = file.metadata().map_err(system)?.len();
    if bytes > memory::available() {
        return Err(memory::no_memory::<u8>("the file", usize::try_from(bytes).unwrap_or(usize::MAX)));
    }
    file.read_to_end(&mut start).map_err(system)?;
    legacy_read::read(&start)
}

/// Opens what can be read from front to end and again: a pipe would be waited for, a device has no end.
fn open(path: &Path) -> Result<File> {
    if path.as_os_str().is_empty() {
        return Err(Error::bad("path", "''", "it names no file: give the name of one"));
    }
    let about = std::fs::metadata(path).map_err(system)?;
    let what = if about.is_dir() { "a folder" } else { "a pipe or a device" };
    // So are some that the system makes up while they are read, and the next byte of one may never come.
    if about.is_file() && about.len() == 0 {
        return Err(broken("it is empty"));
    }
    match about.is_file() {
        true => File::open(path).map_err(system),
        false => Err(system(std::io::Error::other(format!("it is {what}, not a file; give a regular one")))),
    }
}

/// A file of words in UTF-8, no longer than people write.
///
/// # Errors
/// `Io`, `BadFile`.
pub fn words(path: &Path) -> Result<String> {
    const LONGEST: u64 = 1 << 26;
    let read = |path| {
        let mut bytes = Vec::new();
        open(path)?.take(LONGEST + 1).read_to_end(&mut bytes).map_err(system)?;
        if bytes.len() as u64 > LONGEST {
            return Err(broken(format!("it is longer than {LONGEST} bytes")));
        }
        String::from_utf8(bytes).map_err(|_| broken("its text is not UTF-8"))
    };
    read(path).map_err(|e| in_file(path, e))
}

/// The same error where the content is wrong, with what follows from that or what to do about it.
pub fn advised(error: Error, advice: &str) -> Error {
    match error {
        Error::BadFile { path, reason } => Error::BadFile { path, reason: format!("{reason}; {advice}") },
        other => other,
    }
}

/// The content is wrong. The path is added where it is known: [`in_file`].
fn broken(reason: impl Into<String>) -> Error {
    Error::BadFile { path: String::new(), reason: reason.into() }
}

/// The system refused. The path is added where it is known: [`in_file`].
fn system(error: std::io::Error) -> Error {
    match error.kind() {
        std::io::ErrorKind::OutOfMemory => crate::memory::no_memory::<u8>("the name of a file", 0),
        _ => Error::Io { path: String::new(), reason: format!("cannot read it: {error}") },
    }
}

/// The same error with the file's name, unless it has one; an element that cannot be used is the file's fault.
pub fn in_file(path: &Path, error: Error) -> Error {
    let named = || path.display().to_string();
    match error {
        Error::BadFile { path, reason } if path.is_empty() => Error::BadFile { path: named(), reason },
        Error::Io { path, reason } if path.is_empty() => Error::Io { path: named(), reason },
        element @ Error::BadElement { .. } => Error::BadFile { path: named(), reason: element.to_string() },
        other => other,
    }
}
