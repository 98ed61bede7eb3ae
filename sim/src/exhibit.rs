//! One picture on a plastered wall, rendered under conditions that are set one by one, for
//! experiments that vary a single condition (method 18). In: conditions and a seed. Out: an image
//! and the exact corners; equal input gives equal bytes.

mod conditions;

pub use conditions::{Conditions, Shadow};

use crate::{
    scenes::compression::jpeg,
    sensor::expose,
    texture::{Footprint, Texture},
};
use nalgebra::{Matrix3, Point2, Vector3};
use vision::{frame::GrayImage, geometry::Corners};

/// Width and height of the camera's image, in pixels.
pub const IMAGE_PX: [usize; 2] = [640, 480];
/// Its focal length, in pixels.
const FOCAL_PX: f64 = 600.0;
/// Largest view angle that is drawn; beyond it the picture is a line.
pub const MAX_ANGLE_RAD: f64 = 1.53;
/// Smallest and largest apparent size.
pub const SIZES_PX: [f64; 2] = [8.0, 440.0];
/// Brightness of white paper in good light, as a share of the sensor's range.
const WHITE: f64 = 0.9;
/// The wall's plaster repeats after as many sides of the picture.
const PLASTER_SIDES: f64 = 2.8;
/// Width of a shadow's edge, in sides of the picture.
const PENUMBRA: f64 = 0.03;
/// Samples along a pixel's side where the picture's border or a cover's edge crosses it.
const EDGE_SAMPLES: usize = 3;

/// Part of the camera's image that is rendered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// The whole image.
    Whole,
    /// The picture with a third of its larger side around it: enough for recognition by given
    /// corners, and faster.
    Around,
}

/// A rendered image with its truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Exhibit {
    /// The rendered image.
    pub image: GrayImage,
    /// Exact corners of the picture in the image, px.
    pub corners: Corners,
}

/// The picture on the wall (a texture that repeats, such as [`crate::surfaces::plaster`]) under
/// `conditions`; noise follows from `draw`. `None` if the picture does not lie within the camera's
/// image, or is no quad there.
pub fn exhibit(
    picture: &Texture,
    wall: &Texture,
    conditions: &Conditions,
    extent: Extent,
    draw: u64,
) -> Option<Exhibit> {
    let corners = corners(picture, conditions)?;
    let (low, size) = frame(&corners, extent);
    let local = Corners::new(corners.points().map(|c| c - low)).ok()?;
    let mut light = Stage::new([picture, wall], conditions, &local)?.light(size);
    let mut image = expose(&mut light, size[0], &conditions.sensor, draw);
    if let Some(quality) = conditions.jpeg {
        image = jpeg(&image, quality);
    }
    Some(Exhibit { image, corners: local })
}

/// Corners (px) of a picture of area 1.
fn corners(picture: &Texture, c: &Conditions) -> Option<Corners> {
    let angle = |a: f64| if a.is_finite() { a.clamp(-MAX_ANGLE_RAD, MAX_ANGLE_RAD) } else { 0.0 };
    let aspect = picture.width() as f64 / picture.height() as f64;
    let (half_width, half_height) = (0.5 * aspect.sqrt(), 0.5 / aspect.sqrt());
    let distance =
        FOCAL_PX / if c.size_px.is_finite() { c.size_px.clamp(SIZES_PX[0], SIZES_PX[1]) } else { 1.0 };
    let (sin_yaw, cos_yaw) = angle(c.yaw_rad).sin_cos();
    let (sin_pitch, cos_pitch) = angle(c.pitch_rad).sin_cos();
    let (sin_roll, cos_roll) = angle(c.roll_rad).sin_cos();
    let [width, height] = IMAGE_PX.map(|s| s as f64);
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(a, b)| {
        let (x, y) = (a * half_width, b * half_height);
        let (x, z) = (x * cos_yaw, x * sin_yaw);
        let (y, z) = (y * cos_pitch - z * sin_pitch, y * sin_pitch + z * cos_pitch + distance);
        let (x, y) = (x * cos_roll - y * sin_roll, x * sin_roll + y * cos_roll);
        let z = z.max(0.05 * distance);
        Point2::new(
            FOCAL_PX * x / z + 0.5 * (width - 1.0) + c.aim_px[0],
            FOCAL_PX * y / z + 0.5 * (height - 1.0) + c.aim_px[1],
        )
    });
    let inside = corners.iter().all(|c| c.x > 1.0 && c.y > 1.0 && c.x < width - 2.0 && c.y < height - 2.0);
    if inside { Corners::new(corners).ok() } else { None }
}

/// Top-left pixel and size of what is rendered.
fn frame(corners: &Corners, extent: Extent) -> (nalgebra::Vector2<f64>, [usize; 2]) {
    let points = corners.points();
    let bound = |i: usize, f: fn(f64, f64) -> f64| points.iter().map(|p| p[i]).reduce(f).unwrap_or(0.0);
    let (low, high) = ([0, 1].map(|i| bound(i, f64::min)), [0, 1].map(|i| bound(i, f64::max)));
    let margin = (high[0] - low[0]).max(high[1] - low[1]) / 3.0 + 8.0;
    match extent {
        Extent::Whole => (nalgebra::Vector2::zeros(), IMAGE_PX),
        Extent::Around => {
            let from = [0, 1].map(|i| (low[i] - margin).floor().max(0.0));
            let to = [0, 1].map(|i| (high[i] + margin).ceil().min(IMAGE_PX[i] as f64));
            (from.into(), [0, 1].map(|i| ((to[i] - from[i]) as usize).max(1)))
        }
    }
}

