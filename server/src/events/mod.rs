//! What changes on the server, numbered, so that readers can resume. In: what the parts of the
//! server tell. Out: the newest events, from a bounded ring. Nobody who tells an event waits, and
//! no reader holds up another.

pub(crate) mod watch_changes;

use crate::store::now_ms;
use protos::api::ServerEventBody;
use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};
use tokio::sync::watch;

/// Events that are remembered. A reader that is further behind reads anew.
pub(crate) const MAX_EVENTS: usize = 1024;

/// An event with its number and time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct NumberedEvent {
    pub(crate) number: u64,
    pub(crate) at_ms: i64,
    pub(crate) what: ServerEventBody,
}

#[derive(Debug, Default)]
struct Ring {
    events: VecDeque<Arc<NumberedEvent>>,
    /// Of the newest event; 0 before the first.
    newest: u64,
}

/// The newest events.
#[derive(Debug)]
pub(crate) struct EventLog {
    /// Tells the events of this start from those of others.
    start: i64,
    ring: Mutex<Ring>,
    newest: watch::Sender<u64>,
}

impl Default for EventLog {
    fn default() -> Self {
        Self { start: now_ms(), ring: Mutex::default(), newest: watch::Sender::default() }
    }
}

/// The events after a number.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Since {
    /// All of them, oldest first.
    Events(Vec<Arc<NumberedEvent>>),
    /// Some are forgotten. The newest has this number.
    Forgotten(u64),
}

impl EventLog {
    fn ring(&self) -> MutexGuard<'_, Ring> {
        // Whole after every step under the lock.
        self.ring.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn tell(&self, what: ServerEventBody) {
        let number = {
            let mut ring = self.ring();
            ring.newest += 1;
            let event = NumberedEvent { number: ring.newest, at_ms: now_ms(), what };
            ring.events.push_back(Arc::new(event));
            if ring.events.len() > MAX_EVENTS {
                ring.events.pop_front();
            }
            ring.newest
        };
        // Two tellers may come here in the other order.
        self.newest.send_if_modified(|newest| {
            let is_newer = number > *newest;
            *newest = number.max(*newest);
            is_newer
        });
    }

    /// The number of the newest event.
    pub(crate) fn newest(&self) -> u64 {
        self.ring().newest
    }

    /// The number of the newest event, whenever it changes.
    pub(crate) fn changes(&self) -> watch::Receiver<u64> {
        self.newest.subscribe()
    }

    /// The events after this number.
    pub(crate) fn since(&self, number: u64) -> Since {
        let ring = self.ring();
        let first = ring.events.front().map_or(ring.newest + 1, |event| event.number);
        if number > ring.newest || number + 1 < first {
            return Since::Forgotten(ring.newest);
        }
        Since::Events(ring.events.iter().skip((number + 1 - first) as usize).cloned().collect())
    }

    /// The id of an event.
    pub(crate) fn id(&self, number: u64) -> String {
        format!("{}-{number}", self.start)
    }

    /// The number of an id; `None` for one of another start, and for what is none.
    pub(crate) fn number(&self, id: &str) -> Option<u64> {
        let (start, number) = id.split_once('-')?;
        (start == self.start.to_string()).then(|| number.parse().ok()).flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(log: &EventLog, after: u64) -> Result<Vec<u64>, u64> {
        match log.since(after) {
            Since::Events(events) => Ok(events.iter().map(|event| event.number).collect()),
            Since::Forgotten(newest) => Err(newest),
        }
    }

    #[test]
    fn the_newest_events_are_remembered_and_older_readers_are_told() {
        let log = EventLog::default();
        assert_eq!(numbers(&log, 0), Ok(vec![]));
        assert_eq!(numbers(&log, 1), Err(0), "a number of another start");
        let changes = log.changes();
        for _ in 0..MAX_EVENTS + 2 {
            log.tell(ServerEventBody::TokensChanged);
        }
        let newest = MAX_EVENTS as u64 + 2;
        assert_eq!((*changes.borrow(), log.newest()), (newest, newest));
        assert_eq!(numbers(&log, newest), Ok(vec![]));
        assert_eq!(numbers(&log, newest - 2), Ok(vec![newest - 1, newest]));
        assert_eq!(numbers(&log, 2).map(|all| all.len()), Ok(MAX_EVENTS));
        assert_eq!(numbers(&log, 1), Err(newest));
        assert_eq!(numbers(&log, newest + 1), Err(newest));
    }

    #[test]
    fn ids_are_of_one_start() {
        let log = EventLog::default();
        assert_eq!(log.number(&log.id(7)), Some(7));
        let other = EventLog { start: log.start - 1, ..EventLog::default() };
        for id in [other.id(7).as_str(), "7", "", "-", "a-7", &format!("{}-x", log.start)] {
            assert_eq!(log.number(id), None, "{id}");
        }
    }
}
