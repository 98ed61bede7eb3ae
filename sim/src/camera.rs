//! A simulated camera: intrinsics and image size, with a table of the undistorted pinhole's pixel
//! for each pixel, and tiles of pixels for quick rejection.

use std::ops::Range;

use nalgebra::{Matrix3, Point2};
use vision::frame::{Distortion, Intrinsics, MAX_SIDE_PX};

/// Side of a tile in pixels.
pub(crate) const TILE_PX: usize = 16;

/// Bounds of a tile in undistorted pixels, half a pixel beyond its outermost pixel centres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tile {
    pub(crate) centre: [f32; 2],
    pub(crate) half: [f32; 2],
}

/// A calibrated camera of a given size.
#[derive(Debug, Clone)]
pub struct Camera {
    intrinsics: Intrinsics,
    width_px: usize,
    height_px: usize,
    /// Undistorted pixel of each pixel; empty for a pinhole, where it is the pixel itself.
    table: Vec<[f32; 2]>,
    tiles: Vec<Tile>,
}

impl Camera {
    /// Width and height are clamped to 16 to 8192 px.
    pub fn new(intrinsics: Intrinsics, width_px: usize, height_px: usize) -> Self {
        let (width_px, height_px) = (width_px.clamp(16, MAX_SIDE_PX), height_px.clamp(16, MAX_SIDE_PX));
        let table = match intrinsics.distortion {
            Distortion::None => vec![],
            _ => (0..width_px * height_px)
                .map(|i| {
                    let px = Point2::new((i % width_px) as f64, (i / width_px) as f64);
                    // At the edge of a fisheye a pinhole has no such ray; use the pixel itself.
                    let straight = intrinsics.undistort(&px).unwrap_or(px);
                    [straight.x as f32, straight.y as f32]
                })
                .collect(),
        };
        let mut camera = Self { intrinsics, width_px, height_px, table, tiles: vec![] };
        let count = width_px.div_ceil(TILE_PX) * height_px.div_ceil(TILE_PX);
        camera.tiles = (0..count).map(|tile| camera.bounds(tile)).collect();
        camera
    }

    /// A typical robot camera: 640 x 480 px, 64 degrees wide, no distortion.
    pub fn vga() -> Self {
        let intrinsics = Intrinsics {
            fx_px: 512.0,
            fy_px: 512.0,
            cx_px: 319.5,
            cy_px: 239.5,
            distortion: Distortion::None,
            sigmas: None,
        };
        Self::new(intrinsics, 640, 480)
    }

    /// Focal lengths, principal point and distortion.
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// Width of the image, px.
    pub fn width_px(&self) -> usize {
        self.width_px
    }

    /// Height of the image, px.
    pub fn height_px(&self) -> usize {
        self.height_px
    }

    pub(crate) fn k_inverse(&self) -> Matrix3<f64> {
        let k = &self.intrinsics;
        let (fx, fy) = (1.0 / k.fx_px, 1.0 / k.fy_px);
        Matrix3::new(fx, 0.0, -k.cx_px * fx, 0.0, fy, -k.cy_px * fy, 0.0, 0.0, 1.0)
    }

    /// Pixel at which a pinhole with the same K has the ray of this camera's pixel.
    #[inline]
    pub(crate) fn undistorted(&self, pixel: usize) -> [f32; 2] {
        match self.table.get(pixel) {
            Some(px) => *px,
            None => [(pixel % self.width_px) as f32, (pixel / self.width_px) as f32],
        }
    }

    /// d(undistorted pixel)/d(pixel): rows u and v, columns by u and v.
    #[inline]
    pub(crate) fn jacobian(&self, pixel: usize) -> [[f32; 2]; 2] {
        if self.table.is_empty() {
            return [[1.0, 0.0], [0.0, 1.0]];
        }
        let (u, v) = (pixel % self.width_px, pixel / self.width_px);
        let difference = |low: usize, high: usize, steps: usize| {
            let (a, b) = (self.table[low], self.table[high]);
            [(b[0] - a[0]) / steps as f32, (b[1] - a[1]) / steps as f32]
        };
        let (left, right) = (usize::from(u > 0), usize::from(u + 1 < self.width_px));
        let (up, down) = (usize::from(v > 0), usize::from(v + 1 < self.height_px));
        let by_u = difference(pixel - left, pixel + right, left + right);
        let by_v = difference(pixel - up * self.width_px, pixel + down * self.width_px, up + down);
        [[by_u[0], by_v[0]], [by_u[1], by_v[1]]]
    }

    pub(crate) fn tiles(&self) -> &[Tile] {
        &self.tiles
    }

    /// Columns and rows of a tile.
    pub(crate) fn tile_pixels(&self, tile: usize) -> (Range<usize>, Range<usize>) {
        let across = self.width_px.div_ceil(TILE_PX);
        let (u, v) = (tile % across * TILE_PX, tile / across * TILE_PX);
        (u..(u + TILE_PX).min(self.width_px), v..(v + TILE_PX).min(self.height_px))
    }

    fn bounds(&self, tile: usize) -> Tile {
        let (columns, rows) = self.tile_pixels(tile);
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        for pixel in rows.flat_map(|v| columns.clone().map(move |u| v * self.width_px + u)) {
            let (px, j) = (self.undistorted(pixel), self.jacobian(pixel));
            for i in 0..2 {
                let reach = 0.5 * (j[i][0].abs() + j[i][1].abs());
                low[i] = low[i].min(px[i] - reach);
                high[i] = high[i].max(px[i] + reach);
            }
        }
        let half = [0, 1].map(|i| 0.5 * (high[i] - low[i]) + 1e-3);
        Tile { centre: [0, 1].map(|i| 0.5 * (low[i] + high[i])), half }
    }
}
