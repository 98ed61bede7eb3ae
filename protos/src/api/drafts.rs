//! `/maps/{map}/drafts`: drafts of maps, and what publishing them changes.

use super::{ChangeSummary, LandmarkDifference, Page, WallsDifference};
use serde::{Deserialize, Serialize};

/// A draft: a map of its own, made of another one and published to it as one commit.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Draft {
    /// Its name: every operation on maps takes it.
    pub name: String,
    /// The commit of the map that it began with.
    pub from_commit: u64,
    /// ms since the Unix epoch.
    pub created_ms: i64,
    /// That of the draft, as of any map.
    pub revision: String,
    /// Landmarks in it.
    pub landmarks: u64,
}

/// A draft to be.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct NewDraft {
    /// Its name: `[a-z0-9_-]{1,64}`, unique among maps and drafts.
    pub name: String,
}

/// What publishing a draft would change of its map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct DraftDifference {
    /// The commit of the map that the draft began with.
    pub from_commit: u64,
    /// What both have changed since, in words: while there is any, the draft cannot be published.
    pub conflicts: Vec<String>,
    /// Counts of all of it.
    pub summary: ChangeSummary,
    /// How the walls differ.
    pub walls: Option<WallsDifference>,
    /// The landmarks that differ.
    pub landmarks: Page<LandmarkDifference>,
}

/// How many frames a draft is tried with.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
pub struct ReplayQuery {
    /// Most frames, 1 to 100; 40 by default.
    pub frames: Option<usize>,
}

/// What robots on the map would be told otherwise if the draft were published: their last frames,
/// answered by map and draft.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Replay {
    /// Frames that were answered by both.
    pub frames: u64,
    /// Of those, the ones with equal answers.
    pub unchanged: u64,
    /// Counts of each robot, by name.
    pub robots: Vec<RobotReplay>,
    /// The frames with different answers, newest first in turn of their cameras.
    pub changes: Vec<ReplayChange>,
}

/// What the draft changes for one robot, in frames.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RobotReplay {
    /// Its name.
    pub robot: String,
    /// Frames of it.
    pub frames: u64,
    /// With equal answers.
    pub unchanged: u64,
    /// In which landmarks are not named any more.
    pub lost: u64,
    /// In which landmarks are named that were not.
    pub gained: u64,
    /// With a pose by the draft alone.
    pub pose_gained: u64,
    /// With a pose by the map alone.
    pub pose_lost: u64,
    /// With another pose.
    pub pose_moved: u64,
    /// Longest way between the two poses of a frame, m.
    pub longest_move_m: f64,
}

/// How the pose in an answer differs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum ReplayedPose {
    /// Within 1 mm and 1 mrad, or none by both.
    Same,
    /// By the draft alone.
    Gained,
    /// By the map alone.
    Lost,
    /// Another one.
    Moved,
}

/// A frame with different answers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ReplayChange {
    /// Who sent it.
    pub robot: String,
    /// By which camera.
    pub camera: String,
    /// Robot's clock at capture, ms since the Unix epoch.
    pub captured_ms: i64,
    /// Landmarks that the map names alone.
    pub lost: Vec<String>,
    /// Landmarks that the draft names alone.
    pub gained: Vec<String>,
    /// The robot's pose.
    pub pose: ReplayedPose,
    /// Between the two poses, m; null unless it is `moved`.
    pub distance_m: Option<f64>,
    /// Between the two headings, rad, 0 to pi; null unless it is `moved`.
    pub angle_rad: Option<f64>,
}
