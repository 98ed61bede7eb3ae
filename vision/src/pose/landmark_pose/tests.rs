//! Goldens of method 13.3 and 21, exact poses, consistent covariance, no unflagged flip, refusals.

use super::*;
use crate::{
    frame::{Distortion, IntrinsicsSigmas},
    pose::{
        measurement::{MAX_CORNER_PX, MAX_CORNER_SIGMA_PX, MIN_CORNER_SIGMA_PX},
        reprojection::corner_points,
    },
    random::Random,
};
use nalgebra::{Isometry3, Matrix2, Matrix3, Point2, Rotation3, UnitQuaternion};
use nalgebra::{Vector2, Vector3, Vector6};

const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.84 };

fn camera() -> Intrinsics {
    Intrinsics::new(700.0, 700.0, 320.0, 240.0, Distortion::None).unwrap()
}

/// A level camera at `d_m` from the landmark's centre in plan, at azimuth `psi_deg`, 0.3 m below
/// it, panned at it.
fn view(d_m: f64, psi_deg: f64) -> Isometry3<f64> {
    let psi = psi_deg.to_radians();
    let centre = Vector3::new(d_m * psi.cos(), d_m * psi.sin(), -0.3);
    let forward = Vector3::new(-psi.cos(), -psi.sin(), 0.0);
    let down = -Vector3::z();
    let right = down.cross(&forward);
    let landmark_from_camera =
        Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[right, down, forward]));
    let rotation = UnitQuaternion::from_rotation_matrix(&landmark_from_camera.inverse());
    Isometry3::from_parts((-(rotation * centre)).into(), rotation)
}

fn projected(pose: &Isometry3<f64>, camera: &Intrinsics) -> [Point2<f64>; 4] {
    corner_points(&SIZE).map(|p| camera.project(&(pose.rotation * p + pose.translation.vector)))
}

fn noisy(points: &[Point2<f64>; 4], sigma_px: f64, random: &mut Random) -> Corners {
    Corners::new(points.map(|p| p + Vector2::new(random.normal(), random.normal()) * sigma_px)).unwrap()
}

fn isotropic(sigma_px: f64) -> [Matrix2<f64>; 4] {
    [Matrix2::identity() * sigma_px * sigma_px; 4]
}

fn nees(truth: &Isometry3<f64>, solution: &PoseSolution) -> f64 {
    let pose = &solution.camera_from_landmark;
    let turn = (truth.rotation * pose.rotation.inverse()).scaled_axis();
    let shift = truth.translation.vector - pose.translation.vector;
    let e = Vector6::from_iterator(turn.iter().chain(shift.iter()).copied());
    e.dot(&solution.covariance.cholesky().unwrap().solve(&e))
}

/// The camera in the landmark frame: along the normal, along the wall (m), heading (rad).
fn camera_in_plan(pose: &Isometry3<f64>) -> Vector3<f64> {
    let inverse = pose.inverse();
    let forward = inverse.rotation * Vector3::z();
    let t = inverse.translation.vector;
    Vector3::new(t.x, t.y, forward.y.atan2(-forward.x))
}

#[test]
fn golden_frontal_camera() {
    let px = [[250.0, 142.0], [390.0, 142.0], [390.0, 338.0], [250.0, 338.0]];
    let corners = Corners::try_from(px).unwrap();
    let found = landmark_pose(&corners, &isotropic(0.5), SIZE, &camera()).unwrap();
    let pose = found.best.camera_from_landmark;
    let expected = Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, -1.0, -1.0, 0.0, 0.0);
    assert!((pose.rotation.to_rotation_matrix().matrix() - expected).norm() < 1e-9);
    assert!((pose.translation.vector - Vector3::new(0.0, 0.0, 3.0)).norm() < 1e-9);
    assert!(found.best.chi2 < 1e-12 && found.best.reprojection_rms_px < 1e-9);
    assert!(found.second.is_none() && !found.ambiguous);
    // Eq. (2) alone gives the same.
    let linear = linear_pose(&found.measured).unwrap();
    assert!((linear.to_homogeneous() - pose.to_homogeneous()).norm() < 1e-9);
}

