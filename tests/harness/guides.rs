//! Runs the guides: every `sh` block of a Markdown document is run, line by line, with the program
//! of this build, in a folder with the files that the guide names.
//!
//! - A block `toml NAME` or `json NAME` is written to the file NAME.
//! - `waymark serve` stays in the background, on free ports, until the guide ends; later commands
//!   find it.
//! - Before a block, `<!-- status N -->` says that its last command ends with status N instead
//!   of 0.
//! - A block `bash` is for another machine (a robot with ROS 2, an installed server) and is not
//!   run: it may hold only the programs of [`ELSEWHERE`].
//! - `cargo run -p client --example NAME` runs the example of this build; `cargo install`,
//!   `cargo test` and the demo do nothing here.

use crate::{command::program, guide_output::unsaid};
use std::{
    fs,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::Duration,
};

/// Programs that a guide may name for other machines.
pub const ELSEWHERE: [&str; 14] = [
    "ros2",
    "curl",
    "sudo",
    "systemctl",
    "ssh",
    "source",
    "export",
    "cp",
    "zenohd",
    "zenoh-bridge-ros2dds",
    "apt",
    "docker",
    "colcon",
    "pip",
];

/// A block of a guide.
#[derive(Debug, PartialEq, Eq)]
pub enum Block {
    /// Commands to run, and the exit status of the last.
    Run {
        /// Line in the document, from 1.
        line: usize,
        /// The commands; continuation lines joined.
        commands: Vec<String>,
        /// Exit status that the last command has.
        status: i32,
    },
    /// A file to write.
    File {
        /// Its name.
        name: String,
        /// Its content.
        text: String,
    },
    /// Commands for another machine.
    Elsewhere(Vec<String>),
}

/// The blocks of a document, in order. Blocks of other languages are left out.
pub fn blocks(text: &str) -> Vec<Block> {
    let (mut found, mut status) = (Vec::new(), 0);
    let mut lines = text.lines().enumerate();
    while let Some((number, line)) = lines.next() {
        let line = line.trim_start();
        if let Some(n) = line.strip_prefix("<!-- status ").and_then(|l| l.split(' ').next()) {
            status = n.parse().expect("<!-- status NUMBER -->");
        }
        let Some(info) = line.strip_prefix("```") else { continue };
        let indent = text.lines().nth(number).map_or(0, |l| l.len() - l.trim_start().len());
        let body: Vec<&str> = lines
            .by_ref()
            .map(|(_, l)| l)
            .take_while(|l| !l.trim_start().starts_with("```"))
            .map(|l| l.get(indent..).unwrap_or(l.trim_start()))
            .collect();
        match info.split_once(' ').map_or((info, ""), |(language, name)| (language, name.trim())) {
            ("sh", "") => {
                let commands = commands(&body.join("\n"));
                found.push(Block::Run { line: number + 1, commands, status: std::mem::take(&mut status) });
            }
            ("bash", "") => found.push(Block::Elsewhere(commands(&body.join("\n")))),
            ("toml" | "json" | "json5" | "yaml", name) if !name.is_empty() => {
                found.push(Block::File { name: name.to_owned(), text: body.join("\n") + "\n" });
            }
            _ => {}
        }
    }
    found
}

pub(crate) fn commands(body: &str) -> Vec<String> {
    let joined = body.replace("\\\n", " ");
    let is_command = |l: &&str| !l.is_empty() && !l.starts_with('#');
    joined.lines().map(str::trim).filter(is_command).map(str::to_owned).collect()
}

/// Runs a guide in a folder. `after` is called after each command, with the command and the
/// server's address and endpoint once there is one. Panics with the command, its output and its
/// place in the guide if a status is wrong.
pub fn run(guide: &Path, folder: &Path, after: &mut dyn FnMut(&str, &Guide)) {
    let text = fs::read_to_string(guide).expect("a guide in UTF-8");
    let mut guide_run = Guide::new(folder);
    guide_run.read(guide, &text, after);
}

/// The same, and every line that the guide says that commands print is one that they printed.
pub fn run_compared(guide: &Path, folder: &Path, after: &mut dyn FnMut(&str, &Guide)) {
    let text = fs::read_to_string(guide).expect("a guide in UTF-8");
    let mut guide_run = Guide::new(folder);
    guide_run.read(guide, &text, after);
    let unsaid = unsaid(&text, &guide_run.said);
    let said = guide_run.said.join("\n");
    assert!(unsaid.is_empty(), "{}: no command says {unsaid:#?}; they say\n{said}", guide.display());
}

