//! Settings of robots of ROS 2: `[[ros2.robot]]`. In: names as people write them. Out: checked
//! topics, frames and keys.

use super::ConfigError;
use protos::Name;
use ros2::{
    messages::MessageKind,
    robot::{CameraSettings, ImageForm, RobotSettings, absolute_topic},
    topic_name::TopicName,
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Most robots of ROS 2; each has a thread.
pub const MAX_ROS2_ROBOTS: usize = 64;
/// Largest `ROS_DOMAIN_ID`.
pub const MAX_DOMAIN: u32 = 232;
/// Longest prefix of keys, in bytes.
pub const MAX_KEY_PREFIX_BYTES: usize = 128;
/// Furthest that a transform is stamped ahead, seconds.
pub const MAX_TRANSFORM_TOLERANCE_S: f64 = 10.0;

/// `[ros2]`, unchecked.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RawRos2 {
    /// Robots that send messages of ROS 2 in place of those of Waymark.
    pub robot: Vec<RawRos2Robot>,
}

/// One robot, unchecked. An empty text switches off what it names.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RawRos2Robot {
    /// Name of the registered robot; needed.
    pub robot: String,
    /// Whether the robot speaks DDS and is joined by zenoh-bridge-ros2dds; otherwise it runs
    /// `rmw_zenoh`.
    pub bridge: bool,
    /// `ROS_DOMAIN_ID`; not used with a bridge.
    pub domain: u32,
    /// Prefix of the robot's keys: the namespace of its zenoh sessions, or that of its bridge.
    pub key_prefix: String,
    /// Namespace of the robot's nodes; precedes the topics below that have no leading slash.
    pub namespace: String,
    /// The frame of the robot whose pose is wanted; its origin is on the floor.
    pub base_frame: String,
    /// The frame of the odometry.
    pub odom_frame: String,
    /// The frame of the map in what is sent to the robot.
    pub map_frame: String,
    /// `sensor_msgs/msg/LaserScan`; empty: no laser.
    pub scan: String,
    /// `nav_msgs/msg/Odometry`; empty: odometry is taken from the transforms below `odom_frame`.
    pub odometry: String,
    /// Transforms that change.
    pub tf: String,
    /// Transforms that do not.
    pub tf_static: String,
    /// `geometry_msgs/msg/PoseWithCovarianceStamped` out; empty: none.
    pub pose: String,
    /// What `pose` carries.
    pub pose_source: PoseSource,
    /// `/initialpose` of AMCL out, at the first pose and after a jump; empty: never.
    pub initial_pose: String,
    /// Whether `map_frame` to `odom_frame` is broadcast on `tf`.
    pub map_to_odom: bool,
    /// How far that transform is stamped ahead of the robot's newest odometry, seconds.
    pub transform_tolerance_s: f64,
    /// `vision_msgs/msg/Detection2DArray` out; empty: none.
    pub detections: String,
    /// Cameras.
    pub camera: Vec<RawRos2Camera>,
}

impl Default for RawRos2Robot {
    fn default() -> Self {
        Self {
            robot: String::new(),
            bridge: false,
            domain: 0,
            key_prefix: String::new(),
            namespace: "/".into(),
            base_frame: "base_link".into(),
            odom_frame: "odom".into(),
            map_frame: "map".into(),
            scan: "scan".into(),
            odometry: "odom".into(),
            tf: "/tf".into(),
            tf_static: "/tf_static".into(),
            pose: "waymark/pose".into(),
            pose_source: PoseSource::Fixes,
            initial_pose: String::new(),
            map_to_odom: false,
            transform_tolerance_s: 1.0,
            detections: "waymark/detections".into(),
            camera: vec![RawRos2Camera::default()],
        }
    }
}

/// What goes out as the robot's pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PoseSource {
    /// The fix of each frame, at its capture: a measurement for a filter that has the odometry
    /// already.
    Fixes,
    /// The fused pose, at each odometry.
    Fused,
}

/// One camera, unchecked.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RawRos2Camera {
    /// Its name on the wire of Waymark.
    pub name: String,
    /// Its images.
    pub image: String,
    /// Whether they are `sensor_msgs/msg/CompressedImage`; otherwise `sensor_msgs/msg/Image`.
    pub compressed: bool,
    /// `sensor_msgs/msg/CameraInfo`.
    pub camera_info: String,
    /// Whether the images are rectified.
    pub rectified: bool,
    /// The camera's frame; empty: that of the images' header.
    pub frame: String,
    /// Whether that frame has x forward, not z.
    pub body_axes: bool,
}

