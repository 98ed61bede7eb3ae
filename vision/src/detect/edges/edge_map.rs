//! Grey image in, edge map out (method 1.1, 1.2): gradient, non-maximum suppression, hysteresis,
//! thinning.
//!
//! The map keeps the gradient planes: later stages search along a proposed side for edges too weak
//! for the mask. No chaining here. Filter and suppression run on the widest vectors the processor
//! has; results do not depend on it.

use crate::{
    detect::edges::{
        deriche::{FilterMemory, gradients},
        edge_thinning::{EDGE, changing_ring_code, keep, thin},
        maxima::{Maxima, Maximum},
        strongest_plane::{ColourMemory, colour_gradients},
    },
    frame::PictureRef,
};
use fearless_simd::{Level, dispatch};
use nalgebra::{Point2, Vector2};

/// Most edge points of one map; when there are more candidates, the strongest are kept.
pub const MAX_EDGE_POINTS: usize = 1 << 20;
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
    /// Neither threshold lies below these multiples of the gradient's noise (low, high); 0 ignores
    /// the noise.
    pub noise_factors: [f32; 2],
}

impl Default for EdgeParams {
    fn default() -> Self {
        // Thresholds that rise with the noise are for noisy cameras: a picture that fills the image
        // with texture looks like noise, so they stay off. Factors of 2.5 and 6 leave almost no
        // edge pixel to noise.
        Self { alpha: 1.0, low: 6.0, high: 15.0, noise_factors: [0.0, 0.0] }
    }
}

/// Mark of a pixel that becomes an edge pixel if it is connected to one.
const WEAK: u8 = 2;

/// Edge pixels with the gradient of the whole image. Planes are row-major, `width * height` long.
/// The working memory stays with the map, for [`edges_into`].
#[derive(Debug, Clone, Default)]
pub struct EdgeMap {
    width: usize,
    height: usize,
    gx: Vec<f32>,
    gy: Vec<f32>,
    marks: Vec<u8>,
    pixels: Vec<u32>,
    filter: FilterMemory,
    colour_filter: ColourMemory,
    maxima: Maxima,
    stack: Vec<u32>,
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

    /// Length of (gx, gy) in pixel `at` (row-major index).
    #[inline]
    pub fn magnitude(&self, at: usize) -> f32 {
        length(self.gx[at], self.gy[at])
    }

    /// One byte a pixel: [`EDGE`] or 0.
    pub(crate) fn marks(&self) -> &[u8] {
        &self.marks
    }

    /// Row-major indices of the edge pixels, ascending, thinned to lines one pixel wide. At most
    /// [`MAX_EDGE_POINTS`], none within `BORDER_PX` of the border.
    pub fn pixels(&self) -> &[u32] {
        &self.pixels
    }

    /// Gradient at pixel (u, v).
    pub fn gradient(&self, u: usize, v: usize) -> Vector2<f32> {
        let at = v * self.width + u;
        Vector2::new(self.gx[at], self.gy[at])
    }

    /// Sub-pixel position of the edge through edge pixel `at` (row-major index, off the border):
    /// the vertex of a parabola along the gradient, at most half a step away.
    ///
    /// Departs from method 1.2, where the parabola goes through the magnitudes m: here it goes
    /// through `1 / sqrt(m)`. The filter answers a step by `(1 + a |x|) exp(-a |x|)`, which is more
    /// pointed than a parabola: that pulled positions to the middle of the pixel, by up to 0.05 px,
    /// and by the same amount everywhere along a diagonal side.
    pub fn position_px(&self, at: usize) -> Point2<f64> {
        let (behind, ahead, step) = self.along_gradient(at);
        // Roots, and numerator and denominator times all three.
        let (a, b, c) = (behind.sqrt(), self.magnitude(at).sqrt(), ahead.sqrt());
        let curvature = b * (a + c) - 2.0 * a * c;
        let centre = Point2::new((at % self.width) as f64, (at / self.width) as f64);
        if curvature > 0.0 {
            let shift = (0.5 * b * (c - a) / curvature).clamp(-0.5, 0.5);
            centre + (step * shift).cast::<f64>()
        } else {
            centre
        }
    }

    /// The same map without the edge pixels that `gone` names.
    #[cfg(test)]
    pub(crate) fn without(mut self, gone: impl Fn(usize, usize) -> bool) -> Self {
        self.pixels.retain(|&at| !gone(at as usize % self.width, at as usize / self.width));
        self.marks.fill(0);
        self.pixels.iter().for_each(|&at| self.marks[at as usize] = EDGE);
        self
    }

