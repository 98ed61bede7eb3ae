use super::*;
use crate::{
    extrinsics::pan_tilt,
    localise::{FixResult, LandmarkObservation, LocaliseParams, robot_pose},
    place::PlaceSigmas,
    pose2::Pose2,
    visibility::{VisibilityParams, visibility},
};
use nalgebra::{Matrix2, Matrix3, Point3};
use std::f64::consts::{FRAC_PI_2, PI};
use vision::{
    frame::{Distortion, Intrinsics},
    geometry::Corners,
    pose::{
        LandmarkSize, landmark_pose,
        reprojection::{corner_points, pixel},
    },
};

const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.84 };

/// On the wall y = 0, facing +y.
fn poster(x: f64) -> LandmarkPlace {
    LandmarkPlace::by_hand(Vector3::new(x, 0.0, 1.5), FRAC_PI_2, SIZE, PlaceSigmas::default()).unwrap()
}

fn viewer() -> PanTiltCamera {
    PanTiltCamera { pan_rad: [-PI, PI], ..PanTiltCamera::default() }
}

fn area(place: &LandmarkPlace) -> VisibilityMap {
    visibility(place, &[], &viewer(), &VisibilityParams::default()).unwrap()
}

fn at(x: f64, y: f64, theta: f64, sigmas: [f64; 3]) -> Pose2Covariance {
    let covariance = Matrix3::from_diagonal(&Vector3::from(sigmas.map(|s| s * s)));
    Pose2Covariance { pose: Pose2::new(x, y, theta), covariance }
}

const SURE: [f64; 3] = [0.01, 0.01, 0.005];

fn ranked(
    pose: &Pose2Covariance,
    candidates: &[(LandmarkPlace, VisibilityMap, f64, f64)],
    p: &GazeParams,
) -> Vec<GazeTarget> {
    let targets: Vec<_> = candidates
        .iter()
        .enumerate()
        .map(|(i, (place, visible, saliency, v_c))| GazeCandidate {
            landmark: LandmarkId(i as u64),
            place,
            visible,
            saliency: *saliency,
            v_c: *v_c,
        })
        .collect();
    rank(pose, &targets, &viewer(), &PanTiltUnit::default(), p).unwrap()
}

fn two(saliency: [f64; 2]) -> Vec<(LandmarkPlace, VisibilityMap, f64, f64)> {
    [0.0, 3.0].iter().zip(saliency).map(|(x, s)| (poster(*x), area(&poster(*x)), s, 1.0)).collect()
}

#[test]
fn the_choice_flips_where_the_products_are_equal() {
    // By hand: on y = 3.2 the nearest boundary is the far disc, tangent to the wall: of diameter D,
    // centre (x, D/2). With saliencies 1 and 0.8 the choice flips where (R - |q - c0|) = 0.8
    // (R - |q - c1|).
    let p = GazeParams { full_margin_m: 10.0, ..GazeParams::default() };
    let candidates = two([1.0, 0.8]);
    let r = 0.5 * 512.0 * 0.6 / 75.0;
    let worth = |x: f64, centre: f64| r - (x - centre).hypot(3.2 - r);
    let (mut low, mut high) = (1.0, 3.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if worth(middle, 0.0) > 0.8 * worth(middle, 3.0) { low = middle } else { high = middle }
    }
    assert!(worth(low, 0.0) > 0.1, "both are visible there");
    for (x, expected) in [(low - 0.02, 0), (low + 0.02, 1)] {
        let ranked = ranked(&at(x, 3.2, 0.0, [1e-4, 1e-4, 1e-3]), &candidates, &p);
        assert_eq!(ranked.len(), 2);
        assert_eq!(ranked[0].landmark, LandmarkId(expected), "{x} of {low}");
    }
}

