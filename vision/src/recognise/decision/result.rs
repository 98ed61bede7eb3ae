//! The verdict on one quad with the match candidates behind it.

use crate::{
    geometry::corners::Corners, model::landmark_id::LandmarkId, paper::entropy::Possibilities,
    points::verify::PointEvidence,
};
use serde::{Deserialize, Serialize};

/// Why a candidate was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MatchRefusal {
    /// C^r is not below its threshold.
    Correlation,
    /// H^r is not below its threshold.
    Hausdorff,
    /// Too dissimilar after alignment: the gradient similarity is below its threshold.
    Similarity,
    /// Similar, but too many parts mismatch.
    Mismatch,
    /// Similar, but hardly beyond the frame.
    LowContent,
    /// Accepted by its own thresholds, but another landmark, or the same one turned, is too close
    /// behind.
    Margin,
    /// The point evidence may be chance.
    Points,
    /// Its points agree, but a connected part mismatches: perhaps not the taught landmark.
    Disagreement,
    /// Its points agree, but do not determine its corners.
    Corners,
    /// Only its icon agrees, where points decide: not enough to identify it without the robot's
    /// pose.
    Plain,
}

/// A landmark compared with one quad.
#[derive(Debug, Clone, PartialEq)]
pub struct MatchCandidate {
    /// The landmark.
    pub landmark: LandmarkId,
    /// What was compared.
    pub evidence: Evidence,
    /// The deciding distance over its threshold; accepted only below 1.
    pub ratio: f64,
    /// `P(C_l | Q)` of method 10.
    pub probability: f64,
    /// The gate that refused it, if one did.
    pub refusal: Option<MatchRefusal>,
}

/// What a landmark was compared by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Evidence {
    /// Points, by their expected false alarms.
    Points {
        /// Likeness of the picture to the learnt icon after alignment, -1 to 1; `None` where it was
        /// not aligned.
        likeness: Option<f64>,
    },
    /// Icons.
    Icon(IconEvidence),
}

/// Distances between the icon of a quad and those of a landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IconEvidence {
    /// C^r in [0, 2] (method 6.1): to the nearest exemplar, or, where the likeness refuses already,
    /// at the detected corners to the exemplar nearest by its signature.
    pub correlation: f64,
    /// H^r in icon pixels times descriptor distance (method 6.2); infinite with too few points, and
    /// where another gate refuses first.
    pub hausdorff: f64,
    /// Likeness of the picture to the learnt icon after alignment, -1 to 1; 0 where the coarse
    /// level rejected it and nothing was accepted; `None` where the map's distances decide alone.
    pub likeness: Option<f64>,
    /// The deciding distance of the map's
    /// [`DistanceKind`](crate::recognise::distance_kind::DistanceKind).
    pub distance: f64,
    /// The deciding threshold.
    pub tau: f64,
}

/// The paper's three cases. "Unknown" is an answer, not a failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// No landmark of the map.
    Unknown,
    /// Exactly this landmark: fit for a pose.
    Unique(LandmarkId),
    /// Several match; this one is nearest. Never used for a pose by itself.
    Ambiguous(LandmarkId),
}

/// The result of recognising one quad.
#[derive(Debug, Clone, PartialEq)]
pub struct RecognitionResult {
    /// The answer.
    pub verdict: Verdict,
    /// Nearest landmarks by increasing ratio, at most [`MAX_CANDIDATES`]; refused ones included.
    pub candidates: Vec<MatchCandidate>,
    /// What the quad may be (method 10): probabilities and entropies follow. Never a gate.
    pub possibilities: Possibilities,
    /// Probability that the identity is right, 0 to 1 (`confidence.rs`); 0 unless `Unique`.
    pub confidence: f64,
    /// Which of the four corner rotations matched: corner `rotation` of the quad is the landmark's
    /// top-left.
    pub rotation: usize,
    /// Which border matched: 0 for the quad's corners, i for alternate i - 1.
    pub border: usize,
    /// The landmark's corners after alignment, its top-left first; `None` when it was accepted at
    /// the detected corners. They differ from the quad's where another border of the same object
    /// was taught.
    pub aligned_px: Option<Corners>,
    /// Landmarks compared (N).
    pub landmarks: usize,
    /// Point evidence for the first candidate, where points decided.
    pub points: Option<Box<PointEvidence>>,
}

/// Candidates kept in a verdict.
pub const MAX_CANDIDATES: usize = 5;
