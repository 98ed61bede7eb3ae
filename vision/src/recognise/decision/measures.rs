//! Match candidates in, the features of the confidence model out.

use crate::recognise::decision::result::{Evidence, MatchCandidate};

/// Distances are capped here.
pub(crate) const FAR: f64 = 2.0;

/// H^r is divided by this.
const HAUSDORFF_UNIT: f64 = 10.0;

/// Number of measures.
pub const MEASURES: usize = 7;

/// Measures of candidate `best`, each the worse the larger, all within 0 to 2: D/tau and its
/// square, the share of it in the next best's and its square, C^r, H^r, and the number of
/// landmarks. `None` if there is no such candidate.
pub fn measures(candidates: &[MatchCandidate], best: usize, landmarks: usize) -> Option<[f64; MEASURES]> {
    let answer = candidates.get(best)?;
    let others = candidates.iter().enumerate().filter(|(i, _)| *i != best);
    let next = others.map(|(_, c)| c.ratio).fold(f64::INFINITY, f64::min);
    let alone = candidates.len() < 2;
    let margin = if alone { 0.0 } else { answer.ratio / next };
    let within = |x: f64| if x.is_finite() { x.clamp(0.0, FAR) } else { FAR };
    // An infinitely far runner-up is no reason for doubt, unless the best is infinitely far, too.
    let margin = if next.is_finite() || alone { margin } else { 0.0 };
    let (ratio, margin) = (within(answer.ratio), within(margin));
    // Distances that were not measured count as far.
    let (correlation, hausdorff) = match answer.evidence {
        Evidence::Icon(icon) => (icon.correlation, icon.hausdorff),
        Evidence::Points { .. } => (FAR, f64::INFINITY),
    };
    Some([
        ratio,
        0.5 * ratio * ratio,
        margin,
        0.5 * margin * margin,
        within(correlation),
        within(hausdorff / HAUSDORFF_UNIT),
        within(0.1 * (1.0 + landmarks as f64).ln()),
    ])
}
