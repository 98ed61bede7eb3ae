//! Network, clock, workers and map of the simulation, and the model that they are compared with.

use super::{
    random::Random,
    robot::{DEADLINE_MS, FrameId, Packet, Robot},
};
use engine::{
    epochs::MESSAGE_LIVE,
    intake::{FrameJob, FrameKind, Intake},
    live::LiveHub,
    motion::MotionTracker,
    slots::{FrameOutcome, SlotKey, Slots},
    snapshot::{MapSnapshot, Snapshots},
};
use protos::{Code, Name, keys::alive_slot, v1};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, LazyLock},
    time::{Duration, Instant},
};

const ROBOTS: usize = 3;
/// Frames in work at a time.
const WORKERS: usize = 2;
/// Messages on their way at a time; more are lost.
const ON_THE_WAY: usize = 24;

/// One start of time for all worlds, so that they do not depend on the machine's clock.
static START: LazyLock<Instant> = LazyLock::new(|| Instant::now() + Duration::from_secs(1000));

/// A frame in work, with the snapshot that its answer rests on.
struct InWork {
    id: FrameId,
    is_late: bool,
    map: Arc<MapSnapshot>,
    /// Version at the beginning.
    version: u64,
}

/// How often each thing has happened.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Tally {
    processed: u64,
    superseded: u64,
    expired: u64,
    not_newer: u64,
    conflicts: u64,
    versions: u64,
    old_answers: u64,
}

impl Tally {
    pub(crate) fn add(&mut self, other: Self) {
        self.processed += other.processed;
        self.superseded += other.superseded;
        self.expired += other.expired;
        self.not_newer += other.not_newer;
        self.conflicts += other.conflicts;
        self.versions += other.versions;
        self.old_answers += other.old_answers;
    }

    pub(crate) fn all_happened(&self) -> bool {
        let Self { processed, superseded, expired, not_newer, conflicts, versions, old_answers } = *self;
        [processed, superseded, expired, not_newer, conflicts, versions, old_answers].iter().all(|n| *n > 20)
    }
}

/// What the model knows of a robot: the epoch that was last admitted and when, and its tokens.
#[derive(Default)]
struct Lives {
    current: Option<(u64, Instant)>,
    tokens: BTreeSet<u8>,
}

impl Lives {
    /// The epoch that alone is heard.
    fn live(&self, now: Instant) -> Option<u64> {
        let (epoch, at) = self.current?;
        let is_recent = now.saturating_duration_since(at) < MESSAGE_LIVE;
        (is_recent || self.tokens.contains(&alive_slot(epoch))).then_some(epoch)
    }

    /// The same for a message of this epoch: a token of its own slot may be its own.
    fn live_for(&self, epoch: u64, now: Instant) -> Option<u64> {
        let (current, at) = self.current?;
        let is_recent = now.saturating_duration_since(at) < MESSAGE_LIVE;
        let is_of_other = alive_slot(current) != alive_slot(epoch);
        self.live(now).filter(|_| is_recent || is_of_other)
    }

    /// Another epoch than this one may be live.
    fn is_contested(&self, epoch: u64, now: Instant) -> bool {
        let recent = |at: Instant| now.saturating_duration_since(at) < MESSAGE_LIVE;
        self.tokens.iter().any(|slot| *slot != alive_slot(epoch))
            || self.current.is_some_and(|(current, at)| current != epoch && recent(at))
    }
}

pub(crate) struct World {
    random: Random,
    now: Instant,
    intake: Intake,
    robots: Vec<Robot>,
    network: Vec<(Instant, Packet)>,
    in_work: Vec<InWork>,
    // The model.
    lives: BTreeMap<Name, Lives>,
    waiting: BTreeMap<SlotKey, (FrameId, Instant)>,
    accepted: BTreeMap<(SlotKey, u64), u64>,
    ended: BTreeSet<FrameId>,
    received: u64,
    refused: u64,
    version: u64,
    seen: Tally,
    is_told: bool,
}

fn map(version: u64) -> Arc<MapSnapshot> {
    // What an answer rests on says of which version it is.
    Arc::new(MapSnapshot { walls_version: version as i64, ..MapSnapshot::empty("hall", version) })
}

