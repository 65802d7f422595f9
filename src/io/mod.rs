//! Files: what a host's tools read and write.
//!
//! | file | what it does |
//! |---|---|
//! | `snapshot`, `data` | a cloud as read: points, fields, time, notes; numbers of every type |
//! | `view` | a cloud to write: borrowed, or computed a block at a time |
//! | `xml_read` | `.vtu`, `.vtp` and their parallel lists, in all of VTK's encodings |
//! | `split` | an XML file cut into its head and its appended section |
//! | `payload` | the bytes of one array: base64, block headers, decompression |
//! | `xml_write` | `.vtu`, streamed |
//! | `legacy_read` | legacy `.vtk` |
//! | `legacy` | legacy `.vtk` to write, through vtkio |
//! | `pvd` | time series of files |
//! | `atomic` | every file appears whole or not at all |

pub mod atomic;
mod data;
mod legacy;
mod legacy_read;
mod payload;
mod pvd;
#[cfg(test)]
mod samples;
mod snapshot;
mod split;
mod view;
mod xml_read;
mod xml_write;

pub use data::{Data, Element};
pub use pvd::{Entry, Series};
pub use snapshot::{Field, LeftAside, Snapshot};
pub use view::{Column, Values, View};
pub use xml_write::{Encoding, Options};

use crate::error::{Error, Result};
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
    let mut snapshot = read_any(path, true).map_err(|e| in_file(path, e))?;
    if snapshot.ghosts > 0 {
        snapshot.remarks.push(format!("{} points are ghosts (vtkGhostType): left aside", snapshot.ghosts));
    }
    Ok(snapshot)
}

/// Writes a `.vtu`: an unstructured grid with one VERTEX cell per particle.
pub fn write_vtu(path: impl AsRef<Path>, view: &View, options: Options) -> Result<()> {
    view.check()?;
    atomic::replace(path.as_ref(), |sink| xml_write::write(sink, view, options))
}

/// Writes a legacy `.vtk` (version 4.2, big-endian), for tools that read nothing newer. The format has no place for time
/// and notes.
pub fn write_legacy(path: impl AsRef<Path>, view: &View) -> Result<()> {
    view.check()?;
    let path = path.as_ref();
    let bytes = legacy::encode(view).map_err(|e| in_file(path, e))?;
    atomic::replace(path, |sink| std::io::Write::write_all(sink, &bytes))
}

fn read_any(path: &Path, whole: bool) -> Result<Snapshot> {
    let mut file = File::open(path).map_err(system)?;
    let mut start = Vec::new();
    file.by_ref().take(16).read_to_end(&mut start).map_err(system)?;
    if !start.starts_with(b"# vtk DataFile") {
        return xml_read::read(file, path, whole);
    }
    legacy_read::read(&std::fs::read(path).map_err(system)?)
}

/// The content is wrong. The path is added where it is known: [`in_file`].
fn broken(reason: impl Into<String>) -> Error {
    Error::BadFile { path: String::new(), reason: reason.into() }
}

/// The system refused. The path is added where it is known: [`in_file`].
fn system(error: std::io::Error) -> Error {
    Error::Io { path: String::new(), reason: format!("cannot read it: {error}") }
}

/// The same error with the file's name, unless it has one.
fn in_file(path: &Path, error: Error) -> Error {
    let named = || path.display().to_string();
    match error {
        Error::BadFile { path, reason } if path.is_empty() => Error::BadFile { path: named(), reason },
        Error::Io { path, reason } if path.is_empty() => Error::Io { path: named(), reason },
        other => other,
    }
}
