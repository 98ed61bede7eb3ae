//! Work on many items over several threads, with progress, until the job is done or cancelled.

use super::{JobError, ProgressReporter};
use engine::threads::{beside_robots, robots_are_served};
use std::{
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

/// A thread that leaves its place to robots looks so often whether they still need it.
const STANDING_BACK: Duration = Duration::from_millis(100);

/// `work` on every item, over `threads` threads, results in the order of the items. Progress goes
/// from and to the given shares. For a thread of the class `Background`, whose priority the threads
/// inherit. While robots are served, half of them stand back between two items.
pub(super) fn each_of<T: Sync, R: Send>(
    items: &[T],
    threads: usize,
    reporter: &ProgressReporter,
    (from, to, what): (f64, f64, &str),
    work: impl Fn(&T) -> R + Sync,
) -> Result<Vec<R>, JobError> {
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let results = Mutex::new(Vec::with_capacity(items.len()));
    std::thread::scope(|scope| {
        for thread in 0..threads.min(items.len()) {
            let (next, done, results, work) = (&next, &done, &results, &work);
            scope.spawn(move || {
                let may_stand_back = thread >= beside_robots(threads);
                while !reporter.is_cancelled() {
                    if may_stand_back && robots_are_served(Instant::now()) {
                        if next.load(Ordering::Relaxed) >= items.len() {
                            return;
                        }
                        std::thread::sleep(STANDING_BACK);
                        continue;
                    }
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(item) = items.get(index) else { return };
                    let result = work(item);
                    results.lock().unwrap_or_else(PoisonError::into_inner).push((index, result));
                    let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                    let share = from + (to - from) * done as f64 / items.len() as f64;
                    reporter.report(share, format!("{what}: {done} of {}", items.len()));
                }
            });
        }
    });
    if reporter.is_cancelled() {
        return Err(JobError::Cancelled);
    }
    let mut results = results.into_inner().unwrap_or_else(PoisonError::into_inner);
    results.sort_unstable_by_key(|(index, _)| *index);
    Ok(results.into_iter().map(|(_, result)| result).collect())
}
