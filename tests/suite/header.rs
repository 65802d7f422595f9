//! The header is what cbindgen makes of `src/ffi`, and C and C++ compilers accept it in every dialect with every warning.
//! `DIFFUSPH_BLESS=1` writes it anew.

use crate::common::{header, root, run};
use std::path::{Path, PathBuf};
use std::process::Command;

/// In the order in which a reader of the header meets them.
const SOURCES: &[&str] =
    &["codes", "report", "guard", "lifetime", "set", "callback", "advance", "get", "files", "catalogue"];

fn generated() -> String {
    let config = cbindgen::Config::from_file(root().join("cbindgen.toml")).unwrap();
    let mut builder = cbindgen::Builder::new().with_config(config);
    for source in SOURCES {
        builder = builder.with_src(root().join("src/ffi").join(format!("{source}.rs")));
    }
    let mut text = Vec::new();
    builder.generate().unwrap().write(&mut text);
    for_c_readers(&String::from_utf8(text).unwrap())
}

/// Leaves out rustdoc's section on safety, which the conventions at the top of the header stand for.
fn for_c_readers(text: &str) -> String {
    let mut lines: Vec<&str> = Vec::new();
    let mut skipping = false;
    for line in text.lines().map(str::trim_end) {
        skipping = (skipping || line == " * # Safety") && line != " */";
        if line == " * # Safety" && lines.last() == Some(&" *") {
            lines.pop();
        }
        let doubled = line.is_empty() && lines.last() == Some(&"");
        if !(skipping || doubled) {
            lines.push(line);
        }
    }
    // C89 has no comments to the end of a line.
    let line = |line: &str| match line.split_once("// ").filter(|_| line.starts_with(['#', '}'])) {
        Some((code, why)) => format!("{} /* {why} */", code.trim_end()),
        None => line.into(),
    };
    lines.into_iter().map(line).collect::<Vec<String>>().join("\n").trim_start().to_string() + "\n"
}

#[test]
fn the_header_is_what_the_sources_say() {
    let path = root().join("include/diffusph.h");
    let text = generated();
    if std::env::var_os("DIFFUSPH_BLESS").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    let there = std::fs::read_to_string(&path).unwrap();
    if let Some((i, (a, b))) = there.lines().zip(text.lines()).enumerate().find(|(_, (a, b))| a != b) {
        panic!("include/diffusph.h:{}: '{a}' should be '{b}'; DIFFUSPH_BLESS=1 writes it anew", i + 1);
    }
    assert!(there == text, "include/diffusph.h has another length than it should; DIFFUSPH_BLESS=1 writes it anew");
}

/// A program that uses every macro and takes the address of every function.
fn user_of_everything() -> String {
    let mut text = String::from("#include \"diffusph.h\"\n#include <stddef.h>\n#include <stdio.h>\nint main(void) {\n");
    text += "    diffusph_report report = DIFFUSPH_REPORT_INIT;\n    long long sum = (long long)report.size;\n";
    for name in header::macros().iter().filter(|name| *name != "DIFFUSPH_REPORT_INIT") {
        text += &format!("    sum += {name};\n");
    }
    for function in header::functions() {
        text += &format!("    sum += ({} != NULL);\n", function.name);
    }
    text + "    printf(\"%lld\\n\", sum);\n    return 0;\n}\n"
}

fn compile(compiler: &str, dialect: &str, source: &Path, more: &[&str]) -> std::process::Output {
    let strict = ["-Wall", "-Wextra", "-Wundef", "-Werror", "-Wno-address"];
    let mut command = Command::new(compiler);
    command.arg(format!("-std={dialect}")).args(strict).args(more).arg("-fsyntax-only");
    run(command.arg("-I").arg(root().join("include")).arg(source))
}

#[test]
fn c_and_cpp_compilers_accept_it() {
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| -> PathBuf {
        let path = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let (c, cpp) = (file("all.c", &user_of_everything()), file("all.cpp", &user_of_everything()));
    // A control: a missing macro must be noticed by the same flags.
    let wrong = file("wrong.c", &user_of_everything().replace("DIFFUSPH_BUSY", "DIFFUSPH_BUSSY"));
    let in_c: &[&str] = &["-pedantic", "-Wstrict-prototypes", "-Wconversion", "-Wsign-conversion"];
    // Hosts of the oldest C have stdint.h, and long long from it.
    for (dialect, more) in
        [("c89", &["-Wno-long-long"][..]), ("gnu89", in_c), ("c99", in_c), ("c11", in_c), ("c2x", in_c)]
    {
        let plain =
            user_of_everything().replace("long long", "int64_t").replace("%lld", "%ld").replace("+= ", "+= (int64_t)");
        let c = if dialect.ends_with("89") { file("old.c", &plain) } else { c.clone() };
        let done = compile("gcc", dialect, &c, more);
        assert!(done.status.success(), "{dialect}: {}", String::from_utf8_lossy(&done.stderr));
        assert!(!compile("gcc", dialect, &wrong, more).status.success());
    }
    for dialect in ["c++98", "c++11", "c++17", "c++20"] {
        let more: &[&str] = &["-Wold-style-cast", "-Wconversion", "-Wzero-as-null-pointer-constant"];
        // The program casts and compares with NULL in its own way; the header must not.
        let source = file(
            "host.cpp",
            "#include <diffusph.h>\nint main() {\n    diffusph_report r = DIFFUSPH_REPORT_INIT;\n    return static_cast<int>(r.stages);\n}\n",
        );
        let done = compile("g++", dialect, &source, more);
        assert!(done.status.success(), "{dialect}: {}", String::from_utf8_lossy(&done.stderr));
        if dialect == "c++98" {
            continue;
        }
        let done = compile("g++", dialect, &cpp, &["-pedantic"]);
        assert!(done.status.success(), "{dialect}: {}", String::from_utf8_lossy(&done.stderr));
    }
}

#[test]
fn every_status_has_a_macro_of_its_number() {
    let macros = header::macros();
    for (code, name) in diffusph::error::CODES {
        assert_eq!(header::value_of(&format!("DIFFUSPH_{name}")), Some(i64::from(*code)), "{name}");
    }
    assert!(macros.len() > diffusph::error::CODES.len());
}

#[test]
fn every_function_goes_through_the_guard() {
    // These answer a constant, or do one atomic store and nothing else.
    let bare = ["diffusph_version_number", "diffusph_abi_version", "diffusph_cancel"];
    let text: String = SOURCES
        .iter()
        .map(|s| std::fs::read_to_string(root().join("src/ffi").join(format!("{s}.rs"))).unwrap())
        .collect();
    let functions: Vec<&str> = text.split("#[unsafe(no_mangle)]").skip(1).collect();
    assert_eq!(functions.len(), header::functions().len());
    for function in functions {
        let name = function.split("fn ").nth(1).unwrap().split('(').next().unwrap();
        let body = &function[..function.find("\n}").unwrap()];
        let guarded = ["with(s", "alone(", "protected("].iter().any(|way| body.contains(way));
        assert!(guarded || bare.contains(&name), "{name} does not go through the guard");
    }
}
