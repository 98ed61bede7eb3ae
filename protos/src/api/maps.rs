//! `/maps`: maps, where they are, and how they lie to each other.

use super::landmarks::LearningSettings;
use serde::{Deserialize, Serialize};
use vision::{params::preset::Preset, recognise::DistanceKind};

/// Which distance decides in a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Distance {
    /// The picture itself, laid on the learnt icon, must be like it, and one of the two distances
    /// must accept.
    #[default]
    Both,
    /// Bucketed correlation.
    Correlation,
    /// Partial Hausdorff distance.
    Hausdorff,
}

impl From<Distance> for DistanceKind {
    fn from(distance: Distance) -> Self {
        match distance {
            Distance::Both => Self::Both,
            Distance::Correlation => Self::Correlation,
            Distance::Hausdorff => Self::Hausdorff,
        }
    }
}

impl From<DistanceKind> for Distance {
    fn from(kind: DistanceKind) -> Self {
        match kind {
            DistanceKind::Both => Self::Both,
            DistanceKind::Correlation => Self::Correlation,
            DistanceKind::Hausdorff => Self::Hausdorff,
        }
    }
}

/// A whole pipeline by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum PipelinePreset {
    /// The product: search of quads, points, then icons.
    Default,
    /// The paper: relaxation, icons alone.
    Paper,
}

impl From<PipelinePreset> for Preset {
    fn from(preset: PipelinePreset) -> Self {
        match preset {
            PipelinePreset::Default => Self::Default,
            PipelinePreset::Paper => Self::Paper,
        }
    }
}

impl From<Preset> for PipelinePreset {
    fn from(preset: Preset) -> Self {
        match preset {
            Preset::Default => Self::Default,
            Preset::Paper => Self::Paper,
        }
    }
}

/// A map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Map {
    /// `[a-z0-9_-]{1,64}`, unique.
    pub name: String,
    /// Counts up with every change that an answer could depend on.
    pub version: u64,
    /// Another one after every edit or lesson of the map or of what is in it, the same after what
    /// robots do by themselves: `If-Match` takes it, in quotes.
    #[serde(default)]
    pub revision: String,
    /// Landmarks in it, learnt or not.
    pub landmarks: u64,
    /// A picture is shown under it: `GET /maps/{map}/underlay`.
    #[serde(default)]
    pub has_underlay: bool,
    /// Detector and decision; absent: those of the server's settings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preset: Option<PipelinePreset>,
    /// Which distance decides.
    pub distance: Distance,
    /// Weights and gates of its landmarks, if a person has set some.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub learning: Option<LearningSettings>,
    /// The map that it is a draft of.
    #[serde(default)]
    pub draft_of: Option<String>,
    /// The site it belongs to, in words.
    pub site: Option<String>,
    /// The building it belongs to, in words.
    pub building: Option<String>,
    /// The floor it belongs to, in words.
    pub floor: Option<String>,
    /// Where it lies in another map.
    pub parent: Option<Parent>,
}

impl Map {
    /// Where it is, for people; empty where nobody has said it.
    pub fn whereabouts(&self) -> String {
        let words: Vec<&str> =
            [&self.site, &self.building, &self.floor].into_iter().flatten().map(String::as_str).collect();
        let lies = self.parent.as_ref().map(|p| format!("in {} at {:.2}, {:.2} m", p.map, p.x_m, p.y_m));
        [Some(words.join(" / ")).filter(|w| !w.is_empty()), lies]
            .into_iter()
            .flatten()
            .collect::<Vec<_>>()
            .join(", ")
    }
}

/// Where a map lies in another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Parent {
    /// The map in whose frame it lies.
    pub map: String,
    /// Its origin there, x.
    pub x_m: f64,
    /// Its origin there, y.
    pub y_m: f64,
    /// Direction of its x axis there.
    pub theta_rad: f64,
    /// Its floor above that one's, within 1000 m.
    #[serde(default)]
    pub level_m: f64,
    /// Over (x, y, theta), row-major; absent for 5 cm and half a degree.
    #[cfg_attr(feature = "openapi", schema(value_type = Option<super::arrays::Covariance>))]
    pub covariance: Option<[f64; 9]>,
}

