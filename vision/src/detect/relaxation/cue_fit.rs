//! Weights of the cues from labelled photographs (method 2): pairs of segments that lie on opposite sides of a labelled
//! quad against all others that pass the gates. Logistic regression with no weight below zero, both classes weighing
//! the same; every photograph is judged by a fit without its fifth of the photographs. Reads no files.

use crate::{
    detect::{
        relaxation::similarity::{SegmentPair, SimilarityParams},
        segments::edge_segments::EdgeSegment,
    },
    geometry::{corners::Corners, polygon},
};
use nalgebra::Point2;

/// Most labelled pairs of one fit.
pub const MAX_PAIRS_FITTED: usize = 1_000_000;
/// Fewest pairs of either kind.
pub const MIN_PAIRS_OF_A_KIND: usize = 20;
/// Parts of the cross-validation.
pub const FOLDS: usize = 5;
/// Share of the true pairs whose score the smallest score lets through.
pub const KEPT_SHARE: f64 = 0.95;
/// Weight of the squared coefficients, so that cues that say the same share what they say.
const RIDGE: f64 = 1e-4;
/// Rounds over all coefficients.
const MAX_ROUNDS: usize = 200;

/// Why there is no fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CueFitError {
    /// Too few pairs of one kind.
    #[error(
        "{pairs} pairs of opposite sides and {others} others: at least {MIN_PAIRS_OF_A_KIND} of each needed"
    )]
    TooFew {
        /// Pairs of opposite sides.
        pairs: usize,
        /// Other pairs.
        others: usize,
    },
    /// More pairs than [`MAX_PAIRS_FITTED`].
    #[error("{0} pairs, {MAX_PAIRS_FITTED} at most")]
    TooMany(usize),
    /// No cue tells the two kinds apart.
    #[error("no cue tells opposite sides from other pairs")]
    NothingTells,
}

/// A candidate pair that labels judged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LabelledPair {
    /// c1 to c6.
    pub cues: [f64; 6],
    /// Opposite sides of a labelled quad.
    pub opposite: bool,
    /// The photograph it comes from.
    pub photograph: usize,
}

/// Parameters of [`crate::detect::relaxation::similarity::pairs`] that keep every pair that passes the gates, whatever its score.
pub fn ungraded(p: &SimilarityParams) -> SimilarityParams {
    SimilarityParams {
        min_score: 0.0,
        max_candidates: crate::detect::relaxation::labelling::MAX_ROW_CANDIDATES,
        ..p.clone()
    }
}

/// Judges candidate pairs by labelled quads. A pair along another border of a labelled thing (`IoU` of half with it), or
/// along one of `others` (real quads that nobody asks for), is left out, as neither answer would be fair.
pub fn judge(
    segments: &[EdgeSegment],
    pairs: &[SegmentPair],
    labelled: &[Corners],
    others: &[Corners],
    photograph: usize,
) -> Vec<LabelledPair> {
    let judged = |pair: &SegmentPair| {
        let (k, l) = (&segments[pair.k], &segments[pair.l]);
        let opposite = labelled.iter().any(|q| opposite_sides(k, l, q.points()));
        let near = |q: &Corners| polygon::iou(&pair.quad_px, q.points()) >= 0.5;
        let fair = opposite || !labelled.iter().chain(others).any(near);
        fair.then_some(LabelledPair { cues: pair.cues, opposite, photograph })
    };
    pairs.iter().filter_map(judged).collect()
}

/// Whether two segments lie on opposite sides of a quad.
fn opposite_sides(k: &EdgeSegment, l: &EdgeSegment, corners: &[Point2<f64>; 4]) -> bool {
    (0..4).any(|i| on_side(k, corners, i) && on_side(l, corners, (i + 2) % 4))
}

/// Whether a segment covers most of a side: ends near its line, by 2 % of the quad's size or 3 px, and at least 60 % of
/// its length.
fn on_side(s: &EdgeSegment, corners: &[Point2<f64>; 4], side: usize) -> bool {
    let (from, to) = (corners[side], corners[(side + 1) % 4]);
    let (along, length) = ((to - from).normalize(), (to - from).norm());
    let tolerance_px = (0.02 * polygon::area(corners).sqrt()).max(3.0);
    let near = |e: &Point2<f64>| along.perp(&(e - from)).abs() <= tolerance_px;
    let at = |e: &Point2<f64>| along.dot(&(e - from)).clamp(0.0, length);
    near(&s.p_px) && near(&s.q_px) && (at(&s.p_px) - at(&s.q_px)).abs() >= 0.6 * length
}

