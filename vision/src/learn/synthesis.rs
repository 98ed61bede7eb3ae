//! Generated views of one landmark from a single photograph.
//!
//! In: a photograph, the landmark's corners in it, a seed. Out: simulated camera views: other
//! viewpoints, sizes and light, blurred, noisy, cut out along corners as inexact as the detector's.
//! The same seed gives the same views, bit for bit.
//!
//! Not simulated: relief, reflections, the real surroundings, other illumination. Distances
//! measured on generated views are therefore smaller than real ones; a model records how many of
//! its views were generated ([`crate::model::landmark_model::LandmarkModel::generated_views`]).

use crate::{
    frame::GrayImage,
    geometry::corners::Corners,
    icon::icon,
    learn::{gates::quad_from_unit, params::SynthesisParams, texture::Texture, training_view::TrainingView},
    params::Params,
    random::Random,
};
use nalgebra::{Matrix3, Point2, Vector3};

/// Image of the generated camera, in pixels.
const CAMERA_SIZE_PX: [usize; 2] = [640, 480];
/// Focal length of the generated camera, in pixels.
const FOCAL_PX: f64 = 600.0;
/// Attempts for one view: some poses are too small for an icon or leave the image.
const MAX_DRAWS: usize = 30;
/// Pixels rendered around the landmark.
const BORDER_PX: f64 = 12.0;

/// `count` generated views of the landmark at `corners` of `photograph`; fewer where the icon stage
/// refuses a drawn view, none where the corners are unusable.
pub fn views(
    photograph: &GrayImage,
    corners: &Corners,
    count: usize,
    p: &Params,
    seed: u64,
) -> Vec<TrainingView> {
    let Some(texture) = Texture::lift(photograph, corners) else { return vec![] };
    let aspect = aspect(corners);
    let mut random = Random::new(seed);
    (0..count.min(crate::model::landmark_model::MAX_VIEWS))
        .filter_map(|_| (0..MAX_DRAWS).find_map(|_| view(&texture, aspect, p, &mut random)))
        .collect()
}

fn view(texture: &Texture, aspect: f64, p: &Params, random: &mut Random) -> Option<TrainingView> {
    let s = &p.learn.synthesis;
    let corners = corners_from(&Pose::draw(s, random), aspect)?;
    let (image, shift) = photograph(texture, &corners, s, random)?;
    let noisy = corners.points().map(|c| {
        let [du, dv] = [random.normal(), random.normal()].map(|n| n * s.corner_noise_px);
        Point2::new(c.x + du, c.y + dv)
    });
    let local = Corners::new(noisy.map(|c| c - shift)).ok()?;
    let exact = Corners::new(corners.points().map(|c| c - shift)).ok()?;
    Some(TrainingView {
        exact: Some(icon(&image, &exact, &p.icon).ok()?),
        icon: icon(&image, &local, &p.icon).ok()?,
        corners_px: Corners::new(noisy).ok()?,
        image_size_px: CAMERA_SIZE_PX,
        generated: true,
    })
}

/// The camera's pose: angles of the line of sight to the normal, roll, apparent size, image
/// position.
struct Pose {
    yaw_rad: f64,
    pitch_rad: f64,
    roll_rad: f64,
    size_px: f64,
    aim_px: [f64; 2],
}

impl Pose {
    fn draw(s: &SynthesisParams, random: &mut Random) -> Self {
        let mut within = |limit: f64| random.range(-limit, limit);
        let (yaw_rad, pitch_rad, roll_rad) =
            (within(s.max_yaw_rad), within(s.max_pitch_rad), within(s.max_roll_rad));
        let aim_px = [within(0.25 * CAMERA_SIZE_PX[0] as f64), within(0.25 * CAMERA_SIZE_PX[1] as f64)];
        Self {
            yaw_rad,
            pitch_rad,
            roll_rad,
            size_px: random.range(s.min_size_px.ln(), s.max_size_px.ln()).exp(),
            aim_px,
        }
    }
}

