//! A belief over a grid of poses: prediction without blur, diffusion, update, pose hypotheses.

use crate::{
    check::{self, OutOfRange},
    pose2::{Pose2, Pose2Covariance, wrap_rad},
};
use nalgebra::{Matrix3, Point2, Vector2, Vector3};
use std::f64::consts::TAU;

/// Most pose hypotheses.
pub const MAX_MODES: usize = 8;
/// Hypotheses below this probability are left out.
const MIN_MASS: f64 = 1e-3;

/// A pose hypothesis: one peak of the belief.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseHypothesis {
    /// Probability, 0 to 1.
    pub mass: f64,
    /// Mean and covariance of the poses around the peak.
    pub pose: Pose2Covariance,
}

/// Most cells of a grid: 100 m by 100 m at the default resolution.
pub const MAX_CELLS: usize = 9_000_000;

/// All positions at one heading.
#[derive(Debug, Clone)]
struct Layer {
    /// Offset of the layer by motions of less than a cell, metres.
    rest: Vector2<f64>,
    belief: Vec<f64>,
}

#[derive(Debug, Clone)]
pub(super) struct PoseGrid {
    low: Point2<f64>,
    cell_m: f64,
    columns: usize,
    rows: usize,
    layers: Vec<Layer>,
    /// Offset of all headings by turns of less than a step, radians.
    rest_rad: f64,
    /// The prior: uniform over the possible poses.
    even: Vec<f64>,
    /// Motion variances not yet diffused, m^2 and rad^2.
    unspread: (f64, f64),
}

impl PoseGrid {
    pub(super) fn new(
        corners: [Point2<f64>; 2],
        cell_m: f64,
        headings: usize,
        prior: impl Fn(&Pose2) -> f64,
    ) -> Result<Self, OutOfRange> {
        let low = Point2::new(corners[0].x.min(corners[1].x), corners[0].y.min(corners[1].y));
        let size = (corners[1] - corners[0]).abs();
        let columns = (size.x / cell_m).ceil().max(1.0);
        let rows = (size.y / cell_m).ceil().max(1.0);
        check::within("cells", columns * rows * headings as f64, 1.0, MAX_CELLS as f64)?;
        let (columns, rows) = (columns as usize, rows as usize);
        let layer = Layer { rest: Vector2::zeros(), belief: vec![0.0; columns * rows] };
        let mut made = Self {
            low,
            cell_m,
            columns,
            rows,
            layers: vec![layer; headings],
            rest_rad: 0.0,
            even: Vec::new(),
            unspread: (0.0, 0.0),
        };
        made.weigh_all(|_, pose| {
            let weight = prior(pose);
            if weight.is_finite() { weight.max(0.0) } else { 0.0 }
        });
        made.normalise()?;
        made.even = made.layers.iter().flat_map(|l| l.belief.iter().copied()).collect();
        Ok(made)
    }

    fn heading(&self, k: usize) -> f64 {
        k as f64 * TAU / self.layers.len() as f64 + self.rest_rad
    }

    fn pose(&self, k: usize, i: usize) -> Pose2 {
        let (column, row) = ((i % self.columns) as f64 + 0.5, (i / self.columns) as f64 + 0.5);
        let at = self.low + Vector2::new(column, row) * self.cell_m + self.layers[k].rest;
        Pose2::new(at.x, at.y, self.heading(k))
    }

    /// Sets every cell by a function of its index and pose.
    fn weigh_all(&mut self, weight: impl Fn(usize, &Pose2) -> f64) {
        let cells = self.columns * self.rows;
        for k in 0..self.layers.len() {
            for i in 0..cells {
                self.layers[k].belief[i] = weight(k * cells + i, &self.pose(k, i));
            }
        }
    }

    fn normalise(&mut self) -> Result<(), OutOfRange> {
        let total: f64 = self.layers.iter().flat_map(|l| &l.belief).sum();
        check::within("belief", total, f64::MIN_POSITIVE, f64::MAX)?;
        for value in self.layers.iter_mut().flat_map(|l| &mut l.belief) {
            *value /= total;
        }
        Ok(())
    }

    /// A vector with one value for every cell.
    pub(super) fn like(&self, value: f64) -> Vec<f64> {
        vec![value; self.layers.len() * self.columns * self.rows]
    }

