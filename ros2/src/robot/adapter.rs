//! The state of one robot between its messages, and what each message gives.

use super::{
    camera::{CameraState, Pixels, Transforms, frame},
    laser::{planar_wire, scan},
    odometry::{OdometryAt, OdometryHistory},
    problem::{MissingInput, Problem},
    settings::{ImageForm, RobotSettings, SettingsError},
};
use crate::{
    convert::{PlanarPose, TransformTree, isometry_of_pose},
    messages::{AnyMessage, CameraInfo, Header, LaserScan, Odometry, TFMessage},
};
use nalgebra::Isometry3;
use protos::{Name, v1};

/// A message of Waymark. It is not checked yet: the intake does so, as for every robot.
#[derive(Debug, Clone, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "it is handed on at once, never stored in numbers")]
pub enum RobotMessage {
    /// A frame of a camera.
    Frame {
        /// The camera.
        camera: Name,
        /// The frame of ROS that the picture is in.
        frame_id: String,
        /// The frame; absent intrinsics, mounting or odometry are among `lacks`.
        frame: v1::Frame,
        /// What it lacks: without intrinsics or mounting it is recognised and gives no pose.
        lacks: Vec<MissingInput>,
    },
    /// Odometry.
    Odometry(v1::Odometry),
    /// A scan.
    Scan(v1::Scan),
}

/// What became of one message.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ConvertedMessage {
    /// What it gave, and what had waited for it.
    pub messages: Vec<RobotMessage>,
    /// What was not used.
    pub problems: Vec<Problem>,
}

/// One robot: calibrations, transforms, odometry, and what waits for odometry (one frame a camera,
/// one scan).
#[derive(Debug, Clone)]
pub struct RobotAdapter {
    settings: RobotSettings,
    epoch: u64,
    tree: TransformTree,
    newest_transform_ns: Option<i64>,
    odometry: OdometryHistory,
    odometry_seq: u64,
    scan_seq: u64,
    waiting_scan: Option<v1::Scan>,
    cameras: Vec<CameraState>,
}

impl RobotAdapter {
    /// A robot that has sent nothing yet. `epoch` is a number that no other start has.
    pub fn new(settings: RobotSettings, epoch: u64) -> Result<Self, SettingsError> {
        settings.check()?;
        let cameras = vec![CameraState::default(); settings.cameras.len()];
        Ok(Self {
            settings,
            epoch,
            tree: TransformTree::default(),
            newest_transform_ns: None,
            odometry: OdometryHistory::default(),
            odometry_seq: 0,
            scan_seq: 0,
            waiting_scan: None,
            cameras,
        })
    }

    /// The settings.
    pub fn settings(&self) -> &RobotSettings {
        &self.settings
    }

    /// The epoch of what it gives.
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// `odom_from_base` at a time; `None` where odometry does not cover it.
    pub fn odom_from_base(&self, at_ns: i64) -> Option<Isometry3<f64>> {
        match self.odometry.at(at_ns) {
            OdometryAt::Known(pose) => Some(pose),
            OdometryAt::Soon | OdometryAt::Absent => None,
        }
    }

    /// Stamp of the newest odometry.
    pub fn newest_odometry_ns(&self) -> Option<i64> {
        self.odometry.newest_ns()
    }

    /// Takes one message of a topic, by its absolute name.
    pub fn take(&mut self, topic: &str, message: &AnyMessage<'_>) -> ConvertedMessage {
        let mut taken = ConvertedMessage::default();
        let done = match message {
            AnyMessage::TFMessage(message) if self.is_transforms(topic) => {
                self.transforms(topic, message, &mut taken);
                Ok(())
            }
            AnyMessage::Odometry(message) if self.settings.odometry.as_deref() == Some(topic) => {
                self.wheels(topic, message, &mut taken)
            }
            AnyMessage::LaserScan(message) if self.settings.scan.as_deref() == Some(topic) => {
                self.laser(topic, message, &mut taken)
            }
            AnyMessage::CameraInfo(info) if self.is_calibration(topic) => {
                self.calibration(topic, info);
                Ok(())
            }
            AnyMessage::Image(image) => self
                .camera_of(topic, ImageForm::Raw, message)
                .and_then(|camera| Ok((camera, Pixels::of_raw(topic, image)?)))
                .map(|(camera, pixels)| self.image(camera, &image.header, pixels, &mut taken)),
            AnyMessage::CompressedImage(image) => self
                .camera_of(topic, ImageForm::Compressed, message)
                .and_then(|camera| Ok((camera, Pixels::of_compressed(topic, image)?)))
                .map(|(camera, pixels)| self.image(camera, &image.header, pixels, &mut taken)),
            other => Err(not_used(topic, other)),
        };
        taken.problems.extend(done.err());
        taken
    }