/// A guide in work.
#[derive(Debug)]
pub struct Guide {
    folder: PathBuf,
    path: String,
    server: Option<Server>,
    /// Lines that commands printed.
    said: Vec<String>,
}

impl Guide {
    /// Does what a document says.
    fn read(&mut self, guide: &Path, text: &str, after: &mut dyn FnMut(&str, &Self)) {
        for block in blocks(text) {
            match block {
                Block::File { name, text } => {
                    assert!(!name.contains('/'), "{}: file {name} is not in the folder", guide.display());
                    fs::write(self.folder.join(name), text).expect("a file of the guide");
                }
                Block::Elsewhere(commands) => {
                    for command in commands {
                        let word = command.split_whitespace().next().unwrap_or_default();
                        assert!(
                            ELSEWHERE.contains(&word),
                            "{}: `{command}` is not run by the test: use a block `sh`",
                            guide.display()
                        );
                    }
                }
                Block::Run { line, commands, status } => {
                    let last = commands.len().saturating_sub(1);
                    for (i, command) in commands.iter().enumerate() {
                        let wanted = if i == last { status } else { 0 };
                        let at = format!("{}:{line}: `{command}`", guide.display());
                        self.command(command, wanted, &at);
                        after(command, self);
                    }
                }
            }
        }
    }
}

#[derive(Debug)]
struct Server {
    process: std::process::Child,
    url: String,
    endpoint: String,
}

impl Drop for Server {
    fn drop(&mut self) {
        // Fails only when it has ended already.
        drop(self.process.kill());
        drop(self.process.wait());
    }
}

impl Guide {
    fn new(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
            path: path_with(folder, &[("cargo", CARGO)]),
            server: None,
            said: Vec::new(),
        }
    }

    /// Address of the server that the guide started.
    pub fn url(&self) -> Option<&str> {
        self.server.as_ref().map(|s| s.url.as_str())
    }

    /// Endpoint of the server that the guide started.
    pub fn endpoint(&self) -> Option<&str> {
        self.server.as_ref().map(|s| s.endpoint.as_str())
    }

    fn shell(&self, command: &str) -> Command {
        let mut shell = Command::new("bash");
        shell.args(["-euo", "pipefail", "-c", command]).current_dir(&self.folder);
        for name in ["LOG", "SERVER", "CONFIG", "DATA", "MAP", "TOKEN"] {
            shell.env_remove(format!("WAYMARK_{name}"));
        }
        shell.env_remove("XDG_CONFIG_HOME").env_remove("XDG_DATA_HOME");
        shell.env("PATH", &self.path).env("NO_COLOR", "1").env("HOME", &self.folder);
        // Not `WAYMARK_...`: the server takes those for settings.
        shell.env("TESTED_PROGRAMS", program().parent().expect("its folder"));
        shell.env("TESTED_SOURCES", crate::documents::root());
        if let Some(server) = &self.server {
            shell.env("WAYMARK_SERVER", &server.url).env("TESTED_ENDPOINT", &server.endpoint);
            shell.env("WAYMARK_ZENOH", &server.endpoint);
        }
        shell.stdin(Stdio::null());
        shell
    }

    fn command(&mut self, command: &str, status: i32, at: &str) {
        if command == "waymark serve" || command.starts_with("waymark serve ") {
            return self.serve(command, at);
        }
        let limited = format!("timeout {} bash -euo pipefail -c {}", LONGEST.as_secs(), quoted(command));
        let done = self.shell(&limited).output().expect("bash");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        self.said.extend(
            [&done.stdout, &done.stderr]
                .iter()
                .flat_map(|bytes| text(bytes).lines().map(str::to_owned).collect::<Vec<_>>()),
        );
        assert!(
            done.status.code() == Some(status),
            "{at} ended with {:?}, not {status}\n{}{}",
            done.status.code(),
            text(&done.stdout),
            text(&done.stderr)
        );
    }

    /// Whether the server opens no listener for robots, by its options or its file of settings.
    fn joins_a_router(&self, command: &str) -> bool {
        let file = command.split_once("--config ").and_then(|(_, rest)| rest.split_whitespace().next());
        let settings = file.and_then(|file| fs::read_to_string(self.folder.join(file)).ok());
        command.contains("--router ") || settings.is_some_and(|settings| settings.contains("[router]"))
    }

    fn serve(&mut self, command: &str, at: &str) {
        // The old one ends first: it may hold the data directory.
        self.server = None;
        let mut shell = self.shell(&format!("exec {command}"));
        shell.env("WAYMARK_HTTP", "127.0.0.1:0").env("WAYMARK_ZENOH", "tcp/127.0.0.1:0");
        if self.joins_a_router(command) {
            shell.env_remove("WAYMARK_ZENOH");
        }
        shell.stdout(Stdio::piped());
        let mut process = shell.spawn().expect("bash");
        let stdout = process.stdout.take().expect("its output");
        let mut lines = BufReader::new(stdout).lines().map(|line| line.expect("a line"));
        let mut after = |label: &str| {
            let line = lines.find(|line| line.starts_with(label));
            let line = line.unwrap_or_else(|| panic!("{at} ended before it said {label}"));
            line[label.len()..].trim().trim_end_matches('/').to_owned()
        };
        let (url, endpoint) = (after("pages"), after("robots"));
        self.server = Some(Server { process, url, endpoint });
    }
}

