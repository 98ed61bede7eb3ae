//! Simulated landmarks with one number wrong: the number is named, with its value.

use super::*;
use crate::localise::refusal_causes::{FixQuantity, RefusalCause, refusal_causes};

/// What is really there while the map and the frame say something else.
struct Truth {
    size_factor: f64,
    height_error_m: f64,
    tilt_error_rad: f64,
}

const RIGHT: Truth = Truth { size_factor: 1.0, height_error_m: 0.0, tilt_error_rad: 0.0 };

fn real_mounting(truth: &Truth) -> Isometry3<f64> {
    pan_tilt(0.0, 0.05 + truth.tilt_error_rad, Vector3::new(0.1, 0.02, 1.2 + truth.height_error_m))
}

fn real_place(truth: &Truth, place: &LandmarkPlace) -> LandmarkPlace {
    let size = LandmarkSize {
        width_m: place.size.width_m * truth.size_factor,
        height_m: place.size.height_m * truth.size_factor,
    };
    LandmarkPlace { size, ..*place }
}

/// A random view from 2.5 to 4.5 m: where the robot is, and the observed landmark.
fn view(truth: &Truth, random: &mut Random) -> Option<(Pose2, LandmarkPose)> {
    let at = robot(&place(), random.range(2.5, 4.5), random.range(-50.0, 50.0));
    let seen = observe(&at, &real_place(truth, &place()), &real_mounting(truth), 0.5, random)?;
    let inside = |p: &Point2<f64>| (0.0..640.0).contains(&p.x) && (0.0..480.0).contains(&p.y);
    seen.measured.corners_px.points().iter().all(inside).then_some((at, seen))
}

/// A pose by odometry from the last fix: 5 cm, 1 degree.
fn prior_at(at: &Pose2, random: &mut Random) -> Pose2Covariance {
    let sigmas = Vector3::new(0.05, 0.05, 1_f64.to_radians());
    let error = sigmas.map(|sigma| sigma * random.normal());
    let covariance = Matrix3::from_diagonal(&sigmas.component_mul(&sigmas));
    Pose2Covariance::new(at.plus(&error), covariance).unwrap()
}

/// The causes of each refused view of the seeds: without a prior pose, and with one.
fn causes(truth: &Truth, seeds: std::ops::Range<u64>) -> Vec<[Vec<RefusalCause>; 2]> {
    let p = LocaliseParams::default();
    let refused = |seed: u64| {
        let mut random = Random::new(seed);
        let (at, seen) = view(truth, &mut random)?;
        let home = place();
        let observations = [observation(1, &seen, &home)];
        let answer = robot_pose(&observations, &mounting(), None, &p).unwrap();
        if !matches!(answer, FixResult::Refused(FixRefusal::ReprojectionError { .. })) {
            return None;
        }
        let prior = prior_at(&at, &mut random);
        let of = |prior| refusal_causes(&observations, &mounting(), prior, &p);
        Some([of(None), of(Some(&prior))])
    };
    seeds.filter_map(refused).collect()
}

/// Within the tolerance and within 4 standard deviations of the truth.
fn is_right(cause: &RefusalCause, truth: f64, tolerance: f64) -> bool {
    let off = (cause.measured - truth).abs();
    off < tolerance && off < 4.0 * cause.sigma
}

/// Of all views, the share in which the quantity is named rightly: among the causes, as the first,
/// as the only one.
fn shares<'a>(
    all: impl ExactSizeIterator<Item = &'a Vec<RefusalCause>>,
    quantity: FixQuantity,
    truth: f64,
    tolerance: f64,
) -> [f64; 3] {
    let (mut counts, total) = ([0.0; 3], all.len() as f64);
    for causes in all {
        let is = |c: &RefusalCause| c.quantity == quantity && is_right(c, truth, tolerance);
        counts[0] += f64::from(causes.iter().any(is));
        counts[1] += f64::from(causes.first().is_some_and(is));
        counts[2] += f64::from(causes.len() == 1 && is(&causes[0]));
    }
    counts.map(|count| count / total)
}

