//! What pages show: the last frame and answer of each camera, tracks of each robot, and a stream of events. In: what
//! the bus and the workers saw. Out: copies for readers, who never hold up a worker: a slow reader misses events.
//! Nothing here is kept on disk, and every collection is bounded.

use map::pose2::{Pose2, Pose2Covariance};
use protos::{
    Name,
    convert::{Encoding, geometry::pose2_wire},
    prost::bytes::Bytes,
    v1,
};
use serde::{Serialize, Serializer};
use std::{
    collections::{BTreeMap, VecDeque},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};
use tokio::sync::broadcast;

use super::{cameras::CameraRegistry, slots::SlotKey};
use crate::limits::MAX_ROBOTS;

/// Cameras whose last frame is kept; the one longest without a frame gives way.
pub const MAX_CAMERAS: usize = 32;
/// Robots whose tracks are kept; the one longest without a pose gives way.
pub const MAX_TRACKS: usize = 256;
/// Points of one track; the oldest give way.
pub const MAX_TRACK_POINTS: usize = 2000;
/// Events that a reader may be behind before it misses the oldest.
pub const EVENTS_KEPT: usize = 512;

/// The last frame of a camera, as it came.
#[derive(Debug, Clone)]
pub struct LiveFrame {
    /// How it is packed.
    pub encoding: Encoding,
    /// Width.
    pub width_px: u32,
    /// Height.
    pub height_px: u32,
    /// Encoded image.
    pub image: Bytes,
    /// What was answered.
    pub answer: Arc<v1::Answer>,
}

impl LiveFrame {
    /// The image in a form that browsers show: its media type and bytes. Raw grey becomes PNG.
    pub fn for_browsers(&self) -> Result<(&'static str, Bytes), image::ImageError> {
        match self.encoding {
            Encoding::Jpeg => Ok(("image/jpeg", self.image.clone())),
            Encoding::Png => Ok(("image/png", self.image.clone())),
            Encoding::Gray8 => {
                let mut out = Vec::new();
                let encoder = image::codecs::png::PngEncoder::new(&mut out);
                let (width, height) = (self.width_px, self.height_px);
                let gray = image::ExtendedColorType::L8;
                image::ImageEncoder::write_image(encoder, &self.image, width, height, gray)?;
                Ok(("image/png", out.into()))
            }
        }
    }
}

/// Where a robot was, by source; oldest first.
#[derive(Debug, Clone, Default)]
pub struct Trajectories {
    /// Odometry, laid on the map at the robot's first known pose.
    pub odometry: VecDeque<Pose2>,
    /// Fused poses.
    pub pose: VecDeque<Pose2>,
    /// The truth, where a simulator tells it.
    pub truth: VecDeque<Pose2>,
}

/// Which track a pose belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrajectoryKind {
    /// Odometry.
    Odometry,
    /// Fused.
    Pose,
    /// Simulator's truth.
    Truth,
}

