//! Makes the current version of a map the one that is used.
//!
//! A map that cannot be made ready ends nothing: its previous version stays in use, at the start none, the map is named in
//! the log and at `/readyz`, and the next write to it tries again.

use super::build;
use crate::store::{Change, OnCommit, StoreError, map_rows, robots, sites};
use engine::{panics::Edge, snapshot::Snapshots, vitals::Vitals};
use futures::{FutureExt, future::BoxFuture};
use sqlx::SqliteConnection;
use std::{panic::AssertUnwindSafe, sync::Arc};
use tokio::sync::Notify;
use vision::params::Params;

/// Robots read at a time.
const PAGE: usize = 500;

/// The listener of the store.
#[derive(Debug)]
pub(super) struct Publisher {
    snapshots: Arc<Snapshots>,
    params: Arc<Params>,
    vitals: Arc<Vitals>,
    /// Told when a version has data to derive.
    pub(super) derive: Arc<Notify>,
}

impl Publisher {
    pub(super) fn new(snapshots: Arc<Snapshots>, params: Arc<Params>, vitals: Arc<Vitals>) -> Self {
        Self { snapshots, params, vitals, derive: Arc::default() }
    }

    async fn all(&self, conn: &mut SqliteConnection) -> Result<(), StoreError> {
        for id in map_rows::ids(&mut *conn).await? {
            match self.map(conn, id).await {
                Ok(()) | Err(StoreError::NotPublished { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        self.links(conn).await?;
        let mut after = String::new();
        loop {
            let page = robots::page(&mut *conn, &after, PAGE).await?;
            let Some(last) = page.last() else { return Ok(()) };
            after.clone_from(&last.name);
            for robot in page {
                self.snapshots.set_robot(&robot.name, Some(&robot.map));
            }
        }
    }

    async fn links(&self, conn: &mut SqliteConnection) -> Result<(), StoreError> {
        self.snapshots.set_links(sites::links(&sites::all(conn).await?));
        Ok(())
    }

    /// `NotPublished` if the map cannot be made ready; any other error means that the database cannot be read.
    async fn map(&self, conn: &mut SqliteConnection, id: i64) -> Result<(), StoreError> {
        // What a panic leaves behind is thrown away: the snapshot is whole or there is none.
        let panics = self.vitals.panics();
        let made = build::snapshot(&mut *conn, id, &self.snapshots, &self.params, panics);
        let reason = match AssertUnwindSafe(made).catch_unwind().await {
            Ok(Ok(None)) => return Ok(()),
            Ok(Ok(Some(map))) => {
                self.vitals.published(&map.name);
                let is_pending = map.pending.any();
                self.snapshots.publish(Arc::new(map));
                if is_pending {
                    self.derive.notify_one();
                }
                return Ok(());
            }
            Ok(Err(error)) if error.is_fatal() => return Err(error),
            Ok(Err(error)) => {
                tracing::error!(
                    map = id,
                    error = &error as &dyn std::error::Error,
                    "a map cannot be made ready"
                );
                error.to_string()
            }
            Err(cause) => {
                let (what, follows) = (format!("map number {id}"), "its previous version stays in use");
                panics.caught(Edge::Publication, cause.as_ref(), &what, follows);
                "the server failed on it; see its log".to_owned()
            }
        };
        let name = map_rows::name(conn, id).await?;
        tracing::error!(map = name, reason, "the stored version of this map is not in use");
        self.vitals.unpublished(&name, &reason);
        Err(StoreError::NotPublished { map: name })
    }
}

impl OnCommit for Publisher {
    fn opened<'c>(&'c self, conn: &'c mut SqliteConnection) -> BoxFuture<'c, Result<(), StoreError>> {
        Box::pin(self.all(conn))
    }

    fn committed<'c>(
        &'c self,
        conn: &'c mut SqliteConnection,
        change: Change,
    ) -> BoxFuture<'c, Result<(), StoreError>> {
        Box::pin(async move {
            match change {
                Change::Map(id) => self.map(conn, id).await?,
                Change::MapRemoved(name) => {
                    self.snapshots.remove_map(&name);
                    self.vitals.published(&name);
                }
                Change::Links => self.links(conn).await?,
                Change::Robot { name, map } => self.snapshots.set_robot(&name, map.as_deref()),
                // The writer tells the jobs itself.
                Change::Jobs => {}
            }
            Ok(())
        })
    }
}
