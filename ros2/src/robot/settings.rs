//! Which topics, frames and cameras a robot has, with the names that are usual in ROS.

use crate::{
    convert::MAX_FRAME_NAME_BYTES,
    messages::MessageKind,
    topic_name::{TopicName, TopicNameError},
};
use protos::Name;
use std::collections::BTreeSet;

/// Most cameras of a robot, as many as a server serves at a time.
pub const MAX_CAMERAS: usize = 8;

/// How a camera's images are sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageForm {
    /// `sensor_msgs/msg/Image`.
    Raw,
    /// `sensor_msgs/msg/CompressedImage`, JPEG or PNG.
    Compressed,
}

/// One camera.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CameraSettings {
    /// Its name on the wire of Waymark.
    pub name: Name,
    /// Topic of its images.
    pub image: String,
    /// How they are sent.
    pub form: ImageForm,
    /// Topic of its calibration.
    pub camera_info: String,
    /// Whether the images are rectified already: then the lens is left out and `P` gives the
    /// intrinsics.
    pub is_rectified: bool,
    /// Name of the camera's frame, in place of that in the header of its images.
    pub frame: Option<String>,
    /// Whether that frame has the axes of a body (x forward), as some simulators have it, not
    /// optical ones (z forward).
    pub has_body_axes: bool,
}

impl CameraSettings {
    /// A camera with the topics of `image_transport` under `base`, `/camera` for example.
    pub fn conventional(name: Name, base: &str, form: ImageForm) -> Self {
        let image = match form {
            ImageForm::Raw => format!("{base}/image_raw"),
            ImageForm::Compressed => format!("{base}/image_raw/compressed"),
        };
        let camera_info = format!("{base}/camera_info");
        Self { name, image, form, camera_info, is_rectified: false, frame: None, has_body_axes: false }
    }
}

/// One robot. Topics are absolute, with a leading slash: [`absolute_topic`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RobotSettings {
    /// The frame of the robot whose pose is wanted; its origin is on the floor.
    pub base_frame: String,
    /// The frame of the odometry.
    pub odom_frame: String,
    /// The frame of the map, in what is sent to the robot.
    pub map_frame: String,
    /// Topic of the laser; `None` for a robot without one.
    pub scan: Option<String>,
    /// Topic of `nav_msgs/msg/Odometry`; `None` takes odometry from the transforms below
    /// `odom_frame`.
    pub odometry: Option<String>,
    /// Topic of transforms that change.
    pub tf: String,
    /// Topic of transforms that do not.
    pub tf_static: String,
    /// Cameras.
    pub cameras: Vec<CameraSettings>,
}

impl Default for RobotSettings {
    /// The usual names, without a camera.
    fn default() -> Self {
        Self {
            base_frame: "base_link".into(),
            odom_frame: "odom".into(),
            map_frame: "map".into(),
            scan: Some("/scan".into()),
            odometry: Some("/odom".into()),
            tf: "/tf".into(),
            tf_static: "/tf_static".into(),
            cameras: Vec::new(),
        }
    }
}

/// A topic that a robot is listened to on.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct TopicUse {
    /// The absolute name.
    pub topic: String,
    /// The type of its messages.
    pub kind: MessageKind,
    /// Whether late subscribers get earlier messages.
    pub is_latched: bool,
    /// The camera whose images it carries, by its place in the settings.
    pub camera: Option<usize>,
}

/// Why settings cannot be used. `field` is their path: `camera[1].image`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{field}`: {reason}")]
pub struct SettingsError {
    /// The setting.
    pub field: String,
    /// What is wrong with it.
    pub reason: String,
}

impl SettingsError {
    fn new(field: impl Into<String>, reason: impl Into<String>) -> Self {
        Self { field: field.into(), reason: reason.into() }
    }
}

impl RobotSettings {
    /// Checks names and that no topic has two uses; cameras may share their calibration's topic.
    pub fn check(&self) -> Result<(), SettingsError> {
        let frames = [
            ("base_frame", &self.base_frame),
            ("odom_frame", &self.odom_frame),
            ("map_frame", &self.map_frame),
        ];
        for (field, frame) in frames {
            check_frame(field.into(), frame)?;
        }
        if self.cameras.len() > MAX_CAMERAS {
            let reason = format!("{} cameras, at most {MAX_CAMERAS}", self.cameras.len());
            return Err(SettingsError::new("camera", reason));
        }
        let mut names = BTreeSet::new();
        for (i, camera) in self.cameras.iter().enumerate() {
            if !names.insert(&camera.name) {
                let reason = format!("`{}` names another camera, too", camera.name);
                return Err(SettingsError::new(format!("camera[{i}].name"), reason));
            }
            if let Some(frame) = &camera.frame {
                check_frame(format!("camera[{i}].frame"), frame)?;
            }
        }
        let mut seen = BTreeSet::new();
        for (field, topic) in self.named_topics() {
            TopicName::from_ros(topic).map_err(|e| SettingsError::new(&field, e.to_string()))?;
            if !seen.insert(topic) && !field.ends_with("camera_info") {
                return Err(SettingsError::new(field, format!("`{topic}` has another use, too")));
            }
        }
        Ok(())
    }

    /// Every topic with the path of its setting. Calibrations come last.
    fn named_topics(&self) -> Vec<(String, &str)> {
        let mut topics = vec![("tf".to_owned(), self.tf.as_str()), ("tf_static".to_owned(), &self.tf_static)];
        topics.extend(self.scan.iter().map(|topic| ("scan".to_owned(), topic.as_str())));
        topics.extend(self.odometry.iter().map(|topic| ("odometry".to_owned(), topic.as_str())));
        let cameras = || self.cameras.iter().enumerate();
        topics.extend(cameras().map(|(i, c)| (format!("camera[{i}].image"), c.image.as_str())));
        topics.extend(cameras().map(|(i, c)| (format!("camera[{i}].camera_info"), c.camera_info.as_str())));
        topics
    }

