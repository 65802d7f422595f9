//! Time series: a `.pvd` file lists snapshots with their times, for ParaView and pyvista.

use super::{atomic, broken, in_file, system};
use crate::error::{Error, Result};
use roxmltree::Document;
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
}

impl Series {
    /// Reads a list.
    pub fn read(path: impl AsRef<Path>) -> Result<Series> {
        let path = path.as_ref();
        let text = std::fs::read(path).map_err(system);
        let entries = text.and_then(|text| parse(&text)).map_err(|e| in_file(path, e))?;
        Ok(Series { path: path.into(), entries })
    }

    /// Goes on with the list at `path`, or starts one that its first snapshot will bring to disk. Files that were listed
    /// and are gone are forgotten.
    pub fn open_or_create(path: impl AsRef<Path>) -> Result<Series> {
        let path = path.as_ref();
        if !path.try_exists().map_err(|e| in_file(path, system(e)))? {
            return Ok(Series { path: path.into(), entries: Vec::new() });
        }
        let mut series = Series::read(path)?;
        let folder = atomic::folder_of(path);
        series.entries.retain(|e| folder.join(&e.file).is_file());
        Ok(series)
    }

    /// Lists a complete `file` at `time` and replaces the list on disk. Entries of this time or later go: a run that was
    /// restarted writes them again. On an error neither the list nor its file is changed.
    pub fn append(&mut self, time: f64, file: impl AsRef<Path>) -> Result<()> {
        if !time.is_finite() {
            return Err(Error::bad("time", time, "the time of a snapshot must be finite"));
        }
        let folder = atomic::folder_of(&self.path);
        let file = file.as_ref();
        let file = file.strip_prefix(folder).unwrap_or(file);
        if !folder.join(file).is_file() {
            return Err(Error::bad("file", file.display(), "list a snapshot after it has been written"));
        }
        let file = file.to_str().filter(|f| !f.chars().any(char::is_control));
        let file = file.ok_or_else(|| Error::bad("file", "its name", "a listed file needs a name in plain Unicode"))?;
        let earlier = self.entries.iter().filter(|e| e.time < time).cloned();
        let entries: Vec<Entry> = earlier.chain([Entry { time, file: file.into() }]).collect();
        let text = format(&entries);
        atomic::replace(&self.path, |sink| std::io::Write::write_all(sink, text.as_bytes()))?;
        self.entries = entries;
        Ok(())
    }

    /// Where a snapshot of this time goes: the first number, from that of earlier entries on, that none of them has. What
    /// they list stays untouched.
    pub fn next_file(&self, time: f64) -> PathBuf {
        let earlier: Vec<&Entry> = self.entries.iter().filter(|e| e.time < time).collect();
        let taken = |name: &str| earlier.iter().any(|e| Path::new(&e.file).file_name() == Some(name.as_ref()));
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy();
        let mut number = earlier.len();
        loop {
            let name = format!("{stem}_{number:04}.vtu");
            if !taken(&name) {
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

fn parse(text: &[u8]) -> Result<Vec<Entry>> {
    let text = std::str::from_utf8(text).map_err(|_| broken("its text is not UTF-8"))?;
    let document = Document::parse(text).map_err(|e| broken(format!("its XML is wrong: {e}")))?;
    let root = document.root_element();
    if !root.has_tag_name("VTKFile") || root.attribute("type") != Some("Collection") {
        return Err(broken("it is no list of VTK files (a VTKFile of type Collection)"));
    }
    let mut entries = Vec::new();
    for item in root.descendants().filter(|d| d.has_tag_name("DataSet")) {
        let time = item.attribute("timestep").and_then(|t| t.trim().parse().ok()).filter(|t: &f64| t.is_finite());
        let time = time.ok_or_else(|| broken("a DataSet has no timestep that is a number"))?;
        let file = item.attribute("file").ok_or_else(|| broken("a DataSet names no file"))?;
        entries.push(Entry { time, file: file.into() });
    }
    entries.sort_by(|a, b| a.time.total_cmp(&b.time));
    Ok(entries)
}

fn format(entries: &[Entry]) -> String {
    let mut text =
        String::from("<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n  <Collection>\n");
    for Entry { time, file } in entries {
        let file = super::xml_write::escaped(file);
        let _ = writeln!(text, "    <DataSet timestep=\"{time:?}\" part=\"0\" file=\"{file}\"/>");
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
        let cases = ["", "<a", "<VTKFile/>", &list("<DataSet file='a'/>"), &list("<DataSet timestep='nan' file='a'/>")];
        for text in cases {
            std::fs::write(&pvd, text).unwrap();
            let error = Series::open_or_create(&pvd).unwrap_err();
            assert!(error.name() == "BAD_FILE" && error.to_string().contains("run.pvd"), "{error}");
        }
        assert_eq!(Series::read(dir.path().join("none.pvd")).unwrap_err().name(), "IO");
    }
}
