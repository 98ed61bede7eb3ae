//! The verdict on one quad with the match candidates behind it.

use crate::{geometry::corners::Corners, model::landmark_id::LandmarkId, points::verify::PointEvidence};
use serde::{Deserialize, Serialize};

/// Why a candidate was refused although it was looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MatchRefusal {
    /// C^r is not below tau.
    Correlation,
    /// H^r is not below tau.
    Hausdorff,
    /// The gradient similarity after alignment does not reach its threshold.
    Similarity,
    /// The mismatch share is too great: it is like the landmark, but too much of it shows something else.
    Mismatch,
    /// It is like it, but hardly by more than the frame.
    LowContent,
    /// Accepted by its own thresholds, but another landmark is too close behind.
    Margin,
    /// So many points would agree by chance too often.
    Points,
    /// Its points are there, but a connected part of it shows something else: perhaps not the landmark that was taught.
    Disagreement,
    /// Its points agree, but do not tell where its corners are.
    Corners,
    /// Its icon alone speaks for it, where points decide: too little to name it without the robot's pose.
    Plain,
}

/// A landmark compared with one icon.
#[derive(Debug, Clone, PartialEq)]
pub struct MatchCandidate {
    /// The landmark.
    pub landmark: LandmarkId,
    /// C^r in [0, 2] (method 6.1): to the nearest exemplar, or, where the likeness refuses already, where the quad was
    /// found, to the exemplar nearest by its signature.
    pub correlation: f64,
    /// H^r in icon pixels times descriptor distance (method 6.2); infinite with too few points, and where another gate
    /// refuses already.
    pub hausdorff: f64,
    /// How alike the picture and the learnt icon are, one laid on the other, -1 to 1; 0 where a glance told them to
    /// be different things and nothing was accepted; `None` where the map's distances decide alone, and where points
    /// name a landmark at the border that was detected.
    pub likeness: Option<f64>,
    /// The deciding distance of the map's [`DistanceKind`](crate::recognise::distance_kind::DistanceKind).
    pub distance: f64,
    /// The deciding threshold.
    pub tau: f64,
    /// `distance / tau`; accepted only below 1.
    pub ratio: f64,
    /// `P(C_l | Q)` of method 10.
    pub probability: f64,
    /// The gate that refused it, if one did.
    pub refusal: Option<MatchRefusal>,
}

/// The paper's three cases. "Unknown" is an answer, not a failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// No landmark of the map.
    Unknown,
    /// Exactly this landmark: fit for a pose.
    Unique(LandmarkId),
    /// Several fit; this one is nearest. Never enough for a pose by itself.
    Ambiguous(LandmarkId),
}

/// What recognition says of one icon.
#[derive(Debug, Clone, PartialEq)]
pub struct RecognitionResult {
    /// The answer.
    pub verdict: Verdict,
    /// Nearest landmarks by increasing ratio, at most [`MAX_CANDIDATES`]; refused ones included.
    pub candidates: Vec<MatchCandidate>,
    /// The paper's m with the printed 1/(N+1), natural logarithm (method 10). Never a gate.
    pub entropy_m: f64,
    /// 1 - ln K / ln(N+1), in (0, 1].
    pub entropy_norm: f64,
    /// Chance that the identity is right, 0 to 1, learnt from data (`confidence.rs`); 0 unless `Unique`.
    pub confidence: f64,
    /// Which of the four corner rotations matched: corner `rotation` of the quad is the landmark's top-left.
    pub rotation: usize,
    /// Which border matched: 0 for the quad's corners, i for alternate i - 1.
    pub border: usize,
    /// The landmark's corners after its picture was laid on the learnt one, its top-left first; `None` when it was
    /// accepted where it stood. They differ from the quad's where another border of the same thing was taught.
    pub aligned_px: Option<Corners>,
    /// Landmarks compared (N).
    pub landmarks: usize,
    /// What points say of the first candidate, where they decided.
    pub points: Option<Box<PointEvidence>>,
}

/// Candidates kept in a verdict.
pub const MAX_CANDIDATES: usize = 5;
