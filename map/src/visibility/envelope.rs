//! Bounds over direction. A point (x, y) in front of the landmark is (slope, inverse) = (y / x, 1 /
//! x): straight lines stay straight, and nearer points have larger inverses. The nearest of many
//! bounds is therefore the upper envelope of straight pieces.

/// Slopes range from minus this to this.
pub(super) const MAX_SLOPE: f64 = 1.0;
/// Pieces narrower than this in slope, relative to it, are dropped.
const NARROW: f64 = 1e-12;

/// A straight bound from one slope to another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Piece {
    /// Slope at which it begins.
    pub from: f64,
    /// Slope at which it ends, larger than `from`.
    pub to: f64,
    /// The line: its value at a slope, and how it rises.
    anchor: (f64, f64),
    rise: f64,
}

impl Piece {
    /// A piece through two points (slope, inverse) in any order, cut to the range of slopes. `None`
    /// where nothing is left.
    pub(super) fn through(a: (f64, f64), b: (f64, f64)) -> Option<Self> {
        let (a, b) = if a.0 <= b.0 { (a, b) } else { (b, a) };
        let (from, to) = (a.0.max(-MAX_SLOPE), b.0.min(MAX_SLOPE));
        let wide = to - from > NARROW * (1.0 + from.abs());
        // The end nearer to the middle is numerically better.
        let anchor = if a.0.abs() <= b.0.abs() { a } else { b };
        let rise = (b.1 - a.1) / (b.0 - a.0);
        (wide && rise.is_finite()).then_some(Self { from, to, anchor, rise })
    }

    /// All that it consists of.
    pub(super) fn numbers(&self) -> [f64; 5] {
        [self.from, self.to, self.anchor.0, self.anchor.1, self.rise]
    }

    /// The piece that consists of these.
    pub(super) fn of_numbers([from, to, slope, inverse, rise]: [f64; 5]) -> Self {
        Self { from, to, anchor: (slope, inverse), rise }
    }

    /// Its value at a slope.
    pub(super) fn at(&self, slope: f64) -> f64 {
        self.anchor.1 + self.rise * (slope - self.anchor.0)
    }

    fn cut(&self, from: f64, to: f64) -> Self {
        Self { from, to, ..*self }
    }

    fn continues(&self, next: &Self) -> bool {
        #[expect(clippy::float_cmp, reason = "pieces of one line are copies of it")]
        let same = self.anchor == next.anchor && self.rise == next.rise && self.to == next.from;
        same
    }

    /// Slope at which two lines meet, if inside (from, to).
    fn meets(&self, other: &Self, from: f64, to: f64) -> Option<f64> {
        let slope = from + (other.at(from) - self.at(from)) / (self.rise - other.rise);
        (slope > from && slope < to).then_some(slope)
    }
}

/// The nearest of many bounds: pieces by slope, without overlap.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Envelope(Vec<Piece>);

impl Envelope {
    /// Of pieces in any order.
    pub(super) fn upper(mut pieces: Vec<Piece>) -> Self {
        pieces.sort_by(|a, b| a.from.total_cmp(&b.from).then(a.to.total_cmp(&b.to)));
        let mut level: Vec<Self> = pieces.into_iter().map(|p| Self(vec![p])).collect();
        while level.len() > 1 {
            level =
                level.chunks(2).map(|pair| pair.iter().cloned().reduce(merged).unwrap_or_default()).collect();
        }
        level.pop().unwrap_or_default()
    }

    /// What of it lies within ranges of slopes, which are in order.
    pub(super) fn within(&self, open: &[(f64, f64)]) -> Self {
        let mut made = Self::default();
        let mut next = 0;
        for (from, to) in open {
            while self.0.get(next).is_some_and(|p| p.to <= *from) {
                next += 1;
            }
            // The last of them may reach into the next range.
            let inside = self.0[next..].iter().take_while(|p| p.from < *to);
            made.0.extend(inside.map(|p| p.cut(p.from.max(*from), p.to.min(*to))));
        }
        made
    }

    /// Of the pieces of an envelope.
    pub(super) fn of_pieces(pieces: Vec<Piece>) -> Self {
        Self(pieces)
    }

    /// The pieces, by slope.
    pub(super) fn pieces(&self) -> &[Piece] {
        &self.0
    }

    /// Its value at a slope; at the common end of two pieces, the larger. `None` without a bound.
    pub(super) fn at(&self, slope: f64) -> Option<f64> {
        let next = self.0.partition_point(|p| p.from <= slope);
        let before = self.0[..next].iter().rev().take(2);
        before.filter(|p| slope <= p.to).map(|p| p.at(slope)).reduce(f64::max)
    }

    fn push(&mut self, piece: Piece) {
        match self.0.last_mut() {
            Some(last) if last.continues(&piece) => last.to = piece.to,
            _ => self.0.push(piece),
        }
    }
}

