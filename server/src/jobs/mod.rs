//! The life of jobs: long work that is accepted with 202 and stored as a row, so that a crash only
//! delays it. One job runs at a time, with progress that can be watched and a flag that cancels it.
//! What a job does is in its own file.
//!
//! The next job is the first open row whose pause is over. A job that the end of the process
//! interrupted starts again after a pause, and fails after [`MAX_ATTEMPTS`].

pub(crate) mod duplicates;
mod learn;
mod lesson_result;
mod negatives;
mod look_alikes;
mod pictures;
pub(crate) mod request;
mod spread_work;

pub(crate) use lesson_result::thresholds_shown;

use crate::{
    config::Config,
    publication::Catalogue,
    store::{
        StoreError,
        actor::Actor,
        jobs::{self, Ended, JobFilter, JobRow},
    },
};
use protos::api::{JobState, ServerEventBody};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};
use tokio::sync::watch;

/// Progress of an open job.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct JobProgress {
    /// Share of the work that is done, 0 to 1.
    pub(crate) share: f64,
    /// What is being done, for a person.
    pub(crate) message: String,
    /// The job runs; it does not wait any more.
    pub(crate) running: bool,
}

/// A job reports its progress here, and reads whether it is cancelled.
#[derive(Debug)]
pub(crate) struct ProgressReporter {
    progress: watch::Sender<JobProgress>,
    cancelled: AtomicBool,
    stopping: watch::Receiver<bool>,
}

impl ProgressReporter {
    /// Reports progress.
    pub(crate) fn report(&self, share: f64, message: impl Into<String>) {
        let message = message.into();
        self.progress.send_replace(JobProgress { share: share.clamp(0.0, 1.0), message, running: true });
    }

    /// Whether the job shall stop, between two steps: it was cancelled, or the server stops.
    pub(crate) fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed) || *self.stopping.borrow()
    }
}

/// Why a job was not done.
#[derive(Debug, thiserror::Error)]
pub(crate) enum JobError {
    /// It was cancelled, or the server stops.
    #[error("cancelled")]
    Cancelled,
    /// It cannot be done; the text is for a person.
    #[error("{0}")]
    Failed(String),
    /// The store refused.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// How often a job starts that ends the process each time.
const MAX_ATTEMPTS: u32 = 5;
/// The server runs for this long before a job that was interrupted once starts again; twice as long
/// for each further time. So the server can be used, and the job cancelled, even if the job ends
/// the process each time.
const PAUSE: Duration = Duration::from_secs(1);
/// Pause after a failed read or write of the table.
const RETRY: Duration = Duration::from_secs(5);

/// Reporters of open jobs that run or are watched.
#[derive(Debug, Default)]
struct ProgressReporters {
    of: BTreeMap<i64, Arc<ProgressReporter>>,
    running: Option<i64>,
}

/// The open jobs. The table alone says which those are.
#[derive(Debug)]
pub(crate) struct Jobs {
    store: Catalogue,
    config: Arc<Config>,
    reporters: Mutex<ProgressReporters>,
    started: Instant,
    stopping: watch::Receiver<bool>,
}

/// What the open jobs of a map learn.
#[derive(Debug, Default)]
pub(crate) struct Learning {
    all: bool,
    landmarks: BTreeSet<String>,
}

impl Learning {
    /// Whether this landmark is learnt.
    pub(crate) fn has(&self, landmark: &str) -> bool {
        self.all || self.landmarks.contains(landmark)
    }
}

/// Which job is next.
enum Next {
    Job(Box<JobRow>),
    /// None before so long, unless one is queued meanwhile.
    NoneFor(Duration),
}

impl Jobs {
    /// Resumes interrupted jobs, then runs queued ones.
    pub(crate) async fn start(
        store: Catalogue,
        config: Arc<Config>,
        stopping: watch::Receiver<bool>,
    ) -> Result<(Arc<Self>, tokio::task::JoinHandle<()>), StoreError> {
        let reporters = Mutex::default();
        let jobs = Arc::new(Self { store, config, reporters, started: Instant::now(), stopping });
        for row in jobs::open(jobs.store.reads()).await? {
            tracing::info!(job = row.id, attempts = row.attempts, "job_resumed");
        }
        let pulse = jobs.store.vitals().begin("the task that runs jobs");
        let run = jobs.clone().run();
        let task = tokio::spawn(async move {
            run.await;
            drop(pulse);
        });
        Ok((jobs, task))
    }

