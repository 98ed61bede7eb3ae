//! The texture of a landmark from one photograph, for rendering other views.
//!
//! In: a photograph and the landmark's corners in it. Out: a square texture with some surroundings
//! and two coarser levels, and small pictures of it under a homography, filtered to their scale.
//! [`crate::learn::synthesis`] adds light and noise.

use crate::{
    frame::GrayImage,
    geometry::{corners::Corners, interpolate::cell},
    learn::gates::quad_from_unit,
};
use nalgebra::{Matrix3, Point2, Vector3};

/// Texels along the landmark's side at the finest level: more than the largest generated view
/// shows.
const SIDE: usize = 256;
/// Surroundings kept on each side, as a share of the landmark's side: corner noise and blur reach
/// beyond the border.
const MARGIN: f64 = 0.125;
/// Levels, each half as fine as the last.
const LEVELS: usize = 3;
/// Most samples along a texel's or a pixel's side.
const MAX_SAMPLES: usize = 4;
/// Texels that one bilinear sample may stand for.
const TEXELS_PER_SAMPLE: f64 = 1.5;
/// Pixels computed at a time, vectorised.
const ABREAST: usize = 16;
/// How far before the last texel samples end, in texels.
const LAST: f32 = 1e-3;

/// Grey levels and coverage of the landmark's plane, over the unit square and its margin.
#[derive(Debug, Clone)]
pub(crate) struct Texture {
    levels: Vec<Level>,
}

/// One level: grey premultiplied by coverage, and coverage (0 where the photograph ends).
#[derive(Debug, Clone)]
struct Level {
    side: usize,
    texels: Vec<[f32; 2]>,
}

impl Texture {
    /// Rectifies the landmark from `photograph`. `None` if the corners make no invertible
    /// homography.
    pub(crate) fn lift(photograph: &GrayImage, corners: &Corners) -> Option<Self> {
        let photograph_from_unit = quad_from_unit(corners.points());
        photograph_from_unit.try_inverse()?;
        let side = SIDE + 2 * (SIDE as f64 * MARGIN) as usize;
        let texel = 1.0 / SIDE as f64;
        // Source pixels along a texel, from the quad's area.
        let scale = corners.area_px2().sqrt() * texel;
        let n = (scale.ceil() as usize).clamp(1, MAX_SAMPLES);
        let mut texels = Vec::with_capacity(side * side);
        for row in 0..side {
            for column in 0..side {
                let (mut grey, mut cover) = (0.0, 0.0);
                for (da, db) in grid(n) {
                    let a = (column as f64 + da) * texel - MARGIN;
                    let b = (row as f64 + db) * texel - MARGIN;
                    if let Some(g) = sample_grey(photograph, &photograph_from_unit, a, b) {
                        grey += g;
                        cover += 1.0;
                    }
                }
                let all = (n * n) as f32;
                texels.push([grey / all, cover / all]);
            }
        }
        let mut levels = vec![Level { side, texels }];
        while levels.len() < LEVELS {
            levels.extend(levels.last().map(Level::halved));
        }
        Some(Self { levels })
    }

    /// The landmark rendered under `view_from_unit` (unit square to pixels of the small picture),
    /// before a wall of grey `wall`. Row-major, `width * height`.
    pub(crate) fn rendered(
        &self,
        view_from_unit: &Matrix3<f64>,
        size: [usize; 2],
        wall: f32,
    ) -> Option<Vec<f32>> {
        let unit_from_view = view_from_unit.try_inverse()?;
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(a, b)| at(view_from_unit, a, b));
        let mean = |i: usize, j: usize| {
            0.5 * ((corners[i] - corners[i + 1]).norm() + (corners[j] - corners[(j + 1) % 4]).norm())
        };
        let finest = SIDE as f64 / mean(0, 2).max(1.0);
        let finest = finest.max(SIDE as f64 / mean(1, 3).max(1.0));
        let n = ((finest / TEXELS_PER_SAMPLE).ceil() as usize).clamp(1, MAX_SAMPLES);
        let level = &self.levels[((finest / n as f64).log2().round().max(0.0) as usize).min(LEVELS - 1)];
        let texel_from_view = level.texel_from_unit() * unit_from_view;
        let mut picture = vec![0.0f32; size[0] * size[1]];
        for (du, dv) in grid(n) {
            for (v, line) in picture.chunks_exact_mut(size[0]).enumerate() {
                let start = Vector3::new(du - 0.5, v as f64 + dv - 0.5, 1.0);
                fearless_simd::dispatch!(fearless_simd::Level::new(), _s => {
                    level.add_row(&texel_from_view, &start, wall, line);
                });
            }
        }
        let share = 1.0 / (n * n) as f32;
        for grey in &mut picture {
            *grey *= share;
        }
        Some(picture)
    }
}

