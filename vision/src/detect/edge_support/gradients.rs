//! An image with its gradient planes, read at points between pixels.

use crate::{detect::edge_support::fixed_point::Fixed, frame::GrayImage};

/// The gradient points along the normal to within about 35 degrees.
pub(crate) const MIN_COS: f32 = 0.82;

/// The gradient planes of a frame, row-major, in grey levels of step height.
#[derive(Debug, Clone, Copy)]
pub struct Gradients<'a> {
    /// The image they belong to.
    pub image: &'a GrayImage,
    /// Derivative along u.
    pub gx: &'a [f32],
    /// Derivative along v.
    pub gy: &'a [f32],
}

impl Gradients<'_> {
    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.image.width()
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.image.height()
    }

    /// Bilinear gradient; none outside the image.
    pub(crate) fn sample(&self, u: f64, v: f64) -> Option<[f32; 2]> {
        let inside = u >= 0.0 && v >= 0.0 && u < (self.width() - 1) as f64 && v < (self.height() - 1) as f64;
        if !inside {
            return None;
        }
        let (u0, v0) = (u as usize, v as usize);
        let (a, b) = ((u - u0 as f64) as f32, (v - v0 as f64) as f32);
        let i = v0 * self.width() + u0;
        let at = |plane: &[f32]| {
            let top = plane[i] * (1.0 - a) + plane[i + 1] * a;
            let bottom = plane[i + self.width()] * (1.0 - a) + plane[i + self.width() + 1] * a;
            top * (1.0 - b) + bottom * b
        };
        Some([at(self.gx), at(self.gy)])
    }

    /// Gradient at the nearest pixel; none outside the image.
    #[inline]
    pub(crate) fn nearest(&self, p: Fixed) -> Option<[f32; 2]> {
        let i = p.pixel(self.width(), self.height())?;
        Some([*self.gx.get(i)?, *self.gy.get(i)?])
    }

    /// Whether a point lies in the image.
    #[inline]
    pub(crate) fn holds(&self, p: Fixed) -> bool {
        p.pixel(self.width(), self.height()).is_some()
    }

    /// Gradient at the nearest pixel of a point that is known to lie in the image.
    #[inline]
    pub(crate) fn within(&self, p: Fixed) -> [f32; 2] {
        let i = p.index(self.width());
        [self.gx[i], self.gy[i]]
    }

    /// The step across a line with this normal at the nearest pixel, 0 where the gradient does not
    /// point along the normal to within about 35 degrees; none outside the image.
    #[inline]
    pub(crate) fn step_following(&self, p: Fixed, normal: [f32; 2]) -> Option<f32> {
        let (step, square) = across(self.nearest(p)?, normal);
        Some(if step * step >= MIN_COS * MIN_COS * square { step } else { 0.0 })
    }

    /// Whether the gradient at the nearest pixel is a step of at least `min_step` across a line
    /// with this normal, to within about 35 degrees; none outside the image.
    #[inline]
    pub(crate) fn follows(&self, p: Fixed, normal: [f32; 2], min_step: f32) -> Option<bool> {
        let (step, square) = across(self.nearest(p)?, normal);
        Some(step.abs() >= min_step && step * step >= MIN_COS * MIN_COS * square)
    }
}

/// The step across a line with this normal, and the squared gradient.
#[inline]
pub(crate) fn across([x, y]: [f32; 2], [nx, ny]: [f32; 2]) -> (f32, f32) {
    (x * nx + y * ny, x * x + y * y)
}
