//! Checks the time stamps of a robot's messages. In: capture times by the robot's clock, with the times of receipt. Out:
//! accepted, refused, or the robot's clock was set. Knows no messages; time is passed in.
//!
//! The *lead* of a message is its capture time less its time of receipt, each by its own clock. Delay only lowers the lead,
//! so the largest leads of recent messages are the offset between the clocks. A message that leads by more is stamped
//! wrongly. Clocks are compared within one robot and one epoch only; their offset to the server's clock does not matter.

use protos::{Code, Name, Rejection};
use std::{
    collections::{BTreeMap, VecDeque},
    time::{Duration, Instant},
};

/// A message whose lead exceeds the reference by more is refused. Covers a reference by delayed messages, jitter of timers
/// and drift of clocks.
pub const AHEAD_TOLERANCE: Duration = Duration::from_millis(200);
/// A message further behind the reference is refused: the fusion cannot replay it
/// (`map::fuse::FuseParams::window_s`).
pub const BEHIND_TOLERANCE: Duration = Duration::from_secs(2);
/// This many refused messages in a row, of the leading stream...
pub const CLOCK_SET_COUNT: u32 = 5;
/// ...over at least this time...
pub const CLOCK_SET_AFTER: Duration = Duration::from_secs(1);
/// ...whose leads differ by no more than this, mean that the robot's clock was set.
pub const CLOCK_SET_SPREAD: Duration = Duration::from_millis(500);
/// The stream of the highest rank leads. A stream that is silent for this long does not lead any more.
pub const LEADER_SILENT: Duration = Duration::from_secs(10);
/// Leads that the reference is computed from: the latest...
pub const MAX_LEADS: usize = 64;
/// ...and none older than this, except the last.
const LEAD_AGE_NS: i64 = 30_000_000_000;
/// Streams of one robot; a further one replaces the one with the oldest message.
pub const MAX_STREAMS: usize = 16;
/// The reference is the third largest lead, so that two stray stamps do not move it.
const STRAYS: usize = 3;

/// The source of a message. A later variant says more about the robot's clock: odometry carries the pose, and a camera with
/// a clock of its own must not replace odometry's times.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Stream {
    /// Frames of a camera, without odometry.
    Camera(Name),
    /// Frames of a camera with odometry.
    MovingCamera(Name),
    /// Laser scans.
    Scan,
    /// Odometry.
    Odometry,
}

impl Stream {
    /// How far a stamp may lie before that of the previous message: two lasers or threads of one robot need not send in order.
    /// Odometry has one source.
    fn disorder(&self) -> Duration {
        if *self == Self::Odometry { Duration::ZERO } else { AHEAD_TOLERANCE }
    }

    /// Cameras rank equally.
    fn rank(&self) -> u8 {
        match self {
            Self::Camera(_) => 0,
            Self::MovingCamera(_) => 1,
            Self::Scan => 2,
            Self::Odometry => 3,
        }
    }
}

/// The result of a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stamp {
    /// It is in order.
    Good,
    /// It is in order. The stamp of the previous message in its stream, which this carries (ns), was ahead.
    GoodAfterStray(i64),
    /// The robot's clock was set: this stamp is the new reference.
    ClockSet,
}

/// The last messages of a stream.
#[derive(Debug, Clone, Copy)]
struct StreamState {
    /// Capture time and lead of the last accepted message, ns.
    accepted: Option<(i64, i64)>,
    /// Receipt of the last message, accepted or not, ns.
    last_ns: i64,
}

/// Refused messages in a row whose leads agree.
#[derive(Debug, Clone)]
struct RefusedRow {
    stream: Stream,
    count: u32,
    since_ns: i64,
    lead_ns: i64,
}

/// The clock of one epoch of a robot, by the server's clock.
#[derive(Debug, Default)]
pub(crate) struct TimeBase {
    /// Times of receipt count from the first message.
    origin: Option<Instant>,
    /// Receipt and lead of accepted messages, ns.
    leads: VecDeque<(i64, i64)>,
    streams: BTreeMap<Stream, StreamState>,
    row: Option<RefusedRow>,
}