impl Level {
    /// Means of 2 x 2 texels.
    fn halved(&self) -> Self {
        let side = self.side / 2;
        let at = |u: usize, v: usize, k: usize| self.texels[v * self.side + u][k];
        let texels = (0..side * side)
            .map(|i| {
                let (u, v) = (2 * (i % side), 2 * (i / side));
                [0, 1].map(|k| 0.25 * (at(u, v, k) + at(u + 1, v, k) + at(u, v + 1, k) + at(u + 1, v + 1, k)))
            })
            .collect();
        Self { side, texels }
    }

    /// Texel coordinates of a point of the unit square.
    fn texel_from_unit(&self) -> Matrix3<f64> {
        let scale = self.side as f64 / (1.0 + 2.0 * MARGIN);
        let shift = MARGIN * scale - 0.5;
        Matrix3::new(scale, 0.0, shift, 0.0, scale, shift, 0.0, 0.0, 1.0)
    }

    /// Adds a row of pixels beginning at `start`, one to the right each: grey levels bilinearly,
    /// and the wall where nothing covers it; only wall beyond the margin.
    #[expect(
        clippy::inline_always,
        reason = "an instruction set holds only in what is inlined where it was chosen"
    )]
    #[inline(always)]
    fn add_row(&self, texel_from_view: &Matrix3<f64>, start: &Vector3<f64>, wall: f32, line: &mut [f32]) {
        let (from, step) = (texel_from_view * start, texel_from_view.column(0));
        let last = (self.side - 1) as f32;
        for (first, line) in (0..).step_by(ABREAST).zip(line.chunks_mut(ABREAST)) {
            let (mut at, mut inside) = ([0_u32; ABREAST], [0.0_f32; ABREAST]);
            let (mut x, mut y) = ([0.0_f32; ABREAST], [0.0_f32; ABREAST]);
            for k in 0..ABREAST {
                let i = f64::from(first) + k as f64;
                let scale = 1.0 / (from.z + i * step.z);
                let (u, v) = (((from.x + i * step.x) * scale) as f32, ((from.y + i * step.y) * scale) as f32);
                inside[k] = if u >= 0.0 && u <= last && v >= 0.0 && v <= last { 1.0 } else { 0.0 };
                // The last texel is the second of its cell.
                let (u, v) = (u.max(0.0).min(last - LAST), v.max(0.0).min(last - LAST));
                let ((column, left), (row, above)) = (cell(u), cell(v));
                (at[k], x[k], y[k]) = (row * self.side as u32 + column, u - left, v - above);
            }
            for (k, grey) in line.iter_mut().enumerate() {
                let four = &self.texels[at[k] as usize..][..self.side + 2];
                let [p, q, r, s] = [four[0], four[1], four[self.side], four[self.side + 1]];
                let [lit, cover] = [0, 1].map(|c| {
                    let (top, bottom) = (p[c] + (q[c] - p[c]) * x[k], r[c] + (s[c] - r[c]) * x[k]);
                    inside[k] * (top + (bottom - top) * y[k])
                });
                *grey += lit + (1.0 - cover) * wall;
            }
        }
    }
}

