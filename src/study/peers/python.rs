//! A Python program as a process of its own: bytes in, bytes out.

use crate::error::{Error, Result};
use std::ffi::OsString;
use std::io::{Read, Write};
use std::process::{Command, Stdio};
use std::time::Duration;

/// How often one looks whether the user wants to stop.
const LOOK: Duration = Duration::from_millis(20);

/// The exit code of a program that lacks something.
const CANNOT: i32 = 3;

pub enum Outcome {
    /// What it wrote to its standard output.
    Answered(Vec<u8>),
    /// It cannot run here, and why.
    Absent(String),
    Stopped,
}

/// The interpreter: DIFFUSPH_PYTHON, or python3 of the path.
fn interpreter() -> OsString {
    std::env::var_os("DIFFUSPH_PYTHON").unwrap_or("python3".into())
}

/// Runs `program` on `input` until `goes_on` says no.
///
/// # Errors
/// `Io` where it fails, with the last line that it said.
pub fn run(program: &str, arguments: &[String], input: &[u8], mut goes_on: impl FnMut() -> bool) -> Result<Outcome> {
    let python = interpreter();
    let mut command = Command::new(&python);
    command.arg("-c").arg(program).args(arguments);
    let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = match piped {
        Ok(child) => child,
        Err(e) => return Ok(Outcome::Absent(format!("{}: {e}", python.display()))),
    };
    let (stdin, stdout, stderr) = (child.stdin.take(), child.stdout.take(), child.stderr.take());
    let (out, said, stopped) = std::thread::scope(|scope| {
        // A program that gives up early does not read to the end: its exit code says so.
        scope.spawn(move || stdin.map(|mut pipe| pipe.write_all(input)));
        let (out, said) = (scope.spawn(|| all(stdout)), scope.spawn(|| all(stderr)));
        let mut stopped = false;
        while !out.is_finished() && !stopped {
            std::thread::sleep(LOOK);
            stopped = !goes_on();
        }
        if stopped {
            // One that has just ended cannot be killed, and need not be.
            let _ = child.kill();
        }
        (out.join().unwrap_or_default(), said.join().unwrap_or_default(), stopped)
    });
    let failed = |reason: String| Error::Io { path: python.display().to_string(), reason };
    let status = child.wait().map_err(|e| failed(e.to_string()))?;
    let said = String::from_utf8_lossy(&said);
    let last = said.lines().last().unwrap_or("no reason given").to_string();
    match status.code() {
        _ if stopped => Ok(Outcome::Stopped),
        Some(0) => Ok(Outcome::Answered(out)),
        Some(CANNOT) => Ok(Outcome::Absent(last)),
        _ => Err(failed(format!("{status}: {last}"))),
    }
}

fn all(pipe: Option<impl Read>) -> Vec<u8> {
    let mut bytes = Vec::new();
    // A pipe that breaks ends here; the exit code tells.
    let _ = pipe.map(|mut pipe| pipe.read_to_end(&mut bytes));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ask(program: &str) -> Result<Outcome> {
        run(program, &["7".into()], b"abc", || true)
    }

    #[test]
    fn a_program_answers_or_says_why_not() {
        let echo = "import sys; sys.stdout.write(sys.argv[1] + sys.stdin.read())";
        assert!(matches!(ask(echo), Ok(Outcome::Answered(out)) if out == b"7abc"));
        let lacks = "import sys; print('no module', file=sys.stderr); sys.exit(3)";
        assert!(matches!(ask(lacks), Ok(Outcome::Absent(why)) if why == "no module"));
        let text = ask("raise SystemError('broken')").err().map(|e| e.to_string()).unwrap_or_default();
        assert!(text.contains("SystemError: broken"), "{text}");
    }

    #[test]
    fn a_long_program_can_be_stopped() {
        let start = std::time::Instant::now();
        let answer = run("import time; time.sleep(60)", &[], b"", || start.elapsed() < Duration::from_millis(200));
        assert!(matches!(answer, Ok(Outcome::Stopped)) && start.elapsed() < Duration::from_secs(20));
    }
}