/// Corners of a landmark of area 1 and `aspect` = width / height; `None` where they leave the
/// image.
fn corners_from(pose: &Pose, aspect: f64) -> Option<Corners> {
    let (half_width, half_height) = (0.5 * aspect.sqrt(), 0.5 / aspect.sqrt());
    let distance = FOCAL_PX / pose.size_px;
    let (sin_yaw, cos_yaw) = pose.yaw_rad.sin_cos();
    let (sin_pitch, cos_pitch) = pose.pitch_rad.sin_cos();
    let (sin_roll, cos_roll) = pose.roll_rad.sin_cos();
    let [width, height] = CAMERA_SIZE_PX.map(|s| s as f64);
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(a, b)| {
        // Camera axes (x right, y down, z forward): turn about y, then about x, then push away,
        // then roll.
        let (x, y) = (a * half_width, b * half_height);
        let (x, z) = (x * cos_yaw, x * sin_yaw);
        let (y, z) = (y * cos_pitch - z * sin_pitch, y * sin_pitch + z * cos_pitch + distance);
        let (x, y) = (x * cos_roll - y * sin_roll, x * sin_roll + y * cos_roll);
        Point2::new(
            FOCAL_PX * x / z + 0.5 * (width - 1.0) + pose.aim_px[0],
            FOCAL_PX * y / z + 0.5 * (height - 1.0) + pose.aim_px[1],
        )
    });
    let inside = corners.iter().all(|c| c.x > 2.0 && c.y > 2.0 && c.x < width - 3.0 && c.y < height - 3.0);
    if inside { Corners::new(corners).ok() } else { None }
}

/// The part of the generated image around the landmark, and the pixel at its top-left.
fn photograph(
    texture: &Texture,
    corners: &Corners,
    s: &SynthesisParams,
    random: &mut Random,
) -> Option<(GrayImage, nalgebra::Vector2<f64>)> {
    let low = corners
        .points()
        .iter()
        .fold(Vector3::repeat(f64::INFINITY), |m, c| m.inf(&Vector3::new(c.x, c.y, 0.0)));
    let high = corners
        .points()
        .iter()
        .fold(Vector3::repeat(0.0), |m: Vector3<f64>, c| m.sup(&Vector3::new(c.x, c.y, 0.0)));
    let shift = nalgebra::Vector2::new((low.x - BORDER_PX).floor(), (low.y - BORDER_PX).floor());
    let size = [(high.x - shift.x + BORDER_PX) as usize, (high.y - shift.y + BORDER_PX) as usize];
    let view_from_unit: Matrix3<f64> = quad_from_unit(&corners.points().map(|c| c - shift));
    let mut picture = texture.rendered(&view_from_unit, size, random.range(60.0, 230.0) as f32)?;
    occlude(&mut picture, size, &view_from_unit, s, random)?;
    blur(&mut picture, size, random.range(0.0, s.max_blur_px));
    let gain = random.range(-s.max_gain.ln(), s.max_gain.ln()).exp();
    let gamma = random.range(-s.max_gamma.ln(), s.max_gamma.ln()).exp();
    let offset = random.range(-s.max_offset, s.max_offset);
    let noise = random.range(0.0, s.max_noise) as f32;
    // The tone curve is smooth: 256 steps, read linearly, lie within 0.1 grey levels of it.
    let tone: Vec<f32> = (0..=256)
        .map(|i| {
            let curved = 255.0 * (f64::from(i) / 256.0).powf(gamma);
            (128.0 + gain * (curved - 128.0) + offset) as f32
        })
        .collect();
    let data = picture
        .iter()
        .map(|g| {
            let at = (g * (256.0 / 255.0)).clamp(0.0, 255.99);
            let (i, share) = (at as usize, at.fract());
            let grey = tone[i] * (1.0 - share) + tone[i + 1] * share;
            (grey + noise * random.quick_normal()).round().clamp(0.0, 255.0) as u8
        })
        .collect();
    Some((GrayImage::new(size[0], size[1], data).ok()?, shift))
}

