//! The intake of frames. In: bytes of a robot on the key of a camera. Out: the frame in its slot,
//! or a refusal as the answer to publish at once. It checks everything but the pixels, and never
//! waits: it runs on the transport's threads.

use super::slots::{Held, SlotKey, Slots};
use crate::{
    motion::MotionTracker,
    quotas::Kind,
    snapshot::{MapSnapshot, Snapshots},
};
use protos::{
    CheckedFrame, Code, Name, Rejection,
    named_map::{self, FrameHead},
    prost::{Message, bytes::Bytes},
    v1,
};
use std::{
    sync::Arc,
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

/// A capture time further from the server's clock is flagged.
pub const CLOCK_TOLERANCE: Duration = Duration::from_secs(2);

/// A frame that waits for a worker.
#[derive(Debug)]
pub struct FrameJob {
    /// The frame, checked but for its pixels.
    pub frame: CheckedFrame,
    /// The map to recognise against.
    pub map: String,
    /// Time of receipt.
    pub received: Instant,
    /// Work does not begin later.
    pub deadline: Instant,
    /// The robot's clock is off, or the capture time does not fit the robot's other messages.
    pub clock_suspect: bool,
    /// Present if the capture time does not fit the robot's other messages and must not be used:
    /// what the robot's clock showed at receipt, ns.
    pub stamp_instead_ns: Option<i64>,
    /// Bytes of its message.
    pub message_bytes: usize,
}

impl Held for FrameJob {
    /// The image is a part of the message, which is held as a whole.
    fn held_bytes(&self) -> usize {
        self.message_bytes
    }
}

impl FrameJob {
    /// Whether it is too late to begin the work.
    pub fn is_late(&self, now: Instant) -> bool {
        now > self.deadline
    }
}

/// Takes frames in.
#[derive(Debug)]
pub struct Intake {
    /// Where frames wait.
    pub slots: Arc<Slots<FrameJob>>,
    /// Maps, and the map of each robot.
    pub snapshots: Arc<Snapshots>,
    /// The live epoch and the clock of each robot.
    pub motion: Arc<MotionTracker>,
    /// Largest message, in bytes.
    pub frame_bytes: usize,
    /// Deadline of frames that name none.
    pub deadline: Duration,
    /// Whether robots are tied to certificates. Then a frame may name the robot's map and maps
    /// linked with it alone; others look as if they did not exist.
    pub linked_maps_only: bool,
}

impl Intake {
    /// Puts a frame in its slot, or counts its refusal and gives the answer that says why. Quads
    /// have the slot of their camera's frames, and one numbering with them.
    pub fn take(
        &self,
        kind: FrameKind,
        key: SlotKey,
        message: Bytes,
        received: Instant,
    ) -> Result<(), Box<v1::Answer>> {
        let mut echo = v1::Answer { status: v1::Status::Rejected.into(), ..v1::Answer::default() };
        let checked = match kind {
            FrameKind::Image => self.check::<v1::Frame>(&key, message, received, &mut echo),
            FrameKind::Quads => self.check::<v1::Quads>(&key, message, received, &mut echo),
        };
        let taken = match checked {
            // The slot counts its own refusals.
            Ok(job) => self.slots.offer(key, (job.frame.epoch, job.frame.seq), job, received),
            Err(refusal) => {
                self.slots.refuse(refusal.code);
                Err(refusal)
            }
        };
        taken.map_err(|refusal| Box::new(v1::Answer { rejection: Some((&refusal).into()), ..echo }))
    }

    /// A `Frame` that is received now.
    #[cfg(test)]
    pub(super) fn receive(&self, key: SlotKey, message: Bytes) -> Result<(), Box<v1::Answer>> {
        self.take(FrameKind::Image, key, message, Instant::now())
    }

    fn check<M: FrameMessage>(
        &self,
        key: &SlotKey,
        message: Bytes,
        received: Instant,
        echo: &mut v1::Answer,
    ) -> Result<FrameJob, Rejection> {
        if message.len() > self.frame_bytes {
            let detail =
                format!("{} bytes are more than {} (limits.frame_bytes)", message.len(), self.frame_bytes);
            // By these numbers the sender knows which of its frames it is.
            let head = M::KIND.head(&message);
            (echo.epoch, echo.seq, echo.captured_ns) = (head.epoch, head.seq, head.captured_ns);
            return Err(Rejection::new(Code::TooLarge, M::FIELD, detail));
        }
        let message_bytes = message.len();
        let frame = M::decode(message).map_err(|e| {
            Rejection::new(Code::BadMessage, M::FIELD, format!("no {} message: {e}", M::NAME))
        })?;
        (echo.epoch, echo.seq, echo.captured_ns) = frame.numbers();
        let robot_map = self.robot_map(&key.robot)?;
        self.motion.quotas().take(&key.robot, Kind::Frame, message_bytes, received)?;
        let frame: CheckedFrame = frame.try_into()?;
        self.motion.epochs().admit(&key.robot, frame.epoch, received)?;
        let map = frame.map.as_ref().map_or_else(|| robot_map.clone(), ToString::to_string);
        echo.map.clone_from(&map);
        self.open_map(&robot_map, &map)?;
        let wait = frame.deadline_ms.map_or(self.deadline, |ms| Duration::from_millis(u64::from(ms)));
        let stamp = self.motion.frame_stamp((&key.robot, &key.camera), &map, &frame, received);
        let stamp_instead_ns = stamp.err();
        let clock_suspect = clock_suspect(frame.captured_ns) || stamp_instead_ns.is_some();
        Ok(FrameJob {
            frame,
            map,
            received,
            deadline: received + wait,
            clock_suspect,
            stamp_instead_ns,
            message_bytes,
        })
    }

    /// The map of a robot, by its registration.
    pub fn robot_map(&self, robot: &Name) -> Result<String, Rejection> {
        self.snapshots.robot_map(robot.as_str()).ok_or_else(|| {
            let detail = format!("robot {robot} is not registered: PUT /api/v1/robots/{robot}");
            Rejection::new(Code::UnknownRobot, "robot", detail)
        })
    }

    /// A map that a robot of `robot_map` may name.
    pub fn open_map(&self, robot_map: &str, map: &str) -> Result<Arc<MapSnapshot>, Rejection> {
        let is_open =
            !self.linked_maps_only || map == robot_map || self.snapshots.relation(robot_map, map).is_some();
        self.snapshots.for_robots(map).filter(|_| is_open).ok_or_else(|| unknown_map(map))
    }
}

/// What a robot sends of one camera image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameKind {
    /// `Frame`: the image.
    Image,
    /// `Quads`: what the robot's own detector found in it.
    Quads,
}

