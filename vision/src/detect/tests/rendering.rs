//! Test images with known truth: area-sampled convex polygons, noise from a seed, and the
//! symmetries of an image.

use crate::frame::GrayImage;
use nalgebra::Point2;

/// Sub-samples along each axis of a pixel.
const SUB: usize = 8;

/// A convex polygon of level `inside` on `outside`, corners in either turn, averaged over each
/// pixel's area, with Gaussian noise of `sigma` from `seed`.
pub(crate) fn polygon(
    (width, height): (usize, usize),
    corners: &[Point2<f64>],
    (inside, outside): (f64, f64),
    sigma: f64,
    seed: u64,
) -> GrayImage {
    let mut noise = Noise(seed);
    GrayImage::from_fn(width, height, |u, v| {
        let offset = |i: usize| (i as f64 + 0.5) / SUB as f64 - 0.5;
        let covered = (0..SUB * SUB)
            .filter(|i| {
                contains(corners, &Point2::new(u as f64 + offset(i % SUB), v as f64 + offset(i / SUB)))
            })
            .count() as f64
            / (SUB * SUB) as f64;
        (outside + (inside - outside) * covered + sigma * noise.gaussian()).round().clamp(0.0, 255.0) as u8
    })
}

fn contains(corners: &[Point2<f64>], p: &Point2<f64>) -> bool {
    let n = corners.len();
    let side = |i: usize| (corners[(i + 1) % n] - corners[i]).perp(&(p - corners[i]));
    (0..n).all(|i| side(i) >= 0.0) || (0..n).all(|i| side(i) <= 0.0)
}

/// A rectangle turned by `angle` about its centre.
pub(crate) fn rectangle(centre: (f64, f64), size: (f64, f64), angle: f64) -> [Point2<f64>; 4] {
    let (sin, cos) = angle.sin_cos();
    [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(|(a, b)| {
        let (x, y) = (a * size.0, b * size.1);
        Point2::new(centre.0 + cos * x - sin * y, centre.1 + sin * x + cos * y)
    })
}

/// Mirrored left to right.
pub(crate) fn flipped(image: &GrayImage) -> GrayImage {
    let w = image.width();
    GrayImage::from_fn(w, image.height(), |u, v| image.at(w - 1 - u, v))
}

/// Turned a quarter clockwise on screen: pixel (u, v) goes to (height - 1 - v, u).
pub(crate) fn quarter_turned(image: &GrayImage) -> GrayImage {
    let h = image.height();
    GrayImage::from_fn(h, image.width(), |u, v| image.at(v, h - 1 - u))
}

/// Sixty-four-bit congruential noise: the same on every machine.
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    /// Uniform in [0, 1).
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Standard normal, as the sum of twelve uniforms.
    pub(crate) fn gaussian(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}
