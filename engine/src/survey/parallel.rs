//! Work on many items by some threads.

use std::{
    num::NonZeroUsize,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
};

/// How many threads work, and who is told how far they are: what they do, items done, and all.
#[derive(Clone, Copy)]
pub struct Effort<'a> {
    /// Threads. The result does not depend on them.
    pub threads: NonZeroUsize,
    /// Told after each item, by any of the threads.
    pub told: &'a (dyn Fn(&'static str, usize, usize) + Sync),
}

impl std::fmt::Debug for Effort<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Effort").field("threads", &self.threads).finish_non_exhaustive()
    }
}

impl Effort<'_> {
    /// The results of all items, in their order.
    pub fn of_each<T: Sync, R: Send>(
        self,
        items: &[T],
        what: &'static str,
        work: impl Fn(usize, &T) -> R + Sync,
    ) -> Vec<R> {
        let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let results = Mutex::new(Vec::with_capacity(items.len()));
        std::thread::scope(|scope| {
            for _ in 0..self.threads.get().min(items.len()) {
                scope.spawn(|| {
                    loop {
                        let index = next.fetch_add(1, Ordering::Relaxed);
                        let Some(item) = items.get(index) else { return };
                        let result = work(index, item);
                        results.lock().unwrap_or_else(PoisonError::into_inner).push((index, result));
                        (self.told)(what, done.fetch_add(1, Ordering::Relaxed) + 1, items.len());
                    }
                });
            }
        });
        let mut results = results.into_inner().unwrap_or_else(PoisonError::into_inner);
        results.sort_unstable_by_key(|(index, _)| *index);
        results.into_iter().map(|(_, result)| result).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_the_order_of_the_items_for_any_number_of_threads() {
        let items: Vec<u64> = (0..100).collect();
        let told = AtomicUsize::new(0);
        let all = |threads: usize| {
            let told = |_: &'static str, _: usize, of: usize| {
                told.fetch_add(of, Ordering::Relaxed);
            };
            let effort = Effort { threads: NonZeroUsize::new(threads).unwrap(), told: &told };
            effort.of_each(&items, "work", |i, item| item * 2 + i as u64)
        };
        assert_eq!(all(1), all(7));
        assert_eq!(all(2)[40], 120);
        assert_eq!(told.load(Ordering::Relaxed), 3 * 100 * 100);
    }
}
