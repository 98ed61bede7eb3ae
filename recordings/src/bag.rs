//! A robot of a ROS 2 bag. In: messages of a bag (CDR), and which topics and frames are the
//! robot's. Out: messages of the wire, and why others were not used.

use crate::{
    message::{Body, Recorded},
    read::{ChannelInfo, RawMessage},
};
use protos::{Key, Name, keys::MAX_NAME_BYTES};
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
const IMAGE_ENDS: [&str; 8] = [
    "/image_rect_color/compressed",
    "/image_raw/compressed",
    "/image_rect/compressed",
    "/image_color/compressed",
    "/image_rect_color",
    "/image_raw",
    "/image_rect",
    "/image_color",
];

/// A robot of a bag: what came before, and counts.
#[derive(Debug)]
pub struct BagRobot {
    robot: Name,
    adapter: RobotAdapter,
    used: u64,
    problems: BTreeMap<&'static str, (u64, String)>,
}

impl BagRobot {
    /// A robot with this name on the wire. The settings must name its cameras; [`cameras`] finds
    /// them.
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

/// Words of topics whose images are not of what a camera sees: distances, and what is computed of
/// images.
const NO_PICTURES: [&str; 8] =
    ["depth", "disparity", "confidence", "segmentation", "mask", "label", "/theora", "/ffmpeg"];

/// The cameras of a bag by their topics of images, compressed ones before raw ones of the same
/// camera. Of more than [`MAX_CAMERAS`] those come first that have a calibration in the bag, then
/// by their names; depth images are none. A camera is called after its topic:
/// `/camera/front/image_raw` is `camera-front`.
pub fn cameras<'a>(channels: impl IntoIterator<Item = &'a ChannelInfo>) -> Vec<CameraSettings> {
    let channels: Vec<&ChannelInfo> = channels.into_iter().collect();
    let mut found: Vec<CameraSettings> = Vec::new();
    for channel in &channels {
        let form = match channel.schema.as_str() {
            "sensor_msgs/msg/Image" => ImageForm::Raw,
            "sensor_msgs/msg/CompressedImage" => ImageForm::Compressed,
            _ => continue,
        };
        let lower = channel.topic.to_lowercase();
        if NO_PICTURES.iter().any(|word| lower.contains(word)) {
            continue;
        }
        let Some(mut camera) = camera(&channel.topic, form) else { continue };
        match found.iter_mut().find(|other| other.name == camera.name) {
            None => found.push(camera),
            // The same camera in another form.
            Some(other) if camera_topic(&other.image) == camera_topic(&camera.image) => {
                if other.form == ImageForm::Raw {
                    *other = camera;
                }
            }
            // Another one beside it: `/stereo/left` and `/stereo/right`.
            Some(_) => {
                camera.name = name(camera.image.trim_start_matches('/')).unwrap_or(camera.name);
                if found.iter().all(|other| other.name != camera.name) {
                    found.push(camera);
                }
            }
        }
    }
    let is_calibrated = |camera: &CameraSettings| {
        channels.iter().any(|c| c.topic == camera.camera_info && c.schema == "sensor_msgs/msg/CameraInfo")
    };
    found.sort_by_cached_key(|camera| (!is_calibrated(camera), camera.name.clone()));
    found.truncate(MAX_CAMERAS);
    found.sort_by(|a, b| a.name.cmp(&b.name));
    found
}

/// A topic of images without the form of the image; `None` if it does not end as those do.
fn base(topic: &str) -> Option<&str> {
    IMAGE_ENDS.iter().find_map(|end| topic.strip_suffix(end))
}

/// A topic of images without the form of the image.
fn camera_topic(topic: &str) -> &str {
    base(topic).unwrap_or_else(|| topic.strip_suffix("/compressed").unwrap_or(topic))
}

/// A name of the last words of a topic that fit into one.
fn name(words: &str) -> Option<Name> {
    let words = words.trim_matches('/').to_lowercase();
    if words.is_empty() {
        return Name::new("camera").ok();
    }
    let all: Vec<&str> = words.split('/').collect();
    (0..all.len())
        .map(|first| all[first..].join("-"))
        .find(|name| name.len() <= MAX_NAME_BYTES)
        .and_then(|n| Name::new(n).ok())
}

/// The camera of a topic of images, with the calibration beside it; `None` for a topic that gives
/// no name.
pub fn camera(topic: &str, form: ImageForm) -> Option<CameraSettings> {
    let base = base(topic).unwrap_or_else(|| topic.rsplit_once('/').map_or("", |(base, _)| base));
    let mut camera = CameraSettings::conventional(name(base)?, base, form);
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

    fn images(topics: &[&str], infos: &[&str]) -> Vec<(String, String)> {
        let channel = |topic: &&str, schema: &str| ChannelInfo {
            topic: (*topic).to_owned(),
            encoding: "cdr".to_owned(),
            schema: format!("sensor_msgs/msg/{schema}"),
        };
        let images = topics.iter().map(|topic| channel(topic, "Image"));
        let channels: Vec<_> = images.chain(infos.iter().map(|topic| channel(topic, "CameraInfo"))).collect();
        cameras(&channels).into_iter().map(|c| (c.name.to_string(), c.image)).collect()
    }

    #[test]
    fn depth_takes_no_cameras_place_and_calibrated_ones_come_first() {
        let depth: Vec<String> = (0..8).map(|i| format!("/camera{i}/depth/image_rect_raw")).collect();
        let mut topics: Vec<&str> = depth.iter().map(String::as_str).collect();
        topics.extend(["/camera/aligned_depth_to_color/image_raw", "/stereo/disparity", "/zed/image_raw"]);
        assert_eq!(images(&topics, &[]), [("zed".to_owned(), "/zed/image_raw".to_owned())]);
        let many: Vec<String> = (0..12).map(|i| format!("/a{i}/image_raw")).collect();
        let mut topics: Vec<&str> = many.iter().map(String::as_str).collect();
        topics.push("/zed/image_raw");
        let found = images(&topics, &["/zed/camera_info"]);
        assert_eq!(found.len(), MAX_CAMERAS);
        assert!(found.iter().any(|(name, _)| name == "zed"), "{found:?}");
    }

    #[test]
    fn two_cameras_of_one_folder_and_long_topics_have_names() {
        let found = images(&["/stereo/left", "/stereo/right"], &[]);
        assert_eq!(
            found.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(),
            ["stereo", "stereo-right"]
        );
        let long = format!("/{}/front/image_raw", "x".repeat(MAX_NAME_BYTES));
        assert_eq!(images(&[&long], &[])[0].0, "front");
    }
}