#[test]
fn each_factor_of_the_product_has_an_effect() {
    let p = GazeParams::default();
    let candidates = two([1.0, 1.0]);
    let middle = at(1.5, 2.0, 0.0, SURE);
    let equal = ranked(&middle, &candidates, &p);
    assert_eq!(equal[0].landmark, LandmarkId(0), "equal ones by number");
    assert!((equal[0].utility - equal[1].utility).abs() < 1e-9);
    let expected = equal[0].probability * equal[0].margin_m.min(1.0) * 0.5;
    assert!((equal[0].utility - expected).abs() < 1e-12);
    let mut wider = candidates.clone();
    wider[1].3 = 2.0;
    assert_eq!(ranked(&middle, &wider, &p)[0].landmark, LandmarkId(1), "observed from further apart");
    let half_lost = ranked(&at(1.5, 2.0, 0.0, [2.0, 2.0, 0.1]), &candidates, &p);
    assert!(half_lost.iter().all(|c| c.probability < 0.9));
}

#[test]
fn pan_and_tilt_centre_the_landmark() {
    let p = GazeParams::default();
    let head = PanTiltUnit { camera_m: [0.2, -0.1, 1.1], ..PanTiltUnit::default() };
    for (x, y, theta) in [(0.5, 2.5, 0.3), (-1.0, 1.8, -2.0), (0.0, 3.0, 3.0)] {
        let pose = at(x, y, theta, SURE);
        let place = poster(0.0);
        let map = area(&place);
        let target =
            GazeCandidate { landmark: LandmarkId(1), place: &place, visible: &map, saliency: 1.0, v_c: 1.0 };
        let found = rank(&pose, &[target], &viewer(), &head, &p).unwrap()[0];
        let camera = pose.pose.to_isometry3() * pan_tilt(found.pan_rad, found.tilt_rad, head.camera_m.into());
        let centre = camera.inverse() * Point3::new(place.x_m, place.y_m, place.z_m);
        let off = centre.x.hypot(centre.y).atan2(centre.z);
        assert!(off < 0.5_f64.to_radians(), "{off}");
        assert!((found.range_m - found.tilt_rad.cos() * centre.z).abs() < 0.01);
    }
}

#[test]
fn a_sign_under_the_ceiling_is_a_target_inside_its_area() {
    let mut sign = poster(0.0);
    (sign.z_m, sign.tilt_rad) = (2.5, FRAC_PI_2);
    let viewer = PanTiltCamera { tilt_rad: [-0.3, 1.0], ..viewer() };
    let visible = visibility(&sign, &[], &viewer, &VisibilityParams::default()).unwrap();
    let target =
        GazeCandidate { landmark: LandmarkId(1), place: &sign, visible: &visible, saliency: 1.0, v_c: 1.0 };
    let ask = |pose: &Pose2Covariance| {
        rank(pose, &[target], &viewer, &PanTiltUnit::default(), &GazeParams::default()).unwrap()
    };
    // By hand: 1.3 m above the camera, 1.3 m away from every side, it is up and oblique by 45
    // degrees.
    for theta in [0.0, 1.0, 2.0, -2.5_f64] {
        let [choice] = ask(&at(1.3 * theta.cos(), 1.3 * theta.sin(), 0.4, SURE))[..] else {
            panic!("{theta}")
        };
        assert!(
            (choice.tilt_rad - FRAC_PI_2 / 2.0).abs() < 1e-9
                && (choice.incidence_rad - FRAC_PI_2 / 2.0).abs() < 1e-9
        );
        assert!(wrap_rad(choice.pan_rad - (theta + PI - 0.4)).abs() < 1e-9);
        assert!(choice.gain_nats > 0.5 && choice.utility > 0.0);
    }
    assert!(ask(&at(0.3, 0.0, 0.0, SURE)).is_empty(), "it is too high above");
}

#[test]
fn targets_out_of_the_units_range_are_left_out() {
    let place = poster(0.0);
    let map = area(&place);
    let target =
        GazeCandidate { landmark: LandmarkId(1), place: &place, visible: &map, saliency: 1.0, v_c: 1.0 };
    let ask = |viewer: &PanTiltCamera| {
        rank(
            &at(0.0, 2.5, -FRAC_PI_2, SURE),
            &[target],
            viewer,
            &PanTiltUnit::default(),
            &GazeParams::default(),
        )
        .unwrap()
    };
    assert_eq!(ask(&viewer()).len(), 1);
    assert!(ask(&PanTiltCamera { pan_rad: [0.5, 1.0], ..viewer() }).is_empty());
    assert!(ask(&PanTiltCamera { tilt_rad: [-0.3, 0.05], ..viewer() }).is_empty());
}

