//! Why a message of a robot gave nothing, or less than it could.

use crate::{
    convert::{CameraError, ImageError, LaserError, LookupError, PoseError, TransformError},
    messages::MessageKind,
};
use std::fmt;

const NS_PER_S: f64 = 1e9;

/// What a message needs besides itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Input {
    /// The calibration of a camera.
    CameraInfo,
    /// Transforms from the sensor to the robot's base.
    Transforms,
    /// Odometry at the time of the message.
    Odometry,
}

impl fmt::Display for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::CameraInfo => "calibration",
            Self::Transforms => "transforms",
            Self::Odometry => "odometry",
        })
    }
}

/// Something that a message needs and that is not there.
#[derive(Debug, Clone, PartialEq)]
pub struct MissingInput {
    /// What is missing.
    pub input: Input,
    /// The topic that it comes on.
    pub topic: String,
    /// Stamp of the message less the newest stamp on that topic; `None` where nothing was received
    /// on it.
    pub age_ns: Option<i64>,
    /// Why what was received does not do.
    pub reason: MissingReason,
}

/// Why what was received does not do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MissingReason {
    /// Nothing was received.
    #[error("nothing was received")]
    NotReceived,
    /// There is none for the time of the message.
    #[error("none is of the time of the message")]
    NotAtThatTime,
    /// The calibration.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The calibration is of images of another size.
    #[error("it is of images of {calibrated:?} px, these have {given:?}")]
    ImageSize {
        /// Width and height of the calibration.
        calibrated: (u32, u32),
        /// Width and height of the image.
        given: (u32, u32),
    },
    /// The frames are not linked.
    #[error("{0}")]
    Transform(Box<LookupError>),
    /// The laser is mounted askew.
    #[error(transparent)]
    Laser(LaserError),
}

impl fmt::Display for MissingInput {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no {} from `{}`: {}", self.input, self.topic, self.reason)?;
        match self.age_ns {
            Some(age_ns) => write!(f, " (newest {:.3} s before)", age_ns as f64 / NS_PER_S),
            None => Ok(()),
        }
    }
}

impl From<LookupError> for MissingReason {
    fn from(error: LookupError) -> Self {
        Self::Transform(Box::new(error))
    }
}

/// Why a message, or part of one, was not used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Problem {
    /// No setting names the topic with this type.
    #[error("`{topic}` with messages of {} is not used", kind.name())]
    NotUsed {
        /// The topic.
        topic: String,
        /// The type.
        kind: MessageKind,
    },
    /// The stamp is 0: the driver has no clock.
    #[error("a message of `{0}` has no stamp")]
    NoStamp(String),
    /// The image.
    #[error("an image of `{topic}`: {fault}")]
    Image {
        /// The topic.
        topic: String,
        /// What is wrong.
        fault: ImageError,
    },
    /// The file in a compressed image says no size.
    #[error("an image of `{0}` has no size in its header")]
    ImageHeader(String),
    /// The scan.
    #[error("a scan of `{topic}`: {fault}")]
    Scan {
        /// The topic.
        topic: String,
        /// What is wrong.
        fault: LaserError,
    },
    /// The pose of odometry.
    #[error("odometry of `{topic}`: {fault}")]
    Odometry {
        /// The topic.
        topic: String,
        /// What is wrong.
        fault: PoseError,
    },
    /// Odometry in another frame than the settings say.
    #[error("odometry of `{topic}` is in frame `{given}`, the settings say `{expected}`")]
    OdometryFrame {
        /// The topic.
        topic: String,
        /// The frame of its header.
        given: String,
        /// The frame of the settings.
        expected: String,
    },
    /// A transform.
    #[error("a transform of `{topic}`: {fault}")]
    Transform {
        /// The topic.
        topic: String,
        /// What is wrong.
        fault: TransformError,
    },
    /// A message that is useless without something that is not there.
    #[error("a message of `{topic}` is not used: {lack}")]
    Lacks {
        /// The topic.
        topic: String,
        /// What is missing.
        lack: Box<MissingInput>,
    },
    /// A newer message of the same topic came while this one waited for odometry.
    #[error("a message of `{0}` was replaced while it waited for odometry")]
    Superseded(String),
}

/// What whoever runs the robot can do about a word of [`Problem::word`] or [`MissingInput::word`],
/// or one of the wire; empty where the sentence of the problem says it.
pub fn advice(word: &str) -> &'static str {
    match word {
        "not_used" | "other_type" => "Compare `ros2 topic list -t` with the robot's settings in the server.",
        "no_stamp" => "Let the driver stamp its messages at capture.",
        "bad_image" => "Send mono8, rgb8, bgr8 or a JPEG; compare the header with the bytes.",
        "bad_odometry" => "Look at `ros2 topic echo --once` of the odometry.",
        "odometry_frame" => "Set `odom_frame` of the robot to the frame that the odometry names.",
        "bad_transform" => "Look at `ros2 run tf2_ros tf2_monitor`.",
        "no_camera_info" => {
            "Publish the calibration of the camera: `ros2 topic echo --once` of its camera_info."
        }
        "no_transform" => {
            "Publish the transform from `base_frame` to the sensor, or set `base_frame` or `frame`."
        }
        "no_odometry" => "Publish odometry, stamped by the clock of the other messages.",
        "superseded" => "Lower the rate of the pictures.",
        "bad_key" | "unknown_type" => "Compare the robot's topics with its settings in the server.",
        "other_definition" => "Use the message packages of ROS 2 Humble or newer.",
        "bad_attachment" | "bad_payload" => "Compare the versions of rmw_zenoh and of the robot's packages.",
        _ => "",
    }
}

impl Problem {
    /// A word for counters.
    pub fn word(&self) -> &'static str {
        match self {
            Self::NotUsed { .. } => "not_used",
            Self::NoStamp(_) => "no_stamp",
            Self::Image { .. } | Self::ImageHeader(_) => "bad_image",
            Self::Scan { .. } => "bad_scan",
            Self::Odometry { .. } => "bad_odometry",
            Self::OdometryFrame { .. } => "odometry_frame",
            Self::Transform { .. } => "bad_transform",
            Self::Lacks { lack, .. } => lack.word(),
            Self::Superseded(_) => "superseded",
        }
    }
}

impl MissingInput {
    /// A word for counters.
    pub fn word(&self) -> &'static str {
        match self.input {
            Input::CameraInfo => "no_camera_info",
            Input::Transforms => "no_transform",
            Input::Odometry => "no_odometry",
        }
    }
}