impl TimeBase {
    /// Checks the capture time of the next message of its stream. Errors: the stamp is ahead of or behind the reference.
    pub(crate) fn check(
        &mut self,
        stream: &Stream,
        captured_ns: i64,
        received: Instant,
    ) -> Result<Stamp, Rejection> {
        let received_ns = self.receipt_ns(received);
        let lead_ns = captured_ns.saturating_sub(received_ns);
        let last = self.note_receipt(stream, received_ns);
        let Some(reference_ns) = self.reference_ns() else {
            self.accept(stream, captured_ns, (received_ns, lead_ns));
            return Ok(Stamp::Good);
        };
        let ahead_ns = lead_ns.saturating_sub(reference_ns);
        let refused = if ahead_ns > nanos(AHEAD_TOLERANCE) {
            Some(Code::ClockAhead)
        } else if ahead_ns < -nanos(BEHIND_TOLERANCE) {
            Some(Code::ClockBehind)
        } else {
            None
        };
        let disorder_ns = nanos(stream.disorder());
        let stray = last.filter(|(before_ns, _)| captured_ns < before_ns.saturating_sub(disorder_ns));
        let refused = refused.or_else(|| {
            // A later message with an earlier stamp: the stamp that is further off the reference is wrong.
            let (_, before_lead_ns) = stray?;
            let before_ahead_ns = before_lead_ns.saturating_sub(reference_ns);
            (before_ahead_ns <= ahead_ns.saturating_neg()).then_some(Code::ClockBehind)
        });
        if let Some(code) = refused {
            if self.is_clock_set(stream, lead_ns, received_ns) {
                self.leads.clear();
                for state in self.streams.values_mut() {
                    state.accepted = None;
                }
                self.accept(stream, captured_ns, (received_ns, lead_ns));
                return Ok(Stamp::ClockSet);
            }
            let off_s = ahead_ns as f64 * 1e-9;
            let detail = format!("{off_s:+.3} s off what the robot's messages were so far");
            return Err(Rejection::new(code, "captured_ns", detail));
        }
        self.accept(stream, captured_ns, (received_ns, lead_ns));
        Ok(stray.map_or(Stamp::Good, |(before_ns, _)| Stamp::GoodAfterStray(before_ns)))
    }

    /// Time since a capture, at least 0; `None` before the first message.
    pub(crate) fn age(&self, captured_ns: i64, now: Instant) -> Option<Duration> {
        let age_ns = self.robot_ns(now)?.saturating_sub(captured_ns);
        Some(Duration::from_nanos(u64::try_from(age_ns).unwrap_or(0)))
    }

    /// What the robot's clock shows at `at`, ns; `None` before the first message.
    pub(crate) fn robot_ns(&self, at: Instant) -> Option<i64> {
        let since = at.saturating_duration_since(self.origin?);
        Some(self.reference_ns()?.saturating_add(nanos(since)))
    }

    fn receipt_ns(&mut self, received: Instant) -> i64 {
        nanos(received.saturating_duration_since(*self.origin.get_or_insert(received)))
    }

    /// Notes the receipt of a message; gives capture time and lead of the stream's last accepted message.
    fn note_receipt(&mut self, stream: &Stream, received_ns: i64) -> Option<(i64, i64)> {
        if self.streams.len() >= MAX_STREAMS && !self.streams.contains_key(stream) {
            let oldest = self.streams.iter().min_by_key(|(_, state)| state.last_ns).map(|(s, _)| s.clone());
            oldest.map(|stream| self.streams.remove(&stream));
        }
        let state = self
            .streams
            .entry(stream.clone())
            .or_insert(StreamState { accepted: None, last_ns: received_ns });
        state.last_ns = received_ns;
        state.accepted
    }

    fn accept(&mut self, stream: &Stream, captured_ns: i64, (received_ns, lead_ns): (i64, i64)) {
        if let Some(state) = self.streams.get_mut(stream) {
            state.accepted = Some((captured_ns, lead_ns));
        }
        // An accepted message ends a row of refusals of the same or a lower rank.
        if self.row.as_ref().is_some_and(|row| row.stream.rank() <= stream.rank()) {
            self.row = None;
        }
        if self.leads.len() == MAX_LEADS {
            self.leads.pop_front();
        }
        self.leads.push_back((received_ns, lead_ns));
        while self.leads.len() > 1
            && self.leads.front().is_some_and(|(at_ns, _)| received_ns - at_ns > LEAD_AGE_NS)
        {
            self.leads.pop_front();
        }
    }

