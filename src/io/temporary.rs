//! Files that are not finished, and what becomes of those that killed processes left.

use super::atomic::folder_of;
use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// An unfinished file; it goes with this unless it has got another name. It is locked as long as somebody writes it.
pub struct Temporary {
    pub path: PathBuf,
    pub file: File,
}

/// What the names of unfinished files begin and end with.
const HEAD: &str = ".diffusph.";
const TAIL: &str = ".tmp";

impl Temporary {
    /// Another name of a file that is there.
    pub fn link(path: &Path) -> io::Result<Temporary> {
        // Or whoever removes stale files would take it.
        let file = File::open(path)?;
        file.try_lock_shared().map_err(io::Error::from)?;
        let (path, ()) = with_free_name(folder_of(path), |name| std::fs::hard_link(path, name))?;
        Ok(Temporary { path, file })
    }

    pub fn create(folder: &Path) -> io::Result<Temporary> {
        remove_stale(folder);
        loop {
            let open = |name: &Path| OpenOptions::new().write(true).create_new(true).open(name);
            let (path, file) = with_free_name(folder, open)?;
            // Whoever removes stale files may have found it before it was locked. Without locks there is no such.
            let lost = matches!(file.try_lock(), Err(TryLockError::WouldBlock)) || !path.exists();
            if !lost {
                return Ok(Temporary { path, file });
            }
        }
    }
}

/// What `make` makes of the first name of an unfinished file that nothing has yet, and the name.
fn with_free_name<T>(folder: &Path, make: impl Fn(&Path) -> io::Result<T>) -> io::Result<(PathBuf, T)> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    loop {
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = folder.join(format!("{HEAD}{}.{number}{TAIL}", std::process::id()));
        match make(&path) {
            // Left by a killed process that had our number, or another host's on a shared disk: take the next.
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
            made => return made.map(|made| (path, made)),
        }
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Removes what killed processes left unfinished: files of our name that nobody has locked.
pub fn remove_stale(folder: &Path) {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let is_file = |entry: &std::fs::DirEntry| entry.file_type().is_ok_and(|kind| kind.is_file());
    for entry in entries.filter(|entry| is_temporary(&entry.file_name()) && is_file(entry)) {
        // Without an answer about the lock somebody may hold it.
        let stale = File::open(entry.path()).and_then(|file| file.try_lock().map(|()| file).map_err(io::Error::from));
        if let Ok(_lock) = stale {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

fn is_temporary(name: &std::ffi::OsStr) -> bool {
    let numbers = name.to_str().and_then(|name| name.strip_prefix(HEAD)?.strip_suffix(TAIL)?.split_once('.'));
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    numbers.is_some_and(|(process, number)| digits(process) && digits(number))
}

#[cfg(test)]
mod tests {
    use super::super::atomic::{prepare, replace, tests::names};
    use std::io::Write;

    #[test]
    fn what_a_killed_process_left_goes_and_what_is_being_written_stays() {
        let dir = tempfile::tempdir().unwrap();
        let stale = dir.path().join(".diffusph.4194305.0.tmp");
        let other = dir.path().join(".diffusph.mine.tmp");
        for path in [&stale, &other] {
            std::fs::write(path, "half").unwrap();
        }
        let unfinished = prepare(&dir.path().join("a.vtu"), |sink| sink.write_all(b"whole")).unwrap();
        replace(&dir.path().join("b.vtu"), |sink| sink.write_all(b"whole")).unwrap();
        unfinished.publish().unwrap();
        assert_eq!(names(dir.path()), [".diffusph.mine.tmp", "a.vtu", "b.vtu"]);
    }
}