impl Default for RawRos2Camera {
    fn default() -> Self {
        Self {
            name: "front".into(),
            image: "camera/image_raw/compressed".into(),
            compressed: true,
            camera_info: "camera/camera_info".into(),
            rectified: false,
            frame: String::new(),
            body_axes: false,
        }
    }
}

/// How the robot's messages travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Middleware {
    /// `rmw_zenoh` in a domain.
    RmwZenoh {
        /// `ROS_DOMAIN_ID`.
        domain: u32,
    },
    /// DDS, by zenoh-bridge-ros2dds.
    BridgeDds,
}

/// One robot of ROS 2.
#[derive(Debug, Clone, PartialEq)]
pub struct Ros2Robot {
    /// The registered robot.
    pub robot: Name,
    /// How its messages travel.
    pub middleware: Middleware,
    /// Prefix of its keys, without slashes around it; may be empty.
    pub key_prefix: String,
    /// Namespace of its nodes, with a leading slash.
    pub namespace: String,
    /// Topics, frames and cameras.
    pub inputs: RobotSettings,
    /// What it gets.
    pub outputs: Ros2Outputs,
}

impl Ros2Robot {
    /// The prefix, if keys behind it are those of this robot alone: not where it is empty, or that
    /// of Waymark's own keys.
    pub(crate) fn own_prefix(&self) -> Option<&str> {
        let first = self.key_prefix.split('/').next().unwrap_or_default();
        (!first.is_empty() && first != protos::keys::ROOT).then_some(self.key_prefix.as_str())
    }
}

/// What a robot of ROS 2 gets, by absolute topics.
#[derive(Debug, Clone, PartialEq)]
pub struct Ros2Outputs {
    /// Poses, and which.
    pub pose: Option<(String, PoseSource)>,
    /// Poses that restart the robot's own localisation.
    pub initial_pose: Option<String>,
    /// Recognised landmarks.
    pub detections: Option<String>,
    /// `map` to `odom`, stamped this far ahead of the newest odometry, ns.
    pub map_to_odom_ahead_ns: Option<i64>,
}

/// Checks all robots. An error names the setting: `ros2.robot[1].camera[0].image`.
pub(super) fn checked(raw: RawRos2) -> Result<Vec<Ros2Robot>, ConfigError> {
    if raw.robot.len() > MAX_ROS2_ROBOTS {
        let reason = format!("{} robots, at most {MAX_ROS2_ROBOTS}", raw.robot.len());
        return Err(super::invalid("ros2.robot", reason));
    }
    let mut robots = Vec::with_capacity(raw.robot.len());
    // Whose topic it is, so that no two robots share one.
    let mut owners: BTreeMap<(Middleware, String, String), usize> = BTreeMap::new();
    for (i, raw) in raw.robot.into_iter().enumerate() {
        let at = |field: String, reason: String| super::invalid(format!("ros2.robot[{i}].{field}"), reason);
        let robot = robot(raw).map_err(|(field, reason)| at(field, reason))?;
        if robots.iter().any(|other: &Ros2Robot| other.robot == robot.robot) {
            return Err(at("robot".into(), format!("`{}` is configured twice", robot.robot)));
        }
        for used in robot.inputs.topics() {
            let field = match used.kind {
                // Robots of one graph may share transforms, with frames of different names.
                MessageKind::TFMessage => continue,
                MessageKind::LaserScan => "scan",
                MessageKind::Odometry => "odometry",
                _ => "camera",
            };
            let place = (robot.middleware, robot.key_prefix.clone(), used.topic.clone());
            if let Some(other) = owners.insert(place, i) {
                let reason = format!("`{}` is a topic of ros2.robot[{other}], too", used.topic);
                return Err(at(field.into(), reason));
            }
        }
        robots.push(robot);
    }
    Ok(robots)
}

/// A field and what is wrong with it.
type Fault = (String, String);

