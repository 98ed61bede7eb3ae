//! Grey image in, edge map out (method 1.1, 1.2): gradient, non-maximum suppression, hysteresis, thinning.
//!
//! The map keeps the gradient planes: later stages look along a hypothesised side for edges too weak for the mask.
//! No chaining here.

use super::{deriche::gradients, thinning::thin};
use crate::frame::GrayImage;
use nalgebra::{Point2, Vector2};

/// Rim of the image in which no edge is reported: the filter sees a continued border there, not the world.
pub const BORDER_PX: usize = 2;
/// Most edge points of one map; when there are more candidates, the strongest are kept.
pub const MAX_EDGE_POINTS: usize = 1 << 20;
/// Relative difference below which two neighbouring magnitudes are a tie, won by the darker pixel.
const TIE: f32 = 1e-4;
/// One pixel in so many takes part in the estimate of noise.
const NOISE_STRIDE: usize = 37;

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EdgeParams {
    /// Sharpness of the Deriche filter per pixel: 0.5 smooths more, 2 localises better.
    pub alpha: f32,
    /// Grey levels of step height that continue an edge, in an image without noise.
    pub low: f32,
    /// Grey levels of step height that start an edge, in an image without noise.
    pub high: f32,
    /// Neither threshold lies below these multiples of the gradient's noise (low, high); 0 ignores the noise.
    pub noise_factors: [f32; 2],
}

impl Default for EdgeParams {
    fn default() -> Self {
        // Thresholds that rise with the noise are for noisy cameras: a picture that fills the image with texture looks
        // like noise, so they stay off. Factors of 2.5 and 6 leave almost no edge pixel to noise.
        Self { alpha: 1.0, low: 6.0, high: 15.0, noise_factors: [0.0, 0.0] }
    }
}

/// Edge pixels with the gradient of the whole image. Planes are row-major, `width * height` long.
#[derive(Debug, Clone, Default)]
pub struct EdgeMap {
    width: usize,
    height: usize,
    gx: Vec<f32>,
    gy: Vec<f32>,
    magnitude: Vec<f32>,
    mask: Vec<bool>,
    pixels: Vec<u32>,
}

impl EdgeMap {
    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Derivative along u, in grey levels of step height (a sharp step of 100 levels peaks at 100).
    pub fn gx(&self) -> &[f32] {
        &self.gx
    }

    /// Derivative along v, likewise. (gx, gy) points to the brighter side.
    pub fn gy(&self) -> &[f32] {
        &self.gy
    }

    /// Length of (gx, gy).
    pub fn magnitude(&self) -> &[f32] {
        &self.magnitude
    }

    /// Edge pixels, thinned to lines one pixel wide.
    pub fn mask(&self) -> &[bool] {
        &self.mask
    }

    /// Row-major indices of the edge pixels, ascending. At most [`MAX_EDGE_POINTS`], none within [`BORDER_PX`].
    pub fn pixels(&self) -> &[u32] {
        &self.pixels
    }

    /// Gradient at pixel (u, v).
    pub fn gradient(&self, u: usize, v: usize) -> Vector2<f32> {
        let at = v * self.width + u;
        Vector2::new(self.gx[at], self.gy[at])
    }

    /// Bilinear gradient at `p_px`, coordinates clamped to the image.
    pub fn gradient_at(&self, p_px: &Point2<f64>) -> Vector2<f64> {
        if self.mask.is_empty() {
            return Vector2::zeros();
        }
        let u = p_px.x.clamp(0.0, (self.width - 1) as f64);
        let v = p_px.y.clamp(0.0, (self.height - 1) as f64);
        let (u0, v0) = (u as usize, v as usize);
        let (u1, v1) = ((u0 + 1).min(self.width - 1), (v0 + 1).min(self.height - 1));
        let (a, b) = (u - u0 as f64, v - v0 as f64);
        let g = |u, v| self.gradient(u, v).cast::<f64>();
        (g(u0, v0) * (1.0 - a) + g(u1, v0) * a) * (1.0 - b) + (g(u0, v1) * (1.0 - a) + g(u1, v1) * a) * b
    }

    /// Sub-pixel position of the edge through edge pixel `at` (row-major index, off the border): the vertex of a
    /// parabola through the magnitudes along the gradient, at most half a step away.
    pub fn position_px(&self, at: usize) -> Point2<f64> {
        let (behind, ahead, step) = self.along_gradient(at);
        let curvature = behind - 2.0 * self.magnitude[at] + ahead;
        let centre = Point2::new((at % self.width) as f64, (at / self.width) as f64);
        if curvature < 0.0 {
            let shift = (0.5 * (behind - ahead) / curvature).clamp(-0.5, 0.5);
            centre + (step * shift).cast::<f64>()
        } else {
            centre
        }
    }

    /// The same map without the edge pixels that `gone` names.
    #[cfg(test)]
    pub(crate) fn without(mut self, gone: impl Fn(usize, usize) -> bool) -> Self {
        self.pixels.retain(|&at| !gone(at as usize % self.width, at as usize / self.width));
        self.mask.fill(false);
        self.pixels.iter().for_each(|&at| self.mask[at as usize] = true);
        self
    }

    /// Magnitudes one step against and along the gradient, interpolated between neighbours, and that step.
    fn along_gradient(&self, at: usize) -> (f32, f32, Vector2<f32>) {
        let (gx, gy) = (self.gx[at], self.gy[at]);
        let (ax, ay) = (gx.abs(), gy.abs());
        let (straight, diagonal) = neighbours(gx, gy, self.width);
        let t = if ax > ay { ay / ax } else { ax / ay };
        let between = |near: f32, far: f32| near + t * (far - near);
        let m = |offset: isize| self.magnitude[at.wrapping_add_signed(offset)];
        let step = if ax > ay { Vector2::new(gx / ax, gy / ax) } else { Vector2::new(gx / ay, gy / ay) };
        (between(m(-straight), m(-diagonal)), between(m(straight), m(diagonal)), step)
    }
}

