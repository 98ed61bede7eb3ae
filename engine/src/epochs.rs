//! Decides which epoch of a robot is live. In: liveliness tokens and the epoch of every message,
//! with the time of receipt. Out: the message is admitted, or refused because another epoch of the
//! robot is live. Knows no transport; time is passed in.
//!
//! An epoch begins with its first message. It is live while its liveliness token is there, or for
//! [`MESSAGE_LIVE`] after its last message. While one epoch of a robot is live, every other one is
//! refused. When its token goes, the epoch ends at once, and the next one is admitted. A token
//! names the slot of its epoch, one of [`protos::keys::ALIVE_SLOTS`]: of two epochs that share a
//! slot, the token says nothing, and the later one waits for [`MESSAGE_LIVE`].

use protos::{
    Code, Name, Rejection,
    keys::{ALIVE_SLOTS, alive_slot},
};
use std::{
    collections::{BTreeMap, VecDeque},
    sync::{Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

/// An epoch without a liveliness token is live for this long after its last message: the longest
/// wait of a restarted robot. Longer than zenoh's lease (2 s), after which the token of a lost link
/// goes.
pub const MESSAGE_LIVE: Duration = Duration::from_secs(3);
/// Epochs of one robot whose end is remembered: late messages of an ended epoch are not a robot
/// that came back.
pub const MAX_ENDED: usize = 8;
/// Robots beyond the registered ones; a further one replaces the one with the oldest token or
/// message.
pub const MAX_UNREGISTERED: usize = 1024;
/// Robots in all.
pub const MAX_TRACKED_ROBOTS: usize = 10_000 + MAX_UNREGISTERED;
/// A conflict is shown for this long after the last refused message.
pub const CONFLICT_SHOWN: Duration = Duration::from_secs(10);
/// Shortest time between two log entries about the conflict of a robot.
pub const CONFLICT_LOGGED: Duration = Duration::from_secs(10);

/// A second epoch sends under the name of a robot while the first is live.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Conflict {
    /// The epoch that was last refused.
    pub epoch: u64,
    /// Messages refused since the conflict began.
    pub refused: u64,
    /// Time since the last of them, ms.
    pub last_ms: u64,
}

/// The epochs of a robot now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Status {
    /// It has a liveliness token, or sent a message within [`MESSAGE_LIVE`].
    pub alive: bool,
    /// The live epoch.
    pub epoch: Option<u64>,
    /// Another epoch that was refused within [`CONFLICT_SHOWN`].
    pub conflict: Option<Conflict>,
}

#[derive(Debug, Clone, Copy)]
struct Refused {
    epoch: u64,
    count: u64,
    last: Instant,
}

/// The epochs of one robot.
#[derive(Debug)]
struct RobotEpochs {
    /// Present tokens: a bit for each slot.
    tokens: u16,
    /// The last live epoch, and the time of its last token or message.
    current: Option<(u64, Instant)>,
    /// Earlier epochs and when each ended; the latest last.
    ended: VecDeque<(u64, Instant)>,
    refused: Option<Refused>,
    logged: Option<Instant>,
    last_heard: Instant,
}

impl RobotEpochs {
    fn new(now: Instant) -> Self {
        Self {
            tokens: 0,
            current: None,
            ended: VecDeque::new(),
            refused: None,
            logged: None,
            last_heard: now,
        }
    }

    fn has_token(&self, epoch: u64) -> bool {
        self.tokens & bit(alive_slot(epoch)) != 0
    }

    /// The live epoch, by its token or its messages.
    fn live(&self, now: Instant) -> Option<u64> {
        let (epoch, _) = self.current?;
        if self.has_token(epoch) { Some(epoch) } else { self.heard(now) }
    }

    /// The epoch that is live by its messages alone.
    fn heard(&self, now: Instant) -> Option<u64> {
        let (epoch, last) = self.current?;
        (now.saturating_duration_since(last) < MESSAGE_LIVE).then_some(epoch)
    }

    fn end_current(&mut self, now: Instant) {
        let Some((epoch, _)) = self.current.take() else { return };
        if self.ended.len() == MAX_ENDED {
            self.ended.pop_front();
        }
        self.ended.push_back((epoch, now));
    }

