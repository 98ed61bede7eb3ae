//! Long work: accepted with 202, kept as a row so that a crash only delays it, one at a time, with progress that can
//! be watched and a flag that stops it. What a job does is in its own file; here is only its life.

pub(crate) mod learn;
mod negatives;
mod look_alikes;

use crate::{
    config::Config,
    store::{
        Store, StoreError,
        jobs::{self, Ended, JobRow},
    },
};
use std::{
    collections::BTreeMap,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};
use tokio::sync::{Notify, watch};

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

#[derive(Debug)]
struct Open {
    reporter: Arc<Reporter>,
    map: String,
    /// Landmarks in work; `None` means all of the map.
    landmarks: Option<Vec<String>>,
}

/// The jobs that wait or run.
#[derive(Debug)]
pub(crate) struct Jobs {
    store: Store,
    config: Arc<Config>,
    open: Mutex<BTreeMap<i64, Open>>,
    wake: Notify,
    stopping: watch::Receiver<bool>,
}

impl Jobs {
    /// Takes up what a stop or a crash interrupted.
    pub(crate) async fn start(
        store: Store,
        config: Arc<Config>,
        stopping: watch::Receiver<bool>,
    ) -> Result<(Arc<Self>, tokio::task::JoinHandle<()>), StoreError> {
        let jobs = Arc::new(Self { store, config, open: Mutex::default(), wake: Notify::new(), stopping });
        for row in jobs::open(jobs.store.reads()).await? {
            tracing::info!(job = row.id, "taken up again");
            jobs.enter(&row);
        }
        let task = tokio::spawn(jobs.clone().run());
        Ok((jobs, task))
    }

    /// Accepts a lesson. Durable when this returns.
    pub(crate) async fn submit(&self, map: &str, request: &learn::Request) -> Result<JobRow, StoreError> {
        let limits = (self.config.limits.jobs, self.config.limits.jobs_kept);
        let (map, text) = (map.to_owned(), request.to_json());
        let row = self
            .store
            .write(move |tx| Box::pin(async move { jobs::create(tx, "learn", &map, &text, limits).await }));
        let row = row.await?;
        self.take_up(&row);
        Ok(row)
    }

    /// Begins with a job that was queued together with something else.
    pub(crate) fn take_up(&self, row: &JobRow) {
        self.enter(row);
        self.wake.notify_one();
    }

    /// Progress of an open job; `None` once it has ended.
    pub(crate) fn watch(&self, id: i64) -> Option<watch::Receiver<Progress>> {
        self.lock().get(&id).map(|open| open.reporter.progress.subscribe())
    }

    /// Asks an open job to stop.
    pub(crate) async fn cancel(&self, id: i64) -> Result<(), StoreError> {
        let reporter = self.lock().get(&id).map(|open| open.reporter.clone());
        let Some(reporter) = reporter else { return Ok(()) };
        reporter.cancelled.store(true, Ordering::Relaxed);
        if !reporter.progress.borrow().running {
            self.end(id, cancelled()).await?;
        }
        Ok(())
    }

    /// Whether an open job learns this landmark.
    pub(crate) fn is_learning(&self, map: &str, landmark: &str) -> bool {
        self.lock().values().any(|open| {
            open.map == map && open.landmarks.as_ref().is_none_or(|names| names.iter().any(|n| n == landmark))
        })
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<i64, Open>> {
        // Every change is one insertion or removal: nothing can be left half done.
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn enter(&self, row: &JobRow) {
        let reporter = Reporter {
            progress: watch::Sender::new(Progress::default()),
            cancelled: AtomicBool::new(false),
            stopping: self.stopping.clone(),
        };
        let landmarks = learn::Request::from_json(&row.request).landmarks;
        let open = Open { reporter: Arc::new(reporter), map: row.map.clone(), landmarks };
        self.lock().insert(row.id, open);
    }

    /// Ends the row, then tells those who watch.
    async fn end(&self, id: i64, ended: Ended) -> Result<(), StoreError> {
        let write = self.store.write(move |tx| Box::pin(async move { jobs::end(tx, id, &ended).await }));
        write.await?;
        self.leave(id);
        Ok(())
    }

    fn leave(&self, id: i64) {
        // Whoever watches is told by the end of the channel, with the last reporter.
        self.lock().remove(&id);
    }

    async fn run(self: Arc<Self>) {
        let mut stopping = self.stopping.clone();
        loop {
            while let Some(id) = self.next() {
                if let Err(error) = self.one(id).await {
                    tracing::error!(job = id, error = &error as &dyn std::error::Error, "job");
                    self.leave(id);
                }
                if *stopping.borrow() {
                    return;
                }
            }
            tokio::select! {
                _ = stopping.wait_for(|stop| *stop) => return,
                () = self.wake.notified() => {}
            }
        }
    }

    fn next(&self) -> Option<i64> {
        self.lock().keys().next().copied()
    }

    async fn one(&self, id: i64) -> Result<(), StoreError> {
        let Some(reporter) = self.lock().get(&id).map(|open| open.reporter.clone()) else { return Ok(()) };
        reporter.report(0.0, "started");
        let started = self.store.write(move |tx| Box::pin(async move { jobs::set_running(tx, id).await }));
        if !started.await? {
            self.leave(id);
            return Ok(());
        }
        let row = jobs::get(self.store.reads(), id).await?;
        let ended = match learn::run(&self.store, &self.config, &row, &reporter).await {
            // The row was ended together with the models.
            Ok(()) => {
                self.leave(id);
                return Ok(());
            }
            // Left as running: taken up again at the next start.
            Err(JobError::Unwanted) if !reporter.cancelled.load(Ordering::Relaxed) => return Ok(()),
            Err(JobError::Unwanted) => cancelled(),
            Err(JobError::Failed(message)) => Ended { state: "failed", message, result: None },
            Err(JobError::Store(error)) => {
                tracing::error!(job = id, error = &error as &dyn std::error::Error, "job failed");
                Ended { state: "failed", message: error.to_string(), result: None }
            }
        };
        self.end(id, ended).await
    }
}

fn cancelled() -> Ended {
    Ended { state: "cancelled", message: String::new(), result: None }
}
