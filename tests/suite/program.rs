//! The program, used as a user would.

use diffusph::io::{self, Series};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

pub fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_diffusph"))
}

fn repository(inside: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(inside)
}

fn scene(name: &str) -> PathBuf {
    repository("tests/scenes").join(name).with_extension("toml")
}

pub struct Answer {
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

pub fn ask(command: &mut Command) -> Answer {
    let Output { status, stdout, stderr } = command.stdin(Stdio::null()).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Answer { code: status.code(), out: text(stdout), err: text(stderr) }
}

/// Runs a scene and parses its report.
fn report(name: &str, out: &Path, more: &[&str]) -> Value {
    let answer = ask(program().args(["run", "--json", "--out"]).arg(out).arg(scene(name)).args(more));
    assert_eq!((answer.code, answer.err.as_str()), (Some(0), ""), "{name}");
    serde_json::from_str(&answer.out).unwrap()
}

pub fn write(folder: &TempDir, name: &str, text: &str) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn a_file_can_be_looked_at_without_paraview() {
    let folder = tempfile::tempdir().unwrap();
    let report = report("contact", folder.path(), &["--set", "threads=1"]);
    for (name, list) in [("contact", "out"), ("sine", "space")] {
        let text = std::fs::read_to_string(scene(name)).unwrap();
        let text = format!("{text}\n[output]\npvd = \"{list}.pvd\"\nfields = [\"flux\"]\n");
        let with_output = write(&folder, &format!("{name}.toml"), &text);
        assert_eq!(ask(program().args(["run", "--out"]).arg(folder.path()).arg(with_output)).code, Some(0));
    }
    let look = |more: &[&str]| ask(program().arg("look").current_dir(folder.path()).args(more));
    let answer = look(&["out.pvd"]);
    assert_eq!((answer.code, answer.err.as_str()), (Some(0), ""), "{}", answer.out);
    let drawn = answer.out.split(':').next().unwrap().to_string();
    let svg = std::fs::read_to_string(folder.path().join(&drawn)).unwrap();
    // Every particle, in more than one colour, and the extrema that the report states.
    assert_eq!(svg.matches("<circle").count(), report["particles"].as_u64().unwrap() as usize);
    let colours: std::collections::BTreeSet<&str> =
        svg.split("<circle").skip(1).filter_map(|c| c.split("fill=\"").nth(1)?.split('"').next()).collect();
    assert!(colours.len() > 5 && svg.contains("T [K]"), "{}", colours.len());
    for end in ["min", "max"] {
        let value = report["temperature"][end].as_f64().unwrap();
        assert!(answer.out.contains(&value.to_string()), "{end}: {value} is not in {}", answer.out);
    }
    // A cloud in space, cut: a tenth of what is there and less.
    let (middle, low) = (look(&["space.pvd", "--out", "a.svg"]), look(&["space.pvd", "--at", "0.1", "--out", "b.svg"]));
    let marks = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap().matches("<circle").count();
    assert!(middle.out.contains(", z = 0.5") && low.out.contains(", z = 0.1"), "{} {}", middle.err, low.err);
    assert!((50..2000).contains(&marks("a.svg")) && marks("b.svg") > 50, "{} {}", marks("a.svg"), marks("b.svg"));
    assert!(look(&["space.pvd", "--at", "7"]).err.contains("no particle is there"));
    // A vector's length, to a name of one's own; what others wrote.
    let answer = look(&["out.pvd", "--field", "flux", "--out", "flux.svg"]);
    assert!(answer.code == Some(0) && folder.path().join("flux.svg").is_file(), "{}", answer.err);
    let cloud = repository("tests/data/dam_break.vtu");
    let cloud = cloud.to_str().unwrap();
    for (more, says) in [
        (&["--field", "v", "--out", "cut.svg"][..], ""),
        (&["--field", "none", "--out", "cut.svg"], "array of the file 'none'"),
        (&["--field", "rho", "--out", "cut.png"], "must end in .svg"),
    ] {
        let answer = look(&[&[cloud], more].concat());
        assert!(answer.err.contains(says) && (answer.code == Some(0)) == says.is_empty(), "{more:?}: {}", answer.err);
    }
    for (file, more, says) in [
        ("out.pvd", &["--at", "0.5"][..], "there are fewer"),
        ("missing.vtu", &[], "missing.vtu"),
        ("contact.toml", &[], "contact.toml"),
    ] {
        let answer = look(&[&[file], more].concat());
        assert!(answer.code != Some(0) && answer.err.contains(says), "{file}: {}", answer.err);
    }
}

#[test]
fn the_manual_and_completions_know_every_command() {
    let help = ask(program().arg("--help")).out;
    let listed = help.split("Commands:").nth(1).unwrap().split("Options:").next().unwrap();
    let name = |line: &'_ str| {
        line.strip_prefix("  ")
            .filter(|l| !l.starts_with(' '))
            .map(|l| l.split(' ').next().unwrap_or_default().to_string())
    };
    let commands: Vec<String> = listed.lines().filter_map(name).collect();
    assert!(["run", "look"].iter().all(|c| commands.iter().any(|k| k == c)), "{commands:?}");
    let page = ask(program().arg("man"));
    assert!(page.code == Some(0) && page.out.starts_with(".ie"), "{}", page.out);
    for command in commands.iter().filter(|c| *c != "help") {
        assert!(page.out.contains(&format!("diffusph\\-{command}(1)")), "{command}");
        let own = ask(program().args(["man", command]));
        assert!(
            own.code == Some(0) && own.out.contains(&format!(".TH diffusph-{command} 1")),
            "{command}: {}",
            own.out
        );
    }
    let wrong = ask(program().args(["man", "rum"]));
    assert!(wrong.code == Some(2) && wrong.err.contains("did you mean 'run'"), "{}", wrong.err);
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let text = ask(program().args(["completions", shell])).out;
        assert!(commands.iter().all(|c| text.contains(c.as_str())) && text.contains("continue"), "{shell}");
    }
    // A real shell takes it.
    let bash = ask(program().args(["completions", "bash"])).out;
    let folder = tempfile::tempdir().unwrap();
    let file = write(&folder, "diffusph.bash", &bash);
    let script = format!(
        ". {} && COMP_WORDS=(diffusph loo) COMP_CWORD=1 && _diffusph diffusph loo diffusph && echo $COMPREPLY",
        file.display()
    );
    assert_eq!(ask(Command::new("bash").args(["-c", &script])).out.trim(), "look");
}

