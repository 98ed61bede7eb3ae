//! Smaller copies of an image, by averaging whole blocks, and quads mapped between scales. Quads of
//! a large image are detected at a working scale: their sides are long enough there.
//!
//! Departs from method 1, which works at full size: time is bounded, and ornate frames are straight
//! at a coarse scale only.

use crate::{
    detect::quad::Quad,
    frame::{GrayImage, PictureRef},
    geometry::corners::Corners,
};
use nalgebra::Point2;

/// The whole factor that brings the longer side nearest to `side_px`; 1 if it is smaller, or
/// `side_px` is 0.
pub fn working_factor<'a>(image: impl Into<PictureRef<'a>>, side_px: usize) -> usize {
    let image = image.into();
    let longest = image.width().max(image.height());
    (longest + side_px / 2).checked_div(side_px).unwrap_or(1).max(1)
}

/// Averages blocks of `factor` x `factor` pixels; incomplete blocks at the right and lower border
/// are dropped. An image smaller than a block stays as it is.
pub fn reduce(image: &GrayImage, factor: usize) -> GrayImage {
    let factor = factor.max(1);
    let (width, height) = (image.width() / factor, image.height() / factor);
    if width == 0 || height == 0 {
        return image.clone();
    }
    let count = (factor * factor) as u32;
    // Columns are summed first, vectorised; then one row of sums is split into blocks.
    let mut columns = vec![0_u16; width * factor];
    let mut sums = vec![0_u32; width];
    let mut data = Vec::with_capacity(width * height);
    for lines in image.data().chunks_exact(image.width() * factor) {
        sums.fill(0);
        for lines in lines.chunks(image.width() * MAX_ADDED_ROWS) {
            columns.fill(0);
            for line in lines.chunks_exact(image.width()) {
                for (sum, p) in columns.iter_mut().zip(line) {
                    *sum += u16::from(*p);
                }
            }
            if factor == 2 {
                add_blocks(columns.as_chunks::<2>().0, &mut sums);
            } else {
                for (sum, block) in sums.iter_mut().zip(columns.chunks_exact(factor)) {
                    *sum += block.iter().map(|p| u32::from(*p)).sum::<u32>();
                }
            }
        }
        if factor == 2 {
            data.extend(sums.iter().map(|s| ((s + 2) / 4) as u8));
        } else {
            data.extend(sums.iter().map(|s| ((s + count / 2) / count) as u8));
        }
    }
    GrayImage::new(width, height, data).unwrap_or_else(|_| image.clone())
}

/// Most rows of bytes whose sum fits in sixteen bits.
const MAX_ADDED_ROWS: usize = 257;

fn add_blocks<const N: usize>(blocks: &[[u16; N]], sums: &mut [u32]) {
    for (sum, block) in sums.iter_mut().zip(blocks) {
        *sum += block.iter().map(|p| u32::from(*p)).sum::<u32>();
    }
}

/// A point of the reduced image in the larger one: pixel centres are at integers on both.
pub fn enlarge(p: &Point2<f64>, factor: f64) -> Point2<f64> {
    p.map(|x| (x + 0.5) * factor - 0.5)
}

impl Corners {
    /// The corners in an image larger by `factor`; none if they no longer make a quad, which only
    /// rounding can cause.
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
    fn every_factor_gives_the_rounded_mean_of_its_blocks() {
        // White, where sums are largest, and a rest at both borders.
        for (factor, (width, height)) in
            [(2, (67, 35)), (3, (67, 35)), (5, (24, 16)), (258, (260, 520)), (300, (301, 601))]
        {
            let white = GrayImage::from_fn(width, height, |_, _| 255);
            assert!(reduce(&white, factor).data().iter().all(|p| *p == 255), "factor {factor}");
            let image = GrayImage::from_fn(width, height, |u, v| (u * 37 + v * 91 + u * v) as u8);
            let small = reduce(&image, factor);
            for (i, value) in small.data().iter().enumerate() {
                let (u, v) = (i % small.width() * factor, i / small.width() * factor);
                let block = (0..factor * factor).map(|i| u32::from(image.at(u + i % factor, v + i / factor)));
                let mean = f64::from(block.sum::<u32>()) / (factor * factor) as f64;
                assert!((f64::from(*value) - mean).abs() <= 0.5, "factor {factor}: {value} for {mean}");
            }
        }
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
    fn a_point_maps_to_the_same_place_at_every_scale() {
        // Left edge of the image: -0.5 on every scale.
        let p = enlarge(&Point2::new(-0.5, 0.0), 2.0);
        assert!((p - Point2::new(-0.5, 0.5)).norm() < 1e-12);
    }
}
