//! Relaxation labelling by projected gradient (method 3.1, 3.2): rows of candidate labels in, one
//! label or none per row out. Knows nothing about segments; both passes build a [`Problem`] and
//! hand it over.
//!
//! Maximises `G(x) = x'Qx + b'x` over the product of the rows' simplices. The method's pseudo code
//! prints the descent form; its prose, and this file, maximise (register A3). `b = 0` gives the
//! paper's G.

use serde::{Deserialize, Serialize};

/// Most candidates of one row, the null label apart.
pub const MAX_ROW_CANDIDATES: usize = 16;

/// Parameters of the solver and weights of both constraint tables.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RelaxationParams {
    /// Step before projection, t in method 3.2.
    pub step: f64,
    /// Most iterations.
    pub max_iterations: usize,
    /// Stop when the directional derivative falls below this.
    pub tolerance: f64,
    /// Weight of the linear term, eta in method 3.3; 0 restores the paper's G.
    pub linear_weight: f64,
    /// Weight of "the other direction of the same match".
    pub reciprocal: f64,
    /// Weight of two matches that share one item.
    pub shared: f64,
    /// Weight of two pairs that are the two halves of one quad (pass 1).
    pub same_quad: f64,
    /// Weight of pairs of segments that partly cross (pass 1).
    pub pairs_crossing: f64,
    /// Weight of quads that partly cross (pass 2).
    pub quads_crossing: f64,
    /// Tolerance of "disjoint" and "included" in pass 1.
    pub pair_tolerance_px: f64,
    /// Tolerance of "nested without crossing" for near-equal quads in pass 2.
    pub quad_tolerance_px: f64,
    /// `IoU` above which two quads count as the same or near-equal.
    pub same_iou: f64,
}

impl Default for RelaxationParams {
    fn default() -> Self {
        Self {
            step: 0.2,
            max_iterations: 300,
            tolerance: 1e-7,
            linear_weight: 2.0,
            reciprocal: 1.0,
            shared: -1.0,
            same_quad: 0.25,
            pairs_crossing: -0.25,
            quads_crossing: -1.0,
            pair_tolerance_px: 4.0,
            quad_tolerance_px: 1.0,
            same_iou: 0.75,
        }
    }
}

/// One label that a row may take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Label {
    /// The column: which item the row is matched with.
    pub item: usize,
    /// Start value before normalisation, > 0.
    pub start: f64,
    /// Its entry of b.
    pub bias: f64,
}

/// A quadratic labelling problem. Every row has its candidates and, last, the null label (b = 0,
/// Q = 0).
#[derive(Debug, Clone, Default)]
pub struct Problem {
    /// First variable of each row, and the number of variables at the end.
    row_start: Vec<usize>,
    items: Vec<Option<usize>>,
    row_of: Vec<usize>,
    bias: Vec<f64>,
    start: Vec<f64>,
    /// Per variable, the others it interacts with. Symmetric.
    links: Vec<Vec<(u32, f64)>>,
}

/// Result of the relaxation.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The item each row chose; none where the null label won.
    pub chosen: Vec<Option<usize>>,
    /// G after the start and after every step, before rounding.
    pub history: Vec<f64>,
    /// G of the rounded labelling.
    pub rounded_value: f64,
}

impl Problem {
    /// Rows with their labels, in order; a row without labels puts all mass on the null label.
    /// Labels beyond [`MAX_ROW_CANDIDATES`] are left out, so give the best first. Starts as Eq. (1)
    /// says.
    pub fn new(rows: &[Vec<Label>]) -> Self {
        let mut problem = Self { row_start: vec![0], ..Self::default() };
        for (row, labels) in rows.iter().enumerate() {
            let labels = &labels[..labels.len().min(MAX_ROW_CANDIDATES)];
            let total: f64 = labels.iter().map(|l| l.start).sum();
            for label in labels {
                problem.push(row, Some(label.item), label.start / total, label.bias);
            }
            problem.push(row, None, if labels.is_empty() { 1.0 } else { 0.0 }, 0.0);
            problem.row_start.push(problem.items.len());
        }
        problem
    }

    fn push(&mut self, row: usize, item: Option<usize>, start: f64, bias: f64) {
        self.items.push(item);
        self.row_of.push(row);
        self.start.push(start);
        self.bias.push(bias);
        self.links.push(Vec::new());
    }

    /// The variable "row takes item", if it is a candidate.
    pub fn variable(&self, row: usize, item: usize) -> Option<usize> {
        self.row(row).find(|i| self.items[*i] == Some(item))
    }

    /// Sets the symmetric entry `Q_ab = Q_ba`. Entries inside one row are ignored: there Q is zero
    /// by definition. Call once per pair.
    pub fn link(&mut self, a: usize, b: usize, weight: f64) {
        if self.row_of[a] != self.row_of[b] {
            self.links[a].push((b as u32, weight));
            self.links[b].push((a as u32, weight));
        }
    }

