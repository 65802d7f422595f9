//! The Fortran module says the same as the header: gfortran prints the C prototypes of its interfaces, which are compared
//! with the header's, and a program of both languages compares the report in memory.

use crate::common::header::{self, Argument, Function};
use crate::common::{installed, root, succeed};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

const STRICT: [&str; 4] = ["-Wall", "-Wextra", "-Werror", "-std=f2003"];

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

/// Pointers that may be NULL are anything's in the interfaces to C: the functions in front of those have them optional,
/// with the type that is put in here.
const OPTIONAL: [(&str, &[&str]); 5] = [
    ("diffusph_create", &["character(kind=c_char) why"]),
    ("diffusph_set_box", &["integer(c_int32_t) periodic"]),
    ("diffusph_set_particles", &["real(c_double) m", "real(c_double) rho", "real(c_double) h"]),
    ("diffusph_step", &["type(diffusph_report) report"]),
    ("diffusph_plan", &["character(kind=c_char) buf", "integer(c_int64_t) needed"]),
];

fn in_fortran(module: &str, folder: &Path) -> BTreeMap<String, String> {
    let text = prototypes_of(module, folder);
    let mut all = signatures(header::prototypes(&text), header::members(&text, "diffusph_report"));
    for (function, arguments) in OPTIONAL {
        let Some(signature) = all.get_mut(function) else { continue };
        let (_, own) = module.split_once(&format!("    recursive function {function}(")).unwrap();
        let own = own.split("end function").next().unwrap();
        for argument in arguments {
            let (kind, name) = argument.rsplit_once(' ').unwrap();
            let is_declared = |line: &str| {
                let (kinds, names) = line.split_once("::").unwrap_or_default();
                kinds.trim().starts_with(&format!("{kind}, "))
                    && kinds.contains("optional, target")
                    && names.contains(name)
            };
            assert!(own.lines().any(is_declared), "{function} {argument}");
            let in_c = match kind {
                "character(kind=c_char)" => "char *",
                "integer(c_int32_t)" => "int *",
                "integer(c_int64_t)" => "long *",
                "real(c_double)" => "double *",
                _ => "diffusph_report *",
            };
            *signature = signature.replace(&format!("void * {name}"), &format!("{in_c} {name}"));
        }
    }
    all
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
        let at = text
            .find(&format!("name='{name}'"))
            .or(text.find(&format!("function {name}(")))
            .or(text.find(&format!(":: {name}")))
            .unwrap();
        let drifted = text[..at].to_string() + &text[at..].replacen(from, to, 1);
        assert_ne!(text, drifted, "{name}");
        let found = differences(&c, &in_fortran(&drifted, dir.path()));
        assert!(!found.is_empty() && found.iter().all(|d| d.starts_with(name)), "{name}: {found:?}");
    }
}

/// Texts come back from both kinds of buffers, and arguments may be left out, in every dialect and with the options of
/// real builds.
#[test]
fn it_compiles_as_hosts_compile() {
    const HOST: &str = "program host
    use diffusph
    use, intrinsic :: iso_c_binding
    implicit none
    type(c_ptr) :: s
    type(diffusph_report) :: report
    character(kind=c_char, len=256) :: string
    character(kind=c_char) :: array(256)
    integer(c_int32_t) :: status
    real(c_double) :: x(3, 4)
    status = diffusph_create(diffusph_c('heat dim=4'), s, string, 256_c_int64_t)
    status = diffusph_create(diffusph_c('heat dim=4'), s, array, 256_c_int64_t)
    if (diffusph_text(string) /= diffusph_text(array)) error stop 'texts differ'
    if (index(diffusph_text(array), 'dim') == 0) error stop 'no text'
    status = diffusph_create(diffusph_c('heat dim=1 threads=1'), s, why_len=0_c_int64_t)
    x = 0
    x(1, :) = real((/1, 2, 3, 4/), c_double)
    status = diffusph_set_particles(s, 4_c_int64_t, x, 3_c_int64_t, rho=x(1, :))
    status = diffusph_set_number(s, diffusph_c('m'), 1.0_c_double)
    status = diffusph_set_number(s, diffusph_c('T'), 5.0_c_double)
    status = diffusph_set_number(s, diffusph_c('kappa'), 1.0_c_double)
    status = diffusph_step(s, 1.0_c_double)
    status = diffusph_step(s, 1.0_c_double, report)
    print '(f3.1)', report%T_max
    status = diffusph_destroy(s)
end program
";
    let dir = tempfile::tempdir().unwrap();
    let (prefix, host) = (installed(dir.path()), dir.path().join("host.f90"));
    let library = prefix.join("lib");
    let host_in = |standard: &str| match standard {
        // It has no code for `error stop`.
        "-std=f2003" => HOST.replace("error stop", "stop"),
        _ => HOST.to_string(),
    };
    for options in [
        "-std=f2003",
        "-std=f2008",
        "-std=f2018",
        "-fno-automatic",
        "-fno-automatic -std=legacy",
        "-fdefault-integer-8 -fdefault-real-8",
        "-fcheck=all -ffpe-trap=invalid,zero,overflow",
        "-finit-real=snan -ffpe-trap=invalid",
        "-Ofast -fopenmp",
    ] {
        std::fs::write(&host, host_in(options)).unwrap();
        let mut gfortran = Command::new("gfortran");
        gfortran.args(options.split(' ')).args(["-Wall", "-Wextra", "-Werror", "-J"]).arg(dir.path());
        gfortran.arg("-o").arg(dir.path().join("host")).arg(prefix.join("include/diffusph.f90")).arg(&host);
        succeed(gfortran.arg("-L").arg(&library).arg("-ldiffusph"));
        let told = succeed(Command::new(dir.path().join("host")).env("LD_LIBRARY_PATH", &library));
        assert_eq!(told.trim(), "5.0", "{options}");
    }
}

#[test]
fn pointers_are_values() {
    let text = module();
    let (interfaces, _) = text.split_once("\ncontains\n").unwrap();
    let lines =
        interfaces.lines().map(str::trim).filter(|l| l.starts_with("type(c_ptr)") || l.starts_with("type(c_funptr)"));
    let by_reference: Vec<&str> = lines.filter(|l| !l.contains(", value ::")).collect();
    // diffusph_create's result.
    assert_eq!(by_reference, ["type(c_ptr), intent(inout) :: s"]);
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
