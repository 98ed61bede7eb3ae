//! Visibility of a landmark from one point: every condition of method 12 separately, obstacle by
//! obstacle. Slow and exact; the reference for the polygons, with which it shares only the
//! definition.

use super::{Obstacle, PanTiltCamera, VisibilityParams};
use crate::place::LandmarkPlace;
use nalgebra::{Point2, Point3, Vector3};

/// Whether the whole landmark is visible for a camera at `q`: large enough, not too oblique,
/// without an obstacle between.
pub fn sees(
    place: &LandmarkPlace,
    obstacles: &[Obstacle],
    viewer: &PanTiltCamera,
    p: &VisibilityParams,
    q: &Point2<f64>,
) -> bool {
    let map_from_landmark = LandmarkPlace { roll_rad: 0.0, ..*place }.map_from_landmark();
    let face = |y: f64, z: f64| map_from_landmark * Point3::new(p.standoff_m, y, z);
    let (half_width, half_height) = (0.5 * place.size.width_m, 0.5 * place.size.height_m);
    let camera = Point3::new(q.x, q.y, viewer.camera_height_m);
    let centre = face(0.0, 0.0);
    let (sight, distance) = ((camera - centre).normalize(), (camera - centre).norm());
    let [normal, wide, high] = [Vector3::x(), Vector3::y(), Vector3::z()].map(|v| map_from_landmark * v);
    let length_px = |side_m: f64| viewer.focal_px * side_m / distance;
    // Incidence and apparent size.
    let width_px = length_px(place.size.width_m * wide.cross(&sight).norm());
    let height_px = length_px(place.size.height_m * high.cross(&sight).norm());
    if normal.dot(&sight) < p.max_incidence_rad.cos() || width_px.min(height_px) < p.min_side_px {
        return false;
    }
    // The axes of the image of an upright camera that looks at the centre.
    let right = sight.cross(&Vector3::z()).normalize();
    let up = right.cross(&-sight).normalize();
    let across = place.size.width_m * wide.dot(&right).abs() + place.size.height_m * high.dot(&right).abs();
    let upright = (high - right * high.dot(&right)).norm();
    let along = place.size.width_m * wide.dot(&up).abs() + place.size.height_m * upright;
    let whole = length_px(across) <= p.max_fill * viewer.width_px
        && length_px(along) <= p.max_fill * viewer.height_px;
    let tilt = (-sight.z).atan2(sight.xy().norm());
    if !whole || tilt < viewer.tilt_rad[0] || tilt > viewer.tilt_rad[1] {
        return false;
    }
    let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)]
        .map(|(y, z)| Point2::from(face(y * half_width, z * half_height).coords.xy()));
    // Triangles of the camera with all pairs of corners cover the hull of camera and landmark on
    // the floor.
    let hidden =
        |o: &Obstacle| (0..4).any(|i| (0..i).any(|j| meets(&[*q, corners[i], corners[j]], &o.a, &o.b)));
    let lowest = (place.z_m - half_height * place.tilt_rad.cos()).min(viewer.camera_height_m);
    !obstacles.iter().any(|o| o.height_m.is_none_or(|h| h > lowest) && hidden(o))
}

/// Whether a segment touches a triangle: what three half-planes leave of it. A triangle without
/// area touches nothing.
fn meets(triangle: &[Point2<f64>; 3], a: &Point2<f64>, b: &Point2<f64>) -> bool {
    let twice_area = (triangle[1] - triangle[0]).perp(&(triangle[2] - triangle[0]));
    if twice_area.abs() < 1e-12 {
        return false;
    }
    let turn = twice_area.signum();
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
