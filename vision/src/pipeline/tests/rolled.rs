//! A camera that is mounted at any roll: by its mounting, and without one.

use super::*;
use nalgebra::UnitQuaternion;
use std::f64::consts::TAU;

/// Rolls of the camera, rad.
fn rolls() -> impl Iterator<Item = f64> {
    (0..12).map(|i| f64::from(i) * TAU / 12.0)
}

/// The camera after it was turned clockwise by `roll_rad` about its axis.
fn rolled(roll_rad: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -roll_rad)
}

/// A picture on the wall as a rolled camera sees it, and its quad, named by +v of the image.
fn seen_rolled(picture: &GrayImage, roll_rad: f64) -> (GrayImage, Quad) {
    let camera_from_landmark = rolled(roll_rad) * camera_from_landmark();
    let corners = [(-0.3, 0.4), (0.3, 0.4), (0.3, -0.4), (-0.3, -0.4)]
        .map(|(y, z)| camera().project(&(camera_from_landmark * Point3::new(0.0, y, z)).coords));
    let unit = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Point2::from);
    let image_from_unit = Homography::from_points(&unit, &corners).unwrap();
    let texture = Texture::lift(picture, &whole()).unwrap();
    let picture = texture.rendered(image_from_unit.matrix(), [640, 480], 150.0).unwrap();
    let image = GrayImage::new(640, 480, picture.into_iter().map(|g| g.round() as u8).collect()).unwrap();
    (image, Quad { corners_px: Corners::from_unordered(corners).unwrap(), ..scene(1).1 })
}

/// A poster that looks the same upside down, or nearly: `differing` rows of its lower half are
/// another poster's.
fn symmetric(differing: usize) -> GrayImage {
    let (half, other) = (poster(1), poster(3));
    GrayImage::from_fn(300, 400, |u, v| match v {
        0..200 => half.at(u, v),
        _ if v >= 400 - differing => other.at(u, v),
        _ => half.at(299 - u, 399 - v),
    })
}

/// A map of one landmark.
fn one(picture: &GrayImage) -> ModelSet {
    let p = Params::default();
    let views = synthesis::views(picture, &whole(), 20, &p, 1);
    let model = learn(LandmarkId(1), &views, &[], &p).unwrap();
    ModelSet::new(vec![Arc::new(model.with_points(&[view_points(picture, &whole())]))], &p).unwrap()
}

/// The analysis of what the detector finds, or of a given quad.
fn analysed(
    (image, given): (&GrayImage, Option<&Quad>),
    models: &ModelSet,
    up: Option<Vector3<f64>>,
) -> FrameAnalysis {
    let sizes = BTreeMap::from([(LandmarkId(1), SIZE)]);
    let landmarks = LandmarkDatabase { models, sizes: &sizes, kind: DistanceKind::Both };
    let camera = camera();
    let of = FrameCamera { intrinsics: Some(&camera), up: up.and_then(Up::new), height_m: None };
    let p = Params::default();
    match given {
        Some(quad) => analyse_quads(image, vec![quad.clone()], of, landmarks, &p, &mut NoTrace),
        None => Pipeline::default().analyse(image, of, landmarks, &p, &mut NoTrace),
    }
}

fn names(analysis: &FrameAnalysis) -> Vec<Verdict> {
    let verdicts = analysis.quads.iter().filter_map(|q| q.recognition.as_ref());
    verdicts.map(|v| v.verdict).filter(|v| *v != Verdict::Unknown).collect()
}

/// Errors of the named landmark's pose, m and rad.
fn pose_error(analysis: &FrameAnalysis, roll_rad: f64) -> (f64, f64) {
    let mut poses = analysis.quads.iter().filter_map(|q| q.pose.as_ref().ok());
    let pose = poses.next().unwrap_or_else(|| panic!("roll {roll_rad}: {:?}", names(analysis)));
    let truth = rolled(roll_rad) * camera_from_landmark();
    let error = pose.best.camera_from_landmark.inverse() * truth;
    (error.translation.vector.norm(), error.rotation.angle())
}

