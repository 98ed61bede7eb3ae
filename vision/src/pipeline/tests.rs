//! The pipeline on drawn posters: poses, refusals, borders, bounds.

use super::*;
use crate::{
    detect::quad::BORDER_SIGMA_PX,
    frame::Distortion,
    geometry::{corners::Corners, homography::Homography},
    learn::{lesson::learn, synthesis, texture::Texture},
    model::landmark_model::LandmarkModel,
    params::preset::Preset,
    points::taught::view_points,
    random::Random,
    trace::NoTrace,
};
use nalgebra::{Isometry3, Matrix2, Point2, Point3, Rotation3, Translation3, Vector3};
use std::sync::Arc;

const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.8 };

fn poster(seed: u64) -> GrayImage {
    let mut random = Random::new(seed);
    let patches: Vec<[f64; 4]> = (0..40)
        .map(|_| {
            [
                random.range(0.0, 300.0),
                random.range(0.0, 400.0),
                random.range(8.0, 50.0),
                random.range(10.0, 245.0),
            ]
        })
        .collect();
    GrayImage::from_fn(300, 400, |u, v| {
        let (u, v) = (u as f64, v as f64);
        let top = patches.iter().rev().find(|[x, y, r, _]| (u - x).abs() < *r && (v - y).abs() < *r);
        top.map_or(128.0, |p| p[3]) as u8
    })
}

fn whole() -> Corners {
    Corners::try_from([[-0.5, -0.5], [299.5, -0.5], [299.5, 399.5], [-0.5, 399.5]]).unwrap()
}

fn models() -> ModelSet {
    let p = Params::default();
    let trained = |seed| {
        let views = synthesis::views(&poster(seed), &whole(), 20, &p, seed);
        let points = view_points(&poster(seed), &whole());
        Arc::new(learn(LandmarkId(seed), &views, &[], &p).unwrap().with_points(&[points]))
    };
    ModelSet::new(vec![trained(1), trained(2)], &p).unwrap()
}

fn camera() -> Intrinsics {
    Intrinsics::new(600.0, 600.0, 319.5, 239.5, Distortion::None).unwrap()
}

/// Camera 2 m in front of the landmark, 25 degrees to its side.
fn camera_from_landmark() -> Isometry3<f64> {
    // Landmark axes (x normal, y right, z up) in a camera that looks straight at it: -z, x, -y.
    let straight = Rotation3::from_matrix_unchecked(nalgebra::Matrix3::new(
        0.0, 1.0, 0.0, 0.0, 0.0, -1.0, -1.0, 0.0, 0.0,
    ));
    let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), 25f64.to_radians());
    Isometry3::from_parts(Translation3::new(0.1, -0.05, 2.0), (turn * straight).into())
}

/// The image of poster `seed` on a wall, and its true quad.
fn scene(seed: u64) -> (GrayImage, Quad) {
    let corners = [(-0.3, 0.4), (0.3, 0.4), (0.3, -0.4), (-0.3, -0.4)]
        .map(|(y, z)| camera().project(&(camera_from_landmark() * Point3::new(0.0, y, z)).coords));
    let unit = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Point2::from);
    let image_from_unit = Homography::from_points(&unit, &corners).unwrap();
    let texture = Texture::lift(&poster(seed), &whole()).unwrap();
    let picture = texture.rendered(image_from_unit.matrix(), [640, 480], 150.0).unwrap();
    let quad = Quad {
        corners_px: Corners::new(corners).unwrap(),
        corner_covariance_px2: [Matrix2::identity() * 0.04; 4],
        side_support: [1.0; 4],
        side_clipped: [false; 4],
        score: 1.0,
        kind: QuadKind::Full,
        upright_ambiguous: false,
        alternates: vec![],
    };
    (GrayImage::new(640, 480, picture.into_iter().map(|g| g.round() as u8).collect()).unwrap(), quad)
}

fn facts(image: &GrayImage, quad: Quad, camera: Option<&Intrinsics>) -> QuadAnalysis {
    let sizes = BTreeMap::from([(LandmarkId(1), SIZE)]);
    let models = models();
    let landmarks = LandmarkDatabase { models: &models, sizes: &sizes, kind: DistanceKind::Both };
    let camera = FrameCamera::level(camera);
    analyse_quads(image, vec![quad], camera, landmarks, &Params::default(), &mut NoTrace).quads.remove(0)
}

fn assert_pose(facts: &QuadAnalysis) {
    let pose = facts.pose.as_ref().unwrap();
    let error = pose.best.camera_from_landmark.inverse() * camera_from_landmark();
    assert!(error.translation.vector.norm() < 1e-3 && error.rotation.angle() < 1e-3, "{error:?}");
}

