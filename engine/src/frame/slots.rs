//! One slot per robot and camera: one frame in work, one waiting, the newest wins. In: frames in
//! any order and at any rate. Out: work, in turns of the robots and then of the cameras of each, so
//! that no robot starves another. Every frame ends in exactly one of processed, superseded,
//! expired, rejected, and the counts say so at every moment. Knows no vision and no transport; time
//! is passed in.

mod turns;

use crate::{epochs::SequenceTracker, limits::MAX_ROBOTS};
use protos::{Code, Name, Rejection};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Condvar, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};
use turns::{Turn, Turns};

/// Work that takes memory while it waits.
pub trait Held {
    /// What it takes, bytes.
    fn held_bytes(&self) -> usize;
}

/// Cameras of one robot.
pub const MAX_CAMERAS_PER_ROBOT: usize = 8;
/// A slot without a frame for this long may be replaced by a camera of another robot; its order is
/// forgotten then.
pub const IDLE_SLOT: Duration = Duration::from_mins(10);
/// A robot with all the cameras that it may have: a new one replaces the one with the oldest frame,
/// if that is this old.
pub const IDLE_CAMERA: Duration = Duration::from_secs(5);

/// A robot and one of its cameras.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct SlotKey {
    /// The robot.
    pub robot: Name,
    /// Its camera.
    pub camera: Name,
}

/// How the work on a frame ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameOutcome {
    /// Answered.
    Processed,
    /// Too old when its turn came.
    Expired,
    /// Refused after it was taken, such as an image that cannot be decoded.
    Rejected(Code),
}

/// Counts of all frames. `received` is the sum of the others at every time.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct FrameCounts {
    /// Every frame that arrived.
    pub received: u64,
    /// Answered.
    pub processed: u64,
    /// Replaced by a newer one while waiting.
    pub superseded: u64,
    /// Too old when their turn came, or still waiting at shutdown.
    pub expired: u64,
    /// Refused, by code.
    pub rejected: BTreeMap<Code, u64>,
    /// Waiting now.
    pub waiting: u64,
    /// In work now.
    pub in_work: u64,
}

impl FrameCounts {
    /// Refused, all codes.
    pub fn rejected_total(&self) -> u64 {
        self.rejected.values().sum()
    }

    /// `received` less the sum of the others: 0, or frames were lost.
    pub fn missing(&self) -> i128 {
        let ended = self.processed + self.superseded + self.expired + self.rejected_total();
        i128::from(self.received) - i128::from(ended + self.waiting + self.in_work)
    }
}

/// Frames whose numbers were left out: sent, and lost on the way.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct MissedFrames {
    /// Of all robots.
    pub total: u64,
    /// By robot, at most [`MAX_ROBOTS`].
    pub by_robot: BTreeMap<Name, u64>,
}

impl MissedFrames {
    fn add(&mut self, robot: &Name, count: u64) {
        self.total += count;
        if let Some(all) = self.by_robot.get_mut(robot) {
            *all += count;
        } else if self.by_robot.len() < MAX_ROBOTS {
            self.by_robot.insert(robot.clone(), count);
        }
    }
}

#[derive(Debug)]
struct Slot<T> {
    waiting: Option<T>,
    /// Bytes of the frame in work.
    work_bytes: usize,
    in_work: bool,
    queued: bool,
    order: SequenceTracker,
    touched: Instant,
    /// Number of its last turn.
    last_turn: u64,
    /// The turn of the frame in work, and the number of this camera's turn before it.
    turn: (Turn, u64),
}

impl<T> Slot<T> {
    fn new(now: Instant) -> Self {
        Self {
            waiting: None,
            work_bytes: 0,
            in_work: false,
            queued: false,
            order: SequenceTracker::default(),
            touched: now,
            last_turn: 0,
            turn: (Turn::default(), 0),
        }
    }
}

#[derive(Debug)]
struct State<T> {
    slots: BTreeMap<SlotKey, Slot<T>>,
    ready: Turns,
    /// Bytes of all frames that wait or are in work.
    held_bytes: usize,
    counts: FrameCounts,
    missed: MissedFrames,
    closed: bool,
}

/// The slots of all cameras.
#[derive(Debug)]
pub struct Slots<T> {
    state: Mutex<State<T>>,
    ready: Condvar,
    limit: usize,
    max_bytes: usize,
}

