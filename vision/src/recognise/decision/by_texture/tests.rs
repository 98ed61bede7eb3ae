use super::*;
use crate::{
    geometry::homography::Homography,
    learn::{lesson::learn, synthesis::views, training_view::TrainingView},
    points::taught::view_points,
    recognise::fixture::poster,
};
use nalgebra::{Rotation2, Vector3};
use std::sync::Arc;

/// The middle of a drawn poster of 240 px: a landmark whose texture goes on beyond its border.
fn middle() -> Corners {
    corners([[50.0, 50.0], [190.0, 50.0], [190.0, 190.0], [50.0, 190.0]])
}

/// The middles of posters 1 to `count` as landmarks of the same numbers.
fn map(count: u64, p: &Params) -> ModelSet {
    let model = |seed| {
        let image = poster(seed);
        let mut lesson = vec![TrainingView::photographed(&image, &middle(), p).unwrap()];
        lesson.extend(views(&image, &middle(), 12, p, seed));
        let points = view_points(&image, &middle());
        Arc::new(learn(LandmarkId(seed), &lesson, &[], p).unwrap().with_points(&[points]))
    };
    ModelSet::new((1..=count).map(model).collect(), p).unwrap()
}

/// A frame of 640 x 480 with whole posters on a plain wall; their middles have the given corners.
fn frame(posters: &[(u64, Corners)]) -> GrayImage {
    let drawn = |(seed, at): &(u64, Corners)| {
        (poster(*seed), Homography::from_points(at.points(), middle().points()).unwrap())
    };
    let posters: Vec<(GrayImage, Homography)> = posters.iter().map(drawn).collect();
    let grey = |at: &Point2<f64>| {
        let on = |(poster, map): &(GrayImage, Homography)| {
            let p = map.apply(at);
            let is_on = map.denominator(at) > 0.0 && p.iter().all(|x| (0.0..=239.0).contains(x));
            is_on.then(|| f64::from(poster.sample(p.x, p.y)))
        };
        posters.iter().find_map(on).unwrap_or(150.0)
    };
    GrayImage::from_fn(640, 480, |u, v| {
        let part = |i: usize| {
            let (du, dv) = ((i % 3) as f64 / 3.0 - 1.0 / 3.0, (i / 3) as f64 / 3.0 - 1.0 / 3.0);
            grey(&Point2::new(u as f64 + du, v as f64 + dv)) / 9.0
        };
        (0..9).map(part).sum::<f64>().round() as u8
    })
}

fn corners(points: [[f64; 2]; 4]) -> Corners {
    Corners::try_from(points).unwrap()
}

fn slanted() -> Corners {
    corners([[250.0, 130.0], [390.0, 150.0], [392.0, 330.0], [252.0, 352.0]])
}

/// The corners turned by `roll_rad` about the centre of a frame of 640 x 480.
fn rolled(at: &Corners, roll_rad: f64) -> Corners {
    let centre = Point2::new(319.5, 239.5);
    let turned = at.points().map(|p| centre + Rotation2::new(roll_rad) * (p - centre));
    Corners::new(turned).unwrap()
}

fn found(image: &GrayImage, up: Option<&Up>, models: &ModelSet) -> Vec<(Quad, RecognitionResult)> {
    by_texture(image, &[], (up, None), models, &Params::default())
}

fn assert_found(found: &[(Quad, RecognitionResult)], id: u64, at: &Corners) {
    let [(quad, verdict)] = found else { panic!("{} found", found.len()) };
    assert_eq!((quad.kind, verdict.verdict), (QuadKind::Texture, Verdict::Unique(LandmarkId(id))));
    let off_px = quad.corners_px.rotated(verdict.rotation).furthest_px(at);
    assert!(
        off_px < 1.0,
        "{off_px} px, {:?}: {:?} for {at:?}",
        verdict.points.as_ref().unwrap().found_by,
        quad.corners_px
    );
    let sigma_px = quad.corner_covariance_px2.map(|c| c.trace().sqrt());
    assert!(sigma_px.iter().all(|s| (0.05..4.0).contains(s)), "{sigma_px:?}");
}

#[test]
fn a_landmark_without_a_visible_border_is_found_with_its_corners() {
    let p = Params::default();
    let models = map(4, &p);
    let image = frame(&[(3, slanted())]);
    assert_found(&found(&image, Some(&Up::level()), &models), 3, &slanted());
}

#[test]
fn an_unknown_picture_without_a_border_has_no_name() {
    let models = map(4, &Params::default());
    for seed in 11..15 {
        let image = frame(&[(seed, slanted())]);
        assert_eq!(found(&image, None, &models), [], "{seed}");
    }
}

#[test]
fn a_rolled_camera_finds_the_same() {
    let models = map(3, &Params::default());
    for roll_deg in [30.0_f64, 90.0, -120.0, 180.0] {
        let roll_rad = roll_deg.to_radians();
        let at = rolled(&slanted(), roll_rad);
        let image = frame(&[(2, at)]);
        // Up turns with the picture.
        let up = Up::new(Vector3::new(roll_rad.sin(), -roll_rad.cos(), 0.0));
        assert_found(&found(&image, up.as_ref(), &models), 2, &at);
        if roll_deg > 80.0 {
            assert_found(&found(&image, None, &models), 2, &at);
        }
    }
}

#[test]
fn a_landmark_that_has_a_name_is_not_found_again() {
    let p = Params::default();
    let models = map(3, &p);
    let image = frame(&[(1, slanted())]);
    let up = Up::level();
    let elsewhere = corners([[10.0, 10.0], [60.0, 10.0], [60.0, 60.0], [10.0, 60.0]]);
    let beside =
        |named: &[(LandmarkId, Corners)]| by_texture(&image, named, (Some(&up), None), &models, &p).len();
    assert_eq!(beside(&[]), 1);
    assert_eq!(beside(&[(LandmarkId(1), elsewhere)]), 0, "by its name");
    assert_eq!(beside(&[(LandmarkId(2), slanted())]), 0, "by its place");
    assert_eq!(beside(&[(LandmarkId(2), elsewhere)]), 1);
}

#[test]
fn at_most_so_many_places_are_asked() {
    let models = map(5, &Params::default());
    let at = |i: usize| {
        let (x, y) = (45.0 + 212.0 * (i % 3) as f64, 50.0 + 235.0 * (i / 3) as f64);
        corners([[x, y], [x + 122.0, y], [x + 122.0, y + 135.0], [x, y + 135.0]])
    };
    let posters: Vec<(u64, Corners)> = (0..5).map(|i| (i as u64 + 1, at(i))).collect();
    let image = frame(&posters);
    assert_eq!(found(&image, Some(&Up::level()), &models).len(), MAX_PLACES);
}

#[test]
fn a_landmark_cut_by_the_image_is_found_with_corners_outside() {
    let models = map(3, &Params::default());
    let at = corners([[-60.0, 120.0], [150.0, 120.0], [150.0, 340.0], [-60.0, 340.0]]);
    let found = found(&frame(&[(2, at)]), Some(&Up::level()), &models);
    let [(quad, verdict)] = found.as_slice() else { panic!("{} found", found.len()) };
    assert_eq!(verdict.verdict, Verdict::Unique(LandmarkId(2)));
    assert_eq!(quad.side_clipped, [true, false, true, true]);
    assert!(quad.corners_px.rotated(verdict.rotation).furthest_px(&at) < 6.0, "{:?}", quad.corners_px);
}
