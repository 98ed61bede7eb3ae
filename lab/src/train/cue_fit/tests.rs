//! The fit of the weights against an oracle, labels of pairs, refusals.

use super::*;
use nalgebra::Vector2;
use vision::{frame::GrayImage, paper::relaxation::similarity::pairs, random::Random};

/// A segment between two points, as an ideal extractor would give it. The brighter side is right of
/// p to q.
fn segment(p: [f64; 2], q: [f64; 2]) -> EdgeSegment {
    let (p_px, q_px) = (Point2::from(p), Point2::from(q));
    let along = (q_px - p_px).normalize();
    let normal = Vector2::new(-along.y, along.x);
    EdgeSegment {
        p_px,
        q_px,
        length_px: (q_px - p_px).norm(),
        theta_rad: along.y.atan2(along.x).rem_euclid(std::f64::consts::PI),
        normal,
        rho_px: normal.dot(&p_px.coords),
        contrast: 50.0,
        support: (q_px - p_px).norm() as usize,
        chain: 0,
        theta_variance: 1e-6,
        offset_variance: 0.01,
        clipped: false,
    }
}

/// The four sides of a quad, each shortened by `gap_px` at both ends.
fn sides(corners: [[f64; 2]; 4], gap_px: f64) -> Vec<EdgeSegment> {
    let side = |i: usize| {
        let (a, b) = (Point2::from(corners[i]), Point2::from(corners[(i + 1) % 4]));
        let cut = (b - a).normalize() * gap_px;
        segment((a + cut).into(), (b - cut).into())
    };
    (0..4).map(side).collect()
}

/// An upright rectangle of grey level 60 on a wall of 200, with one of 220 in it.
fn render(outer: [[f64; 2]; 4], inner: [[f64; 2]; 4]) -> GrayImage {
    let within = |[[left, top], _, [right, bottom], _]: [[f64; 2]; 4], u: f64, v: f64| {
        (left..right).contains(&u) && (top..bottom).contains(&v)
    };
    GrayImage::from_fn(300, 230, |u, v| match (u as f64, v as f64) {
        (u, v) if within(inner, u, v) => 220,
        (u, v) if within(outer, u, v) => 60,
        _ => 200,
    })
}

/// Pairs whose first two cues are informative, the first three times as much; the others are noise.
fn labelled_pairs(count: usize, seed: u64) -> Vec<LabelledPair> {
    let mut random = Random::new(seed);
    (0..count)
        .map(|i| {
            let cues: [f64; 6] = std::array::from_fn(|_| random.unit());
            let logit = 9.0 * cues[0] + 3.0 * cues[1] - 6.0;
            let opposite = random.unit() < 1.0 / (1.0 + f64::exp(-logit));
            LabelledPair { cues, opposite, photograph: i / 40 }
        })
        .collect()
}

