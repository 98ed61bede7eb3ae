//! Settings. In: a file, the environment and the command line ([`RawConfig`]). Out: checked settings ([`Config`]). Everything
//! has a default: the server starts without a file.
//!
//! Precedence, weakest first: defaults, TOML file, `WAYMARK_...` variables (`WAYMARK_LIMITS__FRAME_BYTES=100000`),
//! command line.

mod addresses;
mod backup;
mod error;
mod ros2;
mod router;
mod tls;

pub use backup::BackupSettings;
pub(crate) use backup::MAX_KEPT;
pub use error::ConfigError;
pub use ros2::{
    MAX_DOMAIN, MAX_KEY_PREFIX_BYTES, MAX_ROS2_ROBOTS, MAX_TRANSFORM_TOLERANCE_S, Middleware, PoseSource,
    RawRos2, RawRos2Camera, RawRos2Robot, Ros2Outputs, Ros2Robot,
};
pub use router::{JoinedRouter, MAX_ROUTER_ENDPOINTS, RawRouter, RouterCredentials};
pub use tls::{MAX_TLS_NAMES, OwnCertificate, RawTls, Tls};

use addresses::{is_loopback, zenoh_address, zenoh_endpoint};
use engine::decode::ImageLimits;
use figment::{
    Figment,
    providers::{Env, Format, Toml},
};
use protos::Name;
use serde::{Deserialize, Serialize};
use std::{
    borrow::Cow,
    net::SocketAddr,
    path::{Path, PathBuf},
    sync::Arc,
};
use vision::{model::MAX_LANDMARKS, params::Params};

/// Variables that begin with `WAYMARK_` but are read by the command line, not by the settings.
const NOT_SETTINGS: [&str; 6] = ["config", "server", "map", "log", "token", "robot_file"];
/// Most vision threads that can be asked for.
pub const MAX_WORKERS: usize = 256;

/// Settings of file, environment and command line, unchecked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RawConfig {
    /// Directory of the database.
    pub data: PathBuf,
    /// Address and port of the HTTP interface; port 0 takes a free one.
    pub http: String,
    /// Where the zenoh router listens, as zenoh writes it; port 0 takes a free one. Empty: `tcp/127.0.0.1:7447`, or
    /// `tls/127.0.0.1:7447` with encryption.
    pub zenoh: String,
    /// Name in every key: `waymark/1/{fleet}/...`.
    pub fleet: String,
    /// Name of the server among those of a router. Empty: one is made once and stays in the data directory.
    pub server_name: String,
    /// Vision threads; 0 takes one per core.
    pub workers: usize,
    /// Searches every frame for all landmarks of its map. Otherwise, while a robot's pose is supported and the landmarks that
    /// it expects are found, every third frame of a camera; the others are answered by the expected landmarks alone and say
    /// so (`Answer.only_expected`).
    pub search_every_frame: bool,
    /// Allows plain-text listeners beyond loopback.
    pub insecure: bool,
    /// Encryption, of HTTP and of robots' connections.
    pub tls: RawTls,
    /// A router that the server joins instead of being one.
    pub router: RawRouter,
    /// Backups.
    pub backup: BackupSettings,
    /// Robots of ROS 2.
    pub ros2: RawRos2,
    /// Every bound.
    pub limits: Limits,
    /// Parameters of the algorithms. Models learnt under other distance parameters are refused.
    pub algorithm: Params,
}

impl Default for RawConfig {
    fn default() -> Self {
        Self {
            data: PathBuf::from("waymark-data"),
            http: "127.0.0.1:8080".into(),
            zenoh: String::new(),
            fleet: "default".into(),
            server_name: String::new(),
            workers: 0,
            search_every_frame: true,
            insecure: false,
            tls: RawTls::default(),
            router: RawRouter::default(),
            backup: BackupSettings::default(),
            ros2: RawRos2::default(),
            limits: Limits::default(),
            algorithm: Params::default(),
        }
    }
}

