//! Checks the time stamps of a robot's messages. In: capture times by the robot's clock, with the
//! times of receipt. Out: accepted, refused, or the robot's clock was set. Knows no messages; time
//! is passed in.
//!
//! The *lead* of a message is its capture time less its time of receipt, each by its own clock.
//! Delay only lowers the lead, so the largest leads of recent messages are the offset between the
//! clocks. A message that leads by more is stamped wrongly. Clocks are compared within one robot
//! and one epoch only; their offset to the server's clock does not matter.
//!
//! A simulation's clock runs at another rate than the server's. The rate is learnt from the
//! messages (`clock_rate.rs`), and receipt counts in seconds of the robot's clock. What leads is
//! the stream of the highest rank: a message of it that comes late and goes on from the one before
//! it is accepted, since a simulation stood still, or a link did.

mod clock_rate;

use clock_rate::{ClockRow, MAX_RATE, TimePair, changed_rate};
use protos::{Code, Name, Rejection};
use std::{
    collections::{BTreeMap, VecDeque},
    time::{Duration, Instant},
};

/// A message whose lead exceeds the reference by more is refused. Covers a reference by delayed
/// messages, jitter of timers and drift of clocks.
pub const AHEAD_TOLERANCE: Duration = Duration::from_millis(200);
/// A message further behind the reference is refused: the fusion cannot replay it
/// (`map::fuse::FuseParams::window_s`).
pub const BEHIND_TOLERANCE: Duration = Duration::from_secs(2);
/// A clock is young for this long after its first message, and until [`YOUNG_COUNT`] messages over
/// [`YOUNG_SPAN`] were accepted. Nobody knows its rate yet, and it may run as fast as [`MAX_RATE`].
const YOUNG_FOR: Duration = Duration::from_secs(3);
const YOUNG_COUNT: usize = 8;
const YOUNG_SPAN: Duration = Duration::from_millis(600);
/// This many refused messages in a row, of the leading stream...
pub const CLOCK_SET_COUNT: u32 = 5;
/// ...over at least this time...
pub const CLOCK_SET_AFTER: Duration = Duration::from_secs(1);
/// ...whose leads differ by no more than this, or that lie on a line of another rate, mean that the
/// robot's clock was set.
pub const CLOCK_SET_SPREAD: Duration = Duration::from_millis(500);
/// The stream of the highest rank leads. A stream that is silent for this long does not lead any
/// more.
pub const LEADER_SILENT: Duration = Duration::from_secs(10);
/// Leads that the reference is computed from: the latest...
pub const MAX_LEADS: usize = 64;
/// ...and none older than this, except the last.
const LEAD_AGE_NS: i64 = 30_000_000_000;
/// Streams of one robot; a further one replaces the one with the oldest message.
pub const MAX_STREAMS: usize = 16;
/// Two kept leads are at least this far apart, so that a fast simulation is seen over a second,
/// too.
const LEAD_SPACING_NS: i64 = 15_000_000;
/// The reference is the third largest lead, so that two stray stamps do not move it.
const STRAYS: usize = 3;

/// The source of a message. A later variant says more about the robot's clock: odometry carries the
/// pose, and a camera with a clock of its own must not replace odometry's times.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Stream {
    /// Frames of a camera, without odometry.
    Camera(Name),
    /// Frames of a camera with odometry.
    MovingCamera(Name),
    /// Laser scans.
    Scan,
    Odometry,
}

impl Stream {
    /// How far a stamp may lie before that of the previous message: two lasers or threads of one
    /// robot need not send in order. Odometry has one source.
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
    /// It is in order. The stamp of the previous message in its stream, which this carries (ns),
    /// was ahead.
    GoodAfterStray(i64),
    /// The robot's clock was set: this stamp is the new reference.
    ClockSet,
}

/// The last messages of a stream.
#[derive(Debug, Clone, Copy)]
struct StreamState {
    /// The last accepted message.
    accepted: Option<TimePair>,
    /// Receipt of the last message, accepted or not, ns.
    last_ns: i64,
}

/// The clock of one epoch of a robot, by the server's clock.
#[derive(Debug)]
pub(crate) struct TimeBase {
    /// Times of receipt count from the first message.
    origin: Option<Instant>,
    /// Seconds of the robot's clock in a second of the server's.
    rate: f64,
    /// Whether it was another than 1 in this epoch, and the largest of it so far.
    is_simulated: bool,
    fastest: f64,
    /// Receipt of the first message by the present clock, ns.
    since_ns: i64,
    /// Accepted messages.
    leads: VecDeque<TimePair>,
    /// The last accepted message of any stream.
    newest: Option<TimePair>,
    streams: BTreeMap<Stream, StreamState>,
    /// Messages in a row that the present clock does not explain.
    row: Option<(Stream, ClockRow)>,
}

