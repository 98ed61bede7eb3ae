//! OpenCV beside us: a Python program that is told which picture is next and answers with the times of its detectors.
//! Whatever is wrong with it (no Python, no OpenCV, no answer) is a reason to do without, never a failure.

use serde::Deserialize;
use std::{
    collections::BTreeMap,
    io::{BufRead as _, BufReader, Write as _},
    path::{Path, PathBuf},
    process::{Child, ChildStdin, Command, Stdio},
    sync::mpsc,
    time::Duration,
};
use vision::frame::GrayImage;

/// What runs over there.
const PROGRAM: &str = include_str!("peers.py");
/// How to get what it needs.
pub(super) const HINT: &str = "python3 -m pip install opencv-contrib-python-headless";
/// Longest wait for a line, of the imports too.
const ANSWER: Duration = Duration::from_mins(2);

/// The first line.
#[derive(Deserialize)]
#[serde(untagged)]
enum Greeting {
    Ready { version: String, names: Vec<String> },
    Missing { missing: String },
}

/// A running Python with all pictures loaded. It ends with this value.
#[derive(Debug)]
pub(super) struct Peers {
    child: Child,
    stdin: ChildStdin,
    lines: mpsc::Receiver<String>,
    pub(super) version: String,
    pub(super) names: Vec<String>,
}

impl Peers {
    /// Starts `python` with the frames, which are written to `folder` for it. The error says why there is none.
    pub(super) fn start(python: &Path, frames: &[GrayImage], folder: &Path) -> Result<Self, String> {
        let mut files: Vec<PathBuf> = Vec::new();
        for (i, frame) in frames.iter().enumerate() {
            let path = folder.join(format!("{i}.pgm"));
            std::fs::write(&path, sim::export::pgm(frame)).map_err(|e| format!("{}: {e}", path.display()))?;
            files.push(path);
        }
        let mut child = Command::new(python)
            .args(["-u", "-c", PROGRAM])
            .args(&files)
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
        let mut peers = Self { child, stdin, lines, version: String::new(), names: vec![] };
        let greeting = peers.line()?;
        match serde_json::from_str(&greeting) {
            Ok(Greeting::Ready { version, names }) => {
                (peers.version, peers.names) = (version, names);
                Ok(peers)
            }
            Ok(Greeting::Missing { missing }) => Err(missing),
            Err(error) => Err(format!("{greeting}: {error}")),
        }
    }

    /// Milliseconds of every detector on a picture.
    pub(super) fn time(&mut self, frame: usize) -> Result<BTreeMap<String, f64>, String> {
        writeln!(self.stdin, "{frame}").map_err(|error| error.to_string())?;
        let line = self.line()?;
        serde_json::from_str(&line).map_err(|error| format!("{line}: {error}"))
    }

    fn line(&self) -> Result<String, String> {
        self.lines.recv_timeout(ANSWER).map_err(|error| format!("python gave no answer ({error})"))
    }
}

impl Drop for Peers {
    fn drop(&mut self) {
        // It may have ended by itself; then there is nothing to end.
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_said() {
        let folder = tempfile::tempdir().unwrap();
        let start = |program: &str| Peers::start(Path::new(program), &[], folder.path()).map(|_| ());
        assert!(start("no-such-python-anywhere").unwrap_err().contains("no-such-python-anywhere"));
        // A program that ends at once.
        assert!(start("true").unwrap_err().contains("no answer"));
        // One that prints its arguments, which are no greeting.
        assert!(start("echo").is_err());
    }
}
