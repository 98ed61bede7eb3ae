//! Weights of the cues from labelled photographs (method 2): pairs of segments that lie on opposite
//! sides of a labelled quad against all others that pass the gates. Logistic regression with
//! weights of at least zero, both classes with the same total weight. Every photograph is scored by
//! a fit without its fifth of the photographs. Reads no files.

use nalgebra::Point2;
use vision::{
    detect::segments::edge_segments::EdgeSegment,
    geometry::{corners::Corners, polygon},
    paper::relaxation::similarity::{SegmentPair, SimilarityParams},
};

/// Most labelled pairs of one fit.
pub(crate) const MAX_PAIRS_FITTED: usize = 1_000_000;
/// Fewest pairs of either kind.
pub(crate) const MIN_PAIRS_OF_A_KIND: usize = 20;
/// Parts of the cross-validation.
pub(crate) const FOLDS: usize = 5;
/// Share of the true pairs that score above `min_score`.
pub(crate) const RECALL_SHARE: f64 = 0.95;
/// Weight of the squared coefficients; correlated cues then share their weight.
const RIDGE: f64 = 1e-4;
/// Rounds over all coefficients.
const MAX_ROUNDS: usize = 200;

/// Why there is no fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(crate) enum CueFitError {
    /// Too few pairs of one kind.
    #[error(
        "{pairs} pairs of opposite sides and {others} others: at least {MIN_PAIRS_OF_A_KIND} of each needed"
    )]
    TooFew {
        /// Pairs of opposite sides.
        pairs: usize,
        others: usize,
    },
    /// More pairs than [`MAX_PAIRS_FITTED`].
    #[error("{0} pairs, {MAX_PAIRS_FITTED} at most")]
    TooMany(usize),
    /// No cue separates the two kinds.
    #[error("no cue separates opposite sides from other pairs")]
    NothingTells,
}

/// A candidate pair with its label.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LabelledPair {
    /// c1 to c6.
    pub(crate) cues: [f64; 6],
    /// Opposite sides of a labelled quad.
    pub(crate) opposite: bool,
    /// The photograph it comes from.
    pub(crate) photograph: usize,
}

/// Parameters of [`vision::paper::relaxation::similarity::pairs`] that keep every pair that passes
/// the gates, whatever its score.
pub(crate) fn ungraded(p: &SimilarityParams) -> SimilarityParams {
    SimilarityParams {
        min_score: 0.0,
        max_candidates: vision::paper::relaxation::labelling::MAX_ROW_CANDIDATES,
        ..p.clone()
    }
}

/// Labels candidate pairs by labelled quads. A pair along another border of a labelled object
/// (`IoU` of half with it), or along one of `others` (real quads that do not count), is left out:
/// it is neither.
pub(crate) fn label_pairs(
    segments: &[EdgeSegment],
    pairs: &[SegmentPair],
    labelled: &[Corners],
    others: &[Corners],
    photograph: usize,
) -> Vec<LabelledPair> {
    let labelled = |pair: &SegmentPair| {
        let (k, l) = (&segments[pair.k], &segments[pair.l]);
        let opposite = labelled.iter().any(|q| opposite_sides(k, l, q.points()));
        let near = |q: &Corners| polygon::iou(&pair.quad_px, q.points()) >= 0.5;
        let fair = opposite || !labelled.iter().chain(others).any(near);
        fair.then_some(LabelledPair { cues: pair.cues, opposite, photograph })
    };
    pairs.iter().filter_map(labelled).collect()
}

/// Whether two segments lie on opposite sides of a quad.
fn opposite_sides(k: &EdgeSegment, l: &EdgeSegment, corners: &[Point2<f64>; 4]) -> bool {
    (0..4).any(|i| on_side(k, corners, i) && on_side(l, corners, (i + 2) % 4))
}

/// Whether a segment covers most of a side: ends near its line, by 2 % of the quad's size or 3 px,
/// and at least 60 % of its length.
fn on_side(s: &EdgeSegment, corners: &[Point2<f64>; 4], side: usize) -> bool {
    let (from, to) = (corners[side], corners[(side + 1) % 4]);
    let (along, length) = ((to - from).normalize(), (to - from).norm());
    let tolerance_px = (0.02 * polygon::area(corners).sqrt()).max(3.0);
    let near = |e: &Point2<f64>| along.perp(&(e - from)).abs() <= tolerance_px;
    let at = |e: &Point2<f64>| along.dot(&(e - from)).clamp(0.0, length);
    near(&s.p_px) && near(&s.q_px) && (at(&s.p_px) - at(&s.q_px)).abs() >= 0.6 * length
}

/// A fit with its figures.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FittedSimilarity {
    /// Weights of the cues; they sum to 1.
    pub(crate) weights: [f64; 6],
    /// Smallest score: [`RECALL_SHARE`] of the pairs of opposite sides lie above it.
    pub(crate) min_score: f64,
    /// Pairs of opposite sides, and others.
    pub(crate) counts: [usize; 2],
    /// Mean cues of both.
    pub(crate) mean_cues: [[f64; 6]; 2],
    /// Share of comparisons in which a pair of opposite sides scores above another pair, with the
    /// previous weights.
    pub(crate) order_before: f64,
    /// The same with fitted weights, each pair scored by a fit without its part of the photographs.
    pub(crate) order_after: f64,
    /// Share of the other pairs above the smallest score that keeps [`RECALL_SHARE`], before and
    /// (held out) after.
    pub(crate) passing: [f64; 2],
}

/// Fits the weights. `photograph` modulo [`FOLDS`] is the part of the cross-validation.
pub(crate) fn fit(
    pairs: &[LabelledPair],
    before: &SimilarityParams,
) -> Result<FittedSimilarity, CueFitError> {
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

/// Weights that sum to 1: coefficients of a logistic regression, none below zero, by Newton steps
/// on one coefficient after the other. The function is convex and each step lowers a bound on it,
/// so it converges from anywhere.
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

/// The score that [`RECALL_SHARE`] of the pairs of opposite sides exceed.
fn keeping(scored: &[(f64, bool)]) -> f64 {
    let mut scores: Vec<f64> = scored.iter().filter(|s| s.1).map(|s| s.0).collect();
    scores.sort_by(f64::total_cmp);
    let at = ((1.0 - RECALL_SHARE) * scores.len() as f64) as usize;
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

/// Area under the ROC curve: probability that a pair of opposite sides scores above another pair,
/// ties counting half.
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
mod tests;
