//! What each robot does. In: answers and refusals of its frames, and its other messages, each with its time. Out: counts since
//! the start of the server, the last refusal, and how long ago the last of each was. Knows no clock and no transport.

use crate::limits::MAX_ROBOTS;
use protos::{Name, v1};
use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

/// Whole seconds over which the rate of frames is taken.
pub const RATE_SECONDS: u64 = 10;
/// The seconds of the rate, and the one that is not over.
const RING: usize = RATE_SECONDS as usize + 1;

/// A refused frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RefusedFrame {
    /// Word of the code.
    pub code: String,
    /// The field at fault.
    pub field: String,
    /// A sentence for a person.
    pub detail: String,
    /// Time since it was refused.
    pub ago: Duration,
}

/// What a robot has done since the start of the server.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotActivity {
    /// Frames that were searched for landmarks and answered.
    pub answered: u64,
    /// Refused frames, by the word of the code. Codes are the server's own: their number bounds it.
    pub refused: BTreeMap<String, u64>,
    /// The last refused frame.
    pub last_refusal: Option<RefusedFrame>,
    /// Time since the last message: a frame, odometry or a scan.
    pub last_message: Duration,
    /// Time since the last frame in which a landmark was named.
    pub last_recognised: Option<Duration>,
    /// Time since the last frame that gave a fix.
    pub last_fix: Option<Duration>,
    /// Answered frames in a second, over the last [`RATE_SECONDS`] whole seconds, or all since its first message.
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
    last: Instant,
    answered: u64,
    refused: BTreeMap<String, u64>,
    refusal: Option<(v1::Rejection, Instant)>,
    recognised: Option<Instant>,
    fixed: Option<Instant>,
    rate: FrameRate,
}

impl Record {
    fn new(now: Instant) -> Self {
        Self {
            first: now,
            last: now,
            answered: 0,
            refused: BTreeMap::new(),
            refusal: None,
            recognised: None,
            fixed: None,
            rate: FrameRate::default(),
        }
    }

    fn second(&self, now: Instant) -> u64 {
        now.saturating_duration_since(self.first).as_secs()
    }
}

/// The activity of all robots, at most [`MAX_ROBOTS`]; a further one replaces the one that has been silent the longest.
#[derive(Debug, Default)]
pub struct RobotActivities(BTreeMap<Name, Record>);

impl RobotActivities {
    /// A message of a registered robot came.
    pub fn heard(&mut self, robot: &Name, now: Instant) {
        self.record(robot, now);
    }

    /// A frame was answered.
    pub fn answered(&mut self, robot: &Name, answer: &v1::Answer, now: Instant) {
        let record = self.record(robot, now);
        record.answered += 1;
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

    /// A frame was refused.
    pub fn refused(&mut self, robot: &Name, rejection: &v1::Rejection, now: Instant) {
        let record = self.record(robot, now);
        *record.refused.entry(rejection.code.clone()).or_default() += 1;
        record.refusal = Some((rejection.clone(), now));
    }

    /// Forgets a robot that is deleted.
    pub fn forget(&mut self, robot: &Name) {
        self.0.remove(robot);
    }

    /// What a robot has done; `None` before its first message.
    pub fn get(&self, robot: &Name, now: Instant) -> Option<RobotActivity> {
        let record = self.0.get(robot)?;
        let ago = |at: Instant| now.saturating_duration_since(at);
        let refusal = |(rejection, at): &(v1::Rejection, Instant)| RefusedFrame {
            code: rejection.code.clone(),
            field: rejection.field.clone(),
            detail: rejection.detail.clone(),
            ago: ago(*at),
        };
        Some(RobotActivity {
            answered: record.answered,
            refused: record.refused.clone(),
            last_refusal: record.refusal.as_ref().map(refusal),
            last_message: ago(record.last),
            last_recognised: record.recognised.map(ago),
            last_fix: record.fixed.map(ago),
            frames_per_s: record.rate.per_second(record.second(now)),
        })
    }

    fn record(&mut self, robot: &Name, now: Instant) -> &mut Record {
        if self.0.len() >= MAX_ROBOTS && !self.0.contains_key(robot) {
            let oldest = self.0.iter().min_by_key(|(_, record)| record.last).map(|(name, _)| name.clone());
            oldest.map(|name| self.0.remove(&name));
        }
        let record = self.0.entry(robot.clone()).or_insert_with(|| Record::new(now));
        record.last = record.last.max(now);
        record
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(text: &str) -> Name {
        Name::new(text).unwrap()
    }

    fn rejection(code: &str) -> v1::Rejection {
        v1::Rejection { code: code.into(), field: "image".into(), detail: "it is none".into() }
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
    fn refusals_are_counted_by_code_and_the_last_is_told() {
        let (mut all, start, r1) = (RobotActivities::default(), Instant::now(), name("r1"));
        assert_eq!(all.get(&r1, start), None);
        all.refused(&r1, &rejection("bad_image"), start);
        all.refused(&r1, &rejection("bad_image"), at(start, 10));
        all.refused(&r1, &rejection("not_newer"), at(start, 20));
        all.heard(&r1, at(start, 50));
        let found = all.get(&r1, at(start, 60)).unwrap();
        assert_eq!(found.refused, [("bad_image".into(), 2), ("not_newer".into(), 1)].into());
        let last = found.last_refusal.unwrap();
        assert_eq!(
            (last.code.as_str(), last.field.as_str(), last.ago.as_millis()),
            ("not_newer", "image", 40)
        );
        assert_eq!((found.answered, found.last_message.as_millis()), (0, 10));
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
            all.heard(&name(&format!("r{i}")), at(start, i));
        }
        all.heard(&name("r0"), at(start, 20_000));
        all.heard(&name("new"), at(start, 20_001));
        assert_eq!(all.0.len(), MAX_ROBOTS);
        let is_there = |robot: &str| all.get(&name(robot), start).is_some();
        assert!(is_there("new") && is_there("r0") && !is_there("r1"));
    }
}