    /// The lead of a message without delay: the third largest lead, or with few messages the upper median.
    fn reference_ns(&self) -> Option<i64> {
        let mut leads: Vec<i64> = self.leads.iter().map(|(_, lead_ns)| *lead_ns).collect();
        leads.sort_unstable_by(|a, b| b.cmp(a));
        let place = leads.len().div_ceil(2).min(STRAYS);
        leads.get(place.checked_sub(1)?).copied()
    }

    /// Whether this refused message completes a row that shows that the robot's clock was set.
    fn is_clock_set(&mut self, stream: &Stream, lead_ns: i64, received_ns: i64) -> bool {
        let silent_ns = nanos(LEADER_SILENT);
        let is_present = |state: &StreamState| received_ns - state.last_ns <= silent_ns;
        let leader = self.streams.iter().filter(|(_, state)| is_present(state)).map(|(s, _)| s.rank()).max();
        if leader.is_some_and(|rank| stream.rank() < rank) {
            return false;
        }
        let agrees = |row: &RefusedRow| {
            row.stream == *stream && lead_ns.abs_diff(row.lead_ns) <= nanos(CLOCK_SET_SPREAD).unsigned_abs()
        };
        let row = match self.row.take() {
            Some(row) if agrees(&row) => RefusedRow { count: row.count.saturating_add(1), ..row },
            _ => RefusedRow { stream: stream.clone(), count: 1, since_ns: received_ns, lead_ns },
        };
        let set = row.count >= CLOCK_SET_COUNT && received_ns - row.since_ns >= nanos(CLOCK_SET_AFTER);
        self.row = Some(row);
        set
    }
}