/// Something happened. In JSON: the fields of the variant, without its name; [`LiveEvent::kind`] is the event's name.
#[derive(Debug, Clone, Serialize)]
#[serde(untagged)]
pub enum LiveEvent {
    /// A frame was answered.
    Answer {
        /// Robot.
        robot: Name,
        /// Its camera.
        camera: Name,
        /// What was answered, the map's name included.
        answer: Arc<v1::Answer>,
    },
    /// A fused pose.
    Pose {
        /// Robot.
        robot: Name,
        /// In this map.
        map: String,
        /// Where it is.
        pose: v1::Pose2,
        /// Over (x, y, theta), row-major.
        covariance: Vec<f64>,
        /// Corrections by landmarks so far.
        corrections: u64,
        /// From the capture of what supports it to its publication.
        age_ms: f64,
        /// How far it is trusted.
        #[serde(serialize_with = "trust_word")]
        trust: v1::PoseTrust,
    },
    /// Odometry, laid on the map.
    Odometry {
        /// Robot.
        robot: Name,
        /// In this map.
        map: String,
        /// Where odometry alone says it is.
        pose: v1::Pose2,
    },
    /// A simulator's truth.
    Truth {
        /// Robot.
        robot: Name,
        /// In this map.
        map: String,
        /// Where it really is.
        pose: v1::Pose2,
    },
    /// A robot came or went.
    Presence {
        /// Robot.
        robot: Name,
        /// Its map, if it has one.
        map: String,
        /// Came, or went.
        alive: bool,
    },
    /// A map has a new version, or is gone.
    MapChanged {
        /// Map.
        map: String,
        /// New version; absent when deleted.
        version: Option<u64>,
    },
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn trust_word<S: Serializer>(trust: &v1::PoseTrust, to: S) -> Result<S::Ok, S::Error> {
    protos::json::pose_trust::serialize(&i32::from(*trust), to)
}

impl LiveEvent {
    /// Name of the event in a stream of events.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Answer { .. } => "answer",
            Self::Pose { .. } => "pose",
            Self::Odometry { .. } => "odometry",
            Self::Truth { .. } => "truth",
            Self::Presence { .. } => "presence",
            Self::MapChanged { .. } => "map_changed",
        }
    }

    /// The map it belongs to.
    pub fn map(&self) -> &str {
        match self {
            Self::Answer { answer, .. } => &answer.map,
            Self::Pose { map, .. }
            | Self::Odometry { map, .. }
            | Self::Truth { map, .. }
            | Self::Presence { map, .. }
            | Self::MapChanged { map, .. } => map,
        }
    }
}

#[derive(Debug, Default)]
struct State {
    /// With the count of frames at its last frame: the smallest is the stalest.
    frames: BTreeMap<SlotKey, (u64, LiveFrame)>,
    tracks: BTreeMap<Name, (u64, Trajectories)>,
    /// Of each robot's last published pose: the map it is in, and how far it is trusted.
    trust: BTreeMap<Name, (String, v1::PoseTrust)>,
    ticks: u64,
}

/// The last of everything, and the stream of events.
#[derive(Debug)]
pub struct LiveHub {
    state: Mutex<State>,
    events: broadcast::Sender<Arc<LiveEvent>>,
    watched: CameraRegistry,
}

impl Default for LiveHub {
    fn default() -> Self {
        Self {
            state: Mutex::default(),
            events: broadcast::channel(EVENTS_KEPT).0,
            watched: CameraRegistry::default(),
        }
    }
}

impl LiveHub {
    /// What frames say of the cameras they come from.
    pub fn watched(&self) -> &CameraRegistry {
        &self.watched
    }

    /// Events from now on. A reader more than [`EVENTS_KEPT`] behind is told that it missed some.
    pub fn events(&self) -> broadcast::Receiver<Arc<LiveEvent>> {
        self.events.subscribe()
    }

    /// The last answered frame of a camera.
    pub fn frame(&self, robot: &Name, camera: &Name) -> Option<LiveFrame> {
        let key = SlotKey { robot: robot.clone(), camera: camera.clone() };
        self.lock().frames.get(&key).map(|(_, frame)| frame.clone())
    }

    /// Cameras that have sent a frame, of one robot.
    pub fn cameras(&self, robot: &Name) -> Vec<Name> {
        let state = self.lock();
        state.frames.keys().filter(|k| k.robot == *robot).map(|k| k.camera.clone()).collect()
    }

    /// Tracks of a robot so far.
    pub fn tracks(&self, robot: &Name) -> Option<Trajectories> {
        self.lock().tracks.get(robot).map(|(_, tracks)| tracks.clone())
    }

    /// How far a robot's last published pose is trusted, if that is on this map.
    pub fn trust(&self, robot: &Name, map: &str) -> Option<v1::PoseTrust> {
        let state = self.lock();
        state.trust.get(robot).filter(|(on, _)| on == map).map(|(_, trust)| *trust)
    }

