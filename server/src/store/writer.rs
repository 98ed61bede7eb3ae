//! The only connection that writes, owned by one task. A write is a closure that runs inside BEGIN
//! IMMEDIATE. The order is commit -> publish the snapshot -> acknowledge, so a crash undoes nothing
//! that was matched or acknowledged.
//!
//! What a write changed of maps becomes commits of their history in the same transaction
//! ([`history::close`]).
//!
//! A write whose caller drops it before its transaction begins is skipped. After that it runs to
//! its end in this task, with what must follow the commit ([`Tx::after`]).
//!
//! A panic inside a write is caught and rolled back. After a panic in the publication, the map's
//! previous version stays in use, and the next write to that map tries again.

use super::{
    actor::Actor,
    audit,
    db::Conn,
    error::StoreError,
    history::{self, Author, HistoryLimits},
    kept_answers::IdempotencyRecord,
    note_head,
    on_commit::{CommittedChange, OnCommit},
    sqlite::checkpoint::{empty_log, move_long_log},
    transactions::Transactions,
};
use engine::{
    heartbeats::Heartbeat,
    panics::Edge,
    vitals::{Pulse, Vitals},
};
use futures::{FutureExt, future::BoxFuture};
use std::{
    any::Any,
    panic::AssertUnwindSafe,
    sync::{
        Arc, Weak,
        atomic::{AtomicU64, Ordering},
    },
};
use tokio::sync::{Notify, mpsc, oneshot};

/// Runs once the transaction is committed and visible. Short: the writer waits for it.
type PostCommit = Box<dyn FnOnce() + Send>;

/// An open transaction and what it will make visible.
pub(crate) struct Tx {
    /// The writer's connection, inside a transaction.
    pub(super) conn: Conn,
    /// In whose name it writes.
    pub(super) author: Author,
    pub(super) history: HistoryLimits,
    changes: Vec<CommittedChange>,
    after: Vec<PostCommit>,
}

impl std::fmt::Debug for Tx {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Tx").field("changes", &self.changes).finish_non_exhaustive()
    }
}

impl Tx {
    /// The connection, for tests that damage what is stored.
    #[cfg(test)]
    pub(crate) fn conn(&mut self) -> &mut Conn {
        &mut self.conn
    }

    /// To be published after the commit.
    pub(super) fn changed(&mut self, change: CommittedChange) {
        if !self.changes.contains(&change) {
            self.changes.push(change);
        }
    }

    /// Runs `then` after the commit and before the acknowledgement, whether or not the caller still
    /// waits. It does not run if the transaction is rolled back.
    pub(crate) fn after(&mut self, then: impl FnOnce() + Send + 'static) {
        self.after.push(Box::new(then));
    }
}

type Acknowledge = Box<dyn FnOnce(Result<(), StoreError>) + Send>;

/// The outcome of a write's closure. `acknowledge` holds its value or error until the transaction
/// has ended.
pub(super) struct WriteOutcome {
    keep: bool,
    fatal: bool,
    panic: Option<Box<dyn Any + Send>>,
    acknowledge: Acknowledge,
}

/// Gets the outcome of the transaction's beginning; without one nothing runs.
pub(super) type Run =
    Box<dyn for<'t> FnOnce(&'t mut Tx, Result<(), StoreError>) -> BoxFuture<'t, WriteOutcome> + Send>;

/// What is on its way to the writer.
pub(super) enum Command {
    Write {
        /// What it does.
        run: Run,
        /// The write is cancelled if the caller drops this before the transaction begins.
        caller: Weak<()>,
    },
    /// Shows that the writer goes on; writes nothing.
    Probe(oneshot::Sender<()>),
}

/// What goes into the transaction of a write besides its change.
pub(super) struct WriteContext {
    /// The answer to what it made.
    pub(super) keeping: Option<IdempotencyRecord>,
    /// Who asks for it; `None` for the server's own bookkeeping.
    pub(super) actor: Option<Arc<Actor>>,
    /// Most entries of the audit log.
    pub(super) audit_entries: usize,
}

