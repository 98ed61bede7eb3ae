//! The real program, `waymark serve`, as a child process: started on free ports, killed at any
//! moment.

use client::MapClient;
use std::{
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{ChildStderr, Command, ExitStatus, Stdio},
    sync::OnceLock,
};

/// Variables that tests read, and that are no settings.
const OF_TESTS: [&str; 5] =
    ["WAYMARK_KILLS", "WAYMARK_LONG", "WAYMARK_RUNS", "WAYMARK_SEED", "WAYMARK_SEEDS"];

/// A running `waymark serve`. Killed when dropped.
#[derive(Debug)]
pub struct Child {
    process: std::process::Child,
    /// Base URL, without a slash at the end.
    pub url: String,
    /// Its zenoh endpoint.
    pub zenoh: String,
}

impl Child {
    /// Starts the program on a data directory and waits until it says that it is ready.
    pub fn start(data: &Path) -> Self {
        Self::start_with(data, &[])
    }

    /// The same with these settings, as environment variables.
    pub fn start_with(data: &Path, settings: &[(&str, &str)]) -> Self {
        Self::start_from(&mut Self::command(data, settings))
    }

    /// The command that starts it.
    pub fn command(data: &Path, settings: &[(&str, &str)]) -> Command {
        let is_tls = settings.iter().any(|(name, _)| *name == "WAYMARK_TLS__ENABLED");
        let zenoh = if is_tls { "tls/127.0.0.1:0" } else { "tcp/127.0.0.1:0" };
        let mut command = Command::new(program());
        command
            .envs(settings.iter().copied())
            .env("WAYMARK_LOG", "warn")
            .args(["serve", "--http", "127.0.0.1:0", "--zenoh", zenoh, "--data"])
            .arg(data);
        for name in OF_TESTS {
            command.env_remove(name);
        }
        command
    }

    /// Starts the program as a server that joins the router at `router`, with these settings.
    pub fn joined(data: &Path, (router, name): (&str, &str), settings: &[(&str, &str)]) -> Self {
        Self::start_from(&mut Self::joins(data, (router, name), settings))
    }

    /// The command of that.
    pub fn joins(data: &Path, (router, name): (&str, &str), settings: &[(&str, &str)]) -> Command {
        let mut command = Command::new(program());
        command
            .envs(settings.iter().copied())
            .env("WAYMARK_LOG", "warn")
            .args(["serve", "--http", "127.0.0.1:0", "--router", router, "--server-name", name, "--data"])
            .arg(data);
        command
    }

    /// Starts that command and waits until it says that it is ready.
    pub fn start_from(command: &mut Command) -> Self {
        let mut process = command.stdout(Stdio::piped()).spawn().expect("the program starts");
        let stdout = process.stdout.take().expect("its output");
        let mut lines = BufReader::new(stdout).lines().map(|line| line.expect("a line"));
        let mut after = |label: &str| {
            let line =
                lines.next().unwrap_or_else(|| panic!("the server ended before it was ready ({label})"));
            let rest =
                line.strip_prefix(label).unwrap_or_else(|| panic!("`{line}` does not begin with `{label}`"));
            rest.trim().trim_end_matches('/').to_owned()
        };
        let (url, zenoh) = (after("pages"), after("robots"));
        // With TLS the address is that for other machines; this one is served in plain text.
        let port = url.strip_prefix("https://").and_then(|rest| rest.rsplit(':').next());
        let url = port.map_or(url.clone(), |port| format!("http://127.0.0.1:{port}"));
        Self { process, url, zenoh }
    }

    /// A client of this server.
    pub fn maps(&self) -> MapClient {
        MapClient::new(&self.url).expect("a client")
    }

    /// Number of the process.
    pub fn id(&self) -> u32 {
        self.process.id()
    }

    /// Its standard error, where the command was given a pipe for it.
    pub fn stderr(&mut self) -> ChildStderr {
        self.process.stderr.take().expect("a pipe")
    }

    /// How it has ended by itself; `None` while it runs.
    pub fn ended(&mut self) -> Option<ExitStatus> {
        self.process.try_wait().expect("its status")
    }

    /// SIGTERM: it ends in good order.
    pub fn stop(mut self) {
        let told = Command::new("kill").arg(self.process.id().to_string()).status().expect("kill");
        assert!(told.success() && self.process.wait().expect("wait").success(), "it stops");
    }

    /// SIGKILL: no destructor, no last write.
    pub fn kill(mut self) {
        self.process.kill().expect("kill");
        self.process.wait().expect("wait");
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        // Fails only when it has ended already.
        drop(self.process.kill());
        drop(self.process.wait());
    }
}

/// The program, built with the profile of the tests: cargo does not build another package's program
/// for a test. Built beside a test of the whole workspace, it takes the crates that the tests are
/// linked with; by itself it has features of its own, and half of the crates are built once more.
pub(crate) fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        // target/PROFILE/deps/end_to_end-HASH
        let exe = std::env::current_exe().expect("own path");
        let profile = exe.parent().and_then(Path::parent).expect("target directory");
        let mut cargo = Command::new(env!("CARGO"));
        cargo.args(["build", "--quiet", "--workspace", "--bin", "waymark", "--test", "wedged_router"]);
        cargo.current_dir(env!("CARGO_MANIFEST_DIR"));
        // `cargo test` sets these for its tests. Build scripts that read them would run again, and
        // half of the crates with them.
        for (name, _) in std::env::vars()
            .filter(|(name, _)| name.starts_with("CARGO_PKG_") || name.starts_with("CARGO_MANIFEST_"))
        {
            cargo.env_remove(name);
        }
        if profile.ends_with("release") {
            cargo.arg("--release");
        }
        assert!(cargo.status().expect("cargo").success(), "the program does not build");
        profile.join(format!("waymark{}", std::env::consts::EXE_SUFFIX))
    })
}