#[test]
fn the_gain_is_that_of_a_real_fix() {
    // Oracle: the covariance of the fix from the same corners, added to the prior as information.
    let place = poster(0.0);
    let camera = Intrinsics::new(512.0, 512.0, 319.5, 239.5, Distortion::None).unwrap();
    for psi in [0.6_f64, 0.9, -0.7] {
        let robot = Pose2::new(2.5 * psi.sin(), 2.5 * psi.cos(), 0.4);
        let pose = Pose2Covariance {
            pose: robot,
            covariance: Matrix3::new(0.04, 0.01, 0.0, 0.01, 0.09, 0.002, 0.0, 0.002, 0.01),
        };
        let head = PanTiltUnit::default();
        let candidates = [(place, area(&place), 1.0, 1.0)];
        let found = ranked(&pose, &candidates, &GazeParams::default())[0];
        let mounting =
            CameraExtrinsics::new(pan_tilt(found.pan_rad, found.tilt_rad, Vector3::from(head.camera_m)))
                .unwrap();
        let camera_from_landmark =
            mounting.robot_from_camera.inverse() * robot.to_isometry3().inverse() * place.map_from_landmark();
        let corners = corner_points(&SIZE).map(|c| pixel(&camera_from_landmark, &c, &camera).unwrap());
        let claimed = [Matrix2::identity() * 0.25; 4];
        let observed = landmark_pose(&Corners::new(corners).unwrap(), &claimed, SIZE, &camera).unwrap();
        let observation = LandmarkObservation { landmark: LandmarkId(1), seen: &observed, place: &place };
        let fix = robot_pose(&[observation], &mounting, Some(&pose), &LocaliseParams::default()).unwrap();
        let FixResult::Fixed(fix) = fix else { panic!("{fix:?}") };
        let after = pose.covariance.try_inverse().unwrap() + fix.pose.covariance.try_inverse().unwrap();
        let expected = 0.5 * (pose.covariance.determinant() * after.determinant()).ln();
        assert!((found.gain_nats - expected).abs() < 0.05, "{psi}: {} for {expected}", found.gain_nats);
    }
}

#[test]
fn information_prefers_the_oblique_view() {
    // At the same distance, one straight ahead of its wall and one at 45 degrees, with the same
    // turn of the camera.
    let p = GazeParams { criterion: Criterion::Information, ..GazeParams::default() };
    let straight =
        LandmarkPlace::by_hand(Vector3::new(2.4, 0.0, 1.5), PI, SIZE, PlaceSigmas::default()).unwrap();
    let turned = LandmarkPlace { theta_rad: PI - 0.8, ..straight };
    let candidates = [(straight, area(&straight), 1.0, 1.0), (turned, area(&turned), 1.0, 1.0)];
    let found = ranked(&at(0.0, 0.0, 0.0, [0.1, 0.1, 0.1]), &candidates, &p);
    assert_eq!(found[0].landmark, LandmarkId(1), "{found:?}");
    assert!(found[0].gain_nats > found[1].gain_nats + 0.3);
    // By the product they are equal but for the margin.
    let product = ranked(&at(0.0, 0.0, 0.0, SURE), &candidates, &GazeParams::default());
    assert_eq!(product[0].landmark, LandmarkId(0));
}

#[test]
fn a_large_turn_lowers_the_utility() {
    let p = GazeParams { criterion: Criterion::Information, ..GazeParams::default() };
    let (left, right) = (poster(-1.2), poster(1.2));
    let targets = [
        GazeCandidate {
            landmark: LandmarkId(0),
            place: &left,
            visible: &area(&left),
            saliency: 1.0,
            v_c: 1.0,
        },
        GazeCandidate {
            landmark: LandmarkId(1),
            place: &right,
            visible: &area(&right),
            saliency: 1.0,
            v_c: 1.0,
        },
    ];
    let pose = at(0.0, 2.4, -FRAC_PI_2, SURE);
    for (pan_rad, expected) in [(0.4, 1), (-0.4, 0)] {
        let head = PanTiltUnit { pan_rad, ..PanTiltUnit::default() };
        let found = rank(&pose, &targets, &viewer(), &head, &p).unwrap();
        assert_eq!(found[0].landmark, LandmarkId(expected), "the present target");
    }
}