/// A uniform strip from one side, over up to the given share of the landmark.
fn occlude(
    picture: &mut [f32],
    size: [usize; 2],
    view_from_unit: &Matrix3<f64>,
    s: &SynthesisParams,
    random: &mut Random,
) -> Option<()> {
    let share = random.range(0.0, s.max_occluded_share);
    if share <= 0.0 {
        return Some(());
    }
    let (side, grey) = (random.range(0.0, 4.0) as usize, random.range(20.0, 220.0) as f32);
    let unit_from_view = view_from_unit.try_inverse()?;
    for (i, g) in picture.iter_mut().enumerate() {
        let q = unit_from_view * Vector3::new((i % size[0]) as f64, (i / size[0]) as f64, 1.0);
        let (a, b) = (q.x / q.z, q.y / q.z);
        if [a, b, 1.0 - a, 1.0 - b][side] < share {
            *g = grey;
        }
    }
    Some(())
}

/// Separable Gaussian, border replicated. Skipped below 0.2 px.
fn blur(picture: &mut [f32], size: [usize; 2], sigma_px: f64) {
    if sigma_px < 0.2 {
        return;
    }
    let radius = (3.0 * sigma_px).ceil() as usize;
    let mut kernel: Vec<f32> = (0..=2 * radius)
        .map(|i| (-0.5 * ((i as f64 - radius as f64) / sigma_px).powi(2)).exp() as f32)
        .collect();
    let sum: f32 = kernel.iter().sum();
    for k in &mut kernel {
        *k /= sum;
    }
    let [width, height] = size;
    for v in 0..height {
        convolve(picture, v * width, 1, width, &kernel);
    }
    for u in 0..width {
        convolve(picture, u, width, height, &kernel);
    }
}

fn convolve(picture: &mut [f32], start: usize, step: usize, length: usize, kernel: &[f32]) {
    let radius = kernel.len() / 2;
    let line: Vec<f32> = (0..length + 2 * radius)
        .map(|i| picture[start + step * i.saturating_sub(radius).min(length - 1)])
        .collect();
    for i in 0..length {
        picture[start + step * i] = line[i..].iter().zip(kernel).map(|(g, k)| g * k).sum();
    }
}

