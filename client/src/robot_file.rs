//! The file that `waymark robot enrol` writes: where a robot connects, and what it shows there.

use crate::{ClientError, RobotOptions};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Names the file for programs that are not told.
pub const ROBOT_FILE_VARIABLE: &str = "WAYMARK_ROBOT_FILE";
/// Largest file that is read, in bytes.
const MAX_BYTES: u64 = 64 << 10;

/// What a robot shows on an encrypted connection, and whom it trusts: PEM files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RobotTls {
    /// The robot's certificate.
    pub certificate: PathBuf,
    /// Its private key.
    pub key: PathBuf,
    /// Who signs the server's certificate, besides the authorities that browsers know.
    pub authority: Option<PathBuf>,
    /// When the certificate ends, ms since the Unix epoch; `None` if that is not known.
    pub expires_ms: Option<i64>,
}

/// The file's content. Paths are relative to its folder.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RobotFile {
    /// Where the robot connects: `tls/HOST:PORT`.
    pub endpoint: String,
    /// Name of the fleet.
    pub fleet: String,
    /// Name of the robot.
    pub robot: String,
    /// PEM file.
    pub certificate: PathBuf,
    /// PEM file.
    pub key: PathBuf,
    /// PEM file.
    #[serde(default)]
    pub authority: Option<PathBuf>,
    /// ms since the Unix epoch.
    #[serde(default)]
    pub expires_ms: Option<i64>,
}

impl RobotOptions {
    /// Options of the file that `waymark robot enrol` has written.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, ClientError> {
        let path = path.as_ref();
        let shown = path.display().to_string();
        let unreadable = |error| ClientError::File { path: shown.clone(), error };
        let bytes = std::fs::metadata(path).map_err(unreadable)?.len();
        let bad = |detail: String| ClientError::RobotFile { path: shown.clone(), detail };
        if bytes > MAX_BYTES {
            return Err(bad(format!("it has more than {MAX_BYTES} bytes")));
        }
        let text = std::fs::read_to_string(path).map_err(unreadable)?;
        let file: RobotFile = serde_json::from_str(&text).map_err(|e| bad(e.to_string()))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let tls = RobotTls {
            certificate: folder.join(file.certificate),
            key: folder.join(file.key),
            authority: file.authority.map(|authority| folder.join(authority)),
            expires_ms: file.expires_ms,
        };
        Ok(Self { tls: Some(tls), ..Self::new(file.endpoint, file.fleet, file.robot) })
    }

    /// Options of the file that the variable `WAYMARK_ROBOT_FILE` names; `None` where it is not
    /// set.
    pub fn from_environment() -> Result<Option<Self>, ClientError> {
        std::env::var_os(ROBOT_FILE_VARIABLE).map(Self::from_file).transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_those_beside_the_file_and_a_bad_one_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot.json");
        let put = |text: &str| std::fs::write(&path, text).unwrap();
        put(r#"{"endpoint":"tls/h:1","fleet":"f","robot":"r1","certificate":"c.pem","key":"/k.pem"}"#);
        let options = RobotOptions::from_file(&path).unwrap();
        let tls = options.tls.unwrap();
        assert_eq!((options.endpoint.as_str(), options.robot.as_str()), ("tls/h:1", "r1"));
        assert_eq!((tls.certificate, tls.key), (folder.path().join("c.pem"), PathBuf::from("/k.pem")));
        assert_eq!((tls.authority, tls.expires_ms), (None, None));
        for bad in ["", "{}", &" ".repeat(MAX_BYTES as usize + 1)] {
            put(bad);
            let error = RobotOptions::from_file(&path).unwrap_err().to_string();
            assert!(error.contains("robot.json") && error.contains("waymark robot enrol"), "{error}");
        }
    }
}
