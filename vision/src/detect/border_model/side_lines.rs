//! The straight lines among the edge points of a band. In: points. Out: lines, the best supported
//! first.

use super::feature_constants::{
    FIT_REACH_PX, MAX_LINES, MIN_LINE_POINTS, MIN_SUPPORT, NEAR_LINE_PX, SAME_LINE_PX, SLOPE_STEP, SLOPES,
    SUPPRESSED_BINS,
};

/// Slopes tried in all.
const ALL_SLOPES: usize = 2 * SLOPES + 1;

/// A line beside a side: its offset from the side, out of the quad for positive ones, at the middle
/// of the side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SideLine {
    /// Offset at the middle of the side.
    pub offset_px: f64,
    /// How much the offset grows from the first to the second end of the side.
    pub slope_px: f64,
    /// Share of the samples with an edge on the line.
    pub support: f64,
    /// Mean sign of the steps, -1 to 1; positive where it is brighter outside.
    pub sign: f64,
    /// Mean step height in grey levels.
    pub step: f64,
}

/// An edge point of a band.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Peak {
    pub(crate) row: u32,
    /// Where along the side, -0.5 to 0.5.
    pub(crate) along: f32,
    pub(crate) offset_px: f32,
    pub(crate) step: f32,
}

/// The edge points of a band. Their positions are in lists of their own, too, so that distances are
/// compared together.
#[derive(Debug)]
pub(crate) struct Peaks {
    all: Vec<Peak>,
    along: Vec<f32>,
    offset_px: Vec<f32>,
}

impl Peaks {
    pub(crate) fn with_capacity(n: usize) -> Self {
        Self { all: Vec::with_capacity(n), along: Vec::with_capacity(n), offset_px: Vec::with_capacity(n) }
    }

    #[inline]
    pub(crate) fn push(&mut self, peak: Peak) {
        self.all.push(peak);
        self.along.push(peak.along);
        self.offset_px.push(peak.offset_px);
    }

    /// Calls `peak` with each within [`FIT_REACH_PX`] of a line.
    #[inline(always)]
    fn near(&self, (offset, slope): (f32, f32), mut peak: impl FnMut(&Peak)) {
        /// Peaks whose distances are compared together.
        const TOGETHER: usize = 16;
        let places = self.along.chunks(TOGETHER).zip(self.offset_px.chunks(TOGETHER));
        for (peaks, (along, offset_px)) in self.all.chunks(TOGETHER).zip(places) {
            let mut near = [0_u8; TOGETHER];
            for (near, (along, offset_px)) in near.iter_mut().zip(along.iter().zip(offset_px)) {
                *near = u8::from((offset_px - offset - slope * along).abs() < FIT_REACH_PX);
            }
            let mut left = u128::from_le_bytes(near);
            while left != 0 {
                peak(&peaks[left.trailing_zeros() as usize / 8]);
                left &= left - 1;
            }
        }
    }
}

/// Which rows have an edge point at an offset from the side, for each slope of a line.
struct Votes {
    /// A bit for each row that has one; all offsets of the first slope, then those of the next.
    rows: Vec<u64>,
    offsets: usize,
}

