//! Rendered frames of a map and a camera with one wrong number: it is named, with its value.

use super::super::*;
use crate::{
    frame::{context::FrameContext, landmark_checks::evaluate_frame},
    scene::Scene,
};
use map::{
    extrinsics::CameraExtrinsics,
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use sim::robot::SensorReadings;
use std::sync::Arc;

/// Stops of a seed that no constant was chosen on.
const SEED: u64 = 815;

/// The answer to a frame with these extrinsics; `prior` is where the robot thinks it is, to 5 cm
/// and a degree.
fn answered(
    scene: &Scene,
    map: &MapSnapshot,
    readings: &SensorReadings,
    robot_from_camera: Isometry3<f64>,
    prior: Option<&Pose2>,
) -> v1::Answer {
    let (camera, extrinsics) = (scene.intrinsics(), CameraExtrinsics::new(robot_from_camera).unwrap());
    let of = frame_camera(Some(&camera), Some(&extrinsics), map);
    let analysis = analyse_frame(&readings.frame.image, of, map, &mut StageTimes::start());
    let sigmas = Vector3::new(0.05, 0.05, 1_f64.to_radians());
    let covariance = Matrix3::from_diagonal(&sigmas.component_mul(&sigmas));
    let prior = prior.map(|pose| Pose2Covariance::new(*pose, covariance).unwrap());
    let frame = FrameContext {
        analysis: &analysis,
        map,
        extrinsics: Some(&extrinsics),
        camera: Some(&camera),
        is_whole: true,
        image_px: [640.0, 480.0],
        prior: prior.as_ref(),
    };
    let guided = GuidedResult::default();
    with_fixes(&analysis, &guided, &evaluate_frame(&frame, None, &guided), map)
}

/// The map with landmarks of `factor` times their size.
fn resized(map: &MapSnapshot, factor: f64) -> MapSnapshot {
    let mut map = MapSnapshot::clone(map);
    for (id, info) in &mut map.landmarks {
        let size = info.size.map(|s| vision::pose::LandmarkSize {
            width_m: factor * s.width_m,
            height_m: factor * s.height_m,
        });
        info.size = size;
        if let (Some(place), Some(size)) = (&mut info.place, size) {
            place.size = size;
            map.sizes.insert(*id, size);
        }
    }
    map
}

/// Counts the refused frames, and those whose first cause is this one with a value within the
/// tolerance.
#[derive(Debug, Default)]
struct Count {
    refused: usize,
    named: usize,
}

impl Count {
    fn add(&mut self, answer: &v1::Answer, quantity: v1::FixQuantity, (value, tolerance): (f64, f64)) {
        let Some(detail) = &answer.pose_refusal_detail else { return };
        assert!(["gate_reprojection", "gate_inconsistent"].contains(&answer.pose_refusal.as_str()));
        assert!(answer.map_from_robot.is_none() && detail.chi2 > detail.limit && !detail.causes.is_empty());
        self.refused += 1;
        let first = &detail.causes[0];
        let is_right = first.quantity() == quantity && (first.measured - value).abs() < tolerance;
        if !is_right {
            eprintln!("{quantity:?} {value:.3}: {}", detail.sentence);
        }
        self.named += usize::from(is_right);
    }
}

#[test]
fn a_wrong_number_of_a_rendered_frame_is_named() {
    let mut scene = Scene::new();
    let map: Arc<MapSnapshot> = scene.taught();
    let (large, small) = (resized(&map, 1.5), resized(&map, 1.0 / 1.5));
    let [mut size, mut height, mut tilt] = [(); 3].map(|()| Count::default());
    for (name, readings) in scene.stops(SEED, 10) {
        let truth = readings.step.robot_from_camera;
        let at = &readings.step.map_from_robot;
        let info = map.landmarks.values().find(|l| l.name == name).unwrap();
        let width_m = info.size.unwrap().width_m;
        for wrong in [&large, &small] {
            let answer = answered(&scene, wrong, &readings, truth, Some(at));
            size.add(&answer, v1::FixQuantity::Size, (width_m, 0.05 * width_m));
        }
        for error_m in [-0.4, 0.4] {
            let up = Translation3::new(0.0, 0.0, error_m);
            let answer = answered(&scene, &map, &readings, up * truth, None);
            height.add(&answer, v1::FixQuantity::CameraHeight, (truth.translation.z, 0.05));
        }
        for error_deg in [-10.0_f64, 10.0] {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), error_deg.to_radians());
            let mut wrong = truth;
            wrong.rotation *= turn;
            let answer = answered(&scene, &map, &readings, wrong, None);
            let tilt_rad = (truth.rotation * Vector3::z()).z.asin();
            tilt.add(&answer, v1::FixQuantity::CameraTilt, (tilt_rad, 1_f64.to_radians()));
        }
        let answer = answered(&scene, &map, &readings, truth, None);
        assert!(answer.pose_refusal_detail.is_none(), "nothing is wrong: {answer:?}");
    }
    for (what, Count { refused, named }) in [("size", size), ("height", height), ("tilt", tilt)] {
        eprintln!("{what}: {named} of {refused} named rightly");
        assert!(refused >= 10 && 10 * named >= 9 * refused, "{what}: {named} of {refused}");
    }
}

#[test]
fn a_sentence_says_what_does_not_fit_and_what_to_check() {
    let cause = |quantity, expected, measured| RefusalCause { quantity, expected, measured, sigma: 0.01 };
    let say = |causes: &[RefusalCause]| sentence(causes, |_| "poster".to_owned());
    let height = cause(FixQuantity::CameraHeight, 1.2, 0.62);
    assert_eq!(
        say(&[height]),
        "Landmark seen, but the camera would hang at 0.62 m, not at 1.20 m: check camera height and mounting."
    );
    let size = cause(FixQuantity::Size(LandmarkId(1)), 0.6, 0.4);
    assert_eq!(
        say(&[height, size]),
        "Landmark seen, but the camera would hang at 0.62 m, not at 1.20 m, or `poster` would be 0.40 m wide, \
         not 0.60 m: check camera height, size and mounting."
    );
    assert!(
        say(&[cause(FixQuantity::CameraTilt, 0.0, 0.1745)]).contains("look up by 10.0 degrees, not by 0.0")
    );
    assert!(say(&[cause(FixQuantity::Mounting, 1.5, 37.0)]).contains("off by 37.0 px"));
    let wire =
        refusal_wire(&PoseRefusal { chi2: 90.0, limit: 50.0, causes: vec![size] }, |_| "poster".into());
    let cause = &wire.causes[0];
    assert_eq!(
        (cause.quantity(), cause.landmark.as_str(), cause.unit.as_str()),
        (v1::FixQuantity::Size, "poster", "m")
    );
    let json = serde_json::to_value(&wire).unwrap();
    assert_eq!((&json["causes"][0]["quantity"], &json["chi2"]), (&"size".into(), &90.0.into()));
}
