//! Correlative scan matching (Olson 2009) by branch and bound: every pose of a window is compared
//! with a likelihood field of the reference, coarse to fine, without missing the best one. In:
//! reference scans, points, a window. Out: the best pose of the grid, and by a second search
//! whether another is as good.

use super::cloud::Cloud;
use crate::pose2::Pose2;
use nalgebra::Point2;
use serde::{Deserialize, Serialize};

/// Most cells of a field; a larger area gets larger cells.
const MAX_CELLS: usize = 4 << 20;
/// Most turns of a window.
const MAX_TURNS: usize = 721;
/// Coarsest level: blocks of 2^5 cells.
const MAX_LEVEL: usize = 5;
/// Most blocks visited; then the best result so far counts.
const MAX_VISITS: usize = 200_000;

/// Parameters of correlative scan matching.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CorrelativeParams {
    /// Side of a cell, metres.
    pub cell_m: f64,
    /// Distance from a surface at which the field is exp(-1/2), metres.
    pub sigma_m: f64,
    /// Step between turns, radians.
    pub turn_rad: f64,
}

impl Default for CorrelativeParams {
    fn default() -> Self {
        Self { cell_m: 0.05, sigma_m: 0.08, turn_rad: 0.012 }
    }
}

/// The poses to try: a square and a range of turns around a centre.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PoseWindow {
    pub middle: Pose2,
    pub reach_m: f64,
    pub reach_rad: f64,
    /// Score lost at the border, quadratic from the centre: breaks ties towards odometry.
    pub pull: f64,
}

/// The best pose of a window.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GridMatch {
    pub pose: Pose2,
    /// Mean of the field over the points, 0 to 1, less the loss by distance from the centre.
    pub score: f64,
}

/// A grid with high values near surfaces.
#[derive(Debug, Clone)]
pub(crate) struct LikelihoodField {
    low: Point2<f64>,
    cell_m: f64,
    width: usize,
    height: usize,
    /// Level k: the largest value of the 2^k x 2^k cells from each cell on, up and to the right.
    levels: Vec<Vec<u8>>,
}

impl LikelihoodField {
    /// The field of scans within `reach_m` of `middle`, for windows up to `window_m`.
    pub(crate) fn new<'a>(
        scans: impl Iterator<Item = (Pose2, &'a Cloud)>,
        middle: &Point2<f64>,
        reach_m: f64,
        window_m: f64,
        p: &CorrelativeParams,
    ) -> Self {
        let samples = samples(scans, middle, reach_m, p.cell_m.max(0.01));
        let (mut low, mut high) = (*middle, *middle);
        for s in &samples {
            low = Point2::new(low.x.min(s.x), low.y.min(s.y));
            high = Point2::new(high.x.max(s.x), high.y.max(s.y));
        }
        let mut cell_m = p.cell_m.max(0.01);
        let pad = |c: f64| (3.0 * p.sigma_m / c).ceil() as usize + (1 << MAX_LEVEL) + 1;
        let size = |c: f64| {
            let side = |d: f64| (d / c) as usize + 2 * pad(c) + 1;
            (side(high.x - low.x), side(high.y - low.y))
        };
        while size(cell_m).0.saturating_mul(size(cell_m).1) > MAX_CELLS {
            cell_m *= 2.0;
        }
        let (width, height) = size(cell_m);
        let low = low - nalgebra::Vector2::repeat(pad(cell_m) as f64 * cell_m);
        let mut field = Self { low, cell_m, width, height, levels: vec![vec![0; width * height]] };
        field.stamp(&samples, p.sigma_m);
        let cells = (window_m / cell_m) as usize;
        let mut level = 0;
        while level < MAX_LEVEL && (2 << level) <= cells.max(1) {
            field.levels.push(coarser(&field.levels[level], width, height, 1 << level));
            level += 1;
        }
        field
    }

