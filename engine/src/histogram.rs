//! How often something took how long: counts below fixed bounds and their sum. In: durations, from any thread. Out: a copy for
//! readers. Adding takes no lock.

use std::{
    sync::atomic::{AtomicU64, Ordering},
    time::Duration,
};

/// Upper bounds of the counts, in seconds: from a stage of the pipeline to a request that is given up.
pub const BOUNDS_S: [f64; 14] =
    [0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.15, 0.25, 0.5, 1.0, 5.0, 30.0];

/// Counts of durations.
#[derive(Debug, Default)]
pub struct Histogram {
    /// Of each bound, what is not below an earlier one; then what is above all.
    counts: [AtomicU64; BOUNDS_S.len() + 1],
    sum_us: AtomicU64,
}

/// A histogram at one time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct HistogramCopy {
    /// How many durations were at most each bound of [`BOUNDS_S`].
    pub cumulative: [u64; BOUNDS_S.len()],
    /// All of them.
    pub count: u64,
    /// Their sum, in seconds.
    pub sum_s: f64,
}

impl Histogram {
    /// Adds a duration.
    pub fn add(&self, took: Duration) {
        let seconds = took.as_secs_f64();
        let place = BOUNDS_S.iter().position(|bound| seconds <= *bound).unwrap_or(BOUNDS_S.len());
        self.sum_us.fetch_add(took.as_micros() as u64, Ordering::Relaxed);
        self.counts[place].fetch_add(1, Ordering::Relaxed);
    }

    /// What was added so far. Its counts belong together, whatever is added meanwhile.
    pub fn copy(&self) -> HistogramCopy {
        let mut copy = HistogramCopy::default();
        for (i, count) in self.counts.iter().enumerate() {
            copy.count += count.load(Ordering::Relaxed);
            if let Some(cumulative) = copy.cumulative.get_mut(i) {
                *cumulative = copy.count;
            }
        }
        copy.sum_s = self.sum_us.load(Ordering::Relaxed) as f64 / 1e6;
        copy
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_duration_counts_at_its_bound_and_above() {
        let histogram = Histogram::default();
        for us in [500, 501, 30_000_000, 31_000_000] {
            histogram.add(Duration::from_micros(us));
        }
        let copy = histogram.copy();
        assert_eq!((copy.cumulative[0], copy.cumulative[1], copy.cumulative[12]), (1, 2, 2));
        assert_eq!((copy.cumulative[13], copy.count), (3, 4));
        assert!((copy.sum_s - 61.001_001).abs() < 1e-9, "{}", copy.sum_s);
    }
}
