//! A robot in front of a taught poster, at a known pose.

use super::*;
use crate::{
    frame::analysis::{StageTimes, analyse_frame, frame_camera},
    scene::Scene,
    snapshot::{LandmarkInfo, LookAlikeClasses, MapSnapshot},
};
use map::{extrinsics::CameraExtrinsics, pose2::Pose2};
use nalgebra::{Matrix3, Vector3};
use sim::robot::SensorReadings;
use vision::{model::ModelSet, pipeline::FrameAnalysis};

const POSTER: LandmarkId = LandmarkId(1);
const TWIN: LandmarkId = LandmarkId(7);

/// A pose that is known to 3 cm and half a degree.
fn known(pose: Pose2) -> Pose2Covariance {
    Pose2Covariance { pose, covariance: Matrix3::from_diagonal(&Vector3::new(9e-4, 9e-4, 8e-5)) }
}

/// One frame of the scene's robot.
struct Stop {
    readings: SensorReadings,
    scene: Scene,
}

impl Stop {
    /// In front of the first poster, at another place than it was taught from.
    fn new() -> (Self, Arc<MapSnapshot>) {
        let mut scene = Scene::new();
        let map = scene.taught();
        let name = map.landmarks[&POSTER].name.clone();
        let readings = scene.stops(5, 1).into_iter().find(|(landmark, _)| *landmark == name).unwrap().1;
        (Self { readings, scene }, map)
    }

    fn analysis(&self, map: &MapSnapshot) -> FrameAnalysis {
        let camera = self.scene.intrinsics();
        let extrinsics = CameraExtrinsics::new(self.readings.step.robot_from_camera).unwrap();
        let of = frame_camera(Some(&camera), Some(&extrinsics), map);
        analyse_frame(&self.readings.frame.image, of, map, &mut StageTimes::start())
    }

    /// What a pose adds to this analysis.
    fn guided(
        &self,
        image: &GrayImage,
        analysis: &FrameAnalysis,
        map: &MapSnapshot,
        pose: Pose2,
    ) -> GuidedResult {
        self.guided_in(image, analysis, map, pose, true)
    }

    /// The same; the image is whole, or patches of it alone are there.
    fn guided_in(
        &self,
        image: &GrayImage,
        analysis: &FrameAnalysis,
        map: &MapSnapshot,
        pose: Pose2,
        is_whole: bool,
    ) -> GuidedResult {
        let extrinsics = CameraExtrinsics::new(self.readings.step.robot_from_camera).unwrap();
        let image_px = [image.width() as f64, image.height() as f64];
        let camera = self.scene.intrinsics();
        let frame = FrameContext {
            analysis,
            map,
            extrinsics: Some(&extrinsics),
            camera: Some(&camera),
            is_whole,
            image_px,
            prior: None,
        };
        recognise_guided(image, &frame, &known(pose))
    }

    fn truth(&self) -> Pose2 {
        self.readings.step.map_from_robot
    }
}

/// The map with a second landmark that looks like the poster and hangs `along_m` further along its
/// wall: neither is in use by itself.
fn with_twin(map: &MapSnapshot, along_m: f64) -> MapSnapshot {
    let poster = map.models.get(POSTER).unwrap();
    let twin = Arc::new(vision::model::LandmarkModel { id: TWIN, ..(**poster).clone() });
    let mut info: LandmarkInfo = map.landmarks[&POSTER].clone();
    "twin".clone_into(&mut info.name);
    let place = info.place.as_mut().unwrap();
    place.x_m -= along_m * place.theta_rad.sin();
    place.y_m += along_m * place.theta_rad.cos();
    let mut made = map.clone();
    made.landmarks.insert(TWIN, info);
    made.sizes.insert(TWIN, map.sizes[&POSTER]);
    made.models = ModelSet::default();
    let both = Arc::new(vec![POSTER, TWIN]);
    made.look_alikes = Arc::new(LookAlikeClasses {
        models: ModelSet::new(vec![poster.clone(), twin], &map.params).unwrap(),
        classes: [(POSTER, both.clone()), (TWIN, both)].into(),
        ..LookAlikeClasses::default()
    });
    made
}

