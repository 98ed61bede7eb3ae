use super::*;
use crate::detect::tests::fixtures::{render, segment, sides};

const SQUARE: [[f64; 2]; 4] = [[50.0, 40.0], [150.0, 40.0], [150.0, 140.0], [50.0, 140.0]];

fn scene(corners: [[f64; 2]; 4]) -> (Vec<EdgeSegment>, GrayImage) {
    (sides(corners, 0.0), render(220, 200, 200, &[(corners, 60)]))
}

#[test]
fn a_square_with_perfect_sides_scores_one() {
    let (segments, image) = scene(SQUARE);
    let pairs = pairs(&segments, &image, &SimilarityParams::default());
    assert_eq!(pairs.iter().map(|p| (p.k, p.l)).collect::<Vec<_>>(), vec![(0, 2), (1, 3)]);
    for pair in &pairs {
        // Method 21: c1 = c2 = c3 = c4 = 1; perfect corners and a uniform square make the other two
        // 1 as well.
        for cue in pair.cues {
            assert!((cue - 1.0).abs() < 1e-3, "{pair:?}");
        }
        assert!((pair.score - 1.0).abs() < 1e-3);
        assert!(polygon::signed_area(&pair.quad_px) > 0.0);
        assert!(pair.closing.iter().all(Option::is_some));
    }
}

#[test]
fn cues_by_hand() {
    // Sides of 100 and 50 px, 80 px apart, level; the shorter one lies within the longer one's
    // span.
    let (a, b) = (segment([0.0, 0.0], [100.0, 0.0]), segment([10.0, 80.0], [60.0, 80.0]));
    assert!((inverse_ratio(a.length_px, b.length_px) - 0.8).abs() < 1e-12);
    assert!(angle_between(&a, &b) < 1e-12);
    assert!((inverse_ratio(150.0, 160.0) - 2.0 / (150.0 / 160.0 + 160.0 / 150.0)).abs() < 1e-12);
    assert!((overlap_rate(&a, &b) - 1.0).abs() < 1e-12);
    // Half outside: 30 of 50 px common.
    assert!((overlap_rate(&a, &segment([70.0, 80.0], [120.0, 80.0])) - 0.6).abs() < 1e-12);
    assert!(overlap_rate(&a, &segment([170.0, 80.0], [120.0, 80.0])) < 1e-12);
    let tilted = segment([0.0, 80.0], [100.0, 80.0 + 100.0 * 20.0_f64.to_radians().tan()]);
    assert!((angle_between(&a, &tilted).to_degrees() - 20.0).abs() < 1e-9);
    assert!(
        (angle_between(&segment([0.0, 0.0], [99.0, -1.0]), &segment([0.0, 0.0], [99.0, 1.0]))
            - 2.0 * (1.0_f64 / 99.0).atan())
        .abs()
            < 1e-12
    );
}

#[test]
fn third_segment_cue_by_hand() {
    // The closing side ends 10 px from both chord ends; chord 100 px: g = 10, reach = 23.
    let mut segments = sides(SQUARE, 0.0);
    segments.remove(3);
    segments[1] = segment([150.0, 50.0], [150.0, 130.0]);
    let image = render(220, 200, 200, &[(SQUARE, 60)]);
    let pairs = pairs(&segments, &image, &SimilarityParams::default());
    assert_eq!(pairs.len(), 1);
    assert!((pairs[0].cues[4] - (-(10.0_f64 / 23.0).powi(2)).exp()).abs() < 1e-9, "{pairs:?}");
    assert_eq!(pairs[0].closing.iter().flatten().map(|c| c.0).collect::<Vec<_>>(), vec![1]);
}

#[test]
fn pairs_outside_the_gates_are_dropped() {
    let image = render(220, 200, 200, &[(SQUARE, 60)]);
    let count = |segments: &[EdgeSegment]| pairs(segments, &image, &SimilarityParams::default()).len();
    // No third segment.
    assert_eq!(count(&[segment([50.0, 40.0], [150.0, 40.0]), segment([50.0, 140.0], [150.0, 140.0])]), 0);
    // Closer than 15 px, though closed.
    let flat = [[50.0, 40.0], [150.0, 40.0], [150.0, 54.0], [50.0, 54.0]];
    assert!(
        pairs(&sides(flat, 0.0), &image, &SimilarityParams::default()).iter().all(|p| (p.k, p.l) != (0, 2))
    );
    // At more than 40 degrees.
    let lines = [
        segment([50.0, 100.0], [150.0, 100.0]),
        segment([50.0, 80.0], [120.0, 80.0 - 70.0 * 42.0_f64.to_radians().tan()]),
        segment([50.0, 80.0], [50.0, 100.0]),
    ];
    assert!(
        rough_pair(&lines, 0, 1, &SimilarityParams::default()).is_some_and(|r| r.cues[1] <= 0.0)
            || rough_pairs(&lines[..2], &SimilarityParams::default()).is_empty()
    );
    assert!(rough_pairs(&lines[..2], &SimilarityParams::default()).is_empty());
    // Coincident.
    assert!(rough_pairs(&[lines[0].clone(), lines[0].clone()], &SimilarityParams::default()).is_empty());
    assert_eq!(count(&[]), 0);
}

