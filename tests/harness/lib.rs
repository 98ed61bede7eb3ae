//! Harness of the end-to-end tests: the real program as a child process that can be killed, a
//! server inside the test process, pictures to send. The claims are in `end_to_end/`, one a file.

pub mod bag;
pub mod bombs;
mod child;
pub mod command;
pub mod documents;
pub mod guide_files;
pub mod guide_output;
pub mod guides;
pub mod machines;
mod open_data;
pub mod phone;
pub mod pictures;
pub mod proxy;
pub mod robots;
pub mod ros;
pub mod router;
pub mod scenes;

pub use child::Child;
pub use open_data::{open_data, skipped};

use client::MapClient;
use reqwest::header::{AUTHORIZATION, HeaderMap};
use server::{
    RunningServer, Server,
    config::{Config, Limits, RawConfig},
};
use std::{
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};
use tempfile::TempDir;

/// Longest wait for something that should happen at once: long, for busy machines.
pub const SOON: Duration = Duration::from_mins(1);

/// A server inside the test, on free ports, with its own data directory.
#[derive(Debug)]
pub struct Inside {
    /// The server.
    pub server: RunningServer,
    data: TempDir,
}

impl Inside {
    /// Starts one with these limits.
    pub async fn start(limits: Limits) -> Self {
        Self::start_with(RawConfig { limits, ..RawConfig::default() }).await
    }

    /// Starts one with these settings but for data and addresses.
    pub async fn start_with(settings: RawConfig) -> Self {
        let data = TempDir::new().expect("a temporary directory");
        let protocol = if settings.tls.enabled { "tls" } else { "tcp" };
        let raw = RawConfig {
            limits: in_quick_motion(&settings.limits),
            data: data.path().to_owned(),
            http: "127.0.0.1:0".into(),
            zenoh: format!("{protocol}/127.0.0.1:0"),
            ..settings
        };
        let config = Config::try_from(raw).expect("a valid configuration");
        // Where it must be built, that is done now: it would starve a server at work.
        child::program();
        let server = Server::start(config).await.expect("the server starts");
        Self { server, data }
    }

    /// Its data directory.
    pub fn data(&self) -> &Path {
        self.data.path()
    }

    /// Base URL, without a slash at the end.
    pub fn url(&self) -> String {
        format!("http://{}", self.server.http_addr)
    }

    /// A client of this server.
    pub fn maps(&self) -> MapClient {
        MapClient::new(&self.url()).expect("a client")
    }
}

/// Robots of tests send the readings of minutes within seconds, and the disk of a test's machine
/// may be nearly full: limits that are left at their defaults do not hold them up.
fn in_quick_motion(limits: &Limits) -> Limits {
    let default = Limits::default();
    let raised = |of: fn(&Limits) -> u32| if of(limits) == of(&default) { 1_000_000 } else { of(limits) };
    Limits {
        robot_frames_per_s: raised(|l| l.robot_frames_per_s),
        robot_odometry_per_s: raised(|l| l.robot_odometry_per_s),
        robot_scans_per_s: raised(|l| l.robot_scans_per_s),
        token_requests_per_s: raised(|l| l.token_requests_per_s),
        address_requests_per_s: raised(|l| l.address_requests_per_s),
        disk_percent: if limits.disk_percent == default.disk_percent { 100 } else { limits.disk_percent },
        ..limits.clone()
    }
}

/// The local token of a server, found as the SDK finds it.
pub async fn token(url: &str) -> String {
    let found = MapClient::new(url).expect("a client").token_in_use().await.expect("the local token");
    found.expect("the server asks for a token")
}

/// A client for requests that the SDK does not make, with the local token of this server.
pub async fn http(url: &str) -> reqwest::Client {
    let mut headers = HeaderMap::new();
    headers.insert(AUTHORIZATION, format!("Bearer {}", token(url).await).parse().expect("a token"));
    plain_http().default_headers(headers).build().expect("a client")
}

/// A client of plain HTTP without a token.
pub fn plain_http() -> reqwest::ClientBuilder {
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let tls = rustls::ClientConfig::builder_with_provider(provider).with_safe_default_protocol_versions();
    let tls = tls.expect("versions").with_root_certificates(rustls::RootCertStore::empty());
    reqwest::Client::builder().no_proxy().tls_backend_preconfigured(tls.with_no_client_auth())
}

/// Polls until `ready` returns a value, at most [`SOON`].
pub async fn eventually<T, F: Future<Output = Option<T>>>(what: &str, mut ready: impl FnMut() -> F) -> T {
    let started = Instant::now();
    loop {
        if let Some(value) = ready().await {
            return value;
        }
        assert!(started.elapsed() < SOON, "{what}: not within {SOON:?}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}
