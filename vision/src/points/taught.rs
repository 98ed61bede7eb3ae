//! Views of a landmark in, its stored points out.

use crate::{
    frame::GrayImage,
    geometry::corners::Corners,
    points::{
        descriptor::{Descriptor, WORDS},
        patch::{INNER_PX, Patch, inner_px},
        plain::distance_to_plain,
        point::{Point, SeenPatch},
        vocabulary::word,
    },
};
use std::sync::LazyLock;

/// Most points of a landmark.
pub const MAX_LANDMARK_POINTS: usize = 240;
/// Most views that points are taken from.
pub const MAX_POINT_VIEWS: usize = 3;
/// Points of the largest patch of a view to those of the smaller ones.
const SHARES: [usize; 3] = [4, 1, 1];
/// Points of smaller patches that are coarser than this, in their pixels, see whole frames at once.
const COARSEST_PX: f32 = 5.0;
/// Most points of a patch.
const MAX_VIEW_POINTS: usize = 400;
/// Points nearer than this to a plain structure are dropped.
pub(crate) const MIN_PLAIN_DISTANCE: u32 = 46;
/// Points of one position and scale whose descriptors are nearer than this are duplicates.
const SAME_DISTANCE: u32 = 40;
/// Positions nearer than this, in landmark units, are the same.
const SAME_PLACE: f32 = 0.02;
/// Steps of the stored scale in a factor of 2.
const SCALE_STEPS: f32 = 24.0;
/// The scale of each stored step, in landmark units.
static SCALES: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|step| (-(step as f32) / SCALE_STEPS).exp2()));
/// Bytes of a stored point.
pub(crate) const POINT_BYTES: usize = 8 * WORDS + 6;

/// A landmark's point as stored: quantised, so that memory and database agree bit for bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TaughtPoint {
    /// Its descriptor.
    pub descriptor: Descriptor,
    /// Place in landmark coordinates, in 65535ths.
    at: [u16; 2],
    /// Scale: `2^(-sigma / 24)` landmark units.
    sigma: u8,
    /// Distance to the most similar plain structure.
    plain: u8,
    /// Word of the descriptor; not stored, it follows from that.
    word: u16,
}

/// The stored step of a scale in landmark units.
pub(crate) fn scale_step(sigma: f32) -> u8 {
    (-sigma.log2() * SCALE_STEPS).round().clamp(0.0, 255.0) as u8
}

/// The scale in landmark units of a stored step.
pub(crate) fn scale_of_step(step: u8) -> f32 {
    SCALES[usize::from(step)]
}

impl TaughtPoint {
    fn new(point: &Point, plain: u32) -> Self {
        let at = point.at.map(|a| (a.clamp(0.0, 1.0) * f32::from(u16::MAX)).round() as u16);
        let (descriptor, sigma) = (point.descriptor, scale_step(point.sigma));
        Self { descriptor, at, sigma, plain: plain.min(255) as u8, word: word(&descriptor) }
    }

    /// The point.
    pub fn point(&self) -> Point {
        let at = self.at.map(|a| f32::from(a) / f32::from(u16::MAX));
        Point { at, sigma: SCALES[usize::from(self.sigma)], descriptor: self.descriptor }
    }

    /// Distance to the most similar plain structure.
    pub fn plain(&self) -> u32 {
        u32::from(self.plain)
    }

    /// Word of its descriptor.
    pub(crate) fn word(&self) -> u16 {
        self.word
    }

    /// Its stored scale step.
    pub(crate) fn scale_step(&self) -> u8 {
        self.sigma
    }

    /// Appends [`POINT_BYTES`] bytes.
    pub(crate) fn write(&self, out: &mut Vec<u8>) {
        out.extend(self.descriptor.0.iter().flat_map(|w| w.to_le_bytes()));
        out.extend(self.at.iter().flat_map(|a| a.to_le_bytes()));
        out.extend([self.sigma, self.plain]);
    }

