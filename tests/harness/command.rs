//! One run of the real program: arguments in, status and what it printed out. A run that does not end is killed.

use crate::child::program;
use serde_json::Value;
use std::{
    ffi::OsStr,
    io::Read,
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

/// What a run came to.
#[derive(Debug)]
pub struct Run {
    /// Exit status.
    pub status: i32,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl Run {
    /// Lines of standard output as JSON, one value a line.
    pub fn json_lines(&self) -> Vec<Value> {
        let parse = |line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: `{line}` in {self:?}"));
        self.stdout.lines().map(parse).collect()
    }

    /// The JSON object that standard output ends with.
    pub fn last_json(&self) -> Value {
        let line = self.stdout.lines().next_back().unwrap_or_else(|| panic!("nothing printed: {self:?}"));
        let value: Value = serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {self:?}"));
        assert!(value.is_object(), "{value} is no object");
        value
    }
}

/// Runs `waymark` with these arguments, for `longest` at most.
pub fn waymark<A: AsRef<OsStr>>(args: impl IntoIterator<Item = A>, longest: Duration) -> Run {
    let mut command = Command::new(program());
    command.args(args).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    // Only the program's own settings: what the tests' caller has set must not change a claim.
    for name in ["WAYMARK_LOG", "WAYMARK_SERVER", "WAYMARK_CONFIG", "WAYMARK_DATA"] {
        command.env_remove(name);
    }
    let mut child = command.spawn().expect("the program starts");
    let stdout = drain(child.stdout.take().expect("its output"));
    let stderr = drain(child.stderr.take().expect("its errors"));
    let started = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().expect("its status") {
            break status;
        }
        if started.elapsed() > longest {
            child.kill().expect("kill");
            child.wait().expect("wait");
            panic!("{command:?} did not end within {longest:?}: {}", stderr.join().expect("text"));
        }
        thread::sleep(Duration::from_millis(10));
    };
    Run {
        status: status.code().unwrap_or_else(|| panic!("{command:?} was killed by a signal: {status}")),
        stdout: stdout.join().expect("text"),
        stderr: stderr.join().expect("text"),
    }
}

/// Reads to the end beside the run: a full pipe would hold it up.
fn drain(mut pipe: impl Read + Send + 'static) -> thread::JoinHandle<String> {
    thread::spawn(move || {
        let mut text = String::new();
        pipe.read_to_string(&mut text).expect("UTF-8");
        text
    })
}
