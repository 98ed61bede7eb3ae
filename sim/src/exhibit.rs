//! One picture on a plastered wall, seen by a camera under conditions that are set one by one: for experiments that
//! change a single thing and keep all others as they are (method 18). Conditions and a seed in, an image and the exact
//! corners out; the same in, the same bytes out. Where pictures hang in a building is not of interest here.

use nalgebra::{Matrix3, Point2, Vector3};
use rand::RngExt;
use serde::{Deserialize, Serialize};
use vision::{frame::GrayImage, geometry::Corners};

use crate::{
    scenes::compression::jpeg,
    seed,
    sensor::{SensorParams, expose},
    texture::{Footprint, Texture},
};

/// Width and height of the camera's image, in pixels.
pub const IMAGE_PX: [usize; 2] = [640, 480];
/// Its focal length, in pixels.
const FOCAL_PX: f64 = 600.0;
/// Steepest view that is drawn: beyond, the picture is a line.
pub const MAX_ANGLE_RAD: f64 = 1.53;
/// Smallest and largest apparent size.
pub const SIZES_PX: [f64; 2] = [8.0, 440.0];
/// What white paper sends back in good light, as a share of the sensor's range.
const WHITE: f64 = 0.9;
/// The wall's plaster repeats after as many sides of the picture.
const PLASTER_SIDES: f64 = 2.8;
/// Width of a shadow's edge, in sides of the picture.
const PENUMBRA: f64 = 0.03;
/// Samples along a pixel's side where the picture's border or a cover's edge crosses it.
const EDGE_SAMPLES: usize = 3;

/// A shadow whose edge crosses the picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Shadow {
    /// Share of the light that it takes, 0 to 1.
    pub depth: f64,
    /// Direction into the shadow, from the picture's right towards its bottom.
    pub direction_rad: f64,
    /// How far its edge is from the picture's centre along that direction, in sides of the picture.
    pub offset: f64,
}

/// How the picture is seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Conditions {
    /// Angle between the picture's normal and the line of sight in the horizontal plane, at most [`MAX_ANGLE_RAD`]
    /// either way.
    pub yaw_rad: f64,
    /// The same in the vertical plane.
    pub pitch_rad: f64,
    /// Roll of the camera.
    pub roll_rad: f64,
    /// Square root of the area that the picture would have seen from the front at the same distance, in pixels.
    pub size_px: f64,
    /// The picture's centre from the image's, in pixels.
    pub aim_px: [f64; 2],
    /// Share of the light that is lost from the bright side of the picture to the other, 0 to 1.
    pub side_light: f64,
    /// Direction in which it gets darker, from the picture's right towards its bottom.
    pub side_light_rad: f64,
    /// A shadow on wall and picture.
    pub shadow: Option<Shadow>,
    /// Share of the picture's area that something stands before, a plain rectangle in its middle, 0 to 1.
    pub cover: f64,
    /// Its brightness, 0 to 255.
    pub cover_grey: f64,
    /// Exposure, lens, noise.
    pub sensor: SensorParams,
    /// Quality of the JPEG that the image was sent as, 1 to 100; `None`: not compressed.
    pub jpeg: Option<u8>,
    /// How bright the wall is, as a share of its plaster's own brightness.
    pub wall: f64,
}

impl Default for Conditions {
    fn default() -> Self {
        Self {
            yaw_rad: 0.0,
            pitch_rad: 0.0,
            roll_rad: 0.0,
            size_px: 160.0,
            aim_px: [0.0; 2],
            side_light: 0.0,
            side_light_rad: 0.0,
            shadow: None,
            cover: 0.0,
            cover_grey: 128.0,
            sensor: SensorParams::ideal(),
            jpeg: None,
            wall: 1.0,
        }
    }
}

impl Conditions {
    /// What a robot's camera makes of any view: a little off the level, a little blur, noise and compression, light
    /// not quite that of the lesson. Every draw is another.
    pub fn realistic(draw: u64) -> Self {
        let mut rng = seed::stream(draw, 0x6578_6869);
        let mut within = |low: f64, high: f64| rng.random_range(low..=high);
        let sensor = SensorParams {
            exposure: within(-0.22, 0.22).exp(),
            offset: within(-8.0, 8.0),
            blur_sigma_px: within(0.3, 0.9),
            motion_px: [within(-1.0, 1.0), within(-0.4, 0.4)],
            read_noise: within(0.8, 3.0),
            shot_noise: 0.012,
            vignetting: 0.0,
        };
        Self {
            yaw_rad: within(-0.5, 0.5),
            pitch_rad: within(-0.15, 0.15),
            roll_rad: within(-0.05, 0.05),
            size_px: within(90f64.ln(), 220f64.ln()).exp(),
            aim_px: [within(-40.0, 40.0), within(-25.0, 25.0)],
            side_light: within(0.0, 0.25),
            side_light_rad: within(0.0, std::f64::consts::TAU),
            cover_grey: within(20.0, 220.0),
            jpeg: (within(0.0, 1.0) < 0.6).then(|| within(70.0, 95.0) as u8),
            wall: within(0.45, 1.1),
            sensor,
            ..Self::default()
        }
    }
}

/// How much of the camera's image is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// All of it.
    Whole,
    /// The picture with a third of its larger side around it: enough to recognise it by its corners, and quicker.
    Around,
}

/// What the camera sees.
#[derive(Debug, Clone, PartialEq)]
pub struct Exhibit {
    /// The image.
    pub image: GrayImage,
    /// Where the picture is in it, exactly.
    pub corners: Corners,
}

