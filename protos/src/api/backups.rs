//! `/backups`: copies of the whole database, made while the server runs.

use serde::{Deserialize, Serialize};

/// How far a backup is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum BackupState {
    /// It is being written.
    Running,
    /// It is on the disk, and was compared with its digests.
    Complete,
    /// It could not be made; `reason` says why.
    Failed,
    /// The file is not the one that was written; `reason` says what is wrong.
    Damaged,
}

/// A backup in the server's data directory.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Backup {
    /// Its time in UTC, as in `20261123-140530`.
    pub name: String,
    /// How far it is.
    pub state: BackupState,
    /// When it was begun, ms since the Unix epoch.
    pub created_ms: i64,
    /// Size of the file; 0 until it is complete.
    pub bytes: u64,
    /// Why it failed, or what is wrong with it.
    #[serde(default)]
    pub reason: Option<String>,
    /// What it holds, once it is complete.
    #[serde(default)]
    pub manifest: Option<BackupManifest>,
}

/// What a backup holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct BackupManifest {
    /// When it was made, ms since the Unix epoch.
    pub created_ms: i64,
    /// Version of the program that made it.
    pub program: String,
    /// Number of the last step of the database's schema.
    pub schema: i64,
    /// The maps, by name.
    pub maps: Vec<BackupMap>,
    /// Number of stored pictures.
    pub pictures: u64,
    /// What was wrong with the data when the backup was made.
    pub faults: Vec<String>,
}

/// What a backup holds of one map.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct BackupMap {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: i64,
    /// Number of landmarks.
    pub landmarks: u64,
    /// Number of training views.
    pub views: u64,
    /// Number of models.
    pub models: u64,
    /// Number of wall segments.
    pub walls: u64,
    /// SHA-256 over the digests of its settings, landmarks, views, models and walls, hexadecimal.
    pub sha256: String,
}

/// The state of backups, in `/readyz`.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct BackupHealth {
    /// Hours between scheduled backups; 0: none are scheduled.
    pub every_hours: u32,
    /// Name of the newest complete backup in the data directory.
    #[serde(default)]
    pub newest: Option<String>,
    /// When that was made, ms since the Unix epoch.
    #[serde(default)]
    pub newest_ms: Option<i64>,
    /// Why the last attempt failed; absent once one has succeeded.
    #[serde(default)]
    pub failed: Option<String>,
}