    /// Start of the relaxation, Eq. (1).
    pub fn start(&self) -> &[f64] {
        &self.start
    }

    /// `G(x)`.
    pub fn value(&self, x: &[f64]) -> f64 {
        (0..x.len()).map(|i| x[i] * (self.pull(i, x) + self.bias[i])).sum()
    }

    /// `2Qx + b`.
    pub fn gradient(&self, x: &[f64]) -> Vec<f64> {
        (0..x.len()).map(|i| 2.0 * self.pull(i, x) + self.bias[i]).collect()
    }

    /// `(Qx)_i`.
    fn pull(&self, i: usize, x: &[f64]) -> f64 {
        self.links[i].iter().map(|(j, w)| w * x[*j as usize]).sum()
    }

    fn row(&self, row: usize) -> std::ops::Range<usize> {
        self.row_start[row]..self.row_start[row + 1]
    }

    fn rows(&self) -> usize {
        self.row_start.len() - 1
    }

    /// Best vertex of a row by gain, the earliest label on ties.
    fn best(&self, row: usize, gain: impl Fn(usize) -> f64) -> usize {
        let range = self.row(row);
        let first = range.start;
        range.skip(1).fold(first, |best, i| if gain(i) > gain(best) + 1e-12 { i } else { best })
    }
}

/// Climbs from `x` to a stationary point and rounds it to one label per row. G never falls on the
/// way.
pub fn relax(problem: &Problem, mut x: Vec<f64>, p: &RelaxationParams) -> Solution {
    let mut history = vec![problem.value(&x)];
    for _ in 0..p.max_iterations {
        let g = problem.gradient(&x);
        let mut d: Vec<f64> = x.iter().zip(&g).map(|(x, g)| x + p.step * g).collect();
        for row in 0..problem.rows() {
            project_to_simplex(&mut d[problem.row(row)]);
        }
        d.iter_mut().zip(&x).for_each(|(d, x)| *d -= x);
        let slope: f64 = g.iter().zip(&d).map(|(g, d)| g * d).sum();
        if slope < p.tolerance {
            break;
        }
        // G is quadratic along d: the best step is known.
        let curvature: f64 = (0..d.len()).map(|i| d[i] * problem.pull(i, &d)).sum();
        let step = if curvature >= 0.0 { 1.0 } else { (-slope / (2.0 * curvature)).min(1.0) };
        x.iter_mut().zip(&d).for_each(|(x, d)| *x += step * d);
        history.push(problem.value(&x));
    }
    round(problem, &x, history)
}

/// Sets each row to its best vertex until nothing changes. With no interaction inside a row G is
/// linear in it, so this cannot lower G once all rows are vertices.
fn round(problem: &Problem, x: &[f64], history: Vec<f64>) -> Solution {
    /// G rises at each change, so sweeps end; rounding errors could fake a cycle.
    const MAX_SWEEPS: usize = 100;
    let mut chosen: Vec<usize> = (0..problem.rows()).map(|row| problem.best(row, |i| x[i])).collect();
    let mut vertex = vec![0.0; x.len()];
    for i in &chosen {
        vertex[*i] = 1.0;
    }
    for _ in 0..MAX_SWEEPS {
        let mut changed = false;
        for (row, choice) in chosen.iter_mut().enumerate() {
            let gain = |i: usize| 2.0 * problem.pull(i, &vertex) + problem.bias[i];
            let best = problem.best(row, gain);
            if gain(best) > gain(*choice) + 1e-9 {
                vertex[*choice] = 0.0;
                vertex[best] = 1.0;
                *choice = best;
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    let rounded_value = problem.value(&vertex);
    Solution { chosen: chosen.iter().map(|i| problem.items[*i]).collect(), history, rounded_value }
}

/// Euclidean projection onto `{v >= 0, sum v = 1}`.
pub fn project_to_simplex(v: &mut [f64]) {
    let mut sorted = v.to_vec();
    sorted.sort_by(|a, b| b.total_cmp(a));
    let (mut sum, mut threshold) = (0.0, 0.0);
    for (j, value) in sorted.iter().enumerate() {
        sum += value;
        let t = (sum - 1.0) / (j + 1) as f64;
        if value - t > 0.0 {
            threshold = t;
        }
    }
    for value in v {
        *value = (*value - threshold).max(0.0);
    }
}

/// Two-way matches: rows that chose each other, smaller index first.
pub fn mutual(chosen: &[Option<usize>]) -> Vec<(usize, usize)> {
    let pair =
        |(k, l): (usize, &Option<usize>)| l.filter(|l| k < *l && chosen[*l] == Some(k)).map(|l| (k, l));
    chosen.iter().enumerate().filter_map(pair).collect()
}

#[cfg(test)]
mod tests;
