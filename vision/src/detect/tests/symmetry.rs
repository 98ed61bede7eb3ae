//! `detect` on an image that was mirrored, turned, shifted, inverted, dimmed or enlarged finds the
//! same quads, moved likewise, with both groupings.
//!
//! The result is not exact to the last bit: the recursive filter runs forth and back in single
//! precision, chains start at another end, the darker of two equal edge pixels wins, and blocks of
//! the coarser scale do not move with the image. The tolerances below cover these effects.

use crate::{
    detect::{
        detector::detect,
        params::{DetectParams, Grouping},
        quad::{Quad, QuadKind},
        tests::{
            fixtures::render,
            rendering::{Noise, flipped, quarter_turned},
        },
    },
    frame::GrayImage,
    trace::NoTrace,
};
use nalgebra::Point2;

const SIZE: (usize, usize) = (640, 480);

/// Six objects on a wall, slanted and turned at random, half of them with a mat, some cut by the
/// image border; a little noise.
fn scene(seed: u64, scale: usize) -> GrayImage {
    let mut random = Noise(seed);
    let mut between = |low: f64, high: f64| low + (high - low) * random.uniform();
    let mut quads = Vec::new();
    for i in 0..6 {
        let centre = [110.0 + 210.0 * f64::from(i % 3), 120.0 + 235.0 * f64::from(i / 3)];
        let centre = [centre[0] + between(-18.0, 18.0), centre[1] + between(-12.0, 12.0)];
        let (half, turn) = ([between(45.0, 80.0), between(45.0, 90.0)], between(-0.15, 0.15));
        let corner = |x: f64, y: f64, inset: f64| {
            let (x, y) = (x * (half[0] - inset), y * (half[1] - inset));
            let (x, y) = (x * (1.0 + 0.002 * y), y * (1.0 + 0.001 * x));
            let (sin, cos) = f64::sin_cos(turn);
            [centre[0] + cos * x - sin * y, centre[1] + sin * x + cos * y]
                .map(|c| (c + 0.5) * scale as f64 - 0.5)
        };
        let level = between(30.0, 120.0) as u8;
        let border = |inset| {
            [
                corner(-1.0, -1.0, inset),
                corner(1.0, -1.0, inset),
                corner(1.0, 1.0, inset),
                corner(-1.0, 1.0, inset),
            ]
        };
        quads.push((border(0.0), level));
        if i % 2 == 0 {
            quads.push((border(14.0), 230));
        }
    }
    let image = render(SIZE.0 * scale, SIZE.1 * scale, 185, &quads);
    GrayImage::from_fn(SIZE.0 * scale, SIZE.1 * scale, |u, v| {
        (f64::from(image.at(u, v)) + between(-3.0, 3.0)).round() as u8
    })
}

fn both() -> [DetectParams; 2] {
    let mut paper = DetectParams::default();
    paper.quads.grouping = Grouping::Relaxation;
    [DetectParams::default(), paper]
}

/// Largest distance of a corner from that of the nearest quad of the same kind, under the best
/// naming.
fn farthest(quads: &[Quad], others: &[Quad], map: impl Fn(&Point2<f64>) -> Point2<f64>) -> f64 {
    let gap = |q: &Quad, o: &Quad| {
        let moved = q.corners_px.points().map(|c| map(&c));
        let corner = |c: &Point2<f64>| {
            o.corners_px.points().iter().map(|d| (c - d).norm()).fold(f64::INFINITY, f64::min)
        };
        moved.iter().map(corner).fold(0.0, f64::max)
    };
    let nearest = |q: &Quad| {
        others.iter().filter(|o| o.kind == q.kind).map(|o| gap(q, o)).fold(f64::INFINITY, f64::min)
    };
    quads.iter().map(nearest).fold(0.0, f64::max)
}

/// Both images have the same quads, up to the map and a tolerance.
fn same(
    name: &str,
    changes: impl Fn(&GrayImage) -> GrayImage,
    map: impl Fn(&Point2<f64>) -> Point2<f64>,
    tolerance_px: f64,
) {
    for p in both() {
        for seed in 1..=6 {
            let image = scene(seed, 1);
            let plain = detect(&image, &p, &mut NoTrace);
            let changed = detect(&changes(&image), &p, &mut NoTrace);
            let grouping = p.quads.grouping;
            assert!(plain.len() >= 5, "{name} {grouping:?} seed {seed}: {}", plain.len());
            let worst = farthest(&plain, &changed, &map);
            assert_eq!(plain.len(), changed.len(), "{name} {grouping:?} seed {seed}");
            assert!(worst <= tolerance_px, "{name} {grouping:?} seed {seed}: {worst}");
        }
    }
}

const RIGHT: f64 = SIZE.0 as f64 - 1.0;
const BOTTOM: f64 = SIZE.1 as f64 - 1.0;

#[test]
fn mirrored() {
    same("mirrored", flipped, |c| Point2::new(RIGHT - c.x, c.y), 1e-3);
}

#[test]
fn turned() {
    same("quarter turn", quarter_turned, |c| Point2::new(BOTTOM - c.y, c.x), 1e-3);
    let half = |image: &GrayImage| quarter_turned(&quarter_turned(image));
    same("half turn", half, |c| Point2::new(RIGHT - c.x, BOTTOM - c.y), 1e-3);
}

#[test]
fn inverted_and_dimmed() {
    let inverted = |image: &GrayImage| GrayImage::from_fn(SIZE.0, SIZE.1, |u, v| 255 - image.at(u, v));
    same("inverted", inverted, |c| *c, 0.02);
    // Half the contrast is rounded to whole grey levels anew.
    let dimmed = |image: &GrayImage| GrayImage::from_fn(SIZE.0, SIZE.1, |u, v| image.at(u, v) / 2 + 20);
    same("dimmed", dimmed, |c| *c, 0.1);
}

#[test]
fn shifted() {
    // By whole blocks of the coarser scale, and not.
    for (du, dv, tolerance_px) in [(8, 4, 1e-3), (3, 5, 0.15)] {
        let moved = |image: &GrayImage| {
            GrayImage::from_fn(SIZE.0, SIZE.1, |u, v| image.at(u.saturating_sub(du), v.saturating_sub(dv)))
        };
        same("shifted", moved, |c| Point2::new(c.x + du as f64, c.y + dv as f64), tolerance_px);
    }
}

#[test]
fn enlarged() {
    for p in both() {
        for seed in 1..=3 {
            let full = |image: &GrayImage| {
                let mut quads = detect(image, &p, &mut NoTrace);
                quads.retain(|q| q.kind == QuadKind::Full);
                quads
            };
            let (small, large) = (full(&scene(seed, 1)), full(&scene(seed, 2)));
            assert!(small.len() >= 5);
            // Thresholds are in pixels and the noise is finer, so the larger image may show more;
            // what the smaller one shows it has, to a third of a pixel of the smaller one.
            let worst = farthest(&small, &large, |c| c.map(|x| 2.0 * (x + 0.5) - 0.5));
            assert!(worst < 0.6, "{:?} seed {seed}: {worst}", p.quads.grouping);
        }
    }
}
