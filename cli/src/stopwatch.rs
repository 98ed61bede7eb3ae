//! How long each stage of the detector takes.

use std::{collections::BTreeMap, time::Instant};
use vision::trace::{Stage, Trace};

/// Times each stage of the detector by the wall clock.
#[derive(Debug)]
pub struct Stopwatch {
    last: Instant,
    /// Milliseconds by stage.
    pub ms: BTreeMap<&'static str, f64>,
}

impl Stopwatch {
    /// Starts now.
    pub fn start() -> Self {
        Self { last: Instant::now(), ms: BTreeMap::new() }
    }

    /// All stages together, milliseconds.
    pub fn total_ms(&self) -> f64 {
        self.ms.values().sum()
    }
}

impl Trace for Stopwatch {
    fn finished(&mut self, stage: Stage) {
        let now = Instant::now();
        *self.ms.entry(stage.name()).or_default() += (now - self.last).as_secs_f64() * 1e3;
        self.last = now;
    }
}
