use super::*;
use crate::random::Random;

/// Discs of random grey levels all over a frame.
fn discs(width: usize, height: usize, count: usize) -> GrayImage {
    let mut random = Random::new(7);
    let discs: Vec<[f64; 4]> = (0..count)
        .map(|_| {
            let (x, y) = (random.range(0.0, width as f64), random.range(0.0, height as f64));
            [x, y, random.range(2.0, 7.0), random.range(0.0, 255.0)]
        })
        .collect();
    GrayImage::from_fn(width, height, |u, v| {
        let is_on = |d: &&[f64; 4]| (u as f64 - d[0]).hypot(v as f64 - d[1]) < d[2];
        discs.iter().rev().find(is_on).map_or(128.0, |d| d[3]) as u8
    })
}

#[test]
fn a_rich_frame_has_no_more_points_than_the_budget() {
    let frame = frame_points(&discs(640, 480, 2500), 0.0, &[]).unwrap();
    let mut places: Vec<[u32; 2]> = frame.points.iter().map(|p| p.at_px.map(f32::to_bits)).collect();
    places.dedup();
    // A few are plain in every shape.
    let used = MAX_FRAME_POINTS - 20..=MAX_FRAME_POINTS;
    assert!(used.contains(&places.len()), "the budget is used, and no more: {}", places.len());
    assert!(frame.points.len() <= MAX_DESCRIBED && frame.points.len() > MAX_FRAME_POINTS);
    // All over the frame.
    let is_in = |p: &&FramePoint, x: f32, y: f32| (p.at_px[0] >= x) && (p.at_px[1] >= y);
    let last = frame.points.iter().filter(|p| is_in(p, 480.0, 360.0)).count();
    assert!(last * 16 > frame.points.len() / 2, "{last} of {}", frame.points.len());
}

#[test]
fn what_is_explained_has_no_points() {
    let image = discs(320, 240, 300);
    let border = Corners::try_from([[100.0, 50.0], [220.0, 60.0], [210.0, 180.0], [90.0, 170.0]]).unwrap();
    let inside = |frame: &FramePoints| {
        let is_in =
            |p: &&FramePoint| contains(border.points(), &frame.to_image(p.at_px.map(f64::from), 0), 0.0);
        frame.points.iter().filter(is_in).count()
    };
    let (all, rest) =
        (frame_points(&image, 0.0, &[]).unwrap(), frame_points(&image, 0.0, &[border]).unwrap());
    assert!(inside(&all) > 20);
    assert_eq!(inside(&rest), 0);
    assert!(!rest.points.is_empty());
}

#[test]
fn places_of_a_turned_rolled_and_reduced_frame_are_those_of_the_image() {
    let image = discs(1280, 960, 400);
    for roll_rad in [0.0, 0.4, -0.7] {
        let frame = frame_points(&image, roll_rad, &[]).unwrap();
        for point in frame.points.iter().step_by(40) {
            let at = point.at_px.map(f64::from);
            let here = frame.to_image(at, 0);
            assert!((-1.0..1281.0).contains(&here.x) && (-1.0..961.0).contains(&here.y), "{here}");
            for shift in 1..4 {
                let back = frame.to_image(frame.turned_at(at, shift), shift);
                assert!((back - here).norm() < 1e-6, "{roll_rad} {shift}");
            }
        }
    }
}

/// Of two discs, one below the other in the image, each is found, and the second is where the roll
/// says.
#[test]
fn a_rolled_frame_is_turned_back() {
    let (roll_rad, at, below) = (0.5_f64, Point2::new(200.0, 90.0), Point2::new(200.0, 150.0));
    let is_on = |p: Point2<f64>| (p - at).norm().min((p - below).norm()) < 6.0;
    let grey = |u, v| if is_on(Point2::new(u as f64, v as f64)) { 220 } else { 40 };
    let frame = frame_points(&GrayImage::from_fn(320, 240, grey), roll_rad, &[]).unwrap();
    assert!(frame.size_px[0] > 320 && frame.size_px[1] > 240);
    let nearest = |wanted: Point2<f64>| {
        let off = |p: &FramePoint| (frame.to_image(p.at_px.map(f64::from), 0) - wanted).norm();
        let found = frame.points.iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
        assert!(off(found) < 1.5, "{}", off(found));
        found.at_px.map(f64::from)
    };
    let ([x, y], [u, v]) = (nearest(at), nearest(below));
    assert!((u - x - 60.0 * roll_rad.sin()).abs() < 2.0 && (v - y - 60.0 * roll_rad.cos()).abs() < 2.0);
}
