//! Long work: accepted with 202, kept as a row so that a crash only delays it, one at a time, with progress that can
//! be watched and a flag that stops it. What a job does is in its own file; here is only its life.
//!
//! The next job is the first open row whose turn it is, whoever queued it and whatever became of them. A job that was
//! interrupted by the end of the process is begun again after a pause, and given up as failed after [`MAX_ATTEMPTS`].

pub(crate) mod learn;
mod negatives;
mod look_alikes;
mod pictures;
mod points;
pub(crate) mod request;
mod spread_work;

use crate::{
    config::Config,
    publication::Catalogue,
    store::{
        StoreError,
        jobs::{self, Ended, JobRow},
    },
};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};
use tokio::sync::watch;

/// How far an open job is.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Progress {
    /// 0 to 1.
    pub(crate) share: f64,
    /// What is being done, for a person.
    pub(crate) message: String,
    /// Running, not waiting any more.
    pub(crate) running: bool,
}

/// Where work reports its progress and learns that it is no longer wanted.
#[derive(Debug)]
pub(crate) struct Reporter {
    progress: watch::Sender<Progress>,
    cancelled: AtomicBool,
    stopping: watch::Receiver<bool>,
}

impl Reporter {
    /// Says how far it is.
    pub(crate) fn report(&self, share: f64, message: impl Into<String>) {
        let message = message.into();
        self.progress.send_replace(Progress { share: share.clamp(0.0, 1.0), message, running: true });
    }

    /// The work is to be given up, between two steps.
    pub(crate) fn unwanted(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed) || *self.stopping.borrow()
    }
}

/// Why a job did not get done.
#[derive(Debug, thiserror::Error)]
pub(crate) enum JobError {
    /// Somebody asked for it, or the server stops.
    #[error("given up")]
    Unwanted,
    /// It cannot be done; the text is for a person.
    #[error("{0}")]
    Failed(String),
    /// The store refused.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// How often a job is begun that ends the process each time.
const MAX_ATTEMPTS: u32 = 5;
/// The server has run so long before a job that was interrupted once is begun again; twice as long for each further time.
/// So the server can be used, and the job cancelled, although the job ends the process each time.
const PAUSE: Duration = Duration::from_secs(1);
/// Until the table is read again after it could not be read or written.
const RETRY: Duration = Duration::from_secs(5);

/// Of open jobs only: those that run or are watched.
#[derive(Debug, Default)]
struct Reporters {
    of: BTreeMap<i64, Arc<Reporter>>,
    running: Option<i64>,
}

/// The jobs that wait or run. Which those are is known from the table alone.
#[derive(Debug)]
pub(crate) struct Jobs {
    store: Catalogue,
    config: Arc<Config>,
    reporters: Mutex<Reporters>,
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
    /// Takes up what a stop or a crash interrupted, then what is queued.
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

    /// Accepts a lesson. Durable when this returns, and begun with whether or not the caller is still there.
    pub(crate) async fn submit(&self, map: &str, request: &request::Request) -> Result<JobRow, StoreError> {
        let limits = (self.config.limits.jobs, self.config.limits.jobs_kept);
        let (map, text) = (map.to_owned(), request.to_json());
        let write = self
            .store
            .write(move |tx| Box::pin(async move { jobs::create(tx, "learn", &map, &text, limits).await }));
        write.await
    }

    /// How far a job is that runs or is watched; `None` for any other.
    pub(crate) fn progress(&self, id: i64) -> Option<Progress> {
        self.lock().of.get(&id).map(|reporter| reporter.progress.borrow().clone())
    }

    /// Progress of an open job, from its queue to its end; `None` once it has ended.
    pub(crate) async fn watch(&self, id: i64) -> Result<Option<watch::Receiver<Progress>>, StoreError> {
        if !is_open(&jobs::get(self.store.reads(), id).await?) {
            return Ok(None);
        }
        let watched = self.reporter(id).progress.subscribe();
        // It may have ended in between: then nobody else would take the reporter away.
        if !is_open(&jobs::get(self.store.reads(), id).await?) {
            self.leave(id);
        }
        Ok(Some(watched))
    }

