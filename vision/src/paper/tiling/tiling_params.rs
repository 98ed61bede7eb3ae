//! Which segments count as tiling of a floor, and how the camera sees the floor.

use crate::frame::Intrinsics;
use serde::{Deserialize, Serialize};

/// Which segments count as tiling. Lengths on the floor are metres with a [`FloorView`], otherwise
/// heights of the camera above the floor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TilingParams {
    /// Whether tiling is removed.
    pub remove: bool,
    /// Where the floor is. Without it the horizon is estimated from the image, with a typical focal
    /// length.
    pub floor: Option<FloorView>,
    /// An end at most this far below the horizon is not on the floor, as far as can be told.
    pub horizon_gap_px: f64,
    /// Farther segments on the floor are not removed.
    pub max_distance: f64,
    /// Segments this close to the direction of gravity are not removed: sides of posters and doors.
    /// Degrees.
    pub gravity_deg: f64,
    /// Lines of a family differ from its direction by at most this, degrees.
    pub family_deg: f64,
    /// Smallest and largest distance between neighbouring lines.
    pub period_range: [f64; 2],
    /// Smallest concentration of the lines' phases, 0 to 1.
    pub min_regularity: f64,
    /// Fewest lines of a pattern.
    pub min_lines: usize,
    /// A line may lie this share of the period beside its place.
    pub max_residual: f64,
}

impl Default for TilingParams {
    fn default() -> Self {
        Self {
            remove: false,
            floor: None,
            horizon_gap_px: 5.0,
            max_distance: 6.0,
            gravity_deg: 10.0,
            family_deg: 3.0,
            period_range: [0.1, 1.0],
            min_regularity: 0.7,
            min_lines: 5,
            max_residual: 0.12,
        }
    }
}

/// A camera above a level floor, without roll.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FloorView {
    /// The camera.
    pub intrinsics: Intrinsics,
    /// Width of the images that the intrinsics are for; others are taken for the same images at
    /// another scale.
    pub width_px: usize,
    /// Height of the camera's centre above the floor, metres.
    pub height_m: f64,
    /// Angle of the optical axis above the horizontal, rad.
    pub tilt_rad: f64,
}
