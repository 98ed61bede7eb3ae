//! Coordinates about the landmark, which is moved off its wall by the standoff.

use crate::{place::LandmarkPlace, visibility::penumbra::Footprint};
use nalgebra::{Point2, Vector2};
use vision::pose::LandmarkSize;

/// A landmark with a smaller tilt hangs on a wall: what is behind it hides nothing.
const UPRIGHT_RAD: f64 = 1e-9;

/// The frame whose origin is the landmark's middle, moved off its wall; x along the normal on the
/// floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LocalFrame {
    pub(super) origin: Point2<f64>,
    normal: Vector2<f64>,
}

impl LocalFrame {
    pub(super) fn new(place: &LandmarkPlace, standoff_m: f64) -> Self {
        let normal = Vector2::new(place.theta_rad.cos(), place.theta_rad.sin());
        let off = standoff_m * place.tilt_rad.cos();
        Self { origin: Point2::new(place.x_m, place.y_m) + normal * off, normal }
    }

    pub(super) fn local(&self, map: &Point2<f64>) -> Point2<f64> {
        let d = map - self.origin;
        Point2::new(self.normal.dot(&d), self.normal.perp(&d))
    }

    pub(super) fn map(&self, local: &Point2<f64>) -> Point2<f64> {
        let along = Vector2::new(-self.normal.y, self.normal.x);
        self.origin + self.normal * local.x + along * local.y
    }
}

/// The landmark moved along its normal by the standoff.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moved {
    /// Of its middle above the floor.
    pub(super) height_m: f64,
    pub(super) tilt_rad: f64,
    pub(super) size: LandmarkSize,
}

impl Moved {
    pub(super) fn new(place: &LandmarkPlace, standoff_m: f64) -> Self {
        let tilt_rad = if place.tilt_rad.abs() < UPRIGHT_RAD { 0.0 } else { place.tilt_rad };
        Self { height_m: place.z_m - standoff_m * tilt_rad.sin(), tilt_rad, size: place.size }
    }

    pub(super) fn footprint(&self) -> Footprint {
        let half_depth_m = 0.5 * self.size.height_m * self.tilt_rad.sin().abs();
        Footprint { half_depth_m, half_width_m: 0.5 * self.size.width_m }
    }
}