#[test]
fn a_camera_at_any_roll_names_landmarks_and_gives_their_poses() {
    let models = models();
    for roll_rad in rolls() {
        let (image, _) = seen_rolled(&poster(1), roll_rad);
        // Tilted up by 0.1 rad besides.
        let up = rolled(roll_rad) * Vector3::new(0.0, -f64::cos(0.1), f64::sin(0.1));
        for up in [Some(up), None] {
            let analysis = analysed((&image, None), &models, up);
            assert_eq!(names(&analysis), [Verdict::Unique(LandmarkId(1))], "roll {roll_rad}, up {up:?}");
            let (apart_m, angle_rad) = pose_error(&analysis, roll_rad);
            assert!(apart_m < 0.05 && angle_rad < 0.05, "roll {roll_rad}, up {up:?}: {apart_m} {angle_rad}");
        }
    }
}

#[test]
fn a_known_mounting_asks_one_rotation_and_an_unknown_one_four() {
    let (image, _) = seen_rolled(&poster(1), 0.0);
    let marked = |up: Option<Vector3<f64>>| {
        let analysis = analysed((&image, None), &ModelSet::default(), up);
        assert!(!analysis.quads.is_empty());
        analysis.quads.iter().all(|q| q.quad.upright_ambiguous)
    };
    for roll_rad in rolls().step_by(3) {
        assert!(!marked(Some(rolled(roll_rad) * -Vector3::y())), "roll {roll_rad}");
    }
    assert!(marked(None));
    // Between two sides of the poster, and towards the zenith.
    assert!(marked(Some(rolled(TAU / 8.0) * -Vector3::y())));
    assert!(marked(Some(Vector3::z())));
}

#[test]
fn a_mounting_that_does_not_hold_gives_no_wrong_pose() {
    let (models, stranger) = (models(), one(&poster(4)));
    let (image, _) = seen_rolled(&poster(1), 0.0);
    for roll_rad in rolls().filter(|roll| (1.0..5.3).contains(roll)) {
        let up = Some(rolled(roll_rad) * -Vector3::y());
        let analysis = analysed((&image, None), &models, up);
        assert_eq!(names(&analysis), [Verdict::Unique(LandmarkId(1))], "roll {roll_rad}");
        // In the camera frame: as the picture shows it, whatever the mounting says.
        let (apart_m, angle_rad) = pose_error(&analysis, 0.0);
        assert!(apart_m < 0.05 && angle_rad < 0.05, "roll {roll_rad}: {apart_m} {angle_rad}");
        assert_eq!(names(&analysed((&image, None), &stranger, up)), [], "roll {roll_rad}");
    }
}

#[test]
fn a_landmark_that_looks_the_same_upside_down_has_a_pose_only_where_up_is_known() {
    let picture = symmetric(0);
    let models = one(&picture);
    for roll_rad in rolls() {
        let (image, quad) = seen_rolled(&picture, roll_rad);
        let unsure = analysed((&image, Some(&quad)), &models, None);
        assert_eq!(names(&unsure), [Verdict::Ambiguous(LandmarkId(1))], "roll {roll_rad}");
        let up = rolled(roll_rad) * -Vector3::y();
        let sure = analysed((&image, Some(&quad)), &models, Some(up));
        let (apart_m, angle_rad) = pose_error(&sure, roll_rad);
        assert!(apart_m < 0.05 && angle_rad < 0.05, "roll {roll_rad}: {apart_m} {angle_rad}");
    }
    // A quarter of it tells up from down.
    let picture = symmetric(100);
    let (image, quad) = seen_rolled(&picture, 3.0);
    let analysis = analysed((&image, Some(&quad)), &one(&picture), None);
    let (apart_m, angle_rad) = pose_error(&analysis, 3.0);
    assert!(apart_m < 0.05 && angle_rad < 0.05, "{apart_m} {angle_rad}");
}
