//! A run that goes on from its last snapshot.

use super::identity;
use super::run::Study;
use super::scene::Output;
use crate::error::{Error, Result};
use crate::io::{self, Entry, Series, Snapshot};
use std::path::Path;

impl Study {
    /// Goes on from the last snapshot of the same run under `out`: to the same bits as without an interruption. From the
    /// start where there is none yet.
    ///
    /// # Errors
    /// `BadValue` where the scene writes none, or has changed since; whatever is wrong with the files.
    pub fn resumed(mut self, out: &Path) -> Result<Study> {
        let Some(output) = self.scene.output.clone() else {
            return Err(Error::bad("--continue", "a scene without [output]", "it leaves nothing to go on from"));
        };
        let list = out.join(&output.pvd);
        let series = Series::open_or_create(&list)?;
        let Some(last) = series.entries().last() else {
            self.remarks.push("there was nothing to go on from: from the start".into());
            return Ok(self);
        };
        let file = series.file_of(last);
        let snapshot = read_last(last, &file).map_err(|e| unusable(e, &list))?;
        if let Some(what) = self.difference(&output, &snapshot)? {
            let rule = format!("{what}; give the scene as it was, or another folder by --out");
            return Err(Error::bad("--continue", format!("'{}', which is of another run", file.display()), &rule));
        }
        self.solver.set_snapshot(&snapshot).map_err(|e| unusable(io::in_file(&file, e), &list))?;
        let time = self.solver.get_number("time")?;
        self.done = Some(self.step_at(time, &file)?);
        self.remarks.push(format!("it went on from '{}'", file.display()));
        match series.entries().iter().filter(|e| !series.file_of(e).is_file()).count() {
            0 => {}
            lost => self.remarks.push(format!("{lost} of the files that '{}' lists are not there", list.display())),
        }
        Ok(self)
    }

    /// What this run, and its snapshots say of themselves.
    ///
    /// # Errors
    /// `OutOfOrder` before T is set.
    pub(super) fn identity(&mut self, output: &Output) -> Result<String> {
        if self.identity.is_none() {
            self.identity = Some(identity::of(self.start, &self.scene.time, output, &self.solver.get_all("T")?));
        }
        Ok(self.identity.clone().unwrap_or_default())
    }

    /// What a snapshot has otherwise than this run would leave it; none where it is its own.
    fn difference(&mut self, output: &Output, snapshot: &Snapshot) -> Result<Option<String>> {
        if let Some(what) = self.solver.difference(snapshot)? {
            return Ok(Some(what));
        }
        let own = self.identity(output)?;
        let other = snapshot.notes.iter().find(|(name, _)| name == identity::NOTE).map(|(_, text)| text.as_str());
        let Some(other) = other else { return Ok(Some("it does not say of which scene it is".into())) };
        let compared = identity::compare(&own, other);
        self.remarks.extend(compared.harmless);
        Ok(compared.different)
    }

    /// The step that ends at this time.
    fn step_at(&self, time: f64, file: &Path) -> Result<u32> {
        let span = self.scene.time.end - self.start;
        let step = ((time - self.start) / span * f64::from(self.scene.time.steps)).round();
        // Steps end where they do to rounding.
        if (0.0..=f64::from(self.scene.time.steps)).contains(&step)
            && (self.end_of(step as u32) - time).abs() < 1e-9 * span
        {
            return Ok(step as u32);
        }
        let rule = format!(
            "no step of the scene ends there, at t = {time}; give [time] as it was, or another folder by --out"
        );
        Err(Error::bad("--continue", format!("'{}'", file.display()), &rule))
    }
}

/// The snapshot of an entry, if it is the one that was listed.
fn read_last(last: &Entry, file: &Path) -> Result<Snapshot> {
    let snapshot = io::read(file)?;
    match snapshot.time {
        Some(time) if time == last.time => Ok(snapshot),
        time => {
            let time = time.map_or("no time".into(), |time| format!("t = {time}"));
            let reason = format!("it is of {time}, and listed at t = {}", last.time);
            Err(Error::BadFile { path: file.display().to_string(), reason })
        }
    }
}

/// A last snapshot that cannot be read, with what to do about it.
fn unusable(error: Error, list: &Path) -> Error {
    let list = list.display();
    let advice = format!(
        "it is the last that '{list}' lists: bring it back, or take its line out of that list to go on from the one before; \
         without --continue the run starts anew"
    );
    match error {
        Error::Io { path, reason } => Error::Io { path, reason: format!("{reason}; {advice}") },
        other => io::advised(other, &advice),
    }
}
