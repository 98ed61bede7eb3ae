//! How fast a robot's clock runs by the server's. In: times of capture and receipt. Out: seconds of
//! the robot's clock in a second of the server's: 1, or the factor of a simulation.

use super::{CLOCK_SET_AFTER, CLOCK_SET_COUNT, CLOCK_SET_SPREAD, MAX_LEADS, nanos};
use std::{collections::VecDeque, time::Duration};

/// Rates that a clock may have: simulations run at 0.1 to 10, with a margin of two.
const MIN_RATE: f64 = 0.05;
pub(super) const MAX_RATE: f64 = 20.0;
/// A rate is learnt from messages over at least this time...
const RATE_SPAN: Duration = Duration::from_millis(400);
/// ...at least this many...
const RATE_COUNT: usize = 5;
/// ...if the least delayed ones are off by more than this, which is jitter of timers and links.
const RATE_JITTER: Duration = Duration::from_millis(150);
/// A row goes back by no more than this.
const ROW_AGE_NS: i64 = 3_000_000_000;

/// Times of a message, ns: receipt by the server's clock since the first one, capture by the
/// robot's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct TimePair {
    pub(super) received_ns: i64,
    pub(super) captured_ns: i64,
}

impl TimePair {
    /// Capture time less time of receipt, by the robot's clock, ns.
    pub(super) fn lead_ns(&self, rate: f64) -> i64 {
        self.captured_ns.saturating_sub((self.received_ns as f64 * rate) as i64)
    }

    /// Rate of a clock that shows both; 0 for messages that came at once.
    fn rate_to(&self, later: &Self) -> f64 {
        let passed_ns = later.received_ns - self.received_ns;
        if passed_ns <= 0 {
            return 0.0;
        }
        later.captured_ns.saturating_sub(self.captured_ns) as f64 / passed_ns as f64
    }
}

/// The rate that messages in their order of receipt show, if `rate` does not explain them. The
/// least delayed messages of three equal times must lie on a line: a link that stalls, or delays
/// more from now on, shows no rate. In each, that is the lead of place `strays`, or the smallest of
/// fewer.
pub(super) fn changed_rate(pairs: &VecDeque<TimePair>, rate: f64, strays: usize) -> Option<f64> {
    let (first_ns, last_ns) = (pairs.front()?.received_ns, pairs.back()?.received_ns);
    let third_ns = (last_ns - first_ns) / 3;
    if pairs.len() < RATE_COUNT || 3 * third_ns < nanos(RATE_SPAN) {
        return None;
    }
    let least_delayed = |i: i64| {
        let of_third = |pair: &&TimePair| ((pair.received_ns - first_ns) / third_ns).min(2) == i;
        let mut of_third: Vec<&TimePair> = pairs.iter().filter(of_third).collect();
        of_third.sort_unstable_by_key(|pair| std::cmp::Reverse(pair.lead_ns(rate)));
        of_third.get(of_third.len().min(strays).checked_sub(1)?).copied()
    };
    let [a, b, c] = [least_delayed(0)?, least_delayed(1)?, least_delayed(2)?];
    let found = a.rate_to(c);
    let jitter_ns = nanos(RATE_JITTER) as f64 * found.max(1.0);
    let off_ns = |by: f64, from: &TimePair, to: &TimePair| {
        (from.rate_to(to) - by).abs() * (to.received_ns - from.received_ns) as f64
    };
    let is_line = off_ns(found, a, b) <= jitter_ns && off_ns(found, b, c) <= jitter_ns;
    if !is_line || !(MIN_RATE..=MAX_RATE).contains(&found) || off_ns(rate, a, c) <= jitter_ns {
        return None;
    }
    Some(if off_ns(1.0, a, c) <= jitter_ns { 1.0 } else { found })
}

/// Messages in a row that the clock so far does not explain.
#[derive(Debug, Clone, Default)]
pub(super) struct ClockRow {
    count: u32,
    pairs: VecDeque<TimePair>,
}

impl ClockRow {
    /// Adds the next message. One that no clock shows after the one before it begins a row of its
    /// own.
    pub(super) fn add(&mut self, pair: TimePair) {
        if let Some(last) = self.pairs.back() {
            let spread_ns = nanos(CLOCK_SET_SPREAD);
            let most_ns = (MAX_RATE * (pair.received_ns - last.received_ns) as f64) as i64 + spread_ns;
            if !(-spread_ns..=most_ns).contains(&pair.captured_ns.saturating_sub(last.captured_ns)) {
                *self = Self::default();
            }
        }
        self.count = self.count.saturating_add(1);
        // The newest is kept, those before it at a distance.
        if let [.., before, last] = &*self.pairs.make_contiguous()
            && last.received_ns - before.received_ns < ROW_AGE_NS / MAX_LEADS as i64
        {
            self.pairs.pop_back();
        }
        self.pairs.push_back(pair);
        while self.pairs.front().is_some_and(|first| pair.received_ns - first.received_ns > ROW_AGE_NS) {
            self.pairs.pop_front();
        }
    }

    /// The rate of the clock that the row shows, once there are enough over enough time: `rate` or
    /// 1 if that explains them, else their own.
    pub(super) fn rate(&self, rate: f64) -> Option<f64> {
        let (first, last) = (self.pairs.front()?, self.pairs.back()?);
        if self.count < CLOCK_SET_COUNT || last.received_ns - first.received_ns < nanos(CLOCK_SET_AFTER) {
            return None;
        }
        let is_within = |rate: f64, tolerance_ns: i64| {
            let lead_ns = first.lead_ns(rate);
            let tolerance_ns = (tolerance_ns as f64 * rate.max(1.0)) as u64;
            self.pairs.iter().all(|pair| pair.lead_ns(rate).abs_diff(lead_ns) <= tolerance_ns)
        };
        let spread_ns = nanos(CLOCK_SET_SPREAD);
        if let Some(rate) = [rate, 1.0].into_iter().find(|rate| is_within(*rate, spread_ns)) {
            return Some(rate);
        }
        let own = first.rate_to(last);
        ((MIN_RATE..=MAX_RATE).contains(&own) && is_within(own, nanos(RATE_JITTER))).then_some(own)
    }
}
