//! The frames of the scene's robot against its map and against maps that differ from it.

use super::*;
use crate::{frame::slots::SlotKey, scene::Scene};
use map::{
    extrinsics::CameraExtrinsics,
    place::{LandmarkPlace, PlaceSigmas},
};
use nalgebra::Vector3;
use protos::{
    CheckedFrame, Name,
    convert::{EncodedImage, Encoding, Pixels},
};
use vision::model::ModelSet;

fn frame(scene: &mut Scene) -> (String, KeptFrame) {
    let intrinsics = scene.intrinsics();
    let (poster, readings) = scene.stops(5, 1).swap_remove(0);
    let image =
        EncodedImage { encoding: Encoding::Gray8, bytes: readings.frame.image.data().to_vec().into() };
    let frame = CheckedFrame {
        epoch: 1,
        seq: 1,
        captured_ns: 1,
        width_px: 640,
        height_px: 480,
        pixels: Pixels::Image(image),
        intrinsics: Some(intrinsics),
        mounting: Some(CameraExtrinsics::new(readings.step.robot_from_camera).unwrap()),
        odometry: None,
        prior: None,
        deadline_ms: None,
        map: None,
    };
    let key = SlotKey { robot: Name::new("r1").unwrap(), camera: Name::new("front").unwrap() };
    (poster, KeptFrame { key, map: crate::scene::MAP.to_owned(), frame })
}

/// A copy of the map without a landmark.
fn without(map: &MapSnapshot, name: &str) -> MapSnapshot {
    let mut left = map.clone();
    let gone = *left.landmarks.iter().find(|(_, info)| info.name == name).unwrap().0;
    left.landmarks.remove(&gone);
    left.sizes.remove(&gone);
    let models = map.models.iter().filter(|model| model.id != gone).cloned().collect();
    left.models = ModelSet::new(models, &map.params).unwrap();
    left
}

/// A copy of the map with a landmark `aside_m` further along its wall.
fn moved(map: &MapSnapshot, name: &str, aside_m: f64) -> MapSnapshot {
    let mut other = map.clone();
    let info = other.landmarks.values_mut().find(|info| info.name == name).unwrap();
    let at = info.place.as_ref().unwrap().map_from_landmark();
    let (normal, along) = (at.rotation * Vector3::x(), at.rotation * Vector3::y());
    let centre = at.translation.vector + along * aside_m;
    let (theta_rad, size) = (normal.y.atan2(normal.x), info.size.unwrap());
    info.place = Some(LandmarkPlace::by_hand(centre, theta_rad, size, PlaceSigmas::default()).unwrap());
    other
}

#[test]
fn what_a_draft_loses_gains_and_moves_is_reported() {
    let mut scene = Scene::new();
    let map: Arc<MapSnapshot> = scene.taught();
    let (poster, kept) = frame(&mut scene);
    let of = |before: &MapSnapshot, after: &MapSnapshot| {
        let [before, after] = [before, after].map(|map| Arc::new(map.clone()));
        replay(&kept, [&before, &after], ImageLimits::FRAME).unwrap()
    };
    assert!(of(&map, &map).is_none());
    let bare = without(&map, &poster);
    let lost = of(&map, &bare);
    assert_eq!((&lost.lost, &lost.gained, lost.pose), (&vec![poster.clone()], &vec![], PoseChange::Lost));
    let gained = of(&bare, &map);
    assert_eq!(
        (&gained.lost, &gained.gained, gained.pose),
        (&vec![], &vec![poster.clone()], PoseChange::Gained)
    );
    let aside = of(&map, &moved(&map, &poster, 0.25));
    let PoseChange::Moved { distance_m, angle_rad } = aside.pose else { panic!("{aside:?}") };
    assert!((distance_m - 0.25).abs() < 1e-6 && angle_rad < 1e-6, "{distance_m} m, {angle_rad} rad");
    assert!(aside.lost.is_empty() && aside.gained.is_empty());
}

#[test]
fn turns_are_counted_the_short_way() {
    let at = |theta_rad| {
        let pose = Some(v1::Pose2 { x_m: 1.0, y_m: 2.0, theta_rad });
        let pose = v1::Pose2Covariance { pose, ..v1::Pose2Covariance::default() };
        v1::Answer { map_from_robot: Some(pose), ..v1::Answer::default() }
    };
    for (before, after) in [(3.1, -3.1), (-3.1, 3.1)] {
        let PoseChange::Moved { distance_m, angle_rad } = change(&at(before), &at(after)).pose else {
            panic!("same")
        };
        assert!(distance_m == 0.0 && (angle_rad - (TAU - 6.2)).abs() < 1e-12, "{angle_rad}");
    }
    assert!(change(&at(3.1412), &at(-3.1418)).is_none());
}
