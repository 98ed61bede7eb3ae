//! What viewers get of a message. In: a message of the wire or the content of a map. Out: messages
//! of Foxglove's schemas with their topics.

mod answer;
mod frame;
mod motion;
mod scene;

pub use scene::MapContent;

use crate::message::{Body, Recorded};
use prost::Message;
use protos::{Key, Name, v1};
use std::collections::BTreeMap;

/// A message for viewers.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Shown {
    pub(crate) topic: String,
    /// Full name of the message.
    pub(crate) schema: &'static str,
    /// The message.
    pub(crate) bytes: Vec<u8>,
}

impl Shown {
    fn new(topic: String, schema: &'static str, message: &impl Message) -> Self {
        Self { topic, schema, bytes: message.encode_to_vec() }
    }
}

/// What viewers were told of a camera: told again when it changes.
#[derive(Debug, Default, PartialEq)]
struct CameraState {
    intrinsics: Option<(v1::Intrinsics, [u32; 2])>,
    mounting: Option<v1::Pose3>,
}

/// What viewers were told before. One entry for each camera of the recording.
#[derive(Debug, Default)]
pub(crate) struct View {
    cameras: BTreeMap<(Name, Name), CameraState>,
}

impl View {
    /// What viewers get of a message. The image of a frame is moved out of it if a viewer gets it.
    pub(crate) fn of(&mut self, recorded: &mut Recorded) -> Vec<Shown> {
        let Recorded { key, body, .. } = recorded;
        match (&*key, body) {
            (Key::Frame(robot, camera), Body::Frame(message)) => {
                let state = self.cameras.entry((robot.clone(), camera.clone())).or_default();
                frame::shown(robot, camera, message, state)
            }
            (Key::Answer(robot, camera), Body::Answer(message)) => {
                vec![answer::shown(robot, camera, message)]
            }
            (Key::Scan(robot), Body::Scan(message)) => motion::scan(robot, message).into_iter().collect(),
            (Key::Pose(robot), Body::Pose(message)) => motion::pose(robot, message),
            _ => Vec::new(),
        }
    }

    /// What viewers get of a map.
    pub(crate) fn of_map(content: &MapContent<'_>, log_time_ns: u64) -> Shown {
        scene::shown(content, log_time_ns)
    }
}
