use super::*;
use crate::{
    detect::tests::fixtures::{render, sides},
    paper::relaxation::similarity::{SimilarityParams, pairs},
};

type Quadrangle = [[f64; 2]; 4];

/// A frame with its mat, and two pictures side by side.
const QUADS: [Quadrangle; 4] = [
    [[40.0, 50.0], [210.0, 60.0], [205.0, 230.0], [45.0, 240.0]],
    [[62.0, 74.0], [188.0, 82.0], [184.0, 208.0], [66.0, 216.0]],
    [[250.0, 80.0], [340.0, 70.0], [345.0, 220.0], [255.0, 210.0]],
    [[380.0, 90.0], [470.0, 95.0], [468.0, 215.0], [384.0, 200.0]],
];
const LEVELS: [u8; 4] = [60, 230, 90, 40];
const SIZE: (usize, usize) = (520, 300);

/// Both passes over the sides of some quads; the corners of what comes out.
fn grouped(
    quads: &[Quadrangle],
    reorder: impl Fn(Vec<EdgeSegment>) -> Vec<EdgeSegment>,
) -> Vec<[Point2<f64>; 4]> {
    let drawn: Vec<(Quadrangle, u8)> = quads.iter().copied().zip(LEVELS).collect();
    let image = render(SIZE.0, SIZE.1, 190, &drawn);
    let segments = reorder(quads.iter().flat_map(|q| sides(*q, 2.0)).collect());
    let (similarity, p) = (SimilarityParams::default(), RelaxationParams::default());
    let candidates = pairs(&segments, &image, &similarity);
    let matched = match_pairs(&segments, &candidates, similarity.min_score, &p);
    let matched: Vec<SegmentPair> = matched.iter().map(|i| candidates[*i].clone()).collect();
    match_quads(&segments, &matched, SIZE, &p).iter().map(|s| s.corners_px).collect()
}

/// Every quad of the one is a quad of the other, wherever its corners start.
fn assert_same(found: &[[Point2<f64>; 4]], wanted: &[Quadrangle]) {
    assert_eq!(found.len(), wanted.len());
    for w in wanted {
        let is =
            |f: &[Point2<f64>; 4]| w.iter().all(|c| f.iter().any(|d| (Point2::from(*c) - d).norm() < 1e-6));
        assert!(found.iter().any(is), "{w:?} in {found:?}");
    }
}

#[test]
fn nested_and_neighbouring_quads_are_found() {
    assert_same(&grouped(&QUADS, |s| s), &QUADS);
}

#[test]
fn quads_do_not_depend_on_order_mirror_and_quarter_turn() {
    assert_same(&grouped(&QUADS, |s| s.into_iter().rev().collect()), &QUADS);
    let interleaved = |s: Vec<EdgeSegment>| (0..16).map(|i| s[i * 7 % 16].clone()).collect();
    assert_same(&grouped(&QUADS, interleaved), &QUADS);
    let mut mirrored = QUADS.map(|q| q.map(|[u, v]| [519.0 - u, v]));
    for quad in &mut mirrored {
        quad.reverse();
    }
    assert_same(&grouped(&mirrored, |s| s), &mirrored);
    // Within the image after a turn about its left upper part.
    let turned = QUADS[..2].iter().map(|q| q.map(|[u, v]| [299.0 - v, u])).collect::<Vec<_>>();
    assert_same(&grouped(&turned, |s| s), &turned);
}

#[test]
fn a_quad_needs_two_pairs_without_a_common_segment() {
    let segments = sides(QUADS[0], 2.0);
    let image = render(SIZE.0, SIZE.1, 190, &[(QUADS[0], 60)]);
    let found = pairs(&segments, &image, &SimilarityParams::default());
    assert_eq!(found.len(), 2);
    let p = RelaxationParams::default();
    assert_eq!(match_quads(&segments, &found, SIZE, &p).len(), 1);
    assert!(match_quads(&segments, &found[..1], SIZE, &p).is_empty());
    let twins = [found[0].clone(), found[0].clone()];
    assert!(match_quads(&segments, &twins, SIZE, &p).is_empty());
    // A corner far outside the image.
    assert!(match_quads(&segments, &found, (150, 150), &p).is_empty());
}
