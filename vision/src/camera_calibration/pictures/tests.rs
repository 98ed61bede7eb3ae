//! A textured plate before a wall, with its shadow on the wall: the focal length is right where the
//! border is not.

use super::{calibrate_pictures, from_pictures::PictureCalibration};
use crate::{
    camera_calibration::{CalibrateError, CalibrateParams},
    frame::GrayImage,
    pose::LandmarkSize,
    random::Random,
};
use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector2, Vector3};

const SIZE: LandmarkSize = LandmarkSize { width_m: 0.8, height_m: 0.6 };
const IMAGE: [usize; 2] = [640, 480];
const FX_PX: f64 = 560.0;
/// Views: turn about the vertical, tilt about the horizontal, radians; distance, metres.
const VIEWS: [[f64; 3]; 3] = [[0.6, 0.1, 1.4], [-0.5, 0.25, 1.6], [0.1, -0.6, 1.5]];

/// A plate before a wall.
#[derive(Clone, Copy)]
struct Plate {
    /// How far before the wall, metres.
    depth_m: f64,
    /// Where its shadow falls, to the right and up, metres.
    shadow_m: [f64; 2],
    /// How far a point of the plate at height z is to the right, per metre: 0 for a rectangle.
    shear: f64,
    /// How much of the corners is cut off, metres.
    cut_m: f64,
    /// Which texture.
    seed: u64,
}

const PLATE: Plate = Plate { depth_m: 0.03, shadow_m: [0.03, -0.045], shear: 0.0, cut_m: 0.0, seed: 1 };

impl Plate {
    fn covers(&self, y: f64, z: f64) -> bool {
        let (y, z) = ((y - self.shear * z).abs(), z.abs());
        let (right, up) = (0.5 * SIZE.width_m - y, 0.5 * SIZE.height_m - z);
        right >= 0.0 && up >= 0.0 && right + up >= self.cut_m
    }

    /// Grey level that a ray from `from` along `ray` meets; x out of the wall, y right, z up.
    fn grey(&self, from: &Vector3<f64>, ray: &Vector3<f64>) -> f64 {
        let at = |x: f64| from + ray * ((x - from.x) / ray.x);
        let front = at(0.0);
        if self.covers(front.y, front.z) {
            return texture(front.y, front.z, self.seed);
        }
        let wall = at(-self.depth_m);
        let [right, up] = self.shadow_m;
        if self.covers(wall.y - right, wall.z - up) { 95.0 } else { 175.0 }
    }
}

/// Smooth noise of three sizes.
fn texture(y: f64, z: f64, seed: u64) -> f64 {
    let lattice = |i: i64, j: i64, k: u64| {
        Random::new(seed ^ ((i + 1000) as u64) << 40 ^ ((j + 1000) as u64) << 20 ^ k).unit()
    };
    let mut sum = 110.0;
    for (k, (cell_m, height)) in [(0.12, 60.0), (0.05, 60.0), (0.02, 50.0)].into_iter().enumerate() {
        let (u, v) = (y / cell_m, z / cell_m);
        let (i, j) = (u.floor(), v.floor());
        let (a, b) = (u - i, v - j);
        let at = |di: i64, dj: i64| lattice(i as i64 + di, j as i64 + dj, k as u64);
        let low = at(0, 0) * (1.0 - a) + at(1, 0) * a;
        let high = at(0, 1) * (1.0 - a) + at(1, 1) * a;
        sum += height * (low * (1.0 - b) + high * b - 0.5);
    }
    sum.clamp(5.0, 240.0)
}

fn pose([turn, tilt, distance_m]: [f64; 3]) -> Isometry3<f64> {
    let front = Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, -1.0, -1.0, 0.0, 0.0);
    let front = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(front));
    let rotation = UnitQuaternion::from_euler_angles(tilt, turn, 0.03) * front;
    Isometry3::from_parts(Vector3::new(0.02, -0.01, distance_m).into(), rotation)
}

fn picture(plate: &Plate, view: [f64; 3], fx_px: f64) -> GrayImage {
    let plane_from_camera = pose(view).inverse();
    let from = plane_from_camera.translation.vector;
    let centre = Vector2::new(0.5 * (IMAGE[0] as f64 - 1.0), 0.5 * (IMAGE[1] as f64 - 1.0));
    let mut noise = Random::new(view[0].to_bits() ^ plate.seed);
    GrayImage::from_fn(IMAGE[0], IMAGE[1], |u, v| {
        let mut sum = 2.0 * noise.normal();
        for k in 0..9 {
            let within = Vector2::new(f64::from(k % 3) - 1.0, f64::from(k / 3) - 1.0) / 3.0;
            let q = (Vector2::new(u as f64, v as f64) + within - centre) / fx_px;
            sum += plate.grey(&from, &(plane_from_camera.rotation * Vector3::new(q.x, q.y, 1.0))) / 9.0;
        }
        sum.round().clamp(0.0, 255.0) as u8
    })
}