#[test]
fn a_known_landmark_gives_its_pose() {
    let (image, quad) = scene(1);
    let facts = facts(&image, quad, Some(&camera()));
    assert_eq!(facts.recognition.as_ref().unwrap().verdict, Verdict::Unique(LandmarkId(1)));
    assert_pose(&facts);
}

/// From pixels alone: the poster is detected, identified and located to a few centimetres, and
/// every stage is reported.
#[test]
fn the_pipeline_identifies_and_locates_a_landmark_from_pixels() {
    #[derive(Default)]
    struct Stages(Vec<Stage>);
    impl Trace for Stages {
        fn finished(&mut self, stage: Stage) {
            self.0.push(stage);
        }
    }
    let (image, _) = scene(1);
    let (models, sizes) = (models(), BTreeMap::from([(LandmarkId(1), SIZE)]));
    let landmarks = LandmarkDatabase { models: &models, sizes: &sizes, kind: DistanceKind::Both };
    let mut stages = Stages::default();
    let camera = camera();
    let camera = FrameCamera::level(Some(&camera));
    let facts = Pipeline::default().analyse(&image, camera, landmarks, &Params::default(), &mut stages);
    let poses: Vec<_> = facts.quads.iter().filter_map(|q| q.pose.as_ref().ok()).collect();
    assert_eq!(poses.len(), 1, "{:?}", facts.quads);
    let error = poses[0].best.camera_from_landmark.inverse() * camera_from_landmark();
    assert!(error.translation.vector.norm() < 0.05 && error.rotation.angle() < 0.05, "{error:?}");
    for stage in Stage::ALL {
        assert_eq!(stages.0.iter().filter(|s| **s == stage).count(), 1, "{stage:?}");
    }
    assert!(stages.0.is_sorted());
}

#[test]
fn rotated_corners_are_returned_in_the_landmarks_order() {
    let (image, mut quad) = scene(1);
    quad.corners_px = quad.corners_px.rotated(3);
    quad.corner_covariance_px2 = std::array::from_fn(|i| Matrix2::identity() * (0.04 + 0.01 * i as f64));
    let camera = camera();
    let (models, sizes) = (models(), BTreeMap::from([(LandmarkId(1), SIZE)]));
    let landmarks = LandmarkDatabase { models: &models, sizes: &sizes, kind: DistanceKind::Both };
    let of = FrameCamera { intrinsics: Some(&camera), up: None, height_m: None };
    let facts = analyse_quads(&image, vec![quad.clone()], of, landmarks, &Params::default(), &mut NoTrace);
    let facts = &facts.quads[0];
    assert_pose(facts);
    let seen = matched_border(&quad, facts.recognition.as_ref().unwrap(), &Params::default()).unwrap();
    let border = BORDER_SIGMA_PX.powi(2);
    assert!(
        (seen.covariance_px2[0][(0, 0)] - 0.05 - border).abs() < 1e-12,
        "covariances are rotated with their corners"
    );
}

#[test]
fn a_recognised_inner_border_becomes_the_corners() {
    let (image, mut quad) = scene(1);
    let outer = quad
        .corners_px
        .points()
        .map(|c| Point2::from(c.coords * 1.35 - nalgebra::Vector2::new(319.5, 239.5) * 0.35));
    let (inner, outer) = (quad.corners_px, Corners::new(outer).unwrap());
    (quad.corners_px, quad.alternates) = (outer, vec![inner]);
    let facts = facts(&image, quad, Some(&camera()));
    assert_eq!((facts.quad.corners_px, &facts.quad.alternates[..]), (inner, &[outer][..]));
    assert_eq!(facts.recognition.as_ref().unwrap().border, 0);
    assert_pose(&facts);
}

/// A mat inside the frame was detected, the frame was taught: identity and distance must be right.
#[test]
fn a_detected_inner_border_gives_the_pose_of_the_taught_one() {
    let (image, mut quad) = scene(1);
    let centre = quad.corners_px.points().iter().fold(nalgebra::Vector2::zeros(), |m, c| m + c.coords * 0.25);
    let inner = quad.corners_px.points().map(|c| Point2::from(centre + (c.coords - centre) * 0.95));
    quad.corners_px = Corners::new(inner).unwrap();
    let facts = facts(&image, quad, Some(&camera()));
    assert_eq!(facts.recognition.as_ref().unwrap().verdict, Verdict::Unique(LandmarkId(1)));
    let pose = facts.pose.unwrap();
    let error = pose.best.camera_from_landmark.inverse() * camera_from_landmark();
    // With the detected border the landmark would be 5 % farther away: 10 cm.
    assert!(error.translation.vector.norm() < 0.03, "{error:?}");
    let sigma_m = pose.best.covariance[(5, 5)].sqrt();
    assert!(
        sigma_m > 3e-3,
        "an aligned corner has a larger standard deviation than a detected one: {sigma_m} m"
    );
}

