//! The only connection that writes, owned by one task. A write is a closure run inside BEGIN IMMEDIATE; the order is
//! always commit -> publish the snapshot -> acknowledge, so nothing is matched or confirmed that a crash could undo.
//!
//! A write whose caller has gone away before it began is left out. Once it has begun it runs to its end, here and not in
//! the caller's task, and with it what must follow the commit ([`Tx::after`]).
//!
//! A panic inside a write is caught and rolled back. A panic while a map is made ready after the commit leaves the map's
//! previous version in use; the next write to that map tries again.

use super::{
    error::StoreError,
    on_commit::{Change, OnCommit},
};
use engine::{
    panics::Edge,
    vitals::{Pulse, Vitals},
};
use futures::{FutureExt, future::BoxFuture};
use sqlx::SqliteConnection;
use std::{
    any::Any,
    panic::AssertUnwindSafe,
    sync::{Arc, Weak},
};
use tokio::sync::{Notify, mpsc, oneshot};

/// Runs once the transaction is committed and visible. Short: the writer waits for it.
type After = Box<dyn FnOnce() + Send>;

/// An open transaction and what it will make visible.
pub(crate) struct Tx {
    /// The writer's connection, inside a transaction.
    pub(super) conn: SqliteConnection,
    changes: Vec<Change>,
    after: Vec<After>,
}

impl std::fmt::Debug for Tx {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Tx").field("changes", &self.changes).finish_non_exhaustive()
    }
}

impl Tx {
    /// The connection, for tests that damage what is stored.
    #[cfg(test)]
    pub(crate) fn conn(&mut self) -> &mut SqliteConnection {
        &mut self.conn
    }

    /// To be published after the commit.
    pub(super) fn changed(&mut self, change: Change) {
        if !self.changes.contains(&change) {
            self.changes.push(change);
        }
    }

    /// What must follow the commit, before the acknowledgement, whether or not the caller is still there. Not run if the
    /// transaction is rolled back.
    pub(crate) fn after(&mut self, then: impl FnOnce() + Send + 'static) {
        self.after.push(Box::new(then));
    }
}

type Acknowledge = Box<dyn FnOnce(Result<(), StoreError>) + Send>;

/// What a closure came to. `acknowledge` holds its value or error until the transaction has ended.
struct Outcome {
    keep: bool,
    fatal: bool,
    panic: Option<Box<dyn Any + Send>>,
    acknowledge: Acknowledge,
}

type Run = Box<dyn for<'t> FnOnce(&'t mut Tx) -> BoxFuture<'t, Outcome> + Send>;

/// A write on its way to the writer.
pub(super) struct Command {
    run: Run,
    caller: Weak<()>,
}

/// Wraps a closure for the channel. The write is wanted for as long as `caller` lives.
pub(super) fn command<T, F>(write: F, caller: &Arc<()>) -> (Command, oneshot::Receiver<Result<T, StoreError>>)
where
    T: Send + 'static,
    F: for<'t> FnOnce(&'t mut Tx) -> BoxFuture<'t, Result<T, StoreError>> + Send + 'static,
{
    let (reply, answer) = oneshot::channel();
    let run: Run = Box::new(move |tx| {
        Box::pin(async move {
            // What the closure has changed is in the transaction, which is rolled back.
            let ended = AssertUnwindSafe(async move { write(tx).await }).catch_unwind().await;
            let (result, panic) = match ended {
                Ok(result) => (result, None),
                Err(cause) => (Err(StoreError::Panicked), Some(cause)),
            };
            let (keep, fatal) = (result.is_ok(), result.as_ref().is_err_and(StoreError::is_fatal));
            let acknowledge: Acknowledge = Box::new(move |ended| {
                // The caller may be gone; the write stands all the same.
                drop(reply.send(result.and_then(|value| ended.map(|()| value))));
            });
            Outcome { keep, fatal, panic, acknowledge }
        })
    });
    (Command { run, caller: Arc::downgrade(caller) }, answer)
}

/// The writer's task.
pub(super) struct Writer {
    tx: Tx,
    commands: mpsc::Receiver<Command>,
    on_commit: Arc<dyn OnCommit>,
    vitals: Arc<Vitals>,
    /// Told of every job that is queued.
    jobs: Arc<Notify>,
}

/// Its name among the parts of the server.
pub(crate) const PART: &str = "the writer of the store";

impl Writer {
    pub(super) fn new(
        conn: SqliteConnection,
        commands: mpsc::Receiver<Command>,
        on_commit: Arc<dyn OnCommit>,
        vitals: Arc<Vitals>,
        jobs: Arc<Notify>,
    ) -> Self {
        let tx = Tx { conn, changes: Vec::new(), after: Vec::new() };
        Self { tx, commands, on_commit, vitals, jobs }
    }

    /// Runs until told to close and what is queued is done, or until an error after which nothing may be written.
    pub(super) async fn run(mut self, mut close: oneshot::Receiver<()>, pulse: Pulse) {
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
                self.vitals.fail(PART, error.to_string());
                return;
            }
        }
        pulse.end();
        // Leaves the write-ahead log empty and the file complete in itself.
        if let Err(error) = sqlx::Connection::close(self.tx.conn).await {
            tracing::warn!(%error, "closing the store");
        }
    }

    async fn one(&mut self, command: Command) -> Result<(), StoreError> {
        if command.caller.strong_count() == 0 {
            tracing::debug!("a write is left out: its caller has gone");
            return Ok(());
        }
        self.tx.changes.clear();
        self.tx.after.clear();
        self.execute("BEGIN IMMEDIATE", "begin").await?;
        let outcome = (command.run)(&mut self.tx).await;
        if let Some(cause) = &outcome.panic {
            let follows = "it is rolled back; other writes go on";
            self.vitals.panics().caught(Edge::Write, cause.as_ref(), "a write", follows);
        }
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
        let published = self.publish().await;
        for then in std::mem::take(&mut self.tx.after) {
            let follows = "the write stands; the next start makes up for it";
            self.vitals.panics().catch(Edge::Publication, "what follows a commit", follows, then);
        }
        match published {
            Ok(()) => (outcome.acknowledge)(Ok(())),
            // Durable, not visible, and said so; the map can be made ready by a later write.
            Err(error @ StoreError::NotPublished { .. }) => (outcome.acknowledge)(Err(error)),
            // Durable and not visible: not acknowledged, and the next start shows it.
            Err(error) => {
                (outcome.acknowledge)(Err(StoreError::Closed));
                return Err(error);
            }
        }
        Ok(())
    }

    /// Makes everything visible that the write has changed.
    async fn publish(&mut self) -> Result<(), StoreError> {
        let mut done = Ok(());
        for change in std::mem::take(&mut self.tx.changes) {
            if change == Change::Jobs {
                self.jobs.notify_one();
                continue;
            }
            match self.on_commit.committed(&mut self.tx.conn, change).await {
                Err(error @ StoreError::NotPublished { .. }) => done = Err(error),
                other => other?,
            }
        }
        done
    }

    async fn execute(&mut self, sql: &'static str, operation: &'static str) -> Result<(), StoreError> {
        sqlx::raw_sql(sql).execute(&mut self.tx.conn).await.map_err(StoreError::at(operation))?;
        Ok(())
    }
}
