//! `/maps/{map}/localise`: where a robot is, by one frame, one scan or both.

use crate::v1::{Answer, Pose2, Pose2Covariance};
use serde::{Deserialize, Serialize};

/// A planar laser scan: the part `scan`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct ScanBody {
    /// Pose of the laser on the robot.
    pub robot_from_laser: Pose2,
    /// Bearing of the first beam, counter-clockwise from the laser's x axis.
    pub first_bearing_rad: f64,
    /// From one beam to the next; negative for a laser that turns clockwise.
    pub bearing_step_rad: f64,
    /// A range of at least this is a beam without return.
    pub max_range_m: f64,
    /// One range a beam, at most 16384; null without return.
    pub ranges_m: Vec<Option<f32>>,
}

/// The form of a localisation, for the document: it is read part by part. At least a picture or a
/// scan is needed.
#[cfg(feature = "openapi")]
#[derive(Debug, utoipa::ToSchema)]
pub struct LocaliseForm {
    /// PNG or JPEG; with it, `intrinsics` and `mounting` are needed.
    #[schema(value_type = Option<String>, format = Binary)]
    pub image: Option<Vec<u8>>,
    /// JSON, `{"fx_px", "fy_px", "cx_px", "cy_px", ...}`, with `width_px` and `height_px` as a
    /// photograph has them.
    pub intrinsics: Option<String>,
    /// JSON, `robot_from_camera`: `{"x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"}`.
    pub mounting: Option<String>,
    /// JSON, a scan from the same place: `robot_from_laser`, `first_bearing_rad`,
    /// `bearing_step_rad`, `max_range_m`, `ranges_m` (null without return).
    pub scan: Option<String>,
}

/// What came of a localisation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum LocaliseStatus {
    /// There is one pose.
    Located,
    /// There are hypotheses, and nothing tells which is right.
    Ambiguous,
    /// Nothing matches.
    NoMatch,
}

/// Where the robot may be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LocaliseHypothesisBody {
    /// The pose with its covariance.
    pub map_from_robot: Pose2Covariance,
    /// All hypotheses sum to 1.
    pub probability: f64,
    /// The landmarks that it rests on.
    pub landmarks: Vec<String>,
    /// Share of the scan's points with a wall, 0 to 1; null where the scan was not used.
    pub matched: Option<f64>,
}

/// Where a robot is, without its history.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LocaliseResult {
    /// The map.
    pub map: String,
    /// Its version.
    pub map_version: u64,
    /// What came of it.
    pub status: LocaliseStatus,
    /// Why there is not exactly one pose: `nothing_recognised`, a code of `pose_refusal` of an
    /// answer, `ambiguous`, `undetermined` (the walls leave a direction open), `few_points`,
    /// `poor_match`, `map_too_large`, `stopped`.
    pub reason: Option<String>,
    /// The pose; null unless `located`.
    pub map_from_robot: Option<Pose2Covariance>,
    /// Where the robot may be, most probable first, at most 16.
    pub hypotheses: Vec<LocaliseHypothesisBody>,
    /// The answer to the picture: `Answer` of protos/waymark/v1/waymark.proto as JSON.
    pub answer: Option<Answer>,
}
