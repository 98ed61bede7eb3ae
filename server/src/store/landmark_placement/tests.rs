use super::*;
use crate::{
    publication::Catalogue,
    store::{
        maps,
        teaching::{self, Teaching},
        views::NewView,
        walls,
    },
};
use map::{extrinsics::pan_tilt, pose2::Pose2};
use nalgebra::{Matrix3, Matrix6};
use vision::{
    icon::Icon,
    model::LandmarkId,
    pose::reprojection::{corner_points, pixel},
    recognise::DistanceKind,
};

crate::store::tests::cluster::on_each_store! {
    a_taught_landmark_is_placed_on_its_wall_and_a_place_by_hand_stays,
    a_wall_that_is_known_badly_gives_a_place_that_is_known_badly,
}

const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.84 };

/// On the wall y = 0 of a room above it, 2 m from the origin.
fn truth() -> LandmarkPlace {
    LandmarkPlace {
        x_m: 2.0,
        y_m: 0.0,
        z_m: 1.5,
        theta_rad: std::f64::consts::FRAC_PI_2,
        roll_rad: 0.0,
        tilt_rad: 0.0,
        size: SIZE,
        covariance: Matrix6::zeros(),
        shared: None,
    }
}

pub(crate) fn seen_from(x: f64, number: u8, shift_px: f64) -> NewView {
    let camera = Intrinsics::new(500.0, 500.0, 320.0, 240.0, vision::frame::Distortion::None).unwrap();
    let heading = (-2.0_f64).atan2(2.0 - x);
    let robot = Pose2::new(x, 2.0, heading);
    let mounting = pan_tilt(0.0, 0.1, Vector3::new(0.1, 0.0, 1.2));
    let seen = mounting.inverse() * robot.to_isometry3().inverse() * truth().map_from_landmark();
    let mut px = corner_points(&SIZE).map(|p| pixel(&seen, &p, &camera).unwrap());
    px[1].y += shift_px;
    let spread = Matrix3::from_diagonal(&Vector3::new(1e-4, 1e-4, 1e-5));
    let capture = StoredCapture {
        intrinsics: geometry::intrinsics_wire(&camera),
        map_from_robot: geometry::pose2_covariance_wire(&Pose2Covariance { pose: robot, covariance: spread }),
        robot_from_camera: geometry::pose3_wire(&mounting),
        ceiling_height_m: None,
        corner_covariance_px2: None,
    };
    capture.check().unwrap();
    NewView {
        image: vec![number],
        image_sha256: [number; 32],
        image_kind: "png",
        size_px: [640, 480],
        crop: views::QuadCrop {
            corners_px: Corners::new(px).unwrap(),
            icon: Icon::new(20, vec![7.0; 400], 1.0).unwrap(),
        },
        distractors: vec![],
        capture: Some(serde_json::to_string(&capture).unwrap()),
    }
}

async fn taught(store: &Catalogue, view: NewView) -> PlacementReport {
    let (map, landmark) = ("a".to_owned(), "p1".to_owned());
    let teaching = Teaching { map, landmark, view, max: 100, novelty: None, size: None, create: None };
    teaching::add(store, teaching).await.unwrap().2.unwrap()
}

async fn a_taught_landmark_is_placed_on_its_wall_and_a_place_by_hand_stays() {
    let dir = tempfile::tempdir().unwrap();
    let config = crate::publication::tests::config(dir.path());
    let (store, _task) = Catalogue::open(&config).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    let made = store
        .write(|tx| Box::pin(landmarks::create(tx, "a", "p1", LandmarkGeometry::default(), 5)))
        .await
        .unwrap();
    let none = taught(&store, seen_from(1.0, 1, 0.0)).await;
    assert!(!none.placed && none.reason.as_ref().is_some_and(|r| r.contains("no wall")), "{none:?}");
    store.write(|tx| Box::pin(walls::replace(tx, "a", &[[0.0, 0.0, 6.0, 0.0]]))).await.unwrap();
    let placed = taught(&store, seen_from(3.2, 2, 0.0)).await;
    assert_eq!(placed, PlacementReport { placed: true, views_used: 2, reason: None });
    let of =
        |store: &Catalogue| store.snapshots().get("a").unwrap().landmarks[&LandmarkId(made.id as u64)].place;
    let place = of(&store).unwrap();
    assert!((place.x_m - 2.0).abs() < 1e-6 && place.y_m.abs() < 1e-6 && (place.z_m - 1.5).abs() < 1e-6);
    assert!((place.size.width_m - 0.6).abs() < 1e-6);
    // Its covariance follows from the views: across the wall, corners at 1 px give less than the
    // wall itself.
    let hand = PlaceSigmas::default();
    let row = landmarks::get(store.reads(), "a", "p1").await.unwrap().geometry;
    assert!(row.size_from_views && row.place.unwrap().covariance.is_some());
    assert!((place.covariance[(0, 0)].sqrt() - hand.position_m).abs() > 1e-6);
    // A view that is no rectangle on that wall is said to be so when there is no other.
    let by_hand = store.write(|tx| {
        Box::pin(landmarks::update(tx, "a", "p1", |old| LandmarkGeometry {
            place: old.place.map(|p| StoredPlace { x_m: 2.5, covariance: None, ..p }),
            ..old
        }))
    });
    by_hand.await.unwrap();
    let kept = taught(&store, seen_from(2.5, 3, 0.0)).await;
    assert_eq!(kept.reason.as_deref(), Some("by_hand"));
    assert!((of(&store).unwrap().x_m - 2.5).abs() < 1e-12);
}