/// Wraps a closure for the channel. The write is wanted for as long as `caller` lives.
pub(super) fn command<T, F>(
    write: F,
    beside: WriteContext,
    caller: &Arc<()>,
) -> (Command, oneshot::Receiver<Result<T, StoreError>>)
where
    T: Send + 'static,
    F: for<'t> FnOnce(&'t mut Tx) -> BoxFuture<'t, Result<T, StoreError>> + Send + 'static,
{
    let WriteContext { keeping, actor, audit_entries } = beside;
    let (reply, answer) = oneshot::channel();
    let run: Run = Box::new(move |tx, begun| {
        Box::pin(async move {
            // Unwind safety: the closure's changes are in the transaction, which is rolled back.
            let all = async {
                begun?;
                tx.author = actor.as_deref().map(Author::from).unwrap_or_default();
                let before = audit::total_changes(tx).await?;
                let made = write(tx).await?;
                history::close(tx).await?;
                log(tx, actor.as_deref(), before, audit_entries).await?;
                if let Some(keeping) = &keeping {
                    let answer = keeping.answer_to(&made);
                    keeping.keep(tx, answer).await?;
                }
                Ok(made)
            };
            let ended = AssertUnwindSafe(all).catch_unwind().await;
            let (result, panic) = match ended {
                Ok(result) => (result, None),
                Err(cause) => (Err(StoreError::Panicked), Some(cause)),
            };
            let (keep, fatal) = (result.is_ok(), result.as_ref().is_err_and(StoreError::is_fatal));
            let acknowledge: Acknowledge = Box::new(move |ended| {
                // The key is free again before the caller knows.
                drop(keeping);
                // An error means that the caller is gone; the write stands.
                drop(reply.send(result.and_then(|value| ended.map(|()| value))));
            });
            WriteOutcome { keep, fatal, panic, acknowledge }
        })
    });
    (Command::Write { run, caller: Arc::downgrade(caller) }, answer)
}

/// Writes the audit log: of every change that somebody asked for, and of what the server changes
/// for all to see.
async fn log(tx: &mut Tx, actor: Option<&Actor>, before: i64, max: usize) -> Result<(), StoreError> {
    let is_shown = tx.changes.iter().any(|change| *change != CommittedChange::Jobs);
    match actor {
        Some(actor) if audit::total_changes(tx).await? != before => audit::append(tx, actor, max).await,
        None if is_shown => audit::append(tx, &Actor::server("change", ""), max).await,
        _ => Ok(()),
    }
}

/// The writer's task.
pub(super) struct Writer {
    tx: Tx,
    commands: mpsc::Receiver<Command>,
    on_commit: Arc<dyn OnCommit>,
    vitals: Arc<Vitals>,
    /// Notified of every queued job.
    jobs: Arc<Notify>,
    /// Counts what was committed.
    commits: Arc<AtomicU64>,
    /// Beats by probes, and by what the database does for a long write.
    heart: Arc<Heartbeat>,
    /// Pages of the log from which on it is moved into the file.
    log_pages: i64,
    transactions: Transactions,
}

/// Steps of the database's machine between two beats: a beat costs a thousandth of them.
const STEPS_A_BEAT: i32 = 1000;

/// Why the log is not empty.
const READ: &str = "another connection reads the database";

/// Its name among the parts of the server.
pub(crate) const PART: &str = "the writer of the store";

impl Writer {
    pub(super) fn new(
        conn: Conn,
        commands: mpsc::Receiver<Command>,
        history: HistoryLimits,
        (on_commit, vitals, jobs, commits): (Arc<dyn OnCommit>, Arc<Vitals>, Arc<Notify>, Arc<AtomicU64>),
        (heart, log_pages, transactions): (Arc<Heartbeat>, i64, Transactions),
    ) -> Self {
        let tx = Tx { conn, author: Author::default(), history, changes: Vec::new(), after: Vec::new() };
        Self { tx, commands, on_commit, vitals, jobs, commits, heart, log_pages, transactions }
    }

