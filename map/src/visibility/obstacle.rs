//! Obstacles: straight objects on the floor that hide landmarks.

use crate::{place::LandmarkPlace, visibility::settings::PanTiltCamera};
use nalgebra::Point2;

/// A straight object that stands on the floor and hides what is behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Obstacle {
    /// First end, metres, map frame.
    pub a: Point2<f64>,
    /// Second end, metres, map frame.
    pub b: Point2<f64>,
    /// Height above the floor, metres; `None` for a wall of the laser map, which hides everything.
    pub height_m: Option<f64>,
}

impl From<&crate::segments::LaserSegment> for Obstacle {
    fn from(wall: &crate::segments::LaserSegment) -> Self {
        Self { a: wall.a, b: wall.b, height_m: None }
    }
}

impl Obstacle {
    /// Whether it can come between camera and landmark at all: the lines of sight run above the
    /// lower of the two.
    pub(super) fn hides(&self, place: &LandmarkPlace, viewer: &PanTiltCamera) -> bool {
        let half_height = 0.5 * place.size.height_m * place.tilt_rad.cos();
        let lowest = (place.z_m - half_height).min(viewer.camera_height_m);
        self.height_m.is_none_or(|height| height > lowest)
    }
}
