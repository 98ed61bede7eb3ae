//! A picture with a border around the object in, straight lines along each side of it out: the
//! object's own edges, those of a frame, a mat or a shadow. All are parallel to the object's sides;
//! none is preferred.

use crate::{
    border::side_edges::{SideEdge, outward, side_edges},
    frame::GrayImage,
    geometry::corners::Corners,
};
use nalgebra::Point2;

/// Lines are searched so far to both sides of the border, as a share of the object's size.
const REACH_SHARE: f64 = 0.15;
/// Errors that all points of a line share: its ends are known no better than this, px (chosen on
/// rendered sets).
const LINE_SIGMA_PX: f64 = 0.15;

/// A straight line that follows a side of the border.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SideLine {
    /// Two of its points whose errors are independent, px.
    pub(crate) ends_px: [Point2<f64>; 2],
    /// Standard deviation of each across the line, px.
    pub(crate) sigma_px: f64,
    /// Along the plane's up axis (right and left), not along its width.
    pub(crate) is_upright: bool,
}

/// The lines along all sides of `border_px`.
pub(crate) fn side_lines(image: &GrayImage, border_px: &Corners) -> Vec<SideLine> {
    let p = border_px.points();
    let reach_px = REACH_SHARE * border_px.area_px2().sqrt();
    let along = |side: usize| {
        let (a, b) = (p[side], p[(side + 1) % 4]);
        side_edges(image.into(), &a, &b, reach_px)
            .into_iter()
            .map(move |edge| line(&edge, [a, b], side % 2 == 1))
    };
    (0..4).flat_map(along).collect()
}

/// The edge by the two points at which its errors are equal and independent.
fn line(edge: &SideEdge, [a, b]: [Point2<f64>; 2], is_upright: bool) -> SideLine {
    let (c, offsets_px) = (&edge.covariance_px2, &edge.offsets_px);
    // Variance of the turn, and the place that does not move with it.
    let turn_px2 = c.m11 - 2.0 * c.m12 + c.m22;
    let centre = (c.m11 - c.m12) / turn_px2;
    let centre_px2 = (c.m11 * c.m22 - c.m12 * c.m12) / turn_px2;
    let spread = (centre_px2 / turn_px2).sqrt();
    let across = outward(&a, &b);
    let at = |t: f64| a + (b - a) * t + across * (offsets_px.x + (offsets_px.y - offsets_px.x) * t);
    SideLine {
        ends_px: [at(centre - spread), at(centre + spread)],
        sigma_px: (2.0 * centre_px2).sqrt().hypot(LINE_SIGMA_PX),
        is_upright,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_border_and_its_shadow_are_two_lines_of_a_side() {
        // A dark plate, and beside its right side a shadow that ends askew.
        let image = GrayImage::from_fn(240, 200, |u, v| match (u, v) {
            (60..160, 50..150) => 40,
            (160.., 50..150) if (u as f64) < 166.0 + 0.03 * (v as f64 - 50.0) => 110,
            _ => 180,
        });
        let border = Corners::try_from([[58.0, 51.0], [160.0, 50.0], [161.0, 151.0], [60.0, 149.0]]).unwrap();
        let lines = side_lines(&image, &border);
        let has = |is_upright: bool, from: [f64; 2], to: [f64; 2]| {
            let (from, to) = (Point2::from(from), Point2::from(to));
            let normal = outward(&from, &to);
            lines.iter().any(|l| {
                l.is_upright == is_upright && l.ends_px.iter().all(|p| (p - from).dot(&normal).abs() < 0.5)
            })
        };
        assert!(has(true, [159.5, 50.0], [159.5, 150.0]), "{lines:?}");
        assert!(has(true, [166.0, 50.0], [169.0, 150.0]), "{lines:?}");
        assert!(has(true, [59.5, 50.0], [59.5, 150.0]) && has(false, [60.0, 49.5], [160.0, 49.5]));
        assert!(lines.iter().all(|l| (0.1..0.4).contains(&l.sigma_px)), "{lines:?}");
    }
}
