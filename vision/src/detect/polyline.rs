//! The sub-pixel points of one chain in, its straight pieces out (method 1.3): recursive splitting, then merging of
//! neighbours that are one line after all. Pieces are index ranges; lines are fitted by the caller.

use crate::geometry::line::{Line, LineSums};
use nalgebra::Point2;
use std::ops::Range;

/// Points at both ends of a piece that its line does not use: corners are rounded there.
pub(crate) const TRIM: usize = 2;

/// Tolerances of splitting and merging.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tolerance {
    /// Largest distance of a point from its piece, px.
    pub(crate) split_px: f64,
    /// Largest angle between neighbours that are merged, rad.
    pub(crate) merge_rad: f64,
}

/// A chain cut into straight pieces.
#[derive(Debug)]
pub(crate) struct Polyline {
    /// The chain's points. A closed chain stands here twice, so that a piece may run over its end.
    pub(crate) points: Vec<Point2<f64>>,
    /// `points[i]` is point `(i + turn) % n` of the chain: a closed one is turned to start at a corner.
    pub(crate) turn: usize,
    /// Points of the chain.
    chain_points: usize,
    closed: bool,
    /// Ranges in `points`, in order.
    pub(crate) pieces: Vec<Range<usize>>,
}

/// Splits the points of a chain into straight pieces.
pub(crate) fn polyline(points: &[Point2<f64>], closed: bool, t: Tolerance) -> Polyline {
    let mut buffer = points.to_vec();
    let n = points.len();
    let mut cuts = Vec::new();
    let mut turn = 0;
    if closed && n > 2 {
        let (a, b) = farthest_pair(points);
        turn = a;
        buffer.rotate_left(a);
        buffer.extend_from_within(..);
        let opposite = (b + n - a) % n;
        split(&buffer, 0..opposite + 1, t.split_px, &mut cuts);
        split(&buffer, opposite..n + 1, t.split_px, &mut cuts);
    } else if n > 1 {
        split(&buffer, 0..n, t.split_px, &mut cuts);
    }
    let mut merged: Vec<Range<usize>> = Vec::new();
    for piece in cuts {
        match merged.last() {
            Some(last) if one_line(&buffer, last, &piece, t) => {
                let start = last.start;
                merged.pop();
                merged.push(start..piece.end);
            }
            _ => merged.push(piece),
        }
    }
    // The cut that opened a closed chain may lie within a side.
    if closed && merged.len() > 2 {
        let (first, last) = (merged[0].clone(), merged[merged.len() - 1].clone());
        let wrapped = first.start + n..first.end + n;
        if wrapped.end <= buffer.len() && one_line(&buffer, &last, &wrapped, t) {
            merged.pop();
            merged[0] = last.start..wrapped.end;
        }
    }
    Polyline { points: buffer, turn, chain_points: n, closed, pieces: merged }
}

impl Polyline {
    /// Largest number of points by which a piece grows at one end.
    const MAX_GROWTH: usize = 16;

    /// Moves both ends of a piece to where the chain leaves `line` by more than `tolerance_px`: splits fall a few
    /// points beside rounded corners. The result may exceed the buffer when the chain is closed, see [`Self::point`].
    pub(crate) fn ends_on(&self, piece: &Range<usize>, line: &Line, tolerance_px: f64) -> Range<usize> {
        let n = self.chain_points;
        let on = |i: usize| line.distance(self.point(i)).abs() <= tolerance_px;
        // One turn ahead, so that a closed chain can be walked backwards from its first point.
        let lift = if self.closed { n } else { 0 };
        let (mut start, mut end) = (piece.start + lift, piece.end + lift);
        while end - start > 2 && !on(start) {
            start += 1;
        }
        while end - start > 2 && !on(end - 1) {
            end -= 1;
        }
        let (first, last) = if self.closed { (0, 4 * n) } else { (0, n) };
        for _ in 0..Self::MAX_GROWTH {
            if start > first && end - start < n && on(start - 1) {
                start -= 1;
            }
            if end < last && end - start < n && on(end) {
                end += 1;
            }
        }
        start..end
    }

    /// Point `i` of the chain as turned; a closed chain goes on for ever.
    pub(crate) fn point(&self, i: usize) -> &Point2<f64> {
        &self.points[i % self.chain_points]
    }
}

/// The points of a piece that its line uses.
pub(crate) fn interior(piece: &Range<usize>) -> Range<usize> {
    if piece.len() > 2 * TRIM + 3 { piece.start + TRIM..piece.end - TRIM } else { piece.clone() }
}

/// Two indices whose points are each the farthest from the other.
fn farthest_pair(points: &[Point2<f64>]) -> (usize, usize) {
    let farthest = |from: &Point2<f64>| {
        let mut best = (0, -1.0);
        for (i, p) in points.iter().enumerate() {
            let d = (p - from).norm_squared();
            if d > best.1 {
                best = (i, d);
            }
        }
        best
    };
    let (mut a, mut distance) = farthest(&points[0]);
    let (mut b, mut next) = farthest(&points[a]);
    // Each step makes the pair longer; a few reach a fixed point.
    while next > distance {
        (a, distance) = (b, next);
        (b, next) = farthest(&points[a]);
    }
    (a, b)
}

