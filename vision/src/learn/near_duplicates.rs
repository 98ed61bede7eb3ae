//! Rejects near-duplicate views of an object (method 7.1): a new view must differ from the kept
//! ones in viewing direction, size, light or appearance.
//!
//! In: corners and icons. Out: the novelty of a view; 1 where it reaches a limit. The views are
//! assumed to show the same object.

use crate::{
    geometry::corners::Corners,
    icon::Icon,
    recognise::features::signature::{Signature, likeness},
};
use nalgebra::{Point2, Vector2};
use serde::{Deserialize, Serialize};

/// Smallest differences between two views.
///
/// Departs from method 7.1 (0.2 m and 5 degrees apart): the poses of photographs are unknown, so
/// the limits are on the effect of such a step in the image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NoveltyParams {
    /// Viewing direction: displacement of a corner with both quads normalised to area 1. 5 degrees
    /// move it by 0.02 at 45 degrees off the normal.
    pub shape: f64,
    /// Size: ratio of the quads' sides. 0.2 m change them by 1.1 at 2 m.
    pub scale: f64,
    /// Light: difference of the icons' mean or standard deviation, grey levels.
    pub light_grey: f64,
    /// Appearance: 1 minus the likeness of the icons' signatures.
    pub appearance: f64,
}

impl Default for NoveltyParams {
    fn default() -> Self {
        Self { shape: 0.02, scale: 1.1, light_grey: 12.0, appearance: 0.15 }
    }
}

/// Summary of a view for comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewSummary {
    /// Corners about their centroid, at area 1.
    shape: [Vector2<f64>; 4],
    side_px: f64,
    mean: f64,
    deviation: f64,
    signature: Signature,
}

impl ViewSummary {
    /// The summary of a quad and its icon.
    pub fn new(corners_px: &Corners, icon: &Icon) -> Self {
        let points = corners_px.points();
        let centre = points.iter().fold(Vector2::zeros(), |sum, p: &Point2<f64>| sum + p.coords * 0.25);
        let side_px = corners_px.area_px2().sqrt().max(f64::MIN_POSITIVE);
        let count = icon.pixels.len().max(1) as f64;
        let mean = icon.pixels.iter().map(|g| f64::from(*g)).sum::<f64>() / count;
        let variance = icon.pixels.iter().map(|g| (f64::from(*g) - mean).powi(2)).sum::<f64>() / count;
        Self {
            shape: points.map(|p| (p.coords - centre) / side_px),
            side_px,
            mean,
            deviation: variance.sqrt(),
            signature: Signature::new(icon),
        }
    }

    /// Side of a square of the quad's area, pixels.
    pub fn side_px(&self) -> f64 {
        self.side_px
    }

    /// Difference of two views, symmetric: 0 for equal views, 1 where one of the limits is just
    /// reached.
    pub fn novelty(&self, other: &Self, p: &NoveltyParams) -> f64 {
        let moved = self.shape.iter().zip(&other.shape).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        let unlike = 1.0 - f64::from(likeness(self.signature.values(), other.signature.values()));
        // Two blank icons have no signatures; they count as equal.
        let both_blank = [self, other].iter().all(|v| v.signature.values().iter().all(|s| *s == 0));
        let parts = [
            moved / p.shape,
            (self.side_px / other.side_px).ln().abs() / p.scale.ln(),
            (self.mean - other.mean).abs() / p.light_grey,
            (self.deviation - other.deviation).abs() / p.light_grey,
            if both_blank { 0.0 } else { unlike / p.appearance },
        ];
        parts.into_iter().fold(0.0, f64::max)
    }
}

/// Index of the kept view most similar to `new`, and its novelty; the first of equals. `None` when
/// `kept` is empty.
pub fn most_alike<'a>(
    new: &ViewSummary,
    kept: impl IntoIterator<Item = &'a ViewSummary>,
    p: &NoveltyParams,
) -> Option<(usize, f64)> {
    let each = kept.into_iter().map(|view| new.novelty(view, p)).enumerate();
    each.min_by(|a, b| a.1.total_cmp(&b.1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{frame::GrayImage, geometry::homography::Homography, icon::icon, params::Params};
    use nalgebra::{Rotation3, Vector3};

    /// A poster of 0.6 m x 0.84 m in the view of a camera of 500 px from `distance_m`, `angle_rad`
    /// off its normal.
    fn summary(distance_m: f64, angle_rad: f64, gain: f64) -> ViewSummary {
        let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), angle_rad);
        let corners = [[-0.3, -0.42], [0.3, -0.42], [0.3, 0.42], [-0.3, 0.42]].map(|[x, y]| {
            let p = turn * Vector3::new(x, y, 0.0) + Vector3::new(0.0, 0.0, distance_m);
            Point2::new(320.0 + 500.0 * p.x / p.z, 240.0 + 500.0 * p.y / p.z)
        });
        let corners = Corners::new(corners).unwrap();
        let unit = Homography::square_to_quad(75, &corners).unwrap().inverse().unwrap();
        let image = GrayImage::from_fn(640, 480, |u, v| {
            let p = unit.apply(&Point2::new(u as f64, v as f64)) / 75.0;
            let wave = f64::sin(9.0 * p.x) * f64::cos(7.0 * p.y + 2.0 * p.x);
            (gain * (110.0 + 70.0 * wave)).clamp(0.0, 255.0) as u8
        });
        ViewSummary::new(&corners, &icon(&image, &corners, &Params::default().icon).unwrap())
    }

    #[test]
    fn steps_of_the_method_are_at_the_limits() {
        let p = NoveltyParams::default();
        let from = |d, degrees: f64| summary(d, degrees.to_radians(), 1.0);
        let at = from(2.0, 45.0);
        // Half the method's step is a near-duplicate, twice the step is a view of its own, in each
        // way.
        for (other, is_new) in [
            (from(2.08, 45.0), false),
            (from(2.4, 45.0), true),
            (from(2.0, 47.0), false),
            (from(2.0, 55.0), true),
            (summary(2.0, 45.0_f64.to_radians(), 1.04), false),
            (summary(2.0, 45.0_f64.to_radians(), 1.3), true),
        ] {
            assert_eq!(at.novelty(&other, &p) >= 1.0, is_new, "{}", at.novelty(&other, &p));
            assert!((at.novelty(&other, &p) - other.novelty(&at, &p)).abs() < 1e-12);
        }
        assert!(at.novelty(&at, &p) < 1e-3);
    }

    #[test]
    fn the_most_similar_view_is_found() {
        let p = NoveltyParams::default();
        let kept = [summary(2.0, 0.0, 1.0), summary(3.0, 0.0, 1.0), summary(3.0, 0.9, 1.0)];
        assert_eq!(most_alike(&summary(2.9, 0.0, 1.0), &kept, &p).unwrap().0, 1);
        assert_eq!(most_alike(&kept[0], [], &p), None);
    }

    #[test]
    fn blank_icons_are_equal_and_novelty_is_finite() {
        let square = [[0.0, 0.0], [90.0, 0.0], [90.0, 90.0], [0.0, 90.0]].map(|[x, y]| Point2::new(x, y));
        let square = Corners::new(square);
        let blank = ViewSummary::new(&square.unwrap(), &Icon::new(75, vec![90.0; 5625], 1.0).unwrap());
        assert!(blank.novelty(&blank, &NoveltyParams::default()) < 1e-12);
        assert!(summary(2.0, 0.3, 1.0).novelty(&blank, &NoveltyParams::default()).is_finite());
    }
}
