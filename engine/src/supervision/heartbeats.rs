//! Whether the parts of a server still get their work done, beside whether they run
//! ([`crate::vitals::Pulse`]). A part that works for others beats at each piece of work, and rests
//! between them; a part that is probed beats whenever a probe went through. In: beats, and ticks of
//! a clock. Out: for how long each part has been still.

use std::{
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::Duration,
};

/// A part that has been still for longer is not ready.
pub const STALLED: Duration = Duration::from_secs(4);
/// Most parts: workers and a few others.
pub const MAX_PARTS: usize = 512;
/// What one tick adds at most: a machine that stood still for a while says nothing about the parts.
const MAX_TICK: Duration = Duration::from_secs(2);

/// Held by one part.
#[derive(Debug)]
pub struct Heartbeat {
    part: String,
    beats: AtomicU64,
    is_resting: AtomicBool,
    /// Beats at the last tick.
    seen: AtomicU64,
    still_ms: AtomicU64,
}

impl Heartbeat {
    /// A piece of work has begun or gone on, or a probe went through.
    pub fn beat(&self) {
        self.is_resting.store(false, Ordering::Relaxed);
        self.beats.fetch_add(1, Ordering::Relaxed);
    }

    /// There is nothing to do.
    pub fn rest(&self) {
        self.is_resting.store(true, Ordering::Relaxed);
    }

    /// The part.
    pub fn part(&self) -> &str {
        &self.part
    }

    /// For how long it has been still, in the time of the ticks.
    pub fn still(&self) -> Duration {
        Duration::from_millis(self.still_ms.load(Ordering::Relaxed))
    }

    fn tick(&self, passed: Duration) {
        let beats = self.beats.load(Ordering::Relaxed);
        let is_alive = self.seen.swap(beats, Ordering::Relaxed) != beats;
        if is_alive || self.is_resting.load(Ordering::Relaxed) {
            self.still_ms.store(0, Ordering::Relaxed);
        } else {
            self.still_ms.fetch_add(passed.min(MAX_TICK).as_millis() as u64, Ordering::Relaxed);
        }
    }
}

/// The heartbeats of all parts.
#[derive(Debug, Default)]
pub struct Heartbeats(Mutex<Vec<Arc<Heartbeat>>>);

impl Heartbeats {
    /// Registers a part, at rest. Beyond [`MAX_PARTS`] nobody looks at it.
    pub fn begin(&self, part: impl Into<String>) -> Arc<Heartbeat> {
        let heart = Arc::new(Heartbeat {
            part: part.into(),
            beats: AtomicU64::new(0),
            is_resting: AtomicBool::new(true),
            seen: AtomicU64::new(0),
            still_ms: AtomicU64::new(0),
        });
        let mut all = self.lock();
        if all.len() < MAX_PARTS {
            all.push(heart.clone());
        }
        heart
    }

    /// Time has passed.
    pub fn tick(&self, passed: Duration) {
        for heart in self.lock().iter() {
            heart.tick(passed);
        }
    }

    /// The part that has been still the longest, if that is longer than `bound`.
    pub fn stalled(&self, bound: Duration) -> Option<Arc<Heartbeat>> {
        let all = self.lock();
        all.iter().max_by_key(|heart| heart.still()).filter(|heart| heart.still() > bound).cloned()
    }

    /// Every part.
    pub fn all(&self) -> Vec<Arc<Heartbeat>> {
        self.lock().clone()
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Arc<Heartbeat>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    #[test]
    fn a_part_stalls_by_work_that_does_not_end_and_by_nothing_else() {
        let all = Heartbeats::default();
        let (worker, other) = (all.begin("worker"), all.begin("other"));
        for _ in 0..10 {
            other.beat();
            all.tick(SECOND);
        }
        assert!(all.stalled(STALLED).is_none(), "one rests, the other beats");
        worker.beat();
        for _ in 0..6 {
            other.beat();
            all.tick(SECOND);
        }
        assert_eq!((worker.still(), other.still()), (SECOND * 5, Duration::ZERO));
        assert_eq!(all.stalled(STALLED).map(|heart| heart.part().to_owned()).as_deref(), Some("worker"));
        assert!(all.stalled(SECOND * 5).is_none());
        worker.rest();
        all.tick(SECOND);
        assert!(all.stalled(STALLED).is_none());
    }

    #[test]
    fn a_machine_that_stood_still_stalls_nothing() {
        let all = Heartbeats::default();
        let worker = all.begin("worker");
        worker.beat();
        all.tick(SECOND);
        all.tick(SECOND * 600);
        assert_eq!(worker.still(), MAX_TICK);
        assert!(all.stalled(STALLED).is_none());
    }

    #[test]
    fn parts_are_bounded() {
        let all = Heartbeats::default();
        for i in 0..=MAX_PARTS {
            all.begin(i.to_string()).beat();
        }
        assert_eq!(all.all().len(), MAX_PARTS);
    }
}
