//! From a scene to a solver: particles, quantities, marks.

use super::exact::{self, Exact};
use super::scene::{Numbers, Particles, Periodic, Scene, Value, Where};
use super::{choose, glass, lattice};
use crate::array::Strided;
use crate::error::{Error, Result};
use crate::io::{self, Snapshot};
use crate::model::conductivity::LAWS;
use crate::model::fields::{self, NUMBERS};
use crate::solver::Solver;
use crate::space::surface;
use std::collections::BTreeMap;
use std::path::Path;

/// A scene's particles, ready to be stepped.
pub struct Made {
    pub solver: Solver,
    pub exact: Option<Exact>,
    /// What was taken from where, in words, where a reader of the scene may not expect it.
    pub remarks: Vec<String>,
}

pub fn setup(scene: &Scene, folder: &Path) -> Result<(Solver, Option<Exact>)> {
    make(scene, folder).map(|made| (made.solver, made.exact))
}

/// The same, with what is to be said about it.
///
/// # Errors
/// Whatever is wrong with the scene or its files.
pub fn make(scene: &Scene, folder: &Path) -> Result<Made> {
    let solver = Solver::new(&scene.words)?;
    let mut setup = Setup {
        scene,
        snapshot: None,
        exact: None,
        x: Vec::new(),
        cell: None,
        start: 0.0,
        remarks: Vec::new(),
        solver,
    };
    known(scene.set.keys().chain(scene.mark.iter().flat_map(|mark| mark.set.keys())))?;
    setup.space()?;
    setup.particles(folder)?;
    setup.start()?;
    setup.exact = setup.find_exact()?;
    setup.quantities()?;
    for (number, mark) in scene.mark.iter().enumerate() {
        setup.weigh()?;
        let chosen = setup.chosen(&mark.place)?;
        if mark.set.is_empty() || !chosen.contains(&true) {
            return Err(setup.idle(number, mark.set.is_empty()));
        }
        for (name, value) in &mark.set {
            setup.mark(name, value, &chosen)?;
        }
    }
    setup.weigh()?;
    Ok(Made { solver: setup.solver, exact: setup.exact, remarks: setup.remarks })
}

/// Every name is that of a quantity that can be set.
fn known<'a>(names: impl Iterator<Item = &'a String>) -> Result<()> {
    for name in names {
        match name.as_str() {
            "time" => return Err(Error::bad("time", "in [set]", "start = … in [time] sets it")),
            name if NUMBERS.iter().any(|n| n.name == name) => {}
            name => drop(fields::slot(name)?),
        }
    }
    Ok(())
}

struct Setup<'a> {
    scene: &'a Scene,
    snapshot: Option<Snapshot>,
    exact: Option<Exact>,
    /// `dim` coordinates per particle, as they were given.
    x: Vec<f64>,
    /// Volume of a particle of a lattice.
    cell: Option<f64>,
    /// The time at which it starts.
    start: f64,
    remarks: Vec<String>,
    solver: Solver,
}

