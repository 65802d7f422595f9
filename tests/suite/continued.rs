//! Runs that go on from where they stopped: to the same bits, and only where they are the same run.

use crate::program::{Answer, ask, program, write};
use diffusph::io::{self, Series};
use std::path::Path;
use std::process::Stdio;
use std::time::Instant;

/// kappa(T), walls, marks, derived h and disorder: what a run has to remember.
const REMEMBERED: &str = r#"
words = "heat dim=2 kernel=M4 threads=1"
[box]
lo = [0, 0]
hi = [1, 1]
periodic = [false, true]
[particles]
lattice = "square"
n = 60
jitter = 0.2
seed = 3
[set]
kappa = "power n=2"
T = 300
source = 1e3
[[mark]]
where = { x = [0, 0.05] }
set = { T = 400, fixed = true, c_v = 3 }
[time]
start = 0.5
end = 0.51
steps = 60
[output]
pvd = "run.pvd"
every = 7
fields = ["flux"]
"#;

fn goes_on(folder: &Path, scene: &Path, more: &[&str]) -> Answer {
    ask(program().args(["run", "--continue", "--out"]).arg(folder).arg(scene).args(more))
}

/// Every file of a folder.
fn contents(folder: &Path) -> std::collections::BTreeMap<String, Vec<u8>> {
    let files = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path());
    files.map(|f| (f.file_name().unwrap().to_str().unwrap().into(), std::fs::read(f).unwrap())).collect()
}

#[test]
fn a_run_that_is_killed_goes_on_to_the_same_bits() {
    let scenes = tempfile::tempdir().unwrap();
    let scene = write(&scenes, "remembered.toml", REMEMBERED);
    let whole = tempfile::tempdir().unwrap();
    let begun = Instant::now();
    assert_eq!(ask(program().args(["run", "--out"]).arg(whole.path()).arg(&scene)).code, Some(0));
    let takes = begun.elapsed();
    let whole = contents(whole.path());
    assert_eq!(whole.len(), 11);
    let (mut resumed, mut kills) = (0, 0);
    for round in 0..12 {
        let folder = tempfile::tempdir().unwrap();
        // Killed now and then until it is through.
        for attempt in 0.. {
            let mut command = program();
            command.args(["run", "--continue", "--out"]).arg(folder.path()).arg(&scene).stdin(Stdio::null());
            let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
            std::thread::sleep(
                takes.mul_f64(f64::from((round * 7 + attempt * 3) % 8 + 2) / 12.0 * (1.0 + f64::from(attempt) / 6.0)),
            );
            kills += u32::from(child.try_wait().unwrap().is_none());
            let _ = child.kill();
            let done = child.wait_with_output().unwrap();
            resumed += u32::from(String::from_utf8_lossy(&done.stdout).contains("it went on from"));
            if done.status.success() {
                break;
            }
            assert_eq!((done.status.code(), attempt < 60), (None, true), "{}", String::from_utf8_lossy(&done.stderr));
        }
        let now = contents(folder.path());
        let hidden = |name: &&String| !name.starts_with('.');
        assert!(now.keys().filter(hidden).eq(whole.keys()), "{:?}", now.keys());
        assert!(whole.iter().all(|(name, bytes)| now[name] == *bytes), "round {round}: other bits");
    }
    assert!(kills >= 12 && resumed >= 6, "{kills} kills, {resumed} resumed");
}

#[test]
fn only_the_same_run_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(&folder, "remembered.toml", REMEMBERED);
    let out = folder.path().join("out");
    let first = goes_on(&out, &scene, &[]);
    assert!(first.code == Some(0) && first.out.contains("from the start"), "{}", first.out);
    let before = contents(&out);
    let again = goes_on(&out, &scene, &["--set", "threads=2"]);
    assert!(again.code == Some(0) && again.out.contains("it went on from"), "{} {}", again.out, again.err);
    assert_eq!(contents(&out), before);
    for (from, to, says) in [
        ("seed = 3", "seed = 4", "its particles are elsewhere"),
        ("n = 60", "n = 50", "'given' is"),
        ("kernel=M4", "kernel=M6", "'words' is 'heat dim=2 kernel=M4' there, and 'heat dim=2 kernel=M6' here"),
        ("power n=2", "power n=3", "'law' is"),
        ("source = 1e3", "source = 2e3", "source=1000.0"),
        ("c_v = 3", "c_v = 4", "c_v has other values there"),
        ("hi = [1, 1]", "hi = [1, 2]", "'box' is"),
        ("start = 0.5\n", "start = 0.4\n", "time.start is 0.5 there, and 0.4 here"),
        ("end = 0.51", "end = 0.505", "time.end is 0.51 there, and 0.505 here"),
        ("steps = 60", "steps = 7", "time.steps is 60 there, and 7 here"),
        ("every = 7", "every = 6", "output.every is '7' there, and '6' here"),
        ("[\"flux\"]", "[\"grad_T\"]", "output.fields is 'flux' there, and 'grad_T' here"),
        ("T = 300\n", "T = 301\n", "T at the start has other values there"),
        ("T = 400", "T = 401", "T at the start has other values there"),
    ] {
        assert_eq!(REMEMBERED.matches(from).count(), 1, "{from}");
        let other = write(&folder, "other.toml", &REMEMBERED.replace(from, to));
        let answer = goes_on(&out, &other, &[]);
        assert!(answer.code == Some(2) && answer.err.contains(says), "{from}: {}", answer.err);
        assert_eq!(contents(&out), before, "{from}");
    }
    // Another encoding is the same run.
    let zlib = write(&folder, "other.toml", &format!("{REMEMBERED}encoding = \"zlib\"\n"));
    let answer = goes_on(&out, &zlib, &[]);
    assert!(answer.code == Some(0) && answer.out.contains("output.encoding was raw"), "{} {}", answer.out, answer.err);
    assert_eq!(contents(&out), before);
    let none = write(&folder, "other.toml", REMEMBERED.split("[output]").next().unwrap());
    let answer = goes_on(&out, &none, &[]);
    assert!(answer.code == Some(2) && answer.err.contains("nothing to go on from"), "{}", answer.err);
}

