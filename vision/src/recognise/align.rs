//! A quad and a learnt icon in, the quad's corners moved so that its picture lies on the icon out. Evidence for the
//! decision (a true match fits far better afterwards, a false one hardly does) and sharper corners for the pose.
//! Beyond the method (its sections 4 and 6.3 name it as an option). It decides nothing itself.

use super::{
    correlation::{Buckets, CorrelationParams, dot},
    harris::blurred,
};
use crate::{
    detect::quads::Corners,
    frame::GrayImage,
    geometry::homography::Homography,
    icon::{Icon, IconParams, rectify},
};
use nalgebra::{Point2, SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// Most Gauss-Newton steps at one smoothing, whatever the parameters say.
pub const MAX_STEPS: usize = 50;

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AlignParams {
    /// No corner moves further than this share of the icon's side.
    pub max_shift: f64,
    /// Both pictures are smoothed by these, one after the other, in icon pixels.
    pub sigmas: [f64; 2],
    /// Gauss-Newton steps at each smoothing, at most [`MAX_STEPS`].
    pub steps: usize,
}

impl Default for AlignParams {
    fn default() -> Self {
        Self { max_shift: 0.12, sigmas: [2.5, 1.0], steps: 8 }
    }
}

type Vector8 = SVector<f64, 8>;
type Matrix8 = SMatrix<f64, 8, 8>;

/// The surroundings of a quad, rectified once, in which corners may move.
#[derive(Debug, Clone)]
pub struct Surroundings {
    image_from_icon: Homography,
    margin: usize,
    size: usize,
    pixels: Vec<f32>,
}

impl Surroundings {
    /// Rectifies `corners_px` with a margin around. `None` when the quad is too close to the horizon.
    pub fn new(image: &GrayImage, corners_px: &Corners, icon: &IconParams, p: &AlignParams) -> Option<Self> {
        let image_from_icon = Homography::square_to_quad(icon.size, corners_px).ok()?;
        let margin = (p.max_shift.clamp(0.0, 0.5) * icon.size as f64).ceil() as usize + 1;
        let (low, high) = (-0.5 - margin as f64, icon.size as f64 - 0.5 + margin as f64);
        let wide = [[low, low], [high, low], [high, high], [low, high]].map(Point2::from);
        if wide.iter().any(|c| image_from_icon.denominator(c) <= 0.0) {
            return None;
        }
        let wide = Corners::new(wide.map(|c| image_from_icon.apply(&c))).ok()?;
        let size = icon.size + 2 * margin;
        let picture = rectify(image, &wide, &IconParams { size, max_outside: 1.0, ..icon.clone() }).ok()?;
        Some(Self { image_from_icon, margin, size, pixels: picture.pixels })
    }

    /// Moves the corners until the picture lies on `template`. `None` when a corner would have to move too far or
    /// the picture says nothing about where it lies.
    pub fn align(&self, template: &Icon, c: &CorrelationParams, p: &AlignParams) -> Option<Corners> {
        let size = template.size;
        if size + 2 * self.margin != self.size {
            return None;
        }
        let mut shift = Vector8::zeros();
        for sigma in p.sigmas {
            let smooth = Icon {
                size,
                pixels: blurred(&template.pixels, size, sigma),
                source_scale: template.source_scale,
            };
            let goal = Target::new(&smooth, c);
            for _ in 0..p.steps.min(MAX_STEPS) {
                let mut warped = self.warp(size, &shift)?;
                // Smoothed after cutting, as the template is: the wall around must not bleed in.
                warped.pixels = blurred(&warped.pixels, size, sigma);
                let step = goal.step(&warped, c)?;
                shift += step;
                if shift.amax() > p.max_shift * size as f64 {
                    return None;
                }
                if step.amax() < 0.02 {
                    break;
                }
            }
        }
        let moved = moved_square(size, &shift);
        if moved.iter().any(|m| self.image_from_icon.denominator(m) <= 0.0) {
            return None;
        }
        Corners::new(moved.map(|m| self.image_from_icon.apply(&m))).ok()
    }

    /// The picture inside the moved square.
    fn warp(&self, size: usize, shift: &Vector8) -> Option<Icon> {
        let moved = moved_square(size, shift);
        let map = Homography::from_points(&moved_square(size, &Vector8::zeros()), &moved).ok()?;
        let (h, level) = (map.matrix(), &self.pixels);
        let (offset, last) = (self.margin as f64, (self.size - 1) as f64 - 1e-6);
        let mut pixels = Vec::with_capacity(size * size);
        for b in 0..size {
            let y = b as f64;
            for a in 0..size {
                let x = a as f64;
                let scale = 1.0 / (h[(2, 0)] * x + h[(2, 1)] * y + h[(2, 2)]);
                let u = ((h[(0, 0)] * x + h[(0, 1)] * y + h[(0, 2)]) * scale + offset).clamp(0.0, last);
                let v = ((h[(1, 0)] * x + h[(1, 1)] * y + h[(1, 2)]) * scale + offset).clamp(0.0, last);
                let (column, row) = (u as usize, v as usize);
                let (du, dv) = ((u - column as f64) as f32, (v - row as f64) as f32);
                let i = row * self.size + column;
                let top = level[i] + du * (level[i + 1] - level[i]);
                let bottom = level[i + self.size] + du * (level[i + self.size + 1] - level[i + self.size]);
                pixels.push(top + dv * (bottom - top));
            }
        }
        Some(Icon { size, pixels, source_scale: 1.0 })
    }
}

/// Corners of the icon's square, each moved by two numbers of `shift`.
fn moved_square(size: usize, shift: &Vector8) -> [Point2<f64>; 4] {
    let (low, high) = (-0.5, size as f64 - 0.5);
    let square = [[low, low], [high, low], [high, high], [low, high]];
    std::array::from_fn(|i| Point2::new(square[i][0] + shift[2 * i], square[i][1] + shift[2 * i + 1]))
}

/// What the warped picture shall look like, bucket by bucket, each normalised.
struct Target {
    size: usize,
    buckets: Buckets,
}

impl Target {
    fn new(template: &Icon, c: &CorrelationParams) -> Self {
        Self { size: template.size, buckets: Buckets::new(template, c) }
    }

    /// The Gauss-Newton step of the corners that brings `warped` nearer: least squares over normalised buckets, each
    /// weighted by how well it correlates already, so that covered parts have no say.
    fn step(&self, warped: &Icon, c: &CorrelationParams) -> Option<Vector8> {
        let (size, per_side) = (self.size, c.per_side());
        let buckets = Buckets::new(warped, c);
        let edge = |i: usize| i * size / per_side;
        let (mut normal, mut right) = (Matrix8::zeros(), Vector8::zeros());
        let stride = buckets.stride();
        let pairs = buckets.values().chunks_exact(stride).zip(self.buckets.values().chunks_exact(stride));
        for (i, (ours, theirs)) in pairs.enumerate() {
            let weight = f64::from(dot(ours, theirs).max(0.0)).powi(2);
            if weight < 1e-3 {
                continue;
            }
            let rows = edge(i / per_side)..edge(i / per_side + 1);
            let columns = edge(i % per_side)..edge(i % per_side + 1);
            let (a, b) = bucket_equations(warped, rows, columns, ours, theirs);
            normal += a * weight;
            right += b * weight;
        }
        // A little damping keeps corners still that nothing ties down.
        let damping = 1e-3 * normal.trace() / 8.0;
        if damping <= 0.0 || !damping.is_finite() {
            return None;
        }
        for i in 0..8 {
            normal[(i, i)] += damping;
        }
        normal.cholesky().map(|factor| factor.solve(&right)).filter(|step| step.iter().all(|s| s.is_finite()))
    }
}

/// Normal equations of one bucket: `ours` (warped, normalised) is to become `theirs`.
fn bucket_equations(
    warped: &Icon,
    rows: std::ops::Range<usize>,
    columns: std::ops::Range<usize>,
    ours: &[f32],
    theirs: &[f32],
) -> (Matrix8, Vector8) {
    let size = warped.size;
    let at = |x: usize, y: usize| f64::from(warped.pixels[y * size + x]);
    let mut jacobian: Vec<[f64; 8]> = Vec::with_capacity(ours.len());
    let (mut mean, mut square, mut grey_mean) = ([0.0; 8], 0.0, 0.0);
    for y in rows.clone() {
        let (up, down) = (y.saturating_sub(1), (y + 1).min(size - 1));
        for x in columns.clone() {
            let (left, right) = (x.saturating_sub(1), (x + 1).min(size - 1));
            let gx = (at(right, y) - at(left, y)) / (right - left) as f64;
            let gy = (at(x, down) - at(x, up)) / (down - up) as f64;
            // A point moves with the corners by its bilinear weights: exact for affine moves, near enough for others.
            let (s, t) = ((x as f64 + 0.5) / size as f64, (y as f64 + 0.5) / size as f64);
            let weights = [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t];
            let line = std::array::from_fn(|i| weights[i / 2] * if i % 2 == 0 { gx } else { gy });
            for (m, l) in mean.iter_mut().zip(&line) {
                *m += l;
            }
            grey_mean += at(x, y);
            square += at(x, y) * at(x, y);
            jacobian.push(line);
        }
    }
    let n = jacobian.len() as f64;
    let norm = (square - grey_mean * grey_mean / n).max(1e-9).sqrt();
    let (mut normal, mut right) = (Matrix8::zeros(), Vector8::zeros());
    let mut along = [0.0; 8];
    for (line, o) in jacobian.iter_mut().zip(ours) {
        for i in 0..8 {
            line[i] = (line[i] - mean[i] / n) / norm;
            along[i] += line[i] * f64::from(*o);
        }
    }
    for ((line, o), t) in jacobian.iter().zip(ours).zip(theirs) {
        let row = Vector8::from_fn(|i, _| line[i] - along[i] * f64::from(*o));
        normal += row * row.transpose();
        right += row * f64::from(t - o);
    }
    (normal, right)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        icon::icon,
        recognise::fixture::{oblique, photograph, poster},
    };

    fn setting() -> (IconParams, CorrelationParams, AlignParams) {
        (IconParams::default(), CorrelationParams::default(), AlignParams::default())
    }

    #[test]
    fn displaced_corners_come_back() {
        let (ip, c, p) = setting();
        let template = icon(&photograph(&poster(1), &oblique(), 1.0, 0.0), &oblique(), &ip).unwrap();
        let image = photograph(&poster(1), &oblique(), 0.7, 40.0);
        // Up to 8 px of 200: 3 icon pixels of 75.
        for offset in
            [[6.0, -5.0, 8.0, 4.0, -6.0, 7.0, 3.0, -8.0], [-8.0, -8.0, 8.0, -8.0, 8.0, 8.0, -8.0, 8.0]]
        {
            let mut i = 0;
            let wrong = oblique().points().map(|q| {
                i += 2;
                Point2::new(q.x + offset[i - 2], q.y + offset[i - 1])
            });
            let around = Surroundings::new(&image, &Corners::new(wrong).unwrap(), &ip, &p).unwrap();
            let found = around.align(&template, &c, &p).unwrap();
            for (a, b) in found.points().iter().zip(oblique().points()) {
                // An icon pixel is 2.7 px here.
                assert!((a - b).norm() < 0.7, "{offset:?}: {a} for {b}");
            }
        }
    }

    #[test]
    fn a_covered_part_has_no_say() {
        let (ip, c, p) = setting();
        let template = icon(&photograph(&poster(2), &oblique(), 1.0, 0.0), &oblique(), &ip).unwrap();
        let image = photograph(&poster(2), &oblique(), 1.0, 0.0);
        let covered = GrayImage::from_fn(400, 400, |u, v| {
            if (120..250).contains(&u) && (160..240).contains(&v) {
                if (u / 7) % 2 == 0 { 255 } else { 0 }
            } else {
                image.at(u, v)
            }
        });
        let wrong = Corners::new(oblique().points().map(|q| Point2::new(q.x + 4.0, q.y - 3.0))).unwrap();
        let found = Surroundings::new(&covered, &wrong, &ip, &p).unwrap().align(&template, &c, &p).unwrap();
        for (a, b) in found.points().iter().zip(oblique().points()) {
            assert!((a - b).norm() < 0.8, "{a} for {b}");
        }
    }

    #[test]
    fn corners_never_move_further_than_allowed() {
        let (ip, c, p) = setting();
        let image = photograph(&poster(1), &oblique(), 1.0, 0.0);
        for seed in 2..10 {
            let template = icon(&photograph(&poster(seed), &oblique(), 1.0, 0.0), &oblique(), &ip).unwrap();
            let around = Surroundings::new(&image, &oblique(), &ip, &p).unwrap();
            if let Some(moved) = around.align(&template, &c, &p) {
                for (a, b) in moved.points().iter().zip(oblique().points()) {
                    // 12 % of a side of at most 252 px, both coordinates.
                    assert!((a - b).norm() < 0.12 * 252.0 * 1.42 * 1.2);
                }
            }
        }
        let flat = GrayImage::from_fn(400, 400, |_, _| 99);
        let around = Surroundings::new(&flat, &oblique(), &ip, &p).unwrap();
        let template = icon(&image, &oblique(), &ip).unwrap();
        assert!(around.align(&template, &c, &p).is_none());
    }
}
