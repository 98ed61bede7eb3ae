//! Who asks and what they may do. In: credentials of a request. Out: a [`Principal`], or the reason
//! why there is none.
//!
//! A principal is known by a token (of the database, or the local one of this start) or by a
//! session of the page, which stands for the token that opened it and outlives a restart. Tokens
//! are read from memory ([`registry`]); the publication fills it after each commit, so a revoked
//! token is refused by the next request.
//!
//! The server's own certificate and those of robots come of [`certificates`].

pub(crate) mod authorisation;
pub(crate) mod certificates;
pub(crate) mod local_token;
mod registry;
mod secret;
mod sessions;

pub(crate) use crate::private_file;
pub(crate) use registry::{Denial, PublishedToken, TokenRegistry};
pub(crate) use secret::{Secret, TokenText};
pub(crate) use sessions::{CODE_VALID, MAX_SESSIONS, SESSION_VALID, Sessions};

use protos::api::Role;
use std::{
    collections::BTreeSet,
    sync::{Arc, LazyLock},
};

/// Which token a principal has shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum TokenId {
    /// That of the file in the data directory.
    Local,
    /// One of the database.
    Stored(i64),
}

/// Who asks. A copy shares the texts: each request holds some.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Principal {
    pub(crate) token: TokenId,
    /// Name of the token.
    pub(crate) name: Arc<str>,
    pub(crate) role: Role,
    /// Names of the maps that it is for; `None` for all maps and what is above maps.
    pub(crate) maps: Option<Arc<BTreeSet<String>>>,
    /// ms since the Unix epoch.
    pub(crate) expires_ms: Option<i64>,
}

impl Principal {
    /// Whoever reads the local token: this user of this machine.
    fn local() -> Self {
        static NAME: LazyLock<Arc<str>> = LazyLock::new(|| "local".into());
        Self { token: TokenId::Local, name: NAME.clone(), role: Role::Admin, maps: None, expires_ms: None }
    }

    /// Whether this map is shown to it.
    pub(crate) fn may_see(&self, map: &str) -> bool {
        self.maps.as_ref().is_none_or(|maps| maps.contains(map))
    }

    /// The maps of a list: the one asked for, or all that are shown to it. `None` for all maps.
    pub(crate) fn visible_maps(&self, asked: Option<String>) -> Option<Vec<String>> {
        match asked {
            Some(map) => Some(if self.may_see(&map) { vec![map] } else { Vec::new() }),
            None => self.maps.as_ref().map(|maps| maps.iter().cloned().collect()),
        }
    }
}