    /// Accepts a lesson. Durable when this returns; it runs whether or not the caller still waits.
    pub(crate) async fn submit(&self, map: &str, request: &request::Request) -> Result<JobRow, StoreError> {
        let limits = (self.config.limits.jobs, self.config.limits.jobs_kept);
        let (map, text) = (map.to_owned(), request.to_json());
        let write = self
            .store
            .write(move |tx| Box::pin(async move { jobs::create(tx, "learn", &map, &text, limits).await }));
        let row = write.await?;
        self.tell(&row, JobState::Queued);
        Ok(row)
    }

    /// Tells readers of events where a job stands.
    pub(crate) fn tell(&self, row: &JobRow, state: JobState) {
        self.store.events().tell(ServerEventBody::Job { map: row.map.clone(), job: row.id, state });
    }

    /// A job with its progress while it is open. Its row ends in the transaction of its models;
    /// here it has ended once those are published, so whoever asks next is answered by them.
    pub(crate) async fn get(&self, id: i64) -> Result<(JobRow, Option<JobProgress>), StoreError> {
        Ok(self.with_progress(jobs::get(self.store.reads(), id).await?))
    }

    /// Jobs with numbers below `before`, newest first, and how many there are on all pages.
    pub(crate) async fn page(
        &self,
        filter: &JobFilter,
        before: i64,
        limit: usize,
    ) -> Result<(Vec<(JobRow, Option<JobProgress>)>, u64), StoreError> {
        let rows = jobs::page(self.store.reads(), filter, before, limit).await?;
        let total = jobs::count(self.store.reads(), filter).await?;
        Ok((rows.into_iter().map(|row| self.with_progress(row)).collect(), total))
    }

    fn with_progress(&self, mut row: JobRow) -> (JobRow, Option<JobProgress>) {
        let reporters = self.lock();
        if !is_open(&row) {
            if reporters.running != Some(row.id) {
                return (row, None);
            }
            (row.state, row.message, row.result) = ("running".to_owned(), String::new(), None);
        }
        let progress = reporters.of.get(&row.id).map(|reporter| reporter.progress.borrow().clone());
        (row, progress)
    }

    /// Progress of an open job, from its queue to its end; `None` once it has ended.
    pub(crate) async fn watch(&self, id: i64) -> Result<Option<watch::Receiver<JobProgress>>, StoreError> {
        if !is_open(&self.get(id).await?.0) {
            return Ok(None);
        }
        let watched = self.reporter(id).progress.subscribe();
        // If it ended in between, nobody else removes the reporter.
        if !is_open(&self.get(id).await?.0) {
            self.leave(id);
        }
        Ok(Some(watched))
    }

    /// Asks an open job to stop: one that waits has ended when this returns.
    pub(crate) async fn cancel(self: &Arc<Self>, id: i64) -> Result<(), StoreError> {
        if self.stop_running(id) {
            return Ok(());
        }
        let (jobs, row) = (self.clone(), jobs::get(self.store.reads(), id).await?);
        let write = self.store.write(move |tx| {
            Box::pin(async move {
                if jobs::end(tx, id, &cancelled()).await? {
                    // It may have started meanwhile: then it finds its row ended and stores
                    // nothing.
                    tx.after(move || {
                        if !jobs.stop_running(id) {
                            jobs.leave(id);
                            jobs.tell(&row, JobState::Cancelled);
                        }
                    });
                }
                Ok(())
            })
        });
        write.await
    }