/// Every bound of the server, each with its unit. A value beyond a bound is refused, never cut.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Largest message from a robot, in bytes. Up to 60 000 bytes fit one zenoh batch and are not fragmented. Raw colour of
    /// 640 x 480 takes 921 600, of 1280 x 1024 (the default's largest) 3 932 160. Each camera may have one frame waiting, so
    /// `cameras` times this bounds their memory.
    pub frame_bytes: usize,
    /// Largest frame, in pixels.
    pub frame_pixels: usize,
    /// Largest uploaded image, in bytes.
    pub upload_bytes: usize,
    /// Largest bundle of a map that is taken, in bytes.
    pub bundle_bytes: usize,
    /// Largest uploaded image, in pixels.
    pub upload_pixels: usize,
    /// Largest JSON request, in bytes.
    pub json_bytes: usize,
    /// Oldest frame that work is still started on, in ms after receipt; a robot may ask for less.
    pub frame_deadline_ms: u32,
    /// Maps.
    pub maps: usize,
    /// Landmarks in one map.
    pub landmarks: usize,
    /// Views of one landmark.
    pub views: usize,
    /// Wall segments of one map.
    pub laser_segments: usize,
    /// Robots.
    pub robots: usize,
    /// Cameras with a slot.
    pub cameras: usize,
    /// HTTP connections at a time.
    pub connections: usize,
    /// Live event streams (SSE) at a time.
    pub streams: usize,
    /// Seconds until the head of a request must be there.
    pub header_timeout_s: u64,
    /// Seconds until a request must be answered; event streams are not bound by it.
    pub request_timeout_s: u64,
    /// Longest time for a request that brings or takes the bundle of a map, in seconds.
    pub bundle_timeout_s: u64,
    /// Seconds for which a client may leave an answer unread before its connection is closed; event streams that have
    /// nothing to send are not bound by it.
    pub write_timeout_s: u64,
    /// Requests at a time with a body of more than 64 KiB, or of unknown length: what their bodies take in memory is
    /// bounded by this times the largest body.
    pub uploads: usize,
    /// Seconds that such a request waits for its place before it is refused.
    pub upload_wait_s: u64,
    /// Most items on a page of a list.
    pub page: usize,
    /// Commands waiting for the writer.
    pub write_queue: usize,
    /// Jobs waiting or running.
    pub jobs: usize,
    /// Finished jobs that are retained.
    pub jobs_kept: usize,
    /// Answers to frames that are stored; the oldest go.
    pub stored_answers: usize,
    /// Bytes of frames that are kept in memory to try drafts with; the oldest go.
    pub replay_bytes: usize,
    /// Answers to creations that are kept for repeats, for a day at most; the oldest go.
    pub kept_answers: usize,
    /// Commits of each map that are kept; the oldest go.
    pub kept_commits: usize,
    /// Bytes of each map that are stored only for its kept commits, about; the oldest commits go.
    pub history_bytes: usize,
    /// Entries of the audit log; the oldest are forgotten.
    pub audit_entries: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            frame_bytes: 4 << 20,
            frame_pixels: 2_304_000,
            upload_bytes: 16 << 20,
            bundle_bytes: 1 << 30,
            upload_pixels: vision::frame::MAX_AREA_PX,
            json_bytes: 2 << 20,
            frame_deadline_ms: 500,
            maps: 200,
            landmarks: 2_000,
            views: 200,
            laser_segments: 20_000,
            robots: 1_000,
            cameras: 2_000,
            connections: 256,
            streams: 64,
            header_timeout_s: 5,
            request_timeout_s: 30,
            bundle_timeout_s: 600,
            write_timeout_s: 20,
            uploads: 16,
            upload_wait_s: 5,
            page: 500,
            write_queue: 256,
            jobs: 64,
            jobs_kept: 1_000,
            stored_answers: 2_000,
            replay_bytes: 64 << 20,
            kept_answers: 10_000,
            kept_commits: 1_000,
            history_bytes: 4 << 30,
            audit_entries: 100_000,
        }
    }
}

