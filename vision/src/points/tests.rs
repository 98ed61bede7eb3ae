use super::*;
use crate::{
    frame::GrayImage,
    geometry::corners::Corners,
    points::{
        agreement::Part,
        descriptor::MAX_DISTANCE,
        evidence::log10_tail,
        index::PointIndex,
        patch::Patch,
        plain::distance_to_plain,
        point::SeenPatch,
        taught::{MAX_LANDMARK_POINTS, POINT_BYTES, TaughtPoint, landmark_points, view_points},
        verify::verify_at,
    },
    recognise::fixture::{oblique, photograph, poster, whole},
};
use nalgebra::Point2;

fn taught(seed: u64) -> Vec<TaughtPoint> {
    landmark_points(&[view_points(&poster(seed), &whole())])
}

/// The corners moved by a few pixels, as errors of a prediction.
fn predicted() -> Corners {
    let off = [[3.0, -2.0], [-3.0, 2.0], [2.0, 3.0], [-2.0, -3.0]];
    let moved: Vec<Point2<f64>> =
        oblique().points().iter().zip(off).map(|(p, [x, y])| Point2::new(p.x + x, p.y + y)).collect();
    Corners::new([moved[0], moved[1], moved[2], moved[3]]).unwrap()
}

#[test]
fn only_the_expected_landmark_is_verified() {
    let image = photograph(&poster(1), &oblique(), 0.8, 20.0);
    let found = verify_at(&image, &taught(1), &predicted()).unwrap();
    assert!(found.log10_nfa < -15.0 && found.inliers >= 10, "{found:?}");
    for (a, b) in found.corners_px.points().iter().zip(oblique().points()) {
        assert!((a - b).norm() < 2.0, "{a} for {b}");
    }
    assert!(found.agreement.largest_disagreement() < 2, "{:?}", found.agreement);
    for seed in 2..8 {
        let other = verify_at(&image, &taught(seed), &predicted());
        assert!(other.is_none_or(|o| o.log10_nfa > -3.0), "poster {seed}");
    }
}

#[test]
fn a_replaced_part_disagrees_and_a_covered_part_is_silent() {
    let image = photograph(&poster(1), &oblique(), 1.0, 0.0);
    let other = photograph(&poster(5), &oblique(), 1.0, 0.0);
    let part = |u: usize, v: usize| u > 210 && v > 200;
    let replaced =
        GrayImage::from_fn(400, 400, |u, v| if part(u, v) { other.at(u, v) } else { image.at(u, v) });
    let covered = GrayImage::from_fn(400, 400, |u, v| if part(u, v) { 128 } else { image.at(u, v) });
    let table = |image: &GrayImage| verify_at(image, &taught(1), &oblique()).unwrap().agreement;
    let (of_replaced, of_covered) = (table(&replaced), table(&covered));
    assert!(of_replaced.count(Part::Disagrees) >= 2, "{of_replaced:?}");
    assert!(of_replaced.0[0][0] != Part::Disagrees, "{of_replaced:?}");
    assert!(of_covered.count(Part::Disagrees) < of_replaced.count(Part::Disagrees), "{of_covered:?}");
}

#[test]
fn votes_find_the_landmark() {
    let models: Vec<Vec<TaughtPoint>> = (1..9).map(taught).collect();
    let index = PointIndex::new(models.iter().map(Vec::as_slice));
    for seed in [1_u64, 4, 8] {
        let image = photograph(&poster(seed), &oblique(), 0.9, 10.0);
        let patch = Patch::new(&image, &oblique(), patch::INNER_PX[0]).unwrap();
        let seen = SeenPatch::new(patch, verify::MAX_PATCH_POINTS);
        let votes = index.vote(&seen.points, 3, 1);
        assert_eq!(votes[0].0 as u64 + 1, seed, "{votes:?}");
        assert!(votes.len() <= 3 && votes[0].1 > 2 * votes[1].1, "{votes:?}");
    }
    assert!(PointIndex::default().vote(&[], 3, 1).is_empty());
}

