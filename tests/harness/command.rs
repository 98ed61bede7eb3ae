//! One run of the real program: arguments in, status and output out. A run that does not end is
//! killed.

use serde_json::Value;
use std::{
    collections::BTreeMap,
    ffi::OsStr,
    io::Read,
    path::Path,
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

/// Result of a run.
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
    run(program(), args, longest)
}

/// The help texts of a program by command (`COMMAND` or `COMMAND SUBCOMMAND`; empty for the program
/// itself). Checks that `--help` of every command works.
pub fn helps(program: &Path, longest: Duration) -> BTreeMap<String, String> {
    let (mut open, mut helps) = (vec![String::new()], BTreeMap::new());
    while let Some(command) = open.pop() {
        let run = run(program, command.split_whitespace().chain(["--help"]), longest);
        assert_eq!((run.status, run.stderr.as_str()), (0, ""), "{command}: {run:?}");
        open.extend(listed(&run.stdout).iter().map(|name| format!("{command} {name}").trim().to_owned()));
        helps.insert(command, run.stdout);
    }
    helps
}

/// Checks that the help of every command exists and names its options.
pub fn check_help(program: &Path, options: &[(&str, &[&str])], longest: Duration) {
    let helps = helps(program, longest);
    for (command, options) in options {
        let help = helps.get(*command).unwrap_or_else(|| panic!("`{command}` is not listed: {helps:#?}"));
        for option in *options {
            assert!(help.contains(option), "`{command} --help` does not name {option}:\n{help}");
        }
    }
}

/// Commands that the help of a command lists.
fn listed(help: &str) -> Vec<String> {
    let section = help.split("\nCommands:\n").nth(1).unwrap_or("");
    let lines = section.lines().take_while(|line| !line.is_empty());
    // A command is indented by two, its explanation by more.
    lines
        .filter(|l| l.starts_with("  ") && !l.starts_with("   "))
        .filter_map(|l| l.split_whitespace().next().map(str::to_owned))
        .filter(|name| name != "help")
        .collect()
}

/// Checks that a command line is refused as a wrong use, with nothing on standard output.
pub fn check_refused(program: &Path, line: &str, longest: Duration) {
    let run = run(program, line.split(' '), longest);
    assert_eq!((run.status, run.stdout.as_str()), (2, ""), "`{line}`: {run:?}");
    assert!(run.stderr.contains("Usage") || run.stderr.contains("--help"), "`{line}`: {run:?}");
}

/// The `waymark` program of this build.
pub fn program() -> &'static Path {
    crate::child::program()
}

/// Runs `program` with these arguments, for `longest` at most.
pub fn run<A: AsRef<OsStr>>(program: &Path, args: impl IntoIterator<Item = A>, longest: Duration) -> Run {
    let mut command = Command::new(program);
    command.args(args).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    // Removes settings of the tests' caller, which must not change a claim.
    for name in
        ["WAYMARK_LOG", "WAYMARK_SERVER", "WAYMARK_MAP", "WAYMARK_CONFIG", "WAYMARK_DATA", "WAYMARK_TOKEN"]
    {
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

/// Reads to the end in a thread: a full pipe would block the program.
fn drain(mut pipe: impl Read + Send + 'static) -> thread::JoinHandle<String> {
    thread::spawn(move || {
        let mut text = String::new();
        pipe.read_to_string(&mut text).expect("UTF-8");
        text
    })
}
