//! `detect` from end to end on rendered scenes: truth, symmetry, bounds, determinism.

use crate::{
    detect::{
        detector::{MAX_QUADS, detect, detect_with},
        edge_buffers::{DetectBuffers, MAX_SCALES},
        params::{DetectParams, Grouping, Nested},
        quad::{Quad, QuadKind},
        tests::fixtures::render,
    },
    frame::GrayImage,
    geometry::{corners::Corners, polygon},
    trace::NoTrace,
};
use nalgebra::Point2;
use proptest::prelude::*;

/// Maps a pixel, given the image's width and height.
type Mapping = fn([f64; 2], f64, f64) -> [f64; 2];
type Scene = Vec<([[f64; 2]; 4], u8)>;

/// Two separate pictures, one slanted, one with a mat.
fn scene() -> Scene {
    let slanted = [[60.0, 60.0], [250.0, 85.0], [240.0, 300.0], [70.0, 330.0]];
    let framed = [[330.0, 100.0], [520.0, 90.0], [530.0, 360.0], [325.0, 350.0]];
    let mat = [[352.0, 124.0], [498.0, 116.0], [506.0, 333.0], [348.0, 326.0]];
    vec![(slanted, 70), (framed, 40), (mat, 220)]
}

fn outer(scene: &Scene) -> [[[f64; 2]; 4]; 2] {
    [scene[0].0, scene[1].0]
}

fn found(image: &GrayImage, p: &DetectParams) -> Vec<Quad> {
    detect(image, p, &mut NoTrace).into_iter().filter(|q| q.kind == QuadKind::Full).collect()
}

fn paper() -> DetectParams {
    let mut p = DetectParams::default();
    p.quads.grouping = Grouping::Relaxation;
    p
}

/// Mean corner distance to the nearest found quad, under the best naming.
fn nearest_error(truth: &[[f64; 2]; 4], quads: &[Quad]) -> f64 {
    let truth = truth.map(Point2::from);
    let error = |c: &Corners| {
        (0..4)
            .map(|shift| {
                let r = c.rotated(shift);
                (0..4).map(|i| (r.points()[i] - truth[i]).norm()).sum::<f64>() / 4.0
            })
            .fold(f64::INFINITY, f64::min)
    };
    quads.iter().map(|q| error(&q.corners_px)).fold(f64::INFINITY, f64::min)
}

#[test]
fn rendered_quads_are_found_to_a_third_of_a_pixel() {
    let scene = scene();
    let image = render(600, 420, 200, &scene);
    for p in [DetectParams::default(), paper()] {
        let quads = found(&image, &p);
        assert_eq!(quads.len(), 2, "{quads:#?}");
        for truth in outer(&scene) {
            assert!(nearest_error(&truth, &quads) < 0.3, "{:?}", p.quads.grouping);
        }
        for quad in &quads {
            assert!(quad.side_support.iter().all(|s| *s > 0.9));
            assert!(quad.corner_covariance_px2.iter().all(|c| c.trace() > 0.0 && c.trace() < 1.0));
            assert!(!quad.upright_ambiguous && quad.side_clipped == [false; 4]);
            assert!((0.0..=1.0).contains(&quad.score));
        }
    }
}

#[test]
fn the_mat_is_an_alternate_of_its_frame() {
    let frame = [[100.0, 80.0], [400.0, 80.0], [400.0, 330.0], [100.0, 330.0]];
    let mat = [[125.0, 105.0], [375.0, 105.0], [375.0, 305.0], [125.0, 305.0]];
    let image = render(500, 420, 200, &[(frame, 60), (mat, 230)]);
    for p in [DetectParams::default(), paper()] {
        let quads = found(&image, &p);
        assert_eq!(quads.len(), 1, "{:?} {quads:#?}", p.quads.grouping);
        assert!(nearest_error(&frame, &quads) < 0.3);
        assert_eq!(quads[0].alternates.len(), 1);
    }
}

/// An upright rectangle.
fn upright([left, top, right, bottom]: [f64; 4]) -> [[f64; 2]; 4] {
    [[left, top], [right, top], [right, bottom], [left, bottom]]
}

#[test]
fn a_poster_on_a_door_and_a_picture_in_a_picture_are_alternates() {
    let door = upright([150.0, 30.0, 350.0, 400.0]);
    for inner in [upright([210.0, 100.0, 290.0, 210.0]), upright([190.0, 250.0, 300.0, 330.0])] {
        let image = render(500, 420, 200, &[(door, 90), (inner, 230)]);
        let quads = found(&image, &DetectParams::default());
        assert_eq!(quads.len(), 1, "{quads:#?}");
        assert!(nearest_error(&door, &quads) < 0.3);
        assert_eq!(quads[0].alternates.len(), 1);
        let poster = Quad { corners_px: quads[0].alternates[0], ..quads[0].clone() };
        assert!(nearest_error(&inner, &[poster]) < 0.5);
        let mut apart = DetectParams::default();
        apart.quads.nested = Nested::Quads;
        assert_eq!(found(&image, &apart).len(), 2);
    }
}

#[test]
fn the_panes_of_a_window_stay_quads() {
    let frame = upright([100.0, 60.0, 400.0, 360.0]);
    let panes = [upright([120.0, 80.0, 235.0, 340.0]), upright([265.0, 80.0, 380.0, 340.0])];
    let image = render(500, 420, 200, &[(frame, 90), (panes[0], 240), (panes[1], 240)]);
    let quads = found(&image, &DetectParams::default());
    for quad in [frame, panes[0], panes[1]] {
        assert!(nearest_error(&quad, &quads) < 0.5, "{quads:#?}");
    }
}

