//! The program: what it is asked, what it answers, and how it ends.
//!
//! Exit codes: 0 done; 1 it failed (a file, the numbers, the machine, a study's finding); 2 it was asked something that it cannot mean
//! (a word, a key, an argument); 130 it was interrupted.

mod check;
mod interrupt;
mod list;
mod look;
mod progress;
mod study;

use crate::error::{Error, Result};
use crate::study::run::Study;
use crate::study::scene::Scene;
use clap::error::ContextKind;
use clap::{Args, CommandFactory, Parser, Subcommand};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Diffusion on SPH particles: runs scenes, shows what a run will do, lists what can be chosen, looks into files.
#[derive(Parser)]
#[command(name = "diffusph", version, arg_required_else_help = true)]
#[command(after_help = EXIT_CODES)]
struct Program {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run a scene and report its accuracy against its run time
    #[command(
        after_help = "Snapshots appear whole or not at all; Ctrl-C, or whatever else ends a run, leaves a series whose files are of the times that it lists. A rerun replaces the snapshots that an older run listed at its start or later; one that takes the place of another stands beside it first, as heat_0002.new.vtu.\n\n--continue takes only the same run up: the same particles, quantities, T at the start, [time] and [output]; title, threads, memory and encoding may be others."
    )]
    Run {
        #[command(flatten)]
        scene: SceneArgs,
        /// Report as JSON
        #[arg(long)]
        json: bool,
        /// Folder under which the scene's output goes
        #[arg(long, value_name = "DIR", default_value = ".")]
        out: PathBuf,
        /// Go on from the last snapshot there, to the same bits as without an interruption
        #[arg(long = "continue")]
        resume: bool,
    },
    /// Show what a run of a scene will do, and what it leaves out and why
    Plan {
        #[command(flatten)]
        scene: SceneArgs,
    },
    /// List what can be chosen: kernels, operators, integrators, fields, … ; without a name, all lists
    #[command(
        after_help = "'list scene' shows every key of a scene file, 'list demo' a scene to start from, 'list exact' every exact solution."
    )]
    List {
        /// Which list
        name: Option<String>,
    },
    /// Show what is in a particle file, and whether it can be used
    Check {
        /// A .vtu, .vtp, .pvtu, .pvtp or legacy .vtk file
        file: PathBuf,
    },
    /// Draw a quantity of a particle file, or of the last snapshot of a .pvd, as .svg
    Look {
        /// A file that 'check' takes, or a .pvd
        file: PathBuf,
        /// What to draw; of vectors their length
        #[arg(long, value_name = "NAME", default_value = "T")]
        field: String,
        /// Where three dimensions are cut along their third axis (default: the middle)
        #[arg(long, value_name = "PLACE", allow_negative_numbers = true)]
        at: Option<f64>,
        /// Where to (default: beside the file)
        #[arg(long, value_name = "FILE.svg")]
        out: Option<PathBuf>,
    },
    /// Print the manual page of the program, or of one of its commands: diffusph man | man -l -
    Man {
        /// Which command
        command: Option<String>,
    },
    /// Print what a shell completes: diffusph completions bash > ~/.local/share/bash-completion/completions/diffusph
    Completions {
        /// Which shell
        shell: clap_complete::Shell,
    },
    /// Measure accuracy, cost or stability ('list studies' shows how); exit code 1 where something is not as it should be
    Study(study::StudyArgs),
}

#[derive(Args)]
struct SceneArgs {
    /// Scene file ('list scene' shows its keys); without one, a scene that comes with the program
    scene: Option<PathBuf>,
    /// Replace or add words of the scene: --set "kernel=M4 operator=kernel"; may be repeated
    #[arg(long, value_name = "WORDS")]
    set: Vec<String>,
}

/// The scene that comes with the program.
const DEFAULT_SCENE: &str = include_str!("default.toml");

impl SceneArgs {
    fn study(&self) -> Result<Study> {
        let mut scene = match &self.scene {
            Some(path) => Scene::read(path)?,
            None => Scene::parse("the default scene", DEFAULT_SCENE)?,
        };
        scene.set_words(&self.set.join(" "))?;
        let folder = self.scene.as_deref().and_then(Path::parent);
        Study::new(scene, folder.unwrap_or(Path::new("")))
    }
}

