//! What each robot does. In: answers of its frames, its other messages, and what was refused of
//! all, each with its time. Out: counts since the start of the server, the reasons of refusals, and
//! how long ago the last of each was. Knows no clock and no transport.

mod inputs;

pub use crate::inputs::{Input, Refused};
pub use inputs::{InputActivity, MAX_REASONS, Reason};

use crate::limits::MAX_ROBOTS;
use inputs::Inputs;
use protos::{Name, v1};
use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

/// Whole seconds over which the rate of frames is taken.
pub const RATE_SECONDS: u64 = 10;
/// The seconds of the rate, and the one that is not over.
const RING: usize = RATE_SECONDS as usize + 1;

/// What a robot has done since the start of the server.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotActivity {
    /// Frames that were searched for landmarks and answered.
    pub answered: u64,
    /// What was used and refused, by kind; kinds of which nothing came are absent.
    pub inputs: Vec<InputActivity>,
    /// Time since the last message, used or refused; absent where only connections were refused.
    pub last_message: Option<Duration>,
    /// Time since the last frame in which a landmark was named.
    pub last_recognised: Option<Duration>,
    /// Time since the last frame that gave a fix.
    pub last_fix: Option<Duration>,
    /// Answered frames in a second, over the last [`RATE_SECONDS`] whole seconds, or all since its
    /// first message.
    pub frames_per_s: f64,
}

/// Answered frames of the last seconds, counted since the first message.
#[derive(Debug, Clone, Default)]
struct FrameRate {
    frames: [u32; RING],
    /// The second that the newest count belongs to.
    newest: u64,
}

impl FrameRate {
    fn advance(&mut self, second: u64) {
        for passed in self.newest.saturating_add(1)..=second.min(self.newest.saturating_add(RING as u64)) {
            self.frames[passed as usize % RING] = 0;
        }
        if second > self.newest + RING as u64 {
            self.frames = [0; RING];
        }
        self.newest = self.newest.max(second);
    }

    fn add(&mut self, second: u64) {
        self.advance(second);
        let count = &mut self.frames[self.newest as usize % RING];
        *count = count.saturating_add(1);
    }

    fn per_second(&self, second: u64) -> f64 {
        let mut now = self.clone();
        now.advance(second);
        let whole = now.newest.min(RATE_SECONDS);
        if whole == 0 {
            return 0.0;
        }
        let unfinished = now.newest as usize % RING;
        let frames: u32 =
            now.frames.iter().enumerate().filter(|(i, _)| *i != unfinished).map(|(_, n)| n).sum();
        f64::from(frames) / whole as f64
    }
}

#[derive(Debug)]
struct Record {
    first: Instant,
    /// Of anything, for the order in which robots are forgotten.
    last: Instant,
    message: Option<Instant>,
    answered: u64,
    inputs: Inputs,
    recognised: Option<Instant>,
    fixed: Option<Instant>,
    rate: FrameRate,
}

impl Record {
    fn new(now: Instant) -> Self {
        Self {
            first: now,
            last: now,
            message: None,
            answered: 0,
            inputs: Inputs::default(),
            recognised: None,
            fixed: None,
            rate: FrameRate::default(),
        }
    }

    fn second(&self, now: Instant) -> u64 {
        now.saturating_duration_since(self.first).as_secs()
    }
}

/// The activity of all robots, at most [`MAX_ROBOTS`]; a further one replaces the one that has been
/// silent the longest.
#[derive(Debug, Default)]
pub struct RobotActivities(BTreeMap<Name, Record>);

impl RobotActivities {
    /// An input of a registered robot was used. Frames are counted by [`Self::answered`].
    pub fn used(&mut self, robot: &Name, input: Input, now: Instant) {
        self.record(robot, input, now).inputs.used(input);
    }

    /// A frame was answered.
    pub fn answered(&mut self, robot: &Name, answer: &v1::Answer, now: Instant) {
        let record = self.record(robot, Input::Frame, now);
        record.answered += 1;
        record.inputs.used(Input::Frame);
        let second = record.second(now);
        record.rate.add(second);
        let is_named =
            |q: &v1::QuadAnswer| q.verdict() == v1::Verdict::Unique || !q.guided_landmark.is_empty();
        if answer.quads.iter().any(is_named) {
            record.recognised = Some(now);
        }
        if answer.map_from_robot.is_some() || answer.guided_map_from_robot.is_some() {
            record.fixed = Some(now);
        }
    }

    /// An input was refused. How many were for this reason since the log was told of it, where it
    /// is to be told again.
    pub fn refused(&mut self, robot: &Name, input: Input, refused: Refused<'_>, now: Instant) -> Option<u64> {
        self.record(robot, input, now).inputs.refused(input, refused, now)
    }

    /// Forgets a robot that is deleted.
    pub fn forget(&mut self, robot: &Name) {
        self.0.remove(robot);
    }

    /// What a robot has done; `None` before its first message.
    pub fn get(&self, robot: &Name, now: Instant) -> Option<RobotActivity> {
        let record = self.0.get(robot)?;
        let ago = |at: Instant| now.saturating_duration_since(at);
        Some(RobotActivity {
            answered: record.answered,
            inputs: record.inputs.shown(now),
            last_message: record.message.map(ago),
            last_recognised: record.recognised.map(ago),
            last_fix: record.fixed.map(ago),
            frames_per_s: record.rate.per_second(record.second(now)),
        })
    }