#[test]
fn a_missing_pose_has_a_reason() {
    let (image, quad) = scene(1);
    assert_eq!(facts(&image, quad.clone(), None).pose, Err(PoseUnavailable::NoCamera));
    let (other, other_quad) = scene(2);
    assert_eq!(facts(&other, other_quad, Some(&camera())).pose, Err(PoseUnavailable::NoSize(LandmarkId(2))));
    let (distractor, distractor_quad) = scene(3);
    assert_eq!(facts(&distractor, distractor_quad, Some(&camera())).pose, Err(PoseUnavailable::NotUnique));
}

/// The fourth side of a three-sided quad is a guess: icons read from it do not count, points do.
#[test]
fn a_three_sided_quad_is_recognised_by_points_alone() {
    let (image, quad) = scene(1);
    let three_sided = Quad { kind: QuadKind::ThreeSided, ..quad };
    assert_pose(&facts(&image, three_sided.clone(), Some(&camera())));
    let without: Vec<_> =
        models().iter().map(|m| Arc::new(LandmarkModel::clone(m).with_points(&[]))).collect();
    let p = Params::default();
    let models = ModelSet::new(without, &p).unwrap();
    let (sizes, kind) = (BTreeMap::new(), DistanceKind::Both);
    let landmarks = LandmarkDatabase { models: &models, sizes: &sizes, kind };
    let of = |quad: &Quad| {
        let facts =
            analyse_quads(&image, vec![quad.clone()], FrameCamera::level(None), landmarks, &p, &mut NoTrace);
        facts.quads[0].recognition.clone()
    };
    assert!(of(&Quad { kind: QuadKind::Full, ..three_sided.clone() }).is_some());
    assert_eq!(of(&three_sided), None);
}

#[test]
fn the_number_of_recognised_quads_is_bounded() {
    let (image, quad) = scene(1);
    let quads = vec![quad; MAX_RECOGNISED_QUADS + 1];
    let (models, sizes) = (ModelSet::default(), BTreeMap::new());
    let landmarks = LandmarkDatabase { models: &models, sizes: &sizes, kind: DistanceKind::Both };
    let camera = FrameCamera::level(None);
    let facts = analyse_quads(&image, quads, camera, landmarks, &Params::default(), &mut NoTrace);
    let asked: Vec<bool> = facts.quads.iter().map(|q| q.recognition.is_some()).collect();
    assert_eq!(asked.iter().filter(|a| **a).count(), MAX_RECOGNISED_QUADS);
    assert!(!asked[MAX_RECOGNISED_QUADS]);
}

mod borderless;
mod rolled;

/// Only where tiling is removed, and only of a camera whose height and tilt are known.
#[test]
fn a_frame_brings_its_own_floor() {
    let (camera, paper) = (camera(), Preset::Paper.params().detect);
    let up =
        |tilt: f64, roll: f64| Vector3::new(tilt.cos() * roll.sin(), -tilt.cos() * roll.cos(), tilt.sin());
    let at =
        |up: Vector3<f64>| FrameCamera { intrinsics: Some(&camera), up: Up::new(up), height_m: Some(1.2) };
    let own = at(up(-0.2, 0.01)).above_its_floor(&paper, 640).and_then(|p| p.tiling.floor).unwrap();
    assert!((own.tilt_rad + 0.2).abs() < 1e-3, "{own:?}");
    assert_eq!((own.intrinsics, own.width_px, own.height_m), (camera, 640, 1.2));
    let level = at(up(0.0, 0.0));
    for unknown in [
        at(up(-0.2, 0.1)),
        FrameCamera { intrinsics: None, ..level },
        FrameCamera { up: None, ..level },
        FrameCamera { height_m: None, ..level },
    ] {
        assert_eq!(unknown.above_its_floor(&paper, 640), None);
    }
    let stated = level.above_its_floor(&paper, 640).unwrap();
    assert_eq!(level.above_its_floor(&stated, 640), None);
    assert_eq!(level.above_its_floor(&Params::default().detect, 640), None);
}
