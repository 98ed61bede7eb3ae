use crate::{
    extrinsics::{CameraExtrinsics, pan_tilt},
    landmark_health::{
        expected::{ExpectedLandmark, MountedCamera, expected},
        health::LandmarkHealth,
        monitor::{HealthMonitor, MAX_WATCHED},
        params::HealthParams,
        place_check::{PlaceCheck, PlaceVerdict, check_place, drop_unreliable},
    },
    localise::LandmarkObservation,
    place::{LandmarkPlace, PlaceSigmas},
    pose2::{Pose2, Pose2Covariance},
    visibility::{PanTiltCamera, VisibilityParams, visibility},
};
use nalgebra::{Matrix2, Matrix3, Point2, Vector3};
use std::collections::BTreeMap;
use vision::{
    frame::{Distortion, Intrinsics},
    geometry::Corners,
    model::LandmarkId,
    pose::{
        LandmarkPose, LandmarkSize, landmark_pose,
        reprojection::{corner_points, pixel},
    },
};

const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.84 };

fn camera() -> Intrinsics {
    Intrinsics::new(512.0, 512.0, 319.5, 239.5, Distortion::None).unwrap()
}

fn mounting() -> CameraExtrinsics {
    CameraExtrinsics::new(pan_tilt(0.0, 0.1, Vector3::new(0.0, 0.0, 1.2))).unwrap()
}

/// On the wall x = 4, facing the robot.
fn poster(y: f64, z: f64) -> LandmarkPlace {
    let centre = Vector3::new(4.0, y, z);
    LandmarkPlace::by_hand(centre, std::f64::consts::PI, SIZE, PlaceSigmas::default()).unwrap()
}

fn robot() -> Pose2Covariance {
    let covariance = Matrix3::from_diagonal(&Vector3::new(4e-4, 4e-4, 1e-4));
    Pose2Covariance { pose: Pose2::new(1.2, 0.5, 0.0), covariance }
}

fn observe(place: &LandmarkPlace) -> LandmarkPose {
    let camera_from_landmark = mounting().robot_from_camera.inverse()
        * robot().pose.to_isometry3().inverse()
        * place.map_from_landmark();
    let px = corner_points(&SIZE).map(|c| pixel(&camera_from_landmark, &c, &camera()).unwrap());
    landmark_pose(&Corners::new(px).unwrap(), &[Matrix2::identity() * 0.25; 4], SIZE, &camera()).unwrap()
}

fn verdict(mapped: &LandmarkPlace, real: &LandmarkPlace, supporters: &[u64]) -> PlaceVerdict {
    let seen = observe(real);
    let observation = LandmarkObservation { landmark: LandmarkId(1), seen: &seen, place: mapped };
    let supporters: Vec<_> = supporters.iter().map(|id| LandmarkId(*id)).collect();
    check_place(&observation, &mounting(), &robot(), &supporters, &HealthParams::default()).unwrap().verdict
}

#[test]
fn only_a_moved_landmark_is_observed_elsewhere() {
    let place = poster(0.0, 1.5);
    assert!(
        matches!(verdict(&place, &place, &[2, 3]), PlaceVerdict::InPlace { distance2 } if distance2 < 1.0)
    );
    // Moved by a metre along the wall, and by 30 cm upwards.
    for (real, by) in [(poster(1.0, 1.5), 1.0), (poster(0.0, 1.8), 0.3)] {
        let PlaceVerdict::Elsewhere { apparent, by_m, .. } = verdict(&place, &real, &[2, 3]) else {
            panic!("{by}")
        };
        assert!((by_m - by).abs() < 0.05, "{by_m} for {by}");
        assert!((apparent.position() - nalgebra::Vector2::new(real.x_m, real.y_m)).norm() < 0.05);
    }
}

#[test]
fn a_distant_observation_is_unsure() {
    // Straight ahead at 6 m, heading known to half a degree: a shift along the wall is half hidden
    // in the heading.
    let place = LandmarkPlace { x_m: 7.2, ..poster(0.5, 1.5) };
    let sure =
        Pose2Covariance { covariance: Matrix3::from_diagonal(&Vector3::new(1e-4, 1e-4, 1e-4)), ..robot() };
    let unsure =
        Pose2Covariance { covariance: Matrix3::from_diagonal(&Vector3::new(0.2, 0.2, 1e-2)), ..robot() };
    let seen = observe(&place);
    let observation = LandmarkObservation { landmark: LandmarkId(1), seen: &seen, place: &place };
    let by = |pose| {
        let others = [LandmarkId(2), LandmarkId(3)];
        check_place(&observation, &mounting(), pose, &others, &HealthParams::default()).unwrap()
    };
    assert_eq!(by(&sure).verdict, PlaceVerdict::Unsure);
    assert!(drop_unreliable(&[observation], &[by(&sure)]).is_empty(), "the pose is certain without it");
    assert!(matches!(by(&unsure).verdict, PlaceVerdict::InPlace { .. }), "this pose needs it");
}