impl<T: Held> Slots<T> {
    /// At most `max_slots` cameras over all robots, whose frames that wait or are in work take at
    /// most `max_bytes`.
    pub fn new(max_slots: usize, max_bytes: usize) -> Self {
        let state = State {
            slots: BTreeMap::new(),
            ready: Turns::default(),
            held_bytes: 0,
            counts: FrameCounts::default(),
            missed: MissedFrames::default(),
            closed: false,
        };
        Self { state: Mutex::new(state), ready: Condvar::new(), limit: max_slots, max_bytes }
    }

    /// Puts a frame in its slot; the one that waited there is superseded. Never waits for work.
    /// Errors: the frame is not newer than the last of its camera, there are too many cameras, or
    /// the frames of all take too much memory.
    pub fn offer(&self, key: SlotKey, order: (u64, u64), job: T, now: Instant) -> Result<(), Rejection> {
        let mut guard = self.lock();
        let state = &mut *guard;
        state.counts.received += 1;
        if state.closed {
            return state.refuse(Rejection::new(Code::Expired, "", "the server is shutting down"));
        }
        if !state.slots.contains_key(&key)
            && let Err(refusal) = state.make_room(&key, self.limit, now)
        {
            return state.refuse(refusal);
        }
        let slot = state.slots.entry(key.clone()).or_insert_with(|| Slot::new(now));
        let gap = slot.order.gap(order.0, order.1);
        if let Err(refusal) = slot.order.advance(order.0, order.1) {
            return state.refuse(refusal);
        }
        if gap > 0 {
            state.missed.add(&key.robot, gap);
        }
        slot.touched = now;
        let replaced = slot.waiting.as_ref().map_or(0, Held::held_bytes);
        let held = state.held_bytes - replaced + job.held_bytes();
        if held > self.max_bytes {
            let most = self.max_bytes;
            let detail = format!("frames that wait take more than {most} bytes (limits.waiting_frame_bytes)");
            return state.refuse(Rejection::new(Code::Overloaded, "frame", detail));
        }
        state.held_bytes = held;
        if slot.waiting.replace(job).is_some() {
            state.counts.superseded += 1;
        } else {
            state.counts.waiting += 1;
        }
        if !slot.in_work && !slot.queued {
            slot.queued = true;
            state.ready.push(key, slot.last_turn);
            self.ready.notify_one();
        }
        Ok(())
    }

    /// Counts a frame that was refused before it reached a slot.
    pub fn refuse(&self, code: Code) {
        let counts = &mut self.lock().counts;
        counts.received += 1;
        *counts.rejected.entry(code).or_default() += 1;
    }

