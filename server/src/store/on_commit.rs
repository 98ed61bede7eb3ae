//! How the rest of the program learns what was committed.

use super::{db::Conn, error::StoreError};
use futures::future::BoxFuture;

/// What a committed write makes visible.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum CommittedChange {
    /// The map with this number has a new version.
    Map(i64),
    /// The map is gone.
    MapRemoved(String),
    /// The map links have changed.
    Links,
    /// Tokens, or the maps that they are for.
    Tokens,
    /// Certificates of robots.
    Certificates,
    /// A job is queued.
    Jobs,
    /// The robot is on this map, or is gone.
    Robot {
        name: String,
        /// The map's name.
        map: Option<String>,
    },
}

/// Makes committed data visible. The writer calls it between commit and acknowledgement, so it is
/// short: long computations come later. `NotPublished` is an answer to the caller of the write; any
/// other error stops the store, unless the database is away: then it is called again.
pub(crate) trait OnCommit: Send + Sync + std::fmt::Debug {
    /// The store is open: everything in it is new.
    fn opened<'c>(&'c self, conn: &'c mut Conn) -> BoxFuture<'c, Result<(), StoreError>>;

    /// A write was committed.
    fn committed<'c>(
        &'c self,
        conn: &'c mut Conn,
        change: CommittedChange,
    ) -> BoxFuture<'c, Result<(), StoreError>>;
}