#[test]
fn a_pose_without_other_supporters_decides_nothing() {
    let (place, real) = (poster(0.0, 1.5), poster(1.0, 1.5));
    for supporters in [&[][..], &[1], &[1, 1]] {
        assert_eq!(verdict(&place, &real, supporters), PlaceVerdict::Undecided, "{supporters:?}");
    }
}

#[test]
fn other_landmarks_of_the_frame_still_correct() {
    let (place, seen) = (poster(0.0, 1.5), observe(&poster(0.0, 1.5)));
    let observations =
        [1, 2].map(|id| LandmarkObservation { landmark: LandmarkId(id), seen: &seen, place: &place });
    let verdict =
        PlaceVerdict::Elsewhere { distance2: 100.0, apparent: Pose2::default(), by_m: 1.0, supporters: 2 };
    let moved = |id| PlaceCheck { landmark: LandmarkId(id), verdict };
    let left = |checks: &[PlaceCheck]| {
        drop_unreliable(&observations, checks).iter().map(|s| s.landmark.0).collect::<Vec<_>>()
    };
    assert_eq!(left(&[moved(1)]), [2]);
    assert_eq!(left(&[moved(1), moved(2)]), [1, 2], "then the pose may be wrong, not the places");
}

fn elsewhere(id: u64, y: f64) -> PlaceCheck {
    let apparent = Pose2::new(4.0, y, 3.0);
    let verdict = PlaceVerdict::Elsewhere { distance2: 100.0, apparent, by_m: 1.0, supporters: 2 };
    PlaceCheck { landmark: LandmarkId(id), verdict }
}

fn in_place(id: u64) -> PlaceCheck {
    PlaceCheck { landmark: LandmarkId(id), verdict: PlaceVerdict::InPlace { distance2: 1.0 } }
}

/// A map that applies all changes.
#[derive(Default)]
struct Administration {
    healths: BTreeMap<LandmarkId, LandmarkHealth>,
    log: Vec<(u64, LandmarkHealth)>,
}

impl Administration {
    fn frame(&mut self, monitor: &mut HealthMonitor, x: f64, checks: &[PlaceCheck], missed: &[u64]) {
        let missed: Vec<_> = missed.iter().map(|id| LandmarkId(*id)).collect();
        let healths = self.healths.clone();
        let now = |id| healths.get(&id).copied().unwrap_or_default();
        for change in monitor.frame(Point2::new(x, 0.0), checks, &missed, now) {
            self.healths.insert(change.landmark, change.health);
            self.log.push((change.landmark.0, change.health));
        }
    }
}

#[test]
fn a_moved_landmark_is_flagged_then_quarantined_once_another_agrees() {
    let (mut monitor, mut admin) = (HealthMonitor::new(HealthParams::default()), Administration::default());
    for k in 0..20 {
        admin.frame(&mut monitor, 0.1 * f64::from(k), &[elsewhere(1, 1.0)], &[]);
        let expected: &[_] = if k < 2 { &[] } else { &[(1, LandmarkHealth::Flagged)] };
        assert_eq!(admin.log, expected, "after {} observations", k + 1);
    }
    admin.frame(&mut monitor, 3.0, &[in_place(2)], &[]);
    assert_eq!(admin.log, [(1, LandmarkHealth::Flagged), (1, LandmarkHealth::Quarantined)]);
    // Only a person ends a quarantine, however often it is observed in place again.
    for k in 0..9 {
        admin.frame(&mut monitor, 4.0 + f64::from(k), &[in_place(1)], &[]);
    }
    assert_eq!(admin.log.len(), 2);
}

#[test]
fn a_third_landmark_decides_between_two_that_disagree() {
    let one = |id, y| {
        let PlaceVerdict::Elsewhere { distance2, apparent, by_m, .. } = elsewhere(id, y).verdict else {
            panic!()
        };
        let verdict = PlaceVerdict::Elsewhere { distance2, apparent, by_m, supporters: 1 };
        PlaceCheck { landmark: LandmarkId(id), verdict }
    };
    let (mut monitor, mut admin) = (HealthMonitor::new(HealthParams::default()), Administration::default());
    for k in 0..9 {
        admin.frame(&mut monitor, 0.1 * f64::from(k), &[one(1, 1.0)], &[]);
    }
    assert_eq!(admin.log, [], "the supporting landmark may have moved");
    admin.frame(&mut monitor, 3.0, &[in_place(3)], &[]);
    assert_eq!(admin.log, [(1, LandmarkHealth::Quarantined)]);
}

#[test]
fn a_standing_robot_counts_one_observation() {
    let (mut monitor, mut admin) = (HealthMonitor::new(HealthParams::default()), Administration::default());
    for _ in 0..50 {
        admin.frame(&mut monitor, 1.0, &[elsewhere(1, 1.0), in_place(2)], &[3]);
    }
    assert_eq!(admin.log, []);
}

