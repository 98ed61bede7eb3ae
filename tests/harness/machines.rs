//! Machines for guides that speak of two: network namespaces on this one, joined by a cable. Linux,
//! by root.

use crate::guides::{CARGO, commands, path_with};
use std::{
    fs,
    io::{BufRead as _, BufReader},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
};

/// Copies to a machine: `scp -r FILE... USER@ADDRESS:`.
const SCP: &str = r#"#!/usr/bin/env bash
set -euo pipefail
[ "$1" = "-r" ] && shift
cp -r "${@:1:$#-1}" "${TESTED_MACHINES:?}/$(echo "${@: -1}" | sed 's/.*@\(.*\):/\1/')/"
"#;

/// A machine with one address.
#[derive(Debug)]
pub struct Machine {
    namespace: String,
    folder: PathBuf,
    path: String,
    machines: PathBuf,
    servers: Vec<Child>,
}

/// Runs a program. What it says if it fails.
fn run(command: &mut Command) -> Result<(), String> {
    let done = command.output().map_err(|error| error.to_string())?;
    if done.status.success() {
        return Ok(());
    }
    Err(format!(
        "{command:?}: {}{}",
        String::from_utf8_lossy(&done.stdout),
        String::from_utf8_lossy(&done.stderr)
    ))
}

fn ip(arguments: &str) -> Result<(), String> {
    run(Command::new("ip").args(arguments.split(' ')))
}

/// Two machines that reach each other, with folders named by their addresses. An error says why
/// there are none here.
pub fn pair(within: &Path, addresses: [&str; 2]) -> Result<[Machine; 2], String> {
    let ends = ["a", "b"].map(|end| format!("wm{end}{}", std::process::id()));
    let made = ends.iter().zip(addresses).map(|(namespace, address)| {
        ip(&format!("netns add {namespace}"))?;
        let folder = within.join(address);
        fs::create_dir_all(&folder).map_err(|error| error.to_string())?;
        let path = path_with(&folder, &[("cargo", CARGO), ("scp", SCP)]);
        let (namespace, machines, servers) = (namespace.clone(), within.to_owned(), Vec::new());
        Ok(Machine { namespace, folder, path, machines, servers })
    });
    // Namespaces that were made go with their machines, also where the next one fails.
    let made = made.collect::<Result<Vec<_>, String>>()?;
    let [a, b] = <[Machine; 2]>::try_from(made).map_err(|_other| "there are two".to_owned())?;
    ip(&format!("link add eth0 netns {} type veth peer name eth0 netns {}", a.namespace, b.namespace))?;
    for (machine, address) in [&a, &b].into_iter().zip(addresses) {
        let namespace = &machine.namespace;
        ip(&format!("-n {namespace} addr add {address}/24 dev eth0"))?;
        ip(&format!("-n {namespace} link set eth0 up"))?;
        ip(&format!("-n {namespace} link set lo up"))?;
    }
    Ok([a, b])
}

impl Machine {
    /// Its folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    fn shell(&self, command: &str) -> Command {
        let mut shell = Command::new("ip");
        shell.args(["netns", "exec", &self.namespace, "bash", "-euo", "pipefail", "-c", command]);
        for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("WAYMARK_")) {
            shell.env_remove(name);
        }
        shell
            .env_remove("XDG_CONFIG_HOME")
            .env_remove("XDG_DATA_HOME")
            .env("HOME", &self.folder)
            .env("PATH", &self.path);
        shell.env("TESTED_MACHINES", &self.machines).env("TESTED_ENDPOINT", "tcp/127.0.0.1:1");
        shell.env("TESTED_PROGRAMS", crate::command::program().parent().expect("its folder"));
        shell.current_dir(&self.folder).stdin(Stdio::null());
        shell
    }

    /// Runs a command of a guide: its status and what it says. `waymark serve` goes on until the
    /// machine is dropped.
    pub fn run(&mut self, command: &str) -> (i32, String) {
        if !command.starts_with("waymark serve ") {
            let done = self.shell(&format!("timeout 300 {command}")).output().expect("ip");
            let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
            return (done.status.code().unwrap_or(-1), text(&done.stdout) + &text(&done.stderr));
        }
        let mut shell = self.shell(&format!("exec {command}"));
        let mut server = shell.stdout(Stdio::piped()).spawn().expect("ip");
        let lines = BufReader::new(server.stdout.take().expect("its output")).lines();
        let said: Vec<String> = lines.take(4).map(|line| line.expect("a line")).collect();
        self.servers.push(server);
        (i32::from(said.len() != 4), said.join("\n"))
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        for server in &mut self.servers {
            // Fails only when it has ended already.
            drop(server.kill());
            drop(server.wait());
        }
        drop(ip(&format!("netns del {}", self.namespace)));
    }
}

/// The blocks ```` ```sh NAME ```` of a guide, with the exit status of their last command.
pub fn blocks_for(text: &str, names: [&str; 2]) -> Vec<(usize, Vec<String>, i32)> {
    let (mut found, mut status) = (Vec::new(), 0);
    let mut lines = text.lines().map(str::trim_start);
    while let Some(line) = lines.next() {
        if let Some(n) = line.strip_prefix("<!-- status ").and_then(|rest| rest.split(' ').next()) {
            status = n.parse().expect("<!-- status NUMBER -->");
        }
        let machine = names.iter().position(|name| line == format!("```sh {name}"));
        if let Some(machine) = machine {
            let body: Vec<&str> = lines.by_ref().take_while(|line| !line.starts_with("```")).collect();
            found.push((machine, commands(&body.join("\n")), std::mem::take(&mut status)));
        } else if line.starts_with("```") {
            // To the end of a block that is for nobody here.
            lines.by_ref().find(|line| line.starts_with("```"));
            // A status belongs to the block after it.
            status = 0;
        }
    }
    found
}
