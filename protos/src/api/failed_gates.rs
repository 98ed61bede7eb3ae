//! Failed quality gates of landmarks and tracks, in words for people.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A quality gate, or another reason why something is not in use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum GateBody {
    /// Too few views.
    Views,
    /// Nearly blank, or its views do not agree.
    Saliency,
    /// Too few details are found again.
    StablePoints,
    /// Too little beyond its frame.
    Content,
    /// Its views are too much alike.
    VisibilityConfidence,
    /// Not to be told from other things in the photographs, or its own views differ too much.
    NotDistinct,
    /// It looks like a landmark in use, and nothing tells the two apart: see `look_alike`.
    LooksLike,
    /// Its picture alone does not name it, since it looks like another one; a known pose does. See
    /// `look_alike`.
    ByPoseOnly,
    /// Its stored model cannot be used.
    StoredModel,
    /// Of a track: others look like it or are at the same place.
    SimilarTracks,
    /// Of a track: it was taken for a landmark of the map, or nearly.
    KnownLandmark,
}

/// A landmark that looks like another one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LookAlikeBody {
    /// Name of the other landmark.
    pub landmark: String,
    /// Gradient similarity of the two, at most 1.
    pub gradient_similarity: f64,
}

/// Why a landmark is not in use, or a track should not become one. A reason occurs once.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct FailedGate {
    /// Which gate, for programs.
    pub gate: GateBody,
    /// What is wrong: one sentence for a person.
    pub sentence: String,
    /// What to do: one sentence for a person.
    pub advice: String,
    /// With `looks_like` and `by_pose_only`: the other landmark, unless it is gone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub look_alike: Option<LookAlikeBody>,
}

impl fmt::Display for FailedGate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.sentence, self.advice)
    }
}
