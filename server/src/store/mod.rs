//! Everything durable, in one SQLite file: maps, landmarks, views, models, walls, robots, jobs.
//!
//! One task owns the only connection that writes ([`writer`]); reads take a separate, read-only
//! pool. Every SQL text is a constant of its file and is prepared by a test against the migrated
//! schema. One listener learns of every commit ([`on_commit`]); the store knows it by its trait
//! alone.

pub(crate) mod db;
mod error;
pub(crate) mod kind;
mod postgres;
pub(crate) mod sqlite;
mod transactions;
mod derived_schema;
mod writer;
mod statements;
pub(crate) mod map_rows;
pub(crate) mod on_commit;
pub(crate) mod maps;
pub(crate) mod map_locations;
pub(crate) mod landmarks;
pub(crate) mod underlays;
pub(crate) mod schema;
pub(crate) mod page_sessions;
pub(crate) mod pictures;
pub(crate) mod views;
pub(crate) mod models;
pub(crate) mod walls;
pub(crate) mod landmark_learning;
pub(crate) mod landmark_merge;
pub(crate) mod landmark_placement;
pub(crate) mod aspect_views;
pub(crate) mod teaching;
pub(crate) mod gatherings;
pub(crate) mod track_acceptance;
pub(crate) mod modality_stats;
pub(crate) mod visibility_settings;
pub(crate) mod visibility_areas;
pub(crate) mod robot_certificates;
pub(crate) mod robots;
pub(crate) mod stored_answers;
pub(crate) mod refused_views;
pub(crate) mod tokens;
pub(crate) mod jobs;
pub(crate) mod kept_answers;
pub(crate) mod actor;
pub(crate) mod audit;
pub(crate) mod revisions;
pub(crate) mod history;
pub(crate) mod contents;
pub(crate) mod drafts;

pub(crate) use error::StoreError;
pub(crate) use on_commit::{CommittedChange, OnCommit};
pub(crate) use postgres::{
    copies::{bytes as database_bytes, copy as copy_database, restore as restore_database},
    open::OpenError as PostgresError,
};
pub(crate) use sqlite::{
    copies, disk_guard, integrity,
    open::{self, OpenError},
    restored,
};
pub(crate) use writer::{PART as WRITER, Tx};

use crate::config::Config;
use db::{Conn, Pool};
use disk_guard::DiskGuard;
use engine::{heartbeats::Heartbeat, vitals::Vitals};
use futures::future::BoxFuture;
use protos::api::AuditHead;
use sha2::{Digest as _, Sha256};
use std::{
    fmt::Write as _,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant, SystemTime},
};
use tokio::sync::{Mutex, MutexGuard, Notify, mpsc, oneshot};
use transactions::Transactions;

/// The open store. Cheap to clone.
#[derive(Debug, Clone)]
pub(crate) struct Store {
    commands: mpsc::Sender<writer::Command>,
    reads: Pool,
    vitals: Arc<Vitals>,
    jobs: Arc<Notify>,
    commits: Arc<AtomicU64>,
    disk: Arc<DiskGuard>,
    /// Held while a write is prepared and made.
    turn: Arc<Mutex<()>>,
    keys: kept_answers::InFlightKeys,
    /// Most answers that are kept for repeats.
    kept_answers: usize,
    /// Most entries of the audit log.
    audit_entries: usize,
    heart: Arc<Heartbeat>,
    /// Wait of the last probe, ms.
    probe_ms: Arc<AtomicU64>,
    last_check: integrity::LastCheck,
}

/// What waits for the writer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct WriteQueue {
    /// Commands.
    pub(crate) waiting: usize,
    /// How long the last probe waited.
    pub(crate) last_wait: Duration,
}

/// Awaited so that the file is closed in good order.
#[derive(Debug)]
pub(crate) struct WriterTask {
    task: tokio::task::JoinHandle<()>,
    close: oneshot::Sender<()>,
    reads: Pool,
    /// Held for as long as the writer runs: a second server on the same directory would be a second
    /// writer.
    _lock: std::fs::File,
}

