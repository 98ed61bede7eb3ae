//! A whole frame in, its described keypoints out, as the patches of landmarks of several shapes
//! would show them.
//!
//! A patch is a square, whatever the shape of its landmark. A frame is not rectified: each keypoint
//! is described once for every one of a few shapes.

use crate::{
    detect::pyramid::{reduce, working_factor},
    frame::GrayImage,
    geometry::{corners::Corners, homography::Homography, polygon::contains},
    icon::sample_row,
    points::{
        descriptor::{Descriptor, Window, describe_stretched},
        keypoints::{Keypoint, ScaleSpace, all_keypoints},
        plain::distance_to_plain,
        taught::MIN_PLAIN_DISTANCE,
    },
};
use nalgebra::{Matrix3, Point2};
use std::collections::BTreeMap;

/// Most keypoints of a frame: the bound of the time that a frame's texture takes.
pub const MAX_FRAME_POINTS: usize = 400;
/// Width over height, in the image, of the landmarks that keypoints are described for. One and a
/// third to either side is near enough.
const SHAPES: [f32; 3] = [0.5, 0.85, 1.45];
/// Most points: every keypoint in every shape.
pub const MAX_DESCRIBED: usize = MAX_FRAME_POINTS * SHAPES.len();
/// Larger frames are reduced by a whole factor to about this longer side, pixels.
const WORKING_SIDE_PX: usize = 640;
/// Octaves of a frame.
const OCTAVES: usize = 3;
/// Smallest response of a keypoint, grey levels: ten times that of patches, whose keypoints have
/// fewer rivals.
const MIN_RESPONSE: f32 = 2.5;
/// Keypoints are chosen from cells of this side in turn, work pixels: one rich picture must not
/// take all.
const CELL_PX: f32 = 40.0;
/// Frames that are rolled less are described as they are, radians.
const MAX_ROLL_RAD: f64 = 0.14;

/// A described keypoint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FramePoint {
    /// Place, work pixels.
    pub at_px: [f32; 2],
    /// Scale along x and y, work pixels.
    pub sigma_px: [f32; 2],
    /// Its descriptor.
    pub descriptor: Descriptor,
}

/// The described keypoints of a frame, in its work picture: reduced, and turned by a given roll.
#[derive(Debug, Clone)]
pub struct FramePoints {
    /// At most [`MAX_DESCRIBED`].
    pub points: Vec<FramePoint>,
    /// Width and height of the work picture, pixels.
    pub size_px: [usize; 2],
    /// Image pixels of a work pixel.
    pub image_from_work: Homography,
}

/// The points of `image` outside of the borders `explained`. The work picture is the image turned
/// back by `roll_rad`: clockwise on screen is positive. `None` for an image without pixels.
pub fn frame_points(image: &GrayImage, roll_rad: f64, explained: &[Corners]) -> Option<FramePoints> {
    let factor = working_factor(image, WORKING_SIDE_PX);
    let reduced = (factor > 1).then(|| reduce(image, factor));
    let work = reduced.as_ref().unwrap_or(image);
    let (size_px, work_from_turned, pixels) = turned_back(work, roll_rad)?;
    let scale = factor as f64;
    let shift = 0.5 * (scale - 1.0);
    let enlarged = Matrix3::new(scale, 0.0, shift, 0.0, scale, shift, 0.0, 0.0, 1.0);
    let image_from_work = Homography::from_matrix(enlarged * work_from_turned)?;
    let space = ScaleSpace::of_frame(&pixels, size_px[0], OCTAVES);
    let last = [image.width() as f64 - 1.0, image.height() as f64 - 1.0];
    let mut found = all_keypoints(&space, MIN_RESPONSE);
    found.retain(|k| {
        let at = image_from_work.apply(&Point2::new(f64::from(k.x), f64::from(k.y)));
        let is_inside = at.x >= 0.0 && at.y >= 0.0 && at.x <= last[0] && at.y <= last[1];
        is_inside && !explained.iter().any(|border| contains(border.points(), &at, 0.0))
    });
    let points = spread(found).iter().flat_map(|k| described(k, &space)).collect();
    Some(FramePoints { points, size_px, image_from_work })
}

