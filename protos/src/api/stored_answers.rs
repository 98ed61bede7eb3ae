//! `/answers`: answers to frames that the server has stored.

use crate::v1::{Answer, Pose2Covariance};
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
    /// Why there is no pose: the code of the frame's rejection; where no landmark was named, the
    /// gate that refused the nearest candidate; else the gate that refused the pose.
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
    /// Path of its icon as it was learnt; absent if there is no landmark with a model of this name
    /// any more.
    pub icon: Option<String>,
}

/// A point of a quad that is like a point of a landmark.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct PointMatch {
    /// Place in the quad's icon: (0, 0) is its top-left corner, (1, 1) its bottom-right one; a
    /// little outside is possible.
    #[cfg_attr(feature = "openapi", schema(value_type = super::arrays::Pair))]
    pub seen: [f64; 2],
    /// Place in the landmark's icon, likewise.
    #[cfg_attr(feature = "openapi", schema(value_type = super::arrays::Pair))]
    pub taught: [f64; 2],
    /// Whether it agrees with the others on where the landmark is.
    pub agrees: bool,
}

/// The points of a quad that are like points of a landmark.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct QuadMatches {
    /// The landmark that is named, else the nearest candidate, by its name at that time.
    pub landmark: String,
    /// At most 100, those that agree first.
    pub matches: Vec<PointMatch>,
}

/// Whose pose a picture was compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum PriorSource {
    /// The robot sent it with its frame: a pose beyond the limit is refused.
    Robot,
    /// The server had it of earlier frames and odometry: it only chooses between two solutions of
    /// the picture.
    Server,
}

/// The pose of the robot that was known without a picture, and the pose by the picture alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct PriorCheck {
    /// Whose pose it is.
    pub source: PriorSource,
    /// The pose without the picture, map frame, with covariance.
    pub prior: Pose2Covariance,
    /// The pose by the landmarks of the picture: of several solutions the nearest to the prior,
    /// also where it was refused; null where the picture gives none.
    pub seen: Option<Pose2Covariance>,
    /// Squared Mahalanobis distance of the two, under the sum of their covariances.
    pub distance2: Option<f64>,
    /// The largest distance that a robot's prior lets pass.
    pub limit: f64,
    /// The pose was refused for it: `refusal` is `gate_prior`.
    pub refused: bool,
}

/// The pictures that belong to a quad of a stored answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct StoredQuad {
    /// Path of its icon; absent for quads that are too small, partly outside of the picture, or
    /// beyond the first eight.
    pub icon: Option<String>,
    /// The landmarks it was compared with, in the order of the answer's candidates.
    pub landmarks: Vec<LandmarkIcon>,
    /// Its points that are like those of the best candidate; null without an icon, and where that
    /// has no points.
    pub matched: Option<QuadMatches>,
}

/// A stored answer with everything that was said.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct StoredAnswer {
    /// In brief.
    pub summary: StoredAnswerSummary,
    /// `Answer` of protos/waymark/v1/waymark.proto as JSON: quads with candidates, distances and
    /// thresholds, poses.
    pub answer: Answer,
    /// The pictures of its quads, in the order of `answer.quads`.
    pub quads: Vec<StoredQuad>,
    /// The pose before the frame and that by the frame; null where none was known before.
    pub prior_check: Option<PriorCheck>,
}
