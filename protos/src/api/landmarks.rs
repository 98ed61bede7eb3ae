//! `/maps/{map}/landmarks`: landmarks with size, place, model and health.

use super::{failed_gates::FailedGate, page::ListOrder};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fmt;

/// Which landmarks of a map are listed, in which order, and which page of them.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
pub struct LandmarkQuery {
    /// Most items; 100 by default, bounded by `limits.page`.
    pub limit: Option<usize>,
    /// The `next` of the page before; absent for the first page.
    pub cursor: Option<String>,
    /// Only those whose name contains this.
    pub name: Option<String>,
    /// `name` by default.
    pub sort: Option<ListOrder>,
    /// Only those that have come so far.
    pub status: Option<LandmarkStatus>,
    /// Only those that are trusted so far.
    pub health: Option<LandmarkHealthBody>,
    /// Only those with a place, or those without.
    pub has_place: Option<bool>,
}

/// Landmarks to be made together: all, or none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct NewLandmarks {
    /// 1 to 2000.
    pub landmarks: Vec<NewLandmark>,
}

/// A landmark to be deleted.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LandmarkDeletion {
    /// Its name.
    pub name: String,
    /// The revision that is meant; absent for whatever is there.
    pub revision: Option<String>,
}

/// Landmarks to be deleted together: all, or none.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LandmarkDeletions {
    /// 1 to 2000.
    pub landmarks: Vec<LandmarkDeletion>,
}

/// Another landmark that is the same object.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LandmarkMerge {
    /// Its name. It is deleted.
    pub from: String,
}

/// What was done to several landmarks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct BulkOutcome {
    /// Landmarks made or deleted.
    pub count: u64,
}

/// Width and height of a landmark.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Size {
    /// 0.01 to 100.
    pub width_m: f64,
    /// 0.01 to 100.
    pub height_m: f64,
}

/// Where a landmark is, in the map.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Centre, x.
    pub x_m: f64,
    /// Centre, y.
    pub y_m: f64,
    /// Centre, above the floor.
    pub z_m: f64,
    /// Direction of the outward normal on the floor, counter-clockwise from map x; under a ceiling,
    /// where the top points.
    pub theta_rad: f64,
    /// Turn about the outward normal, within 0.5; 0 when the sides are vertical.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub roll_rad: f64,
    /// Turn of the outward normal from level downwards: 0 on a wall, pi/2 under a ceiling.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub tilt_rad: f64,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_zero(value: &f64) -> bool {
    value.abs() <= 0.0
}

/// Standard deviations of a place that the server found from views.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct PlaceSigma {
    /// Of the centre, x.
    pub x_m: f64,
    /// Of the centre, y.
    pub y_m: f64,
    /// Of the centre, above the floor.
    pub z_m: f64,
    /// Of the direction.
    pub theta_rad: f64,
    /// Of the width.
    pub width_m: f64,
    /// Of the height.
    pub height_m: f64,
}

/// How far a landmark has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum LandmarkStatus {
    /// Not learnt yet.
    NotLearnt,
    /// A job is learning it.
    Learning,
    /// Learnt and matched.
    Active,
    /// Learnt, but not matched: see `failed_gates`.
    Inactive,
}

impl fmt::Display for LandmarkStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotLearnt => "not_learnt",
            Self::Learning => "learning",
            Self::Active => "active",
            Self::Inactive => "inactive",
        })
    }
}

/// What was learnt of a landmark, in brief.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LandmarkModelBody {
    /// Real views it rests on.
    pub views: u64,
    /// Views generated from the real ones.
    pub generated_views: u64,
    /// ms since the Unix epoch.
    pub learnt_ms: i64,
    /// Thresholds and figures of the learning.
    #[serde(flatten)]
    pub facts: serde_json::Map<String, Value>,
}

/// Weights and gates of a map or of one landmark, where a person wants others than the server has.
/// What is absent of a landmark is as the map has it, and of a map as the server has it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LearningSettings {
    /// Why: one line of 1 to 200 characters. The history of the map has it, too.
    pub reason: String,
    /// Cost of a wrong acceptance, 0.1 to 1000, where a refused own view costs 1 (lambda : mu).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub false_positive_weight: Option<f64>,
    /// Fewest views, 1 to 200.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_views: Option<usize>,
    /// Least saliency F, 0 to 1000.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_saliency_f: Option<f64>,
    /// Fewest stable points, 0 to 60.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_stable_points: Option<usize>,
    /// Least visibility confidence of its photographs, 0 to 10.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_visibility_confidence: Option<f64>,
    /// Whether a smaller visibility confidence keeps it out of use.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refuse_one_side: Option<bool>,
    /// It is used whatever its measured gates say. Without a threshold it is still not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub use_despite_gates: Option<bool>,
}

