//! Time series: a `.pvd` file lists snapshots with their times, for ParaView and pyvista.

use super::atomic::{self, Before, Named, Prepared};
use super::collection::{Entry, format, parse};
use super::in_use::InUse;
use super::{advised, in_file, words};
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// What follows the number of a snapshot while an older one of this number is listed: `run_0002.new.vtu`.
pub(super) const BESIDE: &str = ".new";

/// A list of files with their times, kept on disk: whoever reads it finds only files that are complete.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    path: PathBuf,
    entries: Vec<Entry>,
}

impl Series {
    /// Reads a list.
    pub fn read(path: impl AsRef<Path>) -> Result<Series> {
        let path = path.as_ref();
        let entries = parse(&words(path)?).map_err(|e| in_file(path, e))?;
        Ok(Series { path: path.into(), entries })
    }

    /// Goes on with the list at `path`, or starts one that its first snapshot will bring to disk. What is listed stays,
    /// whether its file can be seen now or not.
    pub fn open_or_create(path: impl AsRef<Path>) -> Result<Series> {
        let path = path.as_ref();
        // Snapshots are named by it: two lists must not have the same.
        if path.file_stem().is_some_and(|stem| stem.to_str().is_none()) {
            let rule = "the name of a list, which its snapshots have too, must be Unicode";
            return Err(Error::bad("path", format!("'{}'", path.display().to_string().escape_debug()), rule));
        }
        match path.try_exists().map_err(|e| in_file(path, super::system(e)))? {
            true => Series::read(path).map_err(|e| advised(e, "remove it, or give another name, to begin a new list")),
            false => Ok(Series { path: path.into(), entries: Vec::new() }),
        }
    }

    /// Lists a complete `file` at `time` and replaces the list on disk. Entries of this time or later go, and with them the
    /// files that this series had numbered for them: a run that was restarted writes them again. On an error neither the list
    /// nor its file is changed.
    pub fn append(&mut self, time: f64, file: impl AsRef<Path>) -> Result<()> {
        let file = file.as_ref();
        let listed = atomic::folder_of(&self.path).join(self.listed(file));
        if !listed.is_file() {
            return Err(Error::bad("file", file.display(), "list a snapshot after it has been written"));
        }
        self.publish(time, file, None)
    }

    /// Writes the next snapshot, of this time, and lists it; answers its path. As [`Series::append`], and `write` prepares
    /// the file, under a name that nothing on the list has: whenever this is stopped, the list on disk names files of its
    /// times.
    pub fn write(&mut self, time: f64, write: impl FnOnce(&Path) -> Result<Prepared>) -> Result<PathBuf> {
        let path = self.next_file(time);
        let snapshot = write(&path)?;
        self.publish(time, &path, Some(snapshot))?;
        self.settle();
        Ok(self.entries.last().map_or(path, |entry| self.file_of(entry)))
    }

    fn publish(&mut self, time: f64, file: &Path, snapshot: Option<Prepared>) -> Result<()> {
        if !time.is_finite() {
            return Err(Error::bad("time", time, "the time of a snapshot must be finite"));
        }
        let listed = self.listed(file).to_str().filter(|f| !f.chars().any(char::is_control));
        let name = || format!("'{}'", file.display().to_string().escape_debug());
        let rule =
            "the name of a listed file, and with it that of the list, must be Unicode without control characters";
        let listed = listed.ok_or_else(|| Error::bad("path", name(), rule))?;
        let new = Entry { time, file: listed.into(), others: vec![("part".into(), "0".into())] };
        let entries: Vec<Entry> = self.before(time).cloned().chain([new]).collect();
        let list = self.prepare(&entries)?;
        let old = snapshot.as_ref().map(|_| Before::of(file));
        match snapshot.map_or(Ok(()), Prepared::publish).and_then(|()| list.name()) {
            Ok(list) => self.follow(list, entries),
            Err(e) => {
                old.into_iter().for_each(Before::restore);
                Err(e)
            }
        }
    }

    fn prepare(&self, entries: &[Entry]) -> Result<Prepared> {
        let text = format(entries);
        atomic::prepare(&self.path, |sink| std::io::Write::write_all(sink, text.as_bytes()))
    }