    /// What the open jobs of a map learn.
    pub(crate) async fn learning(&self, map: &str) -> Result<Learning, StoreError> {
        let mut learning = Learning::default();
        for row in jobs::open(self.store.reads()).await?.into_iter().filter(|row| row.map == map) {
            let request = request::Request::from_json(&row.request);
            match request.landmarks {
                Some(names) => learning.landmarks.extend(names),
                None => learning.all = true,
            }
        }
        Ok(learning)
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, ProgressReporters> {
        // Every change is one insertion or removal: nothing can be left half done.
        self.reporters.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn reporter(&self, id: i64) -> Arc<ProgressReporter> {
        let new = || {
            Arc::new(ProgressReporter {
                progress: watch::Sender::new(JobProgress::default()),
                cancelled: AtomicBool::new(false),
                stopping: self.stopping.clone(),
            })
        };
        self.lock().of.entry(id).or_insert_with(new).clone()
    }

    /// Cancels a running job. False if this one does not run.
    fn stop_running(&self, id: i64) -> bool {
        let reporters = self.lock();
        let running = reporters.running.filter(|running| *running == id);
        let reporter = running.and_then(|id| reporters.of.get(&id));
        reporter.inspect(|reporter| reporter.cancelled.store(true, Ordering::Relaxed)).is_some()
    }

    fn leave(&self, id: i64) {
        // The end of the channel tells the watchers, once the last reporter is dropped.
        let mut reporters = self.lock();
        reporters.of.remove(&id);
        reporters.running.take_if(|running| *running == id);
    }

    async fn run(self: Arc<Self>) {
        let mut stopping = self.stopping.clone();
        while !*stopping.borrow() {
            let done = match self.next().await {
                Ok(Next::Job(row)) => {
                    let done = self.one(&row).await.map(|()| Duration::ZERO);
                    self.leave(row.id);
                    if let Ok(row) = jobs::get(self.store.reads(), row.id).await {
                        self.tell(&row, JobState::of_word(&row.state));
                    }
                    done
                }
                Ok(Next::NoneFor(pause)) => Ok(pause),
                Err(error) => Err(error),
            };
            let pause = done.unwrap_or_else(|error| {
                tracing::error!(error = &error as &dyn std::error::Error, "jobs_table_failed");
                RETRY
            });
            if pause.is_zero() {
                continue;
            }
            tokio::select! {
                _ = stopping.wait_for(|stop| *stop) => return,
                () = self.store.job_queued() => {}
                () = tokio::time::sleep(pause) => {}
            }
        }
    }

    /// The first open job whose pause is over. While the disk is nearly full, all wait.
    async fn next(&self) -> Result<Next, StoreError> {
        if self.store.disk().check().is_err() {
            return Ok(Next::NoneFor(RETRY));
        }
        let up = self.started.elapsed();
        let mut wait = Duration::MAX;
        for row in jobs::open(self.store.reads()).await? {
            let pause = match row.attempts {
                1..MAX_ATTEMPTS => PAUSE * (1 << (row.attempts - 1)),
                // New, or out of attempts.
                _ => Duration::ZERO,
            };
            let rest = pause.saturating_sub(up);
            if rest.is_zero() {
                return Ok(Next::Job(Box::new(row)));
            }
            wait = wait.min(rest);
        }
        Ok(Next::NoneFor(wait))
    }

    async fn one(&self, row: &JobRow) -> Result<(), StoreError> {
        let id = row.id;
        let reporter = self.reporter(id);
        self.lock().running = Some(id);
        if row.attempts >= MAX_ATTEMPTS {
            let message = format!(
                "given up: the server ended {} times while it worked on this job; see its log",
                row.attempts
            );
            tracing::error!(job = id, message, "job_failed");
            return self.end(id, Ended { state: "failed", message, result: None }).await;
        }
        reporter.report(0.0, "started");
        if !self.store.write(move |tx| Box::pin(async move { jobs::begin(tx, id).await })).await? {
            return Ok(());
        }
        self.tell(row, JobState::Running);
        let actor = Actor {
            name: row.author.clone(),
            job: Some((id, row.author.clone())),
            why: row.why.clone(),
            ..Actor::server(&row.kind, format!("/jobs/{id}"))
        };
        let ended = match actor.scope(learn::run(&self.store, &self.config, row, &reporter)).await {
            // The row has ended together with the models.
            Ok(()) => {
                tracing::info!(job = id, map = row.map, "job_done");
                return Ok(());
            }
            // It resumes at the next start.
            Err(JobError::Cancelled) if !reporter.cancelled.load(Ordering::Relaxed) => {
                let write = self.store.write(move |tx| Box::pin(async move { jobs::put_back(tx, id).await }));
                return write.await;
            }
            Err(JobError::Cancelled) => cancelled(),
            Err(JobError::Failed(message)) => {
                tracing::warn!(job = id, map = row.map, message, "job_failed");
                Ended { state: "failed", message, result: None }
            }
            Err(JobError::Store(error)) => {
                tracing::error!(job = id, error = &error as &dyn std::error::Error, "job_failed");
                Ended { state: "failed", message: error.to_string(), result: None }
            }
        };
        self.end(id, ended).await
    }

    async fn end(&self, id: i64, ended: Ended) -> Result<(), StoreError> {
        let write = self.store.write(move |tx| Box::pin(async move { jobs::end(tx, id, &ended).await }));
        write.await.map(drop)
    }
}

fn is_open(row: &JobRow) -> bool {
    matches!(row.state.as_str(), "queued" | "running")
}

fn cancelled() -> Ended {
    Ended { state: "cancelled", message: String::new(), result: None }
}

#[cfg(test)]
mod tests;