    fn begin(&mut self, epoch: u64, now: Instant) {
        if self.current.is_some_and(|(current, _)| current != epoch) {
            self.end_current(now);
        }
        self.ended.retain(|(ended, _)| *ended != epoch);
        self.current = Some((epoch, now));
        if self.refused.is_some_and(|refused| refused.epoch == epoch) {
            self.refused = None;
        }
    }

    /// Whether a message of this epoch may have been sent before the epoch ended.
    fn is_straggler(&self, epoch: u64, now: Instant) -> bool {
        let late = |(ended, at): &(u64, Instant)| {
            *ended == epoch && now.saturating_duration_since(*at) < MESSAGE_LIVE
        };
        !self.has_token(epoch) && self.ended.iter().any(late)
    }

    /// Counts a message that is refused because of the live epoch; gives the count if it is to be
    /// logged.
    fn refuse(&mut self, epoch: u64, now: Instant) -> Option<u64> {
        let shown = |r: &Refused| now.saturating_duration_since(r.last) < CONFLICT_SHOWN;
        let count = self.refused.filter(shown).map_or(0, |r| r.count) + 1;
        self.refused = Some(Refused { epoch, count, last: now });
        if self.logged.is_some_and(|last| now.saturating_duration_since(last) < CONFLICT_LOGGED) {
            return None;
        }
        self.logged = Some(now);
        Some(count)
    }
}

/// The live epochs of all robots.
#[derive(Debug, Default)]
pub struct Epochs(Mutex<BTreeMap<Name, RobotEpochs>>);

impl Epochs {
    /// Admits a message of a registered robot, or refuses it with [`Code::EpochConflict`] because
    /// another epoch is live, or with [`Code::NotNewer`] because its own ended less than
    /// [`MESSAGE_LIVE`] ago.
    pub fn admit(&self, robot: &Name, epoch: u64, now: Instant) -> Result<(), Rejection> {
        let mut robots = self.lock();
        if robots.len() >= MAX_TRACKED_ROBOTS && !robots.contains_key(robot) {
            // The list can only be full of names that are not registered any more.
            let oldest =
                robots.iter().min_by_key(|(_, epochs)| epochs.last_heard).map(|(name, _)| name.clone());
            oldest.map(|name| robots.remove(&name));
        }
        let epochs = robots.entry(robot.clone()).or_insert_with(|| RobotEpochs::new(now));
        epochs.last_heard = now;
        if let Some((current, last)) = &mut epochs.current
            && *current == epoch
        {
            *last = now;
            return Ok(());
        }
        let has_other_slot = |(live, _): (u64, Instant)| alive_slot(live) != alive_slot(epoch);
        let is_token_its_own = epochs.current.is_none_or(has_other_slot);
        let live = if is_token_its_own { epochs.live(now) } else { epochs.heard(now) };
        if epochs.is_straggler(epoch, now) {
            return Err(Rejection::new(Code::NotNewer, "epoch", format!("epoch {epoch} is over")));
        }
        let Some(live) = live else {
            epochs.begin(epoch, now);
            return Ok(());
        };
        if let Some(refused) = epochs.refuse(epoch, now) {
            tracing::warn!(
                %robot, live_epoch = live, refused_epoch = epoch, refused,
                follows = "two programs use the name of one robot; messages of the later one are refused",
                "epoch_conflict"
            );
        }
        let detail = format!("epoch {live} of robot {robot} is live; two programs use the robot's name");
        Err(Rejection::new(Code::EpochConflict, "epoch", detail))
    }

