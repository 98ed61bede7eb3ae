//! Sets of three sides of the paper's grouping (method 3.5): pairs that pass 2 left over, closed by
//! a segment that pass 1 left over. Doors and occluded posters. They stay three-sided.

use crate::{
    detect::{
        proposals::quad_seed::{QuadSeed, corner_of, plausible},
        segments::edge_segments::EdgeSegment,
    },
    paper::relaxation::similarity::SegmentPair,
};

/// Three-sided seeds, best first: greedy, every segment used once. `left` are the pairs without a
/// quad, `taken` says which segments belong to a matched pair or a quad already.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::tests::fixtures::segment;

    fn pair(closing: [Option<(usize, f64)>; 2]) -> SegmentPair {
        let quad_px = [[20.0, 100.0], [20.0, 20.0], [80.0, 20.0], [80.0, 100.0]].map(Into::into);
        SegmentPair { k: 0, l: 1, score: 0.9, cues: [1.0; 6], quad_px, closing }
    }

    #[test]
    fn a_door_is_closed_by_the_chord_of_its_lower_ends() {
        let segments = [
            segment([20.0, 100.0], [20.0, 20.0]),
            segment([80.0, 100.0], [80.0, 20.0]),
            segment([22.0, 20.0], [78.0, 20.0]),
        ];
        let door = pair([Some((2, 0.95)), None]);
        let seeds = three_sided(&segments, &[door.clone(), door], &[true, true, false], 0.5, (200, 200));
        // Each segment is used once, so the twin gives no second set.
        assert_eq!(seeds.len(), 1);
        assert_eq!(seeds[0].sides, [Some(0), Some(2), Some(1), None]);
        for (got, wanted) in
            seeds[0].corners_px.iter().zip([[20.0, 100.0], [20.0, 20.0], [80.0, 20.0], [80.0, 100.0]])
        {
            assert!((got - nalgebra::Point2::from(wanted)).norm() < 1e-9);
        }
        let far = pair([Some((2, 0.45)), None]);
        assert!(three_sided(&segments, &[far], &[true, true, false], 0.5, (200, 200)).is_empty());
        let taken = pair([Some((2, 0.95)), None]);
        assert!(three_sided(&segments, &[taken], &[true, true, true], 0.5, (200, 200)).is_empty());
    }
}
