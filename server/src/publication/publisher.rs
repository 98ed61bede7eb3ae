//! Publishes the stored version of a map after each commit.
//!
//! A map that cannot be published stops nothing: its previous version stays in use (none at the
//! start), the log and `/readyz` name the map, and the next write to it tries again.

use super::build;
use crate::store::db;
use crate::{
    identity::{PublishedToken, TokenRegistry, certificates::CertificateRegistry},
    store::{
        CommittedChange, OnCommit, StoreError, map_locations, map_rows, robot_certificates, robots, tokens,
    },
};
use db::Conn;
use engine::{panics::Edge, snapshot::Snapshots, vitals::Vitals};
use futures::{FutureExt, future::BoxFuture};
use std::{panic::AssertUnwindSafe, sync::Arc};
use tokio::sync::Notify;
use vision::params::Params;

/// Robots read at a time.
const PAGE: usize = 500;

/// The listener of the store.
#[derive(Debug)]
pub(super) struct Publisher {
    snapshots: Arc<Snapshots>,
    tokens: Arc<TokenRegistry>,
    certificates: Arc<CertificateRegistry>,
    params: Arc<Params>,
    vitals: Arc<Vitals>,
    /// Notified when a version has data to derive.
    pub(super) derive: Arc<Notify>,
}

impl Publisher {
    pub(super) fn new(
        snapshots: Arc<Snapshots>,
        (tokens, certificates): (Arc<TokenRegistry>, Arc<CertificateRegistry>),
        params: Arc<Params>,
        vitals: Arc<Vitals>,
    ) -> Self {
        Self { snapshots, tokens, certificates, params, vitals, derive: Arc::default() }
    }

    async fn all(&self, conn: &mut Conn) -> Result<(), StoreError> {
        for id in map_rows::ids(&mut *conn).await? {
            match self.map(conn, id).await {
                Ok(()) | Err(StoreError::NotPublished { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        self.links(conn).await?;
        self.tokens(conn).await?;
        self.certificates(conn).await?;
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

    async fn links(&self, conn: &mut Conn) -> Result<(), StoreError> {
        self.snapshots.set_links(map_locations::links(&map_locations::all(conn).await?));
        Ok(())
    }

    async fn tokens(&self, conn: &mut Conn) -> Result<(), StoreError> {
        let all = tokens::page(conn, 0, tokens::MAX_TOKENS).await?;
        let published = |row: tokens::TokenRow| PublishedToken { token: row.token, sha256: row.sha256 };
        self.tokens.publish(all.into_iter().map(published));
        Ok(())
    }

    async fn certificates(&self, conn: &mut Conn) -> Result<(), StoreError> {
        self.certificates.publish(robot_certificates::all(conn).await?);
        Ok(())
    }

    /// Publishes a map. Errors: `NotPublished` if it cannot be built; any other means that the
    /// database cannot be read.
    async fn map(&self, conn: &mut Conn, id: i64) -> Result<(), StoreError> {
        // Unwind safety: a panic drops the unfinished snapshot.
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
            Ok(Err(error @ (StoreError::Away | StoreError::Busy))) => return Err(error),
            Ok(Err(error)) if error.is_fatal() => return Err(error),
            Ok(Err(error)) => {
                tracing::error!(map = id, error = &error as &dyn std::error::Error, "map_build_failed");
                error.to_string()
            }
            Err(cause) => {
                let (what, follows) = (format!("map number {id}"), "its previous version stays in use");
                panics.caught(Edge::Publication, cause.as_ref(), &what, follows);
                "the server failed on it; see its log".to_owned()
            }
        };
        let name = map_rows::name(conn, id).await?;
        tracing::error!(
            map = name,
            reason,
            follows = "its previous version stays in use",
            "map_not_published"
        );
        self.vitals.unpublished(&name, &reason);
        Err(StoreError::NotPublished { map: name })
    }
}

impl OnCommit for Publisher {
    fn opened<'c>(&'c self, conn: &'c mut Conn) -> BoxFuture<'c, Result<(), StoreError>> {
        Box::pin(self.all(conn))
    }

    fn committed<'c>(
        &'c self,
        conn: &'c mut Conn,
        change: CommittedChange,
    ) -> BoxFuture<'c, Result<(), StoreError>> {
        Box::pin(async move {
            match change {
                CommittedChange::Map(id) => self.map(conn, id).await?,
                CommittedChange::MapRemoved(name) => {
                    self.snapshots.remove_map(&name);
                    self.vitals.published(&name);
                }
                CommittedChange::Links => {
                    self.links(conn).await?;
                    self.certificates.touch();
                }
                CommittedChange::Certificates => self.certificates(conn).await?,
                CommittedChange::Tokens => self.tokens(conn).await?,
                CommittedChange::Robot { name, map } => {
                    self.snapshots.set_robot(&name, map.as_deref());
                    self.certificates.touch();
                }
                // The writer tells the jobs itself.
                CommittedChange::Jobs => {}
            }
            Ok(())
        })
    }
}