    /// Once the list on disk has other entries for good, what only the old ones needed goes.
    fn follow(&mut self, list: Named, entries: Vec<Entry>) -> Result<()> {
        let before = std::mem::replace(&mut self.entries, entries);
        list.sync()?;
        self.remove_unlisted(&before);
        Ok(())
    }

    /// Gives snapshots that had to stand beside an older one its name, now that no entry needs it: first a second name,
    /// then the list, then the first one goes. Where that cannot be (not every file system has second names), they keep
    /// the one that they have.
    fn settle(&mut self) {
        let wanted = |e: &Entry| self.usual_name(&e.file).filter(|usual| *usual != e.file);
        if self.entries.iter().all(|e| wanted(e).is_none()) {
            return;
        }
        let mut in_use = self.needed(&self.entries);
        let mut entries = self.entries.clone();
        for entry in &mut entries {
            let Some(usual) = wanted(entry) else { continue };
            let path = self.path.with_file_name(&usual);
            if !in_use.has(&path) && atomic::second_name(&self.file_of(entry), &path).is_ok() {
                in_use.add(&path);
                entry.file = usual;
            }
        }
        if entries != self.entries {
            let _ = self.prepare(&entries).and_then(Prepared::name).and_then(|list| self.follow(list, entries));
        }
    }

