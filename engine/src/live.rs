//! What pages show: the last frame and answer of each camera, the trajectories of each robot, and a stream of events. In:
//! frames, answers and poses of the bus and the workers. Out: copies for readers, who never hold up a worker: a slow reader
//! misses events. Nothing is stored on disk, and every collection is bounded.

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use map::pose2::{Pose2, Pose2Covariance};
use protos::{
    Name,
    convert::{EncodedImage, Encoding, Pixels, geometry::pose2_wire},
    prost::bytes::Bytes,
    v1,
};
use serde::{Serialize, Serializer};
use std::{
    collections::{BTreeMap, VecDeque},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};
use tokio::sync::broadcast;

use super::{
    cameras::CameraRegistry,
    decode::{ImageLimits, mosaic::mosaic},
    slots::SlotKey,
};
use crate::limits::MAX_ROBOTS;

/// Cameras whose last frame is stored; a further one replaces the one with the oldest frame.
pub const MAX_CAMERAS: usize = 32;
/// Robots with trajectories; a further one replaces the one with the oldest pose.
pub const MAX_TRAJECTORIES: usize = 256;
/// Poses of one trajectory: the newest.
pub const MAX_TRAJECTORY_POSES: usize = 2000;
/// Events that a reader may be behind before it misses the oldest.
pub const MAX_EVENTS: usize = 512;

/// The last frame of a camera, as it came.
#[derive(Debug, Clone)]
pub struct LiveFrame {
    /// Width, px.
    pub width_px: u32,
    /// Height, px.
    pub height_px: u32,
    /// The image, or the quads that were sent of it.
    pub pixels: Pixels,
    /// The answer to it.
    pub answer: Arc<v1::Answer>,
}

impl LiveFrame {
    /// The image in a form that browsers show: its media type and bytes. Raw pixels become PNG, and so do patches, each at its
    /// place in the image.
    pub fn for_browsers(&self) -> Result<(&'static str, Bytes), image::ImageError> {
        let EncodedImage { encoding, bytes } = match &self.pixels {
            Pixels::Image(image) => image,
            Pixels::Quads(quads) => {
                let size = (self.width_px as usize, self.height_px as usize);
                let image = mosaic(quads, size, ImageLimits::FRAME)
                    .map_err(|refusal| image::ImageError::IoError(std::io::Error::other(refusal)))?;
                return self.png(image.data(), ExtendedColorType::L8);
            }
        };
        match encoding {
            Encoding::Jpeg => Ok(("image/jpeg", bytes.clone())),
            Encoding::Png => Ok(("image/png", bytes.clone())),
            Encoding::Gray8 => self.png(bytes, ExtendedColorType::L8),
            Encoding::Rgb8 => self.png(bytes, ExtendedColorType::Rgb8),
            Encoding::Bgr8 => {
                let rgb: Vec<u8> = bytes.chunks_exact(3).flat_map(|p| [p[2], p[1], p[0]]).collect();
                self.png(&rgb, ExtendedColorType::Rgb8)
            }
        }
    }

    fn png(
        &self,
        pixels: &[u8],
        colours: ExtendedColorType,
    ) -> Result<(&'static str, Bytes), image::ImageError> {
        let mut out = Vec::new();
        PngEncoder::new(&mut out).write_image(pixels, self.width_px, self.height_px, colours)?;
        Ok(("image/png", out.into()))
    }
}

/// Past poses of a robot by source (map frame), oldest first.
#[derive(Debug, Clone, Default)]
pub struct Trajectories {
    /// Odometry, put on the map at the robot's first known pose.
    pub odometry: VecDeque<Pose2>,
    /// Fused poses.
    pub pose: VecDeque<Pose2>,
    /// The truth, from a simulator.
    pub truth: VecDeque<Pose2>,
}

/// Which trajectory a pose belongs to.
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
    /// Odometry, put on the map.
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
    /// Each with the tick of its last frame.
    frames: BTreeMap<SlotKey, (u64, LiveFrame)>,
    trajectories: BTreeMap<Name, (u64, Trajectories)>,
    /// Of each robot's last published pose: the map it is in, and how far it is trusted.
    trust: BTreeMap<Name, (String, v1::PoseTrust)>,
    ticks: u64,
}

/// The last of everything, and the stream of events.
#[derive(Debug)]
pub struct LiveHub {
    state: Mutex<State>,
    events: broadcast::Sender<Arc<LiveEvent>>,
    cameras: CameraRegistry,
}

impl Default for LiveHub {
    fn default() -> Self {
        Self {
            state: Mutex::default(),
            events: broadcast::channel(MAX_EVENTS).0,
            cameras: CameraRegistry::default(),
        }
    }
}

impl LiveHub {
    /// The cameras by their frames.
    pub fn camera_registry(&self) -> &CameraRegistry {
        &self.cameras
    }

