//! Which permanent parts of the server run: the writer, the workers, the outbox and the tasks
//! beside them. Each holds a [`Pulse`] while it runs. A part that ends before the server is told to
//! stop has failed. Then the server is not ready any more, and [`Vitals::failed`] gives the reason
//! to whoever ends the process.

use super::{
    heartbeats::{Heartbeat, Heartbeats, STALLED},
    panics::Panics,
};
use std::{
    collections::BTreeMap,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};
use tokio::sync::watch;

/// Time between two probes of the parts that cannot hold a pulse themselves.
const PROBE_EVERY: Duration = Duration::from_secs(1);

/// A part that ended before it was told to.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{part} has ended: {reason}")]
pub struct Failure {
    /// Name of the part.
    pub part: String,
    /// The reason, as far as it is known.
    pub reason: String,
}

type Probe = Box<dyn Fn() -> bool + Send + Sync>;

/// The parts of one server.
#[derive(Default)]
pub struct Vitals {
    panics: Arc<Panics>,
    stopping: AtomicBool,
    /// The first failure; the others follow from it or change nothing.
    failure: watch::Sender<Option<Failure>>,
    probes: Mutex<Vec<(&'static str, Probe)>>,
    unpublished: Mutex<BTreeMap<String, String>>,
    hearts: Heartbeats,
    /// A part that is still for longer has failed; 0: none has.
    stall_limit_ms: AtomicU64,
}

impl std::fmt::Debug for Vitals {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Vitals").field("failure", &self.failure()).finish_non_exhaustive()
    }
}

impl Vitals {
    /// Counters of caught panics, of all parts.
    pub fn panics(&self) -> &Arc<Panics> {
        &self.panics
    }

    /// Heartbeats of the parts that work or are probed.
    pub fn hearts(&self) -> &Heartbeats {
        &self.hearts
    }

    /// From now on a part that is still for longer than `limit` has failed.
    pub fn fail_stalled_after(&self, limit: Duration) {
        self.stall_limit_ms.store(limit.as_millis() as u64, Ordering::Relaxed);
    }

    /// The part that has been still for longer than [`STALLED`]: it does not do its work now.
    pub fn stalled(&self) -> Option<Arc<Heartbeat>> {
        self.hearts.stalled(STALLED)
    }

    /// Registers a part that begins to run. It runs until the pulse is dropped.
    #[must_use = "the part runs for as long as this is held"]
    pub fn begin(self: &Arc<Self>, part: impl Into<String>) -> Pulse {
        Pulse { vitals: self.clone(), part: part.into(), is_told: false }
    }

    /// Registers a part that says by itself whether it runs. [`Vitals::failure`] and
    /// [`Vitals::watch`] probe it.
    pub fn probe(&self, part: &'static str, runs: impl Fn() -> bool + Send + Sync + 'static) {
        self.probes.lock().unwrap_or_else(PoisonError::into_inner).push((part, Box::new(runs)));
    }

    /// Records that a part cannot go on.
    pub fn fail(&self, part: &str, reason: impl Into<String>) {
        let failure = Failure { part: part.to_owned(), reason: reason.into() };
        if self.stopping.load(Ordering::Acquire) {
            tracing::debug!(%failure, "part_ended_while_stopping");
            return;
        }
        tracing::error!(%failure, follows = "the server stops", "part_failed");
        self.failure.send_if_modified(|first| {
            let is_first = first.is_none();
            first.get_or_insert(failure);
            is_first
        });
    }

    /// From now on parts end because they are told to.
    pub fn stop(&self) {
        self.stopping.store(true, Ordering::Release);
    }

    /// The first part that failed, if any.
    pub fn failure(&self) -> Option<Failure> {
        if self.failure.borrow().is_none() && !self.stopping.load(Ordering::Acquire) {
            let probes = self.probes.lock().unwrap_or_else(PoisonError::into_inner);
            for (part, _) in probes.iter().filter(|(_, runs)| !runs()) {
                self.fail(part, "it does not run any more");
            }
        }
        self.failure.borrow().clone()
    }