    /// Every topic to listen to, each once.
    pub fn topics(&self) -> Vec<TopicUse> {
        let plain =
            |topic: &String, kind| TopicUse { topic: topic.clone(), kind, is_latched: false, camera: None };
        let mut topics = vec![
            TopicUse { is_latched: true, ..plain(&self.tf_static, MessageKind::TFMessage) },
            plain(&self.tf, MessageKind::TFMessage),
        ];
        topics.extend(self.odometry.iter().map(|topic| plain(topic, MessageKind::Odometry)));
        topics.extend(self.scan.iter().map(|topic| plain(topic, MessageKind::LaserScan)));
        for (i, camera) in self.cameras.iter().enumerate() {
            let kind = match camera.form {
                ImageForm::Raw => MessageKind::Image,
                ImageForm::Compressed => MessageKind::CompressedImage,
            };
            let calibration = plain(&camera.camera_info, MessageKind::CameraInfo);
            if !topics.contains(&calibration) {
                topics.push(calibration);
            }
            topics.push(TopicUse { camera: Some(i), ..plain(&camera.image, kind) });
        }
        topics
    }
}

fn check_frame(field: String, frame: &str) -> Result<(), SettingsError> {
    if frame.is_empty() || frame.len() > MAX_FRAME_NAME_BYTES {
        let reason = format!(
            "the name of a frame has 1 to {MAX_FRAME_NAME_BYTES} bytes, this one has {}",
            frame.len()
        );
        return Err(SettingsError::new(field, reason));
    }
    if frame.starts_with('/') {
        return Err(SettingsError::new(field, "tf2 takes no leading slash"));
    }
    Ok(())
}

/// The absolute name of a topic of a node in `namespace`: `scan` in `/r1` is `/r1/scan`, `/scan`
/// stays `/scan`.
pub fn absolute_topic(namespace: &str, topic: &str) -> Result<String, TopicNameError> {
    let absolute = match namespace.trim_matches('/') {
        _ if topic.starts_with('/') => topic.to_owned(),
        "" => format!("/{topic}"),
        namespace => format!("/{namespace}/{topic}"),
    };
    TopicName::from_ros(&absolute)?;
    Ok(absolute)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> RobotSettings {
        let camera = |name: &str| {
            let base = format!("/{name}");
            CameraSettings::conventional(Name::new(name).unwrap(), &base, ImageForm::Compressed)
        };
        RobotSettings { cameras: vec![camera("front"), camera("rear")], ..RobotSettings::default() }
    }

    #[test]
    fn usual_names_pass_and_give_the_topics() {
        assert_eq!(settings().check(), Ok(()));
        let topics = settings().topics();
        let names: Vec<&str> = topics.iter().map(|t| t.topic.as_str()).collect();
        let expected = [
            "/tf_static",
            "/tf",
            "/odom",
            "/scan",
            "/front/camera_info",
            "/front/image_raw/compressed",
            "/rear/camera_info",
            "/rear/image_raw/compressed",
        ];
        assert_eq!(names, expected);
        assert!(topics[0].is_latched && !topics[1].is_latched);
        assert_eq!((topics[5].kind, topics[5].camera), (MessageKind::CompressedImage, Some(0)));
        let mut shared = settings();
        shared.cameras[1].camera_info = shared.cameras[0].camera_info.clone();
        assert_eq!((shared.check(), shared.topics().len()), (Ok(()), 7));
    }

    #[test]
    fn each_fault_names_its_setting() {
        let fault = |change: fn(&mut RobotSettings)| {
            let mut changed = settings();
            change(&mut changed);
            changed.check().unwrap_err().field
        };
        assert_eq!(fault(|s| s.base_frame.clear()), "base_frame");
        assert_eq!(fault(|s| s.odom_frame = "/odom".into()), "odom_frame");
        assert_eq!(fault(|s| s.map_frame = "m".repeat(MAX_FRAME_NAME_BYTES + 1)), "map_frame");
        assert_eq!(fault(|s| s.scan = Some("scan".into())), "scan");
        assert_eq!(fault(|s| s.odometry = Some("/tf".into())), "odometry");
        assert_eq!(fault(|s| s.cameras[1].image = "/a b".into()), "camera[1].image");
        assert_eq!(fault(|s| s.cameras[1].image = s.cameras[0].image.clone()), "camera[1].image");
        assert_eq!(fault(|s| s.cameras[1].name = s.cameras[0].name.clone()), "camera[1].name");
        assert_eq!(fault(|s| s.cameras[0].frame = Some(String::new())), "camera[0].frame");
        assert_eq!(fault(|s| s.cameras[0].camera_info = "x".into()), "camera[0].camera_info");
        assert_eq!(fault(|s| s.cameras = vec![s.cameras[0].clone(); MAX_CAMERAS + 1]), "camera");
    }

    #[test]
    fn topics_are_resolved_as_nodes_do() {
        let absolute = |namespace, topic| absolute_topic(namespace, topic).unwrap();
        assert_eq!(absolute("/r1", "scan"), "/r1/scan");
        assert_eq!(absolute("r1/", "camera/image_raw"), "/r1/camera/image_raw");
        assert_eq!(absolute("/", "scan"), "/scan");
        assert_eq!(absolute("/r1", "/tf"), "/tf");
        assert!(absolute_topic("/r1", "").is_err() && absolute_topic("/1", "scan").is_err());
    }
}