fn nanos(time: Duration) -> i64 {
    i64::try_from(time.as_nanos()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(text: &str) -> Stream {
        Stream::Camera(Name::new(text).unwrap())
    }

    /// Messages of one robot; times in milliseconds.
    struct Robot {
        clock: TimeBase,
        start: Instant,
    }

    impl Robot {
        fn new() -> Self {
            Self { clock: TimeBase::default(), start: Instant::now() }
        }

        fn check(&mut self, stream: &Stream, captured_ms: i64, received_ms: u64) -> Result<Stamp, Code> {
            let received = self.start + Duration::from_millis(received_ms);
            self.clock.check(stream, captured_ms * 1_000_000, received).map_err(|r| r.code)
        }

        /// Ten odometry messages, 100 ms apart, up to a second.
        fn driving() -> Self {
            let mut robot = Self::new();
            for ms in (100..=1000).step_by(100) {
                assert_eq!(robot.check(&Stream::Odometry, ms, ms as u64), Ok(Stamp::Good));
            }
            robot
        }
    }

    #[test]
    fn stamps_at_the_tolerances() {
        let ahead = AHEAD_TOLERANCE.as_millis() as i64;
        let behind = BEHIND_TOLERANCE.as_millis() as i64;
        let front = camera("front");
        assert_eq!(Robot::driving().check(&front, 1100 + ahead, 1100), Ok(Stamp::Good));
        assert_eq!(Robot::driving().check(&front, 1101 + ahead, 1100), Err(Code::ClockAhead));
        assert_eq!(Robot::driving().check(&front, 1100 - behind, 1100), Ok(Stamp::Good));
        assert_eq!(Robot::driving().check(&front, 1099 - behind, 1100), Err(Code::ClockBehind));
        assert_eq!(Robot::driving().check(&front, i64::MAX / 1_000_000, 1100), Err(Code::ClockAhead));
    }

    /// Two leads may be further apart than 64 bits hold.
    #[test]
    fn stamps_at_both_ends_of_time_are_refused() {
        let mut robot = Robot::driving();
        for (i, captured_ns) in [i64::MAX, i64::MIN, i64::MAX, i64::MIN].into_iter().enumerate() {
            let received = robot.start + Duration::from_millis(1100 + 300 * i as u64);
            assert!(robot.clock.check(&Stream::Odometry, captured_ns, received).is_err(), "{captured_ns}");
        }
    }

    #[test]
    fn strays_within_the_tolerance_do_not_move_the_reference() {
        let mut robot = Robot::driving();
        let ahead = AHEAD_TOLERANCE.as_millis() as i64;
        for (i, received) in (1100..1300).step_by(100).enumerate() {
            let stream = camera(&format!("c{i}"));
            assert_eq!(robot.check(&stream, received + ahead, received as u64), Ok(Stamp::Good));
        }
        assert_eq!(robot.check(&camera("third"), 1301 + ahead, 1300), Err(Code::ClockAhead));
    }

    #[test]
    fn of_two_readings_out_of_order_the_one_further_off_is_wrong() {
        let mut robot = Robot::driving();
        assert_eq!(robot.check(&Stream::Odometry, 1250, 1100), Ok(Stamp::Good));
        assert_eq!(robot.check(&Stream::Odometry, 1200, 1200), Ok(Stamp::GoodAfterStray(1_250_000_000)));
        assert_eq!(robot.check(&Stream::Odometry, 500, 1300), Err(Code::ClockBehind));
        assert_eq!(robot.check(&Stream::Odometry, 1400, 1400), Ok(Stamp::Good));
        // Two lasers need not send in order.
        assert_eq!(robot.check(&Stream::Scan, 1400, 1400), Ok(Stamp::Good));
        assert_eq!(robot.check(&Stream::Scan, 1380, 1400), Ok(Stamp::Good));
    }

    #[test]
    fn a_clock_is_set_by_several_that_agree_over_a_time() {
        let set = |count: u32, step_ms: u64, spread_ms: i64| {
            let mut robot = Robot::driving();
            (0..count)
                .map(|i| {
                    let received = 1100 + u64::from(i) * step_ms;
                    let spread = if i % 2 == 0 { 0 } else { spread_ms };
                    robot.check(&Stream::Odometry, received as i64 + 60_000 + spread, received)
                })
                .filter(|result| *result == Ok(Stamp::ClockSet))
                .count()
        };
        let spread = CLOCK_SET_SPREAD.as_millis() as i64;
        assert_eq!(set(CLOCK_SET_COUNT, 250, 0), 1);
        assert_eq!(set(CLOCK_SET_COUNT - 1, 250, 0), 0, "too few");
        assert_eq!(set(CLOCK_SET_COUNT, 249, 0), 0, "too soon");
        assert_eq!(set(CLOCK_SET_COUNT, 250, spread), 1);
        assert_eq!(set(CLOCK_SET_COUNT, 250, spread + 1), 0, "they do not agree");
        assert_eq!(set(200, 10, 0), 1, "then it is the clock");
    }

    #[test]
    fn of_two_cameras_by_two_clocks_the_first_stays() {
        let mut robot = Robot::new();
        let (a, b) = (camera("a"), camera("b"));
        for ms in (0..5000).step_by(200) {
            assert_eq!(robot.check(&a, ms, ms as u64), Ok(Stamp::Good));
            assert_eq!(robot.check(&b, ms + 10_000, ms as u64), Err(Code::ClockAhead));
        }
        // It is silent: the other goes on.
        let later = (5000..8000).step_by(200).map(|ms| robot.check(&b, ms + 10_000, ms as u64));
        assert_eq!(later.filter(|result| *result == Ok(Stamp::ClockSet)).count(), 1);
    }

    #[test]
    fn a_stream_that_is_silent_leads_no_longer() {
        let mut robot = Robot::driving();
        let silent = 1000 + LEADER_SILENT.as_millis() as i64;
        let front = camera("front");
        let (mut set, mut ms) = (None, 1200);
        while set.is_none() && ms < 3 * silent {
            if robot.check(&front, ms + 60_000, ms as u64) == Ok(Stamp::ClockSet) {
                set = Some(ms);
            }
            ms += 200;
        }
        assert!(set.is_some_and(|ms| ms > silent && ms < silent + 1500), "{set:?}");
    }

    #[test]
    fn ages_are_by_the_robots_clock() {
        let robot = Robot::driving();
        let now = robot.start + Duration::from_millis(1700);
        assert_eq!(robot.clock.age(1_000_000_000, now), Some(Duration::from_millis(700)));
        assert_eq!(robot.clock.age(9_000_000_000, now), Some(Duration::ZERO));
        assert_eq!(TimeBase::default().age(0, now), None);
    }

    #[test]
    fn what_is_kept_is_bounded() {
        let mut robot = Robot::new();
        for ms in 0..1000_i64 {
            let stream = camera(&format!("c{}", ms % 50));
            robot.check(&stream, ms, ms as u64).unwrap();
        }
        assert_eq!((robot.clock.leads.len(), robot.clock.streams.len()), (MAX_LEADS, MAX_STREAMS));
        // Old leads go, but for the last.
        robot.check(&camera("c1"), 100_000, 100_000).unwrap();
        assert_eq!(robot.clock.leads.len(), 1);
    }
}
