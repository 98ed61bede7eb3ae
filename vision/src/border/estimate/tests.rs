//! The border among shadows and frames, its covariance, and refusals; on pictures rendered here.

use super::*;
use crate::{
    frame::{Distortion, GrayImage},
    random::Random,
};
use nalgebra::UnitQuaternion;

const SIZE: LandmarkSize = LandmarkSize { width_m: 0.8, height_m: 0.6 };

fn camera() -> Intrinsics {
    Intrinsics::new(550.0, 550.0, 319.5, 239.5, Distortion::None).unwrap()
}

/// A landmark 3 m ahead, turned by `yaw` about the vertical.
fn pose(yaw: f64) -> Isometry3<f64> {
    // The landmark's normal towards the camera, its right to the right, its top up.
    let facing = nalgebra::Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, -1.0, -1.0, 0.0, 0.0);
    let facing = UnitQuaternion::from_matrix(&facing);
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), yaw);
    Isometry3::from_parts(Vector3::new(0.1, -0.05, 3.0).into(), turn * facing)
}

/// A picture of the plane: light at (y, z) of the landmark, averaged over each pixel, stored as a
/// camera does.
fn picture(pose: &Isometry3<f64>, light: impl Fn(f64, f64) -> f64, random: &mut Random) -> GrayImage {
    let c = camera();
    let (normal, at) = (pose.rotation * Vector3::x(), pose.translation.vector);
    let seen = |u: f64, v: f64| {
        let ray = Vector3::new((u - c.cx_px) / c.fx_px, (v - c.cy_px) / c.fy_px, 1.0);
        let p = pose.inverse_transform_point(&(ray * (normal.dot(&at) / normal.dot(&ray))).into());
        light(p.y, p.z)
    };
    GrayImage::from_fn(640, 480, |u, v| {
        let mean: f64 = (0..25)
            .map(|i| seen(u as f64 + 0.3 * f64::from(i % 5 - 2), v as f64 + 0.3 * f64::from(i / 5 - 2)))
            .sum::<f64>()
            / 25.0;
        let stored = 255.0 * (1.055 * mean.max(0.0).powf(1.0 / 2.4) - 0.055) + 1.5 * random.normal();
        stored.clamp(0.0, 255.0).round() as u8
    })
}

/// How far beyond the border (y, z) is, metres along the worse axis; negative inside.
fn beyond(y: f64, z: f64) -> f64 {
    (y.abs() - 0.5 * SIZE.width_m).max(z.abs() - 0.5 * SIZE.height_m)
}

/// The true corners, shrunk by a share about their centre, each off by normal errors.
fn texture(pose: &Isometry3<f64>, shrunk: f64, sigma_px: f64, random: &mut Random) -> SeenBorder {
    let truth = corners_at(pose, &SIZE, 0.0, &camera());
    let centre = |axis: usize| (0..4).map(|i| truth[2 * i + axis]).sum::<f64>() / 4.0;
    let mut at = |i: usize, axis: usize| {
        truth[2 * i + axis] + shrunk * (centre(axis) - truth[2 * i + axis]) + sigma_px * random.normal()
    };
    let corners_px = Corners::new(std::array::from_fn(|i| Point2::new(at(i, 0), at(i, 1)))).unwrap();
    let covariance = nalgebra::Matrix2::identity() * (sigma_px.powi(2) + BORDER_SIGMA_PX.powi(2));
    SeenBorder {
        corners_px,
        covariance_px2: [covariance; 4],
        found_by: crate::seen_border::FoundBy::Alignment,
    }
}

fn error_px(found: &Corners, pose: &Isometry3<f64>) -> f64 {
    let truth = corners_at(pose, &SIZE, 0.0, &camera());
    (0..4).map(|i| (found.points()[i].coords - truth.fixed_rows::<2>(2 * i)).norm()).fold(0.0, f64::max)
}