/// The bound on the l2 error of each scene with an exact solution, and where it comes from.
fn bound(name: &str) -> Option<f64> {
    Some(match name {
        // Brookshaw's error h² e4 k² of the rate, e4 = 0.075 for M4 in 3-D: 2.2 % of 1.18 e-foldings.
        "sine" => 3.0e-2,
        // The same law for every mode of the Gaussian: e4 h² t √24/s⁴ = 4.6e-3 with e4 = 0.121, h² = 9.6e-4, s² = 0.05.
        "gaussian" => 7.0e-3,
        // 0.8 % of 0.79 e-foldings, and as much again for the disorder.
        "glass_mode" => 1.5e-2,
        // A kink at the contact, smeared over h = 6e-3 of layers 0.1 wide: (h/l)² = 4e-3 of a part of the profile.
        "contact" => 1.0e-3,
        // T rises like a square root at the front, which 1 spacing of 0.05 cannot show on a radius of 1.8.
        "barenblatt" => 4.0e-2,
        // The face is half a spacing beyond the last particle: h d/(2 kappa) = 2 % of the loss, on a mean excess that is
        // about twice the spread.
        "cooling_slab" => 5.0e-2,
        // Likewise, half of 1/50 of the thickness for where the flux enters.
        "heated_slab" => 1.0e-2,
        // Second order on a lattice: (d/r)² = 7e-3 of T's second differences, a few per cent themselves.
        "shell" => 5.0e-4,
        _ => return None,
    })
}

