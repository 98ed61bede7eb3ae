use super::*;
use crate::{detect::tests::rendering::Noise, frame::GrayImage};
use nalgebra::Vector2;

/// Size of the pictures; edges pass near the middle.
const SIDE_PX: usize = 64;
const MIDDLE_PX: f64 = 31.0;

/// The integral of the normal distribution, to 1e-7 (Abramowitz and Stegun 7.1.26).
fn normal_integral(x: f64) -> f64 {
    let z = x.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * z);
    let c = [1.061_405_429, -1.453_152_027, 1.421_413_741, -0.284_496_736, 0.254_829_592];
    let tail = 0.5 * c.iter().fold(0.0, |sum, c| (sum + c) * t) * (-z * z).exp();
    if x < 0.0 { tail } else { 1.0 - tail }
}

/// A straight edge of 80 levels, `shift` from the middle along `normal`, blurred like a lens does
/// and then averaged over the pixels.
fn picture(normal: Vector2<f64>, shift: f64, blur_px: f64, sigma: f64, noise: &mut Noise) -> GrayImage {
    GrayImage::from_fn(SIDE_PX, SIDE_PX, |u, v| {
        let offset = |i: usize| (i as f64 + 0.5) / 4.0 - 0.5 - MIDDLE_PX;
        let distance =
            |i: usize| normal.dot(&Vector2::new(u as f64 + offset(i % 4), v as f64 + offset(i / 4))) - shift;
        let level = (0..16).map(|i| normal_integral(distance(i) / blur_px)).sum::<f64>() / 16.0;
        (60.0 + 80.0 * level + sigma * noise.gaussian()).round() as u8
    })
}

/// Distances of the edge points from their true line, one list a picture, over many directions and
/// sub-pixel shifts.
fn distances(blur_px: f64, sigma: f64) -> Vec<Vec<f64>> {
    let mut noise = Noise(3);
    let mut all = vec![];
    // The main directions, where all points of a side have the same fraction of a pixel, and
    // others.
    let degrees =
        (0..8).map(|i| 45.0 * f64::from(i)).chain((0..13).map(|i| f64::from(i) * 360.0 / 13.0 + 4.0));
    for angle in degrees.map(f64::to_radians) {
        let normal = Vector2::new(angle.cos(), angle.sin());
        for shift in (0..8).map(|i| f64::from(i) / 8.0 - 0.5) {
            let map = edges(&picture(normal, shift, blur_px, sigma, &mut noise), &EdgeParams::default());
            let inner = |p: &Point2<f64>| [p.x, p.y].iter().all(|x| (8.0..SIDE_PX as f64 - 9.0).contains(x));
            let points = map.pixels().iter().map(|at| map.position_px(*at as usize)).filter(inner);
            let from_line = points.map(|p| normal.dot(&p.coords.add_scalar(-MIDDLE_PX)) - shift);
            all.push(from_line.filter(|d| d.abs() < 2.0).collect());
        }
    }
    all
}

#[test]
fn edge_points_have_no_bias_at_any_angle_shift_blur_and_noise() {
    // Noise in grey levels and blur in px; then, in px, the bounds of: root mean square of the
    // points, root mean square of the mean over a side, the largest such mean, and the mean of all.
    // Measured: about nine tenths of each.
    let cases = [
        (0.3, [0.5, 0.007, 0.0044, 0.0125, 0.001]),
        (0.3, [2.0, 0.015, 0.006, 0.0175, 0.001]),
        (2.0, [0.5, 0.0215, 0.008, 0.025, 0.001]),
        (2.0, [1.0, 0.03, 0.0105, 0.03, 0.001]),
        (2.0, [2.0, 0.069, 0.0235, 0.068, 0.001]),
        (5.0, [0.5, 0.0515, 0.0175, 0.05, 0.001]),
        (5.0, [1.0, 0.0725, 0.0245, 0.066, 0.001]),
        (5.0, [2.0, 0.17, 0.0575, 0.18, 0.001]),
    ];
    let rms = |x: &[f64]| (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt();
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    for (sigma, [blur_px, bounds @ ..]) in cases {
        let sides = distances(blur_px, sigma);
        assert!(sides.iter().all(|side| side.len() > 30));
        let means: Vec<f64> = sides.iter().map(|side| mean(side)).collect();
        let largest = means.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        let measured = [rms(&sides.concat()), rms(&means), largest, mean(&means).abs()];
        println!("noise {sigma} blur {blur_px}: {measured:.4?}");
        for (value, bound) in measured.iter().zip(bounds) {
            assert!(*value < bound, "noise {sigma}, blur {blur_px}: {measured:.4?}, bounds {bounds:?}");
        }
    }
}
