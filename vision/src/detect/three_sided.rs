//! Sets of three sides (method 3.5): what pass 2 left over, closed by a segment that pass 1 left over. Doors and
//! occluded posters. Whoever confirms the fourth side makes them full quads; here they stay three-sided.

use super::{
    grouping::{QuadSeed, plausible},
    segments::EdgeSegment,
    similarity::{SegmentPair, corner_of},
};

/// Three-sided seeds, best first: greedy, every segment used once. `left` are the pairs without a quad, `taken` says
/// which segments belong to a matched pair or a quad already.
pub fn three_sided(
    segments: &[EdgeSegment],
    left: &[SegmentPair],
    taken: &[bool],
    min_closing: f64,
    image_size: (usize, usize),
) -> Vec<QuadSeed> {
    let mut found: Vec<(f64, usize, usize, QuadSeed)> = Vec::new();
    for (i, pair) in left.iter().enumerate() {
        for end in [0, 1] {
            let Some((m, c5)) = pair.closing[end] else { continue };
            if c5 < min_closing || taken[m] {
                continue;
            }
            let score = f64::midpoint(pair.score, c5);
            found.extend(seed(segments, pair, end, m, image_size).map(|s| (score, i, end, s)));
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut used = vec![false; segments.len()];
    found.retain(|(_, _, _, seed)| {
        let free = seed.sides.iter().flatten().all(|s| !used[*s]);
        if free {
            seed.sides.iter().flatten().for_each(|s| used[*s] = true);
        }
        free
    });
    found.into_iter().map(|f| f.3).collect()
}

/// Chain k-m-l with the chord of the free ends as its fourth side.
fn seed(
    segments: &[EdgeSegment],
    pair: &SegmentPair,
    end: usize,
    m: usize,
    image_size: (usize, usize),
) -> Option<QuadSeed> {
    let q = &pair.quad_px;
    let (first, second, start, stop) =
        if end == 0 { (pair.k, pair.l, q[0], q[3]) } else { (pair.l, pair.k, q[2], q[1]) };
    let a = corner_of(&segments[first], &segments[m])?;
    let b = corner_of(&segments[m], &segments[second])?;
    let corners_px = [start, a, b, stop];
    plausible(&corners_px, image_size).then(|| QuadSeed {
        sides: [Some(first), Some(m), Some(second), None],
        corners_px,
        similarity: pair.score,
        fit: pair.closing[end].map_or(0.0, |c| c.1),
    })
}