#[test]
fn what_stands_in_the_way_of_going_on_is_said_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(&folder, "remembered.toml", REMEMBERED);
    let out = folder.path().join("out");
    assert_eq!(goes_on(&out, &scene, &[]).code, Some(0));
    let list = out.join("run.pvd");
    let (whole, text) = (contents(&out), std::fs::read_to_string(&list).unwrap());
    let last = out.join("run_0009.vtu");
    let refused = |says: &[&str]| {
        let before = contents(&out);
        let answer = goes_on(&out, &scene, &[]);
        assert!(answer.code.is_some_and(|code| code > 0), "{}", answer.out);
        says.iter().for_each(|says| assert!(answer.err.contains(says), "{says}: {}", answer.err));
        assert_eq!(contents(&out), before);
    };
    let advice = ["run_0009.vtu", "take its line out of that list", "without --continue"];
    std::fs::write(&last, &whole["run_0009.vtu"][..3000]).unwrap();
    refused(&advice);
    std::fs::remove_file(&last).unwrap();
    refused(&advice);
    std::fs::write(&last, &whole["run_0008.vtu"]).unwrap();
    refused(&["and listed at t = 0.51", advice[1]]);
    std::fs::write(&last, &whole["run_0009.vtu"]).unwrap();
    std::fs::write(&list, "").unwrap();
    refused(&["run.pvd", "empty", "remove it"]);
    // As the advice says.
    let shorter: String = text.lines().filter(|l| !l.contains("run_0009")).map(|l| format!("{l}\n")).collect();
    std::fs::write(&list, shorter).unwrap();
    assert_eq!(goes_on(&out, &scene, &[]).code, Some(0));
    assert_eq!(contents(&out), whole);
    // What others wrote says nothing of a scene.
    let mut solver = diffusph::Solver::new("heat dim=2 kernel=M4 threads=1").unwrap();
    solver.read_vtk(&last).unwrap();
    solver.write_series(&list).unwrap();
    refused(&["it does not say of which scene it is"]);
}

#[test]
fn going_on_forgets_no_entry_and_leaves_nothing_unfinished() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(&folder, "remembered.toml", REMEMBERED);
    let out = folder.path().join("out");
    assert_eq!(goes_on(&out, &scene, &[]).code, Some(0));
    std::fs::write(out.join(".diffusph.4194305.0.tmp"), "half").unwrap();
    std::fs::rename(out.join("run_0003.vtu"), folder.path().join("elsewhere.vtu")).unwrap();
    let list = std::fs::read_to_string(out.join("run.pvd")).unwrap();
    let answer = goes_on(&out, &scene, &[]);
    assert!(answer.code == Some(0) && answer.out.contains("1 of the files that"), "{} {}", answer.out, answer.err);
    assert_eq!(std::fs::read_to_string(out.join("run.pvd")).unwrap(), list);
    assert!(!contents(&out).keys().any(|name| name.ends_with(".tmp")));
}

/// A list names files of its times whenever its writer is killed, while it replaces those of an older run as well.
#[test]
fn a_rerun_over_an_older_series_may_be_killed_at_any_time() {
    let folder = tempfile::tempdir().unwrap();
    let small = REMEMBERED.replace("n = 60", "n = 8").replace("every = 7", "every = 1");
    let scenes: Vec<_> = ["0.51", "0.517", "0.513"]
        .iter()
        .map(|end| write(&folder, &format!("{end}.toml"), &small.replace("0.51\n", &format!("{end}\n"))))
        .collect();
    let out = folder.path().join("out");
    let run = |scene: &Path| {
        let mut command = program();
        command.args(["run", "--out"]).arg(&out).arg(scene).stdin(Stdio::null()).stdout(Stdio::null());
        command.spawn().unwrap()
    };
    let begun = Instant::now();
    assert!(run(&scenes[0]).wait().unwrap().success());
    let takes = begun.elapsed();
    let mut kills = 0;
    for round in 0..30 {
        let mut child = run(&scenes[(round + 1) % 3]);
        std::thread::sleep(takes.mul_f64((round * 7 % 30) as f64 / 30.0));
        kills += u32::from(child.try_wait().unwrap().is_none());
        let _ = child.kill();
        child.wait().unwrap();
        let series = Series::read(out.join("run.pvd")).unwrap();
        for entry in series.entries() {
            assert_eq!(
                io::read(series.file_of(entry)).unwrap().time,
                Some(entry.time),
                "round {round}: {}",
                entry.file
            );
        }
    }
    assert!(kills > 15, "{kills}");
    assert!(run(&scenes[0]).wait().unwrap().success());
    // Neither other names nor anything left over.
    let names: Vec<String> = contents(&out).into_keys().collect();
    let usual = (0..61).map(|k| format!("run_{k:04}.vtu"));
    assert!(names.iter().eq(["run.pvd".to_string()].iter().chain(&usual.collect::<Vec<_>>())), "{names:?}");
}
