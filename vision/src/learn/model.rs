//! What is known of one landmark's appearance (method 7 to 9): the views it is learnt from, the model itself, and
//! whether the model may be used.
//!
//! How a model is made is in `lesson.rs`, how it is stored in `stored.rs`.

use super::{
    exemplar::Exemplar,
    gates::GateParams,
    synthesis::SynthesisParams,
    threshold::{Threshold, ThresholdError, ThresholdParams},
};
use crate::{
    detect::quads::Corners,
    frame::GrayImage,
    icon::{Icon, IconError, icon},
    params::{Params, RecogniseParams},
    points::taught::{TaughtPoint, landmark_points},
    recognise::{IconFeatures, LandmarkId, correlation::correlation, hausdorff::hausdorff},
};
use serde::{Deserialize, Serialize};

pub use super::{
    fitting::{add_negatives, refit_thresholds, unlikeness_of},
    lesson::learn,
    stored::StoredModelError,
};

/// Most views one model is learnt from.
pub const MAX_VIEWS: usize = 200;
/// Exemplars of a model: the mean and two modes.
pub const MAX_EXEMPLARS: usize = 3;

/// Parameters of learning.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LearnParams {
    /// Choice of tau.
    pub threshold: ThresholdParams,
    /// tau of C^r is never larger. Measured with the cap of H^r on 287 paintings, each taught alone from one
    /// photograph, without negatives, and 2281 quads of other photographs (2102 of them cut at random): of 654 000
    /// comparisons with the wrong painting both distances accepted 3, all of one look-alike; of 162 taught paintings
    /// 150 were accepted.
    pub correlation_cap: f64,
    /// tau of H^r is never larger. Measured as above.
    pub hausdorff_cap: f64,
    /// The distance of slopes after alignment (1 minus their likeness) is accepted below this, whatever the others are
    /// like. Chosen on 107 photographs of taught paintings; with the thresholds learnt from the others, none of 732
    /// quads of other buildings was accepted.
    pub likeness_cap: f64,
    /// From this many views on, own distances are measured by folds; below, by leaving the exemplars out.
    pub min_views_for_folds: usize,
    /// Number of folds.
    pub folds: usize,
    /// Gates.
    pub gates: GateParams,
    /// Generated views.
    pub synthesis: SynthesisParams,
}

impl Default for LearnParams {
    fn default() -> Self {
        Self {
            threshold: ThresholdParams::default(),
            correlation_cap: 0.5,
            hausdorff_cap: 8.0,
            likeness_cap: 0.55,
            min_views_for_folds: 40,
            folds: 5,
            gates: GateParams::default(),
            synthesis: SynthesisParams::default(),
        }
    }
}

/// One sighting of a landmark, to learn from.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// The rectified picture, cut out along corners as inexact as the detector's.
    pub icon: Icon,
    /// The same along its true corners, where those are known: of a generated view. What is laid on it is as exact as they.
    pub exact: Option<Icon>,
    /// Where it was in the image.
    pub corners_px: Corners,
    /// Width and height of that image.
    pub image_size_px: [usize; 2],
    /// Generated from a photograph, not photographed: see [`super::synthesis`].
    pub generated: bool,
}

impl View {
    /// Cuts the landmark at `corners_px` out of a photograph.
    pub fn photographed(image: &GrayImage, corners_px: &Corners, p: &Params) -> Result<Self, IconError> {
        let icon = icon(image, corners_px, &p.icon)?;
        let image_size_px = [image.width(), image.height()];
        Ok(Self { icon, exact: None, corners_px: *corners_px, image_size_px, generated: false })
    }
}

/// Both distances of one icon to one landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distances {
    /// C^r, 0 to 2.
    pub correlation: f64,
    /// H^r, 0 or more, infinite with too few points.
    pub hausdorff: f64,
}

/// Distances that a threshold was fitted to, as 32-bit floats: kept, so that tau can be fitted again when other
/// landmarks come and go.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Evidence {
    /// Held-out distances of the landmark's own views, rising.
    pub own: Vec<f32>,
    /// The smallest distances of everything else, rising; at most [`Evidence::MAX_NEAREST`].
    pub nearest_others: Vec<f32>,
    /// How many other distances there were (n-).
    pub others: usize,
}

impl Evidence {
    /// Other distances kept; the rest are only counted.
    pub const MAX_NEAREST: usize = 64;
}

/// The learnt appearance of one landmark.
#[derive(Debug, Clone, PartialEq)]
pub struct LandmarkModel {
    /// Whose it is.
    pub id: LandmarkId,
    /// [`Params::distance_hash`] of the parameters it was learnt under. Its thresholds mean nothing under others.
    pub params_hash: u64,
    /// Views it was learnt from (`N_l`).
    pub views: usize,
    /// How many of them were generated. Where that is all but one, whether the landmark is flat and how it looks in
    /// another light was never seen: `v_c` and saliency then say what the model is prepared for, not what was observed.
    pub generated_views: usize,
    /// One to three icons that stand for the mean and the leading modes, grey levels whole numbers.
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
    /// What tau of C^r was fitted to.
    pub correlation_evidence: Evidence,
    /// What tau of H^r was fitted to.
    pub hausdorff_evidence: Evidence,
    /// What tau of the likeness was fitted to; those that are nothing like it by their signature count as infinitely far.
    pub likeness_evidence: Evidence,
    /// Saliency F (method 9).
    pub saliency_f: f64,
    /// Points of the first exemplar that come back in the other views.
    pub stable_points: usize,
    /// F and stable points in one number, 0 to 1.
    pub saliency: f64,
    /// Visibility confidence: how far apart the views are. Over all views, generated ones included.
    pub v_c: f64,
    /// The same over photographed views only; 0 with fewer than two.
    pub photographed_v_c: f64,
    /// Whether it may be used.
    pub status: ModelStatus,
    /// Points of up to three photographed views (`points/`). Empty where none were given, and in models that were stored
    /// before there were any: see [`LandmarkModel::knows_points`].
    pub points: Vec<TaughtPoint>,
    /// Points were looked for, even if none were found.
    pub knows_points: bool,
}