#[test]
fn the_target_stays_until_another_is_clearly_better() {
    let p = GazeParams { full_margin_m: 10.0, ..GazeParams::default() };
    let candidates = two([1.0, 1.0]);
    let mut gaze = GazeController::default();
    let mut target_at = |x: f64| {
        let pose = at(x, 3.2, 0.0, SURE);
        match gaze.choose(0, &ranked(&pose, &candidates, &p), &pose, &p) {
            GazeAction::Landmark(choice) => (choice.landmark.0, choice.utility),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(target_at(1.0).0, 0);
    assert_eq!(target_at(1.51).0, 0, "the other is better, but not clearly");
    assert_eq!(target_at(2.0).0, 1);
    assert_eq!(target_at(1.49).0, 1, "and back");
}

#[test]
fn failures_damp_a_target_for_a_while() {
    let p = GazeParams::default();
    let candidates = two([1.0, 0.7]);
    let pose = at(1.5, 2.0, 0.0, SURE);
    let ranked = ranked(&pose, &candidates, &p);
    let mut gaze = GazeController::default();
    let chosen = |action: GazeAction| match action {
        GazeAction::Landmark(choice) => choice.landmark.0,
        other => panic!("{other:?}"),
    };
    assert_eq!(chosen(gaze.choose(0, &ranked, &pose, &p)), 0);
    for _ in 0..2 {
        gaze.report_outcome(0, LandmarkId(0), false, &p);
    }
    gaze.report_outcome(0, LandmarkId(0), true, &p);
    gaze.report_outcome(0, LandmarkId(0), false, &p);
    assert_eq!(chosen(gaze.choose(1, &ranked, &pose, &p)), 0, "a success starts the count afresh");
    for _ in 0..2 {
        gaze.report_outcome(1, LandmarkId(0), false, &p);
    }
    assert_eq!(chosen(gaze.choose(2, &ranked, &pose, &p)), 1);
    let after = 1 + 10_000_000_001;
    gaze.report_outcome(after, LandmarkId(1), true, &p);
    assert_eq!(chosen(gaze.choose(after, &ranked, &pose, &p)), 0, "1 against 0.7 is more than 1.2 times");
}

#[test]
fn without_targets_it_points_ahead_or_sweeps() {
    let p = GazeParams::default();
    let mut gaze = GazeController::default();
    assert_eq!(gaze.choose(0, &[], &at(0.0, 0.0, 0.0, SURE), &p), GazeAction::Ahead);
    assert_eq!(gaze.choose(0, &[], &at(0.0, 0.0, 0.0, [0.9, 0.9, 0.1]), &p), GazeAction::Sweep);
}

#[test]
fn values_out_of_range_are_refused_with_their_field() {
    let ask =
        |head: PanTiltUnit| rank(&at(0.0, 0.0, 0.0, SURE), &[], &viewer(), &head, &GazeParams::default());
    assert_eq!(
        ask(PanTiltUnit { rate_radps: 0.0, ..PanTiltUnit::default() }).unwrap_err().field,
        "head.rate_radps"
    );
    assert_eq!(
        ask(PanTiltUnit { camera_m: [0.0, f64::NAN, 1.0], ..PanTiltUnit::default() }).unwrap_err().field,
        "head.camera_m"
    );
    assert_eq!(
        ask(PanTiltUnit { tilt_rad: 2.0, ..PanTiltUnit::default() }).unwrap_err().field,
        "head.tilt_rad"
    );
    let mut gaze = GazeController::default();
    let p = GazeParams { failures: 1, ..GazeParams::default() };
    for id in 0..=MAX_DAMPED as u64 {
        gaze.current = Some(LandmarkId(id));
        gaze.report_outcome(0, LandmarkId(id), false, &p);
    }
    assert_eq!(gaze.damped.len(), MAX_DAMPED);
}
