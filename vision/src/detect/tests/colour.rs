//! Quads that differ from the wall in colour alone.

use crate::{
    detect::{
        detector::detect,
        params::DetectParams,
        tests::{fixtures::render, rendering::Noise},
    },
    frame::{GrayImage, Picture},
    trace::NoTrace,
};
use nalgebra::Point2;

/// Grey levels of the wall and of the quads.
const GREY: f64 = 120.0;

/// A quad before a wall of the same grey level, with noise, each plane of its own; red and blue
/// differ by this much.
fn isoluminant(
    (width, height): (usize, usize),
    corners: [[f64; 2]; 4],
    (red, blue): (f64, f64),
    sigma: f64,
) -> Picture {
    let green = -(0.299 * red + 0.114 * blue) / 0.587;
    let mut random = Noise(9);
    let plane = |step: f64| {
        let clean = render(width, height, GREY as u8, &[(corners, (GREY + step).round() as u8)]);
        GrayImage::from_fn(width, height, |u, v| {
            (f64::from(clean.at(u, v)) + sigma * random.gaussian()).round().clamp(0.0, 255.0) as u8
        })
    };
    Picture::from_colour([red, green, blue].map(plane)).expect("planes of one size")
}

fn worst_px(picture: &Picture, corners: [[f64; 2]; 4]) -> f64 {
    let found = detect(picture, &DetectParams::default(), &mut NoTrace);
    let worst = |points: &[Point2<f64>; 4]| {
        let off = |shift: usize| {
            (0..4).map(|i| (points[(i + shift) % 4] - Point2::from(corners[i])).norm()).fold(0.0, f64::max)
        };
        (0..4).map(off).fold(f64::INFINITY, f64::min)
    };
    found.iter().map(|q| worst(q.corners_px.points())).fold(f64::INFINITY, f64::min)
}

#[test]
fn a_quad_of_the_same_grey_as_the_wall_is_found_by_its_colour() {
    let small = [[200.3, 140.2], [410.7, 160.4], [402.1, 330.3], [210.6, 310.9]];
    let large = small.map(|p| p.map(|x| 2.0 * x));
    for (size, corners) in [((640, 480), small), ((1280, 960), large)] {
        for step in [(50.0, 0.0), (-40.0, 10.0), (0.0, 60.0), (30.0, -50.0), (25.0, 40.0)] {
            let picture = isoluminant(size, corners, step, 2.0);
            let off = worst_px(&picture, corners);
            assert!(off < 0.1, "{size:?}, red and blue {step:?}: {off} px");
            // In grey there is nothing.
            assert!(worst_px(&picture.into_grey().into(), corners).is_infinite());
        }
    }
}
