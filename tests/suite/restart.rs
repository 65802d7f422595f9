//! A run that is taken up from a snapshot goes on to the bit; what a snapshot cannot hold is refused; planes of files keep
//! their place.

use crate::particles::*;
use diffusph::io::{self, Data, Field, Series, Snapshot};
use diffusph::{Solver, Strided};
use std::path::Path;

fn all(s: &mut Solver) -> Vec<Vec<u64>> {
    let inputs = ["x", "T", "m", "rho", "h", "kappa", "c_v", "fixed", "source", "flux_in", "h_conv", "emissivity", "u"];
    let mut all: Vec<Vec<u64>> = inputs.iter().map(|name| bits(&s.get_all(name).unwrap())).collect();
    all.push(bits(&["time", "sigma_SB", "energy", "energy_defect"].map(|name| s.get_number(name).unwrap())));
    all
}

/// One scene: words, and what a host sets.
type Scene = (&'static str, fn(&mut Solver, &[f64]));

fn numbers(s: &mut Solver, _: &[f64]) {
    for (name, value) in
        [("rho", 1.3), ("kappa", 0.6), ("c_v", 4.18), ("source", 5.0), ("sigma_SB", 2e-9), ("time", 7.5)]
    {
        s.set_number(name, value).unwrap();
    }
}

fn walls(s: &mut Solver, x: &[f64]) {
    s.set_number("kappa", 1.0).unwrap();
    s.set_number("T_ambient", 3.0).unwrap();
    s.set_number("h_conv", 0.1 + 0.2).unwrap();
    set(s, "fixed", &field(x, 2, |p| f64::from(u8::from(p[0] < 0.1))));
    set(s, "emissivity", &field(x, 2, |p| if p[1] < 0.1 { 0.5 } else { 0.0 }));
}

fn law(s: &mut Solver, x: &[f64]) {
    set(s, "h", &field(x, 2, |p| 0.13 + 0.02 * p[0]));
    s.set_law("kappa", "table T=0,1.1,2,9 kappa=1,0.3,2,2").unwrap();
}

fn tensor(s: &mut Solver, x: &[f64]) {
    s.set_number("kappa_par", 1.0).unwrap();
    set(s, "b_x", &field(x, 2, |p| 1.0 + p[1]));
    s.set_number("b_y", 0.4).unwrap();
}

fn energies(s: &mut Solver, x: &[f64]) {
    s.set_number("kappa", 1.0).unwrap();
    set(s, "u", &field(x, 2, |p| 3.0 + (6.0 * p[0]).sin()));
    set(s, "c_v", &field(x, 2, |p| 1.0 + p[1]));
}

fn by_place(s: &mut Solver, x: &[f64]) {
    set(s, "kappa", &field(x, 2, |p| 0.5 + p[0]));
    set(s, "m", &field(x, 2, |p| 0.01 * (1.0 + 0.1 * p[1])));
}

const SCENES: &[Scene] = &[
    ("kernel=M4", numbers),
    ("kernel=C2 integrator=sdirk2", walls),
    ("kernel=M4 integrator=rkl2 tolerance=off", walls),
    ("kernel=M6", law),
    ("operator=two-first kernel=M4", tensor),
    ("kernel=M4 integrator=auto", energies),
    ("kernel=C2", by_place),
    ("kernel=C2 operator=consistent order=2 h_fac=1.9 allow=unstable,energy", by_place),
    ("kernel=C2 operator=consistent order=2 h_fac=1.9 allow=unstable,energy", |s, _| {
        s.set_number("kappa", 1.0).unwrap()
    }),
    ("kernel=M4 integrator=rkl2", by_place),
];

fn start((words, given): &Scene, x: &[f64]) -> Solver {
    let n = x.len() / 2;
    let mut s = Solver::new(&format!("heat dim=2 threads=1 {words}")).unwrap();
    s.set_box(&[0.0; 2], &[1.0; 2], &[true, false]).unwrap();
    s.set_particles(Strided::new("x", x, n, 2, 2).unwrap()).unwrap();
    s.set_number("m", 1.0 / n as f64).unwrap();
    set(&mut s, "T", &field(x, 2, |p| 2.0 + (std::f64::consts::TAU * p[0]).sin() * p[1]));
    given(&mut s, x);
    s
}

fn moved(x: &[f64], by: f64) -> Vec<f64> {
    x.chunks(2).flat_map(|p| [p[0] + by * (9.0 * p[1]).sin(), p[1]]).collect()
}

fn place(s: &mut Solver, x: &[f64]) {
    s.set_particles(Strided::new("x", x, x.len() / 2, 2, 2).unwrap()).unwrap();
}

#[test]
fn a_run_goes_on_from_its_snapshot_to_the_bit() {
    let x = lattice(12, 2, 0.3);
    let dir = tempfile::tempdir().unwrap();
    for (number, scene) in SCENES.iter().enumerate() {
        for moves in [false, true] {
            let file = dir.path().join(format!("{number}_{moves}.vtu"));
            let mut whole = start(scene, &x);
            let go = |s: &mut Solver, steps: std::ops::Range<u32>| {
                for k in steps {
                    if moves {
                        place(s, &moved(&x, 1e-3 * f64::from(k)));
                    }
                    s.step(2e-3 * f64::from(1 + k % 3)).unwrap();
                }
            };
            go(&mut whole, 0..3);
            whole.write_vtk(&file).unwrap();
            let mut again = Solver::new(whole.words()).unwrap();
            again.read_vtk(&file).unwrap();
            assert_eq!(all(&mut again), all(&mut whole), "{scene:?} as read", scene = scene.0);
            go(&mut whole, 3..6);
            go(&mut again, 3..6);
            assert_eq!(all(&mut again), all(&mut whole), "{} gone on, moves: {moves}", scene.0);
            // What was given stays what was given: c_v and rho act on the same things.
            for s in [&mut whole, &mut again] {
                s.set_number("c_v", 2.5).unwrap();
                s.set_number("rho", 1.1).unwrap();
                s.step(1e-3).unwrap();
            }
            assert_eq!(all(&mut again), all(&mut whole), "{} set anew, moves: {moves}", scene.0);
        }
    }
}

#[test]
fn a_restart_that_forgets_would_be_seen() {
    let (x, dir) = (lattice(12, 2, 0.3), tempfile::tempdir().unwrap());
    let file = dir.path().join("a.vtu");
    let mut whole = start(&SCENES[0], &x);
    whole.step(1e-3).unwrap();
    whole.write_vtk(&file).unwrap();
    // Without its notes the snapshot is that of another program: c_v, source and the box are lost, and h counts as given.
    let mut bare = io::read(&file).unwrap();
    bare.notes.clear();
    let mut again = Solver::new(whole.words()).unwrap();
    again.set_snapshot(&bare).unwrap();
    assert_ne!(all(&mut again), all(&mut whole));
    assert_eq!(again.get_number("time").unwrap(), whole.get_number("time").unwrap());
}

#[test]
fn reading_takes_the_place_of_what_was_set_before() {
    let (x, dir) = (lattice(12, 2, 0.3), tempfile::tempdir().unwrap());
    let file = dir.path().join("a.vtu");
    let mut whole = start(&SCENES[0], &x);
    whole.write_vtk(&file).unwrap();
    let mut other = start(&("kernel=M4", walls), &lattice(9, 2, 0.2));
    other.set_law("kappa", "power n=2.5").unwrap();
    other.set_source_callback(Some(Box::new(|_, _, _, _| 1)));
    other.step(1e-3).unwrap_err();
    other.read_vtk(&file).unwrap();
    assert_eq!(all(&mut other), all(&mut whole));
}

#[test]
fn a_snapshot_that_lived_on_a_function_wants_it_back() {
    let (x, dir) = (lattice(12, 2, 0.3), tempfile::tempdir().unwrap());
    let file = dir.path().join("a.vtu");
    let lend = |s: &mut Solver| {
        s.set_kappa_callback(Some(Box::new(|_, _, t, kappa| {
            kappa.iter_mut().zip(t).for_each(|(k, t)| *k = 1.0 + 0.1 * t);
            0
        })));
    };
    let mut whole = start(&SCENES[0], &x);
    lend(&mut whole);
    whole.step(1e-3).unwrap();
    whole.write_vtk(&file).unwrap();
    let mut again = start(&("kernel=M4", walls), &x);
    let before = all(&mut again);
    let error = again.read_vtk(&file).unwrap_err();
    assert!(error.name() == "OUT_OF_ORDER" && error.to_string().contains("set_kappa_callback"), "{error}");
    assert_eq!(all(&mut again), before);
    lend(&mut again);
    again.read_vtk(&file).unwrap();
    assert_eq!(all(&mut again), all(&mut whole));
}

#[test]
fn notes_that_cannot_be_meant_are_refused_and_change_nothing() {
    let (x, dir) = (lattice(6, 2, 0.3), tempfile::tempdir().unwrap());
    let file = dir.path().join("a.vtu");
    let mut s = start(&SCENES[0], &x);
    s.write_vtk(&file).unwrap();
    let good = io::read(&file).unwrap();
    let before = all(&mut s);
    for (note, text, says) in [
        ("given", "T m=0.1 dust=1", "no such quantity"),
        ("given", "T m=-1", "positive"),
        ("given", "T m=1 c_v", "without an array c_v"),
        ("given", "T m=1 kappa=x", "no number"),
        ("box", "lo=0 hi=1 periodic=1", "dimensions"),
        ("box", "lo=0,0 hi=0,0 periodic=1,1", "hi > lo"),
        ("history", "steps=1 moves=7", "moves"),
        ("law", "square n=2", "unknown law"),
        ("callbacks", "flux", "kappa and source"),
    ] {
        let mut wrong = good.clone();
        wrong.notes.retain(|(name, _)| name != note);
        wrong.notes.push((note.into(), text.into()));
        let error = s.set_snapshot(&wrong).unwrap_err().to_string();
        assert!(error.contains(says), "{note} {text}: {error}");
        assert_eq!(all(&mut s), before, "{note}");
    }
}

#[test]
fn what_a_legacy_file_of_ours_has_lost_is_said() {
    let (x, dir) = (lattice(6, 2, 0.3), tempfile::tempdir().unwrap());
    let mut s = start(&SCENES[0], &x);
    let told = ["a.vtk", "a.vtu"].map(|name| {
        s.write_vtk(dir.path().join(name)).unwrap();
        Solver::new("heat dim=2").unwrap().read_vtk(dir.path().join(name)).unwrap().join("; ")
    });
    assert!(told[0].contains("no place for the time, the box, laws") && told[0].contains(".vtu"), "{}", told[0]);
    assert_eq!(told[1], "");
}

#[test]
fn a_path_without_a_name_is_said_to_be_one() {
    let mut s = Solver::new("heat dim=2").unwrap();
    let errors = [s.read_vtk("").unwrap_err(), io::words(Path::new("")).unwrap_err(), Series::read("").unwrap_err()];
    for error in errors {
        assert!(error.name() == "BAD_VALUE" && error.to_string().contains("names no file"), "{error}");
    }
}

/// A plane of particles along two axes of three.
fn plane(axes: [usize; 2], rest: f64) -> Snapshot {
    let x = lattice(10, 2, 0.2);
    let mut points = vec![[rest; 3]; 100];
    points.iter_mut().zip(x.chunks(2)).for_each(|(p, x)| (p[axes[0]], p[axes[1]]) = (x[0], x[1]));
    let t = field(&x, 2, |p| 2.0 + p[0]);
    Snapshot {
        points,
        fields: vec![Field { name: "T".into(), components: 1, data: Data::F64(t) }],
        ..Snapshot::default()
    }
}

fn planar(snapshot: &Snapshot, words: &str) -> diffusph::error::Result<Solver> {
    let mut s = Solver::new(&format!("heat kernel=M4 threads=1 {words}"))?;
    s.set_snapshot(snapshot)?;
    s.set_number("m", 0.01)?;
    s.set_number("kappa", 1.0)?;
    Ok(s)
}

#[test]
fn a_plane_along_any_axes_is_the_same_plane_and_keeps_its_place() {
    let dir = tempfile::tempdir().unwrap();
    let run = |axes, rest| {
        let snapshot = plane(axes, rest);
        let mut s = planar(&snapshot, "dim=2").unwrap();
        s.step(1e-3).unwrap();
        let file = dir.path().join("a.vtu");
        s.write_vtk(&file).unwrap();
        assert_eq!(io::read(&file).unwrap().points, snapshot.points, "{axes:?}");
        let mut again = Solver::new(s.words()).unwrap();
        again.read_vtk(&file).unwrap();
        again.step(1e-3).unwrap();
        again.write_vtk(&file).unwrap();
        assert_eq!(io::read(&file).unwrap().points, snapshot.points, "{axes:?} read again");
        bits(&again.get_all("T").unwrap())
    };
    let usual = run([0, 1], 0.0);
    for (axes, rest) in [([0, 2], 0.0), ([1, 2], 0.0), ([0, 2], 5.0), ([0, 1], -3.0)] {
        assert_eq!(run(axes, rest), usual, "{axes:?} at {rest}");
    }
}

#[test]
fn particles_that_do_not_fill_their_space_are_refused_unless_the_host_insists() {
    let flat = plane([0, 2], 5.0);
    let refused = |words: &str| {
        let error = planar(&flat, words).unwrap().step(1e-3).unwrap_err();
        (error.name(), error.to_string())
    };
    let (name, text) = refused("dim=3");
    assert_eq!(name, "BAD_VALUE");
    for part in ["flat along y", "100 particles", "dim=2", "allow=flat"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    // Summed along one layer, rho is that of a ball of neighbours.
    let mut s = planar(&flat, "dim=3 allow=flat").unwrap();
    assert!(s.step(1e-3).unwrap_err().to_string().contains("give rho"));
    s.set_number("rho", 10.0).unwrap();
    assert!(s.step(1e-3).is_ok());
    // A host's own arrays are looked at in the same way, and T stays as it is.
    let row: Vec<f64> = (0..20).flat_map(|i| [f64::from(i) / 20.0, 0.5]).collect();
    let mut s = Solver::new("heat dim=2 threads=1").unwrap();
    place(&mut s, &row);
    [("m", 0.05), ("T", 1.0), ("kappa", 1.0)].iter().for_each(|(name, v)| s.set_number(name, *v).unwrap());
    assert!(s.plan().unwrap_err().to_string().contains("flat along y"));
    assert!(s.get_all("h").is_err() && s.get_all("T").is_ok());
    // Where images fill the axis, it is full.
    s.set_box(&[0.0; 2], &[1.0, 0.05], &[false, true]).unwrap();
    s.set_number("h", 0.07).unwrap();
    s.step(1e-4).unwrap();
    // Where they are out of reach, it is not.
    s.set_number("h", 0.01).unwrap();
    assert!(s.step(1e-4).unwrap_err().to_string().contains("flat along y"));
    s.set_number("h", 0.07).unwrap();
    // Thin is not flat.
    let thin: Vec<f64> = row.chunks(2).enumerate().flat_map(|(i, p)| [p[0], p[1] + 1e-6 * (i as f64).sin()]).collect();
    s.set_box(&[0.0; 2], &[1.0; 2], &[false; 2]).unwrap();
    place(&mut s, &thin);
    assert!(s.get_all("h").is_ok());
    // Too few to fill anything.
    place(&mut s, &[0.0, 0.0, 1.0, 0.0]);
    [("T", 1.0), ("h", 1.0)].iter().for_each(|(name, v)| s.set_number(name, *v).unwrap());
    s.step(1e-4).unwrap();
}

#[test]
fn more_dimensions_than_the_solver_has_are_refused() {
    let x = lattice(4, 3, 0.1);
    let solid = Snapshot { points: x.chunks(3).map(|p| [p[0], p[1], p[2]]).collect(), ..Snapshot::default() };
    let mut s = planar(&plane([0, 1], 0.0), "dim=2").unwrap();
    let before = bits(&s.get_all("x").unwrap());
    let error = s.set_snapshot(&solid).unwrap_err().to_string();
    assert!(error.contains("dim is 2") && error.contains("x, y, z") && error.contains("dim=3"), "{error}");
    assert_eq!(bits(&s.get_all("x").unwrap()), before);
}

#[test]
fn a_series_counts_on_and_touches_nothing_that_it_lists_already() {
    let dir = tempfile::tempdir().unwrap();
    let list = dir.path().join("run.pvd");
    let content = |name: &str| std::fs::read(dir.path().join(name)).unwrap();
    let mut s = planar(&plane([0, 1], 0.0), "dim=2").unwrap();
    for _ in 0..4 {
        s.write_series(&list).unwrap();
        s.step(1e-3).unwrap();
    }
    let before = [content("run_0000.vtu"), content("run_0001.vtu")];
    s.read_vtk(dir.path().join("run_0002.vtu")).unwrap();
    for _ in 0..3 {
        s.write_series(&list).unwrap();
        s.step(5e-4).unwrap();
    }
    let series = Series::read(&list).unwrap();
    let entries: Vec<(&str, f64)> = series.entries().iter().map(|e| (e.file.as_str(), e.time)).collect();
    let expected = [0.0, 1e-3, 2e-3, 2.5e-3, 3e-3];
    assert_eq!(entries.len(), 5);
    for (k, (file, time)) in entries.iter().enumerate() {
        assert_eq!(*file, format!("run_{k:04}.vtu"));
        assert!((time - expected[k]).abs() < 1e-15);
        assert_eq!(io::read(series.file_of(&series.entries()[k])).unwrap().time, Some(*time));
    }
    assert_eq!([content("run_0000.vtu"), content("run_0001.vtu")], before);
}

#[test]
fn names_that_no_tool_would_open_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let mut s = planar(&plane([0, 1], 0.0), "dim=2").unwrap();
    for name in ["e.vtp", "e.png", "e.pvd", "e.csv", "e.vtu.gz", "e", "vtu"] {
        let error = s.write_vtk(dir.path().join(name)).unwrap_err();
        assert!(error.name() == "BAD_VALUE" && error.to_string().contains(".vtu, or in .vtk"), "{name}: {error}");
    }
    let error = s.write_series(dir.path().join("e.vtu")).unwrap_err();
    assert!(error.to_string().contains(".pvd"), "{error}");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    for name in ["e.vtu", "E.VTK"] {
        s.write_vtk(dir.path().join(name)).unwrap();
    }
    let legacy = std::fs::read(dir.path().join("E.VTK")).unwrap();
    assert!(legacy.starts_with(b"# vtk DataFile") && Path::new("E.VTK").extension().is_some());
}

#[test]
fn particles_that_move_first_start_from_the_lengths_that_were_found() {
    let x = lattice(10, 2, 0.15);
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("a.vtu");
    let mut whole = start(&("kernel=M4", numbers), &x);
    whole.step(1e-4).unwrap();
    whole.write_vtk(&file).unwrap();
    let mut again = Solver::new(whole.words()).unwrap();
    again.read_vtk(&file).unwrap();
    for s in [&mut whole, &mut again] {
        place(s, &moved(&x, 1e-2));
        s.step(1e-3).unwrap();
    }
    assert_eq!(all(&mut again), all(&mut whole));
}

#[test]
fn a_step_that_fails_leaves_the_plan_as_it_was_and_a_file_without_particles_changes_nothing() {
    let x = lattice(10, 2, 0.15);
    let mut s = start(&("kernel=M4", numbers), &x);
    s.step(1e-4).unwrap();
    // What the failed step asked memory for may still be held.
    let plan = |s: &mut Solver| {
        let plan = s.plan().unwrap();
        let passes: Vec<_> = plan.passes.iter().map(|p| (p.pass.name.0, p.about.clone(), p.when)).collect();
        (plan.title.clone(), passes, plan.left_out.clone())
    };
    let before = plan(&mut s);
    s.step(1e300).unwrap_err();
    assert!(plan(&mut s) == before);
    let empty = diffusph::io::Snapshot::default();
    assert!(s.set_snapshot(&empty).unwrap_err().to_string().contains("no particles"));
    assert_eq!(s.len(), x.len() / 2);
}

/// One array of another program's, instead of T.
fn with_array(name: &str, components: usize, values: Vec<f64>) -> Snapshot {
    let named = Field { name: name.into(), components, data: Data::F64(values) };
    Snapshot { fields: vec![named], ..plane([0, 2], 5.0) }
}

#[test]
fn energies_of_another_program_s_file_are_temperatures_as_a_host_s_are() {
    let u: Vec<f64> = (0..100).map(|i| 3.0 + f64::from(i % 7)).collect();
    let c_v: Vec<f64> = (0..100).map(|i| 1.0 + f64::from(i % 3)).collect();
    let t: Vec<f64> = u.iter().zip(&c_v).map(|(u, c_v)| u / c_v).collect();
    // c_v before, in the file, or after.
    let mut file = with_array("u", 1, u.clone());
    let mut before = Solver::new("heat dim=2").unwrap();
    before.set_snapshot(&plane([0, 2], 5.0)).unwrap();
    set(&mut before, "c_v", &c_v);
    before.set_snapshot(&file).unwrap();
    assert_eq!((before.get_all("T").unwrap(), before.get_all("u").unwrap()), (t.clone(), u.clone()));
    let mut after = Solver::new("heat dim=2").unwrap();
    after.set_snapshot(&file).unwrap();
    assert_eq!(after.get_all("T").unwrap(), u);
    set(&mut after, "c_v", &c_v);
    assert_eq!(after.get_all("T").unwrap(), t);
    file.fields.push(Field { name: "c_v".into(), components: 1, data: Data::F64(c_v.clone()) });
    let mut inside = planar(&file, "dim=2").unwrap();
    assert_eq!(inside.get_all("T").unwrap(), t);
    inside.step(1e-3).unwrap();
    assert!(inside.get_all("T").unwrap() != t);
    // T that moved gives way to a new u, and to nothing but a number.
    inside.set_snapshot(&file).unwrap();
    assert_eq!(inside.get_all("T").unwrap(), t);
    let mut wrong = with_array("u", 1, u);
    wrong.fields[0].data = Data::F64(vec![f64::MAX; 100]);
    set(&mut inside, "c_v", &vec![1e-3; 100]);
    assert!(inside.set_snapshot(&wrong).is_err_and(|e| e.to_string().contains("u[0]")));
    assert_eq!(inside.get_all("T").unwrap(), t.iter().zip(&c_v).map(|(t, c)| t * c / 1e-3).collect::<Vec<_>>());
}

#[test]
fn directions_of_another_program_s_file_are_taken_along_the_axes_that_there_are() {
    let b: Vec<f64> = (0..100).flat_map(|i| [1.0, 99.0, f64::from(i)]).collect();
    let mut s = Solver::new("heat dim=2 operator=two-first").unwrap();
    s.set_snapshot(&with_array("b", 3, b)).unwrap();
    assert_eq!(s.get_all("b").unwrap(), (0..100).flat_map(|i| [1.0, f64::from(i)]).collect::<Vec<_>>());
}

#[test]
fn what_others_call_as_we_do_is_not_ours() {
    // Notes of another program; a velocity called u, with nothing that needs a temperature.
    let mut snapshot = plane([0, 2], 5.0);
    snapshot.notes.push(("given".into(), "by somebody else".into()));
    snapshot.fields.push(Field { name: "u".into(), components: 3, data: Data::F64(vec![1.0; 300]) });
    let mut s = Solver::new("heat dim=2").unwrap();
    s.set_snapshot(&snapshot).unwrap();
    assert_eq!(s.get_all("T").unwrap().len(), 100);
    snapshot.fields.remove(0);
    let mut without = Solver::new("heat dim=2").unwrap();
    without.set_snapshot(&snapshot).unwrap();
    assert!(without.get_all("T").unwrap_err().to_string().contains("set T"));
}

#[test]
fn lists_do_not_share_snapshots_nor_lose_what_is_listed_otherwise() {
    use std::os::unix::ffi::OsStrExt;
    let dir = tempfile::tempdir().unwrap();
    let mut s = planar(&plane([0, 1], 0.0), "dim=2").unwrap();
    for name in [&b"r\xe4.pvd"[..], b"r\xf6.pvd"] {
        let error = s.write_series(dir.path().join(std::ffi::OsStr::from_bytes(name))).unwrap_err();
        assert!(error.name() == "BAD_VALUE" && error.to_string().contains("Unicode"), "{error}");
    }
    assert!(s.write_series(dir.path().join("h.PVD")).unwrap_err().to_string().contains("end in .pvd"));
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    // One file, listed in two ways; the later entry goes, and the file stays.
    let list = dir.path().join("h.pvd");
    for time in [1.0, 5.0] {
        s.set_number("time", time).unwrap();
        s.write_series(&list).unwrap();
    }
    let entry = |time: f64, file: &str| format!("<DataSet timestep=\"{time}\" part=\"0\" file=\"{file}\"/>");
    for other in ["./h_0001.vtu".to_string(), dir.path().join("h_0001.vtu").display().to_string()] {
        let entries = entry(1.0, &other) + &entry(5.0, "h_0001.vtu");
        let text = format!("<VTKFile type=\"Collection\" version=\"0.1\"><Collection>{entries}</Collection></VTKFile>");
        std::fs::write(&list, text).unwrap();
        s.set_number("time", 2.0).unwrap();
        let written = s.write_series(&list).unwrap();
        assert!(dir.path().join("h_0001.vtu").is_file() && written.is_file(), "{other}");
        assert_eq!(Series::read(&list).unwrap().entries().len(), 2, "{other}");
    }
}