#[test]
fn scores_do_not_change_under_a_quarter_turn() {
    let corners = [[60.0, 50.0], [160.0, 42.0], [150.0, 150.0], [52.0, 120.0]];
    // A turn by 90 degrees clockwise on screen of a 220 x 200 image.
    let turned = corners.map(|[u, v]: [f64; 2]| [199.0 - v, u]);
    let image = render(220, 200, 200, &[(corners, 60)]);
    let image_turned = GrayImage::from_fn(200, 220, |u, v| image.at(v, 199 - u));
    let a = pairs(&sides(corners, 2.0), &image, &SimilarityParams::default());
    let b = pairs(&sides(turned, 2.0), &image_turned, &SimilarityParams::default());
    assert_eq!(a.len(), 2);
    for (a, b) in a.iter().zip(&b) {
        assert_eq!((a.k, a.l), (b.k, b.l));
        for (x, y) in a.cues.iter().zip(&b.cues) {
            assert!((x - y).abs() < 1e-6, "{a:?} {b:?}");
        }
    }
}

#[test]
fn order_of_segments_changes_no_score() {
    let (segments, image) = scene([[60.0, 50.0], [160.0, 42.0], [150.0, 150.0], [52.0, 120.0]]);
    let reversed: Vec<_> = segments.iter().rev().cloned().collect();
    let a = pairs(&segments, &image, &SimilarityParams::default());
    let b = pairs(&reversed, &image, &SimilarityParams::default());
    assert_eq!(a.len(), 2);
    for pair in &a {
        let twin = b.iter().find(|q| (3 - q.l, 3 - q.k) == (pair.k, pair.l)).expect("the same pair");
        assert!((twin.score - pair.score).abs() < 1e-9);
    }
}

#[test]
fn clipped_segments_count_less_by_length() {
    let mut segments = sides([[50.0, 40.0], [150.0, 40.0], [130.0, 140.0], [50.0, 140.0]], 0.0);
    let image = render(220, 200, 200, &[(SQUARE, 60)]);
    let free = pairs(&segments, &image, &SimilarityParams::default())[0].clone();
    segments[free.l].clipped = true;
    let clipped = pairs(&segments, &image, &SimilarityParams::default())
        .into_iter()
        .find(|p| (p.k, p.l) == (free.k, free.l))
        .expect("still a pair");
    let w = SimilarityParams::default().weights;
    let total: f64 = free.cues.iter().zip(w).map(|(c, w)| c * w).sum();
    assert!((clipped.score - (total - 0.5 * w[0] * free.cues[0]) / (1.0 - 0.5 * w[0])).abs() < 1e-9);
}

#[test]
fn the_number_of_candidates_is_bounded() {
    // A fan of parallels: every one could pair with every other.
    let p = SimilarityParams::default();
    let mut segments: Vec<_> = (0..MAX_PAIRED_SEGMENTS + 50)
        .map(|i| segment([0.0, i as f64 * 20.0], [3000.0, i as f64 * 20.0]))
        .collect();
    segments.push(segment([0.0, 0.0], [0.0, 11_000.0]));
    let image = GrayImage::from_fn(64, 64, |_, _| 0);
    let found = pairs(&segments, &image, &p);
    assert!(found.len() <= MAX_PAIRS);
    for i in 0..segments.len() {
        assert!(found.iter().filter(|s| s.k == i || s.l == i).count() <= p.max_candidates);
    }
}

#[test]
fn the_shortlist_bounds_the_pairs_of_stripes() {
    let stripes = |n: usize| -> Vec<EdgeSegment> {
        (0..n).map(|i| segment([i as f64 * 20.0, 0.0], [i as f64 * 20.0, 3000.0])).collect()
    };
    let p = SimilarityParams { min_score: 0.0, ..SimilarityParams::default() };
    // n (n - 1) / 2 pairs.
    assert_eq!(shortlist(rough_pairs(&stripes(200), &p)).len(), 19_900);
    let cut = shortlist(rough_pairs(&stripes(201), &p));
    assert_eq!(cut.len(), MAX_ROUGH_PAIRS);
    assert!(cut.windows(2).all(|w| w[0].bound >= w[1].bound));
}