/// Runs the program with the arguments of the process.
pub fn main() -> ExitCode {
    // No scene is called like an option, whatever clap's tip says.
    let program = Program::try_parse().unwrap_or_else(|mut error| {
        error.remove(ContextKind::Suggested);
        error.exit()
    });
    let scene = match &program.command {
        Command::Run { scene, .. } | Command::Plan { scene } => scene.scene.as_ref().map(|s| s.display().to_string()),
        _ => None,
    };
    let done = match program.command {
        Command::Run { scene, json, out, resume } => run(&scene, json, &out, resume).map(success),
        Command::Plan { scene } => scene.study().and_then(|mut study| print(study.plan()?.to_string())).map(success),
        Command::List { name } => list::text(name.as_deref()).and_then(print).map(success),
        Command::Check { file } => check::text(&file).and_then(print).map(success),
        Command::Look { file, field, at, out } => {
            look::draw(&look::Look { file: &file, field: &field, at, out: out.as_deref() }).and_then(print).map(success)
        }
        Command::Man { command } => manual(command.as_deref()).and_then(print).map(success),
        Command::Completions { shell } => print(completions(shell)).map(success),
        Command::Study(args) => study::run(&args),
    };
    match done {
        Ok(code) => code,
        Err(error) => {
            let message = match error {
                Error::Cancelled => "interrupted; what was written so far is complete".to_string(),
                _ => error.to_string(),
            };
            // Whatever is wrong with a scene, it is said of which.
            let of = scene.filter(|scene| !message.contains(scene.as_str()) && !matches!(error, Error::Cancelled));
            let of = of.map_or(String::new(), |scene| format!("{scene}: "));
            // Nobody is left to be told when standard error is closed too.
            let _ = writeln!(std::io::stderr(), "diffusph: {of}{message}");
            ExitCode::from(exit_code(&error))
        }
    }
}

/// A page of the manual, in roff.
fn manual(command: Option<&str>) -> Result<String> {
    let mut program = Program::command();
    program.build();
    let page = match command {
        None => program,
        Some(name) => {
            let known = program.get_subcommands().map(|c| c.get_name().to_string()).collect::<Vec<_>>();
            program.find_subcommand(name).cloned().ok_or_else(|| Error::unknown("command", name, known))?
        }
    };
    let mut text = Vec::new();
    let rendered = clap_mangen::Man::new(page).render(&mut text);
    rendered.map_err(|e| Error::Io { path: "the manual".into(), reason: e.to_string() })?;
    Ok(String::from_utf8_lossy(&text).into_owned())
}

fn completions(shell: clap_complete::Shell) -> String {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Program::command(), "diffusph", &mut text);
    String::from_utf8_lossy(&text).into_owned()
}

fn success((): ()) -> ExitCode {
    ExitCode::SUCCESS
}

fn run(args: &SceneArgs, json: bool, out: &Path, resume: bool) -> Result<()> {
    let mut study = args.study()?;
    if resume {
        study = study.resumed(out)?;
    }
    interrupt::listen();
    let report = study.run(out, progress::watch())?;
    if json {
        let text = serde_json::to_string_pretty(&report).map_err(|e| Error::bad("--json", e, "report this, please"))?;
        return print(text + "\n");
    }
    print(report.to_string())
}

/// To standard output. A reader that has seen enough, like `head`, is no failure.
fn print(text: String) -> Result<()> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::Io { path: "standard output".into(), reason: e.to_string() })
        }
        _ => Ok(()),
    }
}

/// What [`exit_code`] and studies answer; clap has 2 for arguments as well.
const EXIT_CODES: &str = "Exit codes: 0 done; 1 a step, a file or a study went wrong; 2 what was asked for is wrong or incomplete; 130 interrupted.

Start with 'diffusph run': it needs no file, and leaves a series for ParaView.";

fn exit_code(error: &Error) -> u8 {
    match error {
        Error::Cancelled => 130,
        Error::BadValue { .. }
        | Error::BadElement { .. }
        | Error::UnknownWord { .. }
        | Error::OutOfOrder { .. }
        | Error::WrongCount { .. }
        | Error::BoxTooSmall { .. } => 2,
        _ => 1,
    }
}
