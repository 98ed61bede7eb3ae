//! Requests over HTTP by method, route and status, and how long they took. In: each request, when
//! it is answered. Out: counts and histograms. Routes are those of the router, not what clients
//! write, so the number of series is bounded.

use engine::histogram::Times;
use std::{
    collections::BTreeMap,
    sync::{Mutex, MutexGuard, PoisonError},
    time::Duration,
};

/// Most series: beyond it, requests are counted under [`OTHER`]. Routes times a few statuses are
/// fewer.
const MAX_SERIES: usize = 2048;
/// The route of what matches none: pages, and addresses that do not exist.
pub(crate) const OTHER: &str = "other";
/// Methods of the interface; others are [`OTHER`].
const METHODS: [&str; 6] = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE"];

#[derive(Debug, Default)]
struct RouteStats {
    /// By method and status.
    counts: BTreeMap<(&'static str, u16), u64>,
    times: Times,
}

#[derive(Debug, Default)]
struct State {
    routes: BTreeMap<String, RouteStats>,
    /// Counts of all routes.
    series: usize,
}

/// All requests.
#[derive(Debug, Default)]
pub(crate) struct HttpTimes(Mutex<State>);

impl HttpTimes {
    /// A request was answered.
    pub(crate) fn add(&self, method: &str, route: Option<&str>, status: u16, took: Duration) {
        let method = METHODS.into_iter().find(|known| *known == method).unwrap_or(OTHER);
        let route = route.unwrap_or(OTHER);
        let mut guard = self.lock();
        let State { routes, series } = &mut *guard;
        // The usual way, without a copy of the route.
        if let Some(of) = routes.get_mut(route)
            && let Some(count) = of.counts.get_mut(&(method, status))
        {
            *count += 1;
            of.times.add(took);
            return;
        }
        let (method, route) = if *series >= MAX_SERIES { (OTHER, OTHER) } else { (method, route) };
        let of = routes.entry(route.to_owned()).or_default();
        *series += usize::from(!of.counts.contains_key(&(method, status)));
        *of.counts.entry((method, status)).or_default() += 1;
        of.times.add(took);
    }

    /// Counts by method, route and status.
    pub(crate) fn counts(&self) -> Vec<((&'static str, String, u16), u64)> {
        let state = self.lock();
        let of = |(route, of): (&String, &RouteStats)| {
            let of =
                of.counts.iter().map(|((method, status), count)| ((*method, route.clone(), *status), *count));
            of.collect::<Vec<_>>()
        };
        state.routes.iter().flat_map(of).collect()
    }

    /// Times by route.
    pub(crate) fn times(&self) -> Vec<(String, Times)> {
        self.lock().routes.iter().map(|(route, of)| (route.clone(), of.times.clone())).collect()
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