#[test]
fn the_number_of_points_is_bounded_and_stored_points_are_exact() {
    let views: Vec<Vec<TaughtPoint>> = (1..7).map(|seed| view_points(&poster(seed), &whole())).collect();
    let points = landmark_points(&views);
    assert!(points.len() <= MAX_LANDMARK_POINTS && points.len() > 100, "{}", points.len());
    // A repeated view adds no points.
    let twice = landmark_points(&[views[0].clone(), views[0].clone()]);
    assert!(twice.len() <= views[0].len());
    for point in points {
        let mut bytes = Vec::new();
        point.write(&mut bytes);
        assert_eq!(TaughtPoint::read(bytes.as_slice().try_into().unwrap()), point);
        assert_eq!(bytes.len(), POINT_BYTES);
        assert!(point.plain() > 45);
    }
}

#[test]
fn rotated_descriptors_equal_those_of_the_rotated_patch() {
    let n = 160;
    let picture = poster(3);
    let upright = GrayImage::from_fn(n, n, |u, v| picture.at(u, v));
    // `Corners::rotated(1)` names the top-right corner top-left.
    let high = n as f64 - 0.5;
    let corners = Corners::try_from([[-0.5, -0.5], [high, -0.5], [high, high], [-0.5, high]]).unwrap();
    let of = |c: &Corners| SeenPatch::new(Patch::new(&upright, c, patch::INNER_PX[0]).unwrap(), 60).points;
    for turn in 1..4 {
        let (turned, expected) =
            (of(&corners).into_iter().map(|p| p.rotated(turn)), of(&corners.rotated(turn)));
        let mut together = 0;
        for point in turned {
            let near = expected.iter().filter(|e| (0..2).all(|i| (e.at[i] - point.at[i]).abs() < 0.01));
            together += usize::from(
                near.map(|e| e.descriptor.distance(&point.descriptor)).min().is_some_and(|d| d < 40),
            );
        }
        // Octaves drop every second pixel from one side, so that coarse points differ.
        assert!(together > 30, "turn {turn}: {together} of 60");
    }
}

#[test]
fn edges_and_right_angles_are_plain_and_textures_are_not() {
    let frame = GrayImage::from_fn(240, 240, |u, v| {
        let depth = u.min(v).min(239 - u).min(239 - v);
        if depth < 60 { 60 } else { 190 }
    });
    let distances = |image: &GrayImage| -> Vec<u32> {
        let patch = Patch::new(image, &whole(), patch::INNER_PX[0]).unwrap();
        SeenPatch::new(patch, 250).points.iter().map(|p| distance_to_plain(&p.descriptor)).collect()
    };
    assert!(distances(&frame).iter().all(|d| *d < 46), "{:?}", distances(&frame));
    let texture = distances(&poster(2));
    let beyond = texture.iter().filter(|d| **d >= 46).count();
    assert!(2 * beyond > texture.len() && texture.iter().all(|d| *d <= MAX_DISTANCE), "{texture:?}");
    assert!(view_points(&frame, &whole()).is_empty());
}

/// Smaller patches add points that the largest one does not have, and no coarse ones.
#[test]
fn points_of_smaller_patches_are_taught() {
    let of_patch =
        |inner: usize| SeenPatch::new(Patch::new(&poster(2), &whole(), inner).unwrap(), 400).points;
    let largest = of_patch(patch::INNER_PX[0]);
    let added: Vec<_> = view_points(&poster(2), &whole())
        .into_iter()
        .filter(|t| largest.iter().all(|p| p.descriptor != t.descriptor))
        .collect();
    assert!(added.len() >= 10, "{}", added.len());
    let finest = patch::INNER_PX[2] as f32;
    assert!(added.iter().all(|t| t.point().sigma * finest < 5.2), "no point sees a whole frame");
    let small = of_patch(patch::INNER_PX[2]);
    assert!(added.iter().any(|t| small.iter().any(|p| p.descriptor == t.descriptor)));
}

#[test]
fn binomial_tails_by_hand() {
    // By hand: 1 - 0.9^3; 3 * 0.01 * 0.9 + 0.001.
    assert!((log10_tail(3, 1, 0.1) - 0.271_f64.log10()).abs() < 1e-12);
    assert!((log10_tail(3, 2, 0.1) - 0.028_f64.log10()).abs() < 1e-12);
    assert!(log10_tail(5, 0, 0.1).abs() < 1e-15 && log10_tail(3, 4, 0.1) < -1e300);
    for k in 1..40 {
        assert!(log10_tail(40, k + 1, 0.05) < log10_tail(40, k, 0.05));
    }
}