impl LandmarkModel {
    /// The same model with the points of its photographed views, each as [`crate::points::taught::view_points`] gives
    /// them.
    #[must_use]
    pub fn with_points(mut self, views: &[Vec<TaughtPoint>]) -> Self {
        self.points = landmark_points(views);
        self.knows_points = true;
        self
    }

    /// The same model, with points where the settings decide by them; `views` is only called then.
    #[must_use]
    pub fn with_points_if_used(self, p: &Params, views: impl FnOnce() -> Vec<Vec<TaughtPoint>>) -> Self {
        if p.recognise.verdict.points { self.with_points(&views()) } else { self }
    }

    /// Whether it has so many points that its icons never name it.
    pub fn is_named_by_points(&self, p: &Params) -> bool {
        p.recognise.verdict.points && self.points.len() > p.recognise.verdict.max_icon_points
    }

    /// `D(Q, C_l)`: the smallest distance to any exemplar (A17), each of the two by itself.
    pub fn distances(&self, icon: &IconFeatures, p: &RecogniseParams) -> Distances {
        distances(&self.features(p), icon, p)
    }

    /// The exemplars with all that is asked of them.
    pub fn features(&self, p: &RecogniseParams) -> Vec<IconFeatures> {
        self.exemplars.iter().map(|e| e.features(p)).collect()
    }

    /// Learnt from generated views, at least in part.
    pub fn views_generated(&self) -> bool {
        self.generated_views > 0
    }

    /// Memory that it takes, in bytes, by what it is for.
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

    /// Not in use, as a distance does not tell it from others, whatever other gates it fails.
    pub fn overlaps_others(&self) -> bool {
        let ModelStatus::Candidate(failures) = &self.status else { return false };
        let overlap = ThresholdError::Overlap;
        failures.iter().any(|f| f.gate.threshold_error() == Some(overlap))
    }

    /// Not in use for no other reason than that other landmarks look like it.
    pub fn is_kept_out_by_look_alikes(&self) -> bool {
        let ModelStatus::Candidate(failures) = &self.status else { return false };
        !failures.is_empty() && failures.iter().all(|f| f.gate.threshold_error().is_some())
    }
}

/// The smallest of each distance of `icon` to the exemplars.
pub(super) fn distances(exemplars: &[IconFeatures], icon: &IconFeatures, p: &RecogniseParams) -> Distances {
    let far = Distances { correlation: f64::INFINITY, hausdorff: f64::INFINITY };
    exemplars.iter().fold(far, |least, exemplar| Distances {
        correlation: least.correlation.min(correlation(icon, exemplar, &p.correlation)),
        hausdorff: least.hausdorff.min(hausdorff(&icon.points, &exemplar.points, &p.hausdorff)),
    })
}

/// Whether a model may be used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ModelStatus {
    /// Passed every gate: fit for recognition and pose.
    Active,
    /// Failed these gates: kept, may collect more views, is not used.
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
    /// Stable points: where neither of the paper's distances has a threshold.
    StablePoints,
    /// What it shows beyond its frame.
    Content,
    /// Visibility confidence `v_c`.
    VisibilityConfidence,
    /// C^r has no threshold.
    CorrelationThreshold(ThresholdError),
    /// H^r has no threshold.
    HausdorffThreshold(ThresholdError),
    /// The likeness has no threshold.
    LikenessThreshold(ThresholdError),
}

impl Gate {
    /// Why a distance has no threshold, if that is what failed.
    fn threshold_error(self) -> Option<ThresholdError> {
        match self {
            Self::LikenessThreshold(error)
            | Self::CorrelationThreshold(error)
            | Self::HausdorffThreshold(error) => Some(error),
            Self::Views
            | Self::Saliency
            | Self::StablePoints
            | Self::Content
            | Self::VisibilityConfidence => None,
        }
    }
}

/// A failed gate, with its number and its limit. For a missing threshold both are 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GateFailure {
    /// Which gate.
    pub gate: Gate,
    /// What was measured.
    pub value: f64,
    /// What it must reach.
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
                "beyond its frame it shows {value:.1} of 21 parts, at least {limit} needed: any blank board looks like it"
            ),
            Gate::VisibilityConfidence => {
                write!(f, "visibility confidence {value:.3}, at least {limit} needed: views from elsewhere")
            }
            Gate::CorrelationThreshold(reason) => write!(f, "no threshold for the correlation: {reason}"),
            Gate::HausdorffThreshold(reason) => write!(f, "no threshold for the point distance: {reason}"),
            Gate::LikenessThreshold(reason) => write!(f, "no threshold for the likeness: {reason}"),
        }
    }
}

/// Why nothing could be learnt.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LearnError {
    /// No view.
    #[error("views: none given")]
    NoView,
    /// Too many views.
    #[error("views: {found} given, at most {MAX_VIEWS} allowed")]
    TooManyViews {
        /// How many.
        found: usize,
    },
    /// A view's icon has another size than the parameters say.
    #[error("views: icon {index} is {found} px wide, the parameters say {expected}")]
    IconSize {
        /// Which view.
        index: usize,
        /// Its icon's side in pixels.
        found: usize,
        /// The side the parameters ask for.
        expected: usize,
    },
    /// A view's icon holds numbers that are no grey levels, or the components do not converge.
    #[error("views: the icons have no principal components")]
    NoComponents,
}