/// Ramer's recursion with its own stack; successive pieces share their corner point.
fn split(points: &[Point2<f64>], whole: Range<usize>, tolerance_px: f64, pieces: &mut Vec<Range<usize>>) {
    let mut stack = vec![whole];
    while let Some(range) = stack.pop() {
        let (at, distance) = farthest_from_chord(points, &range);
        if distance > tolerance_px {
            // The first part on top: pieces come out in order.
            stack.push(at..range.end);
            stack.push(range.start..at + 1);
        } else if range.len() > 1 {
            pieces.push(range);
        }
    }
}

/// Inner point with the largest distance to the chord of `range`.
fn farthest_from_chord(points: &[Point2<f64>], range: &Range<usize>) -> (usize, f64) {
    let (first, last) = (points[range.start], points[range.end - 1]);
    let chord = Line::from_points(&first, &last);
    let mut best = (range.start, 0.0);
    for (i, p) in points[range.clone()].iter().enumerate() {
        let d = chord.map_or_else(|| (p - first).norm(), |line| line.distance(p).abs());
        if d > best.1 && i > 0 && i + 1 < range.len() {
            best = (range.start + i, d);
        }
    }
    best
}

/// Whether two neighbouring pieces follow one line.
fn one_line(points: &[Point2<f64>], a: &Range<usize>, b: &Range<usize>, t: Tolerance) -> bool {
    let fit = |range: &Range<usize>| points[range.clone()].iter().copied().collect::<LineSums>().fit();
    let (Some(fa), Some(fb), Some(joint)) = (fit(a), fit(b), fit(&(a.start..b.end))) else { return false };
    fa.line.normal.perp(&fb.line.normal).abs() < t.merge_rad.sin()
        && points[a.start..b.end].iter().all(|p| joint.line.distance(p).abs() <= t.split_px)
}

#[cfg(test)]
mod tests {
    use super::*;

    const T: Tolerance = Tolerance { split_px: 1.5, merge_rad: 0.052 };

    fn walk(corners: &[(f64, f64)]) -> Vec<Point2<f64>> {
        corners
            .windows(2)
            .flat_map(|w| {
                let (a, b) = (Point2::new(w[0].0, w[0].1), Point2::new(w[1].0, w[1].1));
                let steps = (b - a).norm() as usize;
                (0..steps).map(move |i| a + (b - a) * (i as f64 / steps as f64))
            })
            .collect()
    }

    #[test]
    fn corners_split_an_open_chain() {
        let points = walk(&[(0.0, 0.0), (40.0, 0.0), (40.0, 30.0), (90.0, 30.0)]);
        assert_eq!(polyline(&points, false, T).pieces, [0..41, 40..71, 70..120]);
    }

    #[test]
    fn a_closed_chain_gives_its_sides_wherever_it_starts() {
        let mut points = walk(&[(10.0, 10.0), (90.0, 10.0), (90.0, 60.0), (10.0, 60.0), (10.0, 10.0)]);
        for _ in 0..points.len() {
            points.rotate_left(1);
            let Polyline { points: buffer, pieces, .. } = polyline(&points, true, T);
            let mut lengths: Vec<f64> =
                pieces.iter().map(|r| (buffer[r.end - 1] - buffer[r.start]).norm().round()).collect();
            lengths.sort_by(f64::total_cmp);
            assert_eq!(pieces.len(), 4, "{pieces:?}");
            assert!(
                lengths.iter().zip([50.0, 50.0, 80.0, 80.0]).all(|(a, b)| (a - b).abs() < 2.1),
                "{lengths:?}"
            );
        }
    }

    #[test]
    fn splits_that_were_not_needed_are_merged() {
        // A bow 2.1 px high: too far from the chord, not from the common line.
        let bow = |i: i32| 2.1 * (1.0 - (f64::from(i) / 100.0 - 1.0).powi(2));
        let points: Vec<_> = (0..=200).map(|i| Point2::new(f64::from(i), bow(i))).collect();
        let merged = polyline(&points, false, T).pieces;
        let mut cuts = vec![];
        split(&points, 0..points.len(), T.split_px, &mut cuts);
        assert_eq!((cuts.len(), merged.len()), (2, 1));
    }

    #[test]
    fn degenerate_chains_are_no_trouble() {
        let same = [Point2::new(3.0, 3.0); 7];
        for closed in [false, true] {
            assert!(polyline(&[], closed, T).pieces.is_empty());
            assert!(polyline(&same[..1], closed, T).pieces.is_empty());
            assert!(polyline(&same, closed, T).pieces.len() <= 2);
            assert_eq!(polyline(&walk(&[(0.0, 0.0), (2.0, 0.0)]), closed, T).pieces.len(), 1);
        }
    }
}
