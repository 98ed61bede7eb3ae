//! Work on many items over several threads, with progress, until the job is done or cancelled.

use super::{JobError, ProgressReporter};
use std::sync::{
    Mutex, PoisonError,
    atomic::{AtomicUsize, Ordering},
};

/// `work` on every item, over `threads` threads, results in the order of the items. Progress goes from and to the
/// given shares.
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
        for _ in 0..threads.min(items.len()) {
            scope.spawn(|| {
                while !reporter.is_cancelled() {
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