impl World {
    pub(crate) fn new(seed: u64, is_told: bool) -> Self {
        let mut random = Random::new(seed);
        let robots: Vec<_> = (0..ROBOTS).map(|n| Robot::new(n, &mut random)).collect();
        let snapshots = Arc::new(Snapshots::default());
        snapshots.publish(map(1));
        for robot in &robots {
            snapshots.set_robot(robot.name.as_str(), Some("hall"));
        }
        let motion = Arc::new(MotionTracker::new(snapshots.clone(), Arc::new(LiveHub::default())));
        let intake = Intake {
            slots: Arc::new(Slots::new(16, 64 << 20)),
            snapshots,
            motion,
            frame_bytes: 1000,
            deadline: Duration::from_millis(DEADLINE_MS),
            linked_maps_only: false,
        };
        let lives = robots.iter().map(|robot| (robot.name.clone(), Lives::default())).collect();
        Self {
            random,
            now: *START,
            intake,
            robots,
            network: Vec::new(),
            in_work: Vec::new(),
            lives,
            waiting: BTreeMap::new(),
            accepted: BTreeMap::new(),
            ended: BTreeSet::new(),
            received: 0,
            refused: 0,
            version: 1,
            seen: Tally { versions: 1, ..Tally::default() },
            is_told,
        }
    }

    pub(crate) fn seen(&self) -> Tally {
        self.seen
    }

    fn tell(&self, what: impl FnOnce() -> String) {
        if self.is_told {
            eprintln!("{:>8} ms  {}", (self.now - *START).as_millis(), what());
        }
    }

    /// One thing happens.
    pub(crate) fn step(&mut self) {
        match self.random.below(20) {
            0..7 => self.send(),
            7..12 => self.deliver(),
            12..15 => self.begin(),
            15..18 => self.finish(),
            18 => self.disturb(),
            _ => self.publish(),
        }
        let ms = if self.random.once_in(60) { 4000 } else { self.random.below(80) };
        self.now += Duration::from_millis(ms as u64);
    }

    /// A robot sends a frame: it is lost, delayed, or arrives twice. Delays differ, so messages
    /// overtake.
    fn send(&mut self) {
        let which = self.random.below(ROBOTS);
        let packet = self.robots[which].frame(&mut self.random);
        if !self.robots[which].is_connected && !self.random.once_in(4) {
            return;
        }
        let copies = [1, 1, 1, 1, 0, 2][self.random.below(6)];
        for _ in 0..copies {
            self.post(packet.clone());
        }
    }

    fn post(&mut self, packet: Packet) {
        let delay = if self.random.once_in(20) { 2500 } else { self.random.below(120) };
        if self.network.len() < ON_THE_WAY {
            self.network.push((self.now + Duration::from_millis(delay as u64), packet));
        }
    }

    /// A message that is due arrives.
    fn deliver(&mut self) {
        let Some(at) = self.network.iter().position(|(due, _)| *due <= self.now) else { return };
        match self.network.swap_remove(at).1 {
            Packet::Frame { id, deadline_ms, bytes } => self.receive(id, deadline_ms, bytes),
            Packet::Token { robot, epoch, appeared } => self.token(&robot, epoch, appeared),
        }
    }

    fn token(&mut self, robot: &Name, epoch: u64, appeared: bool) {
        self.tell(|| format!("token of {robot} {epoch:x} {}", if appeared { "appears" } else { "goes" }));
        self.intake.motion.epochs().token(robot, (alive_slot(epoch), appeared), self.now, |_| true);
        let lives = self.lives.get_mut(robot).expect("a robot of this world");
        if appeared {
            lives.tokens.insert(alive_slot(epoch));
        } else {
            lives.tokens.remove(&alive_slot(epoch));
            if lives.current.is_some_and(|(current, _)| alive_slot(current) == alive_slot(epoch)) {
                lives.current = None;
            }
        }
    }

    fn receive(&mut self, id: FrameId, deadline_ms: u64, bytes: protos::prost::bytes::Bytes) {
        let now = self.now;
        let key = id.key.clone();
        let last = self.accepted.get(&(key.clone(), id.epoch)).copied();
        let result = self.intake.take(FrameKind::Image, key.clone(), bytes, now);
        self.received += 1;
        self.tell(|| format!("{id:?}: {:?}", result.as_ref().err().map(|a| a.rejection.clone())));
        let lives = self.lives.get_mut(&key.robot).expect("a robot of this world");
        let contested = lives.is_contested(id.epoch, now);
        match result {
            Ok(()) => {
                assert!(last.is_none_or(|last| id.seq > last), "{id:?} is not newer than {last:?}");
                assert!(!self.ended.contains(&id), "{id:?} is accepted again after it has ended");
                let live = lives.live_for(id.epoch, now);
                assert!(live.is_none_or(|live| live == id.epoch), "{id:?}: epoch {live:x?} is live");
                lives.current = Some((id.epoch, now));
                self.accepted.insert((key.clone(), id.epoch), id.seq);
                let deadline = now + Duration::from_millis(deadline_ms);
                if let Some((old, _)) = self.waiting.insert(key, (id, deadline)) {
                    assert!(self.ended.insert(old), "superseded after its end");
                    self.seen.superseded += 1;
                }
            }
            Err(answer) => {
                self.refused += 1;
                let v1::Rejection { code, field, .. } = answer.rejection.expect("a reason");
                if field == "seq" {
                    // Its epoch was admitted before its number was refused.
                    lives.current = Some((id.epoch, now));
                }
                let is = |is: Code| code == is.as_str();
                self.seen.not_newer += u64::from(is(Code::NotNewer));
                self.seen.conflicts += u64::from(is(Code::EpochConflict));
                assert!(is(Code::NotNewer) || is(Code::EpochConflict), "{id:?}: {code}");
                // A robot whose program alone is there, and whose frame is newer, is heard.
                let is_newer = last.is_none_or(|last| id.seq > last);
                let is_alone = lives.tokens.contains(&alive_slot(id.epoch)) && !contested;
                assert!(!(is_newer && is_alone), "{id:?} of the only program of its robot: {code}");
            }
        }
    }