/// What a fit found.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedSimilarity {
    /// Weights of the cues; they sum to 1.
    pub weights: [f64; 6],
    /// Smallest score: [`KEPT_SHARE`] of the pairs of opposite sides lie above it.
    pub min_score: f64,
    /// Pairs of opposite sides, and others.
    pub counts: [usize; 2],
    /// Mean cues of both.
    pub mean_cues: [[f64; 6]; 2],
    /// How often a pair of opposite sides scores above another pair, with the weights given at the start.
    pub order_before: f64,
    /// The same with fitted weights, each pair scored by a fit without its part of the photographs.
    pub order_after: f64,
    /// Share of the other pairs above the smallest score that keeps [`KEPT_SHARE`], before and (held out) after.
    pub passing: [f64; 2],
}

/// Fits the weights. `photograph` modulo [`FOLDS`] is the part of the cross-validation.
pub fn fit(pairs: &[LabelledPair], before: &SimilarityParams) -> Result<FittedSimilarity, CueFitError> {
    if pairs.len() > MAX_PAIRS_FITTED {
        return Err(CueFitError::TooMany(pairs.len()));
    }
    let weights = weights(pairs)?;
    let mean = |opposite: bool| {
        let of_kind = || pairs.iter().filter(move |s| s.opposite == opposite);
        let n = of_kind().count() as f64;
        std::array::from_fn(|c| of_kind().map(|s| s.cues[c]).sum::<f64>() / n)
    };
    let mut held_out = Vec::with_capacity(pairs.len());
    for fold in 0..FOLDS {
        let inside = |s: &&LabelledPair| s.photograph % FOLDS == fold;
        let rest: Vec<LabelledPair> = pairs.iter().filter(|s| !inside(s)).copied().collect();
        if pairs.iter().any(|s| inside(&s)) {
            let part = self::weights(&rest)?;
            held_out.extend(pairs.iter().filter(inside).map(|s| (score(&s.cues, &part), s.opposite)));
        }
    }
    let total: f64 = before.weights.iter().sum();
    let given = before.weights.map(|w| w / total.max(f64::MIN_POSITIVE));
    let scored = |w: &[f64; 6]| -> Vec<(f64, bool)> {
        pairs.iter().map(|s| (score(&s.cues, w), s.opposite)).collect()
    };
    let (start, fitted) = (scored(&given), scored(&weights));
    let opposite = pairs.iter().filter(|s| s.opposite).count();
    Ok(FittedSimilarity {
        weights,
        min_score: keeping(&fitted),
        counts: [opposite, pairs.len() - opposite],
        mean_cues: [mean(true), mean(false)],
        order_before: order(&start),
        order_after: order(&held_out),
        passing: [passing(&start), passing(&held_out)],
    })
}

fn score(cues: &[f64; 6], weights: &[f64; 6]) -> f64 {
    cues.iter().zip(weights).map(|(c, w)| c * w).sum()
}

/// Weights that sum to 1: coefficients of a logistic regression, none below zero, by Newton steps on one coefficient
/// after the other. The function is convex and each step lowers a bound on it, so it converges from anywhere.
fn weights(pairs: &[LabelledPair]) -> Result<[f64; 6], CueFitError> {
    let opposite = pairs.iter().filter(|s| s.opposite).count();
    let others = pairs.len() - opposite;
    if opposite.min(others) < MIN_PAIRS_OF_A_KIND {
        return Err(CueFitError::TooFew { pairs: opposite, others });
    }
    let share = |s: &LabelledPair| 0.5 / if s.opposite { opposite as f64 } else { others as f64 };
    let mut coefficients = [0.0; 7];
    let cue = |s: &LabelledPair, c: usize| if c < 6 { s.cues[c] } else { 1.0 };
    let mut logits = vec![0.0; pairs.len()];
    for _ in 0..MAX_ROUNDS {
        let mut moved: f64 = 0.0;
        for (c, coefficient) in coefficients.iter_mut().enumerate() {
            let ridge = if c < 6 { RIDGE } else { 0.0 };
            let (mut slope, mut bend) = (ridge * *coefficient, ridge + 1e-12);
            for (s, logit) in pairs.iter().zip(&logits) {
                let p = 1.0 / (1.0 + f64::exp(-logit));
                let (x, w) = (cue(s, c), share(s));
                slope += w * x * (p - f64::from(u8::from(s.opposite)));
                // A quarter bounds p (1 - p) from above.
                bend += w * x * x * 0.25;
            }
            let mut next = *coefficient - slope / bend;
            if c < 6 {
                next = next.max(0.0);
            }
            let step = next - *coefficient;
            if step.abs() > 0.0 {
                pairs.iter().zip(&mut logits).for_each(|(s, logit)| *logit += step * cue(s, c));
                *coefficient = next;
                moved = moved.max(step.abs());
            }
        }
        if moved < 1e-6 {
            break;
        }
    }
    let total: f64 = coefficients[..6].iter().sum();
    if total > 1e-9 {
        Ok(std::array::from_fn(|c| coefficients[c] / total))
    } else {
        Err(CueFitError::NothingTells)
    }
}

