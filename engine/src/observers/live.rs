//! What pages show: the last frame and answer of each camera, the trajectories of each robot, and a
//! stream of events. In: frames, answers and poses of the bus and the workers. Out: copies for
//! readers, who never hold up a worker: a slow reader misses events. Nothing is stored on disk, and
//! every collection is bounded.

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use map::pose2::{Pose2, Pose2Covariance};
use protos::{
    CheckedFrame, Code, Name, Rejection,
    convert::{EncodedImage, Encoding, Pixels, geometry::pose2_wire},
    prost::bytes::Bytes,
    v1,
};
use std::{
    collections::{BTreeMap, VecDeque},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Instant,
};
use tokio::sync::broadcast;

mod live_event;
pub use live_event::LiveEvent;

use super::{
    cameras::CameraRegistry,
    robot_activity::{RobotActivities, RobotActivity},
    unknown_robots::{UnknownRobot, UnknownRobots},
};
use crate::{
    frame::{
        decode::{ImageLimits, mosaic::mosaic},
        slots::SlotKey,
        workers::{AnsweredFrame, FrameObserver},
    },
    inputs::{Input, Refused},
    limits::MAX_ROBOTS,
    motion::MotionObserver,
};

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
    /// The image in a form that browsers show: its media type and bytes. Raw pixels become PNG, and
    /// so do patches, each at its place in the image.
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
    robots: Mutex<(RobotActivities, UnknownRobots)>,
}

impl Default for LiveHub {
    fn default() -> Self {
        Self {
            state: Mutex::default(),
            events: broadcast::channel(MAX_EVENTS).0,
            cameras: CameraRegistry::default(),
            robots: Mutex::default(),
        }
    }
}

impl MotionObserver for LiveHub {
    fn message(&self, robot: &Name, input: Input, refused: Option<&Rejection>, received: Instant) {
        match refused {
            None => self.robots().0.used(robot, input, received),
            Some(reason) if reason.code == Code::UnknownRobot => self.refused_unknown(robot, None, received),
            Some(reason) => self.refused(robot, input, reason.into(), received),
        }
    }

    fn odometry(&self, robot: &Name, map: &str, map_from_robot: Pose2) {
        self.extend(robot, TrajectoryKind::Odometry, map_from_robot);
        let pose = pose2_wire(&map_from_robot);
        self.send(LiveEvent::Odometry { robot: robot.clone(), map: map.to_owned(), pose });
    }

    fn pose(
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
}

impl FrameObserver for LiveHub {
    fn answered(&self, answered: &AnsweredFrame<'_>) {
        let AnsweredFrame { key, frame, analysed, answer } = *answered;
        let now = Instant::now();
        let Some(found) = analysed else { return self.publish_refusal(key, answer.clone(), now) };
        self.cameras.record_answered(key, frame, found);
        let CheckedFrame { width_px, height_px, .. } = *frame;
        let (pixels, answer) = (frame.pixels.clone(), answer.clone());
        self.publish_answer(key, LiveFrame { width_px, height_px, pixels, answer }, now);
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

    /// What a robot has done since the start; `None` before its first message.
    pub fn activity(&self, robot: &Name, now: Instant) -> Option<RobotActivity> {
        self.robots().0.get(robot, now)
    }

    /// An input of a registered robot was refused. The log is told at once, and then once a minute.
    pub fn refused(&self, robot: &Name, input: Input, refused: Refused<'_>, now: Instant) {
        let Some(count) = self.robots().0.refused(robot, input, refused, now) else { return };
        let (input, Refused { code, field, detail }) = (input.word(), refused);
        tracing::warn!(%robot, input, code, field, detail, count, "robot_input_refused");
    }

    /// The same of a topic of ROS, of which the log is told by topic.
    pub fn refused_by_topic(&self, robot: &Name, input: Input, refused: Refused<'_>, now: Instant) {
        self.robots().0.refused(robot, input, refused, now);
    }

    /// Forgets what a robot has done.
    pub fn forget_activity(&self, robot: &Name) {
        self.robots().0.forget(robot);
    }

    /// A message was refused because its robot is not registered.
    pub fn refused_unknown(&self, robot: &Name, camera: Option<&Name>, now: Instant) {
        if self.robots().1.refused(robot, camera, now) {
            tracing::warn!(%robot, camera = camera.map(Name::as_str), "unknown_robot_refused");
        }
    }

    /// The robots that send messages and are not registered.
    pub fn unknown_robots(&self, now: Instant, is_registered: impl Fn(&Name) -> bool) -> Vec<UnknownRobot> {
        self.robots().1.list(now, is_registered)
    }

    /// Stores the frame as its camera's last and sends its answer as an event.
    fn publish_answer(&self, key: &SlotKey, frame: LiveFrame, now: Instant) {
        let answer = frame.answer.clone();
        self.robots().0.answered(&key.robot, &answer, now);
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
    pub fn publish_refusal(&self, key: &SlotKey, answer: Arc<v1::Answer>, now: Instant) {
        match &answer.rejection {
            Some(rejection) if rejection.code == Code::UnknownRobot.as_str() => {
                self.refused_unknown(&key.robot, Some(&key.camera), now);
            }
            Some(rejection) => self.refused(&key.robot, Input::Frame, Refused::from(rejection), now),
            None => {}
        }
        self.send(LiveEvent::Answer { robot: key.robot.clone(), camera: key.camera.clone(), answer });
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

    fn robots(&self) -> MutexGuard<'_, (RobotActivities, UnknownRobots)> {
        self.robots.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests;