impl FrameKind {
    /// What a message says of itself, without its pixels.
    pub fn head(self, message: &[u8]) -> FrameHead {
        match self {
            Self::Image => named_map::of_frame(message),
            Self::Quads => named_map::of_quads(message),
        }
    }
}

/// The answer to a message that was not taken in.
pub fn refusal_unread(head: &FrameHead, reason: &Rejection) -> v1::Answer {
    let FrameHead { epoch, seq, captured_ns, .. } = *head;
    let (status, rejection) = (v1::Status::Rejected.into(), Some(reason.into()));
    v1::Answer { epoch, seq, captured_ns, status, rejection, ..v1::Answer::default() }
}

/// A message of a camera image.
trait FrameMessage: Message + Default + TryInto<CheckedFrame, Error = Rejection> {
    const KIND: FrameKind;
    /// Its name in the .proto.
    const NAME: &'static str;
    /// The message as a whole in refusals.
    const FIELD: &'static str;
    /// Epoch, sequence number and capture time, ns.
    fn numbers(&self) -> (u64, u64, i64);
}

impl FrameMessage for v1::Frame {
    const KIND: FrameKind = FrameKind::Image;
    const NAME: &'static str = "Frame";
    const FIELD: &'static str = "frame";
    fn numbers(&self) -> (u64, u64, i64) {
        (self.epoch, self.seq, self.captured_ns)
    }
}

impl FrameMessage for v1::Quads {
    const KIND: FrameKind = FrameKind::Quads;
    const NAME: &'static str = "Quads";
    const FIELD: &'static str = "quads";
    fn numbers(&self) -> (u64, u64, i64) {
        (self.epoch, self.seq, self.captured_ns)
    }
}

/// The refusal for a map that does not exist.
pub fn unknown_map(map: &str) -> Rejection {
    Rejection::new(Code::UnknownMap, "map", format!("there is no map {map}"))
}

/// Whether a capture time is further than [`CLOCK_TOLERANCE`] from this machine's clock. It is
/// reported, and changes nothing.
fn clock_suspect(captured_ns: i64) -> bool {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    (i128::from(captured_ns) - now.as_nanos() as i128).unsigned_abs() > CLOCK_TOLERANCE.as_nanos()
}

#[cfg(test)]
mod tests;
