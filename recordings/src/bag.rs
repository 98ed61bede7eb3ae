//! A robot of a ROS 2 bag. In: messages of a bag (CDR), and which topics and frames are the robot's. Out: messages of the
//! wire, and why others were not used.

use crate::{
    message::{Body, Recorded},
    read::{ChannelInfo, RawMessage},
};
use protos::{Key, Name};
use ros2::{
    messages::MessageKind,
    robot::{
        CameraSettings, ImageForm, MAX_CAMERAS, RobotAdapter, RobotMessage, RobotSettings, SettingsError,
    },
    type_name::TypeName,
};
use std::collections::BTreeMap;

/// The epoch of what a bag gives: the same bag gives the same messages.
pub const BAG_EPOCH: u64 = 1;
/// Ends of the topics of images, the longest first.
const IMAGE_ENDS: [&str; 4] =
    ["/image_raw/compressed", "/image_rect/compressed", "/image_raw", "/image_rect"];

/// A robot of a bag: what came before, and counts.
#[derive(Debug)]
pub struct BagRobot {
    robot: Name,
    adapter: RobotAdapter,
    used: u64,
    problems: BTreeMap<&'static str, (u64, String)>,
}

impl BagRobot {
    /// A robot with this name on the wire. The settings must name its cameras; [`cameras`] finds them.
    pub fn new(robot: Name, settings: RobotSettings) -> Result<Self, SettingsError> {
        let adapter = RobotAdapter::new(settings, BAG_EPOCH)?;
        Ok(Self { robot, adapter, used: 0, problems: BTreeMap::new() })
    }

    /// What a message gives: frames, odometry and scans, also those that waited for it.
    pub fn take(&mut self, raw: &RawMessage) -> Vec<Recorded> {
        let kind = TypeName::from_ros(&raw.channel.schema).ok().and_then(MessageKind::of);
        let Some(kind) = kind else {
            self.problem("unknown_type", || format!("messages of type `{}`", raw.channel.schema));
            return Vec::new();
        };
        let taken = match kind.decode(&raw.data) {
            Ok(message) => self.adapter.take(&raw.channel.topic, &message),
            Err(error) => {
                self.problem("malformed", || format!("a message of `{}`: {error}", raw.channel.topic));
                return Vec::new();
            }
        };
        for problem in &taken.problems {
            self.problem(problem.word(), || problem.to_string());
        }
        self.used += u64::from(taken.problems.is_empty());
        let recorded = |message| {
            let (key, body) = match message {
                RobotMessage::Frame { camera, frame, lacks, .. } => {
                    for lack in &lacks {
                        self.problem(lack.word(), || lack.to_string());
                    }
                    (Key::Frame(self.robot.clone(), camera), Body::Frame(frame))
                }
                RobotMessage::Odometry(message) => {
                    (Key::Odometry(self.robot.clone()), Body::Odometry(message))
                }
                RobotMessage::Scan(message) => (Key::Scan(self.robot.clone()), Body::Scan(message)),
            };
            Recorded { log_time_ns: raw.log_time_ns, key, body }
        };
        taken.messages.into_iter().map(recorded).collect()
    }

    /// Messages that were used.
    pub fn used(&self) -> u64 {
        self.used
    }

    /// What was not used or lacks something: how often, and the first of each kind in words.
    pub fn problems(&self) -> impl Iterator<Item = (&'static str, u64, &str)> {
        self.problems.iter().map(|(word, (count, first))| (*word, *count, first.as_str()))
    }

    fn problem(&mut self, word: &'static str, first: impl FnOnce() -> String) {
        self.problems.entry(word).or_insert_with(|| (0, first())).0 += 1;
    }
}

/// Whether a file has messages of ROS 2.
pub fn is_bag<'a>(channels: impl IntoIterator<Item = &'a ChannelInfo>) -> bool {
    channels.into_iter().any(|channel| channel.encoding == "cdr")
}

/// The cameras of a bag by their topics of images, compressed ones before raw ones of the same camera; at most
/// [`MAX_CAMERAS`]. A camera is called after its topic: `/camera/front/image_raw` is `camera-front`.
pub fn cameras<'a>(channels: impl IntoIterator<Item = &'a ChannelInfo>) -> Vec<CameraSettings> {
    let mut found: BTreeMap<Name, CameraSettings> = BTreeMap::new();
    for channel in channels {
        let form = match channel.schema.as_str() {
            "sensor_msgs/msg/Image" => ImageForm::Raw,
            "sensor_msgs/msg/CompressedImage" => ImageForm::Compressed,
            _ => continue,
        };
        let Some(camera) = camera(&channel.topic, form) else { continue };
        let is_better = found.get(&camera.name).is_none_or(|other| other.form == ImageForm::Raw);
        if is_better {
            found.insert(camera.name.clone(), camera);
        }
    }
    found.into_values().take(MAX_CAMERAS).collect()
}

/// The camera of a topic of images, with the calibration beside it; `None` for a topic that gives no name.
pub fn camera(topic: &str, form: ImageForm) -> Option<CameraSettings> {
    let base = IMAGE_ENDS.iter().find_map(|end| topic.strip_suffix(end));
    let base = base.unwrap_or_else(|| topic.rsplit_once('/').map_or("", |(base, _)| base));
    let words: String = base.trim_matches('/').to_lowercase();
    let name = words.replace('/', "-");
    let name = Name::new(if name.is_empty() { "camera".to_owned() } else { name }).ok()?;
    let mut camera = CameraSettings::conventional(name, base, form);
    topic.clone_into(&mut camera.image);
    camera.is_rectified = topic.contains("/image_rect");
    Some(camera)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_found_by_their_topics() {
        let channel = |topic: &str, kind: &str| ChannelInfo {
            topic: topic.to_owned(),
            encoding: "cdr".to_owned(),
            schema: format!("sensor_msgs/msg/{kind}"),
        };
        let channels = [
            channel("/camera/front/image_raw", "Image"),
            channel("/camera/front/image_raw/compressed", "CompressedImage"),
            channel("/image", "Image"),
            channel("/rear/image_rect", "Image"),
            channel("/scan", "LaserScan"),
        ];
        let found: Vec<_> = cameras(&channels)
            .into_iter()
            .map(|c| (c.name.to_string(), c.image, c.camera_info, c.is_rectified))
            .collect();
        let expected = [
            ("camera", "/image", "/camera_info", false),
            ("camera-front", "/camera/front/image_raw/compressed", "/camera/front/camera_info", false),
            ("rear", "/rear/image_rect", "/rear/camera_info", true),
        ];
        let expected = expected.map(|(n, i, c, r)| (n.to_owned(), i.to_owned(), c.to_owned(), r));
        assert_eq!(found, expected);
        assert!(is_bag(&channels));
    }
}
