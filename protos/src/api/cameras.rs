//! `/robots/{robot}/cameras`: what is known of a robot's cameras, and their calibration from views
//! of landmarks.

use crate::v1;
use serde::{Deserialize, Deserializer, Serialize};

/// A camera of a robot, since the server started.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Camera {
    /// `[a-z0-9_-]{1,64}`, unique on the robot.
    pub name: String,
    /// As its frames say.
    pub intrinsics: v1::Intrinsics,
    /// Of its frames.
    pub width_px: u32,
    /// Of its frames.
    pub height_px: u32,
    /// Frames with these intrinsics in which a landmark was recognised.
    pub frames: u64,
    /// Views of landmarks from different sides that are kept for calibration.
    pub views: usize,
    /// What the residuals of its fixes say: `suspicion` is set when the intrinsics seem off, with
    /// the reason and its number.
    pub intrinsics_monitor: IntrinsicsMonitorBody,
}

/// What is known of a camera's intrinsics from its use.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct IntrinsicsMonitorBody {
    /// Frames counted.
    pub tries: u32,
    /// Of them, refused because no robot on the floor sees the corners there.
    pub refused: u32,
    /// Different landmarks in them.
    pub landmarks: usize,
    /// Mean chi2 a degree of freedom of the fixes; about 1 where all is well.
    pub reduced_chi2: Option<f64>,
    /// True over stated focal length, less 1, by the residuals.
    pub focal_error: Option<f64>,
    /// Standard deviation of `focal_error`.
    pub focal_sigma: Option<f64>,
    /// Set when the intrinsics should be checked.
    pub suspicion: Option<IntrinsicsSuspicionBody>,
}

/// Why the intrinsics of a camera seem wrong.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(tag = "reason", rename_all = "snake_case")]
pub enum IntrinsicsSuspicionBody {
    /// The true focal length seems longer than stated by this share (shorter: negative), with
    /// standard deviation.
    Focal {
        /// True over stated, less 1.
        error: f64,
        /// Standard deviation of `error`.
        sigma: f64,
    },
    /// Corners do not fit by this mean chi2 a degree of freedom.
    Misfit {
        /// About 1 where all is well.
        reduced_chi2: f64,
    },
    /// So many of the frames gave no pose because the corners cannot be seen from a robot on the
    /// floor.
    Refused {
        /// Share of the frames, 0 to 1.
        share: f64,
    },
}

/// A robot's cameras.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Cameras {
    /// By name.
    pub cameras: Vec<Camera>,
}

/// One uploaded view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct UploadedView {
    /// Top-left, top-right, bottom-right, bottom-left, in pixels as seen.
    #[cfg_attr(feature = "openapi", schema(value_type = super::arrays::Corners))]
    pub corners: [[f64; 2]; 4],
}

/// Views of one flat rectangle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct UploadedViews {
    /// Of the images.
    pub width_px: u32,
    /// Of the images.
    pub height_px: u32,
    /// Of the rectangle; only its ratio matters for the camera.
    pub size_width_m: f64,
    /// See `size_width_m`.
    pub size_height_m: f64,
    /// At least two, better five to ten, from at least three sides that differ by more than 15
    /// degrees.
    pub views: Vec<UploadedView>,
}

/// What to calibrate from.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct CalibrationRequest {
    /// Views of one rectangle; without them, the views that were kept of this camera's frames.
    pub uploaded_views: Option<UploadedViews>,
    /// What is known beside the views.
    pub constraints: CalibrationConstraintsBody,
}

/// What may be said beside the views.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct CalibrationConstraintsBody {
    /// Radial coefficients (k1, k2) that may be fitted, 0 to 2; only those are that the views ask
    /// for.
    pub radial: u8,
    /// The camera does not roll (C2).
    pub zero_roll: bool,
    /// The camera is this high over the landmark's centre in all views, metres; negative
    /// below, -100 to 100 (C3).
    pub height_m: Option<f64>,
    /// The ratio of the landmark's sides is not what its size says, and is found with the camera.
    pub unknown_aspect: bool,
}

impl Default for CalibrationConstraintsBody {
    fn default() -> Self {
        Self { radial: 1, zero_roll: false, height_m: None, unknown_aspect: false }
    }
}

/// One view of a calibration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CalibrationViewReport {
    /// Whether the camera rests on it; a view that does not fit is left out.
    pub used: bool,
    /// Root mean square residual per coordinate.
    pub rms_px: Option<f64>,
    /// Distance of the camera from the landmark's centre, metres.
    pub distance_m: Option<f64>,
}

/// JSON has no infinity: a number that nothing is known of is null.
fn null_is_infinite<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::INFINITY))
}

/// A calibrated camera. Standard deviations are infinite (null in JSON) where the views do not
/// determine them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CalibrationReport {
    /// As frames carry it, with the standard deviations below: what is not known of the camera is
    /// then in the poses.
    pub intrinsics: v1::Intrinsics,
    /// Width of the pictures that it was calibrated with.
    pub width_px: u32,
    /// Height of these pictures.
    pub height_px: u32,
    /// Standard deviation of the focal length.
    #[serde(deserialize_with = "null_is_infinite")]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<f64>, required))]
    pub fx_sigma_px: f64,
    /// Standard deviation of the principal point, to the right.
    #[serde(deserialize_with = "null_is_infinite")]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<f64>, required))]
    pub cx_sigma_px: f64,
    /// Standard deviation of the principal point, down.
    #[serde(deserialize_with = "null_is_infinite")]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<f64>, required))]
    pub cy_sigma_px: f64,
    /// Focal length of the linear solution, where there was one.
    pub linear_fx_px: Option<f64>,
    /// Root mean square residual per coordinate.
    pub rms_px: f64,
    /// Weighted squared residual over its degrees of freedom: about 1 where corners are as good as
    /// claimed.
    pub reduced_chi2: f64,
    /// Orientations of the landmark that differ by more than 15 degrees.
    pub orientations: usize,
    /// Height over width of the landmark over what its size says.
    pub aspect_ratio: f64,
    /// Why it should not be believed without a look: empty where nothing speaks against it.
    pub warnings: Vec<String>,
    /// Each view, in the order given.
    pub views: Vec<CalibrationViewReport>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_that_nothing_is_known_of_comes_back() {
        let report = CalibrationReport {
            intrinsics: v1::Intrinsics::default(),
            width_px: 640,
            height_px: 480,
            fx_sigma_px: f64::INFINITY,
            cx_sigma_px: 1.0,
            cy_sigma_px: f64::INFINITY,
            linear_fx_px: None,
            rms_px: 0.5,
            reduced_chi2: 1.0,
            orientations: 1,
            aspect_ratio: 1.0,
            warnings: Vec::new(),
            views: Vec::new(),
        };
        let text = serde_json::to_string(&report).unwrap();
        assert!(text.contains(r#""fx_sigma_px":null"#), "{text}");
        assert_eq!(serde_json::from_str::<CalibrationReport>(&text).unwrap(), report);
    }
}
