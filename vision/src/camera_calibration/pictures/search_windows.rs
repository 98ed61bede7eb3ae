//! Where an object may be in a picture in which no border of it was found: quads that it would fill
//! from the front and tilted to four sides, at several places and sizes.

use crate::geometry::corners::Corners;
use nalgebra::{Point2, Rotation3, Vector3};

/// Tilts of the object, radians.
const TILT_RAD: f64 = 0.6;
/// Sizes of the object: its longer side over the picture's shorter one.
const SIZES: [f64; 2] = [0.8, 0.5];
/// Places along either axis.
const PLACES: usize = 3;
/// Focal length that the perspective is made with, in longer sides of the picture.
const FOCAL: f64 = 0.9;

/// The quads of an object of `aspect` (width over height) in a picture of `size_px`.
pub(crate) fn search_windows(size_px: [f64; 2], aspect: f64) -> Vec<Corners> {
    let f = FOCAL * size_px[0].max(size_px[1]);
    let short = size_px[0].min(size_px[1]);
    let tilts = [[0.0, 0.0], [TILT_RAD, 0.0], [-TILT_RAD, 0.0], [0.0, TILT_RAD], [0.0, -TILT_RAD]];
    let mut made = Vec::new();
    for size in SIZES {
        let longer = size * short;
        let (w, h) = if aspect > 1.0 { (longer, longer / aspect) } else { (longer * aspect, longer) };
        for [about_x, about_y] in tilts {
            let turn = Rotation3::from_euler_angles(about_x, about_y, 0.0);
            for place in 0..PLACES * PLACES {
                let along = |i: usize, side: f64| (i as f64 + 1.0) / (PLACES as f64 + 1.0) * side - 0.5;
                let centre =
                    Point2::new(along(place % PLACES, size_px[0]), along(place / PLACES, size_px[1]));
                let corners = [(-w, -h), (w, -h), (w, h), (-w, h)].map(|(x, y)| {
                    let p = turn * Vector3::new(0.5 * x, 0.5 * y, 0.0) + Vector3::new(0.0, 0.0, f);
                    centre + nalgebra::Vector2::new(p.x, p.y) * (f / p.z)
                });
                made.extend(Corners::new(corners).ok());
            }
        }
    }
    made
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_have_the_aspect_and_are_tilted() {
        let windows = search_windows([640.0, 480.0], 2.0);
        assert_eq!(windows.len(), SIZES.len() * 5 * PLACES * PLACES);
        let side = |c: &Corners, i: usize| (c.points()[(i + 1) % 4] - c.points()[i]).norm();
        assert!((side(&windows[0], 0) - 0.8 * 480.0).abs() < 1e-9);
        assert!((side(&windows[0], 0) / side(&windows[0], 1) - 2.0).abs() < 1e-9);
        // Tilted about the horizontal: one of top and bottom is nearer.
        assert!((side(&windows[9], 0) / side(&windows[9], 2) - 1.0).abs() > 0.1);
    }
}