/// The score that [`KEPT_SHARE`] of the pairs of opposite sides exceed.
fn keeping(scored: &[(f64, bool)]) -> f64 {
    let mut scores: Vec<f64> = scored.iter().filter(|s| s.1).map(|s| s.0).collect();
    scores.sort_by(f64::total_cmp);
    let at = ((1.0 - KEPT_SHARE) * scores.len() as f64) as usize;
    scores.get(at).map_or(0.0, |s| s - 1e-9)
}

/// Share of the other pairs above that score.
fn passing(scored: &[(f64, bool)]) -> f64 {
    let least = keeping(scored);
    let (passed, all) = scored
        .iter()
        .filter(|s| !s.1)
        .fold((0_usize, 0_usize), |(passed, all), s| (passed + usize::from(s.0 > least), all + 1));
    passed as f64 / all.max(1) as f64
}

/// Probability that a pair of opposite sides scores above another pair, ties counting half (area under the curve).
fn order(scored: &[(f64, bool)]) -> f64 {
    let mut sorted = scored.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut below, mut wins, mut opposite) = (0.0, 0.0, 0.0);
    for tied in sorted.chunk_by(|a, b| a.0.total_cmp(&b.0).is_eq()) {
        let here = tied.iter().filter(|s| s.1).count() as f64;
        let others = tied.len() as f64 - here;
        wins += here * (below + 0.5 * others);
        below += others;
        opposite += here;
    }
    wins / f64::max(below * opposite, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::tests::{
        fixtures::{render, segment, sides},
        rendering::Noise,
    };

    /// Pairs whose first two cues tell, three times as much the first, the others being noise.
    fn judged(count: usize, seed: u64) -> Vec<LabelledPair> {
        let mut random = Noise(seed);
        (0..count)
            .map(|i| {
                let cues: [f64; 6] = std::array::from_fn(|_| random.uniform());
                let logit = 9.0 * cues[0] + 3.0 * cues[1] - 6.0;
                let opposite = random.uniform() < 1.0 / (1.0 + f64::exp(-logit));
                LabelledPair { cues, opposite, photograph: i / 40 }
            })
            .collect()
    }

    #[test]
    fn weights_that_made_the_data_come_back() {
        let fitted = fit(&judged(20_000, 1), &SimilarityParams::default()).unwrap();
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
        let pairs = judged(3000, 2);
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
    fn too_little_and_too_much_are_refused() {
        let pairs = judged(400, 3);
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
    fn pairs_are_judged_by_the_labels() {
        let outer = [[50.0, 40.0], [250.0, 40.0], [250.0, 190.0], [50.0, 190.0]];
        let inner = [[80.0, 70.0], [220.0, 70.0], [220.0, 160.0], [80.0, 160.0]];
        let mut segments = sides(outer, 1.0);
        segments.extend(sides(inner, 1.0));
        // Half of a side is not the side.
        segments.push(segment([50.0, 40.0], [140.0, 40.0]));
        let image = render(300, 230, 200, &[(outer, 60), (inner, 220)]);
        let found = crate::detect::relaxation::similarity::pairs(
            &segments,
            &image,
            &ungraded(&SimilarityParams::default()),
        );
        let labels = [Corners::try_from(outer).unwrap()];
        let judged = judge(&segments, &found, &labels, &[], 3);
        assert!(judged.iter().all(|j| j.photograph == 3));
        assert_eq!(judged.iter().filter(|j| j.opposite).count(), 2);
        let of = |pair: &SegmentPair| judge(&segments, std::slice::from_ref(pair), &labels, &[], 0);
        for pair in &found {
            match (pair.k, pair.l) {
                (0, 2) | (1, 3) => assert!(of(pair)[0].opposite),
                // Outer top and inner bottom overlap the label by more than half, as does the whole of the inner border's
                // height by width; nobody can say.
                (0, 6) | (2, 4) => assert!(of(pair).is_empty()),
                (2, 8) => assert!(of(pair).iter().all(|j| !j.opposite)),
                _ => {}
            }
        }
        // Without labels all are other pairs, unless a known quad explains them.
        assert!(judge_all(&segments, &found, &[]).iter().all(|j| !j.opposite));
        assert!(judge_all(&segments, &found, &labels).len() < found.len());
    }

    fn judge_all(segments: &[EdgeSegment], pairs: &[SegmentPair], others: &[Corners]) -> Vec<LabelledPair> {
        judge(segments, pairs, &[], others, 0)
    }
}