    /// Runs until told to close and what is queued is done, or until an error after which nothing
    /// may be written.
    pub(super) async fn run(mut self, mut close: oneshot::Receiver<()>, pulse: Pulse) {
        let mut open = true;
        if let Err(error) = beat_with(&mut self.tx.conn, &self.heart).await {
            tracing::error!(%error, "store_failed: no more writes");
            return self.vitals.fail(PART, error.to_string());
        }
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
                tracing::error!(error = &error as &dyn std::error::Error, "store_failed: no more writes");
                let cause = std::error::Error::source(&error).map(|cause| format!(": {cause}"));
                self.vitals.fail(PART, format!("{error}{}", cause.unwrap_or_default()));
                return;
            }
        }
        pulse.end();
        if let Err(error) = note_head(&mut self.tx.conn, "stop").await {
            tracing::warn!(%error, "audit_head_not_read");
        }
        let emptied = match self.tx.conn.sqlite() {
            Ok(conn) => empty_log(conn).await.map_err(|error| error.to_string()),
            // PostgreSQL keeps its log itself.
            Err(_) => Ok(true),
        };
        if let Err(error) = emptied.and_then(|is_empty| is_empty.then_some(()).ok_or(READ.to_owned())) {
            tracing::warn!(%error, follows = "the write-ahead log holds data: copy it with the file", "checkpoint_failed");
        }
        if let Err(error) = self.tx.conn.close().await {
            tracing::warn!(%error, "store_close_failed");
        }
    }

    /// Begins a transaction in which nothing was done.
    async fn begin(&mut self) -> Result<(), StoreError> {
        self.tx.changes.clear();
        self.tx.after.clear();
        if self.tx.conn.is_postgres() {
            // Who waits for another program is not stuck: a statement has a time limit. The next
            // probe ends the rest.
            self.heart.rest();
        }
        self.transactions.begin(&mut self.tx.conn).await
    }

    async fn one(&mut self, command: Command) -> Result<(), StoreError> {
        let (run, caller) = match command {
            Command::Write { run, caller } => (run, caller),
            Command::Probe(answer) => {
                self.heart.beat();
                // An error means that nobody waits for it any more.
                answer.send(()).ok();
                return Ok(());
            }
        };
        if caller.strong_count() == 0 {
            tracing::debug!("write_skipped: its caller has gone");
            return Ok(());
        }
        let begun = self.begin().await;
        let outcome = run(&mut self.tx, begun).await;
        if let Some(cause) = &outcome.panic {
            let follows = "it is rolled back; other writes go on";
            self.vitals.panics().caught(Edge::Write, cause.as_ref(), "a write", follows);
        }
        if !outcome.keep {
            // After some errors (a full disk) SQLite has already rolled back, and this returns an
            // error.
            let rolled_back = self.transactions.roll_back(&mut self.tx.conn).await;
            (outcome.acknowledge)(Ok(()));
            return match rolled_back {
                Err(error) if error.is_fatal() || outcome.fatal => Err(error),
                _ if outcome.fatal => Err(StoreError::Closed),
                _ => Ok(()),
            };
        }
        match self.transactions.commit(&mut self.tx.conn).await {
            Ok(()) => {}
            // Nothing was changed. PostgreSQL repairs itself.
            Err(error) if matches!(error, StoreError::Full) || self.tx.conn.is_postgres() => {
                let rolled_back = self.transactions.roll_back(&mut self.tx.conn).await;
                (outcome.acknowledge)(Err(error));
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
        self.commits.fetch_add(1, Ordering::Release);
        let published = self.publish().await;
        for then in std::mem::take(&mut self.tx.after) {
            let follows = "the write stands; the next start makes up for it";
            self.vitals.panics().catch(Edge::Publication, "what follows a commit", follows, then);
        }
        match published {
            Ok(()) => (outcome.acknowledge)(Ok(())),
            // Durable, but not visible: the caller gets this error, and a later write may publish
            // the map.
            Err(error @ StoreError::NotPublished { .. }) => (outcome.acknowledge)(Err(error)),
            // Durable, but not visible until the next start: not acknowledged.
            Err(error) => {
                (outcome.acknowledge)(Err(StoreError::Closed));
                return Err(error);
            }
        }
        self.move_log().await
    }

    /// After the answer: what is in the log is on the disk. An error of the disk ends the writer
    /// here, too: the log would grow without an end, and the sync that has failed cannot be
    /// repeated.
    async fn move_log(&mut self) -> Result<(), StoreError> {
        let Ok(conn) = self.tx.conn.sqlite() else { return Ok(()) };
        match move_long_log(conn, self.log_pages).await {
            Err(error) if error.is_fatal() => Err(error),
            Err(error) => {
                tracing::warn!(%error, follows = "the log grows; the next commit tries again", "log_not_moved");
                Ok(())
            }
            Ok(()) => Ok(()),
        }
    }

    /// Publishes everything that the write has changed.
    async fn publish(&mut self) -> Result<(), StoreError> {
        let mut done = Ok(());
        for change in std::mem::take(&mut self.tx.changes) {
            if change == CommittedChange::Jobs {
                self.jobs.notify_one();
                continue;
            }
            let mut made = self.on_commit.committed(&mut self.tx.conn, change.clone()).await;
            while let Err(lost) = &made
                && self.transactions.reached_again(&mut self.tx.conn, lost).await
            {
                made = self.on_commit.committed(&mut self.tx.conn, change.clone()).await;
            }
            match made {
                Err(error @ StoreError::NotPublished { .. }) => done = Err(error),
                other => other?,
            }
        }
        done
    }
}

/// Has a long statement beat: it is at work, and not stuck.
async fn beat_with(conn: &mut Conn, heart: &Arc<Heartbeat>) -> Result<(), StoreError> {
    let heart = heart.clone();
    // With PostgreSQL it rests meanwhile.
    let Ok(conn) = conn.sqlite() else { return Ok(()) };
    let mut handle = conn.lock_handle().await.map_err(StoreError::during("watch"))?;
    handle.set_progress_handler(STEPS_A_BEAT, move || {
        heart.beat();
        true
    });
    Ok(())
}