    /// Magnitudes one step against and along the gradient, interpolated between neighbours, and
    /// that step.
    fn along_gradient(&self, at: usize) -> (f32, f32, Vector2<f32>) {
        let (gx, gy) = (self.gx[at], self.gy[at]);
        let (ax, ay) = (gx.abs(), gy.abs());
        let (straight, diagonal) = neighbours(gx, gy, self.width);
        let t = if ax > ay { ay / ax } else { ax / ay };
        let between = |near: f32, far: f32| near + t * (far - near);
        let m = |offset: isize| self.magnitude(at.wrapping_add_signed(offset));
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

/// Length of a vector.
#[inline]
fn length(x: f32, y: f32) -> f32 {
    (x * x + y * y).sqrt()
}

/// The edges of a picture: Canny's criteria on Deriche's recursive gradient.
pub fn edges<'a>(image: impl Into<PictureRef<'a>>, p: &EdgeParams) -> EdgeMap {
    let mut map = EdgeMap::default();
    edges_into(image, p, &mut map);
    map
}

/// [`edges`], in the memory of an earlier map of any picture: about a third faster when it had the
/// same size.
pub fn edges_into<'a>(image: impl Into<PictureRef<'a>>, p: &EdgeParams, map: &mut EdgeMap) {
    map.fill(Level::new(), image.into(), p, MAX_EDGE_POINTS);
}

impl EdgeMap {
    fn fill(&mut self, level: Level, image: PictureRef, p: &EdgeParams, max_points: usize) {
        let (width, height) = (image.width(), image.height());
        (self.width, self.height) = (width, height);
        let (gx, gy) = (&mut self.gx, &mut self.gy);
        gx.resize(width * height, 0.0);
        gy.resize(width * height, 0.0);
        self.maxima.restart(width, height, p.low.max(f32::MIN_POSITIVE));
        let (memory, maxima) = (&mut self.filter, &mut self.maxima);
        match image.colour() {
            None => dispatch!(level, s => gradients(s, image.grey(), p.alpha, memory, [gx, gy], maxima)),
            Some(planes) => {
                let memory = &mut self.colour_filter;
                dispatch!(level, s => colour_gradients(s, planes, p.alpha, memory, [gx, gy], maxima));
            }
        }
        let mut found = std::mem::take(&mut self.maxima.found);
        let mut high = p.high;
        if p.noise_factors.iter().any(|f| *f > 0.0) {
            let noise = self.noise();
            found.retain(|m| m.magnitude >= p.noise_factors[0] * noise);
            high = high.max(p.noise_factors[1] * noise);
        }
        keep_strongest(&mut found, max_points);
        self.hysteresis(&found, high);
        self.maxima.found = found;
        let (gx, gy) = (&self.gx, &self.gy);
        // Squares: only which is greater matters.
        let strength = |at: usize| gx[at] * gx[at] + gy[at] * gy[at];
        thin(&mut self.marks, width, strength, &mut self.pixels, &mut self.stack);
    }

    /// Standard deviation of each gradient component in the smoothest parts of the image: the
    /// magnitude of noise alone has a Rayleigh distribution, whose lower quartile stands 0.7585
    /// sigma high.
    fn noise(&self) -> f32 {
        // A prime stride meets every column.
        let mut sample: Vec<f32> =
            (0..self.gx.len()).step_by(NOISE_STRIDE).map(|at| self.magnitude(at)).collect();
        let quarter = sample.len() / 4;
        let (_, quartile, _) = sample.select_nth_unstable_by(quarter, f32::total_cmp);
        *quartile / 0.7585
    }

    /// Marks and lists the candidates that are 8-connected to one of at least `high`.
    fn hysteresis(&mut self, candidates: &[Maximum], high: f32) {
        let Self { marks, pixels, stack, width, .. } = self;
        let width = *width;
        marks.clear();
        marks.resize(self.gx.len(), 0);
        pixels.clear();
        stack.clear();
        for m in candidates {
            marks[m.at as usize] = if m.magnitude >= high { EDGE } else { WEAK };
            pixels.push(m.at);
        }
        for m in candidates {
            let seed = m.at as usize;
            if marks[seed] == WEAK && changing_ring_code(marks, width, seed) != 0 {
                marks[seed] = EDGE;
                stack.push(m.at);
            }
            while let Some(at) = stack.pop() {
                // Candidates keep off the border, so every neighbour exists.
                let at = at as usize;
                for row in [at - width - 1, at - 1, at + width - 1] {
                    for (i, mark) in marks[row..row + 3].iter_mut().enumerate() {
                        if *mark == WEAK {
                            *mark = EDGE;
                            stack.push((row + i) as u32);
                        }
                    }
                }
            }
        }
        keep(pixels, |at| {
            marks[at] &= EDGE;
            marks[at] == EDGE
        });
    }
}

/// Keeps the `max` strongest, ties to the lower index, in ascending order.
fn keep_strongest(found: &mut Vec<Maximum>, max: usize) {
    if found.len() <= max {
        return;
    }
    if max > 0 {
        found.select_nth_unstable_by(max - 1, |a, b| {
            b.magnitude.total_cmp(&a.magnitude).then(a.at.cmp(&b.at))
        });
    }
    found.truncate(max);
    found.sort_unstable_by_key(|m| m.at);
}

#[cfg(test)]
#[path = "edge_map_tests.rs"]
mod tests;

#[cfg(test)]
#[path = "edge_map_accuracy_tests.rs"]
mod accuracy_tests;
