//! Derivatives of all factors against central differences.

use super::{
    camera_prior::CameraPrior,
    hanging::{Level, OnWall, UnderCeiling},
    line::LineFit,
    odometry::{OdometryMotion, OdometryPrior},
    reprojection::LandmarkView,
    same_object::SameObject,
    sqrt_information,
    summary::{Estimate, Summary},
    wall_prior::{SizePrior, WallPrior},
};
use crate::{
    joint::{
        factor::Factor,
        variables::{CameraState, LandmarkState, OdometryErrors, State, WallLine},
    },
    pose2::Pose2,
    slam::graph::PoseConstraint,
};
use nalgebra::{
    DVector, Isometry3, Matrix2, Matrix3, Point2, SMatrix, SVector, UnitQuaternion, Vector2, Vector3, Vector6,
};
use std::f64::consts::{FRAC_PI_2, PI};
use vision::random::Random;

/// Camera axes (x right, y down, z forward) in robot axes.
fn optical() -> UnitQuaternion<f64> {
    let axes = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    UnitQuaternion::from_matrix(&axes)
}

fn camera() -> CameraState {
    let pitch = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -0.09);
    CameraState {
        robot_from_camera: Isometry3::from_parts(Vector3::new(0.15, 0.02, 1.15).into(), pitch * optical()),
        focal_px: 700.0,
        aspect: 1.02,
        centre_px: Point2::new(640.0, 480.0),
        k1: -0.05,
    }
}

/// Values far from the origin, at walls behind it and angles at pi.
fn state(random: &mut Random) -> State {
    let mut n = |sigma: f64| sigma * random.normal();
    let keyframes = vec![Pose2::new(3.0 + n(0.3), -2.0 + n(0.3), PI + n(0.1)), Pose2::new(2.4, -2.2, 3.0)];
    let facing = [0.1, PI, -PI + 1e-9];
    let walls = facing.map(|angle| WallLine {
        anchor: Point2::new(-4.0 + n(0.1), -2.0),
        facing_rad: angle + n(0.01),
        offset_m: n(0.1),
    });
    // Before the robot, which looks along -x.
    let landmark = |tilt: f64, x: f64, z: f64, n: &mut dyn FnMut(f64) -> f64| LandmarkState {
        centre: Vector3::new(x + n(0.2), -2.0 + n(0.3), z + n(0.1)),
        theta_rad: n(0.3),
        tilt_rad: tilt + n(0.02),
        roll_rad: n(0.02),
        log_size: Vector2::new(-0.5 + n(0.2), -0.3 + n(0.2)),
    };
    let landmarks = vec![
        landmark(0.0, -1.0, 1.4, &mut n),
        landmark(FRAC_PI_2, -0.5, 2.5, &mut n),
        landmark(0.0, -1.5, 1.2, &mut n),
    ];
    let stated = camera();
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(n(0.02), n(0.02), n(0.02)));
    let cameras = vec![CameraState {
        robot_from_camera: Isometry3::from_parts(
            (stated.robot_from_camera.translation.vector + Vector3::new(n(0.02), n(0.02), n(0.02))).into(),
            turn * stated.robot_from_camera.rotation,
        ),
        focal_px: 703.0 + n(2.0),
        ..stated
    }];
    let odometry = vec![OdometryErrors { scale: n(0.02), drift_rad_per_m: n(0.005) }];
    State { keyframes, walls: walls.to_vec(), landmarks, cameras, odometry, ceilings_m: vec![2.7 + n(0.1)] }
}

/// A head that has turned its camera.
fn head() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.02, -0.01, 0.03), Vector3::new(0.1, -0.05, 0.02))
}

fn factors() -> Vec<Factor> {
    let full = Matrix3::new(4e-4, 1e-5, 2e-5, 1e-5, 2e-4, 0.0, 2e-5, 0.0, 1e-4);
    let corner = sqrt_information(&Matrix2::new(0.3, 0.1, 0.1, 0.4)).unwrap();
    let view = |landmark| LandmarkView {
        keyframe: 0,
        landmark,
        camera: 0,
        mounting_from_camera: head(),
        corners_px: [[600.0, 400.0], [700.0, 410.0], [690.0, 500.0], [610.0, 505.0]].map(Point2::from),
        sqrt_information: [corner; 4],
    };
    let line = |wall| LineFit {
        keyframe: 0,
        wall,
        facing_rad: 0.4,
        offset_m: -2.0,
        sqrt_information: sqrt_information(&Matrix2::new(1e-5, 1e-6, 1e-6, 1e-5)).unwrap(),
        doubt_chi2: None,
    };
    let on_wall = |wall| OnWall { landmark: 0, wall, distance_sigma_m: 0.01, angle_sigma_rad: 0.009 };
    let plan = WallLine { anchor: Point2::new(-3.0, 2.0), facing_rad: 3.1, offset_m: 0.2 };
    let (measured, information) = (Pose2::new(0.5, 0.1, -0.2), full.try_inverse().unwrap());
    let scan = PoseConstraint { from: 0, to: 1, measured, information, doubt_chi2: None };
    let steps = [0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 3.5, 3.0, 3.0, 0.01];
    let mut all = vec![
        Factor::Odometry(OdometryMotion {
            from: 0,
            to: 1,
            drive: 0,
            motion: Pose2::new(0.5, -0.02, 0.1),
            sqrt_information: sqrt_information(&full).unwrap(),
        }),
        Factor::OdometryPrior(OdometryPrior { drive: 0, scale_sigma: 0.02, drift_sigma_rad_per_m: 0.006 }),
        Factor::ScanMatch(scan),
        Factor::WallPrior(WallPrior { wall: 1, line: plan, angle_sigma_rad: 0.005, offset_sigma_m: 0.03 }),
        Factor::UnderCeiling(UnderCeiling {
            landmark: 1,
            ceiling: 0,
            distance_sigma_m: 0.01,
            angle_sigma_rad: 0.01,
        }),
        Factor::Level(Level { landmark: 0, sigma_rad: 0.009 }),
        Factor::Same(SameObject { a: 0, b: 2, sigmas: Vector6::repeat(0.003) }),
        Factor::Camera(CameraPrior { camera: 0, stated: camera(), sigmas: SVector::from(steps) }),
        Factor::Size(SizePrior { landmark: 0, log_size: Vector2::new(-0.4, -0.2), sigma: 0.002 }),
    ];
    let landmark = LandmarkState {
        centre: Vector3::new(-1.0, -2.0, 1.3),
        theta_rad: 0.1,
        tilt_rad: 0.0,
        roll_rad: 0.0,
        log_size: Vector2::new(-0.4, -0.3),
    };
    let errors = OdometryErrors { scale: 0.01, drift_rad_per_m: -0.002 };
    let estimates = vec![
        Estimate::Wall(1, plan),
        Estimate::Landmark(2, landmark),
        Estimate::Camera(0, camera()),
        Estimate::Keyframe(0, Pose2::new(3.1, -2.1, -3.1)),
        Estimate::Odometry(0, errors),
    ];
    let sqrt_information = nalgebra::DMatrix::from_fn(25, 25, |r, c| 1.0 / (1.0 + r as f64 + 2.0 * c as f64));
    let offset = DVector::from_element(25, 0.3);
    all.push(Factor::Summary(Box::new(Summary { estimates, sqrt_information, offset })));
    all.extend((0..3).flat_map(|wall| [Factor::Line(line(wall)), Factor::OnWall(on_wall(wall))]));
    all.extend((0..3).map(|landmark| Factor::View(view(landmark))));
    all
}