    /// Calls `visit` with index and pose of the cells within a distance of a point, for every
    /// heading for which `near` gives both.
    pub(super) fn each_heading(
        &self,
        near: impl Fn(f64) -> Option<(Point2<f64>, f64)>,
        mut visit: impl FnMut(usize, &Pose2),
    ) {
        let cells = self.columns * self.rows;
        for k in 0..self.layers.len() {
            let Some((centre, reach)) = near(self.heading(k)) else { continue };
            let from = (centre - self.low - self.layers[k].rest) / self.cell_m;
            let span = |middle: f64, count: usize| {
                let reach = reach / self.cell_m;
                let clamp = |v: f64| v.floor().clamp(0.0, count as f64) as usize;
                clamp(middle - reach)..clamp(middle + reach + 1.0)
            };
            for row in span(from.y, self.rows) {
                for column in span(from.x, self.columns) {
                    let i = row * self.columns + column;
                    visit(k * cells + i, &self.pose(k, i));
                }
            }
        }
    }

    /// Update: multiplies the belief by a likelihood. A likelihood that is zero everywhere changes
    /// nothing.
    pub(super) fn weigh(&mut self, likelihood: impl Fn(usize, &Pose2) -> f64) {
        let before = self.layers.clone();
        let cells = self.columns * self.rows;
        for k in 0..self.layers.len() {
            for i in 0..cells {
                if self.layers[k].belief[i] > 0.0 {
                    self.layers[k].belief[i] *= likelihood(k * cells + i, &self.pose(k, i));
                }
            }
        }
        if self.normalise().is_err() {
            self.layers = before;
        }
    }

    /// Prediction: shifts the belief by `motion` (robot frame) and renormalises. Cells that leave
    /// the grid are lost.
    pub(super) fn shift(&mut self, motion: &Pose2) {
        let step = TAU / self.layers.len() as f64;
        for k in 0..self.layers.len() {
            let (s, c) = self.heading(k).sin_cos();
            let moved = Vector2::new(c * motion.x_m - s * motion.y_m, s * motion.x_m + c * motion.y_m);
            let wanted = self.layers[k].rest + moved;
            let whole = (wanted / self.cell_m).map(f64::round);
            self.layers[k].rest = wanted - whole * self.cell_m;
            self.layers[k].belief = self.shifted(&self.layers[k].belief, whole);
        }
        let wanted = self.rest_rad + motion.theta_rad;
        let whole = (wanted / step).round();
        self.rest_rad = wanted - whole * step;
        let count = self.layers.len();
        self.layers.rotate_right((whole as i64).rem_euclid(count as i64) as usize);
        if self.normalise().is_err() {
            self.reset();
        }
    }

    fn shifted(&self, belief: &[f64], whole: Vector2<f64>) -> Vec<f64> {
        let mut made = vec![0.0; belief.len()];
        for row in 0..self.rows {
            for column in 0..self.columns {
                let (x, y) = (column as f64 + whole.x, row as f64 + whole.y);
                if x >= 0.0 && y >= 0.0 && x < self.columns as f64 && y < self.rows as f64 {
                    made[y as usize * self.columns + x as usize] = belief[row * self.columns + column];
                }
            }
        }
        made
    }

    /// Resets the belief to the prior.
    fn reset(&mut self) {
        let cells = self.columns * self.rows;
        for (layer, even) in self.layers.iter_mut().zip(self.even.chunks(cells)) {
            layer.belief.copy_from_slice(even);
        }
    }

    /// Diffusion: adds motion variance in steps that the grid can represent.
    pub(super) fn spread(&mut self, metres2: f64, radians2: f64) {
        /// Share of the belief of a cell that goes to each neighbour in one step.
        const SHARE: f64 = 0.1;
        let step = TAU / self.layers.len() as f64;
        self.unspread = (self.unspread.0 + metres2, self.unspread.1 + radians2);
        while self.unspread.0 >= 2.0 * SHARE * self.cell_m.powi(2) {
            self.unspread.0 -= 2.0 * SHARE * self.cell_m.powi(2);
            for k in 0..self.layers.len() {
                self.layers[k].belief = self.blurred(&self.layers[k].belief, SHARE);
            }
        }
        while self.unspread.1 >= 2.0 * SHARE * step.powi(2) {
            self.unspread.1 -= 2.0 * SHARE * step.powi(2);
            let before: Vec<Vec<f64>> = self.layers.iter().map(|l| l.belief.clone()).collect();
            let count = before.len();
            for (k, layer) in self.layers.iter_mut().enumerate() {
                let (left, right) = (&before[(k + 1) % count], &before[(k + count - 1) % count]);
                for (i, value) in layer.belief.iter_mut().enumerate() {
                    *value += SHARE * (left[i] + right[i] - 2.0 * *value);
                }
            }
        }
    }

