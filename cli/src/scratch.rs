//! A folder and a server's settings for one run.

use server::config::{Config, ConfigError, RawConfig};
use std::path::{Path, PathBuf};
use vision::params::preset::Preset;

/// Settings of a server that only this program knows of: free ports, and frames as large as the
/// wire allows. What it stores is removed again, so only a full disk stops it, not one that is
/// nearly full.
pub fn private_server(data: &Path, preset: Preset) -> Result<Config, ConfigError> {
    let mut raw = RawConfig {
        data: data.to_owned(),
        http: "127.0.0.1:0".to_owned(),
        zenoh: "tcp/127.0.0.1:0".to_owned(),
        preset,
        algorithm: preset.params(),
        ..RawConfig::default()
    };
    raw.limits.frame_bytes = protos::convert::frame::MAX_FRAME_IMAGE_BYTES;
    raw.limits.disk_percent = 100;
    Config::try_from(raw)
}

/// Exists as long as the value does.
#[derive(Debug)]
pub struct Folder(PathBuf);

impl Folder {
    /// Makes a new folder under the system's temporary folder; the name says what for.
    pub fn new(what: &str) -> std::io::Result<Self> {
        let base = std::env::temp_dir();
        let mut number = std::process::id();
        loop {
            let path = base.join(format!("waymark-{what}-{number}"));
            match std::fs::create_dir(&path) {
                Ok(()) => return Ok(Self(path)),
                Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {
                    number = number.wrapping_add(7919);
                }
                Err(error) => return Err(error),
            }
        }
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What cannot be removed stays in the temporary folder, which the system cleans.
        std::fs::remove_dir_all(&self.0).ok();
    }
}
