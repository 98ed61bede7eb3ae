//! The sub-pixel points of one chain in, its straight pieces out (method 1.3): recursive splitting,
//! then merging of neighbours that are one line after all. Pieces are index ranges; lines are
//! fitted by the caller, from running sums.

use crate::geometry::line::{Line, LineSums};
use nalgebra::Point2;
use std::ops::Range;

/// Points at both ends of a piece that its line does not use: corners are rounded there.
pub(crate) const TRIM: usize = 2;
/// Distances taken side by side.
const ABREAST: usize = 4;

/// Tolerances of splitting and merging.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tolerance {
    /// Largest distance of a point from its piece, px.
    pub(crate) split_px: f64,
    /// Largest angle between neighbours that are merged, rad.
    pub(crate) merge_rad: f64,
}

/// A chain cut into straight pieces. Its memory serves chain after chain.
#[derive(Debug, Default)]
pub(crate) struct Polyline {
    /// The chain's points. A closed chain stands here twice, so that a piece may run over its end.
    x: Vec<f64>,
    y: Vec<f64>,
    /// `sums[i]` is over the first i of these points.
    sums: Vec<LineSums>,
    /// Point i here is point `(i + turn) % n` of the chain: a closed one is turned to start at a
    /// corner.
    pub(crate) turn: usize,
    chain_points: usize,
    closed: bool,
    /// Ranges of points, in order.
    pub(crate) pieces: Vec<Range<usize>>,
    /// The pieces with their ends moved by [`Self::grow`]; none for one without a line.
    pub(crate) grown: Vec<Option<Range<usize>>>,
    cuts: Vec<Range<usize>>,
    stack: Vec<Range<usize>>,
}

impl Polyline {
    /// Largest number of points by which a piece grows at one end.
    const MAX_GROWTH: usize = 16;

    /// Splits the points of a chain into straight pieces.
    pub(crate) fn cut(&mut self, points: impl Iterator<Item = Point2<f64>>, closed: bool, t: Tolerance) {
        self.load(points, closed);
        let n = self.chain_points;
        self.cuts.clear();
        if self.closed {
            let (a, b) = self.farthest_pair();
            self.turn_to(a);
            let opposite = (b + n - a) % n;
            self.split(0..opposite + 1, t.split_px);
            self.split(opposite..n + 1, t.split_px);
        } else if n > 1 {
            self.split(0..n, t.split_px);
        }
        self.merge(t);
    }

    fn load(&mut self, points: impl Iterator<Item = Point2<f64>>, closed: bool) {
        (self.turn, self.closed) = (0, closed);
        self.x.clear();
        self.y.clear();
        for p in points {
            self.x.push(p.x);
            self.y.push(p.y);
        }
        self.chain_points = self.x.len();
        self.closed &= self.chain_points > 2;
        self.sum_up();
    }

    /// Starts the closed chain at point `a` and writes it twice.
    fn turn_to(&mut self, a: usize) {
        self.turn = a;
        for axis in [&mut self.x, &mut self.y] {
            axis.rotate_left(a);
            axis.extend_from_within(..);
        }
        self.sum_up();
    }

    fn sum_up(&mut self) {
        self.sums.clear();
        let mut sums = LineSums::default();
        self.sums.push(sums);
        for (x, y) in self.x.iter().zip(&self.y) {
            sums.add(&Point2::new(*x, *y));
            self.sums.push(sums);
        }
    }

    fn merge(&mut self, t: Tolerance) {
        self.pieces.clear();
        for piece in &self.cuts {
            match self.pieces.last() {
                Some(last) if self.one_line(last, piece, t) => {
                    let start = last.start;
                    self.pieces.pop();
                    self.pieces.push(start..piece.end);
                }
                _ => self.pieces.push(piece.clone()),
            }
        }
        // The cut that opened a closed chain may lie within a side.
        if self.closed && self.pieces.len() > 2 {
            let (first, last) = (self.pieces[0].clone(), self.pieces[self.pieces.len() - 1].clone());
            let wrapped = first.start + self.chain_points..first.end + self.chain_points;
            if wrapped.end <= self.x.len() && self.one_line(&last, &wrapped, t) {
                self.pieces.pop();
                self.pieces[0] = last.start..wrapped.end;
            }
        }
    }

    /// Moves the ends of every piece to where the chain leaves its line by more than
    /// `tolerance_px`.
    pub(crate) fn grow(&mut self, tolerance_px: f64) {
        let mut grown = std::mem::take(&mut self.grown);
        grown.clear();
        grown.extend(self.pieces.iter().map(|piece| {
            let rough = self.sums(&interior(piece)).fit()?;
            Some(self.ends_on(piece, &rough.line, tolerance_px))
        }));
        self.grown = grown;
    }

    /// Whether a longer neighbour grew over most of grown piece `i`, which would be a second one on
    /// the same points.
    pub(crate) fn swallowed(&self, i: usize, piece: &Range<usize>) -> bool {
        let count = self.grown.len();
        let beside = [(i + 1) % count, (i + count - 1) % count];
        beside
            .into_iter()
            .filter(|j| *j != i)
            .filter_map(|j| self.grown[j].as_ref())
            .any(|other| other.len() > piece.len() && 3 * self.common(piece, other) > 2 * piece.len())
    }

    /// Number of points of `a` that are also in `b`, both at most one turn long.
    fn common(&self, a: &Range<usize>, b: &Range<usize>) -> usize {
        let n = self.chain_points;
        let start = (a.start + n - b.start % n) % n;
        let end = start + a.len();
        end.min(b.len()).saturating_sub(start) + end.min(n + b.len()).saturating_sub(n.max(start))
    }

