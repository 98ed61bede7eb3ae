//! OpenCV as peer: a Python program that reads the number of a picture and answers with a line of
//! JSON, for example the times of its detectors. A missing Python or OpenCV, or no answer, is a
//! reason to run without it, never a failure.

use serde::{Deserialize, de::DeserializeOwned};
use std::{
    collections::BTreeMap,
    io::{BufRead as _, BufReader, Write as _},
    path::{Path, PathBuf},
    process::{Child, ChildStdin, Command, Stdio},
    sync::mpsc,
    time::Duration,
};
use vision::frame::GrayImage;

/// The Python program.
const PROGRAM: &str = include_str!("../../peers/detectors.py");
/// How to install what it needs.
pub(super) const HINT: &str = "python3 -m pip install opencv-contrib-python-headless";
/// Longest wait for a line; imports and preparing the pictures count too.
const ANSWER: Duration = Duration::from_mins(10);

/// The first line if all is there.
#[derive(Deserialize)]
struct Greeting {
    version: String,
}

#[derive(Deserialize)]
struct Missing {
    missing: String,
}

/// A running Python program that answers line by line. Dropping this value ends it.
#[derive(Debug)]
pub(crate) struct Python {
    child: Child,
    stdin: ChildStdin,
    lines: mpsc::Receiver<String>,
}

impl Python {
    /// Starts `program` with arguments and returns its first line, parsed. The error is the reason,
    /// for people.
    pub(crate) fn start<T: DeserializeOwned>(
        python: &Path,
        program: &str,
        args: &[PathBuf],
    ) -> Result<(Self, T), String> {
        let mut child = Command::new(python)
            .args(["-u", "-c", program])
            .args(args)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|error| format!("{}: {error}", python.display()))?;
        let (Some(stdin), Some(stdout)) = (child.stdin.take(), child.stdout.take()) else {
            return Err("no pipes".into());
        };
        let (sender, lines) = mpsc::channel();
        std::thread::spawn(move || {
            for line in BufReader::new(stdout).lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        let running = Self { child, stdin, lines };
        let greeting = running.line()?;
        if let Ok(Missing { missing }) = serde_json::from_str(&greeting) {
            return Err(missing);
        }
        let greeting = serde_json::from_str(&greeting).map_err(|error| format!("{greeting}: {error}"))?;
        Ok((running, greeting))
    }

    /// Writes a line and waits for the answer.
    pub(crate) fn ask<T: DeserializeOwned>(&mut self, question: &str) -> Result<T, String> {
        writeln!(self.stdin, "{question}").map_err(|error| error.to_string())?;
        let line = self.line()?;
        serde_json::from_str(&line).map_err(|error| format!("{line}: {error}"))
    }

    fn line(&self) -> Result<String, String> {
        self.lines.recv_timeout(ANSWER).map_err(|error| format!("python gave no answer ({error})"))
    }
}

/// Writes pictures to `folder`, by name and number.
pub(super) fn written<'a>(
    images: impl IntoIterator<Item = &'a GrayImage>,
    folder: &Path,
    name: &str,
) -> Result<Vec<PathBuf>, String> {
    let write = |(i, image): (usize, &GrayImage)| {
        let path = folder.join(format!("{name}-{i}.pgm"));
        std::fs::write(&path, sim::export::pgm(image)).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(path)
    };
    images.into_iter().enumerate().map(write).collect()
}

/// A running Python with all pictures loaded, that times OpenCV's detectors.
#[derive(Debug)]
pub(super) struct Peers {
    python: Python,
    pub(super) version: String,
}

impl Peers {
    /// Writes the frames to `folder` and starts `python` on them. The error is the reason, for
    /// people.
    pub(super) fn start(python: &Path, frames: &[GrayImage], folder: &Path) -> Result<Self, String> {
        let files = written(frames, folder, "frame")?;
        let (python, Greeting { version }) = Python::start(python, PROGRAM, &files)?;
        Ok(Self { python, version })
    }

    /// Milliseconds of every detector on a picture.
    pub(super) fn time(&mut self, frame: usize) -> Result<BTreeMap<String, f64>, String> {
        self.python.ask(&frame.to_string())
    }
}

impl Drop for Python {
    fn drop(&mut self) {
        // Fails if it has ended by itself.
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peer_that_does_not_run_gives_a_reason() {
        let folder = tempfile::tempdir().unwrap();
        let start = |program: &str| Peers::start(Path::new(program), &[], folder.path()).map(|_| ());
        assert!(start("no-such-python-anywhere").unwrap_err().contains("no-such-python-anywhere"));
        // A program that ends at once.
        assert!(start("true").unwrap_err().contains("no answer"));
        // One that prints its arguments, which are no greeting.
        assert!(start("echo").is_err());
    }
}