#[test]
fn every_scene_runs_and_is_as_accurate_as_its_operator() {
    let out = tempfile::tempdir().unwrap();
    let mut compared = 0;
    for entry in std::fs::read_dir(repository("tests/scenes")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap();
        let report = report(name, out.path(), &[]);
        let number =
            |path: &str| report.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{name} {path}"));
        assert!(number("/seconds/solve") > 0.0 && number("/ns_per_particle") > 0.0 && number("/ns_per_pair") > 0.0);
        let count = |what: &str| report["work"][what].as_u64().unwrap();
        assert!(number("/bytes") > 0.0 && count("applications") >= count("substeps"), "{name}");
        assert!(report["left_out"].as_array().is_some_and(|rules| !rules.is_empty()), "{name}");
        if report["energy"]["isolated"] == true {
            // Rounding of one exchange per pair and application, which does not add up in one direction.
            assert!(number("/energy/relative").abs() < 1e-13, "{name}: {}", report["energy"]);
        }
        match bound(name) {
            Some(bound) => {
                assert!(number("/accuracy/l2") < bound, "{name}: {}", report["accuracy"]);
                compared += 1;
            }
            None => assert!(report["accuracy"].is_null() && name.starts_with("dam_break"), "{name} needs a bound"),
        }
    }
    assert_eq!(compared, 8);
}

#[test]
fn an_error_that_should_be_seen_is_seen() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(scene("sine")).unwrap();
    let wrong = write(&folder, "wrong.toml", &text.replace("name = \"sine\"", "name = \"sine\"\nkappa = 1.1"));
    let answer = ask(program().args(["run", "--json"]).arg(wrong));
    let report: Value = serde_json::from_str(&answer.out).unwrap();
    // 10 % of 1.18 e-foldings.
    assert!(report["accuracy"]["l2"].as_f64().unwrap() > 0.09, "{}", report["accuracy"]);
}

#[test]
fn words_of_the_command_line_win_over_those_of_the_scene() {
    let out = tempfile::tempdir().unwrap();
    let report = report("sine", out.path(), &["--set", "kernel=C4 operator=kernel", "--set", "threads=1"]);
    assert_eq!(report["words"], "heat dim=3 kernel=C4 operator=kernel threads=1");
    assert_eq!(report["threads"], 1);
}

#[test]
fn a_dam_break_at_a_hot_wall_loses_what_its_surfaces_give_away() {
    let out = tempfile::tempdir().unwrap();
    let energies = ["dam_break", "dam_break_free_surface", "dam_break_all_sides"].map(|name| {
        let report = report(name, out.path(), &[]);
        let t = |end: &str| report["temperature"][end].as_f64().unwrap();
        // The wall and the air bound T; rkl2 may exceed them by a small part of its first jump of 100 K.
        assert!(t("min") >= 299.9 && t("max") <= 400.1, "{name} {}", report["temperature"]);
        let series = Series::read(out.path().join(name).with_extension("pvd")).unwrap();
        assert_eq!(series.entries().iter().map(|e| e.time).collect::<Vec<_>>(), [0.0, 1e6, 2e6]);
        for entry in series.entries() {
            let snapshot = io::read(series.file_of(entry)).unwrap();
            assert_eq!((snapshot.points.len(), snapshot.time), (6518, Some(entry.time)));
            assert_eq!(snapshot.field("flux").unwrap().components, 3);
        }
        report["energy"]["after"].as_f64().unwrap()
    });
    assert!(energies[0] > energies[1] && energies[1] > energies[2], "{energies:?}");
}