    /// Moves both ends of a piece to where the chain leaves `line` by more than `tolerance_px`:
    /// splits fall a few points beside rounded corners. The result may exceed the buffer when the
    /// chain is closed, see [`Self::point`].
    pub(crate) fn ends_on(&self, piece: &Range<usize>, line: &Line, tolerance_px: f64) -> Range<usize> {
        let n = self.chain_points;
        let on = |i: usize| line.distance(&self.point(i)).abs() <= tolerance_px;
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
            let before = end - start;
            if start > first && end - start < n && on(start - 1) {
                start -= 1;
            }
            if end < last && end - start < n && on(end) {
                end += 1;
            }
            if end - start == before {
                break;
            }
        }
        start..end
    }

    /// Index in the buffer of point `i` of the chain as turned; a closed chain goes on for ever.
    pub(crate) fn wrapped(&self, mut i: usize) -> usize {
        while i >= self.chain_points {
            i -= self.chain_points;
        }
        i
    }

    /// Point `i` of the chain as turned.
    pub(crate) fn point(&self, i: usize) -> Point2<f64> {
        let i = self.wrapped(i);
        Point2::new(self.x[i], self.y[i])
    }

    /// Sums over a piece, which may exceed the buffer.
    pub(crate) fn sums(&self, piece: &Range<usize>) -> LineSums {
        let start = self.wrapped(piece.start);
        self.sums[start + piece.len()] - self.sums[start]
    }

    /// Two indices whose points are each the farthest from the other.
    fn farthest_pair(&self) -> (usize, usize) {
        let farthest = |from: usize| {
            let mut best = (0, -1.0);
            for (i, (x, y)) in self.x.iter().zip(&self.y).enumerate() {
                let d = (x - self.x[from]).powi(2) + (y - self.y[from]).powi(2);
                if d > best.1 {
                    best = (i, d);
                }
            }
            best
        };
        let (mut a, mut distance) = farthest(0);
        let (mut b, mut next) = farthest(a);
        // Each step makes the pair longer; a few reach a fixed point.
        while next > distance {
            (a, distance) = (b, next);
            (b, next) = farthest(a);
        }
        (a, b)
    }

    /// Ramer's recursion with its own stack; successive pieces share their corner point.
    fn split(&mut self, whole: Range<usize>, tolerance_px: f64) {
        self.stack.push(whole);
        while let Some(range) = self.stack.pop() {
            if let Some(at) = self.corner(&range, tolerance_px) {
                // The first part on top: pieces come out in order.
                self.stack.push(at..range.end);
                self.stack.push(range.start..at + 1);
            } else if range.len() > 1 {
                self.cuts.push(range);
            }
        }
    }

    /// Inner point with the largest distance to the chord of `range`, if that exceeds the
    /// tolerance; the first of equals.
    fn corner(&self, range: &Range<usize>, tolerance_px: f64) -> Option<usize> {
        if range.len() < 3 {
            return None;
        }
        let (first, last) = (self.point(range.start), self.point(range.end - 1));
        let (x, y) = (&self.x[range.start + 1..range.end - 1], &self.y[range.start + 1..range.end - 1]);
        let from_chord = |line: &Line, x: f64, y: f64| line.distance(&Point2::new(x, y)).abs();
        let at = if let Some(line) = Line::from_points(&first, &last) {
            first_farthest(x, y, tolerance_px, |x, y| from_chord(&line, x, y))
        } else {
            first_farthest(x, y, tolerance_px, |x, y| (Point2::new(x, y) - first).norm())
        };
        at.map(|i| range.start + 1 + i)
    }

    /// Whether two neighbouring pieces follow one line.
    fn one_line(&self, a: &Range<usize>, b: &Range<usize>, t: Tolerance) -> bool {
        let both = a.start..b.end;
        let fit = |range| self.sums(range).fit();
        let (Some(fa), Some(fb)) = (fit(a), fit(b)) else { return false };
        if fa.line.normal.perp(&fb.line.normal).abs() >= t.merge_rad.sin() {
            return false;
        }
        let Some(joint) = fit(&both) else { return false };
        let near = |(x, y): (&f64, &f64)| joint.line.distance(&Point2::new(*x, *y)).abs() <= t.split_px;
        self.x[both.clone()].iter().zip(&self.y[both]).all(near)
    }
}

/// Index of the first point of the largest distance, if that exceeds the tolerance.
#[inline]
fn first_farthest(x: &[f64], y: &[f64], tolerance: f64, distance: impl Fn(f64, f64) -> f64) -> Option<usize> {
    let greater = |a: f64, b: f64| if b > a { b } else { a };
    let ((x4, x_rest), (y4, y_rest)) = (x.as_chunks::<ABREAST>(), y.as_chunks::<ABREAST>());
    let mut best = [0.0; ABREAST];
    for (x, y) in x4.iter().zip(y4) {
        for i in 0..ABREAST {
            best[i] = greater(best[i], distance(x[i], y[i]));
        }
    }
    let mut largest = best.into_iter().fold(0.0, greater);
    for (x, y) in x_rest.iter().zip(y_rest) {
        largest = greater(largest, distance(*x, *y));
    }
    if largest > tolerance { x.iter().zip(y).position(|(x, y)| distance(*x, *y) >= largest) } else { None }
}

/// The points of a piece that its line uses.
pub(crate) fn interior(piece: &Range<usize>) -> Range<usize> {
    if piece.len() > 2 * TRIM + 3 { piece.start + TRIM..piece.end - TRIM } else { piece.clone() }
}

#[cfg(test)]
#[path = "polyline_tests.rs"]
mod tests;
