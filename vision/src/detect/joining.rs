//! Straight fragments in, fragments of one line joined out (method 1.3): corners, junctions and clutter break sides
//! that the next stages want whole.

use super::segments::SegmentParams;
use crate::geometry::line::{LineFit, LineSums};
use nalgebra::{Point2, Vector2};

/// Side of a grid cell in which ends are looked up.
const CELL_PX: f64 = 16.0;
/// Most fragments that take part, the longest first; the rest stays as it is.
const MAX_FRAGMENTS: usize = 8192;
/// Rounds of joining; each at least halves what still has a partner.
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

    /// Both as one, if they follow one line closely enough. `self` is the longer one.
    fn joined(&self, other: &Self, gates: &Gates) -> Option<Self> {
        let d = self.fit.line.direction();
        let (dx, dy) = (other.q - other.p, self.q - self.p);
        let (own, length) = (d.dot(&dy), dx.norm());
        // The cheap gates first: most neighbours fail here.
        if d.dot(&dx) <= 0.0 || d.perp(&dx).abs() > gates.max_sin * length {
            return None;
        }
        let lateral = |e: &Point2<f64>| self.fit.line.distance(e).abs();
        if lateral(&other.p).max(lateral(&other.q)) > gates.lateral_px {
            return None;
        }
        let gap = d.dot(&(other.p - self.q)).max(d.dot(&(self.p - other.q)));
        if gap > gates.gap_share * (own + length + gap) || gap < -2.0 * gates.lateral_px {
            return None;
        }
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
    let mut fragments = fragments;
    for _ in 0..MAX_ROUNDS {
        let before = fragments.len();
        fragments = join_once(&fragments, &gates);
        if fragments.len() == before {
            break;
        }
    }
    fragments
}

/// One round: every fragment takes, at each end, the nearest fitting fragment that is not longer than itself.
fn join_once(fragments: &[Fragment], gates: &Gates) -> Vec<Fragment> {
    let lengths: Vec<f64> = fragments.iter().map(Fragment::length_px).collect();
    let mut order: Vec<usize> = (0..fragments.len()).collect();
    // Stable: equal lengths keep the order of their chains.
    order.sort_by(|a, b| lengths[*b].total_cmp(&lengths[*a]));
    let rest = order.split_off(order.len().min(MAX_FRAGMENTS));
    // Bright sides agree, so the end of one meets the start of the other.
    let starts = Grid::new(order.iter().map(|&i| (fragments[i].p, i)));
    let ends = Grid::new(order.iter().map(|&i| (fragments[i].q, i)));
    let mut taken = vec![false; fragments.len()];
    let mut joined = Vec::with_capacity(fragments.len());
    for &i in &order {
        if std::mem::replace(&mut taken[i], true) {
            continue;
        }
        let mut whole = fragments[i].clone();
        // gap <= share * (long + short + gap) with short <= long.
        let reach = 2.0 * gates.gap_share / (1.0 - gates.gap_share) * lengths[i] + CELL_PX;
        let d = whole.fit.line.direction();
        for (end, outward, grid) in [(whole.p, -d, &ends), (whole.q, d, &starts)] {
            let mut step = 0.0;
            while step <= reach {
                let mut best: Option<(usize, Fragment)> = None;
                grid.near(end + outward * step, |j| {
                    if taken[j] || best.as_ref().is_some_and(|b| lengths[b.0] >= lengths[j]) {
                        return;
                    }
                    if let Some(joint) = whole.joined(&fragments[j], gates) {
                        best = Some((j, joint));
                    }
                });
                if let Some((j, joint)) = best {
                    taken[j] = true;
                    whole = joint;
                    break;
                }
                step += 2.0 * CELL_PX;
            }
        }
        joined.push(whole);
    }
    joined.extend(rest.into_iter().map(|i| fragments[i].clone()));
    joined
}

/// Points by cell: `items[first[c]..first[c + 1]]` lie in cell c, row-major.
struct Grid {
    columns: usize,
    rows: usize,
    first: Vec<usize>,
    items: Vec<usize>,
}

impl Grid {
    fn new(points: impl Iterator<Item = (Point2<f64>, usize)> + Clone) -> Self {
        let cell = |x: f64| (x.max(0.0) / CELL_PX) as usize;
        let (columns, rows) =
            points.clone().fold((1, 1), |(c, r), (p, _)| (c.max(cell(p.x) + 1), r.max(cell(p.y) + 1)));
        let at = |p: &Point2<f64>| cell(p.y) * columns + cell(p.x);
        let mut first = vec![0; columns * rows + 1];
        for (p, _) in points.clone() {
            first[at(&p) + 1] += 1;
        }
        for c in 0..columns * rows {
            first[c + 1] += first[c];
        }
        let mut next = first.clone();
        let mut items = vec![0; first[columns * rows]];
        for (p, i) in points {
            let slot = &mut next[at(&p)];
            items[*slot] = i;
            *slot += 1;
        }
        Self { columns, rows, first, items }
    }

    /// Visits what lies in the cell of `p` or one beside it.
    fn near(&self, p: Point2<f64>, mut visit: impl FnMut(usize)) {
        let (u, v) = ((p.x / CELL_PX).floor(), (p.y / CELL_PX).floor());
        if u < -1.0 || v < -1.0 || u > self.columns as f64 || v > self.rows as f64 {
            return;
        }
        let (from, to) = ((u - 1.0).max(0.0) as usize, ((u + 2.0) as usize).min(self.columns));
        for row in (v - 1.0).max(0.0) as usize..((v + 2.0) as usize).min(self.rows) {
            if from < to {
                self.items[self.first[row * self.columns + from]..self.first[row * self.columns + to]]
                    .iter()
                    .for_each(|&i| visit(i));
            }
        }
    }
}
