//! Straight fragments in, fragments of one line joined out (method 1.3): corners, junctions and
//! clutter break sides into fragments.

use crate::geometry::line::{LineFit, LineSums};
use nalgebra::{Point2, Vector2};

/// Most segments of one image; the longest are kept.
pub const MAX_SEGMENTS: usize = 500;

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SegmentParams {
    /// Largest distance of an edge point from its straight piece, px.
    pub split_px: f64,
    /// Largest angle between neighbouring pieces of a chain that are merged, degrees.
    pub merge_angle_deg: f64,
    /// A piece ends where its chain leaves the fitted line by more than this, px.
    ///
    /// Departs from method 1.3, where a piece ends at its splits: those fall a few points beside a
    /// rounded corner.
    pub end_px: f64,
    /// Pieces shorter than this take no part in joining, px.
    pub min_fragment_px: f64,
    /// Largest angle between fragments that are joined, degrees.
    pub join_angle_deg: f64,
    /// Largest distance across the line between fragments that are joined, px.
    pub join_lateral_px: f64,
    /// Largest gap between fragments that are joined, as share of the joint length.
    pub join_gap_share: f64,
    /// Shortest segment, as share of the image width.
    pub min_length_share: f64,
    /// Lower and upper bound of the shortest segment, px: small images keep what noise cannot make,
    /// large ones keep the sides of small quads.
    ///
    /// Departs from method 1.4, which has the share of the width alone.
    pub min_length_range_px: [f64; 2],
    /// Most segments, longest first; at most [`MAX_SEGMENTS`].
    pub max_segments: usize,
}

impl Default for SegmentParams {
    fn default() -> Self {
        Self {
            split_px: 1.5,
            merge_angle_deg: 3.0,
            end_px: 1.0,
            min_fragment_px: 8.0,
            join_angle_deg: 2.0,
            join_lateral_px: 1.5,
            join_gap_share: 0.1,
            min_length_share: 0.04,
            min_length_range_px: [12.0, 25.0],
            max_segments: MAX_SEGMENTS,
        }
    }
}

/// Side of a grid cell in which ends are looked up.
const CELL_PX: f64 = 16.0;
/// Most fragments that take part, the longest first; the rest stays as it is.
const MAX_FRAGMENTS: usize = 8192;
/// Rounds of merging; each at least halves what still has a partner.
const MAX_ROUNDS: usize = 8;

/// A straight run of edge points, with all sums that a refit needs.
#[derive(Debug, Clone)]
pub(crate) struct Fragment {
    /// Points the line is fitted on.
    pub(crate) sums: LineSums,
    pub(crate) fit: LineFit,
    /// Sum of the gradients; tells the bright side.
    pub(crate) gradient: Vector2<f64>,
    /// Sum of the gradients' magnitudes over all points.
    pub(crate) magnitude: f64,
    /// Ends, on the fitted line; the bright side is on the right from `p` to `q`.
    pub(crate) p: Point2<f64>,
    pub(crate) q: Point2<f64>,
    pub(crate) chain: usize,
}

impl Fragment {
    /// None when the points have no line.
    pub(crate) fn new(
        sums: LineSums,
        gradient: Vector2<f64>,
        magnitude: f64,
        ends: &[Point2<f64>],
        chain: usize,
    ) -> Option<Self> {
        let mut fit = sums.fit()?;
        if fit.line.normal.dot(&gradient) < 0.0 {
            fit.line = fit.line.flipped();
        }
        let d = fit.line.direction();
        let along = |p: &&Point2<f64>| d.dot(&p.coords);
        let first = ends.iter().min_by(|a, b| along(a).total_cmp(&along(b)))?;
        let last = ends.iter().max_by(|a, b| along(a).total_cmp(&along(b)))?;
        let (p, q) = (fit.line.project(first), fit.line.project(last));
        Some(Self { sums, fit, gradient, magnitude, p, q, chain })
    }

    pub(crate) fn length_px(&self) -> f64 {
        (self.q - self.p).norm()
    }

    /// Whether `other` may continue this line; most neighbours fail here. `self` is the longer one.
    #[inline]
    fn continues(&self, other: &Place, gates: &Gates) -> bool {
        let d = self.fit.line.direction();
        let dx = other.q - other.p;
        let (own, length) = (d.dot(&(self.q - self.p)), dx.norm());
        if d.dot(&dx) <= 0.0 || d.perp(&dx).abs() > gates.max_sin * length {
            return false;
        }
        let lateral = |e: &Point2<f64>| self.fit.line.distance(e).abs();
        if lateral(&other.p).max(lateral(&other.q)) > gates.lateral_px {
            return false;
        }
        let gap = d.dot(&(other.p - self.q)).max(d.dot(&(self.p - other.q)));
        gap <= gates.gap_share * (own + length + gap) && gap >= -2.0 * gates.lateral_px
    }

    /// Both as one, if they follow one line closely enough.
    fn joined(&self, other: &Self, gates: &Gates) -> Option<Self> {
        let ends = [self.p, self.q, other.p, other.q];
        let joint = Self::new(
            self.sums + other.sums,
            self.gradient + other.gradient,
            self.magnitude + other.magnitude,
            &ends,
            self.chain,
        )?;
        ends.iter().all(|e| joint.fit.line.distance(e).abs() <= gates.lateral_px).then_some(joint)
    }
}

struct Gates {
    max_sin: f64,
    lateral_px: f64,
    gap_share: f64,
}

