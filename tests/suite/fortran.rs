//! The Fortran module says the same as the header: gfortran prints the C prototypes of its interfaces, which are compared
//! with the header's, and a program of both languages compares the report in memory.

use crate::common::header::{self, Argument, Function};
use crate::common::{installed, root, succeed};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

const STRICT: [&str; 4] = ["-Wall", "-Wextra", "-Werror", "-std=f2018"];

fn module() -> String {
    std::fs::read_to_string(root().join("include/diffusph.f90")).unwrap()
}

/// What gfortran says the interfaces are in C.
fn prototypes_of(module: &str, folder: &Path) -> String {
    let source = folder.join("module.f90");
    std::fs::write(&source, module).unwrap();
    let mut gfortran = Command::new("gfortran");
    gfortran.args(STRICT).args(["-fsyntax-only", "-fc-prototypes", "-J"]).arg(folder).arg(source);
    succeed(&mut gfortran).replace("int (*callback)()", "callback callback")
}

/// A C type as gfortran can print it: no names for integers of a size, nor for what a pointer points to.
fn as_fortran(kind: &str) -> String {
    match kind {
        "int32_t" | "uint32_t" => "int".into(),
        "int64_t" => "long".into(),
        "int32_t *" | "uint32_t *" => "int *".into(),
        "int64_t *" => "long *".into(),
        // A type(c_ptr) is printed alike with and without `value`; `pointers_are_values` looks at that.
        "diffusph_solver *" | "diffusph_solver * *" => "void *".into(),
        other if other.ends_with("_callback") => "callback".into(),
        other => other.into(),
    }
}

/// Every function, callback and struct as text, by name, in gfortran's words.
fn signatures(functions: Vec<Function>, report: Vec<Argument>) -> BTreeMap<String, String> {
    let list = |items: &[Argument]| {
        let words: Vec<String> =
            items.iter().map(|a| format!("{} {}", as_fortran(&a.kind), a.name.to_lowercase())).collect();
        words.join(", ")
    };
    let mut all: BTreeMap<String, String> = functions
        .into_iter()
        .map(|f| (f.name, format!("{} ({})", as_fortran(&f.result), list(&f.arguments))))
        .collect();
    all.insert("diffusph_report".into(), list(&report));
    all
}

/// The header, its callback types written as functions.
fn in_c() -> BTreeMap<String, String> {
    let text = header::without_comments(&header::text());
    let mut plain = String::new();
    for statement in text.split_inclusive(';') {
        // typedef int32_t (*name)(…); is compared as int32_t name(…);
        match statement.find("typedef").filter(|_| statement.contains("(*diffusph_")) {
            Some(at) => plain += &statement[at..].replace("typedef", "").replace("(*", "").replacen(")(", "(", 1),
            None => plain += statement,
        }
    }
    signatures(header::prototypes(&plain), header::report())
}

fn in_fortran(module: &str, folder: &Path) -> BTreeMap<String, String> {
    let text = prototypes_of(module, folder);
    signatures(header::prototypes(&text), header::members(&text, "diffusph_report"))
}

fn differences(c: &BTreeMap<String, String>, fortran: &BTreeMap<String, String>) -> Vec<String> {
    let missing = "missing".to_string();
    let names = c.keys().chain(fortran.keys().filter(|name| !c.contains_key(*name)));
    let differing = names.filter(|name| c.get(*name) != fortran.get(*name));
    let text = |all: &BTreeMap<String, String>, name: &String| all.get(name).unwrap_or(&missing).clone();
    differing.map(|name| format!("{name}: C {} Fortran {}", text(c, name), text(fortran, name))).collect()
}

#[test]
fn the_module_has_the_header_s_functions_and_types() {
    let dir = tempfile::tempdir().unwrap();
    let c = in_c();
    assert_eq!(c.len(), header::functions().len() + 4, "functions, three callbacks and the report");
    assert_eq!(differences(&c, &in_fortran(&module(), dir.path())), Vec::<String>::new());
    // A control: each of these must be found, and nothing else.
    for (name, from, to) in [
        ("diffusph_step", "real(c_double), value :: dt", "real(c_double) :: dt"),
        ("diffusph_limit", "real(c_double), intent(inout) :: dt", "integer(c_int32_t), intent(inout) :: dt"),
        ("diffusph_get", "integer(c_int64_t), value :: n, stride", "integer(c_int32_t), value :: n, stride"),
        ("diffusph_report", "integer(c_int64_t) :: stages", "integer(c_int32_t) :: stages"),
        (
            "diffusph_field_callback",
            "integer(c_int64_t), value :: n\n            integer(c_int32_t), intent(in) :: p",
            "integer(c_int32_t), value :: n\n            integer(c_int32_t), intent(in) :: p",
        ),
        ("diffusph_cancel", "diffusph_cancel(", "diffusph_cancels("),
    ] {
        let text = module();
        let at = text.find(&format!("function {name}(")).or(text.find(&format!(":: {name}"))).unwrap();
        let drifted = text[..at].to_string() + &text[at..].replacen(from, to, 1);
        assert_ne!(text, drifted, "{name}");
        let found = differences(&c, &in_fortran(&drifted, dir.path()));
        assert!(!found.is_empty() && found.iter().all(|d| d.starts_with(name)), "{name}: {found:?}");
    }
}

