//! `/audit`: who changed what, in a chain of digests.

use serde::{Deserialize, Serialize};

/// Which entries are listed, newest first.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
pub struct AuditQuery {
    /// Most items; 100 by default, bounded by `limits.page`.
    pub limit: Option<usize>,
    /// The `next` of the page before; absent for the first page.
    pub cursor: Option<String>,
    /// Only those of tokens with this name, or of the `server`.
    pub actor: Option<String>,
    /// Only those whose target begins so: `/maps/office`.
    pub target: Option<String>,
    /// Only those from this time on, ms since the Unix epoch.
    pub since_ms: Option<i64>,
    /// Only those before this time, ms since the Unix epoch.
    pub before_ms: Option<i64>,
}

/// A change, and who made it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct AuditEntry {
    /// 1, 2, 3, ... without gaps.
    pub seq: u64,
    /// ms since the Unix epoch.
    pub time_ms: i64,
    /// Name of the token; `local` for the local one, `server` for what the server does by itself.
    pub actor: String,
    /// Number of the token; none for the local one and the server.
    pub token: Option<i64>,
    /// Method and path of the operation, as in the authorisation table, or what the server did.
    pub action: String,
    /// Path of the request.
    pub target: String,
    /// Id of the request, as in the log of the server.
    pub request: Option<String>,
    /// The reason that was given.
    pub why: Option<String>,
    /// Digest of this entry and of all before it: SHA-256, hexadecimal.
    pub sha256: String,
}

/// A place in the chain, noted elsewhere, that has to be there still.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
pub struct AuditHeadQuery {
    /// Number of an entry; with `sha256`.
    pub seq: Option<u64>,
    /// Its digest, 64 hexadecimal digits; with `seq`.
    pub sha256: Option<String>,
}

/// A place in the chain.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct AuditHead {
    /// Number of the entry; 0 before the first.
    pub seq: u64,
    /// Its digest: SHA-256, hexadecimal.
    pub sha256: String,
}

/// The chain as it was found: the digest of every entry was computed anew.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct AuditCheck {
    /// Entries that are kept.
    pub entries: u64,
    /// Entries that were forgotten for want of room; the chain goes on from their last one.
    pub forgotten: u64,
    /// The newest entry. Noted elsewhere, it proves later that nothing before it was changed.
    pub head: AuditHead,
    /// The first thing that is wrong; none where the chain is whole.
    pub fault: Option<String>,
}