/// Width over height, from the mean lengths of opposite sides, within 1:5 and 5:1.
fn aspect(corners: &Corners) -> f64 {
    let [tl, tr, br, bl] = corners.points();
    (((tr - tl).norm() + (br - bl).norm()) / ((bl - tl).norm() + (br - tr).norm())).clamp(0.2, 5.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{model::landmark_model::MAX_VIEWS, recognise::features::icon_features::features};

    fn poster(seed: u64) -> GrayImage {
        let mut random = Random::new(seed);
        let spots: Vec<[f64; 4]> = (0..25)
            .map(|_| {
                [
                    random.range(0.0, 300.0),
                    random.range(0.0, 400.0),
                    random.range(10.0, 45.0),
                    random.range(20.0, 235.0),
                ]
            })
            .collect();
        GrayImage::from_fn(300, 400, |u, v| {
            let (u, v) = (u as f64, v as f64);
            let top = spots.iter().rev().find(|[x, y, r, _]| (u - x).abs() < *r && (v - y).abs() < *r);
            top.map_or(120.0, |s| s[3]) as u8
        })
    }

    fn whole() -> Corners {
        Corners::try_from([[-0.5, -0.5], [299.5, -0.5], [299.5, 399.5], [-0.5, 399.5]]).unwrap()
    }

    #[test]
    fn views_depend_on_the_seed_only() {
        let p = Params::default();
        let poster = poster(1);
        let first = views(&poster, &whole(), 4, &p, 7);
        assert_eq!(first, views(&poster, &whole(), 4, &p, 7));
        assert_ne!(first, views(&poster, &whole(), 4, &p, 8));
        assert_eq!(first.len(), 4);
        assert!(first.iter().all(|v| v.generated && v.icon.size == p.icon.size));
        assert_eq!(views(&poster, &whole(), MAX_VIEWS + 50, &p, 7).len(), MAX_VIEWS);
    }

    #[test]
    fn poses_cover_their_ranges() {
        let p = Params::default();
        let views = views(&poster(2), &whole(), 100, &p, 3);
        let sizes: Vec<f64> = views.iter().map(|v| v.corners_px.area_px2().sqrt()).collect();
        assert!(sizes.iter().any(|s| *s < 85.0) && sizes.iter().any(|s| *s > 180.0));
        // Width over height against the frontal 0.75: the yaw reaches beyond 50 degrees.
        let slant = |v: &TrainingView| {
            let [tl, tr, _, bl] = v.corners_px.points();
            (tr - tl).norm() / (bl - tl).norm() / 0.75
        };
        assert!(views.iter().any(|v| slant(v) < 50f64.to_radians().cos()));
        assert!(views.iter().all(|v| slant(v) > 0.3 && slant(v) < 1.6));
        for v in &views {
            assert!(
                v.corners_px.min_side_px() >= 0.5 * p.icon.size as f64,
                "smaller ones are refused and drawn anew"
            );
        }
    }

    #[test]
    fn without_disturbance_the_icon_equals_the_photographed_one() {
        let mut p = Params::default();
        p.learn.synthesis = SynthesisParams {
            max_yaw_rad: 0.0,
            max_pitch_rad: 0.0,
            max_roll_rad: 0.0,
            min_size_px: 240.0,
            max_size_px: 240.0,
            corner_noise_px: 0.0,
            max_gain: 1.0,
            max_offset: 0.0,
            max_gamma: 1.0,
            max_blur_px: 0.0,
            max_noise: 0.0,
            max_occluded_share: 0.0,
        };
        let poster = poster(3);
        let direct = features(icon(&poster, &whole(), &p.icon).unwrap(), &p.recognise);
        let generated = views(&poster, &whole(), 1, &p, 1).remove(0);
        let difference: f32 =
            direct.icon.pixels.iter().zip(&generated.icon.pixels).map(|(a, b)| (a - b).abs()).sum::<f32>()
                / 5625.0;
        assert!(difference < 3.0, "{difference}");
    }

    #[test]
    fn occlusion_and_light_change_the_icon() {
        let mut p = Params::default();
        let poster = poster(4);
        let plain = views(&poster, &whole(), 1, &p, 9).remove(0);
        p.learn.synthesis.max_occluded_share = 0.9;
        let covered = views(&poster, &whole(), 1, &p, 9).remove(0);
        assert_ne!(plain.icon.pixels, covered.icon.pixels);
    }

    #[test]
    fn an_unusable_quad_gives_no_views() {
        let sliver = Corners::try_from([[0.0, 0.0], [300.0, 0.0], [300.0, 1e-3], [0.0, 1e-3]]).unwrap();
        // Stretched to 1:5 at most, it still is a plane of one colour: views exist, but nothing to
        // learn from.
        for v in views(&poster(5), &sliver, 2, &Params::default(), 1) {
            assert!(v.icon.pixels.iter().all(|g| (0.0..=255.0).contains(g)));
        }
    }

    #[test]
    fn blur_keeps_the_mean_and_spreads_a_point() {
        let mut picture = vec![0.0f32; 31 * 31];
        picture[15 * 31 + 15] = 1000.0;
        blur(&mut picture, [31, 31], 1.2);
        assert!((picture.iter().sum::<f32>() - 1000.0).abs() < 0.1);
        let expected = 1000.0 / (std::f32::consts::TAU * 1.2 * 1.2);
        assert!((picture[15 * 31 + 15] - expected).abs() < 2.0, "{}", picture[15 * 31 + 15]);
    }
}
