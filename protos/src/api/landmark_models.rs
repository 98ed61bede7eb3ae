//! `.../landmarks/{landmark}/model`, `/distances`, `/icon` and `/maps/{map}/duplicates`: what was
//! learnt, and how it tells landmarks apart.

use serde::{Deserialize, Serialize};

/// What limits a threshold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum ThresholdLimit {
    /// The least weighted cost of errors.
    Cost,
    /// The nearest distance to another landmark or a distractor.
    NearestNegative,
    /// The greatest threshold that is ever used.
    AbsoluteCap,
}

/// A threshold with its evidence. A distance is accepted only when it is strictly below.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ThresholdBody {
    /// In the unit of the distance; 0 accepts nothing.
    pub threshold: f64,
    /// Share of other distances below it.
    pub false_positive_rate: f64,
    /// Share of own distances at or above it.
    pub false_negative_rate: f64,
    /// Own distances that it was fitted to.
    pub positives: usize,
    /// Distances to others that it was fitted to.
    pub negatives: usize,
    /// What limits it.
    pub limited_by: ThresholdLimit,
}

/// Costs that thresholds of the correlation and the Hausdorff distance weigh.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ThresholdWeights {
    /// Of a wrong acceptance.
    pub lambda: f64,
    /// Of a refused own view.
    pub mu: f64,
}

/// A Harris point of an exemplar with its descriptor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct HarrisPoint {
    /// To the right, in icon pixels.
    pub x_px: f32,
    /// Downwards, in icon pixels.
    pub y_px: f32,
    /// Harris response, grey levels to the fourth.
    pub response: f32,
    /// The seven components of the 7-jet, whitened: differences are in standard deviations.
    pub jet: [f32; 7],
}

/// Harris points of an exemplar.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct HarrisSet {
    /// Which exemplar, from 1.
    pub exemplar: usize,
    /// At most 60, by falling response.
    pub points: Vec<HarrisPoint>,
}

/// What is read of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
pub struct LandmarkModelQuery {
    /// `true` adds `harris`.
    pub harris: Option<bool>,
}

/// A stored picture of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum ModelPicture {
    /// The real icon nearest to the mean.
    #[default]
    Exemplar1,
    /// The real icon nearest to the first mode.
    Exemplar2,
    /// The real icon nearest to the second mode.
    Exemplar3,
    /// The mean of the views.
    Mean,
    /// The first mode: 128 is 0, and the largest entry is at 1 or 255.
    Mode1,
    /// The second mode.
    Mode2,
}

/// Which picture of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
pub struct ModelPictureQuery {
    /// `exemplar1` by default.
    pub which: Option<ModelPicture>,
}

/// A Harris point of the mean icon.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct IconKeypoint {
    /// To the right, in icon pixels.
    pub x_px: f32,
    /// Downwards, in icon pixels.
    pub y_px: f32,
}

/// A point of the landmark's photographs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LandmarkPoint {
    /// To the right, 0 to 1 over the landmark's width.
    pub x: f32,
    /// Downwards, 0 to 1 over the landmark's height.
    pub y: f32,
    /// Scale, in shares of the landmark's side.
    pub sigma: f32,
}

/// Memory of a model for one purpose.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct MemoryPart {
    /// What it holds.
    pub purpose: String,
    /// Bytes.
    pub bytes: usize,
}