/// A map to be.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct NewMap {
    /// `[a-z0-9_-]{1,64}`, unique.
    pub name: String,
    /// Detector and decision; absent: those of the server's settings.
    pub preset: Option<PipelinePreset>,
    /// Which distance decides; absent: that of the preset.
    pub distance: Option<Distance>,
    /// The site it belongs to, in words: 1 to 64 characters.
    pub site: Option<String>,
    /// The building it belongs to, in words: 1 to 64 characters.
    pub building: Option<String>,
    /// The floor it belongs to, in words: 1 to 64 characters.
    pub floor: Option<String>,
    /// Where it lies in another map.
    pub parent: Option<Parent>,
}

impl NewMap {
    /// A map of this name that lies in no other.
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), ..Self::default() }
    }
}

/// A copy of a map to be.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct NewCopy {
    /// Its name: `[a-z0-9_-]{1,64}`, unique.
    pub name: String,
}

/// What changes of a map. A field that is absent stays, one that is null is forgotten.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct MapPatch {
    /// Another name. Refused while a robot, an open job or an open gathering has the present one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Detector and decision, from the next version on; null: those of the server's settings.
    #[serde(
        default,
        deserialize_with = "super::patch::null_or_value",
        skip_serializing_if = "Option::is_none"
    )]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<PipelinePreset>))]
    pub preset: Option<Option<PipelinePreset>>,
    /// Which distance decides; absent where `preset` changes: that of the preset.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance: Option<Distance>,
    /// Weights and gates of its landmarks; what a landmark sets of its own goes before.
    #[serde(
        default,
        deserialize_with = "super::patch::null_or_value",
        skip_serializing_if = "Option::is_none"
    )]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<LearningSettings>))]
    pub learning: Option<Option<LearningSettings>>,
    /// The site it belongs to, in words: 1 to 64 characters.
    #[serde(
        default,
        deserialize_with = "super::patch::null_or_value",
        skip_serializing_if = "Option::is_none"
    )]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<String>))]
    pub site: Option<Option<String>>,
    /// The building it belongs to, in words: 1 to 64 characters.
    #[serde(
        default,
        deserialize_with = "super::patch::null_or_value",
        skip_serializing_if = "Option::is_none"
    )]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<String>))]
    pub building: Option<Option<String>>,
    /// The floor it belongs to, in words: 1 to 64 characters.
    #[serde(
        default,
        deserialize_with = "super::patch::null_or_value",
        skip_serializing_if = "Option::is_none"
    )]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<String>))]
    pub floor: Option<Option<String>>,
    /// Where it lies in another map.
    #[serde(
        default,
        deserialize_with = "super::patch::null_or_value",
        skip_serializing_if = "Option::is_none"
    )]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<Parent>))]
    pub parent: Option<Option<Parent>>,
}

/// Into which map to transform, and perhaps a pose to transform.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
pub struct TransformQuery {
    /// Name of the other map.
    pub to: String,
    /// A pose in the first map, all three numbers or none.
    pub x_m: Option<f64>,
    /// Of the pose.
    pub y_m: Option<f64>,
    /// Of the pose.
    pub theta_rad: Option<f64>,
}

/// A pose with its covariance over (x, y, theta), row-major.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct TransformedPose {
    /// Metres, in the other map.
    pub x_m: f64,
    /// Metres, in the other map.
    pub y_m: f64,
    /// Heading in the other map.
    pub theta_rad: f64,
    /// Over (x, y, theta), row-major.
    #[cfg_attr(feature = "openapi", schema(value_type = super::arrays::Covariance))]
    pub covariance: [f64; 9],
}

/// How one map lies in another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct TransformResponse {
    /// The maps on the way, both ends included; those that the asker may not see are left out.
    pub via: Vec<String>,
    /// Maps coordinates of the first to the other.
    pub to_from_map: TransformedPose,
    /// Height of the first one's floor above the other's.
    pub level_m: f64,
    /// The pose that was asked for, in the other map; its covariance is that of the maps alone.
    pub pose: Option<TransformedPose>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_patch_tells_null_from_absent_both_ways() {
        let patch: MapPatch = serde_json::from_str(r#"{"site": null, "floor": "1st"}"#).unwrap();
        let expected = MapPatch { site: Some(None), floor: Some(Some("1st".into())), ..MapPatch::default() };
        assert_eq!(patch, expected);
        assert_eq!(serde_json::to_string(&patch).unwrap(), r#"{"site":null,"floor":"1st"}"#);
        assert!(serde_json::from_str::<MapPatch>(r#"{"names": "other"}"#).is_err());
    }
}
