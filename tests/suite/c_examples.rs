//! The hosts in `c_examples` are built by make and by CMake against an installed library; they check their own answers, and
//! valgrind checks their memory and ours.

use crate::common::{installed, root, run, succeed};
use std::path::{Path, PathBuf};
use std::process::Command;

fn programs(folder: &Path) -> Vec<PathBuf> {
    use std::os::unix::fs::PermissionsExt;
    let entries = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap());
    let runs = entries.filter(|e| e.metadata().is_ok_and(|m| m.is_file() && m.permissions().mode() & 0o100 != 0));
    runs.map(|e| e.path()).collect()
}

fn valgrind(program: &Path) -> Command {
    let mut valgrind = Command::new("valgrind");
    valgrind.args(["-q", "--leak-check=full", "--errors-for-leak-kinds=definite", "--show-leak-kinds=definite"]);
    valgrind.arg("--error-exitcode=99").arg(program);
    valgrind
}

/// The exit code, under valgrind, of `heat.c` with one thing changed.
fn code_of_changed(folder: &Path, from: &str, to: &str) -> i32 {
    let text = std::fs::read_to_string(root().join("c_examples/heat.c")).unwrap();
    assert!(text.contains(from));
    let (source, program, prefix) = (folder.join("wrong.c"), folder.join("wrong"), folder.join("prefix"));
    std::fs::write(&source, text.replace(from, to)).unwrap();
    let mut gcc = Command::new("gcc");
    gcc.arg("-I").arg(prefix.join("include")).arg("-o").arg(&program).arg(&source).arg("-L").arg(prefix.join("lib"));
    succeed(gcc.args(["-ldiffusph", "-lm"]).arg(format!("-Wl,-rpath,{}", prefix.join("lib").display())));
    run(valgrind(&program).current_dir(folder)).status.code().unwrap()
}

fn make(folder: &Path, target: &str) -> Command {
    let prefix = installed(folder);
    let mut make = Command::new("make");
    make.arg("-C").arg(root().join("c_examples")).arg(target);
    make.arg(format!("PREFIX={}", prefix.display())).arg(format!("BUILD={}", folder.join("build").display()));
    make
}

#[test]
fn by_make_and_under_valgrind() {
    let dir = tempfile::tempdir().unwrap();
    let told = succeed(&mut make(dir.path(), "check"));
    let build = dir.path().join("build");
    let programs = programs(&build);
    assert_eq!(programs.len(), told.matches("== ").count(), "{told}");
    for program in &programs {
        succeed(valgrind(program).current_dir(&build));
    }
    // What they wrote is there, and whole: the list names two snapshots, which we read.
    let series = diffusph::io::Series::read(build.join("heat.pvd")).unwrap();
    let times: Vec<f64> = series.entries().iter().map(|e| e.time).collect();
    assert!(times.len() == 2 && times[0] == 0.0 && (times[1] - 0.1).abs() < 1e-12, "{times:?}");
    for entry in series.entries() {
        let snapshot = diffusph::io::read(series.file_of(entry)).unwrap();
        assert!(snapshot.points.len() == 576 && snapshot.field("T").is_some() && snapshot.time == Some(entry.time));
    }
    // A control: valgrind must find that a solver is lost, and the program that its answer is wrong.
    assert_eq!(code_of_changed(dir.path(), "    diffusph_destroy(s);\n    printf(\"errors", "    printf(\"errors"), 99);
    assert_eq!(code_of_changed(dir.path(), "\"kappa\", kappa", "\"kappa\", 1.1 * kappa"), 1);
}

#[test]
fn by_cmake() {
    let dir = tempfile::tempdir().unwrap();
    let (prefix, build) = (installed(dir.path()), dir.path().join("build"));
    let mut cmake = Command::new("cmake");
    cmake.arg("-S").arg(root().join("c_examples")).arg("-B").arg(&build).arg("-DCMAKE_BUILD_TYPE=Release");
    succeed(cmake.arg(format!("-DCMAKE_PREFIX_PATH={}", prefix.display())));
    succeed(Command::new("cmake").arg("--build").arg(&build));
    let told = succeed(Command::new("ctest").arg("--output-on-failure").current_dir(&build));
    assert!(told.contains("100% tests passed, 0 tests failed out of 7"), "{told}");
}