impl Limits {
    /// Name and value of every bound that must not be 0.
    fn counts(&self) -> [(&'static str, usize); 29] {
        [
            ("limits.frame_bytes", self.frame_bytes),
            ("limits.frame_pixels", self.frame_pixels),
            ("limits.upload_bytes", self.upload_bytes),
            ("limits.bundle_bytes", self.bundle_bytes),
            ("limits.bundle_timeout_s", self.bundle_timeout_s as usize),
            ("limits.upload_pixels", self.upload_pixels),
            ("limits.json_bytes", self.json_bytes),
            ("limits.frame_deadline_ms", self.frame_deadline_ms as usize),
            ("limits.maps", self.maps),
            ("limits.landmarks", self.landmarks),
            ("limits.views", self.views),
            ("limits.laser_segments", self.laser_segments),
            ("limits.robots", self.robots),
            ("limits.cameras", self.cameras),
            ("limits.connections", self.connections),
            ("limits.header_timeout_s", self.header_timeout_s as usize),
            ("limits.request_timeout_s", self.request_timeout_s as usize),
            ("limits.write_timeout_s", self.write_timeout_s as usize),
            ("limits.uploads", self.uploads),
            ("limits.upload_wait_s", self.upload_wait_s as usize),
            ("limits.page", self.page),
            ("limits.write_queue", self.write_queue),
            ("limits.jobs", self.jobs),
            ("limits.stored_answers", self.stored_answers),
            ("limits.replay_bytes", self.replay_bytes),
            ("limits.kept_answers", self.kept_answers),
            ("limits.kept_commits", self.kept_commits),
            ("limits.history_bytes", self.history_bytes),
            ("limits.audit_entries", self.audit_entries),
        ]
    }

    /// Limits of an uploaded picture.
    pub fn upload(&self) -> ImageLimits {
        ImageLimits { bytes: self.upload_bytes, pixels: self.upload_pixels }
    }
}

impl RawConfig {
    /// Defaults, then the file (which must exist if named), then the environment.
    pub fn read(file: Option<&Path>) -> Result<Self, ConfigError> {
        // Defaults are left to serde: as values they would stand beside a key of an earlier build.
        let mut figment = Figment::new();
        if let Some(path) = file {
            figment = figment.merge(Toml::file_exact(path));
        }
        figment
            .merge(Env::prefixed("WAYMARK_").ignore(&NOT_SETTINGS).split("__"))
            .extract()
            .map_err(|e| ConfigError::Read(Box::new(e)))
    }
}

/// The settings the server runs on.
#[derive(Debug, Clone, PartialEq)]
pub struct Config {
    /// Directory of the database.
    pub data: PathBuf,
    /// Where HTTP listens; port 0 takes a free one.
    pub http_addr: SocketAddr,
    /// Where the zenoh router listens, `tcp/HOST:PORT` or `tls/HOST:PORT`; port 0 takes a free one.
    pub zenoh_endpoint: String,
    /// The router that is joined; then the server opens no listener for robots.
    pub router: Option<JoinedRouter>,
    /// Name in every key.
    pub fleet: Name,
    /// The server's name; `None`: that of the data directory.
    pub server_name: Option<Name>,
    /// Vision threads, at least 1.
    pub workers: usize,
    /// Whether every frame is searched for all landmarks of its map.
    pub search_every_frame: bool,
    /// Encryption; `None`: there is none.
    pub tls: Option<Tls>,
    /// Backups.
    pub backup: BackupSettings,
    /// Robots of ROS 2.
    pub ros2: Vec<Ros2Robot>,
    /// Every bound.
    pub limits: Limits,
    /// Parameters of the algorithms.
    pub params: Arc<Params>,
}

impl Config {
    /// The listeners that other machines can reach, by setting, with their addresses: they are not encrypted.
    pub fn plain_text_beyond_loopback(&self) -> Vec<(&'static str, String)> {
        let is_plain = |(is_tls, address): &(bool, SocketAddr)| !is_tls && !is_loopback(address.ip());
        let own = self.router.is_none().then(|| zenoh_address("zenoh", &self.zenoh_endpoint).ok());
        let zenoh = own.flatten().filter(is_plain);
        let joined = self.router.iter().flat_map(JoinedRouter::plain_beyond_loopback);
        let joined = joined.map(|endpoint| ("router.connect", endpoint.clone()));
        let is_http_plain = self.tls.is_none() && !is_loopback(self.http_addr.ip());
        let http = is_http_plain.then(|| ("http", self.http_addr.to_string()));
        let zenoh = zenoh.map(|_| ("zenoh", self.zenoh_endpoint.clone()));
        http.into_iter().chain(zenoh).chain(joined).collect()
    }
}

impl TryFrom<RawConfig> for Config {
    type Error = ConfigError;

