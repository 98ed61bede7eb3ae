//! What a robot of ROS gets for an answer or a fused pose. Pure: messages in, payloads out.
//!
//! Without a pose there is no message, and every pose has a covariance. Nothing is said of a fused
//! pose that no landmark supports or that one contradicts.

use crate::config::{PoseSource, Ros2Outputs};
use nalgebra::{Isometry3, Matrix3};
use protos::{convert::geometry, v1};
use ros2::{
    convert::{
        PlanarPose, UNKNOWN_VARIANCE, initial_pose, map_from_odom, pose_of, ros_of_planar, transform_stamped,
    },
    messages::{
        BoundingBox2D, Detection2D, Detection2DArray, Header, Message, MessageKind, ObjectHypothesisWithPose,
        Pose2D, PoseWithCovariance, PoseWithCovarianceStamped, TFMessage, Time,
    },
    robot::{RobotAdapter, RobotSettings},
};

/// A jump of `map_from_odom` by more than this, metres, or by [`JUMP_RAD`], between supported poses
/// is a relocalisation.
const JUMP_M: f64 = 0.5;
/// See [`JUMP_M`]; radians.
const JUMP_RAD: f64 = 0.35;
/// Shortest time between two broadcasts of `map` to `odom`, by the robot's stamps: 25 a second.
const TRANSFORM_PERIOD_NS: i64 = 40_000_000;

/// A message for a robot.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Outgoing {
    pub(super) topic: String,
    pub(super) kind: MessageKind,
    pub(super) payload: Vec<u8>,
}

impl Outgoing {
    fn of<'a, M: Message<'a>>(topic: &str, kind: MessageKind, message: &M) -> Self {
        Self { topic: topic.to_owned(), kind, payload: message.encode() }
    }
}

/// What has been sent, as far as it decides what is sent next.
#[derive(Debug)]
pub(super) struct Outputs {
    settings: Ros2Outputs,
    map_frame: String,
    odom_frame: String,
    tf: String,
    /// The map of the last supported pose, and the last known `map_from_odom`.
    supported: Option<(String, Option<PlanarPose>)>,
    last_transform_ns: Option<i64>,
}

impl Outputs {
    pub(super) fn new(settings: Ros2Outputs, inputs: &RobotSettings) -> Self {
        Self {
            settings,
            map_frame: inputs.map_frame.clone(),
            odom_frame: inputs.odom_frame.clone(),
            tf: inputs.tf.clone(),
            supported: None,
            last_transform_ns: None,
        }
    }

    /// Every topic that is sent on, with its type.
    pub(super) fn topics(&self) -> Vec<(String, MessageKind)> {
        let pose = MessageKind::PoseWithCovarianceStamped;
        let Ros2Outputs { pose: poses, initial_pose, detections, map_to_odom_ahead_ns } = &self.settings;
        let mut topics: Vec<(String, MessageKind)> =
            poses.iter().map(|(topic, _)| topic).chain(initial_pose).map(|t| (t.clone(), pose)).collect();
        topics.extend(detections.iter().map(|topic| (topic.clone(), MessageKind::Detection2DArray)));
        topics.extend(map_to_odom_ahead_ns.map(|_| (self.tf.clone(), MessageKind::TFMessage)));
        topics
    }

    /// For an answer to a frame of a camera with this frame of ROS.
    pub(super) fn of_answer(&self, answer: &v1::Answer, frame_id: &str) -> Vec<Outgoing> {
        let is_analysed =
            matches!(answer.status(), v1::Status::Matched | v1::Status::Ambiguous | v1::Status::NoMatch);
        let Some(stamp) = Time::from_ns(answer.captured_ns).ok().filter(|_| is_analysed) else {
            return Vec::new();
        };
        let mut outgoing = Vec::new();
        if let (Some((topic, PoseSource::Fixes)), Some(fix)) =
            (&self.settings.pose, answer.map_from_robot.as_ref())
        {
            outgoing.extend(self.pose(topic, stamp, fix));
        }
        if let Some(topic) = &self.settings.detections {
            let header = Header { stamp, frame_id };
            let detections = answer.quads.iter().filter(|quad| !quad.landmark.is_empty());
            let detections = detections.map(|quad| detection(header, quad)).collect();
            let message = Detection2DArray { header, detections };
            outgoing.push(Outgoing::of(topic, MessageKind::Detection2DArray, &message));
        }
        outgoing
    }

    /// For a fused pose. The odometry of the robot makes it `map` to `odom`.
    pub(super) fn of_pose(&mut self, pose: &v1::RobotPose, robot: &RobotAdapter) -> Vec<Outgoing> {
        let mut outgoing = Vec::new();
        let is_usable = matches!(pose.trust(), v1::PoseTrust::Supported | v1::PoseTrust::Stale);
        let (Some(fused), Ok(stamp)) = (&pose.map_from_robot, Time::from_ns(pose.captured_ns)) else {
            return outgoing;
        };
        let Some((map_from_base, covariance)) = planar(fused).filter(|_| is_usable) else { return outgoing };
        if let Some((topic, PoseSource::Fused)) = &self.settings.pose {
            outgoing.extend(self.pose(topic, stamp, fused));
        }
        let odom_from_base = robot.odom_from_base(pose.captured_ns);
        let map_from_odom = odom_from_base.map(|odom| map_from_odom(&map_from_base.to_isometry(), &odom));
        let is_supported = pose.trust() == v1::PoseTrust::Supported;
        if is_supported && self.is_relocalised(&pose.map, map_from_odom.as_ref()) {
            let topic = self.settings.initial_pose.as_ref();
            let message = initial_pose(&self.map_frame, stamp, map_from_base, &covariance);
            if let (Some(topic), Ok(message)) = (topic, message) {
                outgoing.push(Outgoing::of(topic, MessageKind::PoseWithCovarianceStamped, &message));
            }
        }
        outgoing.extend(map_from_odom.and_then(|transform| self.transform(&transform, robot)));
        outgoing
    }