    /// Returns when a part has failed.
    pub async fn failed(&self) -> Failure {
        let mut failure = self.failure.subscribe();
        match failure.wait_for(Option::is_some).await.map(|failure| failure.clone()) {
            Ok(Some(failure)) => failure,
            // Not reached: the sender is in `self`, and the value is awaited to be there.
            _ => std::future::pending().await,
        }
    }

    /// Probes the parts that have a probe, and looks for parts that are still, until one has
    /// failed.
    pub async fn watch(self: Arc<Self>) {
        let (mut looked, mut stalled) = (Instant::now(), None);
        while self.failure().is_none() {
            tokio::time::sleep(PROBE_EVERY).await;
            self.hearts.tick(looked.elapsed());
            looked = Instant::now();
            let part = self.stalled().map(|heart| heart.part().to_owned());
            if part != stalled {
                if let Some(part) = &part {
                    tracing::error!(part, follows = "the server is not ready", "part_stalled");
                } else {
                    tracing::info!("part_goes_on");
                }
                stalled = part;
            }
            let limit = Duration::from_millis(self.stall_limit_ms.load(Ordering::Relaxed));
            if let Some(heart) = self.hearts.stalled(limit).filter(|_| !limit.is_zero()) {
                let seconds = heart.still().as_secs();
                self.fail(heart.part(), format!("it has not gone on for {seconds} s"));
            }
        }
    }

    /// Records that the stored version of a map could not be published: an earlier one stays in use
    /// until a later version can be.
    pub fn unpublished(&self, map: &str, reason: &str) {
        let mut all = self.unpublished.lock().unwrap_or_else(PoisonError::into_inner);
        all.insert(map.to_owned(), reason.to_owned());
    }

    /// Records that the stored version of a map is published, or that the map is gone.
    pub fn published(&self, map: &str) {
        self.unpublished.lock().unwrap_or_else(PoisonError::into_inner).remove(map);
    }

    /// Maps whose stored version is not in use, with the reason.
    pub fn all_unpublished(&self) -> BTreeMap<String, String> {
        self.unpublished.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// A part holds this while it runs.
#[derive(Debug)]
pub struct Pulse {
    vitals: Arc<Vitals>,
    part: String,
    is_told: bool,
}

impl Pulse {
    /// The part ends because it was told to.
    pub fn end(mut self) {
        self.is_told = true;
    }
}

impl Drop for Pulse {
    fn drop(&mut self) {
        if self.is_told {
            return;
        }
        let reason = if std::thread::panicking() { "it panicked" } else { "it stopped by itself" };
        self.vitals.fail(&self.part, reason);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_part_that_ends_untold_is_a_failure_and_the_first_one_stays() {
        let vitals = Arc::new(Vitals::default());
        let pulse = vitals.begin("vision-0");
        assert_eq!(vitals.failure(), None);
        let thread = std::thread::spawn(move || {
            let _pulse = pulse;
            panic!("planted");
        });
        assert!(thread.join().is_err());
        let failure = vitals.failed().await;
        assert_eq!((failure.part.as_str(), failure.reason.as_str()), ("vision-0", "it panicked"));
        drop(vitals.begin("laser"));
        assert_eq!(vitals.failure(), Some(failure));
    }

    #[tokio::test]
    async fn a_part_that_is_told_to_end_is_no_failure() {
        let vitals = Arc::new(Vitals::default());
        let pulse = vitals.begin("writer");
        pulse.end();
        assert_eq!(vitals.failure(), None);
        let pulse = vitals.begin("laser");
        vitals.stop();
        drop(pulse);
        assert_eq!(vitals.failure(), None);
    }

    #[tokio::test]
    async fn a_probe_that_says_no_is_a_failure() {
        let vitals = Arc::new(Vitals::default());
        let runs = Arc::new(AtomicBool::new(true));
        let asked = runs.clone();
        vitals.probe("outbox", move || asked.load(Ordering::Relaxed));
        tokio::spawn(vitals.clone().watch());
        assert_eq!(vitals.failure(), None);
        runs.store(false, Ordering::Relaxed);
        let failed = tokio::time::timeout(PROBE_EVERY * 5, vitals.failed()).await;
        assert_eq!(failed.unwrap().part, "outbox");
    }
}