    /// Asks an open job to stop: one that waits has ended when this returns.
    pub(crate) async fn cancel(self: &Arc<Self>, id: i64) -> Result<(), StoreError> {
        if self.stop_running(id) {
            return Ok(());
        }
        let jobs = self.clone();
        let write = self.store.write(move |tx| {
            Box::pin(async move {
                if jobs::end(tx, id, &cancelled()).await? {
                    // Its turn may have come meanwhile: then it finds its row ended and stores nothing.
                    tx.after(move || {
                        if !jobs.stop_running(id) {
                            jobs.leave(id);
                        }
                    });
                }
                Ok(())
            })
        });
        write.await
    }

    /// What the open jobs of a map learn. Models that only get points stay as they are.
    pub(crate) async fn learning(&self, map: &str) -> Result<Learning, StoreError> {
        let mut learning = Learning::default();
        for row in jobs::open(self.store.reads()).await?.into_iter().filter(|row| row.map == map) {
            let request = request::Request::from_json(&row.request);
            match request.landmarks {
                _ if request.only_points => {}
                Some(names) => learning.landmarks.extend(names),
                None => learning.all = true,
            }
        }
        Ok(learning)
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Reporters> {
        // Every change is one insertion or removal: nothing can be left half done.
        self.reporters.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn reporter(&self, id: i64) -> Arc<Reporter> {
        let new = || {
            Arc::new(Reporter {
                progress: watch::Sender::new(Progress::default()),
                cancelled: AtomicBool::new(false),
                stopping: self.stopping.clone(),
            })
        };
        self.lock().of.entry(id).or_insert_with(new).clone()
    }

    /// Tells the job that runs to stop. False if this one does not run.
    fn stop_running(&self, id: i64) -> bool {
        let reporters = self.lock();
        let running = reporters.running.filter(|running| *running == id);
        let reporter = running.and_then(|id| reporters.of.get(&id));
        reporter.inspect(|reporter| reporter.cancelled.store(true, Ordering::Relaxed)).is_some()
    }

    fn leave(&self, id: i64) {
        // Whoever watches is told by the end of the channel, with the last reporter.
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
                    done
                }
                Ok(Next::NoneFor(pause)) => Ok(pause),
                Err(error) => Err(error),
            };
            let pause = done.unwrap_or_else(|error| {
                tracing::error!(error = &error as &dyn std::error::Error, "jobs wait");
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

    /// The first open job whose pause is over.
    async fn next(&self) -> Result<Next, StoreError> {
        let up = self.started.elapsed();
        let mut wait = Duration::MAX;
        for row in jobs::open(self.store.reads()).await? {
            let pause = match row.attempts {
                1..MAX_ATTEMPTS => PAUSE * (1 << (row.attempts - 1)),
                // New, or to be given up.
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
            tracing::error!(job = id, message, "job failed");
            return self.end(id, Ended { state: "failed", message, result: None }).await;
        }
        reporter.report(0.0, "started");
        if !self.store.write(move |tx| Box::pin(async move { jobs::begin(tx, id).await })).await? {
            return Ok(());
        }
        let ended = match learn::run(&self.store, &self.config, row, &reporter).await {
            // The row was ended together with the models.
            Ok(()) => return Ok(()),
            // Taken up again at the next start.
            Err(JobError::Unwanted) if !reporter.cancelled.load(Ordering::Relaxed) => {
                let write = self.store.write(move |tx| Box::pin(async move { jobs::put_back(tx, id).await }));
                return write.await;
            }
            Err(JobError::Unwanted) => cancelled(),
            Err(JobError::Failed(message)) => Ended { state: "failed", message, result: None },
            Err(JobError::Store(error)) => {
                tracing::error!(job = id, error = &error as &dyn std::error::Error, "job failed");
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
