//! Exact places, a consistent covariance, refusals.

use super::*;
use crate::{
    extrinsics::{CameraExtrinsics, pan_tilt},
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{Matrix2, Matrix3, Point2, Vector3};
use vision::{
    frame::{Distortion, Intrinsics, IntrinsicsSigmas},
    geometry::Corners,
    pose::reprojection::{corner_points, perturbed, pixel},
    random::Random,
};

const SIZE: LandmarkSize = LandmarkSize { width_m: 1.2, height_m: 0.8 };
const CEILING: Ceiling = Ceiling { height_m: 2.6, sigma_m: 0.01 };

fn camera() -> Intrinsics {
    Intrinsics::new(500.0, 490.0, 320.0, 240.0, Distortion::None).unwrap()
}

fn mounting() -> CameraExtrinsics {
    CameraExtrinsics::new(pan_tilt(0.1, 0.8, Vector3::new(0.1, 0.02, 1.2))).unwrap()
}

fn truth(height_m: f64) -> LandmarkPlace {
    LandmarkPlace {
        x_m: 4.0,
        y_m: 3.0,
        z_m: height_m,
        theta_rad: 2.8,
        roll_rad: 0.0,
        tilt_rad: FRAC_PI_2,
        size: SIZE,
        covariance: Matrix6::zeros(),
        shared: None,
    }
}

fn robot(direction: f64) -> Pose2Covariance {
    let (d, v) = (1.5, Vector3::new(4e-4, 4e-4, 3e-5));
    let pose = Pose2::new(4.0 - d * direction.cos(), 3.0 - d * direction.sin(), direction - 0.1);
    Pose2Covariance { pose, covariance: Matrix3::from_diagonal(&v) }
}

fn project(place: &LandmarkPlace, robot: &Pose2, mounting: &CameraExtrinsics) -> [Point2<f64>; 4] {
    projected(&camera(), place, robot, mounting)
}

fn projected(
    camera: &Intrinsics,
    place: &LandmarkPlace,
    robot: &Pose2,
    mounting: &CameraExtrinsics,
) -> [Point2<f64>; 4] {
    let camera_from_landmark =
        mounting.robot_from_camera.inverse() * robot.to_isometry3().inverse() * place.map_from_landmark();
    corner_points(&place.size).map(|p| pixel(&camera_from_landmark, &p, camera).unwrap())
}

/// Stated intrinsics: focal length to 0.8 %, principal point to 3 px.
fn stated() -> Intrinsics {
    camera().with_sigmas(IntrinsicsSigmas { focal_px: 4.0, center_px: 3.0 }).unwrap()
}

fn view_of(points: [Point2<f64>; 4], robot: &Pose2Covariance) -> Result<CeilingRectangle, PlacementError> {
    let view = PosedView {
        corners: &Corners::new(points).unwrap(),
        covariance_px2: &[Matrix2::identity() * 0.25; 4],
        camera: &stated(),
        map_from_robot: robot,
        mounting: &mounting(),
    };
    view_on_ceiling(&view, &CEILING, &PlacementParams::default())
}

#[test]
fn exact_views_give_the_exact_place() {
    let views: Vec<_> = [0.0, 1.0, -2.0]
        .map(|direction| {
            let robot = robot(direction);
            view_of(project(&truth(2.6), &robot.pose, &mounting()), &robot).unwrap()
        })
        .into();
    let made = ceiling_placement(&views, &CEILING, &PlacementParams::default()).unwrap();
    let (a, b) = (made.place.map_from_landmark(), truth(2.6).map_from_landmark());
    assert!((a.to_homogeneous() - b.to_homogeneous()).norm() < 1e-9, "{a} {b}");
    assert!((made.place.size.width_m - 1.2).abs() < 1e-9 && made.used == [0, 1, 2]);
}

#[test]
fn the_covariance_is_consistent() {
    // Oracle: Monte Carlo with corners, robot, extrinsics, camera and ceiling drawn anew.
    let mut random = Random::new(7);
    for directions in [vec![0.4], vec![0.4, 2.0, -1.5]] {
        let (mut sum, mut n, mut beyond) = (0.0, 0.0, 0);
        for _ in 0..400 {
            let true_place = truth(2.6 + 0.01 * random.normal());
            let m = mounting();
            let e = m.covariance.map_diagonal(f64::sqrt).map(|s| s * random.normal());
            let (turn, shift) = (e.fixed_rows::<3>(0).into(), e.fixed_rows::<3>(3).into());
            let real =
                CameraExtrinsics { robot_from_camera: perturbed(&m.robot_from_camera, &turn, &shift), ..m };
            let k = camera();
            let share = 1.0 + 0.008 * random.normal();
            let (cx_px, cy_px) = (k.cx_px + 3.0 * random.normal(), k.cy_px + 3.0 * random.normal());
            let taken_by = Intrinsics { fx_px: k.fx_px * share, fy_px: k.fy_px * share, cx_px, cy_px, ..k };
            let views: Vec<_> = directions
                .iter()
                .map(|direction| {
                    let believed = robot(*direction);
                    let e = believed.covariance.map_diagonal(f64::sqrt).map(|s| s * random.normal());
                    let stood = believed.pose.plus(&e);
                    let noise =
                        |p: Point2<f64>, r: &mut Random| p + Vector2::new(r.normal(), r.normal()) * 0.5;
                    let points =
                        projected(&taken_by, &true_place, &stood, &real).map(|p| noise(p, &mut random));
                    view_of(points, &believed).unwrap()
                })
                .collect();
            let made = ceiling_placement(&views, &CEILING, &PlacementParams::default()).unwrap();
            let e = error_of(&made.place, &true_place);
            let value = e.dot(&made.place.covariance.cholesky().unwrap().solve(&e));
            (sum, n) = (sum + value, n + 1.0);
            beyond += usize::from((0..6).any(|k| e[k].powi(2) > 9.0 * made.place.covariance[(k, k)]));
        }
        // chi2 with 6 degrees of freedom; several views are inflated by 2.
        let range = if directions.len() == 1 { 5.4..6.7 } else { 2.5..6.3 };
        assert!(range.contains(&(sum / n)), "{directions:?}: {}", sum / n);
        assert!(beyond <= 12, "{beyond} of 400 beyond 3 sigma");
    }
}

#[test]
fn an_object_not_under_the_ceiling_is_refused() {
    let robot = robot(0.4);
    // A poster on a wall, viewed by the same camera.
    let wall = LandmarkPlace { tilt_rad: 0.0, theta_rad: 0.4 + std::f64::consts::PI, z_m: 2.2, ..truth(2.6) };
    let refused = view_of(project(&wall, &robot.pose, &mounting()), &robot);
    assert!(
        matches!(refused, Err(PlacementError::NotOnCeiling { .. } | PlacementError::NoWall)),
        "{refused:?}"
    );
    let bad = Ceiling { height_m: MAX_HEIGHT_M + 0.1, ..CEILING };
    assert_eq!(bad.check().unwrap_err().field, "ceiling.height_m");
    assert!(Ceiling { sigma_m: f64::NAN, ..CEILING }.check().is_err());
    assert!(Ceiling { height_m: MAX_HEIGHT_M, sigma_m: 1.0 }.check().is_ok());
    assert_eq!(ceiling_placement(&[], &CEILING, &PlacementParams::default()), Err(PlacementError::NoView));
}

#[test]
fn the_derivative_by_the_height_is_the_finite_difference() {
    let robot = robot(0.4);
    let points = project(&truth(2.6), &robot.pose, &mounting());
    let view = PosedView {
        corners: &Corners::new(points).unwrap(),
        covariance_px2: &[Matrix2::identity() * 0.25; 4],
        camera: &camera(),
        map_from_robot: &robot,
        mounting: &mounting(),
    };
    let at = |h: f64| {
        let ceiling = Ceiling { height_m: h, ..CEILING };
        view_on_ceiling(&view, &ceiling, &PlacementParams::default()).unwrap()
    };
    let numeric = (at(2.6 + 1e-5).rectangle - at(2.6 - 1e-5).rectangle) / 2e-5;
    assert!((numeric - at(2.6).by_height).norm() < 1e-5, "{numeric}");
}
