//! Time series: a `.pvd` file lists snapshots with their times, for ParaView and pyvista.

use super::atomic::{self, Before, Prepared};
use super::{broken, in_file, words, xml};
use crate::error::{Error, Result};
use std::collections::{HashMap, HashSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// A list of files with their times, kept on disk: whoever reads it finds only files that are complete.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    path: PathBuf,
    entries: Vec<Entry>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    pub time: f64,
    /// As listed: absolute, or relative to the list's folder.
    pub file: String,
    /// What else a list says of it, like its part and its group.
    pub others: Vec<(String, String)>,
}

impl Series {
    /// Reads a list.
    pub fn read(path: impl AsRef<Path>) -> Result<Series> {
        let path = path.as_ref();
        let entries = parse(&words(path)?).map_err(|e| in_file(path, e))?;
        Ok(Series { path: path.into(), entries })
    }

    /// Goes on with the list at `path`, or starts one that its first snapshot will bring to disk. Files that were listed
    /// and are gone are forgotten.
    pub fn open_or_create(path: impl AsRef<Path>) -> Result<Series> {
        let path = path.as_ref();
        // Snapshots are named by it: two lists must not have the same.
        if path.file_stem().is_some_and(|stem| stem.to_str().is_none()) {
            let rule = "the name of a list, which its snapshots have too, must be Unicode";
            return Err(Error::bad("path", format!("'{}'", path.display().to_string().escape_debug()), rule));
        }
        if !path.try_exists().map_err(|e| in_file(path, super::system(e)))? {
            return Ok(Series { path: path.into(), entries: Vec::new() });
        }
        let mut series = Series::read(path)?;
        let folder = atomic::folder_of(path);
        series.entries.retain(|e| folder.join(&e.file).is_file());
        Ok(series)
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
    /// the file: it takes the place of an older one only when all is there for the list to follow.
    pub fn write(&mut self, time: f64, write: impl FnOnce(&Path) -> Result<Prepared>) -> Result<PathBuf> {
        let path = self.next_file(time);
        let snapshot = write(&path)?;
        self.publish(time, &path, Some(snapshot))?;
        Ok(path)
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
        let earlier = self.entries.iter().filter(|e| e.time < time).cloned();
        let entries: Vec<Entry> = earlier.chain([new]).collect();
        let text = format(&entries);
        let list = atomic::prepare(&self.path, |sink| std::io::Write::write_all(sink, text.as_bytes()))?;
        let old = snapshot.as_ref().map(|_| Before::of(file));
        if let Some(snapshot) = snapshot {
            snapshot.publish()?;
        }
        let list = match list.name() {
            Ok(list) => list,
            Err(e) => {
                old.into_iter().for_each(Before::restore);
                return Err(e);
            }
        };
        let before = std::mem::replace(&mut self.entries, entries);
        self.remove_unlisted(&before);
        list.sync()
    }

    /// A file as the list names it.
    fn listed<'f>(&self, file: &'f Path) -> &'f Path {
        file.strip_prefix(atomic::folder_of(&self.path)).unwrap_or(file)
    }

    /// Removes the snapshots of this series that it listed before, and that nobody finds any more.
    fn remove_unlisted(&self, before: &[Entry]) {
        // However they are written: ./h_0001.vtu is h_0001.vtu.
        let place = |entry: &Entry| self.file_of(entry).canonicalize().ok();
        let listed: HashSet<PathBuf> = self.entries.iter().filter_map(place).collect();
        let unlisted = |entry: &Entry| place(entry).is_some_and(|place| !listed.contains(&place));
        let gone = before.iter().filter(|e| self.has_numbered(&e.file) && unlisted(e));
        gone.for_each(|entry| {
            let _ = std::fs::remove_file(self.file_of(entry));
        });
    }

    /// Whether a name is one that [`Series::next_file`] gives.
    fn has_numbered(&self, file: &str) -> bool {
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy();
        let number = file.strip_prefix(&*stem).and_then(|rest| rest.strip_prefix('_')?.strip_suffix(".vtu"));
        number.is_some_and(|n| n.len() >= 4 && n.bytes().all(|b| b.is_ascii_digit()))
    }

    /// Where a snapshot of this time goes: the first number, from that of earlier entries on, that none of them has. What
    /// they list stays untouched.
    pub fn next_file(&self, time: f64) -> PathBuf {
        let earlier: Vec<&Entry> = self.entries.iter().filter(|e| e.time < time).collect();
        let taken: HashSet<_> = earlier.iter().filter_map(|e| Path::new(&e.file).file_name()).collect();
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy();
        let mut number = earlier.len();
        loop {
            let name = format!("{stem}_{number:04}.vtu");
            if !taken.contains(std::ffi::OsStr::new(&name)) {
                return self.path.with_file_name(name);
            }
            number += 1;
        }
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

fn parse(text: &str) -> Result<Vec<Entry>> {
    let document = xml::document(text)?;
    let root = document.root_element();
    if !root.has_tag_name("VTKFile") || root.attribute("type") != Some("Collection") {
        return Err(broken("it is no list of VTK files (a VTKFile of type Collection)"));
    }
    let mut entries = Vec::new();
    let mut count = HashMap::new();
    for item in root.descendants().filter(|d| d.has_tag_name("DataSet")) {
        let text = item.attribute("timestep").map(str::trim).filter(|text| !text.is_empty());
        let time = text.map(|t| t.parse().ok().filter(|t: &f64| t.is_finite()));
        // Entries without a time count the steps of their part.
        let step = count.entry((item.attribute("group"), item.attribute("part"))).or_insert(0u32);
        let time = time.unwrap_or(Some(f64::from(*step)));
        *step += 1;
        let time = time.ok_or_else(|| broken("a DataSet has a timestep that is no number"))?;
        let file = item.attribute("file").ok_or_else(|| broken("a DataSet names no file"))?;
        let others = item.attributes().filter(|a| !matches!(a.name(), "timestep" | "file"));
        let others = others.map(|a| (a.name().to_string(), a.value().to_string())).collect();
        entries.push(Entry { time, file: file.into(), others });
    }
    entries.sort_by(|a, b| a.time.total_cmp(&b.time));
    Ok(entries)
}

fn format(entries: &[Entry]) -> String {
    let mut text =
        String::from("<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n  <Collection>\n");
    for Entry { time, file, others } in entries {
        let escaped = super::xml_write::escaped;
        let others: String = others.iter().map(|(name, value)| format!(" {name}=\"{}\"", escaped(value))).collect();
        let _ = writeln!(text, "    <DataSet timestep=\"{time:?}\"{others} file=\"{}\"/>", escaped(file));
    }
    text + "  </Collection>\n</VTKFile>\n"
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

        // Restarted from the second snapshot, whose successor is gone: it continues from there.
        std::fs::remove_file(dir.path().join("ü3.vtu")).unwrap();
        let mut again = Series::open_or_create(&pvd).unwrap();
        assert_eq!(times(&again), [0.0, 0.1]);
        again.append(0.05, names[1]).unwrap();
        assert_eq!(times(&Series::read(&pvd).unwrap()), [0.0, 0.05]);
    }

    #[test]
    fn what_others_say_of_their_entries_is_kept() {
        let list = |inside: &str| format!("<VTKFile type=\"Collection\"><Collection>{inside}</Collection></VTKFile>");
        let entries = |inside: &str| parse(&list(inside)).unwrap();
        let two = "<DataSet timestep='0' group='a &lt; b' part='0' file='a'/><DataSet timestep='' part='1' name='n' file='b'/>";
        let read = entries(two);
        assert_eq!(parse(&format(&read)).unwrap(), read);
        let all: String = read.iter().flat_map(|e| &e.others).map(|(name, value)| format!("{name}={value} ")).collect();
        assert_eq!(all, "group=a < b part=0 part=1 name=n ");
        let times = |inside: &str| entries(inside).iter().map(|e| e.time).collect::<Vec<_>>();
        assert_eq!(times("<DataSet file='a'/><DataSet file='b'/><DataSet file='c'/>"), [0.0, 1.0, 2.0]);
        assert_eq!(times("<DataSet part='0' file='a'/><DataSet part='1' file='b'/>"), [0.0, 0.0]);
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
            assert!(error.name() == "BAD_FILE" && error.to_string().contains("run.pvd"), "{error}");
        }
        assert_eq!(Series::read(dir.path().join("none.pvd")).unwrap_err().name(), "IO");
    }
}
