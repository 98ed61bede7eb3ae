//! Settings. In: a file, the environment and the command line ([`RawConfig`]). Out: checked
//! settings ([`Config`]). Everything has a default: the server starts without a file.
//!
//! Precedence, weakest first: defaults, TOML file, `WAYMARK_...` variables
//! (`WAYMARK_LIMITS__FRAME_BYTES=100000`), command line.

mod addresses;
mod backup;
mod environment;
mod error;
mod frame_search;
mod limits;
mod memory;
mod postgres;
mod ros2;
mod router;
mod tls;

pub use backup::BackupSettings;
pub(crate) use backup::MAX_KEPT;
pub use environment::default_data;
pub use error::ConfigError;
pub use frame_search::{BUSY_FRAMES_PER_WORKER, FrameSearch};
pub use limits::Limits;
pub use memory::MemoryShare;
pub use postgres::PostgresAddress;
pub use ros2::{
    MAX_DOMAIN, MAX_KEY_PREFIX_BYTES, MAX_ROS2_ROBOTS, MAX_TRANSFORM_TOLERANCE_S, Middleware, PoseSource,
    RawRos2, RawRos2Camera, RawRos2Robot, Ros2Outputs, Ros2Robot,
};
pub use router::{JoinedRouter, MAX_ROUTER_ENDPOINTS, RawRouter, RouterCredentials};
pub use tls::{MAX_TLS_NAMES, OwnCertificate, RawTls, Tls};

use addresses::{is_loopback, socket_address, zenoh_address, zenoh_endpoint};
use environment::{PREFIX, is_known};
use figment::{
    Figment,
    providers::{Env, Format, Serialized, Toml},
};
use protos::Name;
use serde::{Deserialize, Serialize};
use std::{
    borrow::Cow,
    net::SocketAddr,
    path::{Path, PathBuf},
    sync::Arc,
};
use vision::params::{Params, preset::Preset};

/// Variables that begin with `WAYMARK_` but are read by the command line, not by the settings.
const NOT_SETTINGS: [&str; 8] =
    ["config", "server", "map", "log", "log_format", "token", "authority", "robot_file"];
/// Most vision threads that can be asked for.
pub const MAX_WORKERS: usize = 256;

/// Settings of file, environment and command line, unchecked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RawConfig {
    /// Directory of the database; empty: [`default_data`].
    pub data: PathBuf,
    /// A database of PostgreSQL that maps are stored in, `postgres://USER@HOST/NAME`; empty: SQLite
    /// in `data`.
    pub store: String,
    /// Address and port of the HTTP interface; port 0 takes a free one.
    pub http: String,
    /// Where the zenoh router listens, as zenoh writes it; port 0 takes a free one. Empty:
    /// `tcp/127.0.0.1:7447`, or `tls/127.0.0.1:7447` with encryption.
    pub zenoh: String,
    /// Address and port of a listener for metrics alone, which asks for no token; empty: none. Port
    /// 0 takes a free one.
    pub metrics: String,
    /// Name in every key: `waymark/1/{fleet}/...`.
    pub fleet: String,
    /// Name of the server among those of a router. Empty: one is made once and stays in the data
    /// directory.
    pub server_name: String,
    /// Vision threads; 0 takes one per core.
    pub workers: usize,
    /// When frames are searched for all landmarks of their map. The others are answered by the
    /// expected landmarks alone and say so (`Answer.only_expected`).
    pub search_frames: FrameSearch,
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
    /// The parameters that `algorithm` changes.
    pub preset: Preset,
    /// Parameters of the algorithms. Models learnt under other distance parameters are refused.
    pub algorithm: Params,
}

impl Default for RawConfig {
    fn default() -> Self {
        Self {
            data: PathBuf::new(),
            store: String::new(),
            http: "127.0.0.1:8080".into(),
            zenoh: String::new(),
            metrics: String::new(),
            fleet: "default".into(),
            server_name: String::new(),
            workers: 0,
            search_frames: FrameSearch::default(),
            insecure: false,
            tls: RawTls::default(),
            router: RawRouter::default(),
            backup: BackupSettings::default(),
            ros2: RawRos2::default(),
            limits: Limits::default(),
            preset: Preset::default(),
            algorithm: Params::default(),
        }
    }
}

impl RawConfig {
    /// Defaults, then the file (which must exist if named), then the environment; of that what is
    /// no setting is left out ([`Self::unknown_variables`]).
    pub fn read(file: Option<&Path>) -> Result<Self, ConfigError> {
        Self::read_over(None, file)
    }

    /// The same with this preset, whatever they name.
    pub fn read_over(preset: Option<Preset>, file: Option<&Path>) -> Result<Self, ConfigError> {
        // Defaults are left to serde.
        let mut figment = Figment::new();
        if let Some(path) = file {
            figment = figment.merge(Toml::file_exact(path));
        }
        let settings = environment::names();
        let variables = Env::prefixed(PREFIX).filter(move |name| is_known(name.as_str(), &settings));
        let read = |e| ConfigError::Read(Box::new(e));
        let mut figment = figment.merge(variables.ignore(&NOT_SETTINGS).split("__"));
        if let Some(preset) = preset {
            figment = figment.merge(Serialized::default("preset", preset));
        }
        let preset = if figment.contains("preset") {
            figment.extract_inner("preset").map_err(read)?
        } else {
            Preset::Default
        };
        if preset != Preset::Default {
            figment = figment.join(Serialized::default("algorithm", preset.params()));
        }
        figment.extract().map_err(read)
    }
}