impl WriterTask {
    /// Ends the writer as a fault would.
    #[cfg(test)]
    pub(crate) fn abort(&self) {
        self.task.abort();
    }

    /// Takes no more writes, finishes those that wait, and leaves one complete file behind.
    pub(crate) async fn close(self) {
        // Readers first: the writer's last checkpoint needs a database that nobody reads.
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
    /// Opens or creates the database under `config.data`, migrates it, checks its settings and its
    /// integrity, and tells `on_commit` of everything in it.
    pub(crate) async fn open(
        config: &Config,
        on_commit: Arc<dyn OnCommit>,
        vitals: Arc<Vitals>,
    ) -> Result<(Self, WriterTask), OpenError> {
        let (opened, transactions) = Box::pin(opened(config)).await?;
        let disk = Arc::new(DiskGuard::new(&config.data, &config.limits));
        let jobs = Arc::new(Notify::new());
        let mut conn = opened.writer;
        on_commit.opened(&mut conn).await.map_err(OpenError::Load)?;
        let history = history::HistoryLimits {
            commits: config.limits.kept_commits,
            bytes: config.limits.history_bytes,
        };
        note_head(&mut conn, "start").await.map_err(OpenError::Load)?;
        let (commands, received) = mpsc::channel(config.limits.write_queue);
        let commits = Arc::<AtomicU64>::default();
        let parts = (on_commit, vitals.clone(), jobs.clone(), commits.clone());
        let heart = vitals.hearts().begin(WRITER);
        let with = (heart.clone(), config.log_pages().unwrap_or(sqlite::checkpoint::LOG_PAGES), transactions);
        let writer = writer::Writer::new(conn, received, history, parts, with);
        let (close, closed) = oneshot::channel();
        let task = tokio::spawn(writer.run(closed, vitals.begin(WRITER)));
        let task = WriterTask { task, close, reads: opened.reads.clone(), _lock: opened.lock };
        let (turn, keys) = (Arc::default(), kept_answers::InFlightKeys::default());
        let (kept_answers, audit_entries) = (config.limits.kept_answers, config.limits.audit_entries);
        let (reads, probe_ms) = (opened.reads, Arc::default());
        let store = Self {
            commands,
            reads,
            vitals,
            jobs,
            commits,
            disk,
            turn,
            keys,
            kept_answers,
            audit_entries,
            heart,
            probe_ms,
            last_check: integrity::LastCheck::default(),
        };
        Ok((store, task))
    }

    /// The database, if it is not the file in the data directory.
    pub(crate) fn database(&self) -> Option<Pool> {
        Some(self.reads.clone()).filter(|reads| matches!(reads, Pool::Postgres(_)))
    }

    /// The check of the whole database after this start.
    pub(crate) fn last_check(&self) -> &integrity::LastCheck {
        &self.last_check
    }

    /// Runs `write` in its own transaction. When this returns `Ok`, it is committed and visible. A
    /// caller that drops this future before the transaction begins takes the write back; later it
    /// runs to its end. The answer to a creation with a key is kept in the same transaction
    /// ([`kept_answers`]), and so is the entry of the audit log ([`audit`]).
    pub(crate) async fn write<T, F>(&self, write: F) -> Result<T, StoreError>
    where
        T: Send + 'static,
        F: for<'t> FnOnce(&'t mut Tx) -> BoxFuture<'t, Result<T, StoreError>> + Send + 'static,
    {
        let caller = Arc::new(());
        let beside = writer::WriteContext {
            keeping: kept_answers::IdempotencyRecord::current(),
            actor: actor::Actor::current(),
            audit_entries: self.audit_entries,
        };
        let (command, answer) = writer::command(write, beside, &caller);
        self.commands.send(command).await.map_err(|_gone| StoreError::Closed)?;
        let answer = answer.await;
        drop(caller);
        answer.map_err(|_gone| StoreError::Closed)?
    }

