//! Photographs without a robot: where they were taken.

mod pose_refusal;

use super::answer_to_photograph;
use crate::{frame::fixes::NoFix, scene::Scene, snapshot::MapSnapshot};
use map::segments::LaserSegment;
use nalgebra::{Matrix2, Matrix6, Point2, Vector2, Vector6};
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

/// Walls from point to point.
fn walls(ends: &[[Point2<f64>; 2]]) -> Arc<Vec<LaserSegment>> {
    let segment =
        |[a, b]: &[Point2<f64>; 2]| LaserSegment::from_ends(*a, *b, Matrix2::identity() * 1e-4).unwrap();
    Arc::new(ends.iter().map(segment).collect())
}

#[test]
fn a_photograph_from_behind_a_wall_or_from_outside_says_so() {
    let mut scene = Scene::new();
    let (map, camera) = (scene.taught(), scene.intrinsics());
    let map = Arc::unwrap_or_clone(map);
    let stops = scene.stops(5, 6);
    let posed = stops.iter().find_map(|(_, readings)| {
        let answer = answer_to_photograph(&readings.frame.image, Some(&camera), &map);
        Some((readings, answer.camera_pose.clone()?, answer.pose_cautions))
    });
    let (readings, pose, cautions) = posed.expect("a photograph with a pose");
    assert!(cautions.is_empty(), "{cautions:?}");
    let at = pose3(&pose.map_from_camera.unwrap()).unwrap().translation.vector.xy();
    let place = map.landmarks.values().find(|l| l.name == pose.landmarks[0]).unwrap().place.unwrap();
    let (at, landmark) = (Point2::from(at), Point2::new(place.x_m, place.y_m));
    let middle = nalgebra::center(&at, &landmark);
    let across = Vector2::new(-(landmark - at).y, (landmark - at).x);
    let between = walls(&[[middle - across, middle + across]]);
    // A room that ends a metre before the camera.
    let near = landmark + (at - landmark) * (1.0 - 1.0 / (at - landmark).norm());
    let corners = [
        near - across * 2.0,
        near + across * 2.0,
        near + across * 2.0 + (landmark - at) * 2.0,
        near - across * 2.0 + (landmark - at) * 2.0,
    ];
    let room: Vec<_> = (0..4).map(|i| [corners[i], corners[(i + 1) % 4]]).collect();
    for (walls, said) in [(between, vec!["behind_wall"]), (walls(&room), vec!["behind_wall", "outside_map"])]
    {
        let map = MapSnapshot { walls, ..map.clone() };
        let answer = answer_to_photograph(&readings.frame.image, Some(&camera), &map);
        assert!(answer.camera_pose.is_some(), "the pose stands");
        assert_eq!(answer.pose_cautions, said);
    }
}