#[test]
fn exact_corners_give_exact_poses() {
    let lenses = [
        Distortion::None,
        Distortion::PlumbBob([-0.25, 0.08, 8e-4, -6e-4, -0.01]),
        Distortion::RationalPolynomial([0.9, 0.3, 2e-4, -3e-4, 0.02, 1.2, 0.5, 0.06]),
        Distortion::Equidistant([-0.02, 0.006, -0.004, 0.001]),
    ];
    let mut random = Random::new(7);
    let mut tried = 0;
    while tried < 500 {
        let distortion = lenses[tried % 4];
        let camera = Intrinsics::new(700.0, 690.0, 320.0, 240.0, distortion).unwrap();
        let (d, psi) = (random.range(1.0, 8.0), random.range(-75.0, 75.0));
        let turn = Vector3::new(random.range(-0.2, 0.2), random.range(-0.2, 0.2), random.range(-0.3, 0.3));
        let base = view(d, psi);
        let swing = UnitQuaternion::from_scaled_axis(turn);
        let truth = Isometry3::from_parts((swing * base.translation.vector).into(), swing * base.rotation);
        let points = projected(&truth, &camera);
        if points.iter().any(|p| !(0.0..640.0).contains(&p.x) || !(0.0..480.0).contains(&p.y)) {
            continue;
        }
        tried += 1;
        let found = landmark_pose(&Corners::new(points).unwrap(), &isotropic(0.5), SIZE, &camera).unwrap();
        let pose = found.best.camera_from_landmark;
        // The undistortion converges to about 1e-8 px.
        assert!(pose.rotation.angle_to(&truth.rotation) < 1e-6, "{d} {psi} {distortion:?}");
        assert!((pose.translation.vector - truth.translation.vector).norm() < 1e-6, "{d} {psi}");
    }
}

#[test]
fn errors_agree_with_the_table_of_method_13_3() {
    // d, psi; refined sigma of (normal, along wall, heading in degrees); linear only.
    let table = [
        (2.0, 0.0, [0.006, 0.020, 0.56], [0.006, 0.024, 0.65]),
        (4.0, 0.0, [0.022, 0.158, 2.25], [0.026, 0.176, 2.51]),
        (4.0, 30.0, [0.029, 0.035, 0.61], [0.118, 0.113, 2.20]),
        (4.0, 60.0, [0.023, 0.014, 0.33], [0.128, 0.040, 1.38]),
        (6.0, 45.0, [0.060, 0.043, 0.64], [0.47, 0.20, 4.3]),
    ];
    let mut random = Random::new(13);
    for (d, psi, refined, linear) in table {
        let truth = view(d, psi);
        let origin = camera_in_plan(&truth);
        // Sums of errors and of their squares: refined, linear.
        let mut sums = [Vector3::zeros(); 4];
        let draws = 2000;
        for _ in 0..draws {
            let corners = noisy(&projected(&truth, &camera()), 0.5, &mut random);
            let found = landmark_pose(&corners, &isotropic(0.5), SIZE, &camera()).unwrap();
            for (i, pose) in
                [found.best.camera_from_landmark, linear_pose(&found.measured).unwrap()].iter().enumerate()
            {
                let e = camera_in_plan(pose) - origin;
                sums[2 * i] += e;
                sums[2 * i + 1] += e.component_mul(&e);
            }
        }
        for (i, expected) in [refined, linear].iter().enumerate() {
            let mean = sums[2 * i] / f64::from(draws);
            let s = (sums[2 * i + 1] / f64::from(draws) - mean.component_mul(&mean)).map(f64::sqrt);
            for (k, got) in [s.x, s.y, s.z.to_degrees()].iter().enumerate() {
                let want = expected[k];
                assert!((got / want - 1.0).abs() < 0.08, "{i} {d} m {psi} deg [{k}]: {got:.4} for {want}");
            }
        }
    }
}