/// The picture on the wall (a texture that repeats, such as [`crate::surfaces::plaster`]) under `conditions`; noise
/// follows from `draw`. `None` where the picture does not lie within the camera's image, or is no quad there.
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

/// Where a picture of area 1 is seen.
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

/// Everything that sends light to the camera.
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
        // How far an edge is in units of the pixel's reach: the picture's border, and the cover's.
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

    /// Light from one place of the plane.
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
mod tests {
    use super::*;
    use crate::{posters::poster, surfaces::plaster, texture::Edge};

    fn paper() -> Texture {
        Texture::new(64, 64, vec![200; 64 * 64], Edge::Clamp)
    }

    fn mean(seen: &Exhibit, x: f64, y: f64) -> f64 {
        let [a, b, c, d] = *seen.corners.points();
        let at = a.coords * (1.0 - x) * (1.0 - y)
            + b.coords * x * (1.0 - y)
            + c.coords * x * y
            + d.coords * (1.0 - x) * y;
        f64::from(seen.image.sample(at.x, at.y))
    }

    fn see(conditions: &Conditions) -> Exhibit {
        exhibit(&paper(), &plaster(1), conditions, Extent::Whole, 1).unwrap()
    }

    #[test]
    fn corners_are_where_geometry_puts_them() {
        let seen = see(&Conditions { size_px: 100.0, ..Conditions::default() });
        let expected = [[269.5, 189.5], [369.5, 189.5], [369.5, 289.5], [269.5, 289.5]];
        for (found, expected) in seen.corners.points().iter().zip(expected) {
            assert!((found - Point2::from(expected)).norm() < 1e-9, "{found} {expected:?}");
        }
        // Turned by 60 degrees it is half as wide, and its height grows on the near side.
        let seen = see(&Conditions { size_px: 100.0, yaw_rad: 60f64.to_radians(), ..Conditions::default() });
        let [a, b, c, d] = seen.corners.points();
        assert!(((b - a).x - 50.0).abs() < 1.0, "{}", (b - a).x);
        assert!((d - a).norm() > 105.0 && (c - b).norm() < 95.0);
        assert!((mean(&seen, 0.5, 0.5) - 180.0).abs() <= 1.0);
    }

    #[test]
    fn cover_light_and_shadow_are_where_they_are_asked_for() {
        let plain = Conditions { size_px: 200.0, ..Conditions::default() };
        let covered = see(&Conditions { cover: 0.25, cover_grey: 40.0, ..plain.clone() });
        assert!(
            (mean(&covered, 0.5, 0.5) - 36.0).abs() <= 1.0 && (mean(&covered, 0.27, 0.5) - 36.0).abs() <= 1.0
        );
        assert!((mean(&covered, 0.2, 0.5) - 180.0).abs() <= 1.0);
        let dark = (0..200 * 200).filter(|i| {
            let (u, v) = (220 + i % 200, 140 + i / 200);
            covered.image.at(u, v) < 100
        });
        assert!((dark.count() as f64 / 40_000.0 - 0.25).abs() < 0.01);
        let side = see(&Conditions { side_light: 0.5, ..plain.clone() });
        assert!(
            (mean(&side, 0.1, 0.5) - 0.95 * 180.0).abs() < 2.0
                && (mean(&side, 0.9, 0.5) - 0.55 * 180.0).abs() < 2.0
        );
        let shadow = Shadow { depth: 0.6, direction_rad: 0.0, offset: 0.1 };
        let shadow = see(&Conditions { shadow: Some(shadow), ..plain });
        assert!(
            (mean(&shadow, 0.5, 0.5) - 180.0).abs() <= 1.0 && (mean(&shadow, 0.7, 0.5) - 72.0).abs() <= 1.0
        );
    }

    #[test]
    fn the_cut_is_the_whole_around_the_picture() {
        let conditions = Conditions { aim_px: [30.3, -20.7], yaw_rad: 0.4, ..Conditions::default() };
        let poster = poster(3);
        let whole = exhibit(&poster, &plaster(1), &conditions, Extent::Whole, 5).unwrap();
        let cut = exhibit(&poster, &plaster(1), &conditions, Extent::Around, 5).unwrap();
        let shift = whole.corners.points()[0] - cut.corners.points()[0];
        for (u, v) in [(20, 20), (90, 100), (60, 140)] {
            let (a, b) = (
                cut.image.at(u, v),
                whole.image.at(u + shift.x.round() as usize, v + shift.y.round() as usize),
            );
            assert!(a.abs_diff(b) <= 1, "{a} {b}");
        }
    }

    #[test]
    fn the_draw_decides_and_what_leaves_the_image_is_none() {
        let poster = poster(1);
        let see =
            |draw| exhibit(&poster, &plaster(1), &Conditions::realistic(4), Extent::Around, draw).unwrap();
        assert_eq!(see(1), see(1));
        assert_ne!(see(1), see(2));
        assert_ne!(Conditions::realistic(1), Conditions::realistic(2));
        let away = Conditions { aim_px: [400.0, 0.0], ..Conditions::default() };
        assert!(exhibit(&poster, &plaster(1), &away, Extent::Whole, 1).is_none());
        let broken = Conditions {
            yaw_rad: f64::NAN,
            size_px: f64::INFINITY,
            aim_px: [f64::NAN, 0.0],
            ..Conditions::default()
        };
        assert!(exhibit(&poster, &plaster(1), &broken, Extent::Whole, 1).is_none());
    }
}
