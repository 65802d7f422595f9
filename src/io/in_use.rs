//! Which files the entries of a list need, however they name them: through links, or as the pieces of a parallel file.

use super::atomic::folder_of;
use super::{words, xml};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// Names that must stay as they are.
#[derive(Default)]
pub struct InUse {
    names: HashSet<PathBuf>,
    /// Folders with their names that have no links.
    folders: HashMap<PathBuf, PathBuf>,
    /// Files that list others, and cannot be read now: whatever there is may be theirs.
    unknown: bool,
}

impl InUse {
    pub fn of(files: impl IntoIterator<Item = PathBuf>) -> InUse {
        let mut in_use = InUse::default();
        files.into_iter().for_each(|file| in_use.add(&file));
        in_use
    }

    /// Adds a file with all that is needed to read it.
    pub fn add(&mut self, file: &Path) {
        let mut next = Some(file.to_path_buf());
        // Files may link to each other, and list each other, in circles.
        while let Some(name) = next.map(|path| self.in_real_folder(&path)).filter(|name| !self.names.contains(name)) {
            next = name.read_link().ok().map(|target| folder_of(&name).join(target));
            self.names.insert(name);
        }
        if !lists_others(file) {
            return;
        }
        match listed_in(file) {
            Some(others) => {
                let new: Vec<PathBuf> = others.into_iter().filter(|other| !self.has_name(other)).collect();
                new.iter().for_each(|other| self.add(other));
            }
            None => self.unknown = true,
        }
    }

    /// Whether a file of that name is needed, or may be.
    pub fn has(&mut self, path: &Path) -> bool {
        (self.unknown && path.symlink_metadata().is_ok()) || self.has_name(path)
    }

    fn has_name(&mut self, path: &Path) -> bool {
        let name = self.in_real_folder(path);
        self.names.contains(&name)
    }

    /// One name for each way to write it; a folder that cannot be seen keeps the one that it was given.
    fn in_real_folder(&mut self, path: &Path) -> PathBuf {
        let folder = folder_of(path);
        let Some(name) = path.file_name() else { return path.into() };
        if !self.folders.contains_key(folder) {
            let real = folder.canonicalize().unwrap_or_else(|_| folder.into());
            self.folders.insert(folder.into(), real);
        }
        self.folders[folder].join(name)
    }
}

/// Whether a file has its particles in others: `.pvtu`, `.vtm` and such.
fn lists_others(file: &Path) -> bool {
    const WHOLE: &[&str] = &["vtu", "vtp", "vts", "vti", "vtr", "vtk", "vtkhdf"];
    file.extension().is_none_or(|ending| !WHOLE.iter().any(|whole| ending.eq_ignore_ascii_case(whole)))
}

/// The files that a file lists; none where it cannot be read.
fn listed_in(file: &Path) -> Option<Vec<PathBuf>> {
    let text = words(file).ok()?;
    let document = xml::document(&text).ok()?;
    let names = document.descendants().filter_map(|d| d.attribute("Source").or_else(|| d.attribute("file")));
    // Lists from Windows have its separators.
    let both = names.flat_map(|name| [name.to_string(), name.replace('\\', "/")]);
    Some(both.map(|name| folder_of(file).join(name)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(unix)]
    fn a_file_is_in_use_by_every_way_to_it() {
        use std::os::unix::fs::symlink;
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        std::fs::create_dir(at("sub")).unwrap();
        symlink("linked.vtu", at("link.vtu")).unwrap();
        symlink(at("far.vtu"), at("linked.vtu")).unwrap();
        symlink("round.vtu", at("round.vtu")).unwrap();
        symlink(dir.path(), at("folder")).unwrap();
        std::fs::write(at("p.pvtu"), "<a><Piece Source='sub\\piece.vtu'/><Piece Source='p.pvtu'/></a>").unwrap();
        let files = ["link.vtu", "round.vtu", "folder/gone.vtu", "p.pvtu"];
        let mut in_use = InUse::of(files.map(at));
        for used in ["link.vtu", "linked.vtu", "far.vtu", "round.vtu", "gone.vtu", "./gone.vtu", "sub/piece.vtu"] {
            assert!(in_use.has(&at(used)), "{used}");
        }
        std::fs::write(at("free.vtu"), "").unwrap();
        assert!(!in_use.has(&at("free.vtu")) && !in_use.has(&at("piece.vtu")));
        // Nobody knows the pieces of a list that cannot be read.
        in_use.add(&at("none.pvtu"));
        assert!(in_use.has(&at("free.vtu")) && !in_use.has(&at("new.vtu")));
    }
}
