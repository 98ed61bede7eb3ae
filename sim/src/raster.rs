//! Rasterisation: the surfaces visible in each pixel and their shares. A depth buffer for pixels
//! inside one surface, 64 samples for those on an edge; edges are accurate to about a hundredth of
//! a pixel. `render` shades.

use nalgebra::{Matrix3, Vector3};

use crate::building::Surface;
use crate::camera::{Camera, TILE_PX};

/// No surface here.
pub(crate) const NOTHING: u16 = u16::MAX;
/// End of a pixel's list of fragments.
const END: u32 = u32::MAX;
/// Samples per pixel on an edge; a Hammersley set, so that each row and each column of the pixel
/// has 64 steps.
pub(crate) const SAMPLES: usize = 64;

/// A surface in one camera's view: linear functions of the undistorted pixel (u, v, 1).
#[derive(Debug, Clone)]
pub(crate) struct View {
    /// Index of the surface.
    pub(crate) index: u16,
    /// Numerators of the relative position s (right) and t (down), 0 to 1 over the surface, and the
    /// denominator, which is the inverse depth in 1/m.
    pub(crate) s: [f32; 3],
    pub(crate) t: [f32; 3],
    pub(crate) w: [f32; 3],
    /// Signed distances from the four sides in pixels, positive inside.
    sides: [[f32; 3]; 4],
}

impl View {
    /// `None` when the camera is behind the surface or in its plane.
    fn new(
        index: u16,
        surface: &Surface,
        camera_from_map: &nalgebra::Isometry3<f64>,
        k_inverse: &Matrix3<f64>,
    ) -> Option<Self> {
        let surface_from_camera = (camera_from_map * surface.map_from_surface).inverse();
        let r = surface_from_camera.rotation.to_rotation_matrix();
        let c = surface_from_camera.translation.vector;
        if c.x <= 1e-9 {
            return None;
        }
        // A ray d meets the plane x = 0 at depth -c.x / (r0 . d).
        let row = |i: usize| r.matrix().row(i).transpose();
        let w: Vector3<f64> = -row(0) / c.x;
        let s = (row(1) + w * (c.y + 0.5 * surface.width_m)) / surface.width_m;
        let t = (-row(2) + w * (0.5 * surface.height_m - c.z)) / surface.height_m;
        let to_pixels = |f: Vector3<f64>| k_inverse.transpose() * f;
        let (s, t, w) = (to_pixels(s), to_pixels(t), to_pixels(w));
        let side = |f: Vector3<f64>| {
            let slope = f.xy().norm();
            narrow(&(f / if slope > 1e-12 { slope } else { 1.0 }))
        };
        let sides = [side(s), side(w - s), side(t), side(w - t)];
        Some(Self { index, s: narrow(&s), t: narrow(&t), w: narrow(&w), sides })
    }
}

fn narrow(f: &Vector3<f64>) -> [f32; 3] {
    [f.x as f32, f.y as f32, f.z as f32]
}

/// Value of a linear function at an undistorted pixel.
#[inline]
pub(crate) fn at(f: &[f32; 3], [u, v]: [f32; 2]) -> f32 {
    f[0] * u + f[1] * v + f[2]
}

#[derive(Debug, Clone, Copy)]
struct Fragment {
    view: u16,
    next: u32,
    mask: u64,
}

/// Buffers of one camera, reused for every frame.
#[derive(Debug, Clone)]
pub(crate) struct Raster {
    depth: Vec<f32>,
    owner: Vec<u16>,
    first: Vec<u32>,
    fragments: Vec<Fragment>,
    offsets: [[f32; 2]; SAMPLES],
    pub(crate) views: Vec<View>,
    /// Pixels that each view covers, hidden or not, and those where it is visible.
    pub(crate) covered_px: Vec<f64>,
    pub(crate) visible_px: Vec<f64>,
}

impl Raster {
    pub(crate) fn new(pixels: usize) -> Self {
        let offset = |i: usize| {
            let bits = (i as u32).reverse_bits() >> 26;
            [(i as f32 + 0.5) / SAMPLES as f32 - 0.5, (bits as f32 + 0.5) / SAMPLES as f32 - 0.5]
        };
        Self {
            depth: vec![0.0; pixels],
            owner: vec![NOTHING; pixels],
            first: vec![END; pixels],
            fragments: vec![],
            offsets: std::array::from_fn(offset),
            views: vec![],
            covered_px: vec![],
            visible_px: vec![],
        }
    }