async fn a_wall_that_is_known_badly_gives_a_place_that_is_known_badly() {
    let dir = tempfile::tempdir().unwrap();
    let config = crate::publication::tests::config(dir.path());
    let (store, _task) = Catalogue::open(&config).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    let none = LandmarkGeometry::default();
    store.write(move |tx| Box::pin(landmarks::create(tx, "a", "p1", none, 5))).await.unwrap();
    let ends = [0.0, 0.0, 6.0, 0.0];
    let mut across = Vec::new();
    for (number, covariance) in [(1, None), (2, Some([1e-6, 0.0, 0.04])), (3, None)] {
        let wall = walls::StoredWall { ends, covariance };
        store.write(move |tx| Box::pin(async move { walls::replace(tx, "a", &[wall]).await })).await.unwrap();
        assert_eq!(walls::all_of(store.reads(), 1).await.unwrap(), [wall]);
        assert!(taught(&store, seen_from(1.0 + 0.3 * f64::from(number), number, 0.0)).await.placed);
        let place = landmarks::get(store.reads(), "a", "p1").await.unwrap().geometry.place.unwrap();
        across.push(place.covariance.unwrap()[(1, 1)].sqrt());
    }
    // 1 cm by hand, 20 cm as stated, 1 cm again: the wall's error is not reduced by views.
    assert!(across[0] < 0.02 && (across[1] - 0.2).abs() < 0.01 && across[2] < 0.02, "{across:?}");
}

#[test]
fn what_is_not_on_the_wall_is_refused_with_the_residual() {
    let wall = LaserSegment::by_hand(&[0.0, 0.0, 6.0, 0.0]).unwrap();
    let new = seen_from(1.0, 1, 60.0);
    let capture: StoredCapture = serde_json::from_str(new.capture.as_deref().unwrap()).unwrap();
    let refused = placed(&[(new.crop.corners_px, capture.checked().unwrap())], &[wall]).unwrap_err();
    assert!(matches!(refused, PlacementError::NotOnWall { rms_m, .. } if rms_m > 0.05), "{refused:?}");
    assert!(refused.to_string().contains("not on this wall"));
    let high = StoredCapture { ceiling_height_m: Some(101.0), ..capture };
    assert_eq!(high.check().unwrap_err().field, "ceiling_height_m");
}

#[test]
fn corners_are_worth_what_is_known_of_them_and_no_more_than_borders_are() {
    let wall = LaserSegment::by_hand(&[0.0, 0.0, 6.0, 0.0]).unwrap();
    let new = seen_from(1.0, 1, 0.0);
    let silent: StoredCapture = serde_json::from_str(new.capture.as_deref().unwrap()).unwrap();
    let with = |corner| StoredCapture { corner_covariance_px2: Some([corner; 4]), ..silent.clone() };
    let width = |capture: &StoredCapture| {
        let made = placed(&[(new.crop.corners_px, capture.checked().unwrap())], std::slice::from_ref(&wall));
        made.unwrap().place.covariance[(4, 4)]
    };
    let by_detector = {
        let mut capture = silent.clone();
        capture.set_detected_corners(&[Matrix2::identity() * 0.04; 4]);
        // It survives the JSON of the store.
        serde_json::from_str::<StoredCapture>(&serde_json::to_string(&capture).unwrap()).unwrap()
    };
    // The width is all corners', so its variance goes with theirs: 1 px; 0.2 px and what borders
    // are off by.
    let camera = width(&StoredCapture {
        intrinsics: v1::Intrinsics {
            focal_sigma_px: Some(0.0),
            center_sigma_px: Some(0.0),
            ..silent.intrinsics.clone()
        },
        ..silent.clone()
    });
    assert!(width(&by_detector) < width(&silent) && camera < width(&silent));
    assert_eq!(by_detector.checked().unwrap().corners_px2[3], Matrix2::identity() * 0.13);
    assert_eq!(silent.checked().unwrap().corners_px2[0], Matrix2::identity());
    // A stated covariance of zero is replaced by the error of borders.
    assert_eq!(with([0.0; 3]).checked().unwrap().corners_px2[0], Matrix2::identity() * 0.09);
    assert!(with([1e8, 0.0, 1e8]).check().is_ok());
    for bad in [[1.1e8, 0.0, 1.0], [1.0, 1.1, 1.0], [-0.1, 0.0, -0.1], [1.0, f64::NAN, 1.0]] {
        assert_eq!(with(bad).check().unwrap_err().field, "corner_covariance_px2[0]");
    }
}
