//! Everything durable, in one SQLite file: maps, landmarks, views, models, walls, robots, jobs.
//!
//! One task owns the only connection that writes ([`writer`]); reads take a separate, read-only pool. Every SQL text
//! is a constant of its file and is prepared by a test against the migrated schema. Does not know vision beyond bytes,
//! except [`load`], which makes snapshots.

mod error;
mod open;
mod writer;
mod statements;
pub(crate) mod load;
pub(crate) mod maps;
pub(crate) mod sites;
pub(crate) mod landmarks;
pub(crate) mod views;
pub(crate) mod models;
pub(crate) mod laser;
pub(crate) mod placing;
pub(crate) mod gatherings;
pub(crate) mod accepting;
pub(crate) mod areas;
mod seen;
pub(crate) mod sights;
pub(crate) mod robots;
pub(crate) mod jobs;

pub(crate) use error::StoreError;
pub(crate) use open::OpenError;
pub(crate) use writer::{Change, Tx};

use crate::{config::Config, engine::snapshot::Snapshots};
use futures::future::BoxFuture;
use sqlx::SqlitePool;
use std::{sync::Arc, time::SystemTime};
use tokio::sync::{mpsc, oneshot, watch};

/// The open store. Cheap to clone.
#[derive(Debug, Clone)]
pub(crate) struct Store {
    commands: mpsc::Sender<writer::Command>,
    reads: SqlitePool,
    snapshots: Arc<Snapshots>,
    failed: watch::Receiver<bool>,
}

/// What must be awaited for the file to be closed in good order.
#[derive(Debug)]
pub(crate) struct WriterTask {
    task: tokio::task::JoinHandle<()>,
    close: oneshot::Sender<()>,
    reads: SqlitePool,
    /// Held for as long as the writer runs: a second server on the same directory would be a second writer.
    _lock: std::fs::File,
}

impl WriterTask {
    /// Takes no more writes, finishes those that wait, and leaves one complete file behind.
    pub(crate) async fn close(self) {
        // The last connection to close empties the write-ahead log; that must be the one that may write.
        self.reads.close().await;
        if self.close.send(()).is_err() {
            tracing::debug!("the writer had ended already");
        }
        if let Err(error) = self.task.await {
            tracing::error!(%error, "the writer panicked");
        }
    }
}

impl Store {
    /// Opens or creates the database under `config.data`, migrates it, checks its settings and its integrity, and
    /// publishes every map.
    pub(crate) async fn open(config: &Config) -> Result<(Self, WriterTask), OpenError> {
        let opened = open::open(&config.data).await?;
        let snapshots = Arc::new(Snapshots::default());
        let mut conn = opened.writer;
        load::all(&mut conn, &snapshots, &config.params).await.map_err(OpenError::Load)?;
        let (commands, received) = mpsc::channel(config.limits.write_queue);
        let (failed, failure) = watch::channel(false);
        let writer = writer::Writer::new(conn, received, snapshots.clone(), config.params.clone(), failed);
        let (close, closed) = oneshot::channel();
        let task = tokio::spawn(writer.run(closed));
        let task = WriterTask { task, close, reads: opened.reads.clone(), _lock: opened.lock };
        Ok((Self { commands, reads: opened.reads, snapshots, failed: failure }, task))
    }

    /// Runs `write` in its own transaction. When this returns `Ok`, it is committed and visible.
    pub(crate) async fn write<T, F>(&self, write: F) -> Result<T, StoreError>
    where
        T: Send + 'static,
        F: for<'t> FnOnce(&'t mut Tx) -> BoxFuture<'t, Result<T, StoreError>> + Send + 'static,
    {
        let (command, answer) = writer::command(write);
        self.commands.send(command).await.map_err(|_gone| StoreError::Closed)?;
        answer.await.map_err(|_gone| StoreError::Closed)?
    }

    /// The read-only pool.
    pub(crate) fn reads(&self) -> &SqlitePool {
        &self.reads
    }

    /// What the workers read.
    pub(crate) fn snapshots(&self) -> &Arc<Snapshots> {
        &self.snapshots
    }

    /// Becomes true when the store has failed and the server must stop.
    pub(crate) fn failed(&self) -> watch::Receiver<bool> {
        self.failed.clone()
    }
}

/// ms since the Unix epoch, for display.
pub(crate) fn now_ms() -> i64 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |d| d.as_millis() as i64)
}

/// Refuses an insertion that has passed a bound: the transaction is rolled back.
fn within(count: i64, max: usize, what: &'static str) -> Result<(), StoreError> {
    if count as usize > max { Err(StoreError::Limit { what, max }) } else { Ok(()) }
}

#[cfg(test)]
pub(crate) mod tests;