/// `PATH` with scripts in place of programs, then the programs of this build, then what there is.
pub(crate) fn path_with(folder: &Path, scripts: &[(&str, &str)]) -> String {
    let tools = folder.join(".tools");
    fs::create_dir_all(&tools).expect("a folder");
    for (name, text) in scripts {
        let script = tools.join(name);
        fs::write(&script, text).expect("a script");
        #[cfg(unix)]
        fs::set_permissions(&script, std::os::unix::fs::PermissionsExt::from_mode(0o755))
            .expect("executable");
    }
    let programs = program().parent().expect("its folder");
    let inherited = std::env::var("PATH").unwrap_or_default();
    format!("{}:{}:{inherited}", tools.display(), programs.display())
}

/// Longest run of one command.
const LONGEST: Duration = Duration::from_mins(10);

/// Stands for cargo: examples of this build are run, nothing is installed.
pub(crate) const CARGO: &str = r#"#!/usr/bin/env bash
set -euo pipefail
case "$1" in
install)
    test -f "$TESTED_SOURCES/${3:?}/Cargo.toml" ;;
test)
    # The README's second command: this test is one of its own.
    ;;
run)
    if [ "$*" = "run --release -- demo" ]; then
        # The README's first command: the demo has a test of its own.
        exit 0
    fi
    shift
    while [ "$1" != "--" ]; do
        if [ "$1" = "--example" ]; then example="$2"; fi
        shift
    done
    shift
    exec "$TESTED_PROGRAMS/examples/${example:?}" --endpoint "${TESTED_ENDPOINT:?}" "$@" ;;
*)
    echo "cargo $*: not run by the test" >&2
    exit 1 ;;
esac
"#;

fn quoted(command: &str) -> String {
    format!("'{}'", command.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_read_with_their_status_and_their_files() {
        let text = "a\n```sh\nwaymark serve   # x\n# only this\nb \\\n  --c\n```\n   <!-- status 5 -->\n   ```sh\n   d\n   ```\n\
                    ```toml w.toml\nx = 1\n```\n```bash\nros2 launch\n```\n```json\n{}\n```\n```sh\ne\n```\n";
        let run = |line, commands: &[&str], status| Block::Run {
            line,
            commands: commands.iter().map(|c| (*c).to_owned()).collect(),
            status,
        };
        assert_eq!(
            blocks(text),
            [
                run(2, &["waymark serve   # x", "b    --c"], 0),
                run(9, &["d"], 5),
                Block::File { name: "w.toml".into(), text: "x = 1\n".into() },
                Block::Elsewhere(vec!["ros2 launch".into()]),
                run(21, &["e"], 0),
            ]
        );
    }

    #[test]
    fn a_command_with_a_wrong_status_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let guide = folder.path().join("guide.md");
        let failed = |text: &str| {
            fs::write(&guide, text).expect("a guide");
            let run = std::panic::AssertUnwindSafe(|| run(&guide, folder.path(), &mut |_, _| ()));
            std::panic::catch_unwind(run).is_err()
        };
        assert!(!failed("```sh\ntrue\ntest -f guide.md\n```\n<!-- status 1 -->\n```sh\nfalse\n```\n"));
        assert!(failed("```sh\nfalse\n```\n"));
        assert!(failed("```sh\nfalse\ntrue\n```\n"));
        assert!(failed("<!-- status 1 -->\n```sh\ntrue\n```\n"));
        assert!(failed("```bash\nwaymark map list\n```\n"), "it must be run");
    }
}