#[test]
fn derivatives_are_the_finite_differences() {
    let mut random = Random::new(29);
    for _ in 0..20 {
        let state = state(&mut random);
        for factor in factors() {
            assert!(factor.is_valid(), "{factor:?}");
            for (variable, by) in factor.linearised(&state).by {
                for k in 0..variable.size() {
                    let residual = |h: f64| -> DVector<f64> {
                        let mut step = vec![0.0; variable.size()];
                        step[k] = h;
                        let mut moved = state.clone();
                        moved.step(variable, &step);
                        factor.linearised(&moved).residual
                    };
                    let numeric = (residual(1e-6) - residual(-1e-6)) / 2e-6;
                    let error = (&numeric - by.column(k)).amax();
                    assert!(error < 1e-5 * (1.0 + numeric.amax()), "{factor:?} {variable:?} {k}: {error}");
                }
            }
        }
    }
}

#[test]
fn a_view_is_that_of_the_projection() {
    // Oracle: the camera model of `vision`, for a camera without distortion.
    let state = state(&mut Random::new(3));
    let mut state = State { cameras: vec![CameraState { k1: 0.0, ..state.cameras[0] }], ..state };
    state.landmarks[0].roll_rad = 0.1;
    let (m, c, x) = (state.landmarks[0], state.cameras[0], state.keyframes[0]);
    let place = crate::place::LandmarkPlace {
        x_m: m.centre.x,
        y_m: m.centre.y,
        z_m: m.centre.z,
        theta_rad: m.theta_rad,
        roll_rad: m.roll_rad,
        tilt_rad: m.tilt_rad,
        size: m.size(),
        covariance: SMatrix::zeros(),
        shared: None,
    };
    let intrinsics = vision::frame::Intrinsics::new(
        c.focal_px,
        c.focal_px * c.aspect,
        c.centre_px.x,
        c.centre_px.y,
        vision::frame::Distortion::None,
    )
    .unwrap();
    let camera_from_landmark =
        (x.to_isometry3() * c.robot_from_camera * head()).inverse() * place.map_from_landmark();
    let corners_px = vision::pose::reprojection::corner_points(&m.size())
        .map(|p| vision::pose::reprojection::pixel(&camera_from_landmark, &p, &intrinsics).unwrap());
    let view = LandmarkView {
        keyframe: 0,
        landmark: 0,
        camera: 0,
        mounting_from_camera: head(),
        corners_px,
        sqrt_information: [Matrix2::identity(); 4],
    };
    assert!(Factor::View(view).linearised(&state).residual.norm() < 1e-9);
}

#[test]
fn numbers_that_are_not_finite_and_spreads_of_zero_are_refused() {
    for mut factor in factors() {
        match &mut factor {
            Factor::Odometry(f) => f.motion.x_m = f64::NAN,
            Factor::OdometryPrior(f) => f.scale_sigma = 0.0,
            Factor::ScanMatch(f) => f.information[(0, 1)] = f64::INFINITY,
            Factor::Line(f) => f.offset_m = f64::NAN,
            Factor::WallPrior(f) => f.offset_sigma_m = -1.0,
            Factor::View(f) => f.corners_px[2].x = f64::NAN,
            Factor::OnWall(f) => f.angle_sigma_rad = 0.0,
            Factor::UnderCeiling(f) => f.distance_sigma_m = 0.0,
            Factor::Level(f) => f.sigma_rad = f64::NAN,
            Factor::Same(f) => f.sigmas[3] = 0.0,
            Factor::Camera(f) => f.sigmas[0] = 0.0,
            Factor::Size(f) => f.log_size.x = f64::NEG_INFINITY,
            Factor::Summary(f) => f.sqrt_information[(3, 4)] = f64::NAN,
        }
        assert!(!factor.is_valid(), "{factor:?}");
    }
    assert_eq!(sqrt_information(&Matrix2::new(1.0, 2.0, 2.0, 1.0)), None);
}