fn off_px(a: &Corners, b: &Corners) -> f64 {
    a.points().iter().zip(b.points()).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

#[test]
fn what_the_picture_alone_names_is_not_guided() {
    let (stop, map) = Stop::new();
    let analysis = stop.analysis(&map);
    assert!(!crate::frame::fixes::unique_landmarks(&analysis).is_empty());
    let made = stop.guided(&stop.readings.frame.image, &analysis, &map, stop.truth());
    assert!(made.observations.iter().all(|s| s.landmark != POSTER), "{:?}", made.observations);
    assert_eq!(made.report.contradictions, 0);
}

/// Without points the poster matches by its icon alone. The picture leaves it open; the pose names
/// it at its place, and a pose that is half a metre off does not.
#[test]
fn what_an_icon_alone_speaks_for_is_named_by_the_pose() {
    let (stop, map) = Stop::new();
    let poster = map.models.get(POSTER).unwrap();
    let plain = Arc::new(vision::model::LandmarkModel { points: vec![], ..(**poster).clone() });
    let mut map = (*map).clone();
    map.models = ModelSet::new(vec![plain], &map.params).unwrap();
    let analysis = stop.analysis(&map);
    assert_eq!(crate::frame::fixes::unique_landmarks(&analysis), []);
    let image = &stop.readings.frame.image;
    let made = stop.guided(image, &analysis, &map, stop.truth());
    let found = made.observations.iter().find(|s| s.landmark == POSTER).expect("named");
    assert!(found.quad.is_some(), "by what was detected: {found:?}");
    let wrong = stop.truth().compose(&Pose2::new(0.5, 0.0, 0.0));
    assert_eq!(stop.guided(image, &analysis, &map, wrong).observations, []);
    // A landmark without a place is never named.
    map.landmarks.get_mut(&POSTER).unwrap().place = None;
    assert_eq!(stop.guided(image, &analysis, &map, stop.truth()).observations, []);
}

#[test]
fn a_landmark_that_was_not_detected_is_found_where_it_is_expected() {
    let (stop, map) = Stop::new();
    let nothing = FrameAnalysis { quads: Vec::new() };
    let made = stop.guided(&stop.readings.frame.image, &nothing, &map, stop.truth());
    let found = made.observations.iter().find(|s| s.landmark == POSTER).expect("found");
    let truth = stop.readings.frame.truth.landmark(&map.landmarks[&POSTER].name).unwrap();
    assert!(off_px(&found.corners_px, &truth.corners_px) < 3.0, "{found:?}, truth {truth:?}");
    assert_eq!(found.quad, None);
    // By a pose 6 cm off it is found where it is, not where it was expected.
    let beside = stop.truth().compose(&Pose2::new(0.06, 0.0, 0.0));
    let made = stop.guided(&stop.readings.frame.image, &nothing, &map, beside);
    let found = made.observations.iter().find(|s| s.landmark == POSTER).expect("found");
    assert!(off_px(&found.corners_px, &truth.corners_px) < 3.0, "{found:?}, truth {truth:?}");
}

/// Outside of its patches the image of quads is unknown.
#[test]
fn without_the_whole_image_nothing_is_searched_for_and_nothing_is_missed() {
    let (stop, map) = Stop::new();
    let (image, nothing) = (&stop.readings.frame.image, FrameAnalysis { quads: Vec::new() });
    assert_eq!(stop.guided_in(image, &nothing, &map, stop.truth(), false), GuidedResult::default());
}

#[test]
fn nothing_is_found_in_another_picture_or_from_a_wrong_pose() {
    let (stop, map) = Stop::new();
    let (image, nothing) = (&stop.readings.frame.image, FrameAnalysis { quads: Vec::new() });
    let grey = GrayImage::from_fn(image.width(), image.height(), |_, _| 128);
    let made = stop.guided(&grey, &nothing, &map, stop.truth());
    assert!(made.observations.is_empty() && made.report.contradictions == 0, "{made:?}");
    assert!(made.report.missed, "the poster is surely in view");
    let mirrored = GrayImage::from_fn(image.width(), image.height(), |u, v| {
        image.data()[v * image.width() + image.width() - 1 - u]
    });
    assert_eq!(stop.guided(&mirrored, &nothing, &map, stop.truth()).observations, []);
    // Half a metre off, with a standard deviation of 3 cm.
    let wrong = stop.truth().compose(&Pose2::new(0.5, 0.0, 0.0));
    let made = stop.guided(image, &nothing, &map, wrong);
    assert!(made.observations.is_empty(), "{made:?}");
    let analysis = stop.analysis(&map);
    let made = stop.guided(image, &analysis, &map, wrong);
    assert!(made.report.contradictions > 0, "what the picture alone names speaks against the pose: {made:?}");
}

#[test]
fn of_two_that_look_the_same_the_pose_says_which() {
    let (stop, map) = Stop::new();
    // Two metres: far beyond the gates.
    let map = with_twin(&map, 2.0);
    let analysis = stop.analysis(&map);
    assert!(crate::frame::fixes::unique_landmarks(&analysis).is_empty(), "neither is in use by itself");
    let image = &stop.readings.frame.image;
    let made = stop.guided(image, &analysis, &map, stop.truth());
    let named: Vec<_> = made.observations.iter().map(|s| (s.landmark, s.quad.is_some())).collect();
    assert!(named.contains(&(POSTER, true)), "{named:?}");
    assert!(!named.iter().any(|(id, _)| *id == TWIN), "{named:?}");
    // By a pose two metres further along the wall, the same picture is the twin: what a pose names
    // proves nothing of that pose.
    let place = map.landmarks[&POSTER].place.unwrap();
    let along = Pose2::new(-2.0 * place.theta_rad.sin(), 2.0 * place.theta_rad.cos(), 0.0);
    let there =
        Pose2::new(stop.truth().x_m + along.x_m, stop.truth().y_m + along.y_m, stop.truth().theta_rad);
    let made = stop.guided(image, &analysis, &map, there);
    let named: Vec<_> = made.observations.iter().map(|s| s.landmark).collect();
    assert!(named.contains(&TWIN) && !named.contains(&POSTER), "{named:?}");
    // Until the classes of this version are known, a pose names nothing.
    let mut pending = map;
    pending.pending.look_alikes = true;
    assert!(stop.guided(image, &analysis, &pending, stop.truth()).observations.is_empty());
}

#[test]
fn a_class_of_which_one_hangs_nobody_knows_where_is_not_named() {
    let (stop, map) = Stop::new();
    let placed = with_twin(&map, 2.0);
    let (mut unplaced, mut quarantined) = (placed.clone(), placed);
    unplaced.landmarks.get_mut(&TWIN).unwrap().place = None;
    quarantined.landmarks.get_mut(&TWIN).unwrap().health = map::landmark_health::LandmarkHealth::Quarantined;
    for map in [unplaced, quarantined] {
        for analysis in [stop.analysis(&map), FrameAnalysis { quads: Vec::new() }] {
            let made = stop.guided(&stop.readings.frame.image, &analysis, &map, stop.truth());
            assert!(made.observations.iter().all(|s| s.landmark != POSTER), "{:?}", made.observations);
        }
    }
}
