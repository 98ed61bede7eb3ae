use super::*;
use crate::detect::{
    edges::maxima::BORDER_PX,
    tests::rendering::{flipped, polygon, quarter_turned, rectangle},
};
use crate::frame::GrayImage;

#[test]
fn a_step_between_two_pixels_lies_half_way() {
    let image = GrayImage::from_fn(40, 30, |u, _| if u < 20 { 50 } else { 150 });
    let map = edges(&image, &EdgeParams::default());
    assert_eq!(map.pixels().len(), 30 - 2 * BORDER_PX, "one pixel a row");
    for &at in map.pixels() {
        let p = map.position_px(at as usize);
        assert!((p.x - 19.5).abs() < 1e-3, "{p}");
        assert!((map.magnitude(at as usize) - 100.0).abs() < 0.01);
    }
}

/// Sub-pixel points of the map, rounded to a fiftieth of a pixel and sorted.
fn points(map: &EdgeMap) -> Vec<(i64, i64)> {
    points_through(map, |p| p)
}

fn points_through(map: &EdgeMap, f: impl Fn(Point2<f64>) -> Point2<f64>) -> Vec<(i64, i64)> {
    let fine = |x: f64| (x * 50.0).round() as i64;
    let mut all: Vec<_> = map
        .pixels()
        .iter()
        .map(|&at| f(map.position_px(at as usize)))
        .map(|p| (fine(p.x), fine(p.y)))
        .collect();
    all.sort_unstable();
    all
}

/// Share of the points of `a` with a point of `b` within a twenty-fifth of a pixel.
fn shared(a: &[(i64, i64)], b: &[(i64, i64)]) -> f64 {
    let near = |p: &&(i64, i64)| b.iter().any(|q| (p.0 - q.0).abs() <= 2 && (p.1 - q.1).abs() <= 2);
    a.iter().filter(near).count() as f64 / a.len() as f64
}

#[test]
fn symmetries_move_the_points_and_nothing_else() {
    let corners = rectangle((31.0, 24.0), (33.0, 21.0), 0.4);
    let image = polygon((64, 48), &corners, (170.0, 80.0), 3.0, 8);
    let p = EdgeParams::default();
    let map = edges(&image, &p);
    let expected = |f: &dyn Fn(Point2<f64>) -> Point2<f64>| points_through(&map, f);
    let cases = [
        (flipped(&image), expected(&|p| Point2::new(63.0 - p.x, p.y))),
        (quarter_turned(&image), expected(&|p| Point2::new(47.0 - p.y, p.x))),
        (
            GrayImage::from_fn(64, 48, |u, v| image.at(u.saturating_sub(3), v)),
            expected(&|p| Point2::new(p.x + 3.0, p.y)),
        ),
        (GrayImage::from_fn(64, 48, |u, v| image.at(u, v) + 17), expected(&|p| p)),
        (GrayImage::from_fn(64, 48, |u, v| 255 - image.at(u, v)), expected(&|p| p)),
    ];
    for (i, (image, expected)) in cases.iter().enumerate() {
        let found = points(&edges(image, &p));
        // Thinning may keep another pixel of a staircase.
        let share = shared(expected, &found).min(shared(&found, expected));
        assert!(share > 0.97, "symmetry {i}: {share:.3}");
    }
}

#[test]
fn contrast_scales_with_the_thresholds() {
    let corners = rectangle((31.0, 24.0), (33.0, 21.0), 0.4);
    let image = polygon((64, 48), &corners, (70.0, 40.0), 1.0, 8);
    let double = GrayImage::from_fn(64, 48, |u, v| 2 * image.at(u, v) + 5);
    let map = edges(&image, &EdgeParams::default());
    let p = EdgeParams::default();
    let doubled = edges(&double, &EdgeParams { low: 2.0 * p.low, high: 2.0 * p.high, ..p });
    assert_eq!(points(&map), points(&doubled));
}

