//! What happens now: trajectories of a robot, and the events of a map.

use super::robots::PoseTrust;
use crate::v1::{Answer, Pose2};
use serde::{Deserialize, Serialize};

/// Where a robot was lately, by source; oldest first, at most 2000 of each.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct TrajectoriesBody {
    /// Fused poses.
    pub pose: Vec<Pose2>,
    /// Odometry alone, laid on the map at the robot's first known pose.
    pub odometry: Vec<Pose2>,
    /// The truth, where a simulator tells it.
    pub truth: Vec<Pose2>,
}

/// An event of a map's stream. Its name is the variant in snake case; its data are the fields as
/// JSON.
#[derive(Debug, Clone, PartialEq)]
pub enum LiveEventBody {
    /// A frame was answered.
    Answer(Box<LiveAnswer>),
    /// A fused pose.
    Pose(LivePose),
    /// Where odometry alone says that a robot is.
    Odometry(LivePosition),
    /// Where a robot really is, told by a simulator.
    Truth(LivePosition),
    /// A robot came or went.
    Presence(LivePresence),
    /// A map has a new version, or is gone.
    MapChanged(MapChangeBody),
    /// The reader was too slow: so many events are missing here.
    Missed(u64),
}

/// The data of an event of a map's stream, for the document: the name of the event says which of
/// these it is. `odometry` and `truth` are positions; `missed` is the number of events that a slow
/// reader has missed.
#[cfg(feature = "openapi")]
#[derive(Debug, Serialize, utoipa::ToSchema)]
#[serde(untagged)]
pub enum LiveEventData {
    /// `answer`.
    Answer(Box<LiveAnswer>),
    /// `pose`.
    Pose(LivePose),
    /// `odometry` and `truth`.
    Position(LivePosition),
    /// `presence`.
    Presence(LivePresence),
    /// `map_changed`.
    MapChanged(MapChangeBody),
    /// `missed`.
    Missed(u64),
}

impl LiveEventBody {
    /// Reads an event by its name; `None` for a name that is not known here.
    pub fn read(name: &str, data: &str) -> Result<Option<Self>, serde_json::Error> {
        Ok(Some(match name {
            "answer" => Self::Answer(serde_json::from_str(data)?),
            "pose" => Self::Pose(serde_json::from_str(data)?),
            "odometry" => Self::Odometry(serde_json::from_str(data)?),
            "truth" => Self::Truth(serde_json::from_str(data)?),
            "presence" => Self::Presence(serde_json::from_str(data)?),
            "map_changed" => Self::MapChanged(serde_json::from_str(data)?),
            "missed" => Self::Missed(serde_json::from_str(data)?),
            _ => return Ok(None),
        }))
    }
}

/// The answer to a frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LiveAnswer {
    /// Name of the robot.
    pub robot: String,
    /// Name of its camera.
    pub camera: String,
    /// What was answered, the map's name included.
    pub answer: Answer,
}

/// A fused pose, as it was published.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LivePose {
    /// Name of the robot.
    pub robot: String,
    /// The map it is a pose in.
    pub map: String,
    /// Where the robot is.
    pub pose: Pose2,
    /// Over (x, y, theta), row-major.
    pub covariance: Vec<f64>,
    /// Corrections by landmarks so far.
    pub corrections: u64,
    /// From the capture of what supports it to its publication.
    pub age_ms: f64,
    /// How far it is trusted.
    pub trust: PoseTrust,
}

/// A pose without covariance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LivePosition {
    /// Name of the robot.
    pub robot: String,
    /// The map it is a pose in.
    pub map: String,
    /// Where the robot is.
    pub pose: Pose2,
}

/// A robot came or went.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LivePresence {
    /// Name of the robot.
    pub robot: String,
    /// Its map, if it has one; else empty.
    pub map: String,
    /// Came, or went.
    pub alive: bool,
}

/// A map has a new version, or is gone.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct MapChangeBody {
    /// Name of the map.
    pub map: String,
    /// New version; absent when deleted.
    pub version: Option<u64>,
}