#[test]
fn without_a_file_there_is_something_to_look_at() {
    let folder = tempfile::tempdir().unwrap();
    let start = Instant::now();
    let answer = ask(program().arg("run").current_dir(folder.path()));
    assert!(start.elapsed() < Duration::from_secs(10));
    // Nothing moves in a pipe: no bar, no colours.
    assert_eq!((answer.code, answer.err.as_str()), (Some(0), ""));
    assert!(!answer.out.contains('\x1b') && answer.out.contains("left out"), "{}", answer.out);
    let series = Series::read(folder.path().join("diffusph_demo/heat.pvd")).unwrap();
    assert_eq!(series.entries().len(), 21);
    let spreads = [0, 20].map(|at| {
        let snapshot = io::read(series.file_of(&series.entries()[at])).unwrap();
        let t = snapshot.field("T").unwrap().data.to_f64().unwrap();
        assert!(t.iter().all(|t| (300.0..=400.0).contains(t)));
        t.iter().copied().fold(0.0, f64::max) - t.iter().copied().fold(f64::MAX, f64::min)
    });
    assert!(spreads[0] == 100.0 && spreads[1] < 99.0, "{spreads:?}");
    // Nothing else was left behind, and a second run takes the place of the first.
    assert_eq!(std::fs::read_dir(folder.path().join("diffusph_demo")).unwrap().count(), 22);
    assert_eq!(ask(program().arg("run").current_dir(folder.path())).code, Some(0));
    assert_eq!(Series::read(folder.path().join("diffusph_demo/heat.pvd")).unwrap().entries().len(), 21);
}

#[test]
fn a_plan_says_what_runs_and_what_does_not() {
    let answer = ask(program().args(["plan", "--set", "without=same_h"]).arg(scene("sine")));
    assert_eq!((answer.code, answer.err.as_str()), (Some(0), ""));
    for expected in ["weights", "each stage", "left out", "at_rest", "without= says no", "13824 particles"] {
        assert!(answer.out.contains(expected), "{expected}: {}", answer.out);
    }
    assert_eq!(ask(program().arg("plan")).code, Some(0));
}

#[test]
fn every_list_can_be_seen() {
    let all = ask(program().arg("list"));
    assert_eq!(all.code, Some(0));
    for line in all.out.lines() {
        let name = line.split_whitespace().next().unwrap();
        let answer = ask(program().args(["list", name]));
        assert_eq!(answer.code, Some(0), "{name}");
        assert!(!answer.out.is_empty(), "{name}");
    }
    assert!(ask(program().args(["list", "scene"])).out.contains("jitter"));
    assert!(ask(program().args(["list", "exact"])).out.contains("barenblatt"));
}

#[test]
fn a_file_is_described_before_it_is_used() {
    let answer = ask(program().arg("check").arg(repository("tests/data/dam_break.vtu")));
    assert_eq!((answer.code, answer.err.as_str()), (Some(0), ""));
    for expected in ["6518 particles, 2-D", "still to be given in [set]: T, kappa", "Int32", "share one place"] {
        assert!(answer.out.contains(expected), "{expected}: {}", answer.out);
    }
    let folder = tempfile::tempdir().unwrap();
    let good = std::fs::read(repository("tests/data/glass_24.vtu")).unwrap();
    let half = folder.path().join("half.vtu");
    std::fs::write(&half, &good[..good.len() / 2]).unwrap();
    let odd = "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\"><UnstructuredGrid>\
               <Piece NumberOfPoints=\"2\" NumberOfCells=\"0\"><Points>\
               <DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 nan 0</DataArray>\
               </Points></Piece></UnstructuredGrid></VTKFile>";
    for (path, expected) in [
        (half, "half.vtu"),
        (write(&folder, "prose.vtu", "not a file of particles"), "prose.vtu"),
        (write(&folder, "odd.vtu", odd), "x[1] is NaN"),
        (folder.path().join("nowhere.vtu"), "nowhere.vtu"),
        // The system makes it up while it is read, and would wait for what comes next.
        ("/proc/kmsg".into(), "/proc/kmsg"),
    ] {
        let answer = ask(program().arg("check").arg(path));
        assert_eq!(answer.code, Some(1), "{expected}");
        assert!(answer.err.starts_with("diffusph: ") && answer.err.contains(expected), "{}", answer.err);
    }
}