#[test]
fn a_fading_edge_is_followed_both_ways() {
    // Step height 40 at one end, 2 at the other: kept down to the low threshold, whichever end is
    // up.
    let fading = |v: usize| 40.0 - 39.0 * v as f64 / 199.0;
    let image = |up: bool| {
        GrayImage::from_fn(40, 200, |u, v| {
            let step = fading(if up { v } else { 199 - v });
            (100.0 + if u < 20 { 0.0 } else { step }).round() as u8
        })
    };
    let p = EdgeParams::default();
    let (down, up) = (edges(&image(true), &p).pixels().len(), edges(&image(false), &p).pixels().len());
    let rows_above_low = (0..200).filter(|&v| fading(v) > f64::from(p.low)).count();
    assert_eq!(down, up);
    assert!(down.abs_diff(rows_above_low) <= 8, "{down} of {rows_above_low} rows");
    let high = EdgeParams { high: 45.0, ..p };
    assert!(edges(&image(true), &high).pixels().is_empty());
}

#[test]
fn flat_and_tiny_images_have_no_edges() {
    for (width, height) in [(1, 1), (1, 50), (50, 1), (4, 4), (5, 3), (64, 48)] {
        let map = edges(&GrayImage::from_fn(width, height, |_, _| 77), &EdgeParams::default());
        assert!(map.pixels().is_empty() && map.marks().len() == width * height);
        let noisy = GrayImage::from_fn(width, height, |u, v| ((u * 97 + v * 57) % 251) as u8);
        for &at in edges(&noisy, &EdgeParams::default()).pixels() {
            let (u, v) = (at as usize % width, at as usize / width);
            assert!(
                (BORDER_PX..width - BORDER_PX).contains(&u) && (BORDER_PX..height - BORDER_PX).contains(&v)
            );
        }
    }
}

fn within(image: &GrayImage, p: &EdgeParams, max_points: usize) -> EdgeMap {
    let mut map = EdgeMap::default();
    map.fill(Level::new(), image.into(), p, max_points);
    map
}

#[test]
fn the_strongest_points_are_kept_up_to_the_bound() {
    // Steps that grow to the right.
    let image = GrayImage::from_fn(80, 40, |u, _| (if u % 10 < 5 { 20 + u } else { 10 }) as u8);
    let p = EdgeParams::default();
    let all = within(&image, &p, usize::MAX).pixels().len();
    assert_eq!(within(&image, &p, all).pixels().len(), all);
    let half = within(&image, &p, all / 2);
    assert!(half.pixels().len() <= all / 2 && half.pixels().len() > all / 3);
    let weakest = half.pixels().iter().map(|&at| half.magnitude(at as usize)).fold(f32::INFINITY, f32::min);
    assert!(weakest > 40.0);
    assert!(within(&image, &p, 0).pixels().is_empty());
}

#[test]
fn thresholds_rise_with_the_noise() {
    // Flat apart from noise: its deviation is found, and no edge.
    let p = EdgeParams { low: 3.0, high: 8.0, noise_factors: [2.5, 6.0], ..EdgeParams::default() };
    for (sigma, seed) in [(2.0, 1), (4.0, 2), (8.0, 3)] {
        let image =
            polygon((160, 120), &rectangle((80.0, 60.0), (1.0, 1.0), 0.0), (100.0, 100.0), sigma, seed);
        let map = edges(&image, &p);
        let inner = (0..160 * 120).filter(|i| (8..152).contains(&(i % 160)) && (8..112).contains(&(i / 160)));
        let squares: Vec<f32> = inner.map(|i| map.gx()[i].powi(2)).collect();
        let deviation = (squares.iter().sum::<f32>() / squares.len() as f32).sqrt();
        assert!((map.noise() / deviation - 1.0).abs() < 0.15, "{} {deviation}", map.noise());
        assert!(map.pixels().len() < 20, "sigma {sigma}: {} edge pixels of noise", map.pixels().len());
        let bare = edges(&image, &EdgeParams { noise_factors: [0.0; 2], ..p.clone() });
        assert!(sigma < 8.0 || bare.pixels().len() > 100);
    }
}
