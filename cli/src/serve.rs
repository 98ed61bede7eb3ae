//! `waymark serve`: the server, until Ctrl-C or SIGTERM.

use super::{
    failure::{Class, Failure},
    notify::Supervisor,
    serve_panic::end_after_a_panic_of_zenoh,
};
use anyhow::{Context, anyhow};
use clap::Args;
use engine::vitals;
use server::{
    RunningServer, Server, StartError,
    config::{Config, PostgresAddress, RawConfig},
};
use std::{
    io::{IsTerminal as _, Write as _},
    path::{Path, PathBuf},
    time::Duration,
};
use tokio::signal::unix::{Signal, SignalKind, signal};
use vision::params::preset::Preset;

/// Time that the other parts have to end after one has failed.
const STOP_AFTER_FAILURE: Duration = Duration::from_secs(10);

/// What `--help` teaches.
const HELP: &str = r"Runs the server: zenoh for robots, HTTP for people and programs, one SQLite file for everything that lasts.

Starts with no settings at all; then the page is at http://127.0.0.1:8080/, the API with its interactive
documentation at http://127.0.0.1:8080/api/docs/, and robots connect to tcp/127.0.0.1:7447.

Teach a first landmark from a photograph of a picture on a wall:

  waymark map create office
  waymark landmark teach poster photo.jpg --size 0.60x0.84
  waymark recognise other-photo.jpg

Commands and SDKs of the same user on the same machine find the token that `serve` writes to local-token in its data
directory. `waymark open` prints a link that opens the page; `waymark token create` makes tokens for others.

Maps are in a database of PostgreSQL instead (docs/OPERATIONS.md) with its address; its password belongs into
WAYMARK_STORE, PGPASSWORD or ~/.pgpass, as others see the command line:

  waymark serve --store postgres://waymark@db.example.org/waymark

For other machines, encrypted, with a certificate for each robot (`waymark robot enrol`):

  waymark serve --tls --tls-name 192.168.1.4 --http 0.0.0.0:8080 --zenoh tls/0.0.0.0:7447

Several servers, each with its own maps, share one zenoh router (docs/guides/several-servers.md):

  waymark serve --router tcp/127.0.0.1:7447 --server-name hall --http 127.0.0.1:8081

With OTEL_EXPORTER_OTLP_ENDPOINT=http://127.0.0.1:4318 traces of requests and frames go to a collector of OpenTelemetry.

Runs until Ctrl-C or SIGTERM. If a part of it ends by itself, /readyz answers 503 with its name and the program ends with
an error: start it again, and it goes on from what is on the disk.

Settings come from defaults, then the file, then WAYMARK_... variables, then these options;
server/config.example.toml lists all of them.";

/// Runs the server until it is told to stop.
#[derive(Debug, Clone, Args)]
#[command(about = "Runs the server: zenoh for robots, HTTP for people and programs", long_about = HELP)]
pub(super) struct Serve {
    /// Settings file, TOML.
    #[arg(long, env = "WAYMARK_CONFIG", value_name = "FILE")]
    config: Option<PathBuf>,
    /// Directory of the database; made if missing [default: the user's folder for data,
    /// ~/.local/share/waymark on Linux].
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// A database of PostgreSQL that maps are stored in, `postgres://USER@HOST/NAME` [default:
    /// SQLite in the data directory].
    #[arg(long, value_name = "URL")]
    store: Option<String>,
    /// Where HTTP listens; port 0 takes a free one [default: 127.0.0.1:8080].
    #[arg(long, value_name = "ADDR")]
    http: Option<String>,
    /// Where robots connect; port 0 takes a free one [default: tcp/127.0.0.1:7447, with encryption
    /// tls/127.0.0.1:7447].
    #[arg(long, value_name = "ENDPOINT")]
    zenoh: Option<String>,
    /// Where metrics are served without a token, besides /metrics for viewers; port 0 takes a free
    /// one [default: nowhere].
    #[arg(long, value_name = "ADDR")]
    metrics: Option<String>,
    /// Name in every key, waymark/1/{fleet}/... [default: default].
    #[arg(long, value_name = "NAME")]
    fleet: Option<String>,
    /// Vision threads [default: one per core].
    #[arg(long, value_name = "N")]
    workers: Option<usize>,
    /// Encrypts connections, with a certificate of the server's own authority unless the settings
    /// name files.
    #[arg(long)]
    tls: bool,
    /// A DNS name or address by which clients reach this server, for its certificate; may be given
    /// several times.
    #[arg(long, value_name = "NAME", requires = "tls")]
    tls_name: Vec<String>,
    /// A zenoh router to join instead of being one, such as tls/router.example.org:7447; may be
    /// given several times.
    #[arg(long, value_name = "ENDPOINT", conflicts_with = "zenoh")]
    router: Vec<String>,
    /// The server's name among those of a router [default: made once, and kept in the data
    /// directory].
    #[arg(long, value_name = "NAME")]
    server_name: Option<String>,
    /// Allows addresses beyond loopback in plain text. There nothing is encrypted and robots are
    /// not authenticated: only for a network that is trusted as a whole. Encrypted endpoints need
    /// no such permission.
    #[arg(long)]
    insecure: bool,
    /// The pipeline: `default`, or that of the `paper`, for experiments: relaxation, icons alone. A
    /// map may have its own: `waymark map create --preset` [default: default].
    #[arg(long, value_name = "NAME")]
    preset: Option<Preset>,
}

