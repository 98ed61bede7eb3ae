//! Points of an image in fixed point, for loops over thousands of pixels along lines: advancing is
//! an addition, the pixel of a point a shift. In: coordinates. Out: indices of pixels.

use nalgebra::{Point2, Vector2};

/// Fractional bits.
const BITS: u32 = 32;
/// Coordinates are clamped to this, far outside every image, so that no sum of them overflows.
const FARTHEST_PX: f64 = 1e6;

/// A point of an image or a step in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Fixed {
    u: i64,
    v: i64,
}

impl Fixed {
    /// A point, pixel centres at integers. NaN becomes 0.
    pub(crate) fn point(p: &Point2<f64>) -> Self {
        // Half a pixel added, so that truncation rounds to the nearest.
        Self::new(p.x + 0.5, p.y + 0.5)
    }

    pub(crate) fn step(by: &Vector2<f64>) -> Self {
        Self::new(by.x, by.y)
    }

    fn new(u: f64, v: f64) -> Self {
        let fixed = |x: f64| (x.clamp(-FARTHEST_PX, FARTHEST_PX) * (1_i64 << BITS) as f64) as i64;
        Self { u: fixed(u), v: fixed(v) }
    }

    /// The point `times` steps on.
    #[inline]
    pub(crate) fn on(self, step: Self, times: i64) -> Self {
        Self {
            u: self.u.wrapping_add(step.u.wrapping_mul(times)),
            v: self.v.wrapping_add(step.v.wrapping_mul(times)),
        }
    }

    /// The index of the pixel around the point in an image of this width and height; none outside.
    #[inline]
    pub(crate) fn pixel(self, width: usize, height: usize) -> Option<usize> {
        // Negative values wrap to very large ones.
        let (u, v) = ((self.u >> BITS) as usize, (self.v >> BITS) as usize);
        (u < width && v < height).then(|| v * width + u)
    }

    /// The same of a point that is known to lie in the image.
    #[inline]
    pub(crate) fn index(self, width: usize) -> usize {
        ((self.v >> BITS) as usize).wrapping_mul(width).wrapping_add((self.u >> BITS) as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_the_nearest() {
        let pixel = |u: f64, v: f64| Fixed::point(&Point2::new(u, v)).pixel(10, 8);
        assert_eq!([pixel(0.0, 0.0), pixel(-0.4, 0.4), pixel(2.6, 1.0)], [Some(0), Some(0), Some(13)]);
        assert_eq!([pixel(9.4, 7.4), pixel(9.6, 0.0), pixel(0.0, 7.6)], [Some(79), None, None]);
        assert_eq!([pixel(-0.6, 0.0), pixel(0.0, -0.6), pixel(1e300, 0.0)], [None; 3]);
        assert_eq!([pixel(f64::NEG_INFINITY, 0.0), pixel(0.0, -1e300)], [None; 2]);
    }

    #[test]
    fn steps_add_up() {
        let step = Fixed::step(&Vector2::new(0.3, -0.7));
        let end = Fixed::point(&Point2::new(2.0, 700.0)).on(step, 1000);
        assert_eq!(end.pixel(1000, 1000), Some(302));
        assert_eq!(end.on(step, -1000).pixel(1000, 1000), Some(700_002));
    }
}
