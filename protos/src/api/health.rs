//! `/healthz`, `/readyz`, `/version`.

use super::backups::BackupHealth;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The process lives.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Health {
    /// `ok`.
    pub status: String,
}

/// How far the server can do its work.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Readiness {
    /// `ready`, or `degraded`: everything runs, but one of `counts` is not 0, the disk has no room,
    /// the server has no part in its router, another server has one of its maps, the last scheduled
    /// backup failed, or the check of the database did.
    pub status: String,
    /// How many there are of what is wrong, for whoever asks.
    #[serde(default)]
    pub counts: ReadinessCounts,
    /// Maps whose stored version cannot be made ready, with the reason: an earlier version is used,
    /// or none since the server started. A later change of the map tries again. Only maps of the
    /// token that asks: none without one.
    pub maps_not_in_use: BTreeMap<String, String>,
    /// Views, tracks and underlays whose stored picture is damaged, at most 100, of maps of the
    /// token that asks: none without one. The picture is not used; the same photograph, uploaded
    /// again, mends it.
    #[serde(default)]
    pub damaged_pictures: Vec<String>,
    /// Why the server has no part in the router that it is to join: no connection, or a name that
    /// another server has. Told to whoever sees all maps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub router: Option<String>,
    /// Maps that another server has, too, with the reason: robots are refused on them here. Only
    /// maps of the token that asks.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub maps_not_served: BTreeMap<String, String>,
    /// The check of the whole database after the start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub database_check: Option<DatabaseCheckBody>,
    /// The newest backup, and why the last attempt failed. A token for all maps is told the name
    /// and the reason.
    #[serde(default)]
    pub backup: BackupHealth,
    /// For how many seconds each part that has work, or is probed, has not gone on. Beyond a few
    /// the server is not ready. Empty for whoever does not see all maps.
    #[serde(default)]
    pub parts_still_s: BTreeMap<String, u64>,
    /// The disk of the data directory; absent for whoever does not see all maps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub storage: Option<StorageHealth>,
    /// Panics caught since the start, by where: what they met was refused or dropped, everything
    /// else went on. Each is in the log. Anything but 0 is a fault of the program.
    pub panics: BTreeMap<String, u64>,
}

/// How far the check of the database is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum DatabaseCheckState {
    /// It goes on: in the background, for seconds a gigabyte.
    Running,
    /// Every page, row and index is as it was written.
    Ok,
    /// The database is damaged. Robots are served; `advice` says what to do.
    Failed,
}

/// The check of every page, row and index of the database that runs once after each start.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct DatabaseCheckBody {
    /// How far it is.
    pub state: DatabaseCheckState,
    /// When it ended, ms since the Unix epoch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ended_ms: Option<i64>,
    /// What is wrong, at most 20; empty for whoever does not see all maps.
    #[serde(default)]
    pub faults: Vec<String>,
    /// What to do where it failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub advice: Option<String>,
}

/// How many things are wrong, named or not.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ReadinessCounts {
    /// Maps whose stored version is not in use.
    pub maps_not_in_use: u64,
    /// Views, tracks and underlays whose stored picture is damaged.
    pub damaged_pictures: u64,
}

/// The disk of the data directory at the last look, some seconds ago at most.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct StorageHealth {
    /// Bytes that the server's user can fill; 0 where that is not known.
    pub total_bytes: u64,
    /// Of these, free.
    pub free_bytes: u64,
    /// Bytes of the database file that deletions have freed: new data take them first.
    pub reusable_bytes: u64,
    /// Used share, in percent, rounded down.
    pub used_percent: u64,
    /// The setting `limits.disk_percent`: from here on nothing is added.
    pub limit_percent: u64,
    /// Why nothing is added at present, and what to do. Robots are served all the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
}

/// What runs here.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Version {
    /// `waymark`.
    pub name: String,
    /// Of the program.
    pub version: String,
    /// Of the HTTP interface.
    pub api: String,
    /// Of the protocol over zenoh.
    pub protocol: String,
    /// Name of this server among those of a router.
    #[serde(default)]
    pub server: String,
}
