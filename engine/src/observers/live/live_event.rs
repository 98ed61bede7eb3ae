//! What readers of the stream of events are told.

use protos::{Name, v1};
use serde::{Serialize, Serializer};
use std::sync::Arc;

/// Something happened. In JSON: the fields of the variant, without its name; [`LiveEvent::kind`] is
/// the event's name.
#[derive(Debug, Clone, Serialize)]
#[serde(untagged)]
pub enum LiveEvent {
    /// A frame was answered.
    Answer {
        /// Robot.
        robot: Name,
        /// Its camera.
        camera: Name,
        /// What was answered, the map's name included.
        answer: Arc<v1::Answer>,
    },
    /// A fused pose.
    Pose {
        /// Robot.
        robot: Name,
        /// In this map.
        map: String,
        /// Where it is.
        pose: v1::Pose2,
        /// Over (x, y, theta), row-major.
        covariance: Vec<f64>,
        /// Corrections by landmarks so far.
        corrections: u64,
        /// From the capture of what supports it to its publication.
        age_ms: f64,
        /// How far it is trusted.
        #[serde(serialize_with = "trust_word")]
        trust: v1::PoseTrust,
    },
    /// Odometry, put on the map.
    Odometry {
        /// Robot.
        robot: Name,
        /// In this map.
        map: String,
        /// Where odometry alone says it is.
        pose: v1::Pose2,
    },
    /// A simulator's truth.
    Truth {
        /// Robot.
        robot: Name,
        /// In this map.
        map: String,
        /// Where it really is.
        pose: v1::Pose2,
    },
    /// A robot came or went.
    Presence {
        /// Robot.
        robot: Name,
        /// Its map, if it has one.
        map: String,
        /// Came, or went.
        alive: bool,
    },
    /// A map has a new version, or is gone.
    MapChanged {
        /// Map.
        map: String,
        /// New version; absent when deleted.
        version: Option<u64>,
    },
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn trust_word<S: Serializer>(trust: &v1::PoseTrust, to: S) -> Result<S::Ok, S::Error> {
    protos::json::pose_trust::serialize(&i32::from(*trust), to)
}

impl LiveEvent {
    /// Name of the event in a stream of events.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Answer { .. } => "answer",
            Self::Pose { .. } => "pose",
            Self::Odometry { .. } => "odometry",
            Self::Truth { .. } => "truth",
            Self::Presence { .. } => "presence",
            Self::MapChanged { .. } => "map_changed",
        }
    }

    /// The map it belongs to.
    pub fn map(&self) -> &str {
        match self {
            Self::Answer { answer, .. } => &answer.map,
            Self::Pose { map, .. }
            | Self::Odometry { map, .. }
            | Self::Truth { map, .. }
            | Self::Presence { map, .. }
            | Self::MapChanged { map, .. } => map,
        }
    }
}
