//! What a robot sends, by kind, and why some of it is refused.

use protos::{Rejection, v1};

/// Kinds of what a robot sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Input {
    /// Pictures and quads of cameras.
    Frame,
    /// Odometry.
    Odometry,
    /// Laser scans.
    Scan,
    /// Calibrations of cameras, of ROS.
    CameraInfo,
    /// Transforms, of ROS.
    Transform,
    /// Connections.
    Connection,
}

impl Input {
    /// The kind in one word, for programs.
    pub fn word(self) -> &'static str {
        match self {
            Self::Frame => "frame",
            Self::Odometry => "odometry",
            Self::Scan => "scan",
            Self::CameraInfo => "camera_info",
            Self::Transform => "transform",
            Self::Connection => "connection",
        }
    }
}

/// Why an input is refused.
#[derive(Debug, Clone, Copy)]
pub struct Refused<'a> {
    /// A stable word.
    pub code: &'a str,
    /// The field at fault, or the topic.
    pub field: &'a str,
    /// A sentence for a person.
    pub detail: &'a str,
}

impl<'a> From<&'a v1::Rejection> for Refused<'a> {
    fn from(rejection: &'a v1::Rejection) -> Self {
        Self { code: &rejection.code, field: &rejection.field, detail: &rejection.detail }
    }
}

impl<'a> From<&'a Rejection> for Refused<'a> {
    fn from(rejection: &'a Rejection) -> Self {
        Self { code: rejection.code.as_str(), field: &rejection.field, detail: &rejection.detail }
    }
}