    /// Whether the robot's own localisation has to begin anew. Notes the pose.
    fn is_relocalised(&mut self, map: &str, map_from_odom: Option<&Isometry3<f64>>) -> bool {
        let now = map_from_odom.map(PlanarPose::of);
        let jumped = |before: &PlanarPose, now: &PlanarPose| {
            let turn = before.to_isometry().rotation.angle_to(&now.to_isometry().rotation);
            (before.x_m - now.x_m).hypot(before.y_m - now.y_m) > JUMP_M || turn > JUMP_RAD
        };
        let (is_new, before) = match &self.supported {
            Some((before_map, before)) if before_map == map => {
                // Without odometry there is nothing to compare.
                let both = before.as_ref().zip(now.as_ref());
                (both.is_some_and(|(before, now)| jumped(before, now)), *before)
            }
            _ => (true, None),
        };
        self.supported = Some((map.to_owned(), now.or(before)));
        is_new
    }

    fn transform(&mut self, map_from_odom: &Isometry3<f64>, robot: &RobotAdapter) -> Option<Outgoing> {
        let ahead_ns = self.settings.map_to_odom_ahead_ns?;
        let newest_ns = robot.newest_odometry_ns()?;
        // A stamp that is not newer would be refused by tf2; one far back means that the robot's
        // clock was set.
        let since_ns = self.last_transform_ns.map_or(i64::MAX, |last| newest_ns.saturating_sub(last));
        if (0..TRANSFORM_PERIOD_NS).contains(&since_ns) {
            return None;
        }
        let stamp = Time::from_ns(newest_ns.saturating_add(ahead_ns)).ok()?;
        self.last_transform_ns = Some(newest_ns);
        let transform = transform_stamped(&self.map_frame, &self.odom_frame, stamp, map_from_odom);
        let message = TFMessage { transforms: vec![transform] };
        Some(Outgoing::of(&self.tf, MessageKind::TFMessage, &message))
    }

    fn pose(&self, topic: &str, stamp: Time, pose: &v1::Pose2Covariance) -> Option<Outgoing> {
        let (planar, covariance) = planar(pose)?;
        let pose = PoseWithCovariance {
            pose: pose_of(&planar.to_isometry()),
            covariance: ros_of_planar(&covariance),
        };
        let header = Header { stamp, frame_id: &self.map_frame };
        let message = PoseWithCovarianceStamped { header, pose };
        Some(Outgoing::of(topic, MessageKind::PoseWithCovarianceStamped, &message))
    }
}

fn planar(pose: &v1::Pose2Covariance) -> Option<(PlanarPose, Matrix3<f64>)> {
    let checked = geometry::pose2_covariance(pose).ok()?;
    let map::pose2::Pose2 { x_m, y_m, theta_rad } = checked.pose;
    Some((PlanarPose { x_m, y_m, theta_rad }, checked.covariance))
}

/// A landmark that the picture alone names.
fn detection<'a>(header: Header<'a>, quad: &'a v1::QuadAnswer) -> Detection2D<'a> {
    let range = |of: fn(&v1::Point) -> f64| {
        let values = quad.corners.iter().map(of);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
    };
    let ((left, right), (top, bottom)) = (range(|p| p.u_px), range(|p| p.v_px));
    let center = Pose2D { x: 0.5 * (left + right), y: 0.5 * (top + bottom), theta: 0.0 };
    let bbox = BoundingBox2D { center, size_x: right - left, size_y: bottom - top };
    let pose = quad.pose.as_ref().and_then(landmark_pose).unwrap_or_else(|| {
        let mut covariance = [0.0; 36];
        (0..6).for_each(|i| covariance[7 * i] = UNKNOWN_VARIANCE);
        PoseWithCovariance { covariance, ..PoseWithCovariance::default() }
    });
    let result = ObjectHypothesisWithPose { class_id: &quad.landmark, score: quad.confidence, pose };
    Detection2D { header, results: vec![result], bbox, id: &quad.landmark }
}

/// Waymark's covariances are over (rotation, translation), those of ROS over (translation,
/// rotation); both perturb the rotation about the axes of the camera and the position by itself.
fn landmark_pose(pose: &v1::LandmarkPose) -> Option<PoseWithCovariance> {
    let camera_from_landmark = geometry::pose3(pose.camera_from_landmark.as_ref()?).ok()?;
    let ours: &[f64; 36] = pose.covariance.as_slice().try_into().ok()?;
    let swapped = |i: usize| (i + 3) % 6;
    let covariance = std::array::from_fn(|at| ours[6 * swapped(at / 6) + swapped(at % 6)]);
    Some(PoseWithCovariance { pose: pose_of(&camera_from_landmark), covariance })
}

#[cfg(test)]
mod tests;