    /// Keeps the frame as its camera's last and tells of its answer.
    pub fn answered(&self, key: &SlotKey, frame: LiveFrame) {
        let answer = frame.answer.clone();
        {
            let mut guard = self.lock();
            let state = &mut *guard;
            state.ticks += 1;
            state.frames.insert(key.clone(), (state.ticks, frame));
            if state.frames.len() > MAX_CAMERAS {
                let stalest = state.frames.iter().min_by_key(|(_, (tick, _))| *tick).map(|(k, _)| k.clone());
                stalest.map(|k| state.frames.remove(&k));
            }
        }
        self.tell(LiveEvent::Answer { robot: key.robot.clone(), camera: key.camera.clone(), answer });
    }

    /// Tells of an answer to a frame that cannot be shown.
    pub fn refused(&self, key: &SlotKey, answer: Arc<v1::Answer>) {
        self.tell(LiveEvent::Answer { robot: key.robot.clone(), camera: key.camera.clone(), answer });
    }

    /// A fused pose, with the corrections so far, its age, and how far it is trusted.
    pub fn fused(
        &self,
        robot: &Name,
        map: &str,
        pose: &Pose2Covariance,
        (corrections, age_ms): (u64, f64),
        trust: v1::PoseTrust,
    ) {
        self.extend(robot, TrajectoryKind::Pose, pose.pose);
        self.trusted(robot, map, trust);
        self.tell(LiveEvent::Pose {
            robot: robot.clone(),
            map: map.to_owned(),
            pose: pose2_wire(&pose.pose),
            covariance: pose.covariance.transpose().as_slice().to_vec(),
            corrections,
            age_ms,
            trust,
        });
    }

    /// Odometry laid on the map.
    pub fn odometry(&self, robot: &Name, map: &str, map_from_robot: Pose2) {
        self.extend(robot, TrajectoryKind::Odometry, map_from_robot);
        let pose = pose2_wire(&map_from_robot);
        self.tell(LiveEvent::Odometry { robot: robot.clone(), map: map.to_owned(), pose });
    }

    /// Where a simulated robot really is.
    pub fn truth(&self, robot: &Name, map: &str, map_from_robot: Pose2) {
        self.extend(robot, TrajectoryKind::Truth, map_from_robot);
        let pose = pose2_wire(&map_from_robot);
        self.tell(LiveEvent::Truth { robot: robot.clone(), map: map.to_owned(), pose });
    }

    /// A robot came or went.
    pub fn presence(&self, robot: &Name, map: Option<String>, alive: bool) {
        self.tell(LiveEvent::Presence { robot: robot.clone(), map: map.unwrap_or_default(), alive });
    }

    /// A map changed.
    pub fn map_changed(&self, map: String, version: Option<u64>) {
        self.tell(LiveEvent::MapChanged { map, version });
    }

    fn trusted(&self, robot: &Name, map: &str, trust: v1::PoseTrust) {
        let mut state = self.lock();
        if state.trust.len() < MAX_ROBOTS || state.trust.contains_key(robot) {
            state.trust.insert(robot.clone(), (map.to_owned(), trust));
        }
    }

    fn extend(&self, robot: &Name, kind: TrajectoryKind, pose: Pose2) {
        let mut guard = self.lock();
        let state = &mut *guard;
        state.ticks += 1;
        let (tick, tracks) = state.tracks.entry(robot.clone()).or_default();
        *tick = state.ticks;
        let track = match kind {
            TrajectoryKind::Odometry => &mut tracks.odometry,
            TrajectoryKind::Pose => &mut tracks.pose,
            TrajectoryKind::Truth => &mut tracks.truth,
        };
        if track.len() == MAX_TRACK_POINTS {
            track.pop_front();
        }
        track.push_back(pose);
        if state.tracks.len() > MAX_TRACKS {
            let stalest = state.tracks.iter().min_by_key(|(_, (tick, _))| *tick).map(|(k, _)| k.clone());
            stalest.map(|k| state.tracks.remove(&k));
        }
    }

    fn tell(&self, event: LiveEvent) {
        // An error only says that nobody listens.
        drop(self.events.send(Arc::new(event)));
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests;
