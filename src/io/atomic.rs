//! Files that are either whole or not there: written under a temporary name in the same folder, flushed, synced, renamed,
//! and the folder synced. Whoever polls the folder never sees half a file; a full disk leaves the old one intact.

use super::limit::Quiet;
use super::temporary::Temporary;
pub use super::temporary::remove_stale;
use crate::error::{Error, Result};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Makes or replaces the file at `path` by what `fill` writes, or fails and leaves everything as it was.
pub fn replace(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<()> {
    prepare(path, fill)?.publish()
}

/// Writes what is to be at `path` in full, and leaves the path as it is.
pub fn prepare(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<Prepared> {
    prepare_or_fail(path, fill).map_err(|e| failed(path, &e))
}

/// A file that only needs its name; without one it goes.
pub struct Prepared {
    temporary: Temporary,
    path: PathBuf,
    /// Its folder, where that can be opened.
    folder: Option<File>,
}

impl Prepared {
    /// Gives the file its name, for good.
    pub fn publish(self) -> Result<()> {
        self.name()?.sync()
    }

    /// Gives the file its name.
    pub fn name(self) -> Result<Named> {
        std::fs::rename(&self.temporary.path, &self.path).map_err(|e| failed(&self.path, &e))?;
        changed();
        Ok(Named { path: self.path, folder: self.folder })
    }
}

/// A file that has its name, though a failing machine may forget it until the folder is synced.
pub struct Named {
    path: PathBuf,
    folder: Option<File>,
}

impl Named {
    pub fn sync(self) -> Result<()> {
        self.folder.map_or(Ok(()), sync).map_err(|e| {
            let reason = format!("it is written, but the disk does not say that it will stay: {e}");
            Error::Io { path: self.path.display().to_string(), reason }
        })
    }
}

/// What was at a path before a new file takes its place, until it is clear that the new one stays.
pub struct Before {
    path: PathBuf,
    /// Another name of the old file, where there was one.
    kept: Option<Temporary>,
    was_there: bool,
}

impl Before {
    pub fn of(path: &Path) -> Before {
        let was_there = path.exists();
        let kept = was_there.then(|| Temporary::link(path).ok()).flatten();
        Before { path: path.into(), kept, was_there }
    }

    /// Puts things back as they were.
    pub fn restore(self) {
        let _ = match (&self.kept, self.was_there) {
            (Some(kept), _) => std::fs::rename(&kept.path, &self.path),
            (None, false) => std::fs::remove_file(&self.path),
            // The file system has no second names: the new file is a whole one as well.
            (None, true) => Ok(()),
        };
    }
}

/// Gives a file another name in its folder, in place of what has that name. Not every file system can.
pub fn second_name(file: &Path, name: &Path) -> io::Result<()> {
    std::fs::rename(&Temporary::link(file)?.path, name)?;
    changed();
    Ok(())
}

/// Removes a file that nobody needs, if it can be.
pub fn remove(path: &Path) {
    let _ = std::fs::remove_file(path);
    changed();
}

fn failed(path: &Path, error: &io::Error) -> Error {
    use io::ErrorKind::{FileTooLarge, NotFound, PermissionDenied, QuotaExceeded, ReadOnlyFilesystem, StorageFull};
    let advice = match error.kind() {
        StorageFull | QuotaExceeded => "free some space or choose another place",
        FileTooLarge => "raise the limit on the size of files or choose another place",
        PermissionDenied | ReadOnlyFilesystem => "choose a place that may be written",
        NotFound => "make its folder first or choose another place",
        _ => "choose another name or place",
    };
    let reason = format!("cannot write it: {error}; {advice}");
    Error::Io { path: path.display().to_string(), reason }
}

/// Makes a folder and those above it where they are not there yet.
pub fn make_folder(folder: &Path) -> Result<()> {
    let failed = |e| Error::Io { path: folder.display().to_string(), reason: format!("cannot make this folder: {e}") };
    std::fs::create_dir_all(folder).map_err(failed)
}

fn prepare_or_fail(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<Prepared> {
    let before = path.metadata().ok();
    // A device or a pipe would be swapped for a plain file by the rename.
    if before.as_ref().is_some_and(|m| !m.is_file()) {
        return Err(io::Error::other("it exists and is not a regular file"));
    }
    if path.file_name().is_none() {
        return Err(io::Error::other("the path ends in no file name"));
    }
    let folder = folder_of(path);
    let temporary = Temporary::create(folder)?;
    if let Some(before) = before {
        temporary.file.set_permissions(before.permissions())?;
    }
    fill_and_sync(temporary.file.try_clone()?, fill)?;
    // A folder that may not be read cannot be synced; only Unix lets one open a folder.
    let folder = File::open(folder).ok().filter(|_| cfg!(unix));
    Ok(Prepared { temporary, path: path.into(), folder })
}

/// The folder that a file of this path lies in.
pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn fill_and_sync(file: File, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let _quiet = Quiet::begin();
    let mut sink = BufWriter::with_capacity(1 << 16, file);
    fill(&mut sink)?;
    sink.flush()?;
    sink.get_ref().sync_all()
}

fn sync(folder: File) -> io::Result<()> {
    match folder.sync_all() {
        // Some network file systems have no sync for folders; the rename is done all the same.
        Err(e) if matches!(e.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported) => Ok(()),
        done => done,
    }
}

/// Called after every change of a name that others see: a process may be killed at each of them.
fn changed() {
    #[cfg(test)]
    WATCH.with_borrow(|watch| watch.iter().for_each(|watch| watch()));
}

#[cfg(test)]
thread_local! {
    pub static WATCH: std::cell::RefCell<Option<Box<dyn Fn()>>> = const { std::cell::RefCell::new(None) };
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
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
        assert!(text.contains("a.vtu") && text.contains("no storage space; free some"), "{text}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(dir.path()), ["a.vtu"]);
    }

    #[test]
    fn what_was_there_before_can_come_back() {
        let dir = tempfile::tempdir().unwrap();
        let (old, new) = (dir.path().join("old.vtu"), dir.path().join("new.vtu"));
        std::fs::write(&old, "old").unwrap();
        for path in [&old, &new] {
            let before = Before::of(path);
            replace(path, |sink| sink.write_all(b"new")).unwrap();
            before.restore();
        }
        assert_eq!((std::fs::read_to_string(&old).unwrap().as_str(), new.exists()), ("old", false));
        drop(Before::of(&old));
        assert_eq!(names(dir.path()), ["old.vtu"]);
    }

    #[test]
    #[cfg(unix)]
    fn a_file_keeps_its_mode() {
        use std::os::unix::fs::PermissionsExt;
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.vtu");
        std::fs::write(&path, "old").unwrap();
        for mode in [0o640, 0o600, 0o444] {
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(mode)).unwrap();
            replace(&path, |sink| sink.write_all(b"new")).unwrap();
            assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, mode);
        }
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_few_bytes_lost_in_the_buffer_are_noticed() {
        // Ten bytes fit the buffer: only the flush meets the full device.
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let error = fill_and_sync(full, |sink| sink.write_all(b"ten bytes.")).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
    }

    #[test]
    fn devices_folders_and_missing_folders_are_errors() {
        let dir = tempfile::tempdir().unwrap();
        let missing = dir.path().join("no/such/a.vtu");
        for (path, advice) in [
            (Path::new("/dev/null"), "not a regular file; choose another name"),
            (dir.path(), "not a regular file; choose another name"),
            (&missing, "make its folder first"),
            (Path::new(".."), "choose another name"),
        ] {
            let error = replace(path, |_| Ok(())).unwrap_err();
            let text = error.to_string();
            assert!(error.name() == "IO" && text.contains(advice) && !text.contains("space"), "{text}");
        }
        assert_eq!(names(dir.path()), Vec::<String>::new());
    }
}
