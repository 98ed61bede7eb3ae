//! A landmark's face lifted off one photograph, to be seen again from elsewhere.
//!
//! In: a photograph and the landmark's corners in it. Out: a square texture with some surroundings and two coarser
//! levels, and small pictures of it under a new homography, filtered to their scale. No light, lens or noise here:
//! see [`super::synthesis`].

use super::gates::quad_from_unit;
use crate::{detect::quads::Corners, frame::GrayImage};
use nalgebra::{Matrix3, Point2, Vector3};

/// Texels along the landmark's side at the finest level: more than the largest generated view shows.
const SIDE: usize = 256;
/// Surroundings kept on each side, as a share of the landmark's side: corner noise and blur look beyond the border.
const MARGIN: f64 = 0.125;
/// Levels, each half as fine as the last.
const LEVELS: usize = 3;
/// Most samples along a texel's or a pixel's side.
const MAX_SAMPLES: usize = 4;
/// Texels that one bilinear sample may stand for.
const TEXELS_PER_SAMPLE: f64 = 1.5;

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
    /// Lifts the landmark off `photograph`. `None` if the corners make no invertible homography.
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
                    if let Some(g) = look(photograph, &photograph_from_unit, a, b) {
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

    /// The landmark seen under `view_from_unit` (unit square to pixels of the small picture), before a wall of grey
    /// `wall`. Row-major, `width * height`.
    pub(crate) fn seen(
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
        let h = unit_from_view;
        let mut picture = vec![0.0f32; size[0] * size[1]];
        for (du, dv) in grid(n) {
            for (v, line) in picture.chunks_exact_mut(size[0]).enumerate() {
                let (u, v) = (du - 0.5, v as f64 + dv - 0.5);
                let start = h * Vector3::new(u, v, 1.0);
                for (i, grey) in line.iter_mut().enumerate() {
                    let i = i as f64;
                    let scale = 1.0 / (start.z + i * h[(2, 0)]);
                    let (a, b) = ((start.x + i * h[(0, 0)]) * scale, (start.y + i * h[(1, 0)]) * scale);
                    let [lit, cover] = level.sample(a, b);
                    *grey += lit + (1.0 - cover) * wall;
                }
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

    /// Bilinear [grey, coverage] at landmark coordinates; nothing beyond the margin.
    fn sample(&self, a: f64, b: f64) -> [f32; 2] {
        let extent = 1.0 + 2.0 * MARGIN;
        let column = (a + MARGIN) / extent * self.side as f64 - 0.5;
        let row = (b + MARGIN) / extent * self.side as f64 - 0.5;
        let last = (self.side - 1) as f64;
        if !(column >= 0.0 && column <= last && row >= 0.0 && row <= last) {
            return [0.0, 0.0];
        }
        let (u, v) = ((column as usize).min(self.side - 2), (row as usize).min(self.side - 2));
        let (x, y) = ((column - u as f64) as f32, (row - v as f64) as f32);
        let i = v * self.side + u;
        let [p, q, r, s] = [i, i + 1, i + self.side, i + self.side + 1].map(|i| self.texels[i]);
        [0, 1].map(|k| (p[k] * (1.0 - x) + q[k] * x) * (1.0 - y) + (r[k] * (1.0 - x) + s[k] * x) * y)
    }
}

/// Grey of the photograph at landmark coordinates, `None` outside it or behind the camera.
fn look(photograph: &GrayImage, photograph_from_unit: &Matrix3<f64>, a: f64, b: f64) -> Option<f32> {
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

    /// Oracle: the waves at the place that exact geometry gives.
    #[test]
    fn a_slanted_landmark_is_seen_from_elsewhere() {
        let photograph = GrayImage::from_fn(500, 400, |u, v| waves(u as f64, v as f64).round() as u8);
        let from = corners([[60.0, 50.0], [430.0, 80.0], [410.0, 350.0], [80.0, 330.0]]);
        let texture = Texture::lift(&photograph, &from).unwrap();
        let to = corners([[12.0, 10.0], [130.0, 25.0], [125.0, 120.0], [15.0, 145.0]]);
        let view_from_unit = quad_from_unit(to.points());
        let picture = texture.seen(&view_from_unit, [150, 160], 90.0).unwrap();
        let photograph_from_view = quad_from_unit(from.points()) * view_from_unit.try_inverse().unwrap();
        for (u, v) in [(40, 40), (70, 80), (110, 100), (20, 100), (120, 40)] {
            let p = at(&photograph_from_view, f64::from(u), f64::from(v));
            let found = f64::from(picture[v as usize * 150 + u as usize]);
            assert!((found - waves(p.x, p.y)).abs() < 2.0, "({u}, {v}): {found}, {}", waves(p.x, p.y));
        }
    }

    #[test]
    fn beyond_the_photograph_stands_the_wall() {
        let photograph = GrayImage::from_fn(200, 200, |_, _| 200);
        let whole = corners([[-0.5, -0.5], [199.5, -0.5], [199.5, 199.5], [-0.5, 199.5]]);
        let texture = Texture::lift(&photograph, &whole).unwrap();
        let to = corners([[19.5, 19.5], [119.5, 19.5], [119.5, 119.5], [19.5, 119.5]]);
        let picture = texture.seen(&quad_from_unit(to.points()), [140, 140], 70.0).unwrap();
        let at = |u: usize, v: usize| picture[v * 140 + u];
        assert!((at(10, 70) - 70.0).abs() < 0.5 && (at(70, 130) - 70.0).abs() < 0.5);
        assert!((at(70, 70) - 200.0).abs() < 0.5);
    }

    #[test]
    fn fine_stripes_average_out_at_a_distance() {
        let photograph = GrayImage::from_fn(512, 512, |u, _| if u % 4 < 2 { 40 } else { 200 });
        let whole = corners([[-0.5, -0.5], [511.5, -0.5], [511.5, 511.5], [-0.5, 511.5]]);
        let texture = Texture::lift(&photograph, &whole).unwrap();
        let to = corners([[5.0, 5.0], [37.0, 5.0], [37.0, 37.0], [5.0, 37.0]]);
        let picture = texture.seen(&quad_from_unit(to.points()), [42, 42], 0.0).unwrap();
        for u in 10..32 {
            assert!((picture[20 * 42 + u] - 120.0).abs() < 8.0, "column {u}: {}", picture[20 * 42 + u]);
        }
    }
}
