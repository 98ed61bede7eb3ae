//! `/answers`: answers to frames that the server has stored.

use crate::v1::Answer;
use serde::{Deserialize, Serialize};

/// What came of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum AnswerStatus {
    /// A landmark was named.
    Matched,
    /// Some quad may be several landmarks, and none was named.
    Ambiguous,
    /// No quad is like a landmark.
    NoMatch,
    /// The frame was refused.
    Rejected,
    /// The frame waited too long.
    Expired,
    /// The server had no time for the frame.
    Overloaded,
    /// The server was not ready.
    NotReady,
    /// None of these: an answer of another build.
    Unspecified,
}

/// Which stored answers are listed, newest first.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
pub struct StoredAnswerQuery {
    /// Most items; 100 by default, bounded by `limits.page`.
    pub limit: Option<usize>,
    /// The `next` of the page before; absent for the first page.
    pub cursor: Option<String>,
    /// Only those about this map.
    pub map: Option<String>,
    /// Only those to this robot.
    pub robot: Option<String>,
    /// Only those to frames of this camera.
    pub camera: Option<String>,
    /// Only those that came out so.
    pub status: Option<AnswerStatus>,
    /// Only those without a pose for this reason, as `refusal` says it.
    pub refusal: Option<String>,
    /// Only those that name this landmark or were compared with it, by its name at that time.
    pub landmark: Option<String>,
    /// Only those stored at this time or later, ms since the Unix epoch.
    pub since_ms: Option<i64>,
    /// Only those stored before this time, ms since the Unix epoch.
    pub until_ms: Option<i64>,
}

/// A stored answer in brief.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct StoredAnswerSummary {
    /// Its number, never used again.
    pub id: i64,
    /// The map that the frame was compared with.
    pub map: String,
    /// The robot that sent the frame.
    pub robot: String,
    /// The camera that took it.
    pub camera: String,
    /// ms since the Unix epoch.
    pub stored_ms: i64,
    /// What came of the frame.
    pub status: AnswerStatus,
    /// Whether it gave a pose of the robot by the picture alone.
    pub has_pose: bool,
    /// Why there is no pose: the code of the frame's rejection; where no landmark was named, the gate that refused the nearest
    /// candidate; else the gate that refused the pose.
    pub refusal: Option<String>,
    /// The landmarks that it names, by their names at that time.
    pub landmarks: Vec<String>,
    /// The other landmarks that quads were compared with.
    pub candidates: Vec<String>,
}

/// A landmark beside a quad that was compared with it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LandmarkIcon {
    /// Its name at that time.
    pub landmark: String,
    /// Path of its icon as it was learnt; absent if there is no landmark with a model of this name any more.
    pub icon: Option<String>,
}

/// The pictures that belong to a quad of a stored answer.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct StoredQuad {
    /// Path of its icon; absent for quads that are too small, partly outside of the picture, or beyond the first eight.
    pub icon: Option<String>,
    /// The landmarks it was compared with, in the order of the answer's candidates.
    pub landmarks: Vec<LandmarkIcon>,
}

/// A stored answer with everything that was said.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct StoredAnswer {
    /// In brief.
    pub summary: StoredAnswerSummary,
    /// `Answer` of protos/waymark/v1/waymark.proto as JSON: quads with candidates, distances and thresholds, poses.
    #[cfg_attr(feature = "openapi", schema(value_type = Object))]
    pub answer: Answer,
    /// The pictures of its quads, in the order of `answer.quads`.
    pub quads: Vec<StoredQuad>,
}