#[test]
fn flips_turns_shifts_and_contrast_keep_the_quads() {
    let scene = scene();
    let (width, height) = (600, 420);
    let image = render(width, height, 200, &scene);
    let turned = GrayImage::from_fn(height, width, |u, v| image.at(v, height - 1 - u));
    let flipped = GrayImage::from_fn(width, height, |u, v| image.at(width - 1 - u, v));
    let shifted =
        GrayImage::from_fn(width, height, |u, v| image.at(u.saturating_sub(17), v.saturating_sub(9)));
    let dimmed = GrayImage::from_fn(width, height, |u, v| image.at(u, v) / 2 + 40);
    let (w, h) = (width as f64, height as f64);
    let cases: [(&str, GrayImage, Mapping); 4] = [
        ("turned", turned, |[u, v], _, h| [h - 1.0 - v, u]),
        ("flipped", flipped, |[u, v], w, _| [w - 1.0 - u, v]),
        ("shifted", shifted, |[u, v], _, _| [u + 17.0, v + 9.0]),
        ("dimmed", dimmed, |p, _, _| p),
    ];
    for p in [DetectParams::default(), paper()] {
        for (name, changed, map) in &cases {
            let quads = found(changed, &p);
            assert_eq!(quads.len(), 2, "{name}");
            for truth in outer(&scene) {
                let mut truth = truth.map(|c| map(c, w, h));
                if *name == "flipped" {
                    truth.reverse();
                }
                assert!(nearest_error(&truth, &quads) < 0.4, "{name} {:?}", p.quads.grouping);
            }
        }
    }
}

#[test]
fn the_same_image_gives_the_same_quads_bit_for_bit() {
    let image = render(600, 420, 200, &scene());
    for p in [DetectParams::default(), paper()] {
        assert_eq!(detect(&image, &p, &mut NoTrace), detect(&image, &p, &mut NoTrace));
    }
}

#[test]
fn reused_memory_does_not_change_the_quads() {
    let image = |seed| render(600 - 40 * seed as usize, 420, seed, &scene());
    let mut memory = DetectBuffers::default();
    for p in [DetectParams::default(), paper()] {
        for image in [image(1), image(3), image(1), image(2)] {
            let quads = detect_with(&mut memory, &image, &p, &mut NoTrace);
            assert!(!quads.is_empty());
            assert_eq!(quads, detect(&image, &p, &mut NoTrace));
        }
    }
    assert!(memory.maps.len() <= MAX_SCALES);
}

#[test]
fn a_side_without_a_segment_is_found_by_the_default_detector_only() {
    // The right side fades into the wall: 4 grey levels, below the low threshold of the edges.
    let quad = [[100.0, 80.0], [400.0, 80.0], [400.0, 330.0], [100.0, 330.0]];
    let plain = render(500, 420, 200, &[(quad, 100)]);
    let image = GrayImage::from_fn(500, 420, |u, v| {
        let level = f64::from(plain.at(u, v));
        // The picture brightens towards its right side, where 5 levels are left.
        if (100..=400).contains(&u) {
            (level + (195.0 - level).max(0.0) * (u as f64 - 100.0) / 300.0) as u8
        } else {
            plain.at(u, v)
        }
    });
    assert!(nearest_error(&quad, &found(&image, &DetectParams::default())) < 3.0);
}

#[test]
fn the_number_of_quads_is_bounded() {
    let mut quads = Vec::new();
    for row in 0..10 {
        for column in 0..10 {
            let (u, v) = (f64::from(column) * 80.0 + 20.0, f64::from(row) * 80.0 + 20.0);
            quads.push(([[u, v], [u + 50.0, v], [u + 50.0, v + 46.0], [u, v + 46.0]], 60));
        }
    }
    let image = render(820, 820, 200, &quads);
    let found = detect(&image, &DetectParams::default(), &mut NoTrace);
    assert_eq!(found.len(), MAX_QUADS);
    assert!(found.windows(2).all(|w| w[0].score >= w[1].score));
}

#[test]
fn empty_and_tiny_images_have_no_quads() {
    for (width, height) in [(1, 1), (1, 300), (300, 1), (2, 2), (7, 5), (64, 64)] {
        let image = GrayImage::from_fn(width, height, |_, _| 90);
        assert!(detect(&image, &DetectParams::default(), &mut NoTrace).is_empty());
        assert!(detect(&image, &paper(), &mut NoTrace).is_empty());
    }
}

#[test]
fn checkerboards_of_any_period_stay_bounded() {
    for period in [1, 2, 3, 5, 8, 13, 21, 34, 55] {
        let image =
            GrayImage::from_fn(320, 240, |u, v| if (u / period + v / period) % 2 == 0 { 30 } else { 220 });
        for p in [DetectParams::default(), paper()] {
            let quads = detect(&image, &p, &mut NoTrace);
            assert!(quads.len() <= MAX_QUADS);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn noise_of_any_grain_gives_convex_quads_or_none(seed in any::<u32>(), grain in 1..20_usize, width in 20..260_usize, height in 20..200_usize) {
        let noise = |u: usize, v: usize| {
            let mut x = seed ^ (u as u32).wrapping_mul(0x9E37_79B9) ^ (v as u32).wrapping_mul(0x85EB_CA6B);
            x = (x ^ (x >> 16)).wrapping_mul(0x7FEB_352D);
            ((x ^ (x >> 15)) >> 13) as u8
        };
        let image = GrayImage::from_fn(width, height, |u, v| noise(u / grain, v / grain));
        for p in [DetectParams::default(), paper()] {
            for quad in detect(&image, &p, &mut NoTrace) {
                prop_assert!(polygon::is_convex(quad.corners_px.points()));
                prop_assert!((0.0..=1.0).contains(&quad.score));
                prop_assert!(quad.corner_covariance_px2.iter().all(|c| c.iter().all(|x| x.is_finite())));
            }
        }
    }
}