    /// The next frame in turn; waits for one. `None` after [`Slots::close`]. Every frame taken is
    /// given back to [`Slots::finish`].
    pub fn take(&self) -> Option<(SlotKey, T)> {
        let mut state = self.lock();
        loop {
            if state.closed {
                return None;
            }
            if let Some(work) = state.next() {
                return Some(work);
            }
            state = self.ready.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// The next frame in turn, if there is one now.
    pub fn try_take(&self) -> Option<(SlotKey, T)> {
        self.lock().next()
    }

    /// Ends the work on the frame last taken from this slot; its next frame queues behind the
    /// others.
    pub fn finish(&self, key: &SlotKey, outcome: FrameOutcome) {
        let mut guard = self.lock();
        let state = &mut *guard;
        let Some(slot) = state.slots.get_mut(key).filter(|slot| slot.in_work) else { return };
        slot.in_work = false;
        state.held_bytes -= std::mem::take(&mut slot.work_bytes);
        state.counts.in_work -= 1;
        match outcome {
            FrameOutcome::Processed => state.counts.processed += 1,
            FrameOutcome::Expired => {
                state.counts.expired += 1;
                // Otherwise, with more robots than are served in time, the same ones would be
                // served again and again.
                let (turn, before) = slot.turn;
                slot.last_turn = before;
                state.ready.give_back(&key.robot, turn);
            }
            FrameOutcome::Rejected(code) => *state.counts.rejected.entry(code).or_default() += 1,
        }
        if slot.waiting.is_some() && !slot.queued {
            slot.queued = true;
            state.ready.push(key.clone(), slot.last_turn);
            self.ready.notify_one();
        }
    }

    /// Counts of all frames so far.
    pub fn counts(&self) -> FrameCounts {
        self.lock().counts.clone()
    }

    /// Frames that wait now.
    pub fn waiting(&self) -> u64 {
        self.lock().counts.waiting
    }

    /// Frames that were sent and did not arrive, by their numbers.
    pub fn missed(&self) -> MissedFrames {
        self.lock().missed.clone()
    }

    /// For how long the oldest frame has waited that waits now.
    pub fn oldest_wait(&self, now: Instant) -> Option<Duration> {
        let state = self.lock();
        let waiting = state.slots.values().filter(|slot| slot.waiting.is_some());
        // The newest frame is the one that waits, so its slot was touched when it came.
        waiting.map(|slot| now.saturating_duration_since(slot.touched)).max()
    }

    /// Cameras with a slot.
    pub fn cameras(&self) -> usize {
        self.lock().slots.len()
    }

    /// Bytes of the frames that wait or are in work.
    pub fn held_bytes(&self) -> usize {
        self.lock().held_bytes
    }

    /// Ends the wait of every worker; frames that wait are counted as expired.
    pub fn close(&self) {
        let mut guard = self.lock();
        let state = &mut *guard;
        state.closed = true;
        for slot in state.slots.values_mut() {
            if let Some(job) = slot.waiting.take() {
                state.held_bytes -= job.held_bytes();
                state.counts.waiting -= 1;
                state.counts.expired += 1;
            }
            slot.queued = false;
        }
        state.ready.clear();
        self.ready.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, State<T>> {
        // No code inside can panic halfway through a change.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T: Held> State<T> {
    fn refuse(&mut self, refusal: Rejection) -> Result<(), Rejection> {
        *self.counts.rejected.entry(refusal.code).or_default() += 1;
        Err(refusal)
    }

    fn next(&mut self) -> Option<(SlotKey, T)> {
        while let Some((key, turn)) = self.ready.pop() {
            let Some(slot) = self.slots.get_mut(&key) else { continue };
            slot.queued = false;
            if let Some(job) = slot.waiting.take() {
                slot.turn = (turn, slot.last_turn);
                slot.last_turn = turn.number;
                (slot.in_work, slot.work_bytes) = (true, job.held_bytes());
                self.counts.waiting -= 1;
                self.counts.in_work += 1;
                return Some((key, job));
            }
        }
        None
    }

    /// Makes room for one more slot: removes slots that have been idle for [`IDLE_SLOT`], and if
    /// need be the robot's camera that has been idle longest, for at least [`IDLE_CAMERA`].
    fn make_room(&mut self, key: &SlotKey, max_slots: usize, now: Instant) -> Result<(), Rejection> {
        let of_robot =
            |slots: &BTreeMap<SlotKey, Slot<T>>| slots.keys().filter(|k| k.robot == key.robot).count();
        if self.slots.len() >= max_slots || of_robot(&self.slots) >= MAX_CAMERAS_PER_ROBOT {
            self.slots.retain(|_, s| {
                s.in_work || s.waiting.is_some() || now.saturating_duration_since(s.touched) < IDLE_SLOT
            });
            let robots: BTreeSet<&Name> = self.slots.keys().map(|key| &key.robot).collect();
            self.ready.of_robots.retain(|robot, _| robots.contains(robot));
        }
        if of_robot(&self.slots) >= MAX_CAMERAS_PER_ROBOT {
            let idle = |s: &Slot<T>| {
                let free = !s.in_work && s.waiting.is_none();
                free && now.saturating_duration_since(s.touched) >= IDLE_CAMERA
            };
            let own = self.slots.iter().filter(|(k, s)| k.robot == key.robot && idle(s));
            let oldest = own.min_by_key(|(_, s)| s.touched).map(|(k, _)| k.clone());
            oldest.map(|k| self.slots.remove(&k));
        }
        if of_robot(&self.slots) >= MAX_CAMERAS_PER_ROBOT {
            let detail = format!("a robot has at most {MAX_CAMERAS_PER_ROBOT} cameras at a time");
            return Err(Rejection::new(Code::TooMany, "camera", detail));
        }
        if self.slots.len() >= max_slots {
            let detail = format!("the server has at most {max_slots} cameras at a time");
            return Err(Rejection::new(Code::TooMany, "camera", detail));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