impl Default for TimeBase {
    fn default() -> Self {
        let (leads, streams) = (VecDeque::new(), BTreeMap::new());
        Self {
            origin: None,
            rate: 1.0,
            is_simulated: false,
            fastest: 1.0,
            since_ns: 0,
            leads,
            newest: None,
            streams,
            row: None,
        }
    }
}

impl TimeBase {
    /// Checks the capture time of the next message of its stream. Errors: the stamp is ahead of or
    /// behind the reference.
    pub(crate) fn check(
        &mut self,
        stream: &Stream,
        captured_ns: i64,
        received: Instant,
    ) -> Result<Stamp, Rejection> {
        let pair = TimePair { received_ns: self.receipt_ns(received), captured_ns };
        let last = self.note_receipt(stream, pair.received_ns);
        let Some(reference_ns) = self.reference_ns() else {
            self.since_ns = pair.received_ns;
            self.accept(stream, pair);
            return Ok(Stamp::Good);
        };
        let ahead_ns = pair.lead_ns(self.rate).saturating_sub(reference_ns);
        let is_behind = ahead_ns < -nanos(BEHIND_TOLERANCE);
        let refused = if ahead_ns > self.ahead_tolerance_ns() && !self.may_be_faster(pair) {
            Some(Code::ClockAhead)
        } else if is_behind && !self.goes_on(stream, last, pair) {
            Some(Code::ClockBehind)
        } else {
            None
        };
        let disorder_ns = nanos(stream.disorder());
        let stray = last.filter(|before| captured_ns < before.captured_ns.saturating_sub(disorder_ns));
        let refused = refused.or_else(|| {
            // A later message with an earlier stamp: the stamp that is further off the reference is
            // wrong.
            let before_ahead_ns = stray?.lead_ns(self.rate).saturating_sub(reference_ns);
            (before_ahead_ns <= ahead_ns.saturating_neg()).then_some(Code::ClockBehind)
        });
        if (refused.is_some() || is_behind)
            && let Some(rate) = self.clock_of_row(stream, pair)
        {
            self.restart(rate, pair);
            self.accept(stream, pair);
            return Ok(if refused.is_some() { Stamp::ClockSet } else { Stamp::Good });
        }
        if let Some(code) = refused {
            let off_s = ahead_ns as f64 * 1e-9;
            let detail = format!("{off_s:+.3} s off what the robot's messages were so far");
            return Err(Rejection::new(code, "captured_ns", detail));
        }
        if is_behind {
            self.note_accepted(stream, pair);
        } else {
            self.accept(stream, pair);
        }
        Ok(stray.map_or(Stamp::Good, |before| Stamp::GoodAfterStray(before.captured_ns)))
    }

    /// Time since a capture by the robot's clock, at least 0; `None` before the first message.
    pub(crate) fn age(&self, captured_ns: i64, now: Instant) -> Option<Duration> {
        let age_ns = self.robot_ns(now)?.saturating_sub(captured_ns);
        Some(Duration::from_nanos(u64::try_from(age_ns).unwrap_or(0)))
    }

    /// What the robot's clock shows at `at`, ns; `None` before the first message.
    pub(crate) fn robot_ns(&self, at: Instant) -> Option<i64> {
        let since = at.saturating_duration_since(self.origin?);
        Some(self.reference_ns()?.saturating_add((nanos(since) as f64 * self.rate) as i64))
    }

    /// Seconds of the robot's clock in a second of the server's: 1 but for simulations.
    pub(crate) fn rate(&self) -> f64 {
        self.rate
    }

    fn receipt_ns(&mut self, received: Instant) -> i64 {
        nanos(received.saturating_duration_since(*self.origin.get_or_insert(received)))
    }

