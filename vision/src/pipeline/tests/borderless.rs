//! A part of a wall painting is the landmark: no edge is at its border. It is found by its texture,
//! marked as such, and has a pose.

use super::*;

/// The landmark's corners in the painting.
fn part() -> Corners {
    Corners::try_from([[250.0, 200.0], [550.0, 200.0], [550.0, 600.0], [250.0, 600.0]]).unwrap()
}

/// A painting of 800 x 800 px.
fn painting() -> GrayImage {
    let mut random = Random::new(5);
    let mut patch = || {
        let (x, y) = (random.range(0.0, 800.0), random.range(0.0, 800.0));
        [x, y, random.range(8.0, 45.0), random.range(10.0, 245.0)]
    };
    let patches: Vec<[f64; 4]> = (0..260).map(|_| patch()).collect();
    GrayImage::from_fn(800, 800, |u, v| {
        let (u, v) = (u as f64, v as f64);
        let top = patches.iter().rev().find(|[x, y, r, _]| (u - x).hypot(v - y) < *r);
        top.map_or(128.0, |p| p[3]) as u8
    })
}

/// The wall as the camera sees it, and the landmark's true corners.
fn wall() -> (GrayImage, Corners) {
    let (_, quad) = scene(1);
    let painting = painting();
    let painting_from_image = Homography::from_points(quad.corners_px.points(), part().points()).unwrap();
    let image = GrayImage::from_fn(640, 480, |u, v| {
        let part = |i: usize| {
            let (du, dv) = ((i % 3) as f64 / 3.0 - 1.0 / 3.0, (i / 3) as f64 / 3.0 - 1.0 / 3.0);
            let at = painting_from_image.apply(&Point2::new(u as f64 + du, v as f64 + dv));
            f64::from(painting.sample(at.x, at.y)) / 9.0
        };
        (0..9).map(part).sum::<f64>().round() as u8
    });
    (image, quad.corners_px)
}

fn map_of_the_part() -> ModelSet {
    let p = Params::default();
    let views = synthesis::views(&painting(), &part(), 20, &p, 1);
    let points = view_points(&painting(), &part());
    let model = learn(LandmarkId(1), &views, &[], &p).unwrap().with_points(&[points]);
    ModelSet::new(vec![Arc::new(model)], &p).unwrap()
}

/// The quads with a name.
fn named(image: &GrayImage, up: Option<Up>, p: &Params) -> Vec<QuadAnalysis> {
    let (models, sizes) = (map_of_the_part(), BTreeMap::from([(LandmarkId(1), SIZE)]));
    let landmarks = LandmarkDatabase { models: &models, sizes: &sizes, kind: DistanceKind::Both };
    let intrinsics = camera();
    let camera = FrameCamera { intrinsics: Some(&intrinsics), up, height_m: None };
    let facts = Pipeline::default().analyse(image, camera, landmarks, p, &mut NoTrace);
    let is_unique =
        |q: &QuadAnalysis| q.recognition.as_ref().is_some_and(|v| matches!(v.verdict, Verdict::Unique(_)));
    facts.quads.into_iter().filter(is_unique).collect()
}

fn searching(search: bool, enough: usize) -> Params {
    let mut p = Params::default();
    (p.recognise.texture.search, p.recognise.texture.enough) = (search, enough);
    p
}

#[test]
fn a_landmark_without_a_border_is_named_and_located_by_its_texture() {
    let (image, corners_px) = wall();
    assert_eq!(named(&image, Some(Up::level()), &Params::default()), [], "no quad shows it, and it is off");
    let found = named(&image, Some(Up::level()), &searching(true, 2));
    let [quad] = found.as_slice() else { panic!("{} found", found.len()) };
    assert_eq!(quad.quad.kind, QuadKind::Texture);
    assert_eq!(quad.recognition.as_ref().unwrap().verdict, Verdict::Unique(LandmarkId(1)));
    let off_px = quad.border_px.unwrap().furthest_px(&corners_px);
    assert!(off_px < 2.0, "{off_px} px");
    let pose = &quad.pose.as_ref().unwrap().best;
    let off = pose.camera_from_landmark.translation.vector - camera_from_landmark().translation.vector;
    let stated = pose.covariance.fixed_view::<3, 3>(3, 3).into_owned();
    let nees = off.dot(&stated.cholesky().unwrap().solve(&off));
    // 99.9 % of chi2 with three degrees of freedom; and not so wide that it says nothing.
    assert!(nees < 16.3, "{nees}: {off:?} of {stated}");
    assert!(off.norm() < 0.06 && stated.trace().sqrt() < 0.1, "{off:?} of {stated}");
}

#[test]
fn its_border_is_that_of_the_points_and_no_detected_one() {
    let (image, _) = wall();
    let found = named(&image, Some(Up::level()), &searching(true, 2));
    let verdict = found[0].recognition.as_ref().unwrap();
    let seen = matched_border(&found[0].quad, verdict, &Params::default()).unwrap();
    assert_eq!(seen, verdict.points.as_ref().unwrap().border());
}

#[test]
fn texture_is_searched_only_while_no_pose_is_supported() {
    let (image, _) = wall();
    let count = |up, p: &Params| named(&image, up, p).len();
    assert_eq!(count(Some(Up::level()), &searching(true, 0)), 0, "enough have a name");
    assert_eq!(count(Some(Up::level()), &searching(true, 1)), 1);
    assert_eq!(count(None, &searching(true, 0)), 1, "no mounting, no pose of a robot");
    let mut without_points = searching(true, 2);
    without_points.recognise.verdict.points = false;
    assert_eq!(count(None, &without_points), 0, "points do not decide");
}