/// Grey of the photograph at landmark coordinates, `None` outside it or behind the camera.
fn sample_grey(photograph: &GrayImage, photograph_from_unit: &Matrix3<f64>, a: f64, b: f64) -> Option<f32> {
    let p = photograph_from_unit * Vector3::new(a, b, 1.0);
    let (u, v) = (p.x / p.z, p.y / p.z);
    let inside =
        u > -0.5 && v > -0.5 && u < photograph.width() as f64 - 0.5 && v < photograph.height() as f64 - 0.5;
    (p.z > 0.0 && inside).then(|| photograph.sample(u, v))
}

fn at(h: &Matrix3<f64>, x: f64, y: f64) -> Point2<f64> {
    let p = h * Vector3::new(x, y, 1.0);
    Point2::new(p.x / p.z, p.y / p.z)
}

/// Centres of an n x n grid over the unit square.
fn grid(n: usize) -> impl Iterator<Item = (f64, f64)> {
    let step = 1.0 / n as f64;
    (0..n * n).map(move |i| (((i % n) as f64 + 0.5) * step, ((i / n) as f64 + 0.5) * step))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners(c: [[f64; 2]; 4]) -> Corners {
        Corners::try_from(c).unwrap()
    }

    fn waves(u: f64, v: f64) -> f64 {
        128.0 + 60.0 * (u * 0.05).sin() + 50.0 * (v * 0.04 + 1.0).cos()
    }

    /// Oracle: the waves at the exactly projected point.
    #[test]
    fn another_view_equals_the_exact_projection() {
        let photograph = GrayImage::from_fn(500, 400, |u, v| waves(u as f64, v as f64).round() as u8);
        let from = corners([[60.0, 50.0], [430.0, 80.0], [410.0, 350.0], [80.0, 330.0]]);
        let texture = Texture::lift(&photograph, &from).unwrap();
        let to = corners([[12.0, 10.0], [130.0, 25.0], [125.0, 120.0], [15.0, 145.0]]);
        let view_from_unit = quad_from_unit(to.points());
        let picture = texture.rendered(&view_from_unit, [150, 160], 90.0).unwrap();
        let photograph_from_view = quad_from_unit(from.points()) * view_from_unit.try_inverse().unwrap();
        for (u, v) in [(40, 40), (70, 80), (110, 100), (20, 100), (120, 40)] {
            let p = at(&photograph_from_view, f64::from(u), f64::from(v));
            let found = f64::from(picture[v as usize * 150 + u as usize]);
            assert!((found - waves(p.x, p.y)).abs() < 2.0, "({u}, {v}): {found}, {}", waves(p.x, p.y));
        }
    }

    #[test]
    fn the_wall_fills_pixels_outside_the_photograph() {
        let photograph = GrayImage::from_fn(200, 200, |_, _| 200);
        let whole = corners([[-0.5, -0.5], [199.5, -0.5], [199.5, 199.5], [-0.5, 199.5]]);
        let texture = Texture::lift(&photograph, &whole).unwrap();
        let to = corners([[19.5, 19.5], [119.5, 19.5], [119.5, 119.5], [19.5, 119.5]]);
        let picture = texture.rendered(&quad_from_unit(to.points()), [140, 140], 70.0).unwrap();
        let at = |u: usize, v: usize| picture[v * 140 + u];
        assert!((at(10, 70) - 70.0).abs() < 0.5 && (at(70, 130) - 70.0).abs() < 0.5);
        assert!((at(70, 70) - 200.0).abs() < 0.5);
    }

    #[test]
    fn fine_stripes_are_averaged_at_a_distance() {
        let photograph = GrayImage::from_fn(512, 512, |u, _| if u % 4 < 2 { 40 } else { 200 });
        let whole = corners([[-0.5, -0.5], [511.5, -0.5], [511.5, 511.5], [-0.5, 511.5]]);
        let texture = Texture::lift(&photograph, &whole).unwrap();
        let to = corners([[5.0, 5.0], [37.0, 5.0], [37.0, 37.0], [5.0, 37.0]]);
        let picture = texture.rendered(&quad_from_unit(to.points()), [42, 42], 0.0).unwrap();
        for u in 10..32 {
            assert!((picture[20 * 42 + u] - 120.0).abs() < 8.0, "column {u}: {}", picture[20 * 42 + u]);
        }
    }
}