#[test]
fn what_cannot_be_meant_is_answered_with_what_could_be() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(scene("gaussian")).unwrap();
    let changed = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        write(&folder, "changed.toml", &text.replace(from, to))
    };
    for (from, to, expected) in [
        ("lattice", "latice", "did you mean 'lattice'"),
        ("kappa = 1", "kapa = 1", "did you mean 'kappa'"),
        ("kappa = 1", "kappa = 1\nc_v = -1", "c_v"),
        ("kappa = 1", "", "kappa"),
        ("hexagonal", "hexagon", "did you mean 'hexagonal'"),
        ("name = \"gaussian\"", "name = \"gausian\"", "did you mean 'gaussian'"),
        ("s = 0.1", "s = 0.1\namplitud = 2", "did you mean 'amplitude'"),
        ("kernel=M6", "kernl=M6", "did you mean 'kernel'"),
        ("end = 0.02", "end = 0.02\nstep = 3", "did you mean 'steps'"),
        ("hi = [1, 1]", "hi = [1]", "hi has 1 values"),
        ("[time]", "[time", "line "),
        ("hi = [1, 1]", "hi = [1e308, 1]", "take fewer"),
        ("n = 60", "n = 1000000000", "take fewer"),
        ("n = 60", "n = 60\nglass = true", "give jitter"),
        ("[time]", "[[mark]]\nwhere = {}\nset = { c_v = -1 }\n[time]", "c_v[0] is -1"),
    ] {
        let answer = ask(program().arg("run").arg(changed(from, to)));
        assert_eq!((answer.code, answer.out.as_str()), (Some(2), ""), "{to}: {}", answer.err);
        assert!(answer.err.starts_with("diffusph: ") && answer.err.contains(expected), "{to}: {}", answer.err);
    }
    let sine = scene("sine");
    let sine = sine.to_str().unwrap();
    for (arguments, expected) in [
        (&["run", sine, "--set", "kernl=M4"][..], "did you mean 'kernel'"),
        (&["run", sine, "--set", "M4"], "key=value"),
        (&["list", "kernal"], "did you mean 'kernels'"),
        (&["rum"], "run"),
        (&["run", sine, "--set", "kernel=M4 kernel=M6"], "kernel is given twice"),
        (&["run", sine, "--set", "kernel=M4", "--set", "kernel=M6"], "kernel is given twice"),
        (&["run", sine, "--set", "h_fac=1e300"], "another h or h_fac"),
        (&["run", "--jsn"], "--json"),
        (&[], "Usage"),
    ] {
        let answer = ask(program().args(arguments));
        assert_eq!((answer.code, answer.out.as_str()), (Some(2), ""), "{arguments:?}");
        assert!(answer.err.contains(expected), "{arguments:?}: {}", answer.err);
    }
    let tip = ask(program().args(["plan", "--json"]));
    assert!(tip.code == Some(2) && !tip.err.contains("tip"), "{}", tip.err);
    for help in [&["--help"][..], &["run", "--help"], &["help", "check"], &["--version"]] {
        let answer = ask(program().args(help));
        assert_eq!((answer.code, answer.err.as_str()), (Some(0), ""), "{help:?}");
    }
}

#[test]
fn what_the_world_refuses_is_reported_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = write(&folder, "file", "in the way");
    for out in [file.join("below"), file.clone()] {
        let answer = ask(program().args(["run", "--out"]).arg(&out));
        assert_eq!((answer.code, answer.out.as_str()), (Some(1), ""));
        assert!(answer.err.contains("file"), "{}", answer.err);
    }
    let missing = ask(program().args(["run", "nowhere.toml"]).current_dir(folder.path()));
    assert_eq!(missing.code, Some(1));
    assert!(missing.err.contains("nowhere.toml"), "{}", missing.err);
    let text = std::fs::read_to_string(scene("dam_break")).unwrap();
    let lost = write(&folder, "lost.toml", &text.replace("../data/", "lost/"));
    let answer = ask(program().arg("run").arg(lost).current_dir(folder.path()));
    assert_eq!(answer.code, Some(1));
    assert!(answer.err.contains("dam_break.vtu"), "{}", answer.err);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
}

