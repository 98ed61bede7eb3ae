//! Names under which robots send messages without being registered. In: refused messages, with
//! their time. Out: the list of names for a person who may register them, and which ones are new,
//! for the log. Knows no clock and no transport.

use protos::Name;
use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

/// Names that are remembered; a further one replaces the one that has been silent the longest.
pub const MAX_UNKNOWN_ROBOTS: usize = 64;
/// New names that are logged in [`LOG_WINDOW`]; more are listed only.
pub const MAX_LOGGED: usize = 64;
/// See [`MAX_LOGGED`].
pub const LOG_WINDOW: Duration = Duration::from_hours(1);

/// A robot that is not registered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnknownRobot {
    /// The name it uses.
    pub name: Name,
    /// The camera of its last frame; absent if it sent none.
    pub camera: Option<Name>,
    /// Refused messages.
    pub messages: u64,
    /// Time since the first of them.
    pub first: Duration,
    /// Time since the last of them.
    pub last: Duration,
}

#[derive(Debug)]
struct Record {
    camera: Option<Name>,
    messages: u64,
    first: Instant,
    last: Instant,
}

/// The unregistered robots of late.
#[derive(Debug, Default)]
pub struct UnknownRobots {
    records: BTreeMap<Name, Record>,
    /// Begin of the window of the log, and the names logged in it.
    logged: Option<(Instant, usize)>,
}

impl UnknownRobots {
    /// Notes a message that was refused because its robot is not registered; true if its name is to
    /// be logged.
    pub fn refused(&mut self, robot: &Name, camera: Option<&Name>, now: Instant) -> bool {
        if let Some(record) = self.records.get_mut(robot) {
            record.messages += 1;
            record.last = record.last.max(now);
            record.camera = camera.cloned().or(record.camera.take());
            return false;
        }
        if self.records.len() >= MAX_UNKNOWN_ROBOTS {
            let oldest = self.records.iter().min_by_key(|(_, r)| r.last).map(|(name, _)| name.clone());
            oldest.map(|name| self.records.remove(&name));
        }
        let record = Record { camera: camera.cloned(), messages: 1, first: now, last: now };
        self.records.insert(robot.clone(), record);
        let is_open = |begin: Instant| now.saturating_duration_since(begin) < LOG_WINDOW;
        let (_, logged) = match &mut self.logged {
            Some(window) if is_open(window.0) => window,
            other => other.insert((now, 0)),
        };
        *logged += 1;
        *logged <= MAX_LOGGED
    }

    /// The robots that are not registered now, by name. The others are forgotten.
    pub fn list(&mut self, now: Instant, is_registered: impl Fn(&Name) -> bool) -> Vec<UnknownRobot> {
        self.records.retain(|name, _| !is_registered(name));
        let ago = |at: Instant| now.saturating_duration_since(at);
        let shown = |(name, record): (&Name, &Record)| UnknownRobot {
            name: name.clone(),
            camera: record.camera.clone(),
            messages: record.messages,
            first: ago(record.first),
            last: ago(record.last),
        };
        self.records.iter().map(shown).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(text: &str) -> Name {
        Name::new(text).unwrap()
    }

    #[test]
    fn an_unregistered_robot_is_listed_until_it_is_registered() {
        let (mut unknown, start) = (UnknownRobots::default(), Instant::now());
        let at = |ms| start + Duration::from_millis(ms);
        assert!(unknown.refused(&name("new"), Some(&name("front")), start), "it is logged once");
        assert!(!unknown.refused(&name("new"), None, at(20)));
        unknown.refused(&name("other"), None, at(30));
        let found = unknown.list(at(50), |robot| robot.as_str() == "other");
        let expected = UnknownRobot {
            name: name("new"),
            camera: Some(name("front")),
            messages: 2,
            first: Duration::from_millis(50),
            last: Duration::from_millis(30),
        };
        assert_eq!(found, [expected]);
        // A robot that is deleted later begins anew.
        unknown.refused(&name("other"), None, at(60));
        assert_eq!(unknown.list(at(60), |_| false)[1].messages, 1);
    }

    #[test]
    fn names_and_log_lines_are_bounded_and_the_longest_silent_name_goes() {
        let (mut unknown, start) = (UnknownRobots::default(), Instant::now());
        let at = |ms| start + Duration::from_millis(ms);
        let mut logged = 0;
        for i in 0..2 * MAX_UNKNOWN_ROBOTS as u64 {
            logged += usize::from(unknown.refused(&name(&format!("r{i}")), None, at(2 * i)));
            unknown.refused(&name("r0"), None, at(2 * i + 1));
        }
        assert_eq!(logged, MAX_LOGGED);
        let found = unknown.list(at(1000), |_| false);
        assert_eq!(found.len(), MAX_UNKNOWN_ROBOTS);
        let is_there = |robot: &str| found.iter().any(|r| r.name.as_str() == robot);
        assert!(is_there("r0") && is_there("r127") && !is_there("r1"));
        assert!(unknown.refused(&name("late"), None, start + LOG_WINDOW), "the next window logs again");
    }
}
