//! What became of the messages of each robot, for people who look for what is missing.

use protos::api::Ros2Status;
use std::{
    collections::BTreeMap,
    sync::{Mutex, MutexGuard, PoisonError},
};

/// Most different reasons that are counted of a robot: topics times words, both bounded by the
/// settings and the program.
const MAX_REASONS: usize = 512;

/// Shared by the robot's thread and zenoh's.
#[derive(Debug, Default)]
pub(super) struct Counters(Mutex<Ros2Status>);

impl Counters {
    fn lock(&self) -> MutexGuard<'_, Ros2Status> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn read(&self) -> Ros2Status {
        self.lock().clone()
    }

    /// Topics are those of the settings, so the list is bounded by them.
    pub(super) fn received(&self, topic: &str) {
        one_more(&mut self.lock().received, topic);
    }

    pub(super) fn sent(&self, topic: &str) {
        one_more(&mut self.lock().sent, topic);
    }

    /// Counts a reason. Returns the count if it is to be logged: the 1st, 2nd, 4th, 8th ...
    pub(super) fn reason(&self, topic: &str, word: &str) -> Option<u64> {
        let mut counts = self.lock();
        let is_known = counts.reasons.get(topic).is_some_and(|words| words.contains_key(word));
        if !is_known && counts.reasons.values().map(BTreeMap::len).sum::<usize>() >= MAX_REASONS {
            return None;
        }
        let count = one_more(counts.reasons.entry(topic.to_owned()).or_default(), word);
        count.is_power_of_two().then_some(count)
    }
}

fn one_more(counts: &mut BTreeMap<String, u64>, name: &str) -> u64 {
    if let Some(count) = counts.get_mut(name) {
        *count += 1;
        return *count;
    }
    counts.insert(name.to_owned(), 1);
    1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_are_bounded_and_logged_ever_more_rarely() {
        let counters = Counters::default();
        let logged: Vec<_> = (0..9).map(|_| counters.reason("/scan", "bad_scan")).collect();
        let expected = [Some(1), Some(2), None, Some(4), None, None, None, Some(8), None];
        assert_eq!(logged, expected);
        for i in 0..2 * MAX_REASONS {
            counters.reason(&format!("/t{i}"), "not_used");
        }
        let counted: usize = counters.read().reasons.values().map(BTreeMap::len).sum();
        assert_eq!(counted, MAX_REASONS);
        assert_eq!(counters.reason("/scan", "bad_scan"), None, "the tenth of a known one");
        assert_eq!(counters.read().reasons["/scan"]["bad_scan"], 10);
    }
}