/// Lines by Hough transform over offset and slope, each refitted. `first_px` is the offset of the
/// first of the `columns`.
#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
pub(crate) fn find(
    peaks: &Peaks,
    rows: usize,
    (first_px, columns): (i32, usize),
    length_px: f64,
) -> Vec<SideLine> {
    let unit = SLOPE_STEP.of(length_px);
    let mut best = best_slopes(&vote(&peaks.all, first_px as f32, columns + 4, unit as f32));
    let mut lines: Vec<SideLine> = Vec::new();
    let mut near = Vec::new();
    let least = MIN_SUPPORT * rows as f64;
    while lines.len() < MAX_LINES {
        let count = best.iter().fold(0, |most, (count, _)| most.max(*count));
        if f64::from(count) < least {
            break;
        }
        let Some(top) = best.iter().position(|b| b.0 == count) else { break };
        let slope = best[top].1;
        let end = (top + SUPPRESSED_BINS + 1).min(best.len());
        best[top.saturating_sub(SUPPRESSED_BINS)..end].fill((0, SLOPES as u32));
        let offset_px = top as f64 - 2.0 + f64::from(first_px);
        let rough = (offset_px, (f64::from(slope) - SLOPES as f64) * unit);
        let Some(line) = fit(peaks, rows, rough, &mut near) else { continue };
        let known = |l: &SideLine| {
            (l.offset_px - line.offset_px).abs() < SAME_LINE_PX.0
                && (l.slope_px - line.slope_px).abs() < SAME_LINE_PX.1
        };
        if line.support >= MIN_SUPPORT && !lines.iter().any(known) {
            lines.push(line);
        }
    }
    lines
}

/// One vote of each peak for every slope, at the offset that goes with it. Two bins lie before
/// `first_px`.
#[inline(always)]
fn vote(peaks: &[Peak], first_px: f32, bins: usize, unit: f32) -> Votes {
    /// Fractional bits of a bin in fixed point.
    const BITS: u32 = 16;
    let fixed = |x: f32| (x * (1 << BITS) as f32) as i32;
    let mut votes = vec![0_u64; ALL_SLOPES * bins];
    let last = bins as i32 - 1;
    for p in peaks {
        // By how much the offset changes from slope to slope; the first one is the least.
        let step = fixed(unit * p.along);
        let mut at = fixed(p.offset_px + 2.5 - first_px).saturating_add(step.saturating_mul(SLOPES as i32));
        for votes in votes.chunks_exact_mut(bins) {
            votes[(at >> BITS).clamp(0, last) as usize] |= 1 << p.row;
            at = at.saturating_sub(step);
        }
    }
    // The outermost bins took what lies outside; they have no votes of their own.
    for votes in votes.chunks_exact_mut(bins) {
        (votes[0], votes[bins - 1]) = (0, 0);
    }
    Votes { rows: votes, offsets: bins }
}

/// For every offset the most votes of any slope, those of the neighbouring offsets with them, and
/// the slope: lines of neighbouring slopes are one. Ties go to the slope nearest to 0, then to the
/// lesser.
#[inline(always)]
fn best_slopes(votes: &Votes) -> Vec<(u32, u32)> {
    /// A slope's place in the order of ties is below this.
    const TIES: u32 = 64;
    let n = votes.offsets;
    // The votes, and then who wins a tie.
    let mut best = vec![0_u32; n];
    let mut around = vec![0_u64; n];
    for (slope, rows) in votes.rows.chunks_exact(n).enumerate() {
        around.copy_from_slice(rows);
        for (sum, other) in around[1..].iter_mut().zip(rows) {
            *sum |= other;
        }
        for (sum, other) in around.iter_mut().zip(&rows[1..]) {
            *sum |= other;
        }
        // Twice the distance from slope 0, and the sign.
        let order = 2 * slope.abs_diff(SLOPES) + usize::from(slope > SLOPES);
        let tie = TIES - 1 - order as u32;
        for (best, rows) in best.iter_mut().zip(&around) {
            *best = (*best).max(rows.count_ones() * TIES + tie);
        }
    }
    let slope = |order: u32| {
        if order.is_multiple_of(2) { SLOPES as u32 - order / 2 } else { SLOPES as u32 + order / 2 }
    };
    best.into_iter().map(|b| (b / TIES, slope(TIES - 1 - b % TIES))).collect()
}

/// An edge point near a line.
struct Near {
    /// Its row, as a bit.
    row: u64,
    /// What it adds to the sums of a fit: one; position, offset, square, product; sign and height
    /// of its step.
    adds: [f64; SUMS],
}

/// Sums of a fit, and one more that stays 0: as many as a vector has.
const SUMS: usize = 8;