/// A scene on a square lattice, with these lines for [set], [time] and after.
#[test]
fn a_particle_file_is_no_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vtu");
    std::fs::write(&path, [0xff; 9]).unwrap();
    let answer = ask(program().arg("run").arg(path));
    assert!(answer.code == Some(1) && answer.err.contains("a scene is a text in TOML"), "{}", answer.err);
    assert!(answer.err.contains("a.vtu") && !answer.err.contains("particle was read"), "{}", answer.err);
}

fn square(set: &str, time: &str, more: &str) -> String {
    format!(
        "words = \"heat dim=2 kernel=M4 threads=1\"\n[box]\nlo = [0, 0]\nhi = [1, 1]\nperiodic = true\n[particles]\n\
         lattice = \"square\"\nn = 10\n[set]\n{set}\n[time]\n{time}\n[output]\npvd = \"out/a.pvd\"\n{more}"
    )
}

#[test]
fn a_scene_goes_on_from_a_snapshot_of_another() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, text: &str| {
        let path = write(&folder, name, text);
        let answer = ask(program().args(["run", "--json", "--out"]).arg(folder.path()).arg(path));
        assert_eq!((answer.code, answer.err.as_str()), (Some(0), ""), "{name}");
        serde_json::from_str::<Value>(&answer.out).unwrap()
    };
    let times = || {
        let series = Series::read(folder.path().join("out/a.pvd")).unwrap();
        series.entries().iter().map(|e| (e.file.clone(), e.time)).collect::<Vec<_>>()
    };
    let content = |name: &str| std::fs::read(folder.path().join("out").join(name)).unwrap();
    let set = "T = 300\nkappa = 1\nc_v = 3\nsource = 50";
    let mark = "[[mark]]\nwhere = { r = [0, 0.2], centre = [0.5, 0.5] }\nset = { T = 400 }";
    run("a.toml", &square(set, "end = 0.5\nsteps = 4", mark));
    let whole =
        (times(), ["a_0000.vtu", "a_0001.vtu"].map(content), io::read(folder.path().join("out/a_0004.vtu")).unwrap());
    // Neither quantities nor box nor start are said again.
    let again = "words = \"heat dim=2 kernel=M4 threads=1\"\n[particles]\nfile = \"out/a_0002.vtu\"\n[time]\nend = 0.5\n\
                 steps = 2\n[output]\npvd = \"out/a.pvd\"\n";
    let report = run("b.toml", again);
    assert!(
        report["remarks"].to_string().contains("starts at t = 0.25, the time of the file"),
        "{}",
        report["remarks"]
    );
    assert!(report["remarks"].to_string().contains("box is that of the file"), "{}", report["remarks"]);
    assert_eq!((times(), ["a_0000.vtu", "a_0001.vtu"].map(content)), (whole.0, whole.1));
    let end = io::read(folder.path().join("out/a_0004.vtu")).unwrap();
    assert!(end.fields == whole.2.fields && end.time == whole.2.time);
    // What the scene says wins, and is told.
    let other = again.replace("end = 0.5", "start = 0.3\nend = 0.5");
    let report = run("c.toml", &other.replace("[particles]", "[box]\nlo = [0, 0]\nhi = [2, 1]\n[particles]"));
    let remarks = report["remarks"].to_string();
    assert!(remarks.contains("t = 0.3, as the scene says; the file is of t = 0.25"), "{remarks}");
    assert!(remarks.contains("[box] of the scene takes the place"), "{remarks}");
    let late = write(&folder, "late.toml", &again.replace("end = 0.5", "end = 0.2"));
    let answer = ask(program().args(["run", "--out"]).arg(folder.path()).arg(late));
    assert!(answer.code == Some(2) && answer.err.contains("later than the start"), "{}", answer.err);
}