impl Setup<'_> {
    fn space(&mut self) -> Result<()> {
        match &self.scene.space {
            Some(space) => self.solver.set_box(&space.lo, &space.hi, &self.periodic()),
            None => Ok(()),
        }
    }

    fn periodic(&self) -> Vec<bool> {
        match self.scene.space.as_ref().map(|s| &s.periodic) {
            Some(Periodic::Each(each)) => each.clone(),
            Some(Periodic::All(all)) => vec![*all; self.solver.dim()],
            None => vec![false; self.solver.dim()],
        }
    }

    /// When it starts: as the scene says, or else its file, or at 0.
    fn start(&mut self) -> Result<()> {
        let (said, file) = (self.scene.time.start, self.snapshot.as_ref().and_then(|s| s.time));
        self.start = said.or(file).unwrap_or(0.0);
        match (said, file) {
            (Some(said), Some(file)) if said != file => {
                self.remarks.push(format!("it starts at t = {said}, as the scene says; the file is of t = {file}"));
            }
            (None, Some(file)) if file != 0.0 => {
                self.remarks.push(format!("it starts at t = {file}, the time of the file"))
            }
            _ => {}
        }
        self.scene.check_end(self.start)?;
        self.solver.set_number("time", self.start)
    }

    /// Particles from a file. Of a snapshot's box, that of the scene takes the place.
    fn read_file(&mut self, path: &Path) -> Result<()> {
        let mut snapshot = io::read(path)?;
        // What the scene gives anew need not be usable in the file.
        snapshot.left_aside.retain(|l| !self.scene.set.contains_key(&l.name));
        if snapshot.points.is_empty() {
            let reason = "it holds no particles".into();
            return Err(Error::BadFile { path: path.display().to_string(), reason });
        }
        let before = self.solver.domain().clone();
        self.solver.set_snapshot(&snapshot).map_err(|e| io::in_file(path, e))?;
        let its = self.solver.domain().clone();
        if its != before && self.scene.space.is_some() {
            self.remarks.push("the [box] of the scene takes the place of the file's".into());
            self.space()?;
        } else if its != before {
            self.remarks.push("the box is that of the file".into());
        }
        self.remarks.extend(snapshot.told(|_| true).into_iter().map(|remark| format!("the file: {remark}")));
        let frame = self.solver.frame();
        self.remarks.extend(frame.about().map(|about| format!("the particles lie along {about}")));
        self.x = snapshot.points.iter().flat_map(|p| frame.inward(*p)).collect();
        self.snapshot = Some(snapshot);
        Ok(())
    }

    /// What is wrong with a mark that does nothing.
    fn idle(&self, number: usize, sets_nothing: bool) -> Error {
        let what = format!("[[mark]] {}", number + 1);
        if sets_nothing {
            return Error::bad(&what, "without effect", "its set = {} names no quantity");
        }
        let dim = self.solver.dim();
        let range = |axis: usize| {
            let all = self.x.iter().skip(axis).step_by(dim);
            let (low, high) = all.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(*v), high.max(*v)));
            format!("{} {low} to {high}", self.solver.frame().names()[axis])
        };
        let ranges: Vec<String> = (0..dim).map(range).collect();
        let rule = format!(
            "none of the {} particles fulfils all conditions of its where; they lie at {}",
            self.solver.len(),
            ranges.join(", ")
        );
        Error::bad(&what, "without particles", &rule)
    }

    /// (m/rho)^(1/nu)
    fn spacing(&mut self) -> Result<Vec<f64>> {
        let power = 1.0 / self.solver.dim() as f64;
        let (m, rho) = (self.solver.get_all("m")?, self.solver.get_all("rho")?);
        Ok(m.iter().zip(rho).map(|(m, rho)| (m / rho).powf(power)).collect())
    }

    fn particles(&mut self, folder: &Path) -> Result<()> {
        let dim = self.solver.dim();
        let Particles { file, lattice: name, n, jitter, seed, glass, made } = &self.scene.particles;
        if let Some(file) = file {
            self.read_file(&folder.join(file))?;
        } else if let (Some(name), Some(n), Some(space)) = (name, n, &self.scene.space) {
            let volume: f64 = space.lo.iter().zip(&space.hi).map(|(lo, hi)| hi - lo).product();
            let cell = |x: &[f64]| volume * dim as f64 / x.len() as f64;
            self.x = match made {
                Some(made) => made.to_vec(),
                None => {
                    let mut x = lattice::find(name, dim)?.fill(&space.lo, &space.hi, *n as usize)?;
                    let spacing = cell(&x).powf(1.0 / dim as f64);
                    lattice::jitter(&mut x, jitter * spacing, *seed);
                    if *glass {
                        self.needs_periodic("particles.glass")?;
                        glass::relax(&mut x, &space.lo, &space.hi)?;
                    }
                    x
                }
            };
            let cell = cell(&self.x);
            self.solver.set_particles(Strided::new("x", &self.x, self.x.len() / dim, dim, dim)?)?;
            self.cell = Some(cell);
        }
        Ok(())
    }

    fn needs_periodic(&self, what: &str) -> Result<()> {
        match self.periodic().iter().all(|periodic| *periodic) {
            true => Ok(()),
            false => Err(Error::bad(what, true, "it needs a box that is periodic along every axis")),
        }
    }

    fn find_exact(&self) -> Result<Option<Exact>> {
        let Some(wanted) = &self.scene.exact else { return Ok(None) };
        let numbers = |numbers: &Numbers| match numbers {
            Numbers::One(one) => vec![*one],
            Numbers::List(list) => list.clone(),
        };
        let given = wanted.parameters.iter().map(|(name, values)| (name.clone(), numbers(values))).collect();
        let number = |(name, value): (&String, &Value)| match value {
            Value::Number(v) => Some((name.clone(), *v)),
            _ => None,
        };
        let material: BTreeMap<String, f64> = self.scene.set.iter().filter_map(number).collect();
        exact::find(&wanted.name, self.solver.dim(), given, &material).map(Some)
    }

    fn quantities(&mut self) -> Result<()> {
        let set = &self.scene.set;
        if self.cell.is_some() && !set.contains_key("rho") {
            self.solver.set_number("rho", 1.0)?;
        }
        for (name, value) in set {
            match value {
                Value::Number(v) => self.solver.set_number(name, *v)?,
                Value::Flag(on) => self.solver.set_number(name, f64::from(*on))?,
                Value::Text(text) if is_law(name, text) => self.solver.set_law(name, text)?,
                Value::Text(text) => {
                    let values = self.array(name, text)?;
                    self.solver.set(name, Strided::packed(&values))?;
                }
            }
        }
        self.refuse_cells()?;
        if self.exact.is_some() && !set.contains_key("T") {
            let values = self.array("T", "exact")?;
            self.solver.set("T", Strided::packed(&values))?;
        }
        Ok(())
    }

    /// What every run needs, where the file has it for cells only and the scene does not give it.
    fn refuse_cells(&self) -> Result<()> {
        let Some(snapshot) = &self.snapshot else { return Ok(()) };
        let given = |name: &str| snapshot.field(name).is_some() || self.scene.set.contains_key(name);
        let of_cells = |name: &&str| snapshot.of_cells.iter().any(|cell| cell == name) && !given(name);
        let exact = |name: &&str| *name == "T" && self.exact.is_some();
        match ["T", "m", "kappa"].iter().find(|name| of_cells(name) && !exact(name)) {
            Some(name) => {
                let rule = "particles are points: make it an array of points (ParaView: Cell Data to Point Data)";
                Err(Error::bad(&format!("array '{name}' of the file"), "of cells", rule))
            }
            None => Ok(()),
        }
    }

    /// The masses of a lattice, rho times the volume of a particle, unless the scene sets them.
    fn weigh(&mut self) -> Result<()> {
        let Some(cell) = self.cell.filter(|_| !self.scene.set.contains_key("m")) else { return Ok(()) };
        match self.scene.set.get("rho") {
            // rho as an array of the solver is there only once masses are: start from any.
            _ if self.rho_varies() => {
                self.solver.set_number("m", cell)?;
                let m: Vec<f64> = self.solver.get_all("rho")?.iter().map(|rho| rho * cell).collect();
                self.solver.set("m", Strided::packed(&m))
            }
            Some(Value::Number(rho)) => self.solver.set_number("m", rho * cell),
            _ => self.solver.set_number("m", cell),
        }
    }

    fn rho_varies(&self) -> bool {
        let text = matches!(self.scene.set.get("rho"), Some(Value::Text(_)));
        text || self.scene.mark.iter().any(|mark| mark.set.contains_key("rho"))
    }

    /// What a text stands for, per particle: the exact solution at the start, or an array of the file.
    fn array(&self, name: &str, text: &str) -> Result<Vec<f64>> {
        if let Some(exact) = self.exact.as_ref().filter(|_| text == "exact") {
            return Ok(at_all(exact, &self.x, self.solver.dim(), self.start));
        }
        let file = self.scene.particles.file.as_deref().unwrap_or(Path::new(""));
        let usable = self.snapshot.as_ref().map_or(Ok(None), |s| s.usable(text));
        usable.map_err(|e| io::in_file(file, e))?;
        let fields = || self.snapshot.iter().flat_map(|s| &s.fields);
        let field = fields().find(|f| f.name == text).ok_or_else(|| {
            let laws = LAWS.iter().filter(|_| name == "kappa").map(|(law, _)| *law);
            let exact = self.exact.iter().map(|_| "exact");
            let known: Vec<&str> = fields().map(|f| f.name.as_str()).chain(exact).chain(laws).collect();
            if text.trim().parse::<f64>().is_ok() {
                return Error::bad(name, format!("'{text}'"), "it is in quotes: write the number without them");
            }
            if text == "exact" {
                let rule = "it starts from an exact solution: name one in [exact] ('list exact' shows them)";
                return Error::bad(name, "'exact'", rule);
            }
            if known.is_empty() {
                let rule = "a text names an array of the file, and the particles come from a lattice: give a number";
                return Error::bad(name, format!("'{text}'"), rule);
            }
            Error::unknown(&format!("array for {name}"), text, known)
        })?;
        if field.components != 1 {
            return Err(Error::bad(text, format!("{} components", field.components), "a quantity needs one"));
        }
        field.data.to_f64()
    }

    /// Sets a quantity of the chosen particles and leaves it as it is on the others.
    fn mark(&mut self, name: &str, value: &Value, chosen: &[bool]) -> Result<()> {
        let new = match value {
            Value::Number(v) => vec![*v; chosen.len()],
            Value::Flag(on) => vec![f64::from(*on); chosen.len()],
            Value::Text(text) if is_law(name, text) => {
                return Err(Error::bad(name, format!("'{text}'"), "a law is for all particles: put it in [set]"));
            }
            Value::Text(text) => self.array(name, text)?,
        };
        let mut values = self.solver.get_all(name)?;
        values.iter_mut().zip(&new).zip(chosen).filter(|(_, chosen)| **chosen).for_each(|((v, new), _)| *v = *new);
        self.solver.set(name, Strided::packed(&values))
    }

    fn chosen(&mut self, place: &Where) -> Result<Vec<bool>> {
        let mut chosen = choose::by_place(place, self.scene.space.as_ref(), &self.x, self.solver.frame())?;
        let mut keep = |holds: &dyn Fn(usize) -> bool| {
            chosen.iter_mut().enumerate().for_each(|(i, chosen)| *chosen &= holds(i));
        };
        match (&place.field, place.equals) {
            (Some(field), Some(value)) => {
                let values = self.array("where", field)?;
                keep(&|i| values[i] == value);
            }
            (None, None) => {}
            _ => return Err(Error::bad("where", "incomplete", "field and equals go together")),
        }
        if let Some(wanted) = place.surface {
            let spacing = self.spacing()?;
            let free = surface::free(self.solver.domain(), &self.x, &spacing)?;
            keep(&|i| free[i] == wanted);
        }
        Ok(chosen)
    }
}