    fn record(&mut self, robot: &Name, input: Input, now: Instant) -> &mut Record {
        if self.0.len() >= MAX_ROBOTS && !self.0.contains_key(robot) {
            let oldest = self.0.iter().min_by_key(|(_, record)| record.last).map(|(name, _)| name.clone());
            oldest.map(|name| self.0.remove(&name));
        }
        let record = self.0.entry(robot.clone()).or_insert_with(|| Record::new(now));
        record.last = record.last.max(now);
        if input != Input::Connection {
            record.message = record.message.max(Some(now));
        }
        record
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(text: &str) -> Name {
        Name::new(text).unwrap()
    }

    fn refused(code: &str) -> Refused<'_> {
        Refused { code, field: "image", detail: "it is none" }
    }

    fn at(start: Instant, ms: u64) -> Instant {
        start + Duration::from_millis(ms)
    }

    #[test]
    fn the_rate_is_that_of_the_last_whole_seconds() {
        let (mut all, start, r1) = (RobotActivities::default(), Instant::now(), name("r1"));
        // In tenths of a frame a second.
        let rate = |all: &RobotActivities, ms| {
            (10.0 * all.get(&r1, at(start, ms)).unwrap().frames_per_s).round() as u64
        };
        // Four frames a second for twelve seconds.
        for i in 0..48 {
            all.answered(&r1, &v1::Answer::default(), at(start, 250 * i));
            if i == 3 {
                assert_eq!(rate(&all, 900), 0, "no second is over");
            }
            if i == 7 {
                assert_eq!(rate(&all, 2000), 40, "two are over");
            }
        }
        assert_eq!(rate(&all, 11_999), 40);
        assert_eq!(rate(&all, 17_000), 20, "five of ten seconds are silent");
        assert_eq!(rate(&all, 22_000), 0);
        assert_eq!(rate(&all, 900_000), 0);
        all.answered(&r1, &v1::Answer::default(), at(start, 900_000));
        assert_eq!(rate(&all, 901_000), 1);
        assert_eq!(all.get(&r1, at(start, 901_000)).unwrap().answered, 49);
    }

    #[test]
    fn messages_and_refusals_have_a_time_and_a_robot_is_forgotten_whole() {
        let (mut all, start, r1) = (RobotActivities::default(), Instant::now(), name("r1"));
        assert_eq!(all.get(&r1, start), None);
        all.refused(&r1, Input::Connection, refused("bad_certificate"), start);
        assert_eq!(all.get(&r1, start).unwrap().last_message, None, "it has said nothing");
        all.refused(&r1, Input::Frame, refused("not_newer"), at(start, 20));
        all.used(&r1, Input::Scan, at(start, 50));
        let found = all.get(&r1, at(start, 60)).unwrap();
        let inputs: Vec<_> = found.inputs.iter().map(|i| (i.input, i.used, i.refused)).collect();
        assert_eq!(inputs, [(Input::Frame, 0, 1), (Input::Scan, 1, 0), (Input::Connection, 0, 1)]);
        assert_eq!((found.answered, found.last_message), (0, Some(Duration::from_millis(10))));
        all.forget(&r1);
        assert_eq!(all.get(&r1, start), None);
    }

    #[test]
    fn a_named_landmark_is_remembered_however_it_was_named() {
        let (mut all, start, r1) = (RobotActivities::default(), Instant::now(), name("r1"));
        let recognised = |all: &RobotActivities| all.get(&r1, at(start, 100)).unwrap().last_recognised;
        let quad = v1::QuadAnswer { verdict: v1::Verdict::Ambiguous.into(), ..v1::QuadAnswer::default() };
        let answer = |quad| v1::Answer { quads: vec![quad], ..v1::Answer::default() };
        all.answered(&r1, &answer(quad.clone()), start);
        assert_eq!(recognised(&all), None);
        let guided = v1::QuadAnswer { guided_landmark: "poster".into(), ..quad.clone() };
        all.answered(&r1, &answer(guided), at(start, 20));
        assert_eq!(recognised(&all), Some(Duration::from_millis(80)));
        let unique = v1::QuadAnswer { verdict: v1::Verdict::Unique.into(), ..quad };
        all.answered(&r1, &answer(unique), at(start, 30));
        assert_eq!(recognised(&all), Some(Duration::from_millis(70)));
    }

    #[test]
    fn robots_are_bounded_and_the_longest_silent_one_goes() {
        let (mut all, start) = (RobotActivities::default(), Instant::now());
        for i in 0..MAX_ROBOTS as u64 {
            all.used(&name(&format!("r{i}")), Input::Scan, at(start, i));
        }
        all.used(&name("r0"), Input::Scan, at(start, 20_000));
        all.used(&name("new"), Input::Scan, at(start, 20_001));
        assert_eq!(all.0.len(), MAX_ROBOTS);
        let is_there = |robot: &str| all.get(&name(robot), start).is_some();
        assert!(is_there("new") && is_there("r0") && !is_there("r1"));
    }
}
