//! Whether one point sees a landmark: every condition of method 12 by itself, obstacle by obstacle. Slow and exact; what
//! the polygons are compared with. Shares nothing with them but the definition.

use super::{Obstacle, Viewer, VisibilityParams};
use crate::place::LandmarkPlace;
use nalgebra::{Point2, Vector2};

/// Whether a camera at `q` sees the whole landmark, near, upright and large enough, with nothing in between.
pub fn sees(
    place: &LandmarkPlace,
    obstacles: &[Obstacle],
    viewer: &Viewer,
    p: &VisibilityParams,
    q: &Point2<f64>,
) -> bool {
    let (width, height) = (place.size.width_m, place.size.height_m);
    let normal = Vector2::new(place.theta_rad.cos(), place.theta_rad.sin());
    let centre = Point2::new(place.x_m, place.y_m);
    let to = q - centre;
    let distance = to.norm();
    let cosine = normal.dot(&to) / distance;
    if normal.dot(&to) <= p.standoff_m || cosine < p.max_incidence_rad.cos() {
        return false;
    }
    let (wide, high) = (width * cosine / distance, height / distance);
    let large = viewer.focal_px * wide.min(high) >= p.min_side_px;
    let half_view = |side_px: f64| 0.5 * side_px / viewer.focal_px;
    let whole = wide <= 2.0 * p.max_fill * half_view(viewer.width_px)
        && high <= 2.0 * p.max_fill * half_view(viewer.height_px);
    let tilt = (place.z_m - viewer.camera_height_m).atan2(distance);
    if !large || !whole || tilt < viewer.tilt_rad[0] || tilt > viewer.tilt_rad[1] {
        return false;
    }
    let side = Vector2::new(-normal.y, normal.x) * (0.5 * width);
    let face = centre + normal * p.standoff_m;
    let sight = [*q, face - side, face + side];
    let lowest = (place.z_m - 0.5 * height).min(viewer.camera_height_m);
    !obstacles.iter().any(|o| o.height_m.is_none_or(|h| h > lowest) && meets(&sight, &o.a, &o.b))
}

/// Whether a segment touches a triangle: what three half-planes leave of it.
fn meets(triangle: &[Point2<f64>; 3], a: &Point2<f64>, b: &Point2<f64>) -> bool {
    let turn = (triangle[1] - triangle[0]).perp(&(triangle[2] - triangle[0])).signum();
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for k in 0..3 {
        let (corner, next) = (triangle[k], triangle[(k + 1) % 3]);
        let inside = |q: &Point2<f64>| turn * (next - corner).perp(&(q - corner));
        let (at_a, at_b) = (inside(a), inside(b));
        if at_a < 0.0 && at_b < 0.0 {
            return false;
        }
        let crossing = at_a / (at_a - at_b);
        if at_a < 0.0 {
            from = from.max(crossing);
        } else if at_b < 0.0 {
            to = to.min(crossing);
        }
    }
    from <= to
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_and_triangles() {
        let t = [Point2::new(0.0, 0.0), Point2::new(4.0, 0.0), Point2::new(0.0, 4.0)];
        let hits = |ax, ay, bx, by| meets(&t, &Point2::new(ax, ay), &Point2::new(bx, by));
        assert!(hits(1.0, 1.0, 1.5, 1.0), "inside");
        assert!(hits(-1.0, 1.0, 5.0, 1.0), "through");
        assert!(hits(1.0, 1.0, 9.0, 9.0), "out of it");
        assert!(!hits(3.0, 3.0, 9.0, 9.0), "beyond the long side");
        assert!(!hits(-1.0, 4.5, 4.5, -1.0 + 4.6), "past a corner");
        assert!(!hits(-1.0, -1.0, -0.1, 5.0));
        let back = [t[0], t[2], t[1]];
        assert!(meets(&back, &Point2::new(1.0, 1.0), &Point2::new(1.5, 1.0)), "either way round");
    }
}
