//! Rotations by quarter turns about a landmark.

use nalgebra::Point2;

/// A point in the frame of a quarter, whose x is the quarter's axis.
pub(super) fn turned(p: &Point2<f64>, quarter: usize) -> Point2<f64> {
    match quarter % 4 {
        0 => *p,
        1 => Point2::new(p.y, -p.x),
        2 => Point2::new(-p.x, -p.y),
        _ => Point2::new(-p.y, p.x),
    }
}

/// The inverse of [`turned`].
pub(super) fn turned_back(p: &Point2<f64>, quarter: usize) -> Point2<f64> {
    turned(p, 4 - quarter % 4)
}
