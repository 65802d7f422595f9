//! Every study, at its smallest, as a user would ask for it: its files, and numbers that are known from elsewhere.
#![cfg(feature = "cli")]

use serde_json::Value;
use std::collections::HashMap;
use std::path::Path;
use std::process::{Command, Stdio};

const STUDIES: &[&str] = &["convergence", "kernels", "positivity", "sod", "work-precision", "claims"];

/// Asks for a study; answers what it printed.
fn study(name: &str, out: &Path, more: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_diffusph"));
    command.args(["study", name, "--tiny", "--out"]).arg(out).args(more).stdin(Stdio::null());
    let output = command.output().unwrap();
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
        assert_eq!(html.contains("<svg"), *name != "claims", "{name}");
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
