//! `/maps/{map}/landmarks/{landmark}/views`: training views.

use crate::v1;
use serde::{Deserialize, Serialize};

/// A stored training view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct TrainingView {
    /// Its number, never used again.
    pub id: i64,
    /// The landmark's corners in the picture: top-left, top-right, bottom-right, bottom-left, in
    /// pixels.
    #[cfg_attr(feature = "openapi", schema(value_type = super::arrays::Corners))]
    pub corners: [[f64; 2]; 4],
    /// Of the picture, as a viewer shows it.
    pub width_px: u32,
    /// Of the picture, as a viewer shows it.
    pub height_px: u32,
    /// `png` or `jpeg`.
    pub image_kind: String,
    /// ms since the Unix epoch.
    pub created_ms: i64,
    /// In the answer to an upload: what became of it. With `duplicate` and `near_duplicate` the
    /// view given is the one that is there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outcome: Option<UploadOutcomeBody>,
    /// In the answer to an upload with `capture`: whether the landmark has a place by its views
    /// now, or why not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub placing: Option<PlacementReportBody>,
}

/// The order of a list by number; `-` reverses it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub enum NumberOrder {
    /// The oldest first.
    #[default]
    #[serde(rename = "number")]
    Number,
    /// The newest first.
    #[serde(rename = "-number")]
    NumberReversed,
}

/// Which views of a landmark are listed, in which order, and which page of them.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
pub struct ViewQuery {
    /// Most items; 100 by default, bounded by `limits.page`.
    pub limit: Option<usize>,
    /// The `next` of the page before; absent for the first page.
    pub cursor: Option<String>,
    /// `number` by default.
    pub sort: Option<NumberOrder>,
    /// Only those with the pose of the robot that took them, or those without.
    pub has_capture: Option<bool>,
    /// Only those stored at this time or later, ms since the Unix epoch.
    pub since_ms: Option<i64>,
    /// Only those stored before this time, ms since the Unix epoch.
    pub until_ms: Option<i64>,
}

/// What became of an upload.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum UploadOutcomeBody {
    /// Stored.
    New,
    /// The same quad of the same picture is there already.
    Duplicate,
    /// Not stored: the view shows nothing that this one does not. A lesson would gain nothing by
    /// it.
    NearDuplicate,
}

/// Who did not take a photograph.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum RefusedBy {
    /// The upload: it is not among the views.
    Upload,
    /// The last lesson: it is among the views.
    Lesson,
}

/// A photograph that was not taken for a landmark, or not in its last lesson.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RefusedView {
    /// Its number, never used again.
    pub id: i64,
    /// ms since the Unix epoch.
    pub refused_ms: i64,
    /// Who did not take it.
    pub by: RefusedBy,
    /// A code: of the refusal of the upload, `duplicate`, `near_duplicate`, `beyond_limit` or
    /// `picture_unreadable`.
    pub reason: String,
    /// Why: one sentence for a person.
    pub sentence: String,
    /// What to do: one sentence for a person.
    pub advice: String,
    /// The view that it repeats, or that the lesson left out; null where that is gone.
    pub view: Option<i64>,
    /// Path of a small picture of it; null where it could not be decoded.
    pub icon: Option<String>,
}

/// What came of placing a landmark by its views.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct PlacementReportBody {
    /// The landmark has a place by its views now.
    pub placed: bool,
    /// Views with a robot pose that the place rests on.
    pub views_used: usize,
    /// Why not: `by_hand` (a place by hand stays), or what is wrong with the views, with the
    /// residual.
    pub reason: Option<String>,
}

/// How a picture was taken: the part `capture` of an upload. With it the server places the landmark
/// itself, on the map's walls or under a ceiling, unless it was placed by hand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CaptureMetadata {
    /// The camera.
    pub intrinsics: v1::Intrinsics,
    /// Where the robot was, with covariance.
    pub map_from_robot: v1::Pose2Covariance,
    /// The camera on the robot.
    pub robot_from_camera: v1::Pose3,
    /// The landmark is under a ceiling so high, not on a wall.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ceiling_height_m: Option<f64>,
    /// Covariance of each corner by the noise of its edges: (uu, uv, vv), top-left, top-right,
    /// bottom-right, bottom-left. Absent: 1 px, or the detector's where the server finds the
    /// corners.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<super::arrays::CornerCovariances>))]
    pub corner_covariance_px2: Option<[[f64; 3]; 4]>,
}

/// The form of an upload, for the document: it is read part by part.
#[cfg(feature = "openapi")]
#[derive(Debug, utoipa::ToSchema)]
pub struct NewViewForm {
    /// PNG or JPEG.
    #[schema(value_type = String, format = Binary)]
    pub image: Vec<u8>,
    /// JSON, `[[x,y],[x,y],[x,y],[x,y]]`: top-left, top-right, bottom-right, bottom-left, in
    /// pixels.
    pub corners: Option<String>,
    /// `true`: the picture shows the landmark and nothing else.
    pub whole_image: Option<String>,
    /// JSON, how it was taken: `intrinsics`, `map_from_robot` (pose with covariance),
    /// `robot_from_camera`, and `ceiling_height_m` for a landmark under a ceiling; also
    /// `corner_covariance_px2`, `[[uu,uv,vv], ...]` of the four corners, where their noise is known
    /// (else 1 px, or the detector's where the server finds them). With it the server places the
    /// landmark on the map's walls itself, unless it was placed by hand.
    pub capture: Option<String>,
    /// `true`: stored even if a stored view shows it from the same side, as large and in the same
    /// light.
    pub keep_near_duplicate: Option<String>,
    /// `true`: makes the landmark if there is none of this name, together with this view or not at
    /// all.
    pub create: Option<String>,
    /// Width of the landmark, 0.01 to 100, together with `height_m`. Refused if the landmark has
    /// another size by hand.
    pub width_m: Option<String>,
    /// Height of the landmark, 0.01 to 100.
    pub height_m: Option<String>,
}
