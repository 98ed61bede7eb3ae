//! Smaller copies of an image, by averaging whole blocks, and quads carried between scales. A large image is searched
//! at a working scale: sides of quads are long, so nothing is lost but time. Finds nothing itself.
//!
//! Departs from method 1, which works at full size: time is bounded, and ornate frames are lines only when seen coarsely.

use super::quads::{Corners, Quad};
use crate::frame::GrayImage;
use nalgebra::Point2;

/// The whole factor that brings the longer side nearest to `side_px`; 1 if it is smaller, or `side_px` is 0.
pub fn working_factor(image: &GrayImage, side_px: usize) -> usize {
    let longest = image.width().max(image.height());
    (longest + side_px / 2).checked_div(side_px).unwrap_or(1).max(1)
}

/// Averages blocks of `factor` x `factor` pixels; a rest at the right and lower border is left out. An image smaller
/// than a block stays as it is.
pub fn reduce(image: &GrayImage, factor: usize) -> GrayImage {
    let factor = factor.max(1);
    let (width, height) = (image.width() / factor, image.height() / factor);
    if width == 0 || height == 0 {
        return image.clone();
    }
    let count = (factor * factor) as u32;
    let mut sums = vec![0_u32; width];
    let mut data = Vec::with_capacity(width * height);
    for row in 0..height {
        sums.fill(0);
        for v in row * factor..(row + 1) * factor {
            let line = &image.data()[v * image.width()..][..width * factor];
            for (sum, block) in sums.iter_mut().zip(line.chunks_exact(factor)) {
                *sum += block.iter().map(|p| u32::from(*p)).sum::<u32>();
            }
        }
        data.extend(sums.iter().map(|s| ((s + count / 2) / count) as u8));
    }
    GrayImage::new(width, height, data).unwrap_or_else(|_| image.clone())
}

/// A point of the reduced image in the larger one: pixel centres are at integers on both.
pub fn enlarge(p: &Point2<f64>, factor: f64) -> Point2<f64> {
    p.map(|x| (x + 0.5) * factor - 0.5)
}

impl Corners {
    /// The corners in an image larger by `factor`; none if they no longer make a quad, which only rounding can cause.
    pub fn scaled(&self, factor: f64) -> Option<Self> {
        Self::new(self.points().map(|p| enlarge(&p, factor))).ok()
    }
}

impl Quad {
    /// The quad in an image larger by `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Option<Self> {
        Some(Self {
            corners_px: self.corners_px.scaled(factor)?,
            corner_covariance_px2: self.corner_covariance_px2.map(|c| c * factor * factor),
            alternates: self.alternates.iter().filter_map(|a| a.scaled(factor)).collect(),
            ..self.clone()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_averaged() {
        let image =
            GrayImage::new(5, 4, vec![0, 4, 10, 10, 99, 8, 4, 10, 10, 99, 1, 1, 0, 2, 99, 1, 2, 0, 2, 99])
                .unwrap();
        let small = reduce(&image, 2);
        assert_eq!((small.width(), small.height()), (2, 2));
        assert_eq!(small.data(), &[4, 10, 1, 1]);
        assert_eq!(reduce(&image, 9), image);
    }

    #[test]
    fn working_factor_by_size() {
        let image = |width| GrayImage::from_fn(width, 2, |_, _| 0);
        for (width, factor) in
            [(1, 1), (640, 1), (959, 1), (960, 2), (1024, 2), (1280, 2), (1920, 3), (8000, 13)]
        {
            assert_eq!(working_factor(&image(width), 640), factor, "{width}");
            assert_eq!(working_factor(&image(width), 0), 1);
        }
    }

    #[test]
    fn a_point_keeps_its_place() {
        // Left edge of the image: -0.5 on every scale.
        let p = enlarge(&Point2::new(-0.5, 0.0), 2.0);
        assert!((p - Point2::new(-0.5, 0.5)).norm() < 1e-12);
    }
}