/// Picture, wall and light sources in front of the camera.
struct Stage<'a> {
    picture: &'a Texture,
    wall: &'a Texture,
    conditions: &'a Conditions,
    unit_from_image: Matrix3<f64>,
    /// Half the side of the cover, in sides of the picture.
    half_cover: f64,
    /// Width over height.
    aspect: f64,
}

impl<'a> Stage<'a> {
    fn new([picture, wall]: [&'a Texture; 2], conditions: &'a Conditions, corners: &Corners) -> Option<Self> {
        let unit = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Point2::from);
        let map = vision::geometry::homography::Homography::from_points(corners.points(), &unit).ok()?;
        Some(Self {
            picture,
            wall,
            conditions,
            unit_from_image: *map.matrix(),
            half_cover: 0.5 * conditions.cover.clamp(0.0, 1.0).sqrt(),
            aspect: picture.width() as f64 / picture.height() as f64,
        })
    }

    /// Light of every pixel, row-major.
    fn light(&self, [width, height]: [usize; 2]) -> Vec<f32> {
        let mut light = Vec::with_capacity(width * height);
        for v in 0..height {
            for u in 0..width {
                light.push(self.pixel(u as f64, v as f64));
            }
        }
        light
    }

    fn pixel(&self, u: f64, v: f64) -> f32 {
        let here = self.unit(u, v);
        let (right, down) = (self.unit(u + 1.0, v), self.unit(u, v + 1.0));
        let [du, dv] = [right, down].map(|p| [p[0] - here[0], p[1] - here[1]]);
        let reach = [0, 1].map(|i| 0.5 * (du[i].abs() + dv[i].abs()));
        // Distances to the picture's border and to the cover's edge, in units of the pixel's
        // extent.
        let crosses = |half: f64| {
            let off = [0, 1].map(|i| ((here[i] - 0.5).abs() - half) / reach[i].max(1e-12));
            off[0].max(off[1]).abs() < 1.0
        };
        if !(crosses(0.5) || self.half_cover > 0.0 && crosses(self.half_cover)) {
            return self.at(here, du, dv);
        }
        let n = EDGE_SAMPLES;
        let step = |i: usize| (i as f64 + 0.5) / n as f64 - 0.5;
        let samples = (0..n * n).map(|i| self.at(self.unit(u + step(i % n), v + step(i / n)), du, dv));
        samples.sum::<f32>() / (n * n) as f32
    }

    /// Light from one point of the plane.
    fn at(&self, [s, t]: [f64; 2], du: [f64; 2], dv: [f64; 2]) -> f32 {
        let (x, y) = (s - 0.5, t - 0.5);
        let lit = (WHITE * self.lit(x, y)) as f32;
        let far = x.abs().max(y.abs());
        if far < self.half_cover {
            return self.conditions.cover_grey as f32 * lit;
        }
        let footprint = |scale: [f64; 2]| Footprint {
            du: [(du[0] * scale[0]) as f32, (du[1] * scale[1]) as f32],
            dv: [(dv[0] * scale[0]) as f32, (dv[1] * scale[1]) as f32],
        };
        if far <= 0.5 {
            return lit * self.picture.sample(s as f32, t as f32, &footprint([1.0; 2]));
        }
        // The plaster is square: the picture's sides are not.
        let sides = [self.aspect.sqrt() / PLASTER_SIDES, 1.0 / self.aspect.sqrt() / PLASTER_SIDES];
        let place = [s * sides[0], t * sides[1]].map(|c| c.rem_euclid(1.0) as f32);
        lit * self.conditions.wall as f32 * self.wall.sample(place[0], place[1], &footprint(sides))
    }

    /// Share of the light that falls at a place, from the picture's centre in its sides.
    fn lit(&self, x: f64, y: f64) -> f64 {
        let c = self.conditions;
        let along = |direction: f64| x * direction.cos() + y * direction.sin();
        let darker = (along(c.side_light_rad) + 0.5).clamp(-0.3, 1.3);
        let mut lit = 1.0 - c.side_light.clamp(0.0, 1.0) * darker;
        if let Some(shadow) = c.shadow {
            let inside = ((along(shadow.direction_rad) - shadow.offset) / PENUMBRA + 0.5).clamp(0.0, 1.0);
            lit *= 1.0 - shadow.depth.clamp(0.0, 1.0) * inside;
        }
        lit.max(0.0)
    }

    fn unit(&self, u: f64, v: f64) -> [f64; 2] {
        let p = self.unit_from_image * Vector3::new(u, v, 1.0);
        [p.x / p.z, p.y / p.z].map(|c| c.clamp(-1e3, 1e3))
    }
}

#[cfg(test)]
mod tests;
