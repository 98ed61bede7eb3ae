//! A described keypoint, and a patch with its keypoints.

use crate::points::{
    descriptor::{Descriptor, Window, describe},
    keypoints::{ScaleSpace, keypoints},
    patch::Patch,
};

/// A described keypoint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Place in landmark coordinates.
    pub at: [f32; 2],
    /// Scale in landmark units.
    pub sigma: f32,
    /// Its descriptor.
    pub descriptor: Descriptor,
}

/// A patch with its scale space and points.
#[derive(Debug, Clone)]
pub struct SeenPatch {
    /// The patch.
    pub patch: Patch,
    /// Its smoothed pictures.
    pub space: ScaleSpace,
    /// Its points, strongest first.
    pub points: Vec<Point>,
}

impl SeenPatch {
    /// Computes the points of `patch`.
    pub fn new(patch: Patch, most: usize) -> Self {
        let space = ScaleSpace::new(&patch);
        let found = keypoints(&patch, &space, most);
        let points = found
            .iter()
            .map(|k| Point {
                at: patch.to_landmark(k.x, k.y),
                sigma: k.sigma / patch.inner as f32,
                descriptor: describe(
                    &space.octaves[k.octave],
                    &Window { x: k.x, y: k.y, sigma: k.sigma, level: k.level },
                )
                .0,
            })
            .collect();
        Self { patch, space, points }
    }
}

impl Point {
    /// The point after the patch was turned counter-clockwise by `shift` quarters.
    #[must_use]
    pub fn rotated(&self, shift: usize) -> Self {
        let [x, y] = self.at;
        let at = match shift % 4 {
            0 => [x, y],
            1 => [y, 1.0 - x],
            2 => [1.0 - x, 1.0 - y],
            _ => [1.0 - y, x],
        };
        Self { at, sigma: self.sigma, descriptor: self.descriptor.rotated(shift) }
    }
}