/// Joins fragments until nothing fits. Deterministic: longest first, then by index.
pub(crate) fn join(fragments: Vec<Fragment>, p: &SegmentParams) -> Vec<Fragment> {
    let gates = Gates {
        max_sin: p.join_angle_deg.to_radians().sin(),
        lateral_px: p.join_lateral_px,
        gap_share: p.join_gap_share.clamp(0.0, 0.5),
    };
    let mut round = Round { fresh: vec![true; fragments.len()], fragments };
    for _ in 0..MAX_ROUNDS {
        let before = round.fragments.len();
        round = round.next(&gates);
        if round.fragments.len() == before {
            break;
        }
    }
    round.fragments
}

/// Fragments between two rounds. `fresh` are those that are new since the last one: two old ones
/// have been tried.
struct Round {
    fragments: Vec<Fragment>,
    fresh: Vec<bool>,
}

impl Round {
    /// Every fragment takes, at each end, the nearest fitting fragment that is not longer than
    /// itself.
    fn next(self, gates: &Gates) -> Self {
        let lengths: Vec<f64> = self.fragments.iter().map(Fragment::length_px).collect();
        let mut order: Vec<usize> = (0..lengths.len()).collect();
        // Stable: equal lengths keep the order of their chains.
        order.sort_by(|a, b| lengths[*b].total_cmp(&lengths[*a]));
        let rest = order.split_off(order.len().min(MAX_FRAGMENTS));
        // Bright sides agree, so the end of one meets the start of the other.
        let place = |i: &usize| Place { p: self.fragments[*i].p, q: self.fragments[*i].q, index: *i };
        let grids = |is_member: &dyn Fn(usize) -> bool| {
            let places: Vec<Place> = order.iter().filter(|i| is_member(**i)).map(place).collect();
            [Grid::new(&places, |at| at.q), Grid::new(&places, |at| at.p)]
        };
        let (all, fresh) = (grids(&|_| true), grids(&|i| self.fresh[i]));
        let mut next = Self { fragments: Vec::with_capacity(lengths.len()), fresh: vec![] };
        let mut left: Vec<Option<Fragment>> = self.fragments.into_iter().map(Some).collect();
        for &i in &order {
            let Some(mut whole) = left[i].take() else { continue };
            let mut grew = false;
            // gap <= share * (long + short + gap) with short <= long.
            let reach = 2.0 * gates.gap_share / (1.0 - gates.gap_share) * lengths[i] + CELL_PX;
            let d = whole.fit.line.direction();
            let grids = if self.fresh[i] { &all } else { &fresh };
            for ((end, outward), grid) in [(whole.p, -d), (whole.q, d)].into_iter().zip(grids) {
                let mut step = 0.0;
                while step <= reach {
                    if let Some((j, joint)) = grid.best(end + outward * step, &whole, &left, &lengths, gates)
                    {
                        left[j] = None;
                        (whole, grew) = (joint, true);
                        break;
                    }
                    step += 2.0 * CELL_PX;
                }
            }
            next.fragments.push(whole);
            next.fresh.push(grew);
        }
        for i in rest {
            next.fragments.extend(left[i].take());
            next.fresh.push(true);
        }
        next
    }
}

/// Where a fragment lies.
#[derive(Clone, Copy)]
struct Place {
    p: Point2<f64>,
    q: Point2<f64>,
    index: usize,
}

/// Fragments by the cell of one end: `items[first[c]..first[c + 1]]` lie in cell c, row-major.
struct Grid {
    columns: usize,
    rows: usize,
    first: Vec<u32>,
    items: Vec<Place>,
}

impl Grid {
    fn new(places: &[Place], end: impl Fn(&Place) -> Point2<f64>) -> Self {
        let cell = |x: f64| (x.max(0.0) / CELL_PX) as usize;
        let (columns, rows) =
            places.iter().map(&end).fold((1, 1), |(c, r), p| (c.max(cell(p.x) + 1), r.max(cell(p.y) + 1)));
        let at = |place: &Place| {
            let p = end(place);
            cell(p.y) * columns + cell(p.x)
        };
        let mut first = vec![0; columns * rows + 1];
        for place in places {
            first[at(place) + 1] += 1;
        }
        for c in 0..columns * rows {
            first[c + 1] += first[c];
        }
        let mut next = first.clone();
        let mut items = vec![Place { p: Point2::origin(), q: Point2::origin(), index: 0 }; places.len()];
        for place in places {
            let slot = &mut next[at(place)];
            items[*slot as usize] = *place;
            *slot += 1;
        }
        Self { columns, rows, first, items }
    }

    /// The longest of those `left` in the cell of `near` or one beside it that can be joined to
    /// `whole`, and both as one; of equals the first.
    fn best(
        &self,
        near: Point2<f64>,
        whole: &Fragment,
        left: &[Option<Fragment>],
        lengths: &[f64],
        gates: &Gates,
    ) -> Option<(usize, Fragment)> {
        let (u, v) = ((near.x / CELL_PX).floor(), (near.y / CELL_PX).floor());
        if u < -1.0 || v < -1.0 || u > self.columns as f64 || v > self.rows as f64 {
            return None;
        }
        let mut best: Option<(usize, Fragment)> = None;
        let (from, to) = ((u - 1.0).max(0.0) as usize, ((u + 2.0) as usize).min(self.columns));
        for row in (v - 1.0).max(0.0) as usize..((v + 2.0) as usize).min(self.rows) {
            let first = |column: usize| self.first[row * self.columns + column] as usize;
            let items = if from < to { &self.items[first(from)..first(to)] } else { &[] };
            for j in items.iter().filter(|other| whole.continues(other, gates)).map(|other| other.index) {
                if best.as_ref().is_some_and(|b| lengths[b.0] >= lengths[j]) {
                    continue;
                }
                if let Some(joint) = left[j].as_ref().and_then(|other| whole.joined(other, gates)) {
                    best = Some((j, joint));
                }
            }
        }
        best
    }
}
