//! Gives the shared library a soname, which cargo sets none of: that of the interface, whatever the crate's version is.
const CODES: &str = "src/ffi/codes.rs";

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed={CODES}");
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("linux") {
        let codes = std::fs::read_to_string(CODES).expect("the sources are there");
        let line = codes.lines().find_map(|line| line.strip_prefix("pub const DIFFUSPH_ABI: i32 = "));
        let abi = line.expect("the interface has a number").trim_end_matches(';');
        println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libdiffusph.so.{abi}");
    }
}