#[test]
fn covariance_is_consistent_in_twelve_cells_and_every_flip_is_flagged() {
    // Distance x obliquity x noise, 200 runs each; mean NEES of 6 degrees of freedom within its
    // bands.
    let mut random = Random::new(4);
    let (mut outside, mut flips, mut flagged) = (0, 0, 0);
    for sigma_px in [0.3, 0.8] {
        for d in [2.0, 4.0, 6.0] {
            for psi in [10.0, 45.0] {
                let truth = view(d, psi);
                let mirrored_truth = mirrored(&truth);
                let (mut sum, mut n) = (0.0, 0.0);
                for _ in 0..200 {
                    let corners = noisy(&projected(&truth, &camera()), sigma_px, &mut random);
                    let found = landmark_pose(&corners, &isotropic(sigma_px), SIZE, &camera()).unwrap();
                    if found.ambiguous {
                        flagged += 1;
                        assert!(found.second.is_some());
                        continue;
                    }
                    let value = nees(&truth, &found.best);
                    let to =
                        |p: &Isometry3<f64>| p.rotation.angle_to(&found.best.camera_from_landmark.rotation);
                    flips += usize::from(to(&mirrored_truth) < to(&truth) && value > 30.0);
                    (sum, n) = (sum + value, n + 1.0);
                }
                let mean = sum / n;
                assert!((5.39..6.65).contains(&mean), "{d} m {psi} deg {sigma_px} px: {mean}");
                outside += usize::from(!(5.53..6.49).contains(&mean));
            }
        }
    }
    assert!(outside <= 2, "{outside} cells outside the 95 % band");
    assert_eq!(flips, 0, "unflagged flips");
    assert!((1..600).contains(&flagged), "{flagged} of 2400 ambiguous");
}

#[test]
fn the_covariance_of_a_front_view_equals_the_sample_covariance() {
    // The linear covariance at the minimum gives a mean NEES of 12 here.
    let truth = view(6.0, 0.0);
    let mut random = Random::new(5);
    let (mut sum, mut n) = (0.0, 0.0);
    for _ in 0..400 {
        let corners = noisy(&projected(&truth, &camera()), 0.5, &mut random);
        let found = landmark_pose(&corners, &isotropic(0.5), SIZE, &camera()).unwrap();
        if !found.ambiguous {
            (sum, n) = (sum + nees(&truth, &found.best), n + 1.0);
        }
    }
    assert!(n > 200.0 && (4.0..7.5).contains(&(sum / n)), "{n} {}", sum / n);
}

#[test]
fn errors_of_the_intrinsics_are_in_the_covariance() {
    // Oracle: a camera drawn anew each time, 1 % and 4 px off, with and without a lens.
    let mut random = Random::new(6);
    for (lens, psi) in
        [(Distortion::None, 40.0), (Distortion::PlumbBob([-0.25, 0.08, 8e-4, -6e-4, -0.01]), -35.0)]
    {
        let bare = Intrinsics::new(700.0, 690.0, 320.0, 240.0, lens).unwrap();
        let stated = bare.with_sigmas(IntrinsicsSigmas { focal_px: 7.0, center_px: 4.0 }).unwrap();
        let base = view(2.5, psi);
        let truth = Isometry3::from_parts(
            (base.translation.vector + Vector3::new(0.3, 0.1, 0.0)).into(),
            base.rotation,
        );
        let (mut sum, mut as_exact, n) = (0.0, 0.0, 400.0);
        for _ in 0..400 {
            let e = stated.error_sigmas().map(|s| s * random.normal());
            let (fx_px, fy_px) = (bare.fx_px * (1.0 + e.x), bare.fy_px * (1.0 + e.x));
            let real = Intrinsics { fx_px, fy_px, cx_px: bare.cx_px + e.y, cy_px: bare.cy_px + e.z, ..bare };
            let corners = noisy(&projected(&truth, &real), 0.3, &mut random);
            let pose = |camera| landmark_pose(&corners, &isotropic(0.3), SIZE, camera).unwrap().best;
            sum += nees(&truth, &pose(&stated));
            as_exact += nees(&truth, &pose(&bare));
        }
        assert!(
            (5.3..6.8).contains(&(sum / n)) && as_exact / n > 30.0,
            "{lens:?} {} {}",
            sum / n,
            as_exact / n
        );
    }
}