/// A dark picture on a bright wall, with a cast shadow below and to the right whose far edge is 3
/// cm away.
#[test]
fn the_border_is_found_beside_a_shadow() {
    let mut random = Random::new(5);
    let shadowed = |y: f64, z: f64| {
        let wall = 0.6;
        if beyond(y, z) < 0.0 {
            return 0.08 + 0.04 * (17.0 * y).sin() * (13.0 * z).cos();
        }
        let in_shadow = beyond(y - 0.03, z + 0.03) < 0.0;
        if in_shadow { 0.5 * wall } else { wall }
    };
    let (mut worst, mut square, mut count): (f64, f64, f64) = (0.0, 0.0, 0.0);
    for yaw in [-0.7, -0.3, 0.2, 0.5, 0.8] {
        let pose = pose(yaw);
        let image = picture(&pose, shadowed, &mut random);
        for _ in 0..4 {
            let texture = texture(&pose, 0.006, 0.4, &mut random);
            let found = estimate_border((&image).into(), &texture, SIZE, &camera()).unwrap();
            worst = worst.max(error_px(&found.corners_px, &pose));
            let off = SVector::<f64, 8>::from_fn(|i, _| found.corners_px.points()[i / 2][i % 2])
                - corners_at(&pose, &SIZE, 0.0, &camera());
            square += (0..4)
                .map(|i| {
                    let off = off.fixed_rows::<2>(2 * i);
                    off.dot(&found.covariance_px2.of(i).cholesky().unwrap().solve(&off))
                })
                .sum::<f64>();
            count += 8.0;
        }
    }
    // The far edge of the shadow is 5.5 px away.
    assert!(worst < 0.8, "{worst}");
    assert!((0.01..1.6).contains(&(square / count)), "{}", square / count);
}

#[test]
fn corners_that_fit_no_pose_are_refused_by_name() {
    let mut random = Random::new(6);
    let pose = pose(0.3);
    let image = picture(&pose, |_, _| 0.4, &mut random);
    let mut bent = texture(&pose, 0.0, 0.3, &mut random);
    let mut points = *bent.corners_px.points();
    points[2].x += 14.0;
    bent.corners_px = Corners::new(points).unwrap();
    let refused = estimate_border((&image).into(), &bent, SIZE, &camera());
    assert!(matches!(refused, Err(BorderError::Reprojection { chi2, limit }) if chi2 > limit), "{refused:?}");
    // Nor does a landmark of twice the width have a pose there.
    let texture = texture(&pose, 0.0, 0.3, &mut random);
    let wide = LandmarkSize { width_m: 1.6, ..SIZE };
    let refused = estimate_border((&image).into(), &texture, wide, &camera());
    assert!(matches!(refused, Err(BorderError::Reprojection { .. })), "{refused:?}");
}

/// A reading whose pose is `off` to the right, known to 1 mm and 1 mrad.
fn reading(off_m: f64, cost: f64) -> Reading {
    let mut state = SVector::<f64, 7>::zeros();
    state[3] = off_m;
    let (covariance, information) = (SMatrix::identity() * 1e-6, SMatrix::identity());
    Reading { state, covariance, cost, chi2: 1.0, edges: 2, information, pull: SVector::zeros() }
}

#[test]
fn two_borders_that_fit_about_as_well_are_unclear() {
    assert_eq!(mean(&[reading(0.0, 3.0), reading(0.02, 3.4)]), Err(BorderError::Unclear));
    // One that is less likely by a factor of e^3 counts for little, and one at the same place
    // agrees.
    let (pose, covariance) = mean(&[reading(0.0, 3.0), reading(0.02, 9.0)]).unwrap();
    assert!(pose[3] < 0.001 && covariance[(3, 3)] > 1e-5, "{pose:?} {covariance}");
    let (pose, covariance) = mean(&[reading(0.0, 3.0), reading(0.001, 3.4)]).unwrap();
    assert!((pose[3] - 0.00045).abs() < 1e-5, "{pose:?}");
    assert!((1.2e-6..1.3e-6).contains(&covariance[(3, 3)]), "{covariance}");
}

/// Without an edge anywhere the texture alone says where the border is, and the covariance is its
/// own.
#[test]
fn without_edges_the_texture_decides() {
    let mut random = Random::new(8);
    let pose = pose(0.4);
    let blank = GrayImage::from_fn(640, 480, |_, _| 90);
    let texture = texture(&pose, 0.0, 0.3, &mut random);
    let found = estimate_border((&blank).into(), &texture, SIZE, &camera()).unwrap();
    assert!(found.corners_px.furthest_px(&texture.corners_px) < 1.5);
    let sigma_px = found.covariance_px2.of(1).trace().sqrt();
    assert!((0.4..2.5).contains(&sigma_px), "{sigma_px}");
}

/// Far away, a landmark that is turned to the left looks like one that is turned to the right.
#[test]
fn the_other_solution_of_the_planar_ambiguity_stays_possible() {
    let mut random = Random::new(9);
    let mut far = pose(0.45);
    far.translation.vector *= 6.0;
    let image = picture(&far, |y, z| if beyond(y, z) < 0.0 { 0.1 } else { 0.6 }, &mut random);
    let texture = texture(&far, 0.0, 0.4, &mut random);
    let found = estimate_border((&image).into(), &texture, SIZE, &camera()).unwrap();
    assert!(found.is_mirrored, "{found:?}");
    let seen = landmark_pose(&found.corners_px, found.covariance_px2, SIZE, &camera()).unwrap();
    assert!(seen.ambiguous, "{:?}", seen.second);
}
