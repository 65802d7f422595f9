//! The run of a scene: steps, snapshots, and what they took.

use super::exact::Exact;
use super::identity;
use super::report::{Accuracy, Energy, LeftOut, Report, Seconds, Temperature, Work};
pub use super::samples::Field;
use super::scene::{Output, Scene};
use super::setup::{Made, at_all, make};
use crate::error::Result;
use crate::io::{Series, atomic};
use crate::model::fields;
use crate::plan::Plan;
use crate::solver::Solver;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::Instant;

/// Inputs that let energy in or out.
const DOORS: &[&str] = &["fixed", "source", "flux_in", "h_conv", "emissivity"];

/// What T is held against.
pub enum Known {
    /// At a place and a time.
    Solution(Exact),
    /// Of each particle at the end, in the order of [`Study::places`].
    Values(Rc<Vec<f64>>),
}

/// Called with the share that is done; false stops the run.
pub type Watch = Box<dyn FnMut(f64) -> bool + Send>;

/// A scene that is ready to run.
pub struct Study {
    pub(super) scene: Scene,
    pub(super) solver: Solver,
    known: Option<Known>,
    /// What it is called.
    source: String,
    pub(super) remarks: Vec<String>,
    setup_seconds: f64,
    /// When the scene starts, and the step that the solver has come to.
    pub(super) start: f64,
    pub(super) done: Option<u32>,
    /// What its snapshots say of it, once T at the start was seen.
    pub(super) identity: Option<String>,
}

impl Study {
    /// Makes the particles of a scene; its files lie in `folder`.
    ///
    /// # Errors
    /// Whatever is wrong with the scene or its files.
    pub fn new(scene: Scene, folder: &Path) -> Result<Study> {
        let start = Instant::now();
        let Made { mut solver, exact, remarks } = make(&scene, folder)?;
        let begin = solver.get_number("time")?;
        let source = scene.exact.as_ref().map_or(String::new(), |e| e.name.clone());
        let known = exact.map(Known::Solution);
        let setup_seconds = start.elapsed().as_secs_f64();
        Ok(Study { scene, solver, known, source, remarks, setup_seconds, start: begin, done: None, identity: None })
    }

    /// When a step ends: from the ends of all rather than by adding up, so that the last one arrives at the end.
    pub(super) fn end_of(&self, step: u32) -> f64 {
        let time = &self.scene.time;
        self.start + (time.end - self.start) * f64::from(step) / f64::from(time.steps)
    }

    /// What a step will do.
    ///
    /// # Errors
    /// As [`Solver::plan`].
    pub fn plan(&mut self) -> Result<Plan> {
        self.solver.plan()
    }

    /// The same, held against a solution that the scene does not name.
    pub fn against(self, source: &str, known: Known) -> Study {
        Study { source: source.into(), known: Some(known), ..self }
    }

    pub fn dim(&self) -> usize {
        self.solver.dim()
    }

    /// Where the particles are; coordinates beyond dim are 0.
    ///
    /// # Errors
    /// As [`Solver::get`].
    pub fn places(&mut self) -> Result<Vec<[f64; 3]>> {
        let place = |p: &[f64]| std::array::from_fn(|axis| p.get(axis).copied().unwrap_or(0.0));
        Ok(self.solver.get_all("x")?.chunks(self.solver.dim()).map(place).collect())
    }

    /// Steps to the end, to what T is there as a function of place.
    ///
    /// # Errors
    /// As [`Solver::step`].
    pub fn field(mut self) -> Result<Field> {
        self.steps(None)?;
        Field::new(&mut self.solver)
    }

    /// Steps to the end, with snapshots under `out`.
    ///
    /// # Errors
    /// As [`Solver::step`]; `Io`; `Cancelled` when `watch` says so. Snapshots written until then are complete.
    pub fn run(mut self, out: &Path, watch: Watch) -> Result<Report> {
        // Before a folder is made.
        self.solver.ready("run")?;
        let callback = told(self.solver.get_number("time")?, self.scene.time.end, watch);
        self.solver.set_progress_callback(Some(callback));
        let isolated = is_isolated(&mut self.solver)?;
        let (energy, temperature) = (self.solver.get_number("energy")?, extrema(&mut self.solver)?);
        let mut writer = match self.scene.output.clone() {
            Some(output) => Some(Writer::new(self.identity(&output)?, output, out)?),
            None => None,
        };
        let work = self.steps(writer.as_mut())?;

        let solver = &mut self.solver;
        let accuracy = self.known.as_ref().map(|known| accuracy(&self.source, solver, known)).transpose()?;
        let (n, neighbours) = (solver.len() as f64, solver.get_number("mean_neighbours")?);
        let seconds = Seconds {
            setup: self.setup_seconds,
            solve: work.seconds,
            files: writer.as_ref().map_or(0.0, |w| w.seconds),
            passes: solver.spent().0.into_iter().map(|(name, s)| (name.to_string(), s)).collect(),
        };
        let left_out = solver.plan()?.left_out.into_iter();
        Ok(Report {
            title: self.scene.title,
            remarks: self.remarks,
            words: solver.words().to_string(),
            particles: solver.len(),
            dim: solver.dim(),
            neighbours,
            threads: solver.get_number("threads")? as usize,
            bytes: solver.get_number("bytes")?,
            time: solver.get_number("time")?,
            accuracy,
            energy: Energy::new(energy, solver.get_number("energy")?, absolute_energy(solver)?, isolated, work.heat),
            temperature_before: temperature,
            temperature: extrema(solver)?,
            ns_per_particle: seconds.per_application(&work, n),
            ns_per_pair: seconds.per_application(&work, n * neighbours),
            work,
            seconds,
            left_out: left_out
                .map(|r| LeftOut { rule: r.name, reason: r.reason, result: r.same.to_string() })
                .collect(),
            series: writer.as_ref().map(|w| w.pvd.display().to_string()),
            snapshots: writer.map_or(0, |w| w.count),
        })
    }