    fn is_transforms(&self, topic: &str) -> bool {
        [&self.settings.tf, &self.settings.tf_static].iter().any(|name| *name == topic)
    }

    fn is_calibration(&self, topic: &str) -> bool {
        self.settings.cameras.iter().any(|camera| camera.camera_info == topic)
    }

    fn camera_of(&self, topic: &str, form: ImageForm, message: &AnyMessage<'_>) -> Result<usize, Problem> {
        let found = self.settings.cameras.iter().position(|c| c.image == topic && c.form == form);
        let index = found.ok_or_else(|| not_used(topic, message))?;
        let is_stamped = message.header().is_some_and(|header| !header.stamp.is_zero());
        if is_stamped { Ok(index) } else { Err(Problem::NoStamp(topic.to_owned())) }
    }

    fn calibration(&mut self, topic: &str, info: &CameraInfo<'_>) {
        for (settings, state) in self.settings.cameras.iter().zip(&mut self.cameras) {
            if settings.camera_info == topic {
                state.calibrate(settings, info);
            }
        }
    }

    fn transforms(&mut self, topic: &str, message: &TFMessage<'_>, taken: &mut ConvertedMessage) {
        for transform in &message.transforms {
            let stamp = transform.header.stamp;
            if let Err(fault) = self.tree.insert(transform) {
                taken.problems.push(Problem::Transform { topic: topic.to_owned(), fault });
                continue;
            }
            if stamp.is_zero() {
                continue;
            }
            self.newest_transform_ns = self.newest_transform_ns.max(Some(stamp.to_ns()));
            let parent = transform.header.frame_id.trim_start_matches('/');
            let is_odometry = self.settings.odometry.is_none() && parent == self.settings.odom_frame;
            // A frame below `odom` that does not lead to the base is something else.
            if is_odometry
                && let Ok(pose) = self.tree.lookup(&self.settings.odom_frame, &self.settings.base_frame)
            {
                self.moved(stamp.to_ns(), pose, taken);
            }
        }
    }

    /// Odometry of its own topic, of whatever frame of the robot.
    fn wheels(
        &mut self,
        topic: &str,
        message: &Odometry<'_>,
        taken: &mut ConvertedMessage,
    ) -> Result<(), Problem> {
        let topic = || topic.to_owned();
        if message.header.stamp.is_zero() {
            return Err(Problem::NoStamp(topic()));
        }
        let (at_ns, expected) = (message.header.stamp.to_ns(), &self.settings.odom_frame);
        let given = message.header.frame_id.trim_start_matches('/');
        if given != expected.as_str() {
            let (given, expected) = (given.to_owned(), expected.clone());
            return Err(Problem::OdometryFrame { topic: topic(), given, expected });
        }
        let odom_from_child = isometry_of_pose(&message.pose.pose);
        let odom_from_child = odom_from_child.map_err(|fault| Problem::Odometry { topic: topic(), fault })?;
        let (child, base) = (message.child_frame_id.trim_start_matches('/'), &self.settings.base_frame);
        let child_from_base = if child == base.as_str() || child.is_empty() {
            Isometry3::identity()
        } else {
            let found = self.tree.lookup(child, base);
            found.map_err(|error| {
                let lack = Box::new(self.sources().lack(at_ns, error.into()));
                Problem::Lacks { topic: topic(), lack }
            })?
        };
        self.moved(at_ns, odom_from_child * child_from_base, taken);
        Ok(())
    }

    /// Notes odometry, sends it, and releases what it covers.
    fn moved(&mut self, at_ns: i64, odom_from_base: Isometry3<f64>, taken: &mut ConvertedMessage) {
        if !self.odometry.push(at_ns, odom_from_base) {
            return;
        }
        self.odometry_seq += 1;
        taken.messages.push(RobotMessage::Odometry(v1::Odometry {
            epoch: self.epoch,
            seq: self.odometry_seq,
            captured_ns: at_ns,
            odom_from_robot: Some(planar_wire(&PlanarPose::of(&odom_from_base))),
            ..v1::Odometry::default()
        }));
        if let Some(scan) = self.waiting_scan.take() {
            let released = self.release_scan(scan, taken);
            taken.problems.extend(released.err());
        }
        for camera in 0..self.cameras.len() {
            if let Some((frame, lacks)) = self.cameras[camera].waiting.take() {
                self.release_frame(camera, (frame, lacks), taken);
            }
        }
    }