/// The upper envelope of two.
#[expect(clippy::needless_pass_by_value, reason = "both are used up")]
fn merged(a: Envelope, b: Envelope) -> Envelope {
    let mut made = Envelope(Vec::with_capacity(a.0.len() + b.0.len()));
    let (mut i, mut j, mut at) = (0, 0, f64::NEG_INFINITY);
    loop {
        let (pa, pb) = (a.0.get(i), b.0.get(j));
        // Where both of them have their next change.
        let ends = |p: &Piece| if p.from > at { p.from } else { p.to };
        let Some(next) = [pa, pb].into_iter().flatten().map(ends).reduce(f64::min) else { return made };
        let covers = |p: &&Piece| p.from <= at && p.to > at;
        match (pa.filter(covers), pb.filter(covers)) {
            (Some(p), None) | (None, Some(p)) => made.push(p.cut(at, next)),
            (Some(p), Some(q)) => push_higher(&mut made, p, q, (at, next)),
            (None, None) => {}
        }
        at = next;
        i += usize::from(pa.is_some_and(|p| p.to <= at));
        j += usize::from(pb.is_some_and(|p| p.to <= at));
    }
}

fn push_higher(made: &mut Envelope, p: &Piece, q: &Piece, (from, to): (f64, f64)) {
    let higher = |from: f64, to: f64| {
        let middle = 0.5 * (from + to);
        if p.at(middle) >= q.at(middle) { p.cut(from, to) } else { q.cut(from, to) }
    };
    match p.meets(q, from, to) {
        Some(meet) => {
            made.push(higher(from, meet));
            made.push(higher(meet, to));
        }
        None => made.push(higher(from, to)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(from: f64, to: f64, start: f64, end: f64) -> Piece {
        Piece::through((from, start), (to, end)).unwrap()
    }

    #[test]
    fn two_that_cross_give_the_higher_of_each() {
        let e = Envelope::upper(vec![piece(-1.0, 1.0, 0.0, 2.0), piece(-1.0, 1.0, 2.0, 0.0)]);
        assert_eq!(e.pieces().len(), 2);
        assert!((e.at(0.0).unwrap() - 1.0).abs() < 1e-12);
        assert!((e.at(-0.5).unwrap() - 1.5).abs() < 1e-12 && (e.at(0.75).unwrap() - 1.75).abs() < 1e-12);
        assert_eq!(e.at(1.1), None);
    }

    #[test]
    fn covered_pieces_vanish_and_gaps_stay() {
        let e = Envelope::upper(vec![
            piece(0.0, 0.5, 1.0, 1.0),
            piece(0.1, 0.2, 0.5, 0.5),
            piece(0.3, 0.4, 2.0, 2.0),
            piece(0.7, 1.0, 1.0, 2.0),
        ]);
        let spans = |e: &Envelope| e.pieces().iter().map(|p| (p.from, p.to)).collect::<Vec<_>>();
        assert_eq!(spans(&e), [(0.0, 0.3), (0.3, 0.4), (0.4, 0.5), (0.7, 1.0)]);
        assert_eq!(e.at(0.6), None);
        assert!((e.at(0.3).unwrap() - 2.0).abs() < 1e-12, "the nearer bound at a step");
        let some = e.within(&[(-0.5, 0.1), (0.2, 0.35), (0.38, 0.8)]);
        let expected = [(0.0, 0.1), (0.2, 0.3), (0.3, 0.35), (0.38, 0.4), (0.4, 0.5), (0.7, 0.8)];
        assert_eq!(spans(&some), expected);
        assert!(e.within(&[]).pieces().is_empty());
    }

    #[test]
    fn pieces_beyond_the_largest_slope_are_cut() {
        let p = piece(-3.0, 0.5, 0.0, 3.5);
        assert!((p.from + 1.0).abs() < 1e-15 && (p.at(0.0) - 3.0).abs() < 1e-12);
        assert_eq!(Piece::through((1.0, 1.0), (2.0, 1.0)), None);
    }

    #[test]
    fn many_are_the_largest_everywhere() {
        // Oracle: the largest of all pieces at each of many slopes.
        let mut state = 7_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let pieces: Vec<_> = (0..300)
            .filter_map(|_| {
                let from = 2.0 * next() - 1.0;
                Piece::through((from, next()), (from + 0.5 * next(), next()))
            })
            .collect();
        let e = Envelope::upper(pieces.clone());
        for k in 0..4000 {
            let slope = -1.1 + 2.2 * f64::from(k) / 4000.0;
            let covering = pieces.iter().filter(|p| p.from <= slope && slope <= p.to);
            let expected = covering.map(|p| p.at(slope)).reduce(f64::max);
            match (e.at(slope), expected) {
                (None, None) => {}
                (Some(a), Some(b)) => assert!((a - b).abs() < 1e-9, "{slope}: {a} for {b}"),
                (a, b) => panic!("{slope}: {a:?} for {b:?}"),
            }
        }
    }
}
