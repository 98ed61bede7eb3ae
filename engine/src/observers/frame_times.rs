//! How long frames took. In: each answer, when it is about to be published. Out: histograms of the
//! time from receipt to answer by status, and of the stages.

use crate::{
    frame::workers::{AnsweredFrame, FrameObserver},
    histogram::Times,
};
use protos::v1;
use std::{
    collections::BTreeMap,
    sync::{Mutex, MutexGuard, PoisonError},
    time::Duration,
};

/// Most stages: those of the pipeline and of the worker, which are a dozen.
const MAX_STAGES: usize = 32;
/// Words of the statuses.
const STATUSES: [(v1::Status, &str); 5] = [
    (v1::Status::Matched, "matched"),
    (v1::Status::Ambiguous, "ambiguous"),
    (v1::Status::NoMatch, "no_match"),
    (v1::Status::Expired, "expired"),
    (v1::Status::Rejected, "rejected"),
];

/// Times of all frames that reached a worker.
#[derive(Debug, Default)]
pub struct FrameTimes {
    latency: [Times; STATUSES.len()],
    stages: Mutex<BTreeMap<String, Times>>,
}

impl FrameObserver for FrameTimes {
    fn answered(&self, frame: &AnsweredFrame<'_>) {
        self.add(frame.answer);
    }
}

impl FrameTimes {
    /// Adds the times of an answer.
    fn add(&self, answer: &v1::Answer) {
        let status = answer.status();
        if let Some(at) = STATUSES.iter().position(|(known, _)| *known == status) {
            self.latency[at].add(duration(answer.latency_ms));
        }
        let mut stages = self.stages();
        for v1::StageTime { stage, ms } in &answer.timings {
            if let Some(times) = stages.get(stage) {
                times.add(duration(*ms));
            } else if stages.len() < MAX_STAGES {
                stages.entry(stage.clone()).or_default().add(duration(*ms));
            }
        }
    }

    /// From receipt to answer, by the word of the status.
    pub fn latencies(&self) -> Vec<(&'static str, Times)> {
        STATUSES.iter().zip(&self.latency).map(|((_, word), times)| (*word, times.clone())).collect()
    }

    /// Of each stage.
    pub fn stage_times(&self) -> Vec<(String, Times)> {
        self.stages().iter().map(|(stage, times)| (stage.clone(), times.clone())).collect()
    }

    fn stages(&self) -> MutexGuard<'_, BTreeMap<String, Times>> {
        self.stages.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn duration(ms: f64) -> Duration {
    Duration::try_from_secs_f64(ms / 1e3).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use prometheus_client::{encoding::prometheus_text, registry::Registry};

    #[test]
    fn stages_are_bounded_and_statuses_are_kept_apart() {
        let times = FrameTimes::default();
        let stage = |i: usize| v1::StageTime { stage: format!("s{i}"), ms: 2.0 };
        let timings: Vec<_> = (0..2 * MAX_STAGES).map(stage).collect();
        times.add(&v1::Answer { status: v1::Status::Expired.into(), timings, ..v1::Answer::default() });
        assert_eq!(times.stage_times().len(), MAX_STAGES);
        for (word, times) in times.latencies() {
            let (mut registry, mut text) = (Registry::default(), String::new());
            registry.register("t", "T", times.0);
            prometheus_text::encode(&mut text, &registry).unwrap();
            let counted = u8::from(word == "expired");
            assert!(text.contains(&format!("\nt_count {counted}\n")), "{word}: {text}");
        }
    }
}
