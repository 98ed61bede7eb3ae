//! The learnt appearance of one landmark, and whether it may be used (method 7 to 9).
//! `learn/lesson.rs` makes it, `model_bytes.rs` stores it.

use crate::{
    model::{
        components::Components,
        exemplar::Exemplar,
        landmark_id::LandmarkId,
        seen_from::SeenFrom,
        threshold::{Threshold, ThresholdError},
    },
    params::Params,
    points::taught::{TaughtPoint, landmark_points},
    recognise::{
        features::{correlation::correlation, hausdorff::hausdorff, icon_features::IconFeatures},
        params::RecogniseParams,
    },
};
use serde::{Deserialize, Serialize};

/// Most views one model is learnt from.
pub const MAX_VIEWS: usize = 200;
/// Exemplars of a model: the mean and two modes.
pub const MAX_EXEMPLARS: usize = 3;

/// Least `v_c` of a landmark for the choice of gaze, half the gate: few photographs do not say that
/// it cannot be seen from elsewhere.
const V_C_FLOOR: f64 = 0.25;

/// Both distances of one icon to one landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distances {
    /// C^r, 0 to 2.
    pub correlation: f64,
    /// H^r, 0 or more, infinite with too few points.
    pub hausdorff: f64,
}

/// Distances that a threshold was fitted to, as 32-bit floats: stored, so that tau can be fitted
/// again when other landmarks are added or removed.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DistanceSamples {
    /// Held-out distances of the landmark's own views, rising.
    pub own: Vec<f32>,
    /// The smallest negative distances, rising; at most [`DistanceSamples::MAX_NEAREST`].
    pub nearest_others: Vec<f32>,
    /// Number of negative distances (n-).
    pub others: usize,
}

impl DistanceSamples {
    /// Most negative distances stored; the rest are only counted.
    pub const MAX_NEAREST: usize = 64;
}

/// The learnt appearance of one landmark.
#[derive(Debug, Clone, PartialEq)]
pub struct LandmarkModel {
    /// The landmark.
    pub id: LandmarkId,
    /// [`Params::distance_hash`] of the parameters it was learnt under. Its thresholds are invalid
    /// under others.
    pub params_hash: u64,
    /// Views it was learnt from (`N_l`).
    pub views: usize,
    /// How many of them were generated. Where that is all but one, `v_c` and saliency describe the
    /// generated variation, not observed variation.
    pub generated_views: usize,
    /// One to three exemplars of the mean and the leading modes, grey levels whole numbers.
    pub exemplars: Vec<Exemplar>,
    /// Variance along the leading modes, falling; squared grey levels summed over the icon.
    pub eigenvalues: Vec<f64>,
    /// Sum of all eigenvalues.
    pub total_variance: f64,
    /// tau of C^r.
    pub correlation: Threshold,
    /// tau of H^r.
    pub hausdorff: Threshold,
    /// tau of 1 minus the likeness after alignment.
    pub likeness: Threshold,
    /// Distances that tau of C^r was fitted to.
    pub correlation_evidence: DistanceSamples,
    /// Distances that tau of H^r was fitted to.
    pub hausdorff_evidence: DistanceSamples,
    /// Values of 1 minus likeness that tau was fitted to; infinite for negatives with dissimilar
    /// signatures.
    pub likeness_evidence: DistanceSamples,
    /// Saliency F (method 9).
    pub saliency_f: f64,
    /// Points of the first exemplar that are found in the other views.
    pub stable_points: usize,
    /// F and stable points in one number, 0 to 1.
    pub saliency: f64,
    /// Visibility confidence `v_c`: the spread of the viewpoints. Over all views, generated ones
    /// included.
    pub v_c: f64,
    /// The same over photographed views only; 0 with fewer than two. The gate and the choice of
    /// gaze take this one.
    pub photographed_v_c: f64,
    /// From where the photographs show it.
    pub seen_from: SeenFrom,
    /// Mean and modes of its views, for people. Empty where the caller needs none in memory.
    pub components: Components,
    /// Whether it may be used.
    pub status: ModelStatus,
    /// Gates that it does not pass and that do not keep it out of use.
    pub waived: Vec<GateFailure>,
    /// Points of up to three photographed views (`points/`). Empty where none were given.
    pub points: Vec<TaughtPoint>,
}

impl LandmarkModel {
    /// The same model with the points of its photographed views, each as
    /// [`crate::points::taught::view_points`] gives them.
    #[must_use]
    pub fn with_points(mut self, views: &[Vec<TaughtPoint>]) -> Self {
        self.points = landmark_points(views);
        self
    }

    /// `v_c` for the choice of gaze (method 14): that of the photographs, and a floor.
    pub fn v_c_for_gaze(&self) -> f64 {
        self.photographed_v_c.max(V_C_FLOOR)
    }

    /// Whether it has so many points that its icons never identify it.
    pub fn is_named_by_points(&self, p: &Params) -> bool {
        p.recognise.verdict.points && self.points.len() > p.recognise.verdict.max_icon_points
    }

