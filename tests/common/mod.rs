//! What the tests of the C ABI share: where things are, how tools are run, and the header as data.
#![allow(dead_code)] // each test uses a part

pub mod header;
pub mod host;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Where cargo has put `libdiffusph.so` and `libdiffusph.a` for the tests of this profile: beside the tests. It copies them
/// one folder up for `cargo build` alone.
pub fn library_folder() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    let folder = test.parent().unwrap().to_path_buf();
    for file in ["libdiffusph.so", "libdiffusph.a"] {
        assert!(folder.join(file).is_file(), "{} is missing", folder.join(file).display());
    }
    folder
}

/// Installs the library under test as a host would find it; answers the prefix.
pub fn installed(folder: &Path) -> PathBuf {
    let prefix = folder.join("prefix");
    let define = |name: &str, value: &Path| format!("-D{name}={}", value.display());
    let mut cmake = Command::new("cmake");
    cmake.arg(define("PREFIX", &prefix)).arg(define("FROM", &library_folder()));
    succeed(cmake.arg("-P").arg(root().join("include/install.cmake")));
    prefix
}

/// Runs a tool; where it is missing, says what to install.
pub fn run(command: &mut Command) -> Output {
    command.output().unwrap_or_else(|e| {
        panic!(
            "cannot run {} ({e}); these tests need C, C++ and Fortran compilers, make, CMake,\n    pkg-config and valgrind:\n    \
             apt-get install gcc g++ gfortran make cmake valgrind",
            command.get_program().to_string_lossy()
        )
    })
}

/// Runs a tool that must succeed; answers what it printed.
pub fn succeed(command: &mut Command) -> String {
    let done = run(command);
    let (out, err) = (String::from_utf8_lossy(&done.stdout), String::from_utf8_lossy(&done.stderr));
    assert!(done.status.success(), "{command:?}: {}\n{out}\n{err}", done.status);
    out.into_owned()
}