#[test]
fn observations_of_different_places_do_not_add_up() {
    let (mut monitor, mut admin) = (HealthMonitor::new(HealthParams::default()), Administration::default());
    for k in 0..20 {
        let at = 3.0 * f64::from(k % 3);
        admin.frame(&mut monitor, 0.1 * f64::from(k), &[elsewhere(1, at), in_place(2)], &[]);
    }
    for k in 0..20 {
        let judged = if k % 2 == 0 { elsewhere(4, 1.0) } else { in_place(4) };
        admin.frame(&mut monitor, 5.0 + 0.1 * f64::from(k), &[judged], &[]);
    }
    assert_eq!(admin.log, []);
}

#[test]
fn a_flag_is_cleared_by_observations_in_place() {
    let (mut monitor, mut admin) = (HealthMonitor::new(HealthParams::default()), Administration::default());
    for k in 0..3 {
        admin.frame(&mut monitor, 0.1 * f64::from(k), &[elsewhere(1, 1.0)], &[]);
    }
    for k in 0..3 {
        assert_eq!(admin.log.len(), 1);
        admin.frame(&mut monitor, 1.0 + 0.1 * f64::from(k), &[in_place(1)], &[]);
    }
    assert_eq!(admin.log, [(1, LandmarkHealth::Flagged), (1, LandmarkHealth::Sound)]);
}

#[test]
fn a_landmark_that_is_never_observed_is_missing() {
    let (mut monitor, mut admin) = (HealthMonitor::new(HealthParams::default()), Administration::default());
    for k in 0..20 {
        admin.frame(&mut monitor, 0.3 * f64::from(k), &[], &[7]);
        let expected = usize::from(k >= 5) + usize::from(k >= 19);
        assert_eq!(admin.log.len(), expected, "after {} frames", k + 1);
    }
    assert_eq!(admin.log, [(7, LandmarkHealth::Flagged), (7, LandmarkHealth::Quarantined)]);
    let (mut monitor, mut admin) = (HealthMonitor::new(HealthParams::default()), Administration::default());
    for k in 0..40 {
        let judged = if k % 5 == 4 { vec![in_place(7)] } else { vec![] };
        let missed: &[u64] = if judged.is_empty() { &[7] } else { &[] };
        admin.frame(&mut monitor, 0.3 * f64::from(k), &judged, missed);
    }
    assert_eq!(admin.log, [], "observed now and then");
}

#[test]
fn flags_by_a_wrong_pose_are_cleared() {
    let (mut monitor, mut admin) = (HealthMonitor::new(HealthParams::default()), Administration::default());
    for k in 0..9 {
        let judged = [elsewhere(1, 1.0), elsewhere(2, 5.0)];
        admin.frame(&mut monitor, 0.1 * f64::from(k), &judged, &[]);
    }
    assert!(admin.log.iter().all(|(_, s)| *s == LandmarkHealth::Flagged), "{:?}", admin.log);
    let cleared: Vec<_> = monitor.clear().iter().map(|c| (c.landmark.0, c.health)).collect();
    assert_eq!(cleared, [(1, LandmarkHealth::Sound), (2, LandmarkHealth::Sound)]);
}

#[test]
fn evidence_is_bounded() {
    let mut monitor = HealthMonitor::new(HealthParams::default());
    for id in 0..=MAX_WATCHED as u64 {
        monitor.frame(Point2::origin(), &[in_place(id)], &[], |_| LandmarkHealth::Sound);
    }
    assert_eq!(monitor.landmarks.len(), MAX_WATCHED);
    assert!(!monitor.landmarks.contains_key(&LandmarkId(0)), "the one unobserved for longest was dropped");
}

#[test]
fn only_landmarks_surely_in_the_image_are_expected() {
    let p = HealthParams::default();
    let (mounting, camera) = (mounting(), camera());
    let eye = MountedCamera { mounting: &mounting, camera: &camera, image_px: [640.0, 480.0] };
    let expects = |pose: &Pose2Covariance,
                   place: &LandmarkPlace,
                   obstacles: &[crate::visibility::Obstacle]| {
        let visible =
            visibility(place, obstacles, &PanTiltCamera::default(), &VisibilityParams::default()).unwrap();
        let one = ExpectedLandmark { landmark: LandmarkId(1), place, visible: &visible };
        !expected(pose, &eye, &[one], &p).is_empty()
    };
    let place = poster(0.5, 1.5);
    assert!(expects(&robot(), &place, &[]));
    let turned = Pose2Covariance { pose: Pose2::new(1.2, 0.5, 0.5), ..robot() };
    assert!(!expects(&turned, &place, &[]), "out of the image");
    let unsure = Pose2Covariance { covariance: Matrix3::identity() * 0.04, ..robot() };
    assert!(!expects(&unsure, &place, &[]), "perhaps out of the image");
    let column =
        crate::visibility::Obstacle { a: Point2::new(2.5, 0.4), b: Point2::new(2.5, 0.6), height_m: None };
    assert!(!expects(&robot(), &place, &[column]), "hidden");
    let oblique = LandmarkPlace { theta_rad: std::f64::consts::PI + 1.15, ..place };
    assert!(!expects(&robot(), &oblique, &[]), "at 66 degrees it might not be recognised");
}