    /// Events from now on. A reader more than [`MAX_EVENTS`] behind is told that it missed some.
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

    /// Trajectories of a robot.
    pub fn trajectories(&self, robot: &Name) -> Option<Trajectories> {
        self.lock().trajectories.get(robot).map(|(_, all)| all.clone())
    }

    /// How far a robot's last published pose is trusted, if that pose is on this map.
    pub fn trust(&self, robot: &Name, map: &str) -> Option<v1::PoseTrust> {
        let state = self.lock();
        state.trust.get(robot).filter(|(on, _)| on == map).map(|(_, trust)| *trust)
    }

    /// Stores the frame as its camera's last and sends its answer as an event.
    pub fn publish_answer(&self, key: &SlotKey, frame: LiveFrame) {
        let answer = frame.answer.clone();
        {
            let mut guard = self.lock();
            let state = &mut *guard;
            state.ticks += 1;
            state.frames.insert(key.clone(), (state.ticks, frame));
            if state.frames.len() > MAX_CAMERAS {
                let oldest = state.frames.iter().min_by_key(|(_, (tick, _))| *tick).map(|(k, _)| k.clone());
                oldest.map(|k| state.frames.remove(&k));
            }
        }
        self.send(LiveEvent::Answer { robot: key.robot.clone(), camera: key.camera.clone(), answer });
    }

    /// Sends the answer to a refused frame as an event; the frame is not stored.
    pub fn publish_refusal(&self, key: &SlotKey, answer: Arc<v1::Answer>) {
        self.send(LiveEvent::Answer { robot: key.robot.clone(), camera: key.camera.clone(), answer });
    }

    /// A fused pose, with the corrections so far, its age (ms), and how far it is trusted.
    pub fn publish_pose(
        &self,
        robot: &Name,
        map: &str,
        pose: &Pose2Covariance,
        (corrections, age_ms): (u64, f64),
        trust: v1::PoseTrust,
    ) {
        self.extend(robot, TrajectoryKind::Pose, pose.pose);
        self.set_trust(robot, map, trust);
        self.send(LiveEvent::Pose {
            robot: robot.clone(),
            map: map.to_owned(),
            pose: pose2_wire(&pose.pose),
            covariance: pose.covariance.transpose().as_slice().to_vec(),
            corrections,
            age_ms,
            trust,
        });
    }

    /// Odometry put on the map.
    pub fn odometry(&self, robot: &Name, map: &str, map_from_robot: Pose2) {
        self.extend(robot, TrajectoryKind::Odometry, map_from_robot);
        let pose = pose2_wire(&map_from_robot);
        self.send(LiveEvent::Odometry { robot: robot.clone(), map: map.to_owned(), pose });
    }

    /// Where a simulated robot really is.
    pub fn truth(&self, robot: &Name, map: &str, map_from_robot: Pose2) {
        self.extend(robot, TrajectoryKind::Truth, map_from_robot);
        let pose = pose2_wire(&map_from_robot);
        self.send(LiveEvent::Truth { robot: robot.clone(), map: map.to_owned(), pose });
    }

    /// A robot came or went.
    pub fn presence(&self, robot: &Name, map: Option<String>, alive: bool) {
        self.send(LiveEvent::Presence { robot: robot.clone(), map: map.unwrap_or_default(), alive });
    }

    /// A map changed.
    pub fn map_changed(&self, map: String, version: Option<u64>) {
        self.send(LiveEvent::MapChanged { map, version });
    }

    fn set_trust(&self, robot: &Name, map: &str, trust: v1::PoseTrust) {
        let mut state = self.lock();
        if state.trust.len() < MAX_ROBOTS || state.trust.contains_key(robot) {
            state.trust.insert(robot.clone(), (map.to_owned(), trust));
        }
    }

    fn extend(&self, robot: &Name, kind: TrajectoryKind, pose: Pose2) {
        let mut guard = self.lock();
        let state = &mut *guard;
        state.ticks += 1;
        let (tick, all) = state.trajectories.entry(robot.clone()).or_default();
        *tick = state.ticks;
        let trajectory = match kind {
            TrajectoryKind::Odometry => &mut all.odometry,
            TrajectoryKind::Pose => &mut all.pose,
            TrajectoryKind::Truth => &mut all.truth,
        };
        if trajectory.len() == MAX_TRAJECTORY_POSES {
            trajectory.pop_front();
        }
        trajectory.push_back(pose);
        if state.trajectories.len() > MAX_TRAJECTORIES {
            let oldest = state.trajectories.iter().min_by_key(|(_, (tick, _))| *tick).map(|(k, _)| k.clone());
            oldest.map(|k| state.trajectories.remove(&k));
        }
    }

    fn send(&self, event: LiveEvent) {
        // An error means that nobody listens.
        drop(self.events.send(Arc::new(event)));
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests;
