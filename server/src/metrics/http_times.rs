//! Requests over HTTP by method, route and status, and how long they took. In: each request, when it is answered. Out: counts
//! and histograms. Routes are those of the router, not what clients write, so the number of series is bounded.

use engine::histogram::{Histogram, HistogramCopy};
use std::{
    collections::BTreeMap,
    sync::{Mutex, MutexGuard, PoisonError},
    time::Duration,
};

/// Most series: beyond it, requests are counted under [`OTHER`]. Routes times a few statuses are fewer.
const MAX_SERIES: usize = 2048;
/// The route of what matches none: pages, and addresses that do not exist.
pub(crate) const OTHER: &str = "other";
/// Methods of the interface; others are [`OTHER`].
const METHODS: [&str; 6] = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE"];

#[derive(Debug, Default)]
struct State {
    counts: BTreeMap<(&'static str, String, u16), u64>,
    times: BTreeMap<String, Histogram>,
}

/// All requests.
#[derive(Debug, Default)]
pub(crate) struct HttpTimes(Mutex<State>);

impl HttpTimes {
    /// A request was answered.
    pub(crate) fn add(&self, method: &str, route: Option<&str>, status: u16, took: Duration) {
        let method = METHODS.into_iter().find(|known| *known == method).unwrap_or(OTHER);
        let mut guard = self.lock();
        let state = &mut *guard;
        let mut key = (method, route.unwrap_or(OTHER).to_owned(), status);
        if !state.counts.contains_key(&key) && state.counts.len() >= MAX_SERIES {
            key = (OTHER, OTHER.to_owned(), status);
        }
        if let Some(times) = state.times.get(&key.1) {
            times.add(took);
        } else {
            state.times.entry(key.1.clone()).or_default().add(took);
        }
        *state.counts.entry(key).or_default() += 1;
    }

    /// Counts by method, route and status.
    pub(crate) fn counts(&self) -> Vec<((&'static str, String, u16), u64)> {
        self.lock().counts.iter().map(|(key, count)| (key.clone(), *count)).collect()
    }

    /// Times by route.
    pub(crate) fn times(&self) -> Vec<(String, HistogramCopy)> {
        self.lock().times.iter().map(|(route, times)| (route.clone(), times.copy())).collect()
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_are_bounded_and_strange_methods_are_one() {
        let (times, took) = (HttpTimes::default(), Duration::from_millis(1));
        times.add("BREW", None, 405, took);
        for i in 0..2 * MAX_SERIES {
            times.add("GET", Some(&format!("/r{i}")), 200, took);
        }
        let counts = times.counts();
        assert_eq!(counts.len(), MAX_SERIES + 1);
        assert_eq!(counts.iter().map(|(_, count)| count).sum::<u64>(), 1 + 2 * MAX_SERIES as u64);
        assert!(counts.iter().any(|(key, count)| *key == (OTHER, OTHER.to_owned(), 405) && *count == 1));
        assert!(times.times().len() <= MAX_SERIES);
    }
}
