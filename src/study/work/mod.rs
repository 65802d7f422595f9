//! What accuracy costs: error against run time and against pair operations, for every choice on one scene.

mod choices;
mod front;
mod reference;

use super::mode::{Cloud, JITTER_2D, JITTER_3D};
use super::page::Page;
use super::plot::{Axis, Plot, Style};
use super::request::Request;
use super::run::Study;
use super::scene::Scene;
use super::table::{Cell, Table, column, short};
use crate::error::Result;
use crate::solver::recommend::refused;
pub use choices::Choice;
use choices::choices;
pub use front::front;
use front::recommend;
pub use reference::Reference;
use std::path::{Path, PathBuf};

/// What a choice gave.
#[derive(Debug, Clone)]
pub struct Point {
    pub choice: Choice,
    pub particles: usize,
    pub neighbours: f64,
    /// Relative l2; no number where the choice was refused or diverged.
    pub error: f64,
    /// From particles to answer, neighbours and weights included.
    pub seconds: f64,
    /// Applications of the operator times pairs.
    pub pairs: f64,
}

impl Point {
    fn refused(choice: Choice) -> Point {
        Point { choice, particles: 0, neighbours: 0.0, error: f64::NAN, seconds: f64::NAN, pairs: f64::NAN }
    }
}

/// A relative error from which nothing of the solution is left: the choice diverged.
const DIVERGED: f64 = 10.0;

/// Runs shorter than this, s, are repeated once: the first touches cold memory.
pub const SHORT: f64 = 0.1;

/// # Errors
/// Whatever is wrong with the scene. A choice that is refused is no error but a row without one.
pub fn run(mut request: Request) -> Result<Page> {
    let mut page = Page::new("work-precision", "Error against run time: what accuracy costs");
    let scenes: Vec<(String, Scene, Vec<u32>)> = match &request.scene {
        Some(path) => vec![(path.display().to_string(), Scene::read(path)?, Vec::new())],
        None => built_in(&request)?,
    };
    let folder = request.scene.as_ref().and_then(|s| s.parent().map(PathBuf::from)).unwrap_or_default();
    let share = scenes.len();
    for (k, (name, scene, sizes)) in scenes.into_iter().enumerate() {
        let (points, reference) = measure(&mut page, &mut request, &scene, &folder, &sizes, (k, share))?;
        show(&mut page, &name, k, &points, &reference);
        if !page.complete {
            break;
        }
    }
    Ok(page)
}

/// The work item that particle codes are compared on, in 3-D and in 2-D.
fn built_in(request: &Request) -> Result<Vec<(String, Scene, Vec<u32>)>> {
    let space = request.pick(vec![6, 8], vec![8, 12, 16, 20], vec![8, 12, 16, 24, 32, 48]);
    let plane = request.pick(vec![8, 16], vec![16, 32, 64], vec![16, 32, 64, 128, 256]);
    let make = |(cloud, sizes): (Cloud, Vec<u32>)| {
        let mut scene = cloud.scene(16, "")?;
        scene.time.steps = 10;
        Ok((cloud.name.to_string(), scene, sizes))
    };
    [(JITTER_3D, space), (JITTER_2D, plane)].into_iter().map(make).collect()
}

fn measure(
    page: &mut Page,
    request: &mut Request,
    scene: &Scene,
    folder: &Path,
    sizes: &[u32],
    (part, parts): (usize, usize),
) -> Result<(Vec<Point>, Reference)> {
    let mut scene = scene.clone();
    scene.output = None;
    let choices = choices(&scene, sizes, request);
    let reference = Reference::of(&scene, folder, &choices)?;
    let goes_on = |done: usize| request.goes_on(part * choices.len() + done, parts * choices.len());
    let points = points(&scene, folder, &choices, &reference, goes_on)?;
    page.complete &= points.len() == choices.len();
    Ok((points, reference))
}

/// What each choice gives, as far as `goes_on` lets them.
///
/// # Errors
/// Whatever is wrong with the scene. A choice that is refused is a point without an error.
pub fn points(
    scene: &Scene,
    folder: &Path,
    choices: &[Choice],
    reference: &Reference,
    mut goes_on: impl FnMut(usize) -> bool,
) -> Result<Vec<Point>> {
    let wanted = choices.iter().enumerate().take_while(|(done, _)| goes_on(*done));
    wanted.map(|(_, choice)| try_once_or_twice(scene, folder, choice, reference)).collect()
}

