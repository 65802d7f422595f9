//! The program `diffusph`.

fn main() -> std::process::ExitCode {
    diffusph::cli::main()
}
