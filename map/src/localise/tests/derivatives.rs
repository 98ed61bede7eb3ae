//! Derivatives against finite differences.

use crate::{
    extrinsics::CameraExtrinsics,
    localise::{
        planar::Planar,
        tests::{SIZE, camera, mounting, moved, observation, observe, observe_by, off, place, robot, stated},
    },
    place::LandmarkPlace,
    pose2::Pose2,
};
use nalgebra::{Vector3, Vector6};
use vision::{
    pose::reprojection::{corner_points, perturbed, pixel},
    random::Random,
};

#[test]
fn derivatives_are_the_finite_differences() {
    let mut random = Random::new(2);
    let truth = robot(&place(), 3.0, 25.0);
    let mut tilted = place();
    tilted.roll_rad = 0.05;
    let seen = observe(&truth, &tilted, &mounting().robot_from_camera, 0.5, &mut random).unwrap();
    let residual = |pose: &Pose2, place: &LandmarkPlace, mounting: &CameraExtrinsics| {
        let observations = [observation(1, &seen, place)];
        Planar::new(&observations, mounting).linearise(pose).unwrap()
    };
    let at = residual(&truth, &tilted, &mounting());
    let h = 1e-6;
    for k in 0..3 {
        let mut d = Vector3::zeros();
        d[k] = h;
        let up = residual(&truth.plus(&d), &tilted, &mounting()).residual;
        let down = residual(&truth.plus(&-d), &tilted, &mounting()).residual;
        // The residual is measured minus predicted.
        assert!(((down - up) / (2.0 * h) - at.by_pose.column(k)).norm() < 1e-4, "pose {k}");
    }
    for k in 0..6 {
        let mut d = Vector6::zeros();
        d[k] = h;
        let up = residual(&truth, &moved(&tilted, &d), &mounting()).residual;
        let down = residual(&truth, &moved(&tilted, &-d), &mounting()).residual;
        assert!(((down - up) / (2.0 * h) - at.by_nuisance.column(k)).norm() < 1e-4, "place {k}");
        let turned = |d: Vector6<f64>| {
            let base = mounting();
            let (turn, shift) = (d.fixed_rows::<3>(0).into(), d.fixed_rows::<3>(3).into());
            CameraExtrinsics { robot_from_camera: perturbed(&base.robot_from_camera, &turn, &shift), ..base }
        };
        let up = residual(&truth, &tilted, &turned(d)).residual;
        let down = residual(&truth, &tilted, &turned(-d)).residual;
        assert!(((down - up) / (2.0 * h) - at.by_nuisance.column(6 + k)).norm() < 1e-4, "mounting {k}");
    }
}

#[test]
fn derivatives_by_the_camera_are_the_finite_differences() {
    let mut random = Random::new(2);
    let truth = robot(&place(), 3.0, 25.0);
    let view =
        mounting().robot_from_camera.inverse() * truth.to_isometry3().inverse() * place().map_from_landmark();
    let seen = observe_by(&camera(), &stated(), &view, SIZE, 0.0, &mut random).unwrap();
    let (home, mounting) = (place(), mounting());
    let observations = [observation(1, &seen, &home)];
    let at = Planar::new(&observations, &mounting).linearise(&truth).unwrap();
    for (k, h) in [1e-6, 1e-3, 1e-3].into_iter().enumerate() {
        let mut d = Vector3::zeros();
        d[k] = h;
        // Predicted corners by another camera.
        let predicted = |d: Vector3<f64>| corner_points(&SIZE).map(|p| pixel(&view, &p, &off(&d)).unwrap());
        for (c, (up, down)) in predicted(d).iter().zip(predicted(-d)).enumerate() {
            let numeric = (up - down) / (2.0 * h);
            let made = at.by_nuisance.fixed_view::<2, 1>(2 * c, 12 + k);
            assert!((numeric - made).norm() < 1e-4 * numeric.norm().max(1.0), "camera {k}, corner {c}");
        }
    }
}