    fn try_from(raw: RawConfig) -> Result<Self, ConfigError> {
        let http_addr: SocketAddr = raw
            .http
            .parse()
            .map_err(|e| invalid("http", format!("`{}` is not ADDRESS:PORT ({e})", raw.http)))?;
        let tls = tls::checked(raw.tls)?;
        let router = router::checked(raw.router, raw.insecure)?;
        if router.is_some() {
            router::listens_for_no_robots(&raw.zenoh, tls.as_ref(), &raw.ros2)?;
        }
        let zenoh_endpoint = zenoh_endpoint(raw.zenoh, tls.is_some());
        let (zenoh_is_tls, zenoh_addr) = zenoh_address("zenoh", &zenoh_endpoint)?;
        if zenoh_is_tls && tls.is_none() {
            return Err(invalid("zenoh", format!("`{zenoh_endpoint}` is encrypted: set tls.enabled, too")));
        }
        for (field, value, is_plain, ip) in [
            ("http", &raw.http, tls.is_none(), http_addr.ip()),
            ("zenoh", &zenoh_endpoint, !zenoh_is_tls, zenoh_addr.ip()),
        ] {
            if is_plain && !raw.insecure && !is_loopback(ip) {
                return Err(ConfigError::NotLoopback { field, value: value.clone() });
            }
        }
        let fleet = Name::new(raw.fleet).map_err(|e| invalid("fleet", e.to_string()))?;
        let server_name = Some(raw.server_name).filter(|name| !name.is_empty()).map(Name::new).transpose();
        let server_name = server_name.map_err(|e| invalid("server_name", e.to_string()))?;
        if raw.workers > MAX_WORKERS {
            return Err(invalid("workers", format!("{} is more than {MAX_WORKERS}", raw.workers)));
        }
        for (field, value) in raw.limits.counts() {
            if value == 0 {
                return Err(invalid(field, "must be at least 1".into()));
            }
        }
        for (field, value) in [
            ("limits.frame_pixels", raw.limits.frame_pixels),
            ("limits.upload_pixels", raw.limits.upload_pixels),
        ] {
            if value > vision::frame::MAX_AREA_PX {
                return Err(invalid(
                    field,
                    format!("{value} is more than {} px", vision::frame::MAX_AREA_PX),
                ));
            }
        }
        if raw.limits.landmarks > MAX_LANDMARKS {
            return Err(invalid("limits.landmarks", format!("more than {MAX_LANDMARKS}")));
        }
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        Ok(Self {
            data: raw.data,
            http_addr,
            zenoh_endpoint,
            router,
            fleet,
            server_name,
            workers: if raw.workers == 0 { cores } else { raw.workers },
            search_every_frame: raw.search_every_frame,
            tls,
            backup: backup::checked(raw.backup)?,
            ros2: ros2::checked(raw.ros2)?,
            limits: raw.limits,
            params: Arc::new(raw.algorithm),
        })
    }
}

impl Default for Config {
    fn default() -> Self {
        Self::try_from(RawConfig::default()).expect("the defaults are valid")
    }
}

fn invalid(field: impl Into<Cow<'static, str>>, reason: String) -> ConfigError {
    ConfigError::Invalid { field: field.into(), reason }
}

#[cfg(test)]
mod tests;