    /// Returns when the writer has done what was asked for before. Writes nothing.
    pub(crate) async fn probe(&self) -> Result<(), StoreError> {
        let asked = Instant::now();
        let (reply, answer) = oneshot::channel();
        self.commands.send(writer::Command::Probe(reply)).await.map_err(|_gone| StoreError::Closed)?;
        answer.await.map_err(|_gone| StoreError::Closed)?;
        self.probe_ms.store(asked.elapsed().as_millis() as u64, Ordering::Relaxed);
        Ok(())
    }

    /// Beats while the writer goes on.
    pub(crate) fn heart(&self) -> &Heartbeat {
        &self.heart
    }

    /// What waits for the writer.
    pub(crate) fn queue(&self) -> WriteQueue {
        let waiting = self.commands.max_capacity() - self.commands.capacity();
        WriteQueue { waiting, last_wait: Duration::from_millis(self.probe_ms.load(Ordering::Relaxed)) }
    }

    /// The turn to prepare a write from stored data: one at a time, so that no preparation makes
    /// another obsolete.
    async fn preparing(&self) -> MutexGuard<'_, ()> {
        self.turn.lock().await
    }

    /// Returns when a job was queued since the last call.
    pub(crate) async fn job_queued(&self) {
        self.jobs.notified().await;
    }

    /// The read-only pool.
    pub(crate) fn reads(&self) -> &Pool {
        &self.reads
    }

    /// How many writes were committed since the store was opened. A write is counted before it is
    /// acknowledged.
    pub(crate) fn commits(&self) -> u64 {
        self.commits.load(Ordering::Acquire)
    }

    /// Whether there is room for more.
    pub(crate) fn disk(&self) -> &Arc<DiskGuard> {
        &self.disk
    }

    /// Which parts of the server run; the writer is one of them.
    pub(crate) fn vitals(&self) -> &Arc<Vitals> {
        &self.vitals
    }
}

/// The database of the settings, on the present schema, and how it is written.
async fn opened(config: &Config) -> Result<(open::Opened, Transactions), OpenError> {
    let Some(address) = &config.store else {
        return Ok((open::open(&config.data, config.sqlite_vfs()).await?, Transactions::Sqlite));
    };
    let lock = open::lock(&config.data)?;
    let holder = transactions::random().map_err(OpenError::Open)?;
    let (mut writer, reads) = postgres::open::open(address.secret(), &holder).await?;
    history::close_outside(&mut writer).await.map_err(OpenError::Open)?;
    tracing::info!(store = %address, "store_opened");
    let transactions = transactions::Postgres { address: address.secret().to_owned(), holder, turn: None };
    Ok((open::Opened { writer, reads, lock }, Transactions::Postgres(transactions)))
}

/// Writes the newest place of the audit log to the server's own log: a note outside of the
/// database.
async fn note_head(conn: &mut Conn, at: &str) -> Result<(), StoreError> {
    let head = AuditHead::from(audit::head(conn).await?);
    tracing::info!(seq = head.seq, sha256 = head.sha256, at, "audit_head");
    Ok(())
}

/// ms since the Unix epoch, for display.
pub(crate) fn now_ms() -> i64 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |d| d.as_millis() as i64)
}

/// Refuses an insertion that has passed a bound: the transaction is rolled back.
fn within(count: i64, max: usize, what: &'static str) -> Result<(), StoreError> {
    if count as usize > max { Err(StoreError::Limit { what, max }) } else { Ok(()) }
}

/// The revision of a text: its digest, so that what is shown and what is stored can be compared
/// wherever they are read.
fn text_revision(text: &str) -> String {
    let digest = Sha256::digest(text.as_bytes());
    digest[..12].iter().fold(String::new(), |mut hex, byte| {
        // Writing to a String cannot fail.
        write!(hex, "{byte:02x}").ok();
        hex
    })
}

#[cfg(test)]
mod damage;
#[cfg(test)]
mod io_errors;
#[cfg(test)]
mod power_cuts;
#[cfg(test)]
pub(crate) mod tests;