/// The settings the server runs on.
#[derive(Debug, Clone, PartialEq)]
pub struct Config {
    /// Directory of the database.
    pub data: PathBuf,
    /// The database that maps are stored in; `None`: SQLite in `data`.
    pub store: Option<PostgresAddress>,
    /// Where HTTP listens; port 0 takes a free one.
    pub http_addr: SocketAddr,
    /// Where the zenoh router listens, `tcp/HOST:PORT` or `tls/HOST:PORT`; port 0 takes a free one.
    pub zenoh_endpoint: String,
    /// Where metrics are served without a token; `None`: nowhere.
    pub metrics_addr: Option<SocketAddr>,
    /// The router that is joined; then the server opens no listener for robots.
    pub router: Option<JoinedRouter>,
    /// Name in every key.
    pub fleet: Name,
    /// The server's name; `None`: that of the data directory.
    pub server_name: Option<Name>,
    /// Vision threads, at least 1.
    pub workers: usize,
    /// When frames are searched for all landmarks of their map.
    pub search_frames: FrameSearch,
    /// Encryption; `None`: there is none.
    pub tls: Option<Tls>,
    /// Backups.
    pub backup: BackupSettings,
    /// Robots of ROS 2.
    pub ros2: Vec<Ros2Robot>,
    /// Every bound.
    pub limits: Limits,
    /// The preset that `params` began with: its distance is that of new maps.
    pub preset: Preset,
    /// Parameters of the algorithms.
    pub params: Arc<Params>,
    /// Name of the layer between SQLite and the files, where a test has its own.
    #[cfg(test)]
    pub(crate) vfs: Option<&'static str>,
    /// Pages of the log from which on it is moved into the file, where a test has fewer.
    #[cfg(test)]
    pub(crate) log_pages: Option<i64>,
}

impl Config {
    /// Name of the layer between SQLite and the files; `None` takes SQLite's own.
    #[cfg_attr(not(test), expect(clippy::unused_self, reason = "only tests have another"))]
    pub(crate) fn sqlite_vfs(&self) -> Option<&'static str> {
        #[cfg(test)]
        return self.vfs;
        #[cfg(not(test))]
        None
    }

    /// Pages of the log from which on it is moved into the file, where a test has fewer.
    #[cfg_attr(not(test), expect(clippy::unused_self, reason = "only tests have another"))]
    pub(crate) fn log_pages(&self) -> Option<i64> {
        #[cfg(test)]
        return self.log_pages;
        #[cfg(not(test))]
        None
    }

    /// The listeners that other machines can reach, by setting, with their addresses: they are not
    /// encrypted.
    pub fn plain_text_beyond_loopback(&self) -> Vec<(&'static str, String)> {
        let is_plain = |(is_tls, address): &(bool, SocketAddr)| !is_tls && !is_loopback(address.ip());
        let own = self.router.is_none().then(|| zenoh_address("zenoh", &self.zenoh_endpoint).ok());
        let zenoh = own.flatten().filter(is_plain);
        let joined = self.router.iter().flat_map(JoinedRouter::plain_beyond_loopback);
        let joined = joined.map(|endpoint| ("router.connect", endpoint.clone()));
        let is_http_plain = self.tls.is_none() && !is_loopback(self.http_addr.ip());
        let http = is_http_plain.then(|| ("http", self.http_addr.to_string()));
        let metrics = self.metrics_addr.filter(|address| !is_loopback(address.ip()));
        let metrics = metrics.map(|address| ("metrics", address.to_string()));
        let zenoh = zenoh.map(|_| ("zenoh", self.zenoh_endpoint.clone()));
        http.into_iter().chain(zenoh).chain(metrics).chain(joined).collect()
    }
}

impl TryFrom<RawConfig> for Config {
    type Error = ConfigError;

    fn try_from(raw: RawConfig) -> Result<Self, ConfigError> {
        let http_addr = socket_address("http", &raw.http)?;
        let metrics_addr = match raw.metrics.as_str() {
            "" => None,
            address => Some(socket_address("metrics", address)?),
        };
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
            (
                "metrics",
                &raw.metrics,
                metrics_addr.is_some(),
                metrics_addr.map_or(http_addr.ip(), |at| at.ip()),
            ),
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
        raw.limits.check()?;
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        Ok(Self {
            store: PostgresAddress::checked(raw.store)?,
            data: if raw.data.as_os_str().is_empty() { default_data() } else { raw.data },
            http_addr,
            zenoh_endpoint,
            metrics_addr,
            router,
            fleet,
            server_name,
            workers: if raw.workers == 0 { cores } else { raw.workers },
            search_frames: raw.search_frames,
            tls,
            backup: backup::checked(raw.backup)?,
            ros2: ros2::checked(raw.ros2)?,
            limits: raw.limits,
            preset: raw.preset,
            params: Arc::new(raw.algorithm),
            #[cfg(test)]
            vfs: None,
            #[cfg(test)]
            log_pages: None,
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