impl Serve {
    /// File and environment, then the options given.
    fn settings(self) -> anyhow::Result<Config> {
        if let Some(file) = self.config.as_deref().filter(|file| !file.exists()) {
            let sentence = format!("There is no settings file {}.", file.display());
            let advice = "A server starts without one; server/config.example.toml lists all settings.";
            return Err(Failure::new(Class::NotFound, "no_settings_file", sentence).advise(advice).into());
        }
        let mut raw = RawConfig::read_over(self.preset, self.config.as_deref())?;
        if let Some(data) = self.data {
            raw.data = data;
        }
        if let Some(store) = self.store {
            raw.store = store;
        }
        if let Some(http) = self.http {
            raw.http = http;
        }
        if let Some(zenoh) = self.zenoh {
            raw.zenoh = zenoh;
        }
        if let Some(metrics) = self.metrics {
            raw.metrics = metrics;
        }
        if let Some(fleet) = self.fleet {
            raw.fleet = fleet;
        }
        if let Some(workers) = self.workers {
            raw.workers = workers;
        }
        if !self.router.is_empty() {
            raw.router.connect = self.router;
        }
        if let Some(name) = self.server_name {
            raw.server_name = name;
        }
        raw.insecure |= self.insecure;
        raw.tls.enabled |= self.tls;
        raw.tls.names.extend(self.tls_name);
        Ok(Config::try_from(raw)?)
    }

    pub(super) async fn run(self) -> anyhow::Result<()> {
        // This process is the server's own: what its libraries make is private, too, not only what
        // it makes itself.
        #[cfg(unix)]
        rustix::process::umask(rustix::fs::Mode::from_raw_mode(0o077));
        let config = self.settings()?;
        warn_of_plain_text(&config);
        for variable in RawConfig::unknown_variables() {
            let follows = "it is left out; server/config.example.toml lists all settings";
            tracing::warn!(variable, follows, "unknown_variable");
        }
        end_after_a_panic_of_zenoh();
        let (data, store) = (config.data.clone(), config.store.clone());
        let server = Server::start(config).await.map_err(not_started)?;
        let signals = StopSignals::heard()?;
        ready(&server, &data, store.as_ref());
        let metrics = server.metrics_addr.map(|address| address.to_string()).unwrap_or_default();
        tracing::info!(data = %data.display(), http = %server.http_addr, zenoh = server.zenoh_endpoint, metrics, "ready");
        let supervisor = Supervisor::of_environment();
        supervisor.tell("READY=1");
        tokio::select! {
            stopped = signals.first() => stopped?,
            failure = server.failed() => return Err(after(&failure, server).await),
            never = supervisor.keep_alive(server.vitals()) => match never {},
        }
        supervisor.tell("STOPPING=1");
        tracing::info!("stopping");
        server.stop().await;
        Ok(())
    }
}