/// Index offsets of the two neighbours between which the gradient leaves the pixel.
#[inline]
fn neighbours(gx: f32, gy: f32, width: usize) -> (isize, isize) {
    let du: isize = if gx < 0.0 { -1 } else { 1 };
    let dv = if gy < 0.0 { -(width as isize) } else { width as isize };
    (if gx.abs() > gy.abs() { du } else { dv }, du + dv)
}

/// The edges of an image: Canny's criteria on Deriche's recursive gradient.
pub fn edges(image: &GrayImage, p: &EdgeParams) -> EdgeMap {
    edges_within(image, p, MAX_EDGE_POINTS)
}

fn edges_within(image: &GrayImage, p: &EdgeParams, max_points: usize) -> EdgeMap {
    let (gx, gy) = gradients(image, p.alpha);
    let magnitude: Vec<f32> = gx.iter().zip(&gy).map(|(x, y)| (x * x + y * y).sqrt()).collect();
    let (width, height) = (image.width(), image.height());
    let mut map = EdgeMap { width, height, gx, gy, magnitude, mask: vec![], pixels: vec![] };
    let noise = map.noise();
    let (low, high) = (p.low.max(p.noise_factors[0] * noise), p.high.max(p.noise_factors[1] * noise));
    let mut maxima = map.maxima(low.max(f32::MIN_POSITIVE));
    keep_strongest(&mut maxima, &map.magnitude, max_points);
    map.mask = hysteresis(&maxima, &map.magnitude, width, high);
    maxima.retain(|&at| map.mask[at as usize]);
    thin(&mut map.mask, width, &map.magnitude, &mut maxima);
    map.pixels = maxima;
    map
}

impl EdgeMap {
    /// Standard deviation of each gradient component in the smoothest parts of the image: the magnitude of noise alone
    /// has a Rayleigh distribution, whose lower quartile stands 0.7585 sigma high.
    fn noise(&self) -> f32 {
        // A prime stride meets every column.
        let mut sample: Vec<f32> = self.magnitude.iter().copied().step_by(NOISE_STRIDE).collect();
        let quarter = sample.len() / 4;
        let (_, quartile, _) = sample.select_nth_unstable_by(quarter, f32::total_cmp);
        *quartile / 0.7585
    }

    /// Pixels of at least `low` whose magnitude no neighbour along the gradient exceeds; row-major, off the border.
    fn maxima(&self, low: f32) -> Vec<u32> {
        let mut found = Vec::new();
        let inner = self.width.saturating_sub(2 * BORDER_PX);
        for v in BORDER_PX..self.height.saturating_sub(BORDER_PX) {
            let start = v * self.width + BORDER_PX;
            for (at, &magnitude) in (start..).zip(&self.magnitude[start..start + inner]) {
                if magnitude >= low && self.is_maximum(at) {
                    found.push(at as u32);
                }
            }
        }
        found
    }

    #[inline]
    fn is_maximum(&self, at: usize) -> bool {
        let (gx, gy) = (self.gx[at], self.gy[at]);
        let (straight, diagonal) = neighbours(gx, gy, self.width);
        let (major, minor) = if gx.abs() > gy.abs() { (gx.abs(), gy.abs()) } else { (gy.abs(), gx.abs()) };
        // Both sides times `major`: no division for the many pixels that fail.
        let centre = self.magnitude[at] * major;
        let m = |offset: isize| self.magnitude[at.wrapping_add_signed(offset)];
        let behind = m(-straight) * (major - minor) + m(-diagonal) * minor;
        let ahead = m(straight) * (major - minor) + m(diagonal) * minor;
        // A step between two pixels gives two equal maxima; rounding must not let both or neither win.
        centre * (1.0 - TIE) > behind && centre >= ahead * (1.0 - TIE)
    }
}

/// Keeps the `max` strongest of `pixels`, ties to the lower index, in ascending order.
fn keep_strongest(pixels: &mut Vec<u32>, magnitude: &[f32], max: usize) {
    if pixels.len() <= max {
        return;
    }
    let strength = |at: &u32| magnitude[*at as usize];
    if max > 0 {
        pixels.select_nth_unstable_by(max - 1, |a, b| strength(b).total_cmp(&strength(a)).then(a.cmp(b)));
    }
    pixels.truncate(max);
    pixels.sort_unstable();
}

/// Mask of the candidates that hang together, over all eight neighbours, with one of at least `high`.
fn hysteresis(candidates: &[u32], magnitude: &[f32], width: usize, high: f32) -> Vec<bool> {
    let mut weak = vec![false; magnitude.len()];
    for &at in candidates {
        weak[at as usize] = true;
    }
    let mut mask = vec![false; magnitude.len()];
    let mut stack = Vec::new();
    for &seed in candidates {
        if magnitude[seed as usize] >= high && weak[seed as usize] {
            weak[seed as usize] = false;
            stack.push(seed as usize);
        }
        while let Some(at) = stack.pop() {
            mask[at] = true;
            // Candidates keep off the border, so every neighbour exists.
            for row in [at - width - 1, at - 1, at + width - 1] {
                for (i, free) in weak[row..row + 3].iter_mut().enumerate() {
                    if std::mem::replace(free, false) {
                        stack.push(row + i);
                    }
                }
            }
        }
    }
    mask
}

#[cfg(test)]
#[path = "edges_tests.rs"]
mod tests;
