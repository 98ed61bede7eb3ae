//! `/tokens`, `/whoami`, `/session/links`: who may do what.

use serde::{Deserialize, Serialize};

/// What a principal may do. Each role may do all that those before it may.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Reads, and asks for what changes nothing.
    Viewer,
    /// A robot's own program: also has pictures recognised.
    Robot,
    /// Also changes what is in a map: landmarks, views, models, walls.
    Teacher,
    /// Also administers robots and how maps are used.
    Operator,
    /// Also deletes maps and administers tokens.
    Admin,
}

impl Role {
    /// Every role, the least first.
    pub const ALL: [Self; 5] = [Self::Viewer, Self::Robot, Self::Teacher, Self::Operator, Self::Admin];

    /// Its word in requests, answers and the database.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Viewer => "viewer",
            Self::Robot => "robot",
            Self::Teacher => "teacher",
            Self::Operator => "operator",
            Self::Admin => "admin",
        }
    }

    /// The role of a word.
    pub fn of(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|role| role.as_str() == word)
    }
}

impl std::fmt::Display for Role {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

/// A token to be made.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct NewToken {
    /// Who or what it is for, `[a-z0-9_-]{1,64}`; several may have the same.
    pub name: String,
    /// What it may do.
    pub role: Role,
    /// Maps that it is for; absent for all maps and what is above maps.
    #[serde(default)]
    pub maps: Option<Vec<String>>,
    /// Seconds until it expires, by the server's clock, at most ten years; absent for never.
    #[serde(default)]
    pub valid_s: Option<u64>,
}

/// A token without its secret.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Token {
    /// Its number; never given again.
    pub id: i64,
    /// Who or what it is for.
    pub name: String,
    /// What it may do.
    pub role: Role,
    /// Maps that it is for, by name; null for all maps and what is above maps. Deleted maps are
    /// left out.
    pub maps: Option<Vec<String>>,
    /// Milliseconds since the Unix epoch.
    pub created_ms: i64,
    /// Not valid from then on; null for never.
    pub expires_ms: Option<i64>,
    /// Not valid since then; null if it was not revoked.
    pub revoked_ms: Option<i64>,
}

/// A new token, with its text.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CreatedToken {
    /// `wmk_{id}_{secret}`, sent as `Authorization: Bearer`. It is shown this once: only its digest
    /// is stored.
    #[cfg_attr(feature = "openapi", schema(format = Password))]
    pub text: String,
    /// What it is.
    pub token: Token,
}

impl std::fmt::Debug for CreatedToken {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("CreatedToken").field("text", &"…").field("token", &self.token).finish()
    }
}

/// Who asks, as the server sees it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Whoami {
    /// Name of the token; `local` for that of the server's own machine.
    pub name: String,
    /// What may be done.
    pub role: Role,
    /// Maps that it is for; null for all maps and what is above maps.
    pub maps: Option<Vec<String>>,
    /// Number of the token; null for the local one.
    pub token: Option<i64>,
    /// Not valid from then on, milliseconds since the Unix epoch; null for never.
    pub expires_ms: Option<i64>,
}

/// A link that opens the page once, with the rights of the one who asked for it.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct PageLink {
    /// Path and query, to be put after the server's address: `/open?code=...`.
    #[cfg_attr(feature = "openapi", schema(format = Password))]
    pub path: String,
    /// Seconds for which it is valid.
    pub valid_s: u64,
}

impl std::fmt::Debug for PageLink {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PageLink").field("path", &"…").field("valid_s", &self.valid_s).finish()
    }
}
