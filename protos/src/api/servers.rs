//! `/servers`: the servers of a router.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// This server and those that it shares a router with.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Servers {
    /// Name of this server.
    pub server: String,
    /// Endpoints of the router that it joins; empty: it is the router itself.
    pub router: Vec<String>,
    /// There is a connection to the router.
    pub is_connected: bool,
    /// All servers that live, this one among them, by name.
    pub servers: Vec<ServerBody>,
    /// Maps that several servers have, with the servers: at most one of them serves it.
    pub contested_maps: BTreeMap<String, Vec<String>>,
    /// Robots that are registered with several servers: their messages must name the map.
    pub contested_robots: BTreeMap<String, Vec<String>>,
    /// Announcements that were not taken because they were too many.
    pub ignored: u64,
}

/// A server.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ServerBody {
    /// Its name.
    pub name: String,
    /// Its maps, without drafts, by name.
    pub maps: Vec<ServedMap>,
    /// How many robots are registered with it.
    pub robots: u64,
}

/// A map of a server.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ServedMap {
    /// Its name.
    pub name: String,
    /// Whether robots are answered on it.
    pub is_served: bool,
}
