//! The straight lines among the edge points of a band. In: points. Out: lines, the best supported first.

use super::feature_constants::{
    FIT_REACH_PX, MAX_LINES, MIN_LINE_POINTS, MIN_SUPPORT, NEAR_LINE_PX, SAME_LINE_PX, SLOPE_STEP, SLOPES,
    SUPPRESSED_BINS,
};

/// Slopes tried in all.
const ALL_SLOPES: usize = 2 * SLOPES + 1;

/// A line beside a side: its offset from the side, out of the quad for positive ones, at the middle of the side.
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

/// Which rows have an edge point within about a pixel and a half of a line, for an offset and every slope.
type Votes = [u64; ALL_SLOPES];

/// Lines by Hough transform over offset and slope, each refitted. `first_px` is the offset of the first of the
/// `columns`.
#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
pub(crate) fn find(
    peaks: &[Peak],
    rows: usize,
    (first_px, columns): (i32, usize),
    length_px: f64,
) -> Vec<SideLine> {
    let unit = SLOPE_STEP.of(length_px);
    let votes = vote(peaks, first_px as f32, columns + 4, unit as f32);
    let mut best = best_slopes(&votes);
    let mut lines: Vec<SideLine> = Vec::new();
    let least = MIN_SUPPORT * rows as f64;
    while lines.len() < MAX_LINES {
        let top = (0..best.len()).fold(0, |top, i| if best[i].0 > best[top].0 { i } else { top });
        let (count, j) = best[top];
        if f64::from(count) < least {
            break;
        }
        best[top.saturating_sub(SUPPRESSED_BINS)..(top + SUPPRESSED_BINS + 1).min(votes.len())]
            .fill((0, SLOPES));
        let offset_px = top as f64 - 2.0 + f64::from(first_px);
        let rough = (offset_px, (j as f64 - SLOPES as f64) * unit);
        let Some(line) = fit(peaks, rows, rough) else { continue };
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

/// One vote of each peak for every slope, at the offset that goes with it. Two bins lie before `first_px`.
#[inline(always)]
fn vote(peaks: &[Peak], first_px: f32, bins: usize, unit: f32) -> Vec<Votes> {
    /// Fractional bits of a bin in fixed point.
    const BITS: u32 = 16;
    let fixed = |x: f32| (x * (1 << BITS) as f32) as i32;
    let mut votes = vec![[0; ALL_SLOPES]; bins];
    for p in peaks {
        // By how much the offset changes from slope to slope; the first one is the least.
        let step = fixed(unit * p.along);
        let mut at = fixed(p.offset_px + 2.5 - first_px).saturating_add(step.saturating_mul(SLOPES as i32));
        #[expect(clippy::needless_range_loop, reason = "an index of what lies in another list")]
        for slope in 0..ALL_SLOPES {
            // Negative values wrap to very large ones. The outermost bins have no votes of their own.
            let bin = (at >> BITS) as usize;
            if bin >= 1 && bin < bins - 1 {
                votes[bin][slope] |= 1 << p.row;
            }
            at = at.saturating_sub(step);
        }
    }
    votes
}

/// For every offset the most votes of any slope, those of the neighbouring offsets with them, and the slope: lines of
/// neighbouring slopes are one. Ties go to the slope nearest to 0, then to the lesser.
#[inline(always)]
fn best_slopes(votes: &[Votes]) -> Vec<(u32, usize)> {
    const NONE: Votes = [0; ALL_SLOPES];
    let around = |bin: usize| {
        let [before, after] = [bin.wrapping_sub(1), bin + 1].map(|i| votes.get(i).unwrap_or(&NONE));
        std::array::from_fn::<_, ALL_SLOPES, _>(|j| (before[j] | votes[bin][j] | after[j]).count_ones())
    };
    (0..votes.len())
        .map(|bin| {
            let counts = around(bin);
            // Twice the distance from slope 0, and the sign.
            let order = |j: usize| 2 * j.abs_diff(SLOPES) + usize::from(j > SLOPES);
            let keys = (0..ALL_SLOPES).map(|j| (counts[j], std::cmp::Reverse(order(j)), j));
            keys.max().map_or((0, SLOPES), |(count, _, j)| (count, j))
        })
        .collect()
}

/// Least squares on the edge points near a line (offset, slope), in rounds of narrowing distance.
#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
fn fit(peaks: &[Peak], rows: usize, mut line: (f64, f64)) -> Option<SideLine> {
    let (offset, slope) = (line.0 as f32, line.1 as f32);
    let within = peaks.iter().filter(|p| (p.offset_px - offset - slope * p.along).abs() < FIT_REACH_PX);
    let within: Vec<(f64, f64, &Peak)> =
        within.map(|p| (f64::from(p.along), f64::from(p.offset_px), p)).collect();
    let mut result = None;
    for near in NEAR_LINE_PX {
        let (mut n, mut t, mut o, mut tt, mut to) = (0.0, 0.0, 0.0, 0.0, 0.0);
        let (mut with, mut sign, mut step) = (0_u64, 0.0, 0.0);
        for (x, y, p) in within.iter().filter(|(x, y, _)| (y - line.0 - line.1 * x).abs() < near) {
            n += 1.0;
            t += x;
            o += y;
            tt += x * x;
            to += x * y;
            with |= 1 << p.row;
            sign += f64::from(p.step.signum());
            step += f64::from(p.step.abs());
        }
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