    /// Notes the receipt of a message; gives the stream's last accepted message.
    fn note_receipt(&mut self, stream: &Stream, received_ns: i64) -> Option<TimePair> {
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

    fn ahead_tolerance_ns(&self) -> i64 {
        (nanos(AHEAD_TOLERANCE) as f64 * self.rate.max(1.0)) as i64
    }

    /// Whether a clock whose rate is not certain may have come to this time since the last accepted
    /// message: a young one, or that of a simulation, whose rate changes with its load.
    fn may_be_faster(&self, pair: TimePair) -> bool {
        let span_ns = self.leads.front().map_or(0, |first| pair.received_ns - first.received_ns);
        let is_known = self.leads.len() >= YOUNG_COUNT && span_ns >= nanos(YOUNG_SPAN);
        let is_young = !is_known && pair.received_ns - self.since_ns < nanos(YOUNG_FOR);
        let fastest = if is_young { MAX_RATE } else { (2.0 * self.rate + 1.0).max(1.25 * self.fastest) };
        let most_ns = |before: TimePair| {
            (fastest * (pair.received_ns - before.received_ns) as f64) as i64 + self.ahead_tolerance_ns()
        };
        let is_within =
            |before: TimePair| pair.captured_ns.saturating_sub(before.captured_ns) <= most_ns(before);
        (is_young || self.is_simulated) && self.newest.is_some_and(is_within)
    }

    /// Whether a message behind the reference goes on from what leads: from its own stream, or from
    /// the one that leads.
    fn goes_on(&self, stream: &Stream, last: Option<TimePair>, pair: TimePair) -> bool {
        if self.is_leading(stream, pair.received_ns) {
            return last.is_some_and(|before| before.captured_ns <= pair.captured_ns);
        }
        let leader = self
            .streams
            .iter()
            .filter(|(_, s)| is_present(s, pair.received_ns))
            .max_by_key(|(s, _)| s.rank());
        let leads_ns = leader.and_then(|(_, state)| state.accepted).map(|newest| newest.lead_ns(self.rate));
        leads_ns
            .is_some_and(|lead_ns| lead_ns.saturating_sub(pair.lead_ns(self.rate)) <= nanos(BEHIND_TOLERANCE))
    }

    /// Whether no stream of a higher rank is present.
    fn is_leading(&self, stream: &Stream, now_ns: i64) -> bool {
        let present = self.streams.iter().filter(|(_, state)| is_present(state, now_ns));
        present.map(|(s, _)| s.rank()).max().is_none_or(|rank| stream.rank() >= rank)
    }

    /// Notes an accepted message without taking its lead for the clock's.
    fn note_accepted(&mut self, stream: &Stream, pair: TimePair) {
        if let Some(state) = self.streams.get_mut(stream) {
            state.accepted = Some(pair);
        }
        self.newest = Some(pair);
    }

    fn accept(&mut self, stream: &Stream, pair: TimePair) {
        self.note_accepted(stream, pair);
        // An accepted message ends a row of refusals of the same or a lower rank.
        if self.row.as_ref().is_some_and(|(of, _)| of.rank() <= stream.rank()) {
            self.row = None;
        }
        let is_close = |last: &TimePair| pair.received_ns - last.received_ns < LEAD_SPACING_NS;
        if self.leads.len() >= YOUNG_COUNT && self.leads.back().is_some_and(is_close) {
            return;
        }
        if self.leads.len() == MAX_LEADS {
            self.leads.pop_front();
        }
        self.leads.push_back(pair);
        while self.leads.len() > 1
            && self.leads.front().is_some_and(|first| pair.received_ns - first.received_ns > LEAD_AGE_NS)
        {
            self.leads.pop_front();
        }
        if let Some(rate) = changed_rate(&self.leads, self.rate, STRAYS) {
            tracing::debug!(before = self.rate, rate, "robot_clock_rate");
            self.set_rate(rate);
        }
    }

    /// Goes on by another clock.
    fn restart(&mut self, rate: f64, pair: TimePair) {
        self.leads.clear();
        for state in self.streams.values_mut() {
            state.accepted = None;
        }
        (self.since_ns, self.row) = (pair.received_ns, None);
        self.set_rate(rate);
    }

    fn set_rate(&mut self, rate: f64) {
        self.is_simulated |= (rate - 1.0).abs() > 0.0;
        (self.rate, self.fastest) = (rate, self.fastest.max(rate));
    }

    /// The lead of a message without delay: the third largest lead, or with few messages the upper
    /// median.
    fn reference_ns(&self) -> Option<i64> {
        let mut leads: Vec<i64> = self.leads.iter().map(|pair| pair.lead_ns(self.rate)).collect();
        leads.sort_unstable_by(|a, b| b.cmp(a));
        let place = leads.len().div_ceil(2).min(STRAYS);
        leads.get(place.checked_sub(1)?).copied()
    }

    /// The rate of the robot's clock, if this message completes a row that shows that it was set,
    /// stood still, or runs at another rate.
    fn clock_of_row(&mut self, stream: &Stream, pair: TimePair) -> Option<f64> {
        if !self.is_leading(stream, pair.received_ns) {
            return None;
        }
        let row = match &mut self.row {
            Some((of, row)) if of == stream => row,
            _ => &mut self.row.insert((stream.clone(), ClockRow::default())).1,
        };
        row.add(pair);
        row.rate(self.rate)
    }
}

fn is_present(state: &StreamState, now_ns: i64) -> bool {
    now_ns - state.last_ns <= nanos(LEADER_SILENT)
}

fn nanos(time: Duration) -> i64 {
    i64::try_from(time.as_nanos()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests;
