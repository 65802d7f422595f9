//! Files that are either whole or not there: written under a temporary name in the same folder, flushed, synced, renamed,
//! and the folder synced. Whoever polls the folder never sees half a file; a full disk leaves the old one intact.

use crate::error::{Error, Result};
use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Makes or replaces the file at `path` by what `fill` writes, or fails and leaves everything as it was.
pub fn replace(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<()> {
    replace_or_fail(path, fill).map_err(|e| Error::Io {
        path: path.display().to_string(),
        reason: format!("cannot write it: {e}; free some space or choose another place"),
    })
}

/// Makes a folder and those above it where they are not there yet.
pub fn make_folder(folder: &Path) -> Result<()> {
    let failed = |e| Error::Io { path: folder.display().to_string(), reason: format!("cannot make this folder: {e}") };
    std::fs::create_dir_all(folder).map_err(failed)
}

fn replace_or_fail(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    // A device or a pipe would be swapped for a plain file by the rename.
    if path.metadata().is_ok_and(|m| !m.is_file()) {
        return Err(io::Error::other("it exists and is not a regular file"));
    }
    let name = path.file_name().ok_or_else(|| io::Error::other("the path ends in no file name"))?;
    let folder = folder_of(path);
    let (temporary, file) = Temporary::create(folder, name)?;
    fill_and_sync(file, fill)?;
    std::fs::rename(&temporary.0, path)?;
    sync_folder(folder)
}

/// The folder that a file of this path lies in.
pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn fill_and_sync(file: File, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let mut sink = BufWriter::with_capacity(1 << 16, file);
    fill(&mut sink)?;
    sink.flush()?;
    sink.get_ref().sync_all()
}

fn sync_folder(folder: &Path) -> io::Result<()> {
    if cfg!(not(unix)) {
        return Ok(()); // only Unix lets one open a folder
    }
    match File::open(folder)?.sync_all() {
        // Some network file systems have no sync for folders; the rename is done all the same.
        Err(e) if matches!(e.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported) => Ok(()),
        done => done,
    }
}

/// The name of an unfinished file; a file that still has it goes with it.
struct Temporary(PathBuf);

impl Temporary {
    fn create(folder: &Path, name: &std::ffi::OsStr) -> io::Result<(Temporary, File)> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        loop {
            let mut hidden = std::ffi::OsString::from(".");
            hidden.push(name);
            hidden.push(format!(".{}.{}.tmp", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed)));
            let path = folder.join(hidden);
            match OpenOptions::new().write(true).create_new(true).open(&path) {
                Ok(file) => return Ok((Temporary(path), file)),
                // Left by a killed process that had our number, or another host's on a shared disk: take the next.
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
                Err(e) => return Err(e),
            }
        }
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn a_file_appears_whole_and_alone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.vtu");
        for text in ["first", "second"] {
            replace(&path, |sink| {
                assert_ne!(std::fs::read(&path).unwrap_or_default(), text.as_bytes());
                sink.write_all(text.as_bytes())
            })
            .unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
        assert_eq!(names(dir.path()), ["a.vtu"]);
    }

    #[test]
    fn a_disk_that_fills_up_leaves_the_old_file_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.vtu");
        std::fs::write(&path, "old").unwrap();
        let error = replace(&path, |sink| {
            sink.write_all(&[0; 100_000])?;
            Err(io::ErrorKind::StorageFull.into())
        });
        let text = error.unwrap_err().to_string();
        assert!(text.contains("a.vtu") && text.contains("no storage space"), "{text}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(dir.path()), ["a.vtu"]);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_few_bytes_lost_in_the_buffer_are_noticed() {
        // Ten bytes fit the buffer: only the flush meets the full device.
        let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
        let error = fill_and_sync(full, |sink| sink.write_all(b"ten bytes.")).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
    }

    #[test]
    fn devices_folders_and_missing_folders_are_errors() {
        let dir = tempfile::tempdir().unwrap();
        for path in [Path::new("/dev/null"), dir.path(), &dir.path().join("no/such/a.vtu"), Path::new("..")] {
            assert_eq!(replace(path, |_| Ok(())).unwrap_err().name(), "IO", "{path:?}");
        }
        assert_eq!(names(dir.path()), Vec::<String>::new());
    }
}
