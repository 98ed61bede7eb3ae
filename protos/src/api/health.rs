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
    /// `ready`, or `degraded`: everything runs, but something is named in `maps_not_in_use`, `damaged_pictures`, `router`
    /// or `maps_not_served`, or the last scheduled backup failed.
    pub status: String,
    /// Maps whose stored version cannot be made ready, with the reason: an earlier version is used, or none since the
    /// server started. A later change of the map tries again.
    pub maps_not_in_use: BTreeMap<String, String>,
    /// Views, tracks and underlays whose stored picture is damaged, at most 100. The picture is not used; the same
    /// photograph, uploaded again, mends it.
    #[serde(default)]
    pub damaged_pictures: Vec<String>,
    /// Why the server has no part in the router that it is to join: no connection, or a name that another server has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub router: Option<String>,
    /// Maps that another server has, too, with the reason: robots are refused on them here.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub maps_not_served: BTreeMap<String, String>,
    /// The newest backup, and why the last attempt failed.
    #[serde(default)]
    pub backup: BackupHealth,
    /// Panics caught since the start, by where: what they met was refused or dropped, everything else went on. Each is in
    /// the log. Anything but 0 is a fault of the program.
    pub panics: BTreeMap<String, u64>,
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