#[test]
fn what_a_scene_says_in_vain_is_refused_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let set = "T = 300\nkappa = 1";
    let mark = |place: &str| square(set, "end = 1", &format!("[[mark]]\nwhere = {place}\nset = {{ T = 400 }}"));
    let words = |words: &str| square(set, "end = 1", "").replace("kernel=M4", words);
    for (text, expected) in [
        (mark("{ r = [5, 6], centre = [0.5, 0.5] }"), "[[mark]] 1 is without particles; none of the 100"),
        (mark("{ surface = true }"), "without particles"),
        (mark("{ centre = [0.5, 0.5] }"), "give r"),
        (square("T = \"300\"\nkappa = 1", "end = 1", ""), "T is '300'; it is in quotes"),
        (square("T = 300\nkappa = 1\nemissivity = 5", "end = 1", ""), "emissivity is 5; it must be from 0 to 1"),
        (square("kappa = 1", "end = 1", ""), "run needs T"),
        (square("T = 300", "end = 1", ""), "run needs kappa"),
        (words("integrator=euler stages=5"), "stages is 5; it has no effect here"),
        (words("operator=consistent normalise=pair"), "normalise is pair; it has no effect here"),
    ] {
        let path = write(&folder, "a.toml", &text);
        let answer = ask(program().args(["run", "--out"]).arg(folder.path()).arg(path));
        assert_eq!((answer.code, answer.out.as_str()), (Some(2), ""), "{expected}: {}", answer.err);
        assert!(answer.err.contains(expected), "{expected}: {}", answer.err);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "{expected}: a folder is left");
    }
}

/// A file of points, as other programs write it.
fn points(folder: &TempDir, name: &str, points: &[[f64; 3]], more: &str) -> PathBuf {
    let n = points.len();
    let list: String = points.iter().flatten().map(|v| format!("{v:?} ")).collect();
    let text = format!(
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\"><UnstructuredGrid><Piece NumberOfPoints=\"{n}\" \
         NumberOfCells=\"1\"><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">{list}</DataArray>\
         </Points>{more}</Piece></UnstructuredGrid></VTKFile>"
    );
    write(folder, name, &text)
}

#[test]
fn files_that_cannot_be_meant_say_why() {
    let folder = tempfile::tempdir().unwrap();
    let none = points(&folder, "none.vtu", &[], "");
    let answer = ask(program().arg("check").arg(&none));
    assert!(answer.code == Some(1) && answer.err.contains("holds no particles"), "{}", answer.err);
    let scene = |file: &str, dim: usize| {
        let text = format!(
            "words = \"heat dim={dim} kernel=M4 threads=1\"\n[particles]\nfile = \"{file}\"\n[set]\nT = 1\nkappa = 1\n\
             m = 0.01\n[time]\nend = 1e-4\nsteps = 1\n"
        );
        write(&folder, "a.toml", &text)
    };
    let answer = ask(program().arg("run").arg(scene("none.vtu", 2)));
    assert!(answer.code == Some(1) && answer.err.contains("holds no particles"), "{}", answer.err);
    // A plane along x and z.
    let plane: Vec<[f64; 3]> = (0..100).map(|i| [f64::from(i % 10) / 10.0, 5.0, f64::from(i / 10) / 10.0]).collect();
    let cells = "<CellData><DataArray type=\"Float64\" Name=\"T\" format=\"ascii\">1</DataArray></CellData>";
    let file = points(&folder, "plane.vtu", &plane, cells);
    let answer = ask(program().arg("check").arg(&file));
    assert_eq!((answer.code, answer.err.as_str()), (Some(0), ""));
    for expected in
        ["100 particles, 2-D along x z at y = 5", "\n  z  ", "of cells, not of points", "given in [set]: m, T"]
    {
        assert!(answer.out.contains(expected), "{expected}: {}", answer.out);
    }
    assert!(!answer.out.contains("\n  y  "), "{}", answer.out);
    let answer = ask(program().arg("run").arg(scene("plane.vtu", 2)));
    assert!(
        answer.code == Some(0) && answer.out.contains("particles lie along x z at y = 5"),
        "{}{}",
        answer.out,
        answer.err
    );
    let answer = ask(program().arg("run").arg(scene("plane.vtu", 3)));
    assert!(
        answer.code == Some(2) && answer.err.contains("flat along y") && answer.err.contains("dim=2"),
        "{}",
        answer.err
    );
    let answer = ask(program().arg("run").arg(scene("plane.vtu", 1)));
    assert!(answer.code == Some(2) && answer.err.contains("vary along x, z"), "{}", answer.err);
}