/// `--insecure` is a decision of the operator; the log of every start says what it means.
fn warn_of_plain_text(config: &Config) {
    for (what, address) in config.plain_text_beyond_loopback() {
        tracing::warn!(
            what,
            address,
            follows =
                "whoever reaches it can read and change everything: trust that network, or use a tunnel",
            "plain_text_beyond_loopback"
        );
    }
}

/// An address that another program has is told with the option that names another.
fn not_started(error: StartError) -> anyhow::Error {
    if let StartError::StoreAway(_) = error {
        let advice =
            "Check that PostgreSQL runs there and takes connections from here, and the address in --store.";
        return Failure::new(Class::Unreachable, "store_away", error.to_string()).advise(advice).into();
    }
    let Some(option) = error.taken_address() else { return error.into() };
    let advice = format!("Another program listens there: end it, or choose another address with {option}.");
    Failure::new(Class::Conflict, "address_taken", error.to_string()).advise(advice).into()
}

/// Stops what is left of a server and says what to do.
async fn after(failure: &vitals::Failure, server: RunningServer) -> anyhow::Error {
    // What is left of it may not come to an end.
    if tokio::time::timeout(STOP_AFTER_FAILURE, server.stop()).await.is_err() {
        tracing::error!("the rest of the server did not stop in time");
    }
    anyhow!("{failure}; start the server again: it goes on from what is on the disk")
}

/// The first lines on stdout, for people and for programs that started this one on port 0. The link
/// is a secret: where standard output is no terminal it may be a log.
fn ready(server: &RunningServer, data: &Path, store: Option<&PostgresAddress>) {
    let link = server.page_link().filter(|_| std::io::stdout().is_terminal());
    let open = link.unwrap_or_else(|| "waymark open prints a link that opens the page".to_owned());
    let store = store.map(|store| format!("store   {store}\n")).unwrap_or_default();
    let text = format!(
        "pages   {}/\nrobots  {}\ntoken   {}\nopen    {open}\nserver  {}\ndata    {}\n{store}",
        server.url(),
        server.zenoh_endpoint,
        server.local_token_file().display(),
        server.server,
        data.display()
    );
    // At once: who reads only the first lines may close the pipe after them.
    std::io::stdout().write_all(text.as_bytes()).ok();
}

/// SIGTERM and Ctrl-C. They are heard as soon as this is made, before anybody is told that the
/// server is ready.
#[cfg(unix)]
struct StopSignals {
    terminate: Signal,
    interrupt: Signal,
}

#[cfg(unix)]
impl StopSignals {
    fn heard() -> anyhow::Result<Self> {
        let terminate = signal(SignalKind::terminate()).context("SIGTERM")?;
        Ok(Self { terminate, interrupt: signal(SignalKind::interrupt()).context("Ctrl-C")? })
    }

    async fn first(mut self) -> anyhow::Result<()> {
        tokio::select! {
            _ = self.interrupt.recv() => Ok(()),
            _ = self.terminate.recv() => Ok(()),
        }
    }
}

#[cfg(not(unix))]
struct StopSignals;

#[cfg(not(unix))]
impl StopSignals {
    fn heard() -> anyhow::Result<Self> {
        Ok(Self)
    }

    async fn first(self) -> anyhow::Result<()> {
        tokio::signal::ctrl_c().await.context("Ctrl-C")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test(flavor = "multi_thread")]
    async fn a_part_that_ends_ends_the_program_with_an_error() {
        let data = tempfile::tempdir().unwrap();
        let raw = || RawConfig {
            data: data.path().to_owned(),
            http: "127.0.0.1:0".into(),
            zenoh: "tcp/127.0.0.1:0".into(),
            ..RawConfig::default()
        };
        let server = Server::start(Config::try_from(raw()).unwrap()).await.unwrap();
        // As a worker thread does that unwinds.
        drop(server.vitals().begin("the worker thread vision-7"));
        let failure = tokio::time::timeout(Duration::from_secs(5), server.failed()).await.unwrap();
        let error = after(&failure, server).await.to_string();
        assert!(error.contains("vision-7 has ended") && error.contains("start the server again"), "{error}");
        // Everything else was stopped: its lock is free. And while nothing ends, nothing fails.
        let again = Server::start(Config::try_from(raw()).unwrap()).await.unwrap();
        assert_eq!(again.vitals().failure(), None);
        again.stop().await;
    }
}