impl Near {
    #[expect(clippy::inline_always, reason = "as above")]
    #[inline(always)]
    fn new(p: &Peak) -> Self {
        let (x, y) = (f64::from(p.along), f64::from(p.offset_px));
        let (sign, height) = (f64::from(p.step.signum()), f64::from(p.step.abs()));
        Self { row: 1 << p.row, adds: [1.0, x, y, x * x, x * y, sign, height, 0.0] }
    }
}

/// Least squares on the edge points near a line (offset, slope), in rounds of narrowing distance.
#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
fn fit(peaks: &Peaks, rows: usize, mut line: (f64, f64), points: &mut Vec<Near>) -> Option<SideLine> {
    points.clear();
    peaks.near((line.0 as f32, line.1 as f32), |p| points.push(Near::new(p)));
    let mut result = None;
    for near in NEAR_LINE_PX {
        let (mut sums, mut with) = ([0.0; SUMS], 0_u64);
        for Near { row, adds } in &*points {
            let is_near = (adds[2] - line.0 - line.1 * adds[1]).abs() < near;
            let weight = if is_near { 1.0 } else { 0.0 };
            for (sum, add) in sums.iter_mut().zip(adds) {
                *sum += weight * add;
            }
            with |= if is_near { *row } else { 0 };
        }
        let [n, t, o, tt, to, sign, step, _] = sums;
        if n < MIN_LINE_POINTS {
            return result;
        }
        let spread = tt - t * t / n;
        if spread <= 1e-9 * n {
            return result;
        }
        let slope = (to - t * o / n) / spread;
        line = ((o - slope * t) / n, slope);
        result = Some(SideLine {
            offset_px: line.0,
            slope_px: line.1,
            support: f64::from(with.count_ones()) / rows as f64,
            sign: sign / n,
            step: step / n,
        });
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn the_best_slope_of_each_offset_is_that_of_a_plain_count() {
        let mut random = Random::new(3);
        for _ in 0..40 {
            let offsets = 5 + (random.unit() * 40.0) as usize;
            // Few rows, so that slopes tie.
            let rows = (0..ALL_SLOPES * offsets).map(|_| (random.unit() * 8.0) as u64).collect();
            let votes = Votes { rows, offsets };
            let count = |offset: usize, slope: usize| {
                let near = offset.saturating_sub(1)..(offset + 2).min(offsets);
                near.fold(0, |all, i| all | votes.rows[slope * offsets + i]).count_ones()
            };
            let plain = (0..offsets).map(|offset| {
                let away = |slope: usize| (slope.abs_diff(SLOPES), slope > SLOPES);
                let best =
                    (0..ALL_SLOPES).max_by_key(|s| (count(offset, *s), std::cmp::Reverse(away(*s)))).unwrap();
                (count(offset, best), best as u32)
            });
            assert_eq!(best_slopes(&votes), plain.collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_line_is_fitted_to_the_points_near_it() {
        let mut peaks = Peaks::with_capacity(0);
        for row in 0..40_u32 {
            let along = (row as f32 + 0.5) / 40.0 - 0.5;
            let mut push = |offset_px: f32, step: f32| peaks.push(Peak { row, along, offset_px, step });
            push(3.0 + 2.0 * along, 20.0);
            // Beyond the reach of the last round, and of all.
            push(5.2 + 2.0 * along, -90.0);
            push(9.0, 50.0);
        }
        let line = fit(&peaks, 40, (3.4, 2.3), &mut Vec::new()).unwrap();
        assert!((line.offset_px - 3.0).abs() < 1e-6 && (line.slope_px - 2.0).abs() < 1e-6, "{line:?}");
        assert!(
            (line.support - 1.0).abs() + (line.sign - 1.0).abs() + (line.step - 20.0).abs() < 1e-9,
            "{line:?}"
        );
        assert!(fit(&peaks, 40, (-20.0, 0.0), &mut Vec::new()).is_none());
    }
}