fn try_once_or_twice(scene: &Scene, folder: &Path, choice: &Choice, reference: &Reference) -> Result<Point> {
    let first = try_once(scene, folder, choice, reference)?;
    if first.seconds > SHORT || first.error.is_nan() {
        return Ok(first);
    }
    let second = try_once(scene, folder, choice, reference)?;
    Ok(if second.seconds < first.seconds { second } else { first })
}

fn try_once(scene: &Scene, folder: &Path, choice: &Choice, reference: &Reference) -> Result<Point> {
    let study = Study::new(choice.put_into(scene), folder).and_then(|study| reference.known_to(study, choice));
    let report = study.and_then(|study| study.run(Path::new(""), Box::new(|_| true)));
    let choice = choice.clone();
    let report = match report {
        Ok(report) => report,
        Err(e) if refused(&e) => return Ok(Point::refused(choice)),
        Err(e) => return Err(e),
    };
    let error = report.accuracy.map_or(f64::NAN, |a| a.l2);
    if error.is_nan() || error >= DIVERGED {
        return Ok(Point::refused(choice));
    }
    let seconds = report.seconds.setup + report.seconds.solve;
    let (particles, neighbours) = (report.particles, report.neighbours);
    let pairs = report.work.applications as f64 * particles as f64 * neighbours;
    Ok(Point { choice, particles, neighbours, error, seconds, pairs })
}

const NAMES: [(&str, &str); 2] = [("points", "front"), ("points_2", "front_2")];

fn show(page: &mut Page, scene: &str, index: usize, points: &[Point], reference: &Reference) {
    let best = front(points, |p| p.seconds);
    let (all, few) = NAMES[index.min(NAMES.len() - 1)];
    page.tables.push(table(Table::new(few, &[]).of(scene), &best));
    page.tables.push(table(Table::long(all, &[]).of(scene), &points.iter().collect::<Vec<_>>()));
    page.plots.push(plot(scene, "seconds from particles to answer", points, |p| p.seconds));
    page.plots.push(plot(scene, "pair operations", points, |p| p.pairs));
    let lost = points.iter().filter(|p| p.error.is_nan()).count();
    page.find(format!(
        "{scene}: {} choices tried, {lost} refused by the solver or its operator, or diverged",
        points.len()
    ));
    let doubt = reference.about().map_or(0.0, |(_, error)| error);
    if let Some((name, error)) = reference.about() {
        page.find(format!(
            "{scene}: no exact solution is named; the reference, {name}, may be wrong by {}",
            short(error)
        ));
    }
    page.findings.extend(recommend(points, doubt).into_iter().map(|sentence| format!("{scene}: {sentence}")));
}

pub fn table(mut table: Table, points: &[&Point]) -> Table {
    let names = ["operator", "kernel", "h_fac", "integrator", "n", "particles", "neighbours", "l2"];
    table.columns = names.map(|name| column(name, "")).into();
    table.columns.extend([column("run time", "s"), column("pair operations", "")]);
    for p in points {
        let Choice { operator, kernel, h_fac, integrator, n } = &p.choice;
        let words: [Cell; 4] = [(*operator).into(), (*kernel).into(), (*h_fac).into(), (*integrator).into()];
        let counts: [Cell; 2] = [(n.unwrap_or(0) as usize).into(), p.particles.into()];
        let numbers = [p.neighbours, p.error, p.seconds, p.pairs].map(Cell::Number);
        table.rows.push(words.into_iter().chain(counts).chain(numbers).collect());
    }
    table
}

/// All points by operator, and the front.
pub fn plot(scene: &str, cost: &str, points: &[Point], of: fn(&Point) -> f64) -> Plot {
    let mut plot = Plot::new(format!("{scene}: error against {cost}"), Axis::log(cost), Axis::log("relative l2 error"));
    let mut operators: Vec<&str> = points.iter().map(|p| p.choice.operator).collect();
    operators.dedup();
    for operator in operators {
        let own = points.iter().filter(|p| p.choice.operator == operator);
        plot.add(operator, Style::Points, own.map(|p| (of(p), p.error)).collect());
    }
    plot.add("front", Style::Front, front(points, of).into_iter().map(|p| (of(p), p.error)).collect());
    plot
}