#[test]
fn the_true_weights_are_recovered() {
    let fitted = fit(&labelled_pairs(20_000, 1), &SimilarityParams::default()).unwrap();
    assert!((fitted.weights[0] - 0.75).abs() < 0.03, "{fitted:?}");
    assert!((fitted.weights[1] - 0.25).abs() < 0.03);
    assert!(fitted.weights[2..].iter().all(|w| (0.0..0.03).contains(w)));
    assert!((fitted.weights.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    assert!(fitted.order_after > fitted.order_before + 0.1, "{fitted:?}");
    assert!(fitted.passing[1] < fitted.passing[0]);
}

#[test]
fn the_fit_is_the_minimum() {
    // Oracle: the balanced loss itself, on a grid of small moves about the fit.
    let pairs = labelled_pairs(3000, 2);
    let found = weights(&pairs).unwrap();
    let n = pairs.iter().filter(|s| s.opposite).count() as f64;
    let loss = |direction: &[f64; 6], scale: f64, offset: f64| {
        let of = |s: &LabelledPair| {
            let logit = scale * score(&s.cues, direction) + offset;
            let (sign, weight) =
                if s.opposite { (-1.0, 0.5 / n) } else { (1.0, 0.5 / (pairs.len() as f64 - n)) };
            weight * f64::exp(sign * logit).ln_1p()
        };
        let ridge: f64 = direction.iter().map(|w| (scale * w).powi(2)).sum::<f64>() * 0.5 * RIDGE;
        pairs.iter().map(of).sum::<f64>() + ridge
    };
    let best = |direction: &[f64; 6]| {
        let mut least = f64::INFINITY;
        for scale in 20..60 {
            for offset in -40..0 {
                least = least.min(loss(direction, 0.3 * f64::from(scale), 0.25 * f64::from(offset)));
            }
        }
        least
    };
    let at_fit = best(&found);
    for c in 0..6 {
        let mut moved = found;
        moved[c] += 0.15;
        assert!(best(&moved) > at_fit, "cue {c}");
    }
}

#[test]
fn order_and_threshold_by_hand() {
    let scored = [(0.1, false), (0.4, true), (0.4, false), (0.8, true)];
    // 0.4 beats one and ties one, 0.8 beats both: 3.5 of 4.
    assert!((order(&scored) - 0.875).abs() < 1e-12);
    let many: Vec<(f64, bool)> =
        (0..100).map(|i| (f64::from(i), true)).chain([(4.0, false), (6.0, false)]).collect();
    assert!((keeping(&many) - 5.0).abs() < 1e-6);
    assert!((passing(&many) - 0.5).abs() < 1e-12);
}

#[test]
fn too_few_and_too_many_pairs_are_refused() {
    let pairs = labelled_pairs(400, 3);
    let p = SimilarityParams::default();
    let few: Vec<LabelledPair> = pairs
        .iter()
        .filter(|s| s.opposite)
        .take(MIN_PAIRS_OF_A_KIND - 1)
        .chain(pairs.iter().filter(|s| !s.opposite))
        .copied()
        .collect();
    assert!(
        matches!(fit(&few, &p), Err(CueFitError::TooFew { pairs, .. }) if pairs == MIN_PAIRS_OF_A_KIND - 1)
    );
    assert_eq!(fit(&[], &p), Err(CueFitError::TooFew { pairs: 0, others: 0 }));
    let same: Vec<LabelledPair> = pairs.iter().map(|s| LabelledPair { cues: [0.0; 6], ..*s }).collect();
    assert_eq!(fit(&same, &p), Err(CueFitError::NothingTells));
    let many = vec![pairs[0]; MAX_PAIRS_FITTED + 1];
    assert_eq!(fit(&many, &p), Err(CueFitError::TooMany(MAX_PAIRS_FITTED + 1)));
}

#[test]
fn pairs_are_labelled_by_quads() {
    let outer = [[50.0, 40.0], [250.0, 40.0], [250.0, 190.0], [50.0, 190.0]];
    let inner = [[80.0, 70.0], [220.0, 70.0], [220.0, 160.0], [80.0, 160.0]];
    let mut segments = sides(outer, 1.0);
    segments.extend(sides(inner, 1.0));
    // Half of a side is not the side.
    segments.push(segment([50.0, 40.0], [140.0, 40.0]));
    let image = render(outer, inner);
    let found = pairs(&segments, &image, &ungraded(&SimilarityParams::default()));
    let labels = [Corners::try_from(outer).unwrap()];
    let labelled_pairs = label_pairs(&segments, &found, &labels, &[], 3);
    assert!(labelled_pairs.iter().all(|j| j.photograph == 3));
    assert_eq!(labelled_pairs.iter().filter(|j| j.opposite).count(), 2);
    let of = |pair: &SegmentPair| label_pairs(&segments, std::slice::from_ref(pair), &labels, &[], 0);
    for pair in &found {
        match (pair.k, pair.l) {
            (0, 2) | (1, 3) => assert!(of(pair)[0].opposite),
            // Outer top and inner bottom overlap the label by more than half, as does the whole of
            // the inner border's height by width; so it has no label.
            (0, 6) | (2, 4) => assert!(of(pair).is_empty()),
            (2, 8) => assert!(of(pair).iter().all(|j| !j.opposite)),
            _ => {}
        }
    }
    // Without labels all are other pairs, unless a known quad explains them.
    assert!(label_all(&segments, &found, &[]).iter().all(|j| !j.opposite));
    assert!(label_all(&segments, &found, &labels).len() < found.len());
}

fn label_all(segments: &[EdgeSegment], pairs: &[SegmentPair], others: &[Corners]) -> Vec<LabelledPair> {
    label_pairs(segments, pairs, &[], others, 0)
}
