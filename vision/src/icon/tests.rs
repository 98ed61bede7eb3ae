//! Icons against supersampling, symmetry and every refusal.

use super::*;
use proptest::prelude::*;

fn corners(c: [[f64; 2]; 4]) -> Corners {
    Corners::try_from(c).unwrap()
}

/// Smooth texture of a plane point (x, y), no detail finer than about 12 px.
fn texture(x: f64, y: f64) -> f64 {
    128.0 + 60.0 * (x * 0.11).sin() * (y * 0.07).cos() + 40.0 * ((x + 2.0 * y) * 0.05).sin()
}

fn textured(width: usize, height: usize) -> GrayImage {
    GrayImage::from_fn(width, height, |u, v| texture(u as f64, v as f64).round() as u8)
}

/// Reference: 16 x 16 samples of a continuous picture in every cell.
fn supersampled(at: impl Fn(f64, f64) -> f64, corners: &Corners, size: usize) -> Vec<f64> {
    let map = Homography::square_to_quad(size, corners).unwrap();
    (0..size * size)
        .map(|i| {
            let mut sum = 0.0;
            for s in 0..256 {
                let da = f64::from(s % 16) / 16.0 - 15.0 / 32.0;
                let db = f64::from(s / 16) / 16.0 - 15.0 / 32.0;
                let px = map.apply(&Point2::new((i % size) as f64 + da, (i / size) as f64 + db));
                sum += at(px.x, px.y);
            }
            sum / 256.0
        })
        .collect()
}

#[test]
fn constant_image_gives_constant_icon() {
    let image = GrayImage::from_fn(200, 160, |_, _| 77);
    let quad = corners([[20.0, 10.0], [180.0, 30.0], [170.0, 150.0], [30.0, 130.0]]);
    let icon = icon(&image, &quad, &IconParams::default()).unwrap();
    assert!(icon.pixels.iter().all(|g| (g - 77.0).abs() < 1e-3));
    assert_eq!(icon.pixels.len(), 75 * 75);
}

#[test]
fn ramp_equals_supersampling_within_a_grey_level() {
    let ramp = |u: f64, v: f64| 20.0 + 0.3 * u + 0.2 * v;
    let image = GrayImage::from_fn(400, 400, |u, v| ramp(u as f64, v as f64).round() as u8);
    let p = IconParams { min_side_ratio: 0.0, ..IconParams::default() };
    // Magnified, about 1:1, about 2:1 and 4:1.
    for side in [40.0, 80.0, 150.0, 320.0] {
        let quad = corners([
            [30.3, 40.2],
            [30.0 + side, 35.0],
            [25.0 + side, 30.0 + side],
            [33.0, 33.0 + 0.8 * side],
        ]);
        let icon = icon(&image, &quad, &p).unwrap();
        let expected = supersampled(ramp, &quad, 75);
        let worst =
            icon.pixels.iter().zip(&expected).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1.0, "side {side}: {worst}");
    }
}

#[test]
fn texture_equals_supersampling_at_every_scale() {
    let image = textured(500, 500);
    let p = IconParams { min_side_ratio: 0.0, ..IconParams::default() };
    for side in [45.0, 80.0, 150.0, 400.0] {
        let quad = corners([
            [40.0, 30.0],
            [40.0 + side, 45.0],
            [30.0 + side, 30.0 + side],
            [48.0, 20.0 + 0.9 * side],
        ]);
        let icon = icon(&image, &quad, &p).unwrap();
        let expected = supersampled(texture, &quad, 75);
        let rms = (icon.pixels.iter().zip(&expected).map(|(a, b)| (f64::from(*a) - b).powi(2)).sum::<f64>()
            / 5625.0)
            .sqrt();
        assert!(rms < 1.5, "side {side}: {rms}");
        let scale = quad.area_px2().sqrt() / 75.0;
        assert!((icon.source_scale - scale).abs() < 1e-12);
    }
}

#[test]
fn rotated_equals_the_icon_of_rotated_corners() {
    let image = textured(300, 300);
    let quad = corners([[40.0, 30.0], [240.0, 45.0], [230.0, 250.0], [48.0, 220.0]]);
    let p = IconParams::default();
    let upright = icon(&image, &quad, &p).unwrap();
    for shift in 0..5 {
        let turned = icon(&image, &quad.rotated(shift), &p).unwrap();
        let ours = upright.rotated(shift);
        let close = ours.pixels.iter().zip(&turned.pixels).filter(|(a, b)| (**a - **b).abs() < 0.5);
        // A pixel centre on the very border of a cell may change sides.
        assert!(close.count() > 5600, "shift {shift}");
    }
    assert_eq!(upright.rotated(1).rotated(3), upright);
    let image = GrayImage::from_fn(100, 100, |u, _| if u < 50 { 0 } else { 200 });
    let halves =
        icon(&image, &corners([[10.0, 10.0], [90.0, 10.0], [90.0, 90.0], [10.0, 90.0]]), &p).unwrap();
    // With TR named top-left, the bright right half comes to lie on top.
    assert!(halves.rotated(1).pixels[37] > 190.0 && halves.rotated(1).pixels[74 * 75 + 37] < 10.0);
}

#[test]
fn sizes_and_shares_outside_the_limits_are_refused() {
    let image = textured(100, 100);
    let p = IconParams::default();
    let square = |a: f64, side: f64| corners([[a, a], [a + side, a], [a + side, a + side], [a, a + side]]);
    assert!(icon(&image, &square(10.0, 37.5), &p).is_ok());
    assert!(matches!(icon(&image, &square(10.0, 37.4), &p), Err(IconError::TooSmall { .. })));
    // One of 75 rows and columns outside is 2.6 % of the cells; none while the corner cells are
    // inside.
    assert!(icon(&image, &square(-0.5, 75.0), &p).is_ok());
    assert!(matches!(icon(&image, &square(-1.6, 75.0), &p), Err(IconError::Outside { .. })));
    for (size, good) in [(19, false), (20, true), (200, true), (201, false)] {
        let p = IconParams { size, min_side_ratio: 0.0, ..IconParams::default() };
        assert_eq!(icon(&image, &square(5.0, 80.0), &p).is_ok(), good, "{size}");
    }
}

#[test]
fn icons_from_external_data_are_checked() {
    assert!(Icon::new(20, vec![0.0; 400], 1.0).is_ok());
    assert_eq!(Icon::new(19, vec![0.0; 361], 1.0), Err(IconError::Size { size: 19 }));
    assert_eq!(Icon::new(20, vec![0.0; 399], 1.0), Err(IconError::Malformed { field: "pixels" }));
    for bad in [f32::NAN, -0.1, 255.1] {
        assert_eq!(Icon::new(20, vec![bad; 400], 1.0), Err(IconError::Malformed { field: "pixels" }));
    }
    assert_eq!(Icon::new(20, vec![9.0; 400], 0.0), Err(IconError::Malformed { field: "source_scale" }));
}

proptest! {
    #[test]
    fn never_panics(c in proptest::array::uniform8(-1e3..1e3_f64), far in prop_oneof![Just(1.0), Just(1e6)]) {
        let image = textured(64, 48);
        let quad = Corners::from_unordered([[c[0], c[1]], [c[2], c[3]], [c[4], c[5]], [c[6], c[7]]]
            .map(|[x, y]| Point2::new(x * far, y * far)));
        if let Ok(quad) = quad {
            let p = IconParams { max_outside: 1.0, ..IconParams::default() };
            if let Ok(icon) = icon(&image, &quad, &p) {
                prop_assert!(icon.pixels.iter().all(|g| (0.0..=255.0).contains(g)));
            }
        }
    }
}