    fn laser(
        &mut self,
        topic: &str,
        message: &LaserScan<'_>,
        taken: &mut ConvertedMessage,
    ) -> Result<(), Problem> {
        if message.header.stamp.is_zero() {
            return Err(Problem::NoStamp(topic.to_owned()));
        }
        let scan = scan(topic, message, &self.sources())?;
        if self.waiting_scan.take().is_some() {
            taken.problems.push(Problem::Superseded(topic.to_owned()));
        }
        self.release_scan(scan, taken)
    }

    /// Sends a scan with odometry of its time, or lets it wait for that.
    fn release_scan(&mut self, mut scan: v1::Scan, taken: &mut ConvertedMessage) -> Result<(), Problem> {
        match self.odometry.at(scan.captured_ns) {
            OdometryAt::Known(pose) => {
                self.scan_seq += 1;
                (scan.epoch, scan.seq) = (self.epoch, self.scan_seq);
                scan.odom_from_robot = Some(planar_wire(&PlanarPose::of(&pose)));
                taken.messages.push(RobotMessage::Scan(scan));
                Ok(())
            }
            OdometryAt::Soon => {
                self.waiting_scan = Some(scan);
                Ok(())
            }
            OdometryAt::Absent => {
                let topic = self.settings.scan.clone().unwrap_or_default();
                Err(Problem::Lacks { topic, lack: Box::new(self.no_odometry(scan.captured_ns)) })
            }
        }
    }

    fn image(&mut self, camera: usize, header: &Header<'_>, pixels: Pixels, taken: &mut ConvertedMessage) {
        let known = (&self.settings.cameras[camera], &self.cameras[camera]);
        let made = frame(known, header, pixels, &self.sources());
        // The picture is worth more than its odometry: it goes without, in its order.
        if let Some((frame, lacks)) = self.cameras[camera].waiting.take() {
            self.send_frame(camera, (frame, lacks), None, taken);
        }
        self.cameras[camera].note_frame_id(&self.settings.cameras[camera], header);
        self.release_frame(camera, made, taken);
    }

    /// Sends a frame with odometry of its time, or lets it wait for that.
    fn release_frame(
        &mut self,
        camera: usize,
        (frame, lacks): (v1::Frame, Vec<MissingInput>),
        taken: &mut ConvertedMessage,
    ) {
        match self.odometry.at(frame.captured_ns) {
            OdometryAt::Soon => self.cameras[camera].waiting = Some((frame, lacks)),
            OdometryAt::Known(pose) => self.send_frame(camera, (frame, lacks), Some(pose), taken),
            OdometryAt::Absent => self.send_frame(camera, (frame, lacks), None, taken),
        }
    }

    fn send_frame(
        &mut self,
        camera: usize,
        (mut frame, mut lacks): (v1::Frame, Vec<MissingInput>),
        odometry: Option<Isometry3<f64>>,
        taken: &mut ConvertedMessage,
    ) {
        if odometry.is_none() {
            lacks.push(self.no_odometry(frame.captured_ns));
        }
        let state = &mut self.cameras[camera];
        state.last_seq += 1;
        (frame.epoch, frame.seq) = (self.epoch, state.last_seq);
        frame.odometry = odometry.map(|pose| planar_wire(&PlanarPose::of(&pose)));
        let frame_id = state.frame_id.clone();
        let camera = self.settings.cameras[camera].name.clone();
        taken.messages.push(RobotMessage::Frame { camera, frame_id, frame, lacks });
    }

    fn no_odometry(&self, at_ns: i64) -> MissingInput {
        self.odometry.lack(self.settings.odometry.as_ref().unwrap_or(&self.settings.tf), at_ns)
    }

    fn sources(&self) -> Transforms<'_> {
        Transforms {
            tree: &self.tree,
            base_frame: &self.settings.base_frame,
            topic: &self.settings.tf_static,
            newest_ns: self.newest_transform_ns,
        }
    }
}

fn not_used(topic: &str, message: &AnyMessage<'_>) -> Problem {
    Problem::NotUsed { topic: topic.to_owned(), kind: message.kind() }
}