#[cfg(unix)]
mod unix {
    use super::*;
    use std::fs::Permissions;
    use std::io::Read;
    use std::os::fd::FromRawFd;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn a_folder_that_may_not_be_written_is_left_as_it_is() {
        if unsafe { libc::geteuid() } == 0 {
            return; // root may write anywhere; the file in the way above stands for it
        }
        let folder = tempfile::tempdir().unwrap();
        std::fs::set_permissions(folder.path(), Permissions::from_mode(0o555)).unwrap();
        let answer = ask(program().arg("run").current_dir(folder.path()));
        assert_eq!(answer.code, Some(1));
        assert!(answer.err.contains("diffusph_demo"), "{}", answer.err);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    /// By default the signal that comes with such a write ends a process.
    #[test]
    fn a_limit_on_the_size_of_files_is_an_error_of_the_write() {
        let folder = tempfile::tempdir().unwrap();
        let mut shell = Command::new("sh");
        shell.args(["-c", "ulimit -f 8 && exec \"$0\" run"]).arg(program().get_program()).current_dir(folder.path());
        let answer = ask(&mut shell);
        assert_eq!(answer.code, Some(1), "{}", answer.err);
        assert!(answer.err.contains("too large"), "{}", answer.err);
    }

    /// A run that takes minutes.
    fn long(folder: &TempDir) -> Command {
        let text = std::fs::read_to_string(scene("dam_break")).unwrap();
        let data = format!("{}/", repository("tests/data").display());
        let text =
            text.replace("../data/", &data).replace("steps = 20", "steps = 20000").replace("every = 10", "every = 1");
        let path = write(folder, "long.toml", &text);
        let mut command = program();
        command.args(["run", "--out"]).arg(folder.path()).arg(path).stdin(Stdio::null());
        command
    }

    #[test]
    fn ctrl_c_leaves_a_series_that_can_be_read() {
        let folder = tempfile::tempdir().unwrap();
        let child = long(&folder).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let pvd = folder.path().join("dam_break.pvd");
        let start = Instant::now();
        while Series::read(&pvd).map_or(0, |s| s.entries().len()) < 3 {
            assert!(start.elapsed() < Duration::from_secs(60), "no snapshots");
            std::thread::sleep(Duration::from_millis(5));
        }
        unsafe { libc::kill(child.id() as i32, libc::SIGINT) };
        let done = child.wait_with_output().unwrap();
        assert_eq!(done.status.code(), Some(130));
        assert!(String::from_utf8_lossy(&done.stderr).contains("interrupted"));
        let series = Series::read(&pvd).unwrap();
        for entry in series.entries() {
            assert_eq!(io::read(series.file_of(entry)).unwrap().points.len(), 6518);
        }
        // The scene, the list, and the snapshots that it lists.
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2 + series.entries().len());
    }

    #[test]
    fn a_terminal_sees_a_bar() {
        let folder = tempfile::tempdir().unwrap();
        let (mut master, mut slave) = (0, 0);
        let null = std::ptr::null_mut();
        assert_eq!(unsafe { libc::openpty(&mut master, &mut slave, null, null.cast(), null.cast()) }, 0);
        let (mut master, slave) = unsafe { (std::fs::File::from_raw_fd(master), Stdio::from_raw_fd(slave)) };
        let mut child = long(&folder).stdout(Stdio::null()).stderr(slave).spawn().unwrap();
        let mut seen = String::new();
        let mut buffer = [0; 256];
        while !seen.contains("% ") {
            let n = master.read(&mut buffer).unwrap();
            seen.push_str(&String::from_utf8_lossy(&buffer[..n]));
            assert!(seen.len() < 100_000, "{seen}");
        }
        child.kill().unwrap();
        child.wait().unwrap();
        assert!(seen.contains("left"), "{seen:?}");
    }
}
