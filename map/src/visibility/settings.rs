//! The camera and the limits that define "visible".

use crate::check::{self, OutOfRange};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;
use vision::pose::LandmarkSize;

/// The camera from which landmarks are to be visible.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PanTiltCamera {
    /// Focal length, pixels; 10 to 20 000.
    pub focal_px: f64,
    /// Width of the image, pixels; 16 to 20 000.
    pub width_px: f64,
    /// Height of the image, pixels; 16 to 20 000.
    pub height_px: f64,
    /// Height of the camera above the floor, 0 to 10 m.
    pub camera_height_m: f64,
    /// Lowest and highest tilt, radians, up positive; within 89 degrees.
    pub tilt_rad: [f64; 2],
    /// Rightmost and leftmost pan, radians, left positive; -pi to pi is all round.
    pub pan_rad: [f64; 2],
}

impl Default for PanTiltCamera {
    /// 640 x 480 px, 64 degrees wide, at 1.2 m, on a unit that tilts by 20 and pans by 97 degrees.
    fn default() -> Self {
        Self {
            focal_px: 512.0,
            width_px: 640.0,
            height_px: 480.0,
            camera_height_m: 1.2,
            tilt_rad: [-0.35, 0.35],
            pan_rad: [-1.7, 1.7],
        }
    }
}

impl PanTiltCamera {
    /// Refuses numbers that are not finite or out of range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        check::within("focal_px", self.focal_px, 10.0, 20_000.0)?;
        check::within("width_px", self.width_px, 16.0, 20_000.0)?;
        check::within("height_px", self.height_px, 16.0, 20_000.0)?;
        check::within("camera_height_m", self.camera_height_m, 0.0, 10.0)?;
        let most = FRAC_PI_2 - 0.017;
        check::within("tilt_rad[0]", self.tilt_rad[0], -most, most)?;
        check::within("tilt_rad[1]", self.tilt_rad[1], self.tilt_rad[0], most)?;
        let half_turn = std::f64::consts::PI;
        check::within("pan_rad[0]", self.pan_rad[0], -half_turn, half_turn)?;
        check::within("pan_rad[1]", self.pan_rad[1], self.pan_rad[0], half_turn)
    }
}

/// Limits within which a landmark is visible.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VisibilityParams {
    /// Largest angle of view against the normal, radians; up to 85 degrees.
    pub max_incidence_rad: f64,
    /// Shortest side in the image, px: the side of an icon.
    pub min_side_px: f64,
    /// Largest share of the image that a side may take, 0 to 1; 0.9 by method 12.3.
    pub max_fill: f64,
    /// Distance of the landmark in front of its wall, so that its own wall does not hide it; 1 mm
    /// to 0.5 m.
    pub standoff_m: f64,
}

impl Default for VisibilityParams {
    fn default() -> Self {
        Self { max_incidence_rad: 75.0_f64.to_radians(), min_side_px: 75.0, max_fill: 0.9, standoff_m: 0.05 }
    }
}

impl VisibilityParams {
    /// Refuses numbers that are not finite or out of range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        check::within("max_incidence_rad", self.max_incidence_rad, 0.01, 85.0_f64.to_radians())?;
        check::within("min_side_px", self.min_side_px, 1.0, 20_000.0)?;
        check::within("max_fill", self.max_fill, 0.01, 1.0)?;
        check::within("standoff_m", self.standoff_m, 0.001, 0.5)
    }
}

/// The camera and the limits that define "visible" in a map.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VisibilitySettings {
    /// The camera.
    pub viewer: PanTiltCamera,
    /// The limits.
    pub seen: VisibilityParams,
}

impl VisibilitySettings {
    /// Refuses numbers that are not finite or out of range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        self.viewer.check()?;
        self.seen.check()
    }

    /// Largest distance from which a landmark of this size is visible, metres.
    pub fn reach_m(&self, size: &LandmarkSize) -> f64 {
        self.viewer.focal_px * size.width_m.min(size.height_m) / self.seen.min_side_px
    }
}