    /// A file as the list names it.
    fn listed<'f>(&self, file: &'f Path) -> &'f Path {
        file.strip_prefix(atomic::folder_of(&self.path)).unwrap_or(file)
    }

    /// The entries that a snapshot of this time leaves on the list.
    fn before(&self, time: f64) -> impl Iterator<Item = &Entry> {
        self.entries.iter().filter(move |e| e.time < time)
    }

    /// The files that entries need.
    fn needed<'e>(&self, entries: impl IntoIterator<Item = &'e Entry>) -> InUse {
        InUse::of(entries.into_iter().map(|e| self.file_of(e)))
    }

    /// Removes the snapshots of this series that it listed before, and those that a killed process left beside others,
    /// where no entry needs them.
    fn remove_unlisted(&self, before: &[Entry]) {
        let mut in_use = self.needed(&self.entries);
        let beside = std::fs::read_dir(atomic::folder_of(&self.path)).into_iter().flatten().flatten();
        let beside = beside.filter_map(|file| file.file_name().into_string().ok());
        let beside = beside.filter(|name| self.usual_name(name).is_some_and(|usual| usual != *name));
        let gone = before.iter().map(|e| e.file.clone()).filter(|name| self.usual_name(name).is_some());
        for path in gone.chain(beside).map(|name| self.path.with_file_name(name)) {
            if !in_use.has(&path) {
                atomic::remove(&path);
            }
        }
    }

    /// Of a name that [`Series::next_file`] gives, the one that it gives where no entry has it.
    fn usual_name(&self, file: &str) -> Option<String> {
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy();
        let mut number = file.strip_prefix(&*stem)?.strip_prefix('_')?.strip_suffix(".vtu")?;
        while let Some(shorter) = number.strip_suffix(BESIDE) {
            number = shorter;
        }
        let ours = number.len() >= 4 && number.bytes().all(|b| b.is_ascii_digit());
        ours.then(|| format!("{stem}_{number}.vtu"))
    }

    /// Where a snapshot of this time goes: the first number, from that of earlier entries on, that none of them needs; beside
    /// the file of that number where a later entry still needs that.
    pub fn next_file(&self, time: f64) -> PathBuf {
        let mut in_use = self.needed(self.before(time));
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy();
        let named = |number: usize, beside: &str| self.path.with_file_name(format!("{stem}_{number:04}{beside}.vtu"));
        let mut number = self.before(time).count();
        while in_use.has(&named(number, "")) {
            number += 1;
        }
        self.entries.iter().filter(|e| e.time >= time).for_each(|e| in_use.add(&self.file_of(e)));
        let mut beside = String::new();
        while in_use.has(&named(number, &beside)) {
            beside += BESIDE;
        }
        named(number, &beside)
    }

    /// The listed files in order of time.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Where the file of an entry lies.
    pub fn file_of(&self, entry: &Entry) -> PathBuf {
        atomic::folder_of(&self.path).join(&entry.file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(series: &Series) -> Vec<f64> {
        series.entries().iter().map(|e| e.time).collect()
    }

    #[test]
    fn a_restarted_series_goes_on_where_it_was() {
        let dir = tempfile::tempdir().unwrap();
        let pvd = dir.path().join("run.pvd");
        let mut series = Series::open_or_create(&pvd).unwrap();
        assert!(!pvd.exists());
        let names = ["a<&\">'1.vtu", "b 2.vtu", "ü3.vtu"];
        for (i, name) in names.iter().enumerate() {
            let file = dir.path().join(name);
            std::fs::write(&file, "").unwrap();
            series.append(0.1 * i as f64, &file).unwrap();
        }
        let again = Series::open_or_create(&pvd).unwrap();
        assert_eq!(again, series);
        assert!(again.entries().iter().zip(names).all(|(e, name)| e.file == name && again.file_of(e).is_file()));

        // Restarted from the first snapshot: it continues from there.
        let mut again = Series::open_or_create(&pvd).unwrap();
        again.append(0.05, names[1]).unwrap();
        assert_eq!(times(&Series::read(&pvd).unwrap()), [0.0, 0.05]);
    }

    #[test]
    fn a_shorter_series_takes_its_old_snapshots_along_and_no_other_files() {
        let dir = tempfile::tempdir().unwrap();
        let mut series = Series::open_or_create(dir.path().join("run.pvd")).unwrap();
        let whole = |path: &Path| atomic::prepare(path, |sink| std::io::Write::write_all(sink, b"new"));
        for time in 0..4 {
            series.write(f64::from(time), whole).unwrap();
        }
        std::fs::write(dir.path().join("mine.vtu"), "").unwrap();
        std::fs::write(dir.path().join("run_0009.vtu"), "").unwrap();
        series.append(4.0, "mine.vtu").unwrap();
        series.write(1.0, whole).unwrap();
        let names = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.collect();
        names.sort();
        assert_eq!(names, ["mine.vtu", "run.pvd", "run_0000.vtu", "run_0001.vtu", "run_0009.vtu"]);
    }

    #[test]
    fn a_snapshot_that_cannot_be_listed_replaces_none() {
        let dir = tempfile::tempdir().unwrap();
        let list = dir.path().join("run.pvd");
        let mut series = Series::open_or_create(&list).unwrap();
        let of = |text: &'static [u8]| {
            move |path: &Path| atomic::prepare(path, |sink| std::io::Write::write_all(sink, text))
        };
        let path = series.write(1.0, of(b"old")).unwrap();
        std::fs::remove_file(&list).unwrap();
        std::fs::create_dir(&list).unwrap();
        assert_eq!(series.write(0.0, of(b"new")).unwrap_err().name(), "IO");
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(times(&series), [1.0]);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2);
    }

    #[test]
    fn only_complete_files_at_finite_times_are_listed() {
        let dir = tempfile::tempdir().unwrap();
        let pvd = dir.path().join("run.pvd");
        let mut series = Series::open_or_create(&pvd).unwrap();
        assert_eq!(series.append(0.0, "missing.vtu").unwrap_err().name(), "BAD_VALUE");
        std::fs::write(dir.path().join("a.vtu"), "").unwrap();
        assert_eq!(series.append(f64::INFINITY, "a.vtu").unwrap_err().name(), "BAD_VALUE");
        assert!(!pvd.exists() && series.entries().is_empty());
        series.append(5e-324, "a.vtu").unwrap();
        assert_eq!(times(&Series::read(&pvd).unwrap()), [5e-324]);
    }

    #[test]
    fn what_is_no_list_is_refused_by_name() {
        let dir = tempfile::tempdir().unwrap();
        let pvd = dir.path().join("run.pvd");
        let list = |inside: &str| format!("<VTKFile type=\"Collection\"><Collection>{inside}</Collection></VTKFile>");
        let cases =
            ["", "<a", "<VTKFile/>", &list("<DataSet timestep='0'/>"), &list("<DataSet timestep='nan' file='a'/>")];
        for text in cases {
            std::fs::write(&pvd, text).unwrap();
            let error = Series::open_or_create(&pvd).unwrap_err();
            let text = error.to_string();
            assert!(error.name() == "BAD_FILE" && text.contains("run.pvd") && text.contains("remove it"), "{text}");
            assert!(!text.contains("particle"), "{text}");
        }
        assert_eq!(Series::read(dir.path().join("none.pvd")).unwrap_err().name(), "IO");
    }
}
