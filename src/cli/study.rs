//! `diffusph study`: what the library knows about itself, measured again.

use super::{interrupt, print, progress};
use crate::error::{Error, Result};
use crate::io::atomic;
use crate::study::catalogue;
use crate::study::request::{Answer, Request};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
pub struct StudyArgs {
    /// Which study ('list studies' shows them)
    name: String,
    /// Report as JSON
    #[arg(long)]
    json: bool,
    /// Write its files into this folder as well: text, JSON, and where there are any tables (CSV), plots (SVG) and a page with all of it (HTML)
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// With more particles, and for as long as that takes
    #[arg(long)]
    full: bool,
    /// With as few particles as show that it works
    #[arg(long, hide = true, conflicts_with = "full")]
    tiny: bool,
    /// A scene of your own, for the study 'work-precision'
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
}

/// Runs a study and prints its answer; exit code 1 where something is not as it should be.
///
/// # Errors
/// `UnknownWord`, `Io`, `Cancelled`, and what the study itself answers.
pub fn run(args: &StudyArgs) -> Result<ExitCode> {
    let study = catalogue::find(&args.name)?;
    if let Some(scene) = args.scene.as_ref().filter(|_| !study.takes_scene) {
        let own = catalogue::STUDIES.iter().filter(|s| s.takes_scene).map(|s| s.name).collect::<Vec<_>>().join(", ");
        let rule = format!("the study '{}' has its own particles; a scene is for {own}", study.name);
        return Err(Error::bad("--scene", scene.display(), &rule));
    }
    interrupt::listen();
    if let Some(folder) = &args.out {
        // Before the work, which may take minutes.
        atomic::make_folder(folder)?;
    }
    let answer =
        (study.run)(Request { full: args.full, tiny: args.tiny, scene: args.scene.clone(), watch: progress::watch() })?;
    let json =
        serde_json::to_string_pretty(&answer.json).map_err(|e| Error::bad("--json", e, "report this, please"))?;
    if let Some(folder) = &args.out {
        write(folder, study.name, &answer, &json)?;
    }
    print(if args.json { json + "\n" } else { answer.text })?;
    if answer.stopped {
        return Err(Error::Cancelled);
    }
    Ok(if answer.failures == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn write(folder: &Path, name: &str, answer: &Answer, json: &str) -> Result<()> {
    let own = [("txt", answer.text.as_str()), ("json", json)].map(|(ending, text)| (format!("{name}.{ending}"), text));
    let more = answer.files.iter().map(|(file, text)| (file.clone(), text.as_str()));
    own.into_iter()
        .chain(more)
        .try_for_each(|(file, text)| atomic::replace(&folder.join(file), |sink| sink.write_all(text.as_bytes())))
}