fn pictures(plate: &Plate, fx_px: f64) -> Vec<GrayImage> {
    VIEWS.iter().map(|view| picture(plate, *view, fx_px)).collect()
}

fn params() -> CalibrateParams {
    CalibrateParams { centre_sigma: 0.1, radial: 1, ..CalibrateParams::default() }
}

/// Error of the focal length and its stated standard deviation, as shares.
fn error(found: &PictureCalibration) -> [f64; 2] {
    let sigma = found.calibration.fx_sigma_px().unwrap() / FX_PX;
    [found.calibration.camera.fx_px / FX_PX - 1.0, sigma]
}

#[test]
fn neither_a_shadow_nor_a_wrong_size_moves_the_focal_length() {
    let images = pictures(&PLATE, FX_PX);
    let found = calibrate_pictures(&images, SIZE, &params()).unwrap();
    let [off, sigma] = error(&found);
    assert!(off.abs() < 0.01 && off.abs() < 3.0 * sigma && sigma < 0.01, "{off} +- {sigma}");
    assert_eq!(found.used, [0, 1, 2]);
    assert!(found.points.iter().all(|n| *n > 40), "{:?}", found.points);
    // As if the shadow were part of it, and more.
    let wrong = LandmarkSize { width_m: 0.8, height_m: 0.7 };
    let [again, _] = error(&calibrate_pictures(&images, wrong, &params()).unwrap());
    assert!((again - off).abs() < 1e-3, "{again} instead of {off}");
}

#[test]
fn pictures_larger_than_needed_are_reduced() {
    let small = pictures(&PLATE, FX_PX);
    let large: Vec<GrayImage> =
        small.iter().map(|i| GrayImage::from_fn(1920, 1440, |u, v| i.at(u / 3, v / 3))).collect();
    let of = |images: &[GrayImage]| calibrate_pictures(images, SIZE, &params()).unwrap().calibration;
    let (small, large) = (of(&small), of(&large));
    // 1920 px are reduced by two, so that pixels of a third are what remains.
    assert!((large.camera.fx_px / (3.0 * small.camera.fx_px) - 1.0).abs() < 0.01, "{large:?}");
    assert!((large.camera.cx_px - 3.0 * small.camera.cx_px).abs() < 40.0, "{large:?}");
}

#[test]
fn an_object_without_right_angles_is_not_silently_believed() {
    for plate in [Plate { shear: 0.25, ..PLATE }, Plate { cut_m: 0.25, ..PLATE }] {
        match calibrate_pictures(&pictures(&plate, FX_PX), SIZE, &params()) {
            Ok(found) => {
                let [off, sigma] = error(&found);
                assert!(off.abs() < 3.0 * sigma, "{off} +- {sigma}");
            }
            Err(error) => assert!(
                matches!(
                    error,
                    CalibrateError::BorderUnclear { .. }
                        | CalibrateError::NoCommonObject { .. }
                        | CalibrateError::FocalOutOfRange { .. }
                ),
                "{error}"
            ),
        }
    }
}

#[test]
fn pictures_of_different_objects_are_refused() {
    let images: Vec<GrayImage> =
        (0..3).map(|i| picture(&Plate { seed: 10 + i, ..PLATE }, VIEWS[i as usize], FX_PX)).collect();
    let refused = calibrate_pictures(&images, SIZE, &params());
    assert!(matches!(refused, Err(CalibrateError::NoCommonObject { of: 3, .. })), "{refused:?}");
    let text = refused.unwrap_err().to_string();
    assert!(text.starts_with("no_common_object: ") && text.contains("take sharp pictures"), "{text}");
}

#[test]
fn views_from_one_side_are_refused() {
    let near = [[0.5, 0.1, 1.4], [0.55, 0.12, 1.5], [0.45, 0.08, 1.6]];
    let images: Vec<GrayImage> = near.iter().map(|view| picture(&PLATE, *view, FX_PX)).collect();
    let refused = calibrate_pictures(&images, SIZE, &params());
    assert!(matches!(refused, Err(CalibrateError::Orientations { orientations: 1, .. })), "{refused:?}");
}

#[test]
fn wrong_pictures_are_refused_by_name() {
    let one = picture(&PLATE, VIEWS[0], FX_PX);
    let refused = calibrate_pictures(std::slice::from_ref(&one), SIZE, &params());
    assert!(matches!(refused, Err(CalibrateError::OutOfRange { field: "pictures", .. })), "{refused:?}");
    let small = GrayImage::from_fn(320, 240, |_, _| 0);
    let refused = calibrate_pictures(&[one, small], SIZE, &params());
    assert!(matches!(refused, Err(CalibrateError::View { view: 1, .. })), "{refused:?}");
}