    fn blurred(&self, belief: &[f64], share: f64) -> Vec<f64> {
        let mut made = belief.to_vec();
        let mut give = |from: usize, to: usize| {
            let flow = share * (belief[from] - belief[to]);
            made[from] -= flow;
            made[to] += flow;
        };
        for i in 0..belief.len() {
            if i % self.columns + 1 < self.columns {
                give(i, i + 1);
            }
            if i + self.columns < belief.len() {
                give(i, i + self.columns);
            }
        }
        made
    }

    /// Mixes a share of the prior into the belief.
    pub(super) fn mix(&mut self, share: f64) {
        let even = self.even.iter();
        for (value, even) in self.layers.iter_mut().flat_map(|l| &mut l.belief).zip(even) {
            *value += share * (even - *value);
        }
    }

    pub(super) fn entropy_nats(&self) -> f64 {
        let values = self.layers.iter().flat_map(|l| &l.belief).filter(|v| **v > 0.0);
        -values.map(|v| v * v.ln()).sum::<f64>()
    }

    /// Belief of the cell that holds a pose.
    pub(super) fn at(&self, pose: &Pose2) -> f64 {
        let count = self.layers.len() as f64;
        let turn = ((pose.theta_rad - self.rest_rad) / TAU * count).round();
        let layer = &self.layers[(turn as i64).rem_euclid(count as i64) as usize];
        let cell = (Point2::from(pose.position()) - self.low - layer.rest) / self.cell_m;
        if cell.x < 0.0 || cell.y < 0.0 || cell.x >= self.columns as f64 || cell.y >= self.rows as f64 {
            return 0.0;
        }
        layer.belief[cell.y as usize * self.columns + cell.x as usize]
    }

    /// Peaks with the cells around them, each without the cells of a greater one.
    pub(super) fn modes(&self, within_m: f64, within_rad: f64) -> Vec<PoseHypothesis> {
        let cells = self.columns * self.rows;
        let mut taken = vec![false; self.layers.len() * cells];
        let mut made: Vec<PoseHypothesis> = Vec::new();
        while made.len() < MAX_MODES {
            let left = (0..taken.len()).filter(|j| !taken[*j]);
            let belief = |j: usize| self.layers[j / cells].belief[j % cells];
            let Some(peak) = left.reduce(|a, b| if belief(b) > belief(a) { b } else { a }) else { break };
            if belief(peak) <= 0.0 {
                break;
            }
            let centre = self.pose(peak / cells, peak % cells);
            let (mut mass, mut sum, mut square) = (0.0, Vector3::zeros(), Matrix3::zeros());
            let near = |heading: f64| {
                let off = wrap_rad(heading - centre.theta_rad).abs();
                (off <= within_rad).then(|| (Point2::from(centre.position()), within_m))
            };
            let mut mine = Vec::new();
            self.each_heading(near, |j, pose| {
                if !taken[j] {
                    let (e, weight) = (pose.minus(&centre), belief(j));
                    (mass, sum, square) =
                        (mass + weight, sum + e * weight, square + e * e.transpose() * weight);
                    mine.push(j);
                }
            });
            // At least the peak itself, or rounding could repeat it for ever.
            taken[peak] = true;
            for j in mine {
                taken[j] = true;
            }
            if mass < MIN_MASS {
                break;
            }
            let mean = sum / mass;
            let spread = square / mass - mean * mean.transpose();
            let bin = TAU / self.layers.len() as f64;
            let within_cell = Vector3::new(self.cell_m.powi(2), self.cell_m.powi(2), bin * bin) / 12.0;
            let covariance = spread + Matrix3::from_diagonal(&within_cell);
            made.push(PoseHypothesis {
                mass,
                pose: Pose2Covariance { pose: centre.plus(&mean), covariance },
            });
        }
        made.sort_by(|a, b| b.mass.total_cmp(&a.mass));
        made
    }
}
