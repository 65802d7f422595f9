//! Tests of lists whose writer is killed at any point, and of the files that their entries need.

use super::atomic::{self, Prepared, tests::names};
use super::collection::{Entry, format};
use super::pvd::{BESIDE, Series};
use crate::error::Result;
use std::cell::RefCell;
use std::io::Write;
use std::path::Path;
use std::rc::Rc;

/// A snapshot that holds nothing but its time.
fn of(time: f64) -> impl Fn(&Path) -> Result<Prepared> {
    move |path| atomic::prepare(path, |sink| write!(sink, "{time:?}"))
}

fn write_all(list: &Path, times: impl Iterator<Item = f64>) {
    for time in times {
        Series::open_or_create(list).unwrap().write(time, of(time)).unwrap();
    }
}

fn times(list: &Path) -> Vec<f64> {
    Series::read(list).unwrap().entries().iter().map(|e| e.time).collect()
}

/// Whether the files of a list are of the times that it says.
fn is_right(list: &Path) -> bool {
    let Ok(series) = Series::read(list) else { return !list.exists() };
    let time_of = |entry| std::fs::read_to_string(series.file_of(entry)).ok().and_then(|text| text.parse().ok());
    series.entries().iter().all(|entry| time_of(entry) == Some(entry.time))
}

/// Runs `work` and answers the folder of the list as each kill on the way would have left it.
fn killed_everywhere(folder: &Path, work: impl FnOnce()) -> Vec<tempfile::TempDir> {
    let (from, left) = (folder.to_path_buf(), Rc::new(RefCell::new(Vec::new())));
    let keep = Rc::clone(&left);
    let copy = move || {
        let now = tempfile::tempdir().unwrap();
        for name in names(&from) {
            std::fs::copy(from.join(&name), now.path().join(&name)).unwrap();
        }
        keep.borrow_mut().push(now);
    };
    atomic::WATCH.set(Some(Box::new(copy)));
    work();
    atomic::WATCH.set(None);
    left.take()
}

#[test]
fn a_list_is_right_whenever_its_writer_is_killed() {
    let dir = tempfile::tempdir().unwrap();
    let list = dir.path().join("run.pvd");
    write_all(&list, (0..5).map(f64::from));
    // From the start, and from the third snapshot on, with other times.
    for start in [0.0, 1.0] {
        let times = || (0..4).map(|k| start + 0.5 * f64::from(k));
        let left = killed_everywhere(dir.path(), || write_all(&list, times()));
        assert!(left.len() >= 8, "{}", left.len());
        for folder in left {
            let list = folder.path().join("run.pvd");
            assert!(is_right(&list), "{start}: {:?}", std::fs::read_to_string(&list));
            // Whoever goes on from there has nothing left over, and the usual names.
            write_all(&list, (0..6).map(|k| start + 0.25 * f64::from(k)));
            let listed: Vec<String> = Series::read(&list).unwrap().entries().iter().map(|e| e.file.clone()).collect();
            let usual: Vec<String> = (0..listed.len()).map(|k| format!("run_{k:04}.vtu")).collect();
            assert!(is_right(&list) && listed == usual, "{listed:?}");
            assert!(!names(folder.path()).iter().any(|name| name.contains(BESIDE) || name.contains("tmp")));
        }
    }
}

#[test]
fn a_file_that_an_earlier_entry_needs_is_not_overwritten() {
    let entry = |time: f64, file: &str| Entry { time, file: file.into(), others: Vec::new() };
    let listed = |first: &str, prepare: fn(&Path)| {
        let dir = tempfile::tempdir().unwrap();
        let list = dir.path().join("h.pvd");
        std::fs::write(dir.path().join("h_0001.vtu"), "of the first").unwrap();
        prepare(dir.path());
        std::fs::write(&list, format(&[entry(0.0, first), entry(5.0, "h_0002.vtu")])).unwrap();
        write_all(&list, (1..6).map(f64::from));
        assert_eq!(std::fs::read(dir.path().join("h_0001.vtu")).unwrap(), b"of the first", "{first}");
        Series::read(&list).unwrap().entries().iter().map(|e| e.file.clone()).collect::<Vec<_>>()
    };
    let pieces = |folder: &Path| {
        std::fs::write(folder.join("all.pvtu"), "<VTKFile><Piece Source=\"./h_0001.vtu\"/></VTKFile>").unwrap();
    };
    let files = ["h_0002.vtu", "h_0003.vtu", "h_0004.vtu", "h_0005.vtu", "h_0006.vtu"];
    assert_eq!(listed("all.pvtu", pieces)[1..], files);
    #[cfg(unix)]
    {
        let link = |folder: &Path| std::os::unix::fs::symlink("h_0001.vtu", folder.join("first.vtu")).unwrap();
        assert_eq!(listed("first.vtu", link)[1..], files);
    }
    assert_eq!(listed("./sub/../h_0001.vtu", |folder| std::fs::create_dir(folder.join("sub")).unwrap())[1..], files);
}

#[test]
fn entries_whose_files_cannot_be_seen_stay() {
    let dir = tempfile::tempdir().unwrap();
    let list = dir.path().join("run.pvd");
    write_all(&list, (0..3).map(f64::from));
    std::fs::remove_file(dir.path().join("run_0001.vtu")).unwrap();
    write_all(&list, [3.0].into_iter());
    assert_eq!(times(&list), [0.0, 1.0, 2.0, 3.0]);
}