fn robot(raw: RawRos2Robot) -> Result<Ros2Robot, Fault> {
    let fault = |field: &str, reason: String| (field.to_owned(), reason);
    let name = Name::new(raw.robot.as_str()).map_err(|e| fault("robot", e.to_string()))?;
    if raw.domain > MAX_DOMAIN {
        return Err(fault("domain", format!("{} is more than {MAX_DOMAIN}", raw.domain)));
    }
    let key_prefix = key_prefix(&raw.key_prefix).map_err(|reason| fault("key_prefix", reason))?;
    let namespace = namespace(&raw.namespace).map_err(|reason| fault("namespace", reason))?;
    let topic = |field: &str, topic: &str| {
        absolute_topic(&namespace, topic).map_err(|e| fault(field, format!("`{topic}`: {e}")))
    };
    let optional = |field: &str, text: &str| (!text.is_empty()).then(|| topic(field, text)).transpose();
    let mut cameras = Vec::with_capacity(raw.camera.len());
    for (i, camera) in raw.camera.iter().enumerate() {
        let field = |field: &str| format!("camera[{i}].{field}");
        cameras.push(CameraSettings {
            name: Name::new(camera.name.as_str()).map_err(|e| (field("name"), e.to_string()))?,
            image: topic(&field("image"), &camera.image)?,
            form: if camera.compressed { ImageForm::Compressed } else { ImageForm::Raw },
            camera_info: topic(&field("camera_info"), &camera.camera_info)?,
            is_rectified: camera.rectified,
            frame: (!camera.frame.is_empty()).then(|| camera.frame.clone()),
            has_body_axes: camera.body_axes,
        });
    }
    let inputs = RobotSettings {
        base_frame: raw.base_frame,
        odom_frame: raw.odom_frame,
        map_frame: raw.map_frame,
        scan: optional("scan", &raw.scan)?,
        odometry: optional("odometry", &raw.odometry)?,
        tf: topic("tf", &raw.tf)?,
        tf_static: topic("tf_static", &raw.tf_static)?,
        cameras,
    };
    inputs.check().map_err(|e| (e.field, e.reason))?;
    let tolerance = raw.transform_tolerance_s;
    if !(0.0..=MAX_TRANSFORM_TOLERANCE_S).contains(&tolerance) {
        let reason = format!("{tolerance} is outside 0 to {MAX_TRANSFORM_TOLERANCE_S}");
        return Err(fault("transform_tolerance_s", reason));
    }
    let outputs = Ros2Outputs {
        pose: optional("pose", &raw.pose)?.map(|topic| (topic, raw.pose_source)),
        initial_pose: optional("initial_pose", &raw.initial_pose)?,
        detections: optional("detections", &raw.detections)?,
        map_to_odom_ahead_ns: raw.map_to_odom.then_some((tolerance * 1e9).round() as i64),
    };
    check_outputs(&inputs, &outputs)?;
    let middleware =
        if raw.bridge { Middleware::BridgeDds } else { Middleware::RmwZenoh { domain: raw.domain } };
    Ok(Ros2Robot { robot: name, middleware, key_prefix, namespace, inputs, outputs })
}

/// No topic goes both ways, and no two outputs share one.
fn check_outputs(inputs: &RobotSettings, outputs: &Ros2Outputs) -> Result<(), Fault> {
    let mut seen: Vec<String> = inputs.topics().into_iter().map(|used| used.topic).collect();
    let named = [
        ("pose", outputs.pose.as_ref().map(|(topic, _)| topic)),
        ("initial_pose", outputs.initial_pose.as_ref()),
        ("detections", outputs.detections.as_ref()),
    ];
    for (field, topic) in named {
        let Some(topic) = topic else { continue };
        if seen.contains(topic) {
            return Err((field.to_owned(), format!("`{topic}` has another use, too")));
        }
        seen.push(topic.clone());
    }
    Ok(())
}

fn key_prefix(text: &str) -> Result<String, String> {
    let plain = text.trim_matches('/');
    if plain.len() > MAX_KEY_PREFIX_BYTES {
        return Err(format!("{} bytes are more than {MAX_KEY_PREFIX_BYTES}", plain.len()));
    }
    let is_part = |part: &str| {
        !part.is_empty() && part.bytes().all(|b| b.is_ascii_alphanumeric() || b"_-.".contains(&b))
    };
    if plain.is_empty() || plain.split('/').all(is_part) {
        return Ok(plain.to_owned());
    }
    Err(format!("`{text}` is not of parts of letters, digits, `_`, `-` and `.`"))
}

fn namespace(text: &str) -> Result<String, String> {
    match text.trim_matches('/') {
        "" => Ok("/".to_owned()),
        plain => {
            TopicName::from_key(plain).map(|_| format!("/{plain}")).map_err(|e| format!("`{text}`: {e}"))
        }
    }
}