    /// The liveliness token of a slot appeared or went. Names that are not registered
    /// (`is_registered`) never replace registered ones. `Some(true)` if the robot came by that,
    /// `Some(false)` if it went.
    pub fn token(
        &self,
        robot: &Name,
        (slot, appeared): (u8, bool),
        now: Instant,
        is_registered: impl Fn(&Name) -> bool,
    ) -> Option<bool> {
        let mut robots = self.lock();
        if !robots.contains_key(robot) {
            if !appeared {
                return None;
            }
            if !is_registered(robot) {
                make_room(&mut robots, is_registered);
            }
        }
        let epochs = robots.entry(robot.clone()).or_insert_with(|| RobotEpochs::new(now));
        epochs.last_heard = now;
        let before = epochs.tokens;
        if appeared {
            epochs.tokens |= bit(slot);
        } else {
            epochs.tokens &= !bit(slot);
            if epochs.current.is_some_and(|(current, _)| alive_slot(current) == slot) {
                epochs.end_current(now);
            }
        }
        match (before, epochs.tokens) {
            (0, 1..) => Some(true),
            (1.., 0) => Some(false),
            _ => None,
        }
    }

    /// The last live epoch of a robot, if it has not ended.
    pub fn current(&self, robot: &Name) -> Option<u64> {
        self.lock().get(robot)?.current.map(|(epoch, _)| epoch)
    }

    /// The epochs of a robot now.
    pub fn status(&self, robot: &Name, now: Instant) -> Status {
        let robots = self.lock();
        let Some(epochs) = robots.get(robot) else { return Status::default() };
        let epoch = epochs.live(now);
        let conflict = epochs.refused.and_then(|r| {
            let ago = now.saturating_duration_since(r.last);
            let last_ms = u64::try_from(ago.as_millis()).unwrap_or(u64::MAX);
            (ago < CONFLICT_SHOWN).then_some(Conflict { epoch: r.epoch, refused: r.count, last_ms })
        });
        Status { alive: epoch.is_some() || epochs.tokens != 0, epoch, conflict }
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<Name, RobotEpochs>> {
        // No code inside can panic halfway through a change.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn bit(slot: u8) -> u16 {
    1 << (slot % ALIVE_SLOTS)
}

/// Makes room for one more robot that is not registered.
fn make_room(robots: &mut BTreeMap<Name, RobotEpochs>, is_registered: impl Fn(&Name) -> bool) {
    if robots.len() < MAX_UNREGISTERED {
        return;
    }
    let unregistered = || robots.iter().filter(|(name, _)| !is_registered(name));
    if unregistered().count() < MAX_UNREGISTERED {
        return;
    }
    let oldest = unregistered().min_by_key(|(_, epochs)| epochs.last_heard).map(|(name, _)| name.clone());
    oldest.map(|name| robots.remove(&name));
}

/// Epochs of one camera whose last number is remembered besides the present one's.
pub const PAST_EPOCHS: usize = 8;

/// The last sequence number of a stream in each of its latest epochs. [`Epochs`] decides which
/// epoch is live; one that comes back continues after its last number.
#[derive(Debug, Default)]
pub struct SequenceTracker {
    last: Option<(u64, u64)>,
    past: VecDeque<(u64, u64)>,
}

impl SequenceTracker {
    /// Numbers that are left out before (epoch, seq): messages that were sent and did not arrive.
    pub fn gap(&self, epoch: u64, seq: u64) -> u64 {
        self.last
            .filter(|(current, last)| *current == epoch && *last < seq)
            .map_or(0, |(_, last)| seq - last - 1)
    }

    /// Takes (epoch, seq) as the newest, or refuses it as not newer than the last of its epoch.
    pub fn advance(&mut self, epoch: u64, seq: u64) -> Result<(), Rejection> {
        let place = self.past.iter().position(|(past, _)| *past == epoch);
        let known = match self.last {
            Some((current, last)) if current == epoch => Some(last),
            _ => place.map(|i| self.past[i].1),
        };
        if let Some(last) = known.filter(|last| seq <= *last) {
            return Err(Rejection::new(Code::NotNewer, "seq", format!("{seq} is not newer than {last}")));
        }
        if let Some(current) = self.last.filter(|(current, _)| *current != epoch) {
            place.and_then(|i| self.past.remove(i));
            if self.past.len() == PAST_EPOCHS {
                self.past.pop_front();
            }
            self.past.push_back(current);
        }
        self.last = Some((epoch, seq));
        Ok(())
    }
}

#[cfg(test)]
mod tests;