#[test]
fn pointers_are_values() {
    let text = module();
    let lines = text.lines().map(str::trim).filter(|l| l.starts_with("type(c_ptr)") || l.starts_with("type(c_funptr)"));
    let by_reference: Vec<&str> = lines.filter(|l| !l.contains(", value ::")).collect();
    // diffusph_create's result, and the argument of the Fortran helper diffusph_error.
    assert_eq!(by_reference, ["type(c_ptr), intent(inout) :: s", "type(c_ptr), intent(in) :: s"]);
    assert!(text.lines().all(|l| l.len() < 132));
}

#[test]
fn constants_are_the_header_s() {
    let text = module();
    let mut constants = BTreeMap::new();
    for line in text.lines().filter(|l| l.contains("parameter ::")) {
        let (name, value) = line.split_once("::").and_then(|(_, rest)| rest.split_once('=')).unwrap();
        constants.insert(name.trim().to_string(), value.trim().parse::<i64>().unwrap());
    }
    for name in header::macros() {
        // The rest is not a plain number: the initialiser, and the version that its parts make up.
        if let Some(value) = header::value_of(&name) {
            assert_eq!(constants.remove(&name), Some(value), "{name}");
        }
    }
    assert!(constants.is_empty(), "{constants:?} are not in the header");
}

/// Both languages print the size of the report and the offset of each member.
#[test]
fn the_report_is_the_same_in_memory() {
    let dir = tempfile::tempdir().unwrap();
    let names: Vec<String> = header::report().into_iter().map(|m| m.name).collect();
    let offsets: String =
        names.iter().map(|n| format!("    printf(\"%d\\n\", (int)offsetof(diffusph_report, {n}));\n")).collect();
    let c = format!(
        "#include <stddef.h>\n#include <stdio.h>\n#include \"diffusph.h\"\nint main(void) {{\n    diffusph_report r = \
         DIFFUSPH_REPORT_INIT;\n    printf(\"%d\\n%d\\n\", (int)r.size, (int)sizeof r);\n{offsets}    return 0;\n}}\n"
    );
    let places: String = names
        .iter()
        .map(|n| format!("    print '(i0)', transfer(c_loc(r%{n}), 0_c_intptr_t) - transfer(c_loc(r), 0_c_intptr_t)\n"))
        .collect();
    let fortran = format!(
        "program layout\n    use diffusph\n    use, intrinsic :: iso_c_binding\n    implicit none\n    \
         type(diffusph_report), target :: r\n    print '(i0)', r%size, c_sizeof(r)\n{places}end program\n"
    );
    std::fs::write(dir.path().join("layout.c"), c).unwrap();
    std::fs::write(dir.path().join("layout.f90"), fortran).unwrap();
    let prefix = installed(dir.path());
    let at = |name: &str| dir.path().join(name);
    succeed(Command::new("gcc").arg("-I").arg(prefix.join("include")).arg("-o").arg(at("c")).arg(at("layout.c")));
    let mut gfortran = Command::new("gfortran");
    gfortran.arg("-J").arg(dir.path()).arg("-o").arg(at("f")).arg(prefix.join("include/diffusph.f90"));
    let library = prefix.join("lib");
    succeed(gfortran.arg(at("layout.f90")).arg("-L").arg(&library).arg("-ldiffusph"));
    let c = succeed(&mut Command::new(at("c")));
    assert_eq!(c, succeed(Command::new(at("f")).env("LD_LIBRARY_PATH", &library)));
    let numbers: Vec<i64> = c.lines().map(|l| l.parse().unwrap()).collect();
    assert!(
        numbers.len() == names.len() + 2 && numbers[0] == numbers[1] && numbers.is_sorted_by_key(|n| n % numbers[0])
    );
}
