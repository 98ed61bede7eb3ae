//! Match candidates in, the measures that the confidence of an identity rests on out.

use crate::recognise::decision::result::MatchCandidate;

/// Distances are measured up to here, as no distance is as bad as a large one.
pub(crate) const FAR: f64 = 2.0;

/// H^r is counted in units of this.
const HAUSDORFF_UNIT: f64 = 10.0;

/// Numbers that a confidence rests on.
pub const MEASURES: usize = 7;

/// What a verdict knows for and against its candidate `best`, each the worse the larger, all within 0 to 2: D/tau and
/// its square, the share of it in the next best's and its square, C^r, H^r, and how many landmarks there were to err
/// with. `None` if there is no such candidate.
pub fn measures(candidates: &[MatchCandidate], best: usize, landmarks: usize) -> Option<[f64; MEASURES]> {
    let answer = candidates.get(best)?;
    let others = candidates.iter().enumerate().filter(|(i, _)| *i != best);
    let next = others.map(|(_, c)| c.ratio).fold(f64::INFINITY, f64::min);
    let alone = candidates.len() < 2;
    let margin = if alone { 0.0 } else { answer.ratio / next };
    let within = |x: f64| if x.is_finite() { x.clamp(0.0, FAR) } else { FAR };
    // A next best that is infinitely far is no reason for doubt, unless so is the answer.
    let margin = if next.is_finite() || alone { margin } else { 0.0 };
    let (ratio, margin) = (within(answer.ratio), within(margin));
    Some([
        ratio,
        0.5 * ratio * ratio,
        margin,
        0.5 * margin * margin,
        within(answer.correlation),
        within(answer.hausdorff / HAUSDORFF_UNIT),
        within(0.1 * (1.0 + landmarks as f64).ln()),
    ])
}