    /// The reverse.
    pub(crate) fn read(bytes: &[u8; POINT_BYTES]) -> Self {
        let mut words = [0; WORDS];
        for (word, bytes) in words.iter_mut().zip(bytes.as_chunks::<8>().0) {
            *word = u64::from_le_bytes(*bytes);
        }
        let rest = &bytes[8 * WORDS..];
        let at = [u16::from_le_bytes([rest[0], rest[1]]), u16::from_le_bytes([rest[2], rest[3]])];
        let descriptor = Descriptor(words);
        Self { descriptor, at, sigma: rest[4], plain: rest[5], word: word(&descriptor) }
    }
}

/// The points of one photographed view: those on the landmark that are not plain structures, in the
/// patch of its size and in the smaller ones, as robots see it from further away. The strongest
/// first, a share of each size in turn. Empty where the corners are degenerate.
pub fn view_points(image: &GrayImage, corners_px: &Corners) -> Vec<TaughtPoint> {
    let largest = inner_px(corners_px);
    let mut sizes: Vec<Vec<TaughtPoint>> = Vec::new();
    for inner in INNER_PX.into_iter().filter(|inner| *inner <= largest) {
        let Some(patch) = Patch::new(image, corners_px, inner) else { continue };
        let is_new = |p: &TaughtPoint| !sizes.iter().flatten().any(|known| is_duplicate(known, p));
        let coarsest = COARSEST_PX / inner as f32;
        let is_fine = |p: &TaughtPoint| sizes.is_empty() || p.point().sigma < coarsest;
        let found = points_of(patch).into_iter().filter(is_new).filter(is_fine).collect();
        sizes.push(found);
    }
    let mut rest: Vec<_> = sizes.iter().map(|points| points.iter().copied()).collect();
    let mut points = Vec::new();
    while rest.iter().any(|points| points.len() > 0) {
        for (size, share) in rest.iter_mut().zip(SHARES) {
            points.extend(size.by_ref().take(share));
        }
    }
    points
}

/// The points of one patch that are taught, strongest first.
fn points_of(patch: Patch) -> Vec<TaughtPoint> {
    let inside = |p: &&Point| p.at.iter().all(|a| (0.0..=1.0).contains(a));
    let of = |p: &Point| TaughtPoint::new(p, distance_to_plain(&p.descriptor));
    let seen = SeenPatch::new(patch, MAX_VIEW_POINTS);
    seen.points.iter().filter(inside).map(of).filter(|p| p.plain() >= MIN_PLAIN_DISTANCE).collect()
}

/// The points of a landmark from those of its photographed views: of up to [`MAX_POINT_VIEWS`]
/// views, evenly chosen, each without duplicates of the earlier ones. At most
/// [`MAX_LANDMARK_POINTS`].
pub fn landmark_points(views: &[Vec<TaughtPoint>]) -> Vec<TaughtPoint> {
    let chosen = views.len().min(MAX_POINT_VIEWS);
    let mut points: Vec<TaughtPoint> = Vec::new();
    for i in 0..chosen {
        let view = &views[i * views.len() / chosen];
        let room = (MAX_LANDMARK_POINTS - points.len()) / (chosen - i);
        let known = points.len();
        let is_new = |p: &&TaughtPoint| !points[..known].iter().any(|k| is_duplicate(k, p));
        let new: Vec<TaughtPoint> = view.iter().filter(is_new).take(room).copied().collect();
        points.extend(new);
    }
    points
}

fn is_duplicate(a: &TaughtPoint, b: &TaughtPoint) -> bool {
    let (p, q) = (a.point(), b.point());
    (p.at[0] - q.at[0]).abs() < SAME_PLACE
        && (p.at[1] - q.at[1]).abs() < SAME_PLACE
        && a.sigma.abs_diff(b.sigma) < SCALE_STEPS as u8 / 2
        && a.descriptor.distance(&b.descriptor) < SAME_DISTANCE
}