#[test]
fn a_wrong_number_is_named_with_its_value() {
    let size = FixQuantity::Size(LandmarkId(1));
    let tilt_rad = 10_f64.to_radians();
    // The tolerances: 5 % of the width, 5 cm, 1 degree.
    let cases = [
        ("large", Truth { size_factor: 1.5, ..RIGHT }, size, 0.9, 0.045),
        ("small", Truth { size_factor: 1.0 / 1.5, ..RIGHT }, size, 0.4, 0.02),
        ("low", Truth { height_error_m: -0.4, ..RIGHT }, FixQuantity::CameraHeight, 0.8, 0.05),
        ("high", Truth { height_error_m: 0.4, ..RIGHT }, FixQuantity::CameraHeight, 1.6, 0.05),
        ("up", Truth { tilt_error_rad: tilt_rad, ..RIGHT }, FixQuantity::CameraTilt, 0.05 + tilt_rad, 0.0175),
        (
            "down",
            Truth { tilt_error_rad: -tilt_rad, ..RIGHT },
            FixQuantity::CameraTilt,
            0.05 - tilt_rad,
            0.0175,
        ),
    ];
    for (name, truth, quantity, value, tolerance) in cases {
        // Seeds that no constant was chosen on.
        let views = causes(&truth, 3_000..3_100);
        let alone = shares(views.iter().map(|[alone, _]| alone), quantity, value, tolerance);
        let posed = shares(views.iter().map(|[_, posed]| posed), quantity, value, tolerance);
        eprintln!("{name}: {} refused, alone {alone:.2?}, with a prior {posed:.2?}", views.len());
        assert!(views.len() >= 20, "{name}: {} refused", views.len());
        // Among the causes of nearly every view; with a prior pose the first, and most often the
        // only one.
        assert!(alone[0] >= 0.95 && posed[1] >= 0.95 && posed[2] >= 0.85, "{name}: {alone:?} {posed:?}");
        // One landmark alone does not tell size from height.
        let is_size = matches!(quantity, FixQuantity::Size(_));
        assert!(is_size || alone[1] >= 0.95, "{name}: {alone:?}");
    }
}

#[test]
fn a_second_landmark_tells_whose_size_is_wrong() {
    let p = LocaliseParams::default();
    let (mut refused, mut named) = (0, 0);
    for seed in 4_000..4_040 {
        let mut random = Random::new(seed);
        let first = place();
        let second = LandmarkPlace { x_m: first.x_m + 0.97, y_m: first.y_m - 0.7, z_m: 1.6, ..first };
        let at = robot(&first, random.range(2.5, 4.0), random.range(-40.0, 40.0));
        let real = real_place(&Truth { size_factor: 1.5, ..RIGHT }, &second);
        let camera = real_mounting(&RIGHT);
        let seen = [(first, &first), (real, &second)]
            .map(|(real, _)| observe(&at, &real, &camera, 0.5, &mut random));
        let [Some(a), Some(b)] = seen else { continue };
        let both = [observation(1, &a, &first), observation(2, &b, &second)];
        let answer = robot_pose(&both, &mounting(), None, &p).unwrap();
        if !matches!(answer, FixResult::Refused(FixRefusal::Disagree { .. })) {
            continue;
        }
        refused += 1;
        let causes = refusal_causes(&both, &mounting(), None, &p);
        let is_it =
            |c: &RefusalCause| c.quantity == FixQuantity::Size(LandmarkId(2)) && is_right(c, 0.9, 0.045);
        named += usize::from(causes.first().is_some_and(is_it));
    }
    assert!(refused >= 20 && named * 20 >= refused * 19, "{named} of {refused}");
}

#[test]
fn where_no_number_alone_explains_it_the_mounting_is_named() {
    // The camera is rolled by 15 degrees.
    let mut random = Random::new(5);
    let at = robot(&place(), 2.5, 20.0);
    let mut real = real_mounting(&RIGHT);
    real.rotation *= nalgebra::UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 15_f64.to_radians());
    let seen = observe(&at, &place(), &real, 0.5, &mut random).unwrap();
    let home = place();
    let causes =
        refusal_causes(&[observation(1, &seen, &home)], &mounting(), None, &LocaliseParams::default());
    let [RefusalCause { quantity: FixQuantity::Mounting, expected, measured, .. }] = causes.as_slice() else {
        panic!("{causes:?}")
    };
    assert!(*measured > 5.0 && expected < measured, "{causes:?}");
}
