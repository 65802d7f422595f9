//! Hosts that are refused memory live on.

use crate::common::{installed, root, succeed};
use std::path::Path;
use std::process::Command;

/// Compiles a host of `tests/hosts` against an installed library.
fn built(host: &str, folder: &Path) -> Command {
    let (prefix, program) = (installed(folder), folder.join(host));
    let mut gcc = Command::new("gcc");
    gcc.args(["-O1", "-Wall", "-Wextra", "-Werror", "-I"]).arg(prefix.join("include")).arg("-o").arg(&program);
    gcc.arg(root().join("tests/hosts").join(host).with_extension("c")).arg("-L").arg(prefix.join("lib"));
    succeed(gcc.args(["-ldiffusph", "-lm"]).arg(format!("-Wl,-rpath,{}", prefix.join("lib").display())));
    let mut run = Command::new(program);
    run.current_dir(folder);
    run
}

#[test]
fn any_allocation_may_be_refused() {
    let dir = tempfile::tempdir().unwrap();
    let scenes = [
        ("heat dim=2 kernel=C2 threads=1", 11),
        ("heat dim=2 operator=projected integrator=sdirk2 threads=1", 47),
        ("heat dim=2 operator=two-first threads=2", 29),
    ];
    for (words, every) in scenes {
        let told = succeed(built("scarce", dir.path()).args([words, &every.to_string(), "."]));
        let count = |what: &str| -> u64 {
            let before = &told[..told.find(what).unwrap_or_else(|| panic!("{told}"))];
            before.trim_end().rsplit(' ').next().unwrap().parse().unwrap()
        };
        // Most allocations are of the kind that can be refused.
        assert!(2 * count("answered") > count("refused in turn"), "{words}: {told}");
    }
}

#[test]
fn an_address_space_of_any_size_gets_an_answer() {
    let dir = tempfile::tempdir().unwrap();
    let told = succeed(&mut built("narrow", dir.path()));
    assert!(!told.contains("step refused 0 times"), "{told}");
}