/// The work picture with its width and height, and where its pixels are.
fn turned_back(image: &GrayImage, roll_rad: f64) -> Option<([usize; 2], Matrix3<f64>, Vec<f32>)> {
    let (width, height) = (image.width(), image.height());
    if roll_rad.abs() <= MAX_ROLL_RAD {
        let pixels = image.data().iter().map(|grey| f32::from(*grey)).collect();
        return Some(([width, height], Matrix3::identity(), pixels));
    }
    let (sin, cos) = roll_rad.sin_cos();
    let (across, down) = (width as f64, height as f64);
    let wide = (across * cos.abs() + down * sin.abs()).ceil();
    let high = (across * sin.abs() + down * cos.abs()).ceil();
    let centre = |side: f64| 0.5 * (side - 1.0);
    let x = centre(across) - cos * centre(wide) + sin * centre(high);
    let y = centre(down) - sin * centre(wide) - cos * centre(high);
    let map = Matrix3::new(cos, -sin, x, sin, cos, y, 0.0, 0.0, 1.0);
    let image_from_turned = Homography::from_matrix(map)?;
    let size_px = [wide as usize, high as usize];
    let mut pixels = vec![0.0; size_px[0] * size_px[1]];
    for (row, line) in (0..).zip(pixels.chunks_exact_mut(size_px[0])) {
        sample_row(image, &image_from_turned, 0, row, 1, line);
    }
    Some((size_px, map, pixels))
}

/// The strongest of each cell, then the second of each, at most [`MAX_FRAME_POINTS`].
fn spread(found: Vec<Keypoint>) -> Vec<Keypoint> {
    let mut taken: BTreeMap<[i32; 2], usize> = BTreeMap::new();
    let mut ranked: Vec<(usize, Keypoint)> = Vec::with_capacity(found.len());
    for keypoint in found {
        let cell = [keypoint.x, keypoint.y].map(|at| (at / CELL_PX) as i32);
        let rank = taken.entry(cell).or_default();
        ranked.push((*rank, keypoint));
        *rank += 1;
    }
    // Stable: of one rank the strongest first.
    ranked.sort_by_key(|(rank, _)| *rank);
    ranked.truncate(MAX_FRAME_POINTS);
    ranked.into_iter().map(|(_, keypoint)| keypoint).collect()
}

/// A keypoint in every shape, without plain structures.
fn described(k: &Keypoint, space: &ScaleSpace) -> impl Iterator<Item = FramePoint> {
    SHAPES.into_iter().filter_map(|shape| {
        let stretch = [shape.sqrt(), 1.0 / shape.sqrt()];
        let window = Window { x: k.x, y: k.y, sigma: k.sigma, level: k.level };
        let (descriptor, _) = describe_stretched(&space.octaves[k.octave], &window, stretch);
        let is_plain = distance_to_plain(&descriptor) < MIN_PLAIN_DISTANCE;
        let sigma_px = stretch.map(|factor| factor * k.sigma);
        (!is_plain).then_some(FramePoint { at_px: [k.x, k.y], sigma_px, descriptor })
    })
}

impl FramePoints {
    /// The points after the work picture was turned counter-clockwise by `shift` quarters, as
    /// [`Point::rotated`](crate::points::point::Point::rotated) turns those of a patch.
    pub fn turned(&self, shift: usize) -> Vec<FramePoint> {
        let turned = |p: &FramePoint| FramePoint {
            at_px: self.turned_at(p.at_px.map(f64::from), shift).map(|at| at as f32),
            sigma_px: if shift.is_multiple_of(2) { p.sigma_px } else { [p.sigma_px[1], p.sigma_px[0]] },
            descriptor: p.descriptor.rotated(shift),
        };
        self.points.iter().map(turned).collect()
    }

    fn turned_at(&self, [x, y]: [f64; 2], shift: usize) -> [f64; 2] {
        let [right, bottom] = self.size_px.map(|side| side as f64 - 1.0);
        match shift % 4 {
            0 => [x, y],
            1 => [y, right - x],
            2 => [right - x, bottom - y],
            _ => [bottom - y, x],
        }
    }

    /// Image pixels of a place in the work picture after it was turned by `shift` quarters.
    pub fn to_image(&self, [x, y]: [f64; 2], shift: usize) -> Point2<f64> {
        let [right, bottom] = self.size_px.map(|side| side as f64 - 1.0);
        let [x, y] = match shift % 4 {
            0 => [x, y],
            1 => [right - y, x],
            2 => [right - x, bottom - y],
            _ => [y, bottom - x],
        };
        self.image_from_work.apply(&Point2::new(x, y))
    }
}

#[cfg(test)]
mod tests;