    /// Finds the views in every pixel.
    pub(crate) fn draw(
        &mut self,
        surfaces: &[Surface],
        camera: &Camera,
        map_from_camera: &nalgebra::Isometry3<f64>,
    ) {
        self.depth.fill(0.0);
        self.owner.fill(NOTHING);
        self.first.fill(END);
        self.fragments.clear();
        let camera_from_map = map_from_camera.inverse();
        let k_inverse = camera.k_inverse();
        self.views = surfaces
            .iter()
            .enumerate()
            .filter_map(|(i, s)| View::new(i as u16, s, &camera_from_map, &k_inverse))
            .collect();
        self.covered_px = vec![0.0; self.views.len()];
        self.visible_px = vec![0.0; self.views.len()];
        let views = std::mem::take(&mut self.views);
        for (number, view) in views.iter().enumerate() {
            for (tile, bounds) in camera.tiles().iter().enumerate() {
                let reach = |side: &[f32; 3]| side[0].abs() * bounds.half[0] + side[1].abs() * bounds.half[1];
                if view.sides.iter().any(|side| at(side, bounds.centre) < -reach(side)) {
                    continue;
                }
                let inside = view.sides.iter().all(|side| at(side, bounds.centre) > reach(side));
                self.tile(camera, tile, (number as u16, view), inside);
            }
        }
        self.views = views;
    }

    fn tile(&mut self, camera: &Camera, tile: usize, (number, view): (u16, &View), inside: bool) {
        let (columns, rows) = camera.tile_pixels(tile);
        for v in rows {
            for u in columns.clone() {
                let pixel = v * camera.width_px() + u;
                let ray = camera.undistorted(pixel);
                if !inside {
                    let jacobian = camera.jacobian(pixel);
                    match self.coverage(view, ray, &jacobian) {
                        0 => continue,
                        u64::MAX => {}
                        mask => {
                            self.covered_px[usize::from(number)] +=
                                f64::from(mask.count_ones()) / SAMPLES as f64;
                            self.fragments.push(Fragment { view: number, next: self.first[pixel], mask });
                            self.first[pixel] = (self.fragments.len() - 1) as u32;
                            continue;
                        }
                    }
                }
                self.covered_px[usize::from(number)] += 1.0;
                let depth = at(&view.w, ray);
                if depth > self.depth[pixel] {
                    self.depth[pixel] = depth;
                    self.owner[pixel] = number;
                }
            }
        }
    }

    /// Which samples of the pixel lie within the view's four sides.
    fn coverage(&self, view: &View, ray: [f32; 2], j: &[[f32; 2]; 2]) -> u64 {
        let mut mask = u64::MAX;
        for side in &view.sides {
            let here = at(side, ray);
            let du = side[0] * j[0][0] + side[1] * j[1][0];
            let dv = side[0] * j[0][1] + side[1] * j[1][1];
            let reach = 0.5 * (du.abs() + dv.abs());
            if here <= -reach {
                return 0;
            }
            if here < reach {
                let inside = |[x, y]: [f32; 2]| u64::from(here + du * x + dv * y >= 0.0);
                mask &= self.offsets.iter().enumerate().fold(0, |m, (i, o)| m | inside(*o) << i);
            }
        }
        mask
    }

    /// Calls `f(view number, share)` for every view visible in a pixel. Shares sum to 1 if the
    /// pixel is covered.
    pub(crate) fn resolve(&mut self, pixel: usize, camera: &Camera, mut f: impl FnMut(usize, f32)) {
        let owner = self.owner[pixel];
        if self.first[pixel] == END {
            if owner != NOTHING {
                self.visible_px[usize::from(owner)] += 1.0;
                f(usize::from(owner), 1.0);
            }
            return;
        }
        let (ray, j) = (camera.undistorted(pixel), camera.jacobian(pixel));
        let mut shares = Shares::default();
        for (i, [x, y]) in self.offsets.iter().enumerate() {
            let at_sample = [ray[0] + j[0][0] * x + j[0][1] * y, ray[1] + j[1][0] * x + j[1][1] * y];
            let mut best = (NOTHING, 0.0);
            let mut offer = |number: u16| {
                let depth = at(&self.views[usize::from(number)].w, at_sample);
                // Nearest first; of equals the one added last, which lies on the other.
                if depth > best.1 || (depth >= best.1 && number > best.0) {
                    best = (number, depth);
                }
            };
            if owner != NOTHING {
                offer(owner);
            }
            let mut next = self.first[pixel];
            while next != END {
                let fragment = self.fragments[next as usize];
                if fragment.mask >> i & 1 == 1 {
                    offer(fragment.view);
                }
                next = fragment.next;
            }
            if best.0 != NOTHING {
                shares.count(best.0);
            }
        }
        for (number, count) in shares.iter() {
            self.visible_px[number] += f64::from(count) / SAMPLES as f64;
            f(number, count as f32 / SAMPLES as f32);
        }
    }
}

/// Samples by view; views beyond eight in a pixel are dropped.
#[derive(Default)]
struct Shares {
    counts: [(u16, u32); 8],
    used: usize,
}

impl Shares {
    fn count(&mut self, view: u16) {
        let known = self.counts[..self.used].iter_mut().find(|c| c.0 == view);
        if let Some(entry) = known {
            entry.1 += 1;
        } else if self.used < self.counts.len() {
            self.counts[self.used] = (view, 1);
            self.used += 1;
        }
    }

    fn iter(&self) -> impl Iterator<Item = (usize, u32)> + '_ {
        self.counts[..self.used].iter().map(|c| (usize::from(c.0), c.1))
    }
}

const _: () = assert!(TILE_PX > 0 && crate::building::MAX_SURFACES < NOTHING as usize);