    fn steps(&mut self, mut writer: Option<&mut Writer>) -> Result<Work> {
        let (last, mut work) = (self.scene.time.steps, Work::default());
        let mut write = |solver: &mut Solver, step| match &mut writer {
            Some(writer) => writer.write(solver, step, last),
            None => Ok(()),
        };
        if self.done.is_none() {
            write(&mut self.solver, 0)?;
        }
        for step in self.done.unwrap_or(0) + 1..=last {
            let dt = self.end_of(step) - self.solver.get_number("time")?;
            work.add(&self.solver.step(dt)?);
            write(&mut self.solver, step)?;
        }
        Ok(work)
    }
}

/// From the solver's callback, which is told the time, to the share of the whole.
fn told(start: f64, end: f64, mut watch: Watch) -> crate::plan::report::Progress {
    Box::new(move |time, _| i32::from(!watch(((time - start) / (end - start)).clamp(0.0, 1.0))))
}

fn is_isolated(solver: &mut Solver) -> Result<bool> {
    for door in DOORS {
        if solver.get_all(door)?.iter().any(|v| *v != 0.0) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Σ |m c_v T|: what a change of energy is small against.
fn absolute_energy(solver: &mut Solver) -> Result<f64> {
    let (m, u) = (solver.get_all("m")?, solver.get_all("u")?);
    Ok(m.iter().zip(u).map(|(m, u)| (m * u).abs()).sum())
}

fn extrema(solver: &mut Solver) -> Result<Temperature> {
    Ok(Temperature { min: solver.get_number("T_min")?, max: solver.get_number("T_max")? })
}

/// The error of T where T is not fixed.
fn accuracy(solution: &str, solver: &mut Solver, known: &Known) -> Result<Accuracy> {
    let (dim, time) = (solver.dim(), solver.get_number("time")?);
    let known = match known {
        Known::Solution(exact) => Rc::new(at_all(exact, &solver.get_all("x")?, dim, time)),
        Known::Values(values) => Rc::clone(values),
    };
    let (t, fixed) = (solver.get_all("T")?, solver.get_all("fixed")?);
    let free =
        t.iter().zip(&*known).zip(&fixed).filter(|(_, fixed)| **fixed == 0.0).map(|((t, known), _)| (*t, *known));
    Ok(Accuracy::new(solution.to_string(), &free.collect::<Vec<_>>()))
}

/// Writes the series.
struct Writer {
    output: Output,
    /// What each snapshot says of the run.
    identity: String,
    pvd: PathBuf,
    series: Series,
    count: usize,
    seconds: f64,
}

impl Writer {
    fn new(identity: String, output: Output, out: &Path) -> Result<Writer> {
        output.fields.iter().try_for_each(|name| fields::field(name).map(drop))?;
        let pvd = out.join(&output.pvd);
        let folder = pvd.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        atomic::make_folder(folder)?;
        atomic::remove_stale(folder);
        let series = Series::open_or_create(&pvd)?;
        Ok(Writer { output, identity, pvd, series, count: 0, seconds: 0.0 })
    }

    /// Every so many steps, and at the end.
    fn write(&mut self, solver: &mut Solver, step: u32, last: u32) -> Result<()> {
        if u64::from(step) % self.output.every != 0 && step != last {
            return Ok(());
        }
        let start = Instant::now();
        let extra: Vec<&str> = self.output.fields.iter().map(String::as_str).collect();
        let notes = [(identity::NOTE, self.identity.as_str())];
        solver.write_with_notes(&mut self.series, self.output.encoding.into(), &extra, &notes)?;
        self.count += 1;
        self.seconds += start.elapsed().as_secs_f64();
        Ok(())
    }
}
