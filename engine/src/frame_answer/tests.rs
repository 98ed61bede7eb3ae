//! Photographs without a robot: where they were taken.

use super::answer_to_photograph;
use crate::{fixes::NoFix, scene::Scene, snapshot::MapSnapshot};
use nalgebra::{Matrix6, Vector6};
use protos::convert::geometry::pose3;
use std::sync::Arc;

#[test]
fn a_photograph_with_intrinsics_says_where_it_was_taken() {
    let mut scene = Scene::new();
    let (map, camera) = (scene.taught(), scene.intrinsics());
    let mut posed = 0;
    for (_, readings) in scene.stops(5, 6) {
        let image = &readings.frame.image;
        assert_eq!(answer_to_photograph(image, None, &map).camera_pose, None);
        let answer = answer_to_photograph(image, Some(&camera), &map);
        let Some(found) = answer.camera_pose else { continue };
        posed += 1;
        let truth = readings.frame.truth.map_from_camera;
        let pose = pose3(&found.map_from_camera.unwrap()).unwrap();
        let rotation = (pose.rotation * truth.rotation.inverse()).scaled_axis();
        let position = pose.translation.vector - truth.translation.vector;
        let error = Vector6::from_iterator(rotation.iter().chain(position.iter()).copied());
        let covariance = Matrix6::from_row_slice(&found.covariance);
        let distance2 = error.dot(&covariance.cholesky().unwrap().solve(&error));
        // 99.99 % of chi2 with 6 degrees of freedom.
        assert!(distance2 < 27.9 && position.norm() < 0.3, "{position:?}, chi2 {distance2}");
        assert!(!found.landmarks.is_empty() && answer.camera_pose_refusal.is_empty());
    }
    assert!(posed >= 6, "{posed} of 12 photographs");
}

#[test]
fn a_photograph_of_landmarks_without_a_place_says_so() {
    let mut scene = Scene::new();
    let (map, camera) = (scene.taught(), scene.intrinsics());
    let mut landmarks = map.landmarks.clone();
    for info in landmarks.values_mut() {
        info.place = None;
    }
    let map = MapSnapshot { landmarks, ..Arc::unwrap_or_clone(map) };
    let (_, readings) = scene.stops(5, 1).remove(0);
    let answer = answer_to_photograph(&readings.frame.image, Some(&camera), &map);
    assert_eq!(answer.camera_pose, None);
    assert_eq!(answer.camera_pose_refusal, NoFix::LandmarkNotPlaced.as_str());
}