    /// `D(Q, C_l)`: the smallest distance to any exemplar (A17), each of the two by itself.
    pub fn distances(&self, icon: &IconFeatures, p: &RecogniseParams) -> Distances {
        distances(&self.features(p), icon, p)
    }

    /// The features of all exemplars.
    pub fn features(&self, p: &RecogniseParams) -> Vec<IconFeatures> {
        self.exemplars.iter().map(|e| e.features(p)).collect()
    }

    /// Its memory by purpose, bytes.
    pub fn memory_parts(&self) -> Vec<(&'static str, usize)> {
        let evidence = [&self.correlation_evidence, &self.hausdorff_evidence, &self.likeness_evidence];
        let distances: usize = evidence.iter().map(|e| e.own.len() + e.nearest_others.len()).sum();
        let mut parts = vec![
            ("points", self.points.len() * size_of::<TaughtPoint>()),
            ("evidence", size_of::<f32>() * distances),
            ("other", size_of::<Self>() + size_of::<f64>() * self.eigenvalues.len()),
        ];
        parts.extend(self.exemplars.iter().flat_map(Exemplar::memory_parts));
        parts
    }

    /// Passed every gate.
    pub fn is_active(&self) -> bool {
        self.status == ModelStatus::Active
    }

    /// Not in use because a distance does not separate it from others, whatever other gates it
    /// fails.
    pub fn overlaps_others(&self) -> bool {
        let ModelStatus::Candidate(failures) = &self.status else { return false };
        let overlap = ThresholdError::Overlap;
        failures.iter().any(|f| f.gate.threshold_error() == Some(overlap))
    }

    /// Not in use only because other landmarks are look-alikes of it.
    pub fn is_kept_out_by_look_alikes(&self) -> bool {
        let ModelStatus::Candidate(failures) = &self.status else { return false };
        !failures.is_empty() && failures.iter().all(|f| f.gate.threshold_error().is_some())
    }
}

/// The smallest of each distance of `icon` to the exemplars.
pub(crate) fn distances(exemplars: &[IconFeatures], icon: &IconFeatures, p: &RecogniseParams) -> Distances {
    let far = Distances { correlation: f64::INFINITY, hausdorff: f64::INFINITY };
    exemplars.iter().fold(far, |least, exemplar| Distances {
        correlation: least.correlation.min(correlation(&icon.buckets, &exemplar.buckets, &p.correlation)),
        hausdorff: least.hausdorff.min(hausdorff(&icon.points, &exemplar.points, &p.hausdorff)),
    })
}

/// Whether a model may be used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ModelStatus {
    /// Passed every gate: fit for recognition and pose.
    Active,
    /// Failed these gates: stored, may collect more views, is not used.
    Candidate(Vec<GateFailure>),
}

/// A gate that a model can fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Gate {
    /// Number of views.
    Views,
    /// Saliency F.
    Saliency,
    /// Stable points.
    StablePoints,
    /// Content beyond its frame.
    Content,
    /// Visibility confidence `v_c` of the photographs, which show it from there.
    VisibilityConfidence(SeenFrom),
    /// C^r has no threshold.
    CorrelationThreshold(ThresholdError),
    /// H^r has no threshold.
    HausdorffThreshold(ThresholdError),
    /// The likeness has no threshold.
    LikenessThreshold(ThresholdError),
}

impl Gate {
    /// Why a distance has no threshold, if this gate is a missing threshold.
    fn threshold_error(self) -> Option<ThresholdError> {
        match self {
            Self::LikenessThreshold(error)
            | Self::CorrelationThreshold(error)
            | Self::HausdorffThreshold(error) => Some(error),
            Self::Views
            | Self::Saliency
            | Self::StablePoints
            | Self::Content
            | Self::VisibilityConfidence(_) => None,
        }
    }
}

/// A failed gate, with its number and its limit. For a missing threshold both are 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GateFailure {
    /// Which gate.
    pub gate: Gate,
    /// The measured value.
    pub value: f64,
    /// The limit.
    pub limit: f64,
}

impl std::fmt::Display for GateFailure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { value, limit, .. } = self;
        match self.gate {
            Gate::Views => write!(f, "{value:.0} views, at least {limit:.0} needed"),
            Gate::Saliency => write!(f, "saliency F {value:.2}, at least {limit} needed"),
            Gate::StablePoints => write!(f, "{value:.0} stable points, at least {limit:.0} needed"),
            Gate::Content => write!(
                f,
                "content beyond its frame in {value:.1} of 21 parts, at least {limit} needed: a blank board would look like it"
            ),
            Gate::VisibilityConfidence(_) => write!(
                f,
                "visibility confidence {value:.3} of the photographs, at least {limit} needed: add some from other viewpoints"
            ),
            Gate::CorrelationThreshold(reason) => write!(f, "no threshold for the correlation: {reason}"),
            Gate::HausdorffThreshold(reason) => write!(f, "no threshold for the point distance: {reason}"),
            Gate::LikenessThreshold(reason) => write!(f, "no threshold for the likeness: {reason}"),
        }
    }
}
