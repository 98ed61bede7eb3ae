//! The only connection that writes, owned by one task. A write is a closure run inside BEGIN IMMEDIATE; the order is
//! always commit -> publish the snapshot -> acknowledge, so nothing is matched or confirmed that a crash could undo.
//!
//! A caller that goes away cannot cancel a write: it runs here, not in the caller's task.

use super::{StoreError, load, sites};
use crate::engine::snapshot::Snapshots;
use futures::future::BoxFuture;
use sqlx::SqliteConnection;
use std::sync::Arc;
use tokio::sync::{mpsc, oneshot, watch};
use vision::params::Params;

/// What a committed write makes visible.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Change {
    /// The map with this number has a new version.
    Map(i64),
    /// The map is gone.
    MapRemoved(String),
    /// How maps lie to each other.
    Links,
    /// The robot stands on this map, or is gone.
    Robot {
        /// Its name.
        name: String,
        /// The map's name.
        map: Option<String>,
    },
}

/// An open transaction and what it will make visible.
#[derive(Debug)]
pub(crate) struct Tx {
    /// The writer's connection, inside a transaction.
    pub(super) conn: SqliteConnection,
    changes: Vec<Change>,
}

impl Tx {
    /// To be published after the commit.
    pub(super) fn changed(&mut self, change: Change) {
        if !self.changes.contains(&change) {
            self.changes.push(change);
        }
    }
}

type Acknowledge = Box<dyn FnOnce(Result<(), StoreError>) + Send>;

/// What a closure came to. `acknowledge` holds its value or error until the transaction has ended.
pub(super) struct Outcome {
    keep: bool,
    fatal: bool,
    acknowledge: Acknowledge,
}

pub(super) type Command = Box<dyn for<'t> FnOnce(&'t mut Tx) -> BoxFuture<'t, Outcome> + Send>;

/// Wraps a closure for the channel.
pub(super) fn command<T, F>(write: F) -> (Command, oneshot::Receiver<Result<T, StoreError>>)
where
    T: Send + 'static,
    F: for<'t> FnOnce(&'t mut Tx) -> BoxFuture<'t, Result<T, StoreError>> + Send + 'static,
{
    let (reply, answer) = oneshot::channel();
    let command: Command = Box::new(move |tx| {
        Box::pin(async move {
            let result = write(tx).await;
            let (keep, fatal) = (result.is_ok(), result.as_ref().is_err_and(StoreError::is_fatal));
            let acknowledge: Acknowledge = Box::new(move |ended| {
                // The caller may be gone; the write stands all the same.
                drop(reply.send(result.and_then(|value| ended.map(|()| value))));
            });
            Outcome { keep, fatal, acknowledge }
        })
    });
    (command, answer)
}

/// The writer's task.
pub(super) struct Writer {
    tx: Tx,
    commands: mpsc::Receiver<Command>,
    snapshots: Arc<Snapshots>,
    params: Arc<Params>,
    failed: watch::Sender<bool>,
}

impl Writer {
    pub(super) fn new(
        conn: SqliteConnection,
        commands: mpsc::Receiver<Command>,
        snapshots: Arc<Snapshots>,
        params: Arc<Params>,
        failed: watch::Sender<bool>,
    ) -> Self {
        Self { tx: Tx { conn, changes: Vec::new() }, commands, snapshots, params, failed }
    }

    /// Runs until told to close and what is queued is done, or until an error after which nothing may be written.
    pub(super) async fn run(mut self, mut close: oneshot::Receiver<()>) {
        let mut open = true;
        loop {
            let command = tokio::select! {
                biased;
                _ = &mut close, if open => {
                    open = false;
                    self.commands.close();
                    continue;
                }
                command = self.commands.recv() => command,
            };
            let Some(command) = command else { break };
            if let Err(error) = self.one(command).await {
                tracing::error!(
                    error = &error as &dyn std::error::Error,
                    "the store has failed; no more writes"
                );
                self.failed.send_replace(true);
                return;
            }
        }
        // Leaves the write-ahead log empty and the file complete in itself.
        if let Err(error) = sqlx::Connection::close(self.tx.conn).await {
            tracing::warn!(%error, "closing the store");
        }
    }

    async fn one(&mut self, command: Command) -> Result<(), StoreError> {
        self.tx.changes.clear();
        self.execute("BEGIN IMMEDIATE", "begin").await?;
        let outcome = command(&mut self.tx).await;
        if !outcome.keep {
            // SQLite has already rolled back by itself after some errors (a full disk); then this one says so.
            let rolled_back = self.execute("ROLLBACK", "roll back").await;
            (outcome.acknowledge)(Ok(()));
            return match rolled_back {
                Err(error) if error.is_fatal() || outcome.fatal => Err(error),
                _ if outcome.fatal => Err(StoreError::Closed),
                _ => Ok(()),
            };
        }
        match self.execute("COMMIT", "commit").await {
            Ok(()) => {}
            Err(StoreError::Full) => {
                let rolled_back = self.execute("ROLLBACK", "roll back").await;
                (outcome.acknowledge)(Err(StoreError::Full));
                return match rolled_back {
                    Err(error) if error.is_fatal() => Err(error),
                    _ => Ok(()),
                };
            }
            Err(error) => {
                (outcome.acknowledge)(Err(StoreError::Closed));
                return Err(error);
            }
        }
        // If this fails the write is durable but not visible: not acknowledged, and the next start shows it.
        let published = self.publish().await;
        (outcome.acknowledge)(if published.is_ok() { Ok(()) } else { Err(StoreError::Closed) });
        published
    }

    async fn publish(&mut self) -> Result<(), StoreError> {
        for change in std::mem::take(&mut self.tx.changes) {
            match change {
                Change::Map(id) => {
                    if let Some(map) = load::map(&mut self.tx.conn, id, &self.snapshots, &self.params).await?
                    {
                        self.snapshots.publish(map);
                    }
                }
                Change::MapRemoved(name) => self.snapshots.remove_map(&name),
                Change::Links => {
                    let all = sites::all(&mut self.tx.conn).await?;
                    self.snapshots.set_links(sites::links(&all));
                }
                Change::Robot { name, map } => self.snapshots.set_robot(&name, map.as_deref()),
            }
        }
        Ok(())
    }

    async fn execute(&mut self, sql: &'static str, operation: &'static str) -> Result<(), StoreError> {
        sqlx::raw_sql(sql).execute(&mut self.tx.conn).await.map_err(StoreError::at(operation))?;
        Ok(())
    }
}