/// An exact solution at every particle.
pub fn at_all(exact: &Exact, x: &[f64], dim: usize, t: f64) -> Vec<f64> {
    let place = |p: &[f64]| std::array::from_fn(|a| p.get(a).copied().unwrap_or(0.0));
    x.chunks(dim).map(|p| exact(place(p), t)).collect()
}

fn is_law(name: &str, text: &str) -> bool {
    let first = text.split_whitespace().next();
    name == "kappa" && LAWS.iter().any(|(law, _)| Some(*law) == first)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(more: &str) -> Scene {
        let text = format!(
            "words = \"heat dim=2 threads=1\"\n[box]\nlo = [0, 0]\nhi = [2, 1]\n[particles]\nlattice = \"square\"\nn = 20\n\
             [set]\nT = 1\nkappa = 2\nrho = 3\n[time]\nend = 1\n{more}"
        );
        Scene::parse("test", &text).unwrap()
    }

    fn solver(more: &str) -> Result<Solver> {
        setup(&scene(more), Path::new(".")).map(|(solver, _)| solver)
    }

    #[test]
    fn masses_fill_the_box_and_follow_rho() {
        let mut s = solver("").unwrap();
        assert_eq!(s.len(), 200);
        assert!((s.get_all("m").unwrap().iter().sum::<f64>() - 6.0).abs() < 1e-12);
        let mut s = solver("[[mark]]\nwhere = { x = [1, 2] }\nset = { rho = 5, kappa = 7 }").unwrap();
        let (m, kappa) = (s.get_all("m").unwrap(), s.get_all("kappa").unwrap());
        assert!((m.iter().sum::<f64>() - 8.0).abs() < 1e-12);
        assert_eq!(kappa.iter().filter(|k| **k == 7.0).count(), 100);
    }

    #[test]
    fn conditions_choose_together() {
        let fixed = |place: &str| -> usize {
            let mut s = solver(&format!("[[mark]]\nwhere = {place}\nset = {{ fixed = true }}")).unwrap();
            s.get_all("fixed").unwrap().iter().filter(|f| **f != 0.0).count()
        };
        assert_eq!(fixed("{}"), 200);
        assert_eq!(fixed("{ x = [0, 0.5], y = [0.5, 1] }"), 25);
        assert_eq!(fixed("{ r = [0, 0.11], centre = [1, 0.5] }"), 4);
        // Away from the corners, the lowest and the highest row.
        assert_eq!(fixed("{ surface = true, x = [0.5, 1.5] }"), 20);
        assert_eq!(fixed("{ surface = false, x = [0.5, 1.5] }"), 80);
    }

    #[test]
    fn a_glass_needs_a_periodic_box() {
        let mut open = scene("");
        (open.particles.glass, open.particles.jitter) = (true, 0.3);
        let text = setup(&open, Path::new(".")).err().unwrap().to_string();
        assert!(text.contains("periodic along every axis"), "{text}");
    }

    #[test]
    fn what_a_scene_cannot_mean_is_said() {
        for (more, expected) in [
            ("[[mark]]\nwhere = {}\nset = { kapa = 1 }", "did you mean 'kappa'"),
            ("[[mark]]\nwhere = {}\nset = { grad_T = 1 }", "computed"),
            ("[[mark]]\nwhere = { z = [0, 1] }\nset = { T = 1 }", "dim=2"),
            ("[[mark]]\nwhere = { field = \"type\" }\nset = { T = 1 }", "go together"),
            ("[[mark]]\nwhere = {}\nset = { kappa = -1 }", "kappa[0] is -1"),
            ("[[mark]]\nwhere = {}\nset = { kappa = \"power n=2\" }", "for all particles"),
            ("[[mark]]\nwhere = {}\nset = { T = \"teperature\" }", "come from a lattice"),
            ("[[mark]]\nwhere = {}\nset = { T = \"300\" }", "without them"),
            ("[[mark]]\nwhere = {}\nset = {}", "[[mark]] 1 is without effect"),
            (
                "[[mark]]\nwhere = {}\nset = { T = 2 }\n[[mark]]\nwhere = { x = [3, 4] }\nset = { T = 1 }",
                "[[mark]] 2 is without particles; none of the 200",
            ),
            ("[[mark]]\nwhere = {}\nset = { emissivity = 5 }", "from 0 to 1"),
            ("[[mark]]\nwhere = {}\nset = { time = 1 }", "in [time]"),
            ("[[mark]]\nwhere = {}\nset = { kappa = \"pwer\" }", "did you mean 'power'"),
            ("[exact]\nname = \"sin\"", "did you mean 'sine'"),
            ("[exact]\nname = \"sine\"", "waves of sine is missing"),
        ] {
            let text = solver(more).err().map(|e| e.to_string()).unwrap_or_default();
            assert!(text.contains(expected), "{more}: {text}");
        }
    }
}