    fn stamp(&mut self, samples: &[Point2<f64>], sigma_m: f64) {
        let reach = (3.0 * sigma_m / self.cell_m).ceil() as usize;
        let side = 2 * reach + 1;
        let kernel: Vec<u8> = (0..side * side)
            .map(|i| {
                let (x, y) = ((i % side) as f64 - reach as f64, (i / side) as f64 - reach as f64);
                let d = (x * x + y * y) * (self.cell_m / sigma_m).powi(2);
                (255.0 * (-0.5 * d).exp()).round() as u8
            })
            .collect();
        for s in samples {
            let (i, j) = self.cell(s);
            let (i, j) = (i as usize - reach, j as usize - reach);
            for r in 0..side {
                let row = &mut self.levels[0][(j + r) * self.width + i..][..side];
                for (old, new) in row.iter_mut().zip(&kernel[r * side..]) {
                    *old = (*old).max(*new);
                }
            }
        }
    }

    fn cell(&self, p: &Point2<f64>) -> (i64, i64) {
        (((p.x - self.low.x) / self.cell_m).floor() as i64, ((p.y - self.low.y) / self.cell_m).floor() as i64)
    }

    /// The best pose of a window with a score above `at_least`, except those within `not` (metres
    /// and radians of a pose).
    pub(crate) fn search(
        &self,
        points: &[Point2<f64>],
        window: &PoseWindow,
        at_least: f64,
        not: Option<(&Pose2, f64, f64)>,
        p: &CorrelativeParams,
    ) -> Option<GridMatch> {
        if points.is_empty() || window.middle.check().is_err() {
            return None;
        }
        let turns = ((window.reach_rad / p.turn_rad.max(1e-4)).ceil() as usize).min(MAX_TURNS / 2) as i64;
        let reach = (window.reach_m / self.cell_m).ceil().clamp(0.0, 1e4) as i64;
        let views: Vec<View> = (-turns..=turns)
            .map(|k| {
                let turn = k as f64 * p.turn_rad;
                let pose = Pose2 { theta_rad: window.middle.theta_rad + turn, ..window.middle };
                let (s, c) = pose.theta_rad.sin_cos();
                let cell = |q: &Point2<f64>| {
                    self.cell(&Point2::new(pose.x_m + c * q.x - s * q.y, pose.y_m + s * q.x + c * q.y))
                };
                View { turn, cells: points.iter().map(cell).collect() }
            })
            .collect();
        let top = (0..self.levels.len()).rev().find(|l| (1_i64 << l) <= reach.max(1)).unwrap_or(0);
        let search = Search { field: self, views: &views, window, reach, not };
        let mut open = Vec::new();
        let step = 1_i64 << top;
        for view in 0..views.len() {
            let mut y = -reach;
            while y <= reach {
                let mut x = -reach;
                while x <= reach {
                    open.push(search.block(view, x, y, top));
                    x += step;
                }
                y += step;
            }
        }
        search.best(open, at_least)
    }
}

/// The points turned one way, as cells.
struct View {
    turn: f64,
    cells: Vec<(i64, i64)>,
}

/// Shifts `x..x + 2^level`, `y..y + 2^level` of one view, and a bound on their score.
#[derive(Debug, Clone, Copy)]
struct Block {
    view: usize,
    x: i64,
    y: i64,
    level: usize,
    bound: f64,
}

struct Search<'a> {
    field: &'a LikelihoodField,
    views: &'a [View],
    window: &'a PoseWindow,
    reach: i64,
    not: Option<(&'a Pose2, f64, f64)>,
}

