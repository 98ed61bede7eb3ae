//! A quad in, its rectified patch with a margin out. The margin lets the taught border lie outside
//! the detected one.
//!
//! Landmark coordinates: the quad's corners TL, TR, BR, BL are (0, 0), (1, 0), (1, 1), (0, 1).

use crate::{
    frame::GrayImage,
    geometry::{corners::Corners, homography::Homography},
    icon::{sample_row, samples_for},
};
use nalgebra::{Matrix3, Point2};

/// Sides of the quad inside its patch, in patch pixels, falling. With the margin patches have 198,
/// 120 and 72 px.
pub const INNER_PX: [usize; 3] = [128, 84, 56];
/// Margin on every side, as a share of the quad's side.
pub const MARGIN: f64 = 0.25;
/// A quad is magnified by at most this factor before the next smaller patch is taken.
const MAX_MAGNIFICATION: f64 = 1.25;

/// Width that a bilinear sample covers, in pixels of the image.
const SAMPLE_PX: f64 = 2.0;

/// A rectified patch.
#[derive(Debug, Clone)]
pub struct Patch {
    /// Side with margins, in pixels.
    pub side: usize,
    /// Side of the quad in the patch, in pixels.
    pub inner: usize,
    /// Row-major grey levels, 0 to 255.
    pub pixels: Vec<f32>,
    to_image: Homography,
    image_size_px: [f64; 2],
}

/// The side of the quad in the patch for its size in the image.
pub fn inner_px(corners_px: &Corners) -> usize {
    let wanted_px = corners_px.area_px2().max(0.0).sqrt() * MAX_MAGNIFICATION;
    INNER_PX.into_iter().find(|inner| *inner as f64 <= wanted_px).unwrap_or(INNER_PX[INNER_PX.len() - 1])
}

impl Patch {
    /// Rectifies the quad `corners_px` to `inner` x `inner` pixels, with [`MARGIN`] around. Outside
    /// the image its border is repeated. `None` where the corners are degenerate or the margin
    /// reaches the horizon.
    pub fn new(image: &GrayImage, corners_px: &Corners, inner: usize) -> Option<Self> {
        let margin = (inner as f64 * MARGIN).round() as usize;
        let side = inner + 2 * margin;
        let image_from_inner = Homography::square_to_quad(inner, corners_px).ok()?;
        let shift = Matrix3::new(1.0, 0.0, -(margin as f64), 0.0, 1.0, -(margin as f64), 0.0, 0.0, 1.0);
        let image_from_patch = Homography::from_matrix(image_from_inner.matrix() * shift)?;
        let last = side as f64 - 0.5;
        let ends = [[-0.5, -0.5], [last, -0.5], [last, last], [-0.5, last]].map(Point2::from);
        let nearest = ends.iter().map(|p| image_from_patch.denominator(p)).fold(f64::INFINITY, f64::min);
        let furthest = ends.iter().map(|p| image_from_patch.denominator(p)).fold(0.0, f64::max);
        if nearest <= MIN_DEPTH_RATIO * furthest {
            return None;
        }
        let pixels_per_cell = corners_px.area_px2().sqrt() / inner as f64;
        let samples = samples_for(pixels_per_cell, SAMPLE_PX);
        let mut pixels = vec![0.0; side * side];
        for (row, line) in (0..).zip(pixels.chunks_exact_mut(side)) {
            sample_row(image, &image_from_patch, 0, row, samples, line);
        }
        let image_size_px = [image.width() as f64, image.height() as f64];
        Some(Self { side, inner, pixels, to_image: image_from_patch, image_size_px })
    }

    /// Landmark coordinates of a point in patch pixels.
    pub fn to_landmark(&self, x: f32, y: f32) -> [f32; 2] {
        let margin = ((self.side - self.inner) / 2) as f32;
        let scale = 1.0 / self.inner as f32;
        [(x + 0.5 - margin) * scale, (y + 0.5 - margin) * scale]
    }

    /// Patch pixels of a point in landmark coordinates.
    pub fn to_patch(&self, at: [f64; 2]) -> [f64; 2] {
        let margin = ((self.side - self.inner) / 2) as f64;
        at.map(|a| a * self.inner as f64 + margin - 0.5)
    }

    /// Image pixels of a point in landmark coordinates; `None` beyond the horizon.
    pub fn to_image(&self, at: [f64; 2]) -> Option<Point2<f64>> {
        let point = Point2::from(self.to_patch(at));
        (self.to_image.denominator(&point) > 0.0).then(|| self.to_image.apply(&point))
    }

    /// Whether the patch within `reach` patch pixels of (x, y) lies inside the image.
    pub fn is_seen(&self, x: f32, y: f32, reach: f32) -> bool {
        let (x, y, reach) = (f64::from(x), f64::from(y), f64::from(reach));
        [[-reach, -reach], [reach, -reach], [reach, reach], [-reach, reach]].iter().all(|[dx, dy]| {
            let at = self.to_image.apply(&Point2::new(x + dx, y + dy));
            at.x >= -0.5
                && at.y >= -0.5
                && at.x <= self.image_size_px[0] - 0.5
                && at.y <= self.image_size_px[1] - 0.5
        })
    }
}

/// Smallest ratio of depths in a patch: below it the patch is too near to the horizon.
const MIN_DEPTH_RATIO: f64 = 0.05;
