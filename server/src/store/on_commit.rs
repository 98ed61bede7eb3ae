//! How the rest of the program learns of what was committed.

use super::error::StoreError;
use futures::future::BoxFuture;
use sqlx::SqliteConnection;

/// What a committed write makes visible.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Change {
    /// The map with this number has a new version.
    Map(i64),
    /// The map is gone.
    MapRemoved(String),
    /// How maps lie to each other.
    Links,
    /// A job is queued.
    Jobs,
    /// The robot stands on this map, or is gone.
    Robot {
        /// Its name.
        name: String,
        /// The map's name.
        map: Option<String>,
    },
}

/// Makes committed data visible. Called by the writer between commit and acknowledgement, so it is short: what takes long is
/// computed afterwards. `NotPublished` is told to the caller of the write; any other error stops the store.
pub(crate) trait OnCommit: Send + Sync + std::fmt::Debug {
    /// The store is open: everything in it is new.
    fn opened<'c>(&'c self, conn: &'c mut SqliteConnection) -> BoxFuture<'c, Result<(), StoreError>>;

    /// A write was committed.
    fn committed<'c>(
        &'c self,
        conn: &'c mut SqliteConnection,
        change: Change,
    ) -> BoxFuture<'c, Result<(), StoreError>>;
}