fn link_beside_another_rust(prefix: &Path, folder: &Path) {
    let other = "#[unsafe(no_mangle)] pub extern \"C\" fn other_work(n: usize) -> usize {\n    let many: std::collections::HashMap<usize, \
                 String> = (0..n).map(|i| (i, format!(\"{i}\"))).collect();\n    std::thread::spawn(move || many.len()).join().unwrap()\n}\n";
    let host = "#include <diffusph.h>\n#include <stdio.h>\nsize_t other_work(size_t);\nint main(void) {\n    diffusph_solver *s;\n    \
                char why[99];\n    int code = diffusph_create(\"heat dim=1 threads=2\", &s, why, sizeof why);\n    \
                printf(\"%d %d %d\\n\", code, (int)other_work(10), diffusph_destroy(s));\n    return 0;\n}\n";
    std::fs::write(folder.join("other.rs"), other).unwrap();
    std::fs::write(folder.join("host.c"), host).unwrap();
    let rustc = |options: &[&str]| {
        let mut rustc = Command::new("rustc");
        succeed(
            rustc
                .args(["--edition=2024", "--crate-type=staticlib", "-O"])
                .args(options)
                .arg("other.rs")
                .current_dir(folder),
        );
    };
    let ours = prefix.join("lib/libdiffusph.a");
    for options in [&[][..], &["-Cpanic=abort"], &["-Clto=fat", "-Ccodegen-units=1"]] {
        rustc(options);
        for order in [[ours.as_path(), Path::new("libother.a")], [Path::new("libother.a"), ours.as_path()]] {
            let mut gcc = Command::new("gcc");
            gcc.arg("-I").arg(prefix.join("include")).arg("host.c").args(order).args(["-lm", "-o", "host"]);
            succeed(gcc.current_dir(folder));
            assert_eq!(succeed(&mut Command::new(folder.join("host"))), "0 10 0\n", "{options:?} {order:?}");
        }
    }
}

#[test]
fn the_installed_library_is_like_any_other() {
    let dir = tempfile::tempdir().unwrap();
    let prefix = installed(dir.path());
    let file = |name: &str| prefix.join("lib").join(name);
    let dynamic = succeed(Command::new("readelf").arg("-d").arg(file("libdiffusph.so")));
    assert!(dynamic.contains("Library soname: [libdiffusph.so.1]"), "{dynamic}");
    // It exports what the header has, and nothing else.
    let exported = succeed(Command::new("nm").args(["-D", "--defined-only"]).arg(file("libdiffusph.so")));
    let mut exported: Vec<&str> = exported.lines().filter_map(|l| l.split_whitespace().nth(2)).collect();
    let mut functions: Vec<String> = crate::common::header::functions().into_iter().map(|f| f.name).collect();
    exported.sort_unstable();
    functions.sort_unstable();
    assert_eq!(exported, functions);
    // So does the archive, and it links beside another library with a Rust of its own, whichever comes first.
    let symbols = succeed(Command::new("readelf").arg("-sW").arg(file("libdiffusph.a")));
    let mut kept: Vec<&str> = Vec::new();
    for symbol in symbols.lines().filter(|l| l.contains(" GLOBAL ") && !l.contains(" UND ")) {
        kept.extend(symbol.split_whitespace().last());
    }
    kept.sort_unstable();
    assert_eq!(kept, functions);
    link_beside_another_rust(&prefix, dir.path());
    // A version that we do not have is refused.
    for (wanted, found) in [("0.1", true), ("0.1.0", true), ("0", true), ("0.2", false), ("1", false)] {
        let project = dir.path().join(format!("project-{wanted}"));
        std::fs::create_dir(&project).unwrap();
        let text = format!(
            "cmake_minimum_required(VERSION 3.16)\nproject(p LANGUAGES C)\nfind_package(diffusph {wanted} REQUIRED)\n"
        );
        std::fs::write(project.join("CMakeLists.txt"), text).unwrap();
        let mut cmake = Command::new("cmake");
        cmake.arg("-S").arg(&project).arg("-B").arg(project.join("build"));
        let done = run(cmake.arg(format!("-DCMAKE_PREFIX_PATH={}", prefix.display())));
        assert_eq!(done.status.success(), found, "{wanted}: {}", String::from_utf8_lossy(&done.stderr));
    }
    let mut pkg_config = Command::new("pkg-config");
    pkg_config.args(["--static", "--libs", "diffusph"]).env("PKG_CONFIG_PATH", file("pkgconfig"));
    assert!(succeed(&mut pkg_config).contains("-ldiffusph"));
}
