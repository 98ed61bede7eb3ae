//! How often something took how long: counts below fixed bounds and their sum. In: durations, from
//! any thread.

use prometheus_client::metrics::histogram::Histogram;
use std::time::Duration;

/// Upper bounds of the counts, in seconds: from a stage of the pipeline to a request that is given
/// up.
const BOUNDS_S: [f64; 14] =
    [0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.15, 0.25, 0.5, 1.0, 5.0, 30.0];

/// Counts of durations. A clone shows the same counts.
#[derive(Debug, Clone)]
pub struct Times(pub Histogram);

impl Default for Times {
    fn default() -> Self {
        Self(Histogram::new(BOUNDS_S))
    }
}

impl Times {
    /// Adds a duration.
    pub fn add(&self, took: Duration) {
        self.0.observe(took.as_secs_f64());
    }
}