impl Search<'_> {
    fn block(&self, view: usize, x: i64, y: i64, level: usize) -> Block {
        let f = self.field;
        let cells = &self.views[view].cells;
        let values = &f.levels[level];
        let (width, height) = (f.width as i64, f.height as i64);
        let mut sum = 0_u32;
        for (i, j) in cells {
            let (i, j) = (i + x, j + y);
            if i >= 0 && j >= 0 && i < width && j < height {
                sum += u32::from(values[(j * width + i) as usize]);
            }
        }
        let score = f64::from(sum) / (255.0 * cells.len() as f64);
        let nearest = |a: i64| {
            let last = a + (1 << level) - 1;
            if a > 0 { a } else { last.min(0).abs() }
        };
        let share = |d: f64, reach: f64| if reach > 0.0 { (d / reach).powi(2) } else { 0.0 };
        let (dx, dy) = (nearest(x) as f64, nearest(y) as f64);
        let away = share(dx.hypot(dy), self.reach as f64)
            + share(self.views[view].turn, self.window.reach_rad.max(1e-9));
        Block { view, x, y, level, bound: score - self.window.pull * away }
    }

    fn best(&self, mut open: Vec<Block>, at_least: f64) -> Option<GridMatch> {
        // The best block is last; the sort is stable.
        let order = |a: &Block, b: &Block| a.bound.total_cmp(&b.bound);
        open.retain(|b| b.bound > at_least);
        open.sort_by(order);
        let (mut best, mut least) = (None, at_least);
        let mut visits = 0;
        while let Some(block) = open.pop() {
            if block.bound <= least || visits > MAX_VISITS {
                continue;
            }
            visits += 1;
            if block.level == 0 {
                let pose = self.pose(&block);
                let left_out = self.not.is_some_and(|(not, metres, radians)| {
                    let d = pose.minus(not);
                    d.xy().norm() < metres && d.z.abs() < radians
                });
                if !left_out {
                    (best, least) = (Some(GridMatch { pose, score: block.bound }), block.bound);
                }
                continue;
            }
            let half = 1_i64 << (block.level - 1);
            let mut parts: Vec<Block> = [(0, 0), (half, 0), (0, half), (half, half)]
                .iter()
                .map(|(dx, dy)| (block.x + dx, block.y + dy))
                .filter(|(x, y)| *x <= self.reach && *y <= self.reach)
                .map(|(x, y)| self.block(block.view, x, y, block.level - 1))
                .filter(|b| b.bound > least)
                .collect();
            parts.sort_by(order);
            open.extend(parts);
        }
        best
    }

    fn pose(&self, leaf: &Block) -> Pose2 {
        let m = &self.window.middle;
        let c = self.field.cell_m;
        Pose2::new(
            m.x_m + leaf.x as f64 * c,
            m.y_m + leaf.y as f64 * c,
            m.theta_rad + self.views[leaf.view].turn,
        )
    }
}

/// Points of the surfaces at the distance of a cell.
fn samples<'a>(
    scans: impl Iterator<Item = (Pose2, &'a Cloud)>,
    middle: &Point2<f64>,
    reach_m: f64,
    cell_m: f64,
) -> Vec<Point2<f64>> {
    let mut samples = Vec::new();
    for (pose, cloud) in scans {
        let mut before: Option<Point2<f64>> = None;
        for point in &cloud.points {
            let at = pose.apply(&point.at);
            if (at - middle).norm() > reach_m {
                before = None;
                continue;
            }
            if let (true, Some(from)) = (point.joined, before) {
                let steps = ((at - from).norm() / cell_m).ceil().min(64.0) as usize;
                samples.extend((1..steps).map(|k| from + (at - from) * (k as f64 / steps as f64)));
            }
            samples.push(at);
            before = Some(at);
        }
    }
    samples
}

/// The next coarser level from blocks of `step` cells.
fn coarser(fine: &[u8], width: usize, height: usize, step: usize) -> Vec<u8> {
    let mut across = fine.to_vec();
    for row in across.chunks_exact_mut(width) {
        for i in 0..width - step {
            row[i] = row[i].max(row[i + step]);
        }
    }
    let mut made = across.clone();
    for j in 0..height - step {
        let (a, b) = (j * width, (j + step) * width);
        for i in 0..width {
            made[a + i] = across[a + i].max(across[b + i]);
        }
    }
    made
}

#[cfg(test)]
mod tests;