/// What was learnt of a landmark.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LandmarkModelDetail {
    /// Its landmark.
    pub landmark: String,
    /// SHA-256 of the stored bytes, hexadecimal: the same digest is the same model.
    pub sha256: String,
    /// Whether it is matched.
    pub in_use: bool,
    /// Whether its points identify the landmark, and its icons never.
    pub named_by_points: bool,
    /// Views that it was learnt from, generated ones included.
    pub views: usize,
    /// How many of them were generated.
    pub generated_views: usize,
    /// Learnt icons: the mean, and up to two modes.
    pub exemplars: usize,
    /// Side of an icon, in icon pixels.
    pub icon_px: usize,
    /// Harris points of the mean icon.
    pub keypoints: Vec<IconKeypoint>,
    /// Points of up to three photographs, at most 240.
    pub points: Vec<LandmarkPoint>,
    /// Bits of the descriptor of one point.
    pub bits_per_point: u32,
    /// Share of the variance of the views that the leading modes explain, 0 to 1 each, falling.
    pub mode_shares: Vec<f64>,
    /// Harris points of each exemplar with their descriptors, where they are asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub harris: Vec<HarrisSet>,
    /// Threshold of the correlation distance, 0 to 2.
    pub correlation: ThresholdBody,
    /// Threshold of the Hausdorff distance.
    pub hausdorff: ThresholdBody,
    /// What these two weigh.
    pub weights: ThresholdWeights,
    /// Threshold of 1 minus the gradient similarity: its cap, or a share of the nearest negative.
    pub gradient_dissimilarity: ThresholdBody,
    /// Saliency, 0 to 1.
    pub saliency: f64,
    /// Keypoints of the mean icon that are found in the other views, too.
    pub stable_points: usize,
    /// Spread of the viewpoints of all views, generated ones included, 0 to 10. No gate takes it.
    pub visibility_confidence: f64,
    /// The same of photographed views only; 0 with fewer than two. The gate and the choice of gaze
    /// take this one.
    pub photographed_visibility_confidence: f64,
    /// Memory in use.
    pub memory: Vec<MemoryPart>,
}

/// Distances of one kind that a threshold was fitted to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct DistanceHistogram {
    /// Accepted below; 0 accepts nothing.
    pub threshold: f64,
    /// Width of a bin; the first begins at 0.
    pub bin_width: f64,
    /// Held-out distances of the landmark's own views, by bin.
    pub own: Vec<u32>,
    /// Own distances beyond the last bin, infinite ones included.
    pub own_beyond: u32,
    /// Distances to other landmarks and distractors, by bin; of these only the 64 nearest are
    /// stored.
    pub others: Vec<u32>,
    /// Distances to others that are in no bin: beyond the last one, or not among the nearest.
    pub others_beyond: u64,
}

/// How far a landmark's own views and everything else are from its model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LandmarkDistances {
    /// The landmark.
    pub landmark: String,
    /// The correlation distance, 0 to 2.
    pub correlation: DistanceHistogram,
    /// The Hausdorff distance.
    pub hausdorff: DistanceHistogram,
    /// 1 minus the gradient similarity.
    pub gradient_dissimilarity: DistanceHistogram,
}

/// How strongly the points of quads spoke for a landmark in the stored answers: heaps by the
/// negative decimal logarithm of the number of false alarms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LandmarkEvidence {
    /// The landmark.
    pub landmark: String,
    /// Stored answers that were read: the newest that name it or were compared with it, at
    /// most 500.
    pub answers: u64,
    /// Accepted from here upwards.
    pub threshold: f64,
    /// Width of a bin; the first begins at 0. The last has everything beyond, too.
    pub bin_width: f64,
    /// Quads that were named as it, by bin.
    pub named: Vec<u32>,
    /// Quads with its points while a part of it showed something else, by bin.
    pub doubtful: Vec<u32>,
    /// Quads named as it without points, by the picture as a whole.
    pub named_without_points: u32,
}

/// Which pairs of look-alikes are listed.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
pub struct DuplicateQuery {
    /// Most items; 100 by default, bounded by `limits.page`.
    pub limit: Option<usize>,
    /// The `next` of the page before; absent for the first page.
    pub cursor: Option<String>,
    /// Only pairs with this landmark.
    pub landmark: Option<String>,
    /// Only pairs of which one landmark is not in use, or pairs of which both are.
    pub in_use: Option<bool>,
}

/// Two landmarks that look alike.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct DuplicatePair {
    /// The landmark whose name comes first.
    pub first: String,
    /// The other one.
    pub second: String,
    /// Gradient similarity of the two, at most 1.
    pub gradient_similarity: f64,
    /// 1 minus that: what thresholds are compared with.
    pub distance: f64,
    /// Whether the first one is matched.
    pub first_in_use: bool,
    /// Whether the second one is matched.
    pub second_in_use: bool,
}
