//! A message of a drive: when it was received, its key, its content.

use protos::{
    Key,
    prost::{DecodeError, Message as _},
    v1,
};

/// Content of a message that a recording contains.
#[derive(Debug, Clone, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "one message is at hand at a time")]
pub enum Body {
    /// Of [`Key::Frame`].
    Frame(v1::Frame),
    /// Of [`Key::Answer`].
    Answer(v1::Answer),
    /// Of [`Key::Odometry`].
    Odometry(v1::Odometry),
    /// Of [`Key::Scan`].
    Scan(v1::Scan),
    /// Of [`Key::Pose`].
    Pose(v1::RobotPose),
    /// Of [`Key::MapChanged`].
    MapChanged(v1::MapChanged),
}

impl Body {
    /// Reads the content that a key promises; `None` for keys without a message that is recorded.
    pub fn decode(key: &Key, bytes: &[u8]) -> Result<Option<Self>, DecodeError> {
        Ok(Some(match key {
            Key::Frame(..) => Self::Frame(v1::Frame::decode(bytes)?),
            Key::Answer(..) => Self::Answer(v1::Answer::decode(bytes)?),
            Key::Odometry(_) => Self::Odometry(v1::Odometry::decode(bytes)?),
            Key::Scan(_) => Self::Scan(v1::Scan::decode(bytes)?),
            Key::Pose(_) => Self::Pose(v1::RobotPose::decode(bytes)?),
            Key::MapChanged(_) => Self::MapChanged(v1::MapChanged::decode(bytes)?),
            Key::Quads(..)
            | Key::Alive(..)
            | Key::Gaze(_)
            | Key::Hello(_)
            | Key::Localise(_)
            | Key::MapVersion(_)
            | Key::Server(..) => return Ok(None),
        }))
    }

    /// The message as bytes.
    pub fn encode(&self) -> Vec<u8> {
        match self {
            Self::Frame(message) => message.encode_to_vec(),
            Self::Answer(message) => message.encode_to_vec(),
            Self::Odometry(message) => message.encode_to_vec(),
            Self::Scan(message) => message.encode_to_vec(),
            Self::Pose(message) => message.encode_to_vec(),
            Self::MapChanged(message) => message.encode_to_vec(),
        }
    }

    /// Full name of the message.
    pub fn schema(&self) -> &'static str {
        match self {
            Self::Frame(_) => "waymark.v1.Frame",
            Self::Answer(_) => "waymark.v1.Answer",
            Self::Odometry(_) => "waymark.v1.Odometry",
            Self::Scan(_) => "waymark.v1.Scan",
            Self::Pose(_) => "waymark.v1.RobotPose",
            Self::MapChanged(_) => "waymark.v1.MapChanged",
        }
    }

    /// When it was captured, by the robot's clock, ns; `None` for messages that are of no robot.
    pub fn captured_ns(&self) -> Option<i64> {
        match self {
            Self::Frame(message) => Some(message.captured_ns),
            Self::Answer(message) => Some(message.captured_ns),
            Self::Odometry(message) => Some(message.captured_ns),
            Self::Scan(message) => Some(message.captured_ns),
            Self::Pose(message) => Some(message.captured_ns),
            Self::MapChanged(_) => None,
        }
    }
}

/// A message with key and time of receipt.
#[derive(Debug, Clone, PartialEq)]
pub struct Recorded {
    /// When it was received, ns since the Unix epoch.
    pub log_time_ns: u64,
    /// Whose message it is, and of which kind; that of the body.
    pub key: Key,
    /// The message.
    pub body: Body,
}