#[test]
fn a_pose_scales_with_the_landmarks_size() {
    // Symmetry: a landmark twice as large at twice the distance looks the same.
    let corners = Corners::new(projected(&view(3.0, 35.0), &camera())).unwrap();
    let double = LandmarkSize { width_m: 2.0 * SIZE.width_m, height_m: 2.0 * SIZE.height_m };
    let near = landmark_pose(&corners, &isotropic(0.5), SIZE, &camera()).unwrap().best;
    let far = landmark_pose(&corners, &isotropic(0.5), double, &camera()).unwrap().best;
    let (a, b) = (near.camera_from_landmark, far.camera_from_landmark);
    assert!((b.translation.vector - a.translation.vector * 2.0).norm() < 1e-8);
    assert!(a.rotation.angle_to(&b.rotation) < 1e-8);
    assert!((far.covariance[(3, 3)] / near.covariance[(3, 3)] - 4.0).abs() < 1e-6);
}

#[test]
fn unusable_input_is_refused_with_a_typed_error() {
    let corners = Corners::new(projected(&view(3.0, 20.0), &camera())).unwrap();
    let pose = |s: [Matrix2<f64>; 4], size, camera: &Intrinsics| landmark_pose(&corners, &s, size, camera);
    let with = |w| pose(isotropic(0.5), LandmarkSize { width_m: w, height_m: 0.8 }, &camera()).map(|_| ());
    assert_eq!(with(LandmarkSize::MIN_M), Ok(()));
    for w in [0.0099, 100.1, -1.0, f64::INFINITY] {
        assert_eq!(with(w), Err(PoseError::Size { field: "width_m", value: w }));
    }
    assert!(with(f64::NAN).is_err());
    let mut s = isotropic(0.5);
    s[2] = Matrix2::new(1.0, 2.0, 2.0, 1.0);
    assert_eq!(pose(s, SIZE, &camera()), Err(PoseError::Covariance { corner: 2 }));
    assert!(pose(isotropic(MIN_CORNER_SIGMA_PX * 1.01), SIZE, &camera()).is_ok());
    assert!(pose(isotropic(MIN_CORNER_SIGMA_PX * 0.9), SIZE, &camera()).is_err());
    assert!(pose(isotropic(MAX_CORNER_SIGMA_PX * 1.1), SIZE, &camera()).is_err());
    assert!(pose(isotropic(f64::NAN), SIZE, &camera()).is_err());
    let blind = Intrinsics { fx_px: f64::NAN, ..camera() };
    assert!(matches!(pose(isotropic(0.5), SIZE, &blind), Err(PoseError::Camera(_))));
    let folded = Intrinsics { distortion: Distortion::PlumbBob([-50.0, 0.0, 0.0, 0.0, 0.0]), ..camera() };
    assert_eq!(pose(isotropic(0.5), SIZE, &folded), Err(PoseError::Distortion));
    let far = |x| Corners::try_from([[0.0, 0.0], [x, 0.0], [x, 9.0], [0.0, 9.0]]).unwrap();
    let result = landmark_pose(&far(MAX_CORNER_PX * 1.01), &isotropic(0.5), SIZE, &camera());
    assert_eq!(result, Err(PoseError::Corner { corner: 1 }));
}

proptest::proptest! {
    #[test]
    fn any_corners_give_a_finite_pose_or_an_error(
        p in proptest::array::uniform8(-4e4..4e4_f64),
        w in 0.01..100.0_f64,
        h in 0.01..100.0_f64,
        sigma in 1e-4..1e4_f64,
    ) {
        let points = [[p[0], p[1]], [p[2], p[3]], [p[4], p[5]], [p[6], p[7]]].map(Point2::from);
        if let Ok(corners) = Corners::from_unordered(points) {
            let size = LandmarkSize { width_m: w, height_m: h };
            if let Ok(found) = landmark_pose(&corners, &isotropic(sigma), size, &camera()) {
                proptest::prop_assert!(found.best.covariance.iter().all(|v| v.is_finite()));
                proptest::prop_assert!(faces_camera(&found.best.camera_from_landmark));
                proptest::prop_assert!(found.second.is_none_or(|s| s.chi2 >= found.best.chi2));
            }
        }
    }
}