    /// A worker takes a frame and the snapshot that its answer will rest on.
    fn begin(&mut self) {
        if self.in_work.len() == WORKERS {
            return;
        }
        let Some((key, job)) = self.intake.slots.try_take() else {
            let idle = self.waiting.keys().all(|key| self.in_work.iter().any(|work| work.id.key == *key));
            assert!(idle, "a frame waits, its camera is free, and no worker gets it");
            return;
        };
        let (id, deadline) = self.waiting.remove(&key).expect("only what waits is taken");
        let FrameJob { frame, .. } = &job;
        assert_eq!((id.epoch, id.seq), (frame.epoch, frame.seq), "the newest wins");
        assert!(self.in_work.iter().all(|work| work.id.key != key), "two frames of a camera in work");
        let is_late = job.is_late(self.now);
        assert_eq!(is_late, self.now > deadline, "nothing begins after its deadline");
        let map = self.intake.snapshots.get("hall").expect("the map is there");
        assert_eq!(map.version, self.version, "every acknowledged version is seen");
        self.tell(|| format!("{id:?} in work, late: {is_late}"));
        self.in_work.push(InWork { id, is_late, version: map.version, map });
    }

    /// A worker ends its frame.
    fn finish(&mut self) {
        if self.in_work.is_empty() {
            return;
        }
        let which = self.random.below(self.in_work.len());
        let InWork { id, is_late, map, version } = self.in_work.swap_remove(which);
        assert_eq!((map.version, map.walls_version as u64), (version, version), "an answer mixes versions");
        self.seen.old_answers += u64::from(version < self.version);
        let outcome = if is_late { FrameOutcome::Expired } else { FrameOutcome::Processed };
        self.intake.slots.finish(&id.key, outcome);
        self.seen.expired += u64::from(is_late);
        self.seen.processed += u64::from(!is_late);
        assert!(self.ended.insert(id.clone()), "{id:?} ends twice");
    }

    /// A link breaks or comes back, or a program starts again, with or without a farewell.
    fn disturb(&mut self) {
        let which = self.random.below(ROBOTS);
        let robot = &mut self.robots[which];
        if robot.is_connected {
            let farewell = robot.token(false);
            robot.is_connected = false;
            if self.random.once_in(2) {
                robot.restart(&mut self.random);
            }
            self.post(farewell);
        } else {
            robot.is_connected = true;
            let hello = robot.token(true);
            self.post(hello);
        }
    }

    /// A commit is published: the next version.
    fn publish(&mut self) {
        self.version += 1;
        self.seen.versions += 1;
        self.intake.snapshots.publish(map(self.version));
    }

    /// Compares the counters with the model.
    pub(crate) fn check(&self) {
        let counts = self.intake.slots.counts();
        assert_eq!(counts.missing(), 0, "{counts:?}");
        assert_eq!(
            (counts.received, counts.rejected_total(), counts.superseded, counts.expired, counts.processed),
            (self.received, self.refused, self.seen.superseded, self.seen.expired, self.seen.processed)
        );
        assert_eq!(
            (counts.waiting, counts.in_work),
            (self.waiting.len() as u64, self.in_work.len() as u64),
            "{counts:?}"
        );
    }

    /// The load stops: everything that was accepted ends.
    pub(crate) fn settle(&mut self) {
        while !self.waiting.is_empty() || !self.in_work.is_empty() {
            self.begin();
            self.finish();
            self.check();
        }
        assert_eq!(self.ended.len() as u64 + self.refused, self.received);
    }
}