/// How far a landmark is trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum LandmarkHealthBody {
    /// Nothing speaks against it.
    Sound,
    /// Robots find it elsewhere or not at all: see `finding`. It is still used.
    Flagged,
    /// So often that it corrects no pose until somebody sets its place or its health.
    Quarantined,
}

/// What robots found of a landmark that is not where the map says. Stored as JSON.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum FindingBody {
    /// It is observed elsewhere.
    Moved {
        /// Where it is observed.
        observed_place: ObservedPlaceBody,
        /// Distance from its place.
        offset_m: f64,
        /// Observations that agree on it.
        sightings: u32,
    },
    /// It should be visible and is not.
    Missing {
        /// Consecutive frames without it.
        missed_frames: u32,
    },
}

/// Where a landmark is observed, in the map.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ObservedPlaceBody {
    /// Centre, x.
    pub x_m: f64,
    /// Centre, y.
    pub y_m: f64,
    /// Direction of the outward normal on the floor.
    pub theta_rad: f64,
}

/// A landmark.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Landmark {
    /// `[a-z0-9_-]{1,64}`, unique in the map.
    pub name: String,
    /// Another one after every edit of name, size, place, views or, by a person, health, and after
    /// every lesson of its model; the same after what robots do by themselves. `If-Match` takes it,
    /// in quotes.
    #[serde(default)]
    pub revision: String,
    /// How far it has come.
    pub status: LandmarkStatus,
    /// Why it is not matched; empty unless it is inactive.
    pub failed_gates: Vec<FailedGate>,
    /// Gates that it does not pass and that do not keep it from being matched.
    pub waived_gates: Vec<FailedGate>,
    /// Its own weights and gates, if a person has set some.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub learning: Option<LearningSettings>,
    /// Real views stored.
    pub views: u64,
    /// Width and height, if measured.
    pub size: Option<Size>,
    /// Where it is, if known.
    pub place: Option<Place>,
    /// How surely, where the server found the place from views; absent for a place by hand.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub place_sigma: Option<PlaceSigma>,
    /// What was learnt.
    pub model: Option<LandmarkModelBody>,
    /// How far what robots saw lets it be trusted.
    pub health: LandmarkHealthBody,
    /// What speaks against it.
    pub finding: Option<FindingBody>,
}

/// A landmark to be.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct NewLandmark {
    /// `[a-z0-9_-]{1,64}`, unique in the map.
    pub name: String,
    /// Width and height; without it there is no pose.
    pub size: Option<Size>,
    /// Where it is; without it there is no robot pose.
    pub place: Option<Place>,
}

/// What changes of a landmark. A field that is absent stays, one that is null is forgotten.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LandmarkPatch {
    /// Another name, `[a-z0-9_-]{1,64}`, unique in the map. Everything that belongs to the landmark
    /// stays with it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Width and height.
    #[serde(
        default,
        deserialize_with = "super::patch::null_or_value",
        skip_serializing_if = "Option::is_none"
    )]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<Size>))]
    pub size: Option<Option<Size>>,
    /// Where it is.
    #[serde(
        default,
        deserialize_with = "super::patch::null_or_value",
        skip_serializing_if = "Option::is_none"
    )]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<Place>))]
    pub place: Option<Option<Place>>,
    /// Weights and gates.
    #[serde(
        default,
        deserialize_with = "super::patch::null_or_value",
        skip_serializing_if = "Option::is_none"
    )]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<LearningSettings>))]
    pub learning: Option<Option<LearningSettings>>,
    /// A person's decision; a new size or place is sound by itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub health: Option<LandmarkHealthBody>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_on_a_wall_has_no_roll_and_tilt_and_one_under_a_ceiling_keeps_them() {
        let wall = Place { x_m: 1.0, ..Place::default() };
        let text = serde_json::to_string(&wall).unwrap();
        assert!(!text.contains("roll_rad") && !text.contains("tilt_rad"), "{text}");
        let ceiling = Place { roll_rad: 0.1, tilt_rad: 1.5, ..wall };
        for place in [wall, ceiling] {
            let back: Place = serde_json::from_str(&serde_json::to_string(&place).unwrap()).unwrap();
            assert_eq!(back, place);
        }
    }

    #[test]
    fn the_word_of_a_status_is_that_of_the_json() {
        use LandmarkStatus::{Active, Inactive, Learning, NotLearnt};
        for status in [NotLearnt, Learning, Active, Inactive] {
            assert_eq!(serde_json::to_value(status).unwrap(), status.to_string());
        }
    }
}
