//! Depth-first branch and bound over assignments: the best that is jointly compatible, and all that
//! come within the margin.

use crate::guided::{
    associate::pairing::{Gates, Row},
    expect::{Expectations, MAX_EXPECTED},
    joint::CommonError,
};

/// Most partial assignments that are visited; if there are more, no observation is unique.
pub const MAX_NODES: usize = 1024;

/// An assignment of all rows.
#[derive(Debug, Clone)]
pub(super) struct Hypothesis {
    /// For each row the index of its pairing; `None`: no expected landmark.
    pub chosen: Vec<Option<usize>>,
    /// Log likelihood ratio against an image without these landmarks, nats.
    score: f64,
    /// Joint squared Mahalanobis distance.
    pub distance2: f64,
}

/// Result of the search.
pub(super) struct Outcome {
    /// The best within the joint gate; the empty assignment is always within it.
    pub best: Hypothesis,
    /// All within the wider gate of rivals that score within the margin of the best, the best among
    /// them.
    pub rivals: Vec<Hypothesis>,
    pub nodes: usize,
    pub is_exhausted: bool,
}

/// A node of the tree: the first `chosen.len()` rows are decided.
struct Node {
    chosen: Vec<Option<usize>>,
    used: [bool; MAX_EXPECTED],
    error: CommonError,
    score: f64,
    distance2: f64,
    count: usize,
}

struct Search<'a> {
    rows: &'a [Row],
    expectations: &'a Expectations,
    gates: &'a Gates,
    /// Largest score that the rows from this one on can add.
    bounds: Vec<f64>,
    found: Outcome,
}

pub(super) fn search(rows: &[Row], expectations: &Expectations, gates: &Gates) -> Outcome {
    let mut bounds = vec![0.0; rows.len() + 1];
    for (r, row) in rows.iter().enumerate().rev() {
        bounds[r] = bounds[r + 1] + row.pairings.iter().map(|p| p.bound).fold(0.0, f64::max);
    }
    let nothing = Hypothesis { chosen: vec![None; rows.len()], score: 0.0, distance2: 0.0 };
    let found = Outcome { best: nothing, rivals: Vec::new(), nodes: 0, is_exhausted: false };
    let mut search = Search { rows, expectations, gates, bounds, found };
    search.visit(&Node {
        chosen: Vec::with_capacity(rows.len()),
        used: [false; MAX_EXPECTED],
        error: CommonError::new(&expectations.common),
        score: 0.0,
        distance2: 0.0,
        count: 0,
    });
    let mut found = search.found;
    let least = found.best.score - gates.margin_nats;
    found.rivals.retain(|h| h.score >= least);
    found
}

impl Search<'_> {
    fn visit(&mut self, node: &Node) {
        let depth = node.chosen.len();
        if node.score + self.bounds[depth] < self.found.best.score - self.gates.margin_nats {
            return;
        }
        if self.found.nodes >= MAX_NODES {
            self.found.is_exhausted = true;
            return;
        }
        self.found.nodes += 1;
        let Some(row) = self.rows.get(depth) else {
            self.take(node);
            return;
        };
        for pairing in 0..row.pairings.len() {
            if let Some(next) = self.paired(node, row, pairing) {
                self.visit(&next);
            }
        }
        let mut chosen = node.chosen.clone();
        chosen.push(None);
        self.visit(&Node { chosen, error: node.error.clone(), ..*node });
    }

    /// The node with one more pairing; `None` when its landmark is taken or the joint gate of
    /// rivals rules it out.
    fn paired(&self, node: &Node, row: &Row, index: usize) -> Option<Node> {
        let pairing = &row.pairings[index];
        if node.used[pairing.expected] {
            return None;
        }
        let predicted = self.expectations.predicted(pairing.expected);
        let updated = node.error.update(&predicted, &pairing.own, &pairing.observed)?;
        let (distance2, count) = (node.distance2 + updated.distance2, node.count + 1);
        if distance2 > self.gates.rival(count) {
            return None;
        }
        let mut chosen = node.chosen.clone();
        chosen.push(Some(index));
        let mut used = node.used;
        used[pairing.expected] = true;
        let score = node.score + pairing.weight + updated.log_density;
        Some(Node { chosen, used, error: updated.error, score, distance2, count })
    }

    fn take(&mut self, node: &Node) {
        let made = Hypothesis { chosen: node.chosen.clone(), score: node.score, distance2: node.distance2 };
        if node.distance2 <= self.gates.accept(node.count) && node.score > self.found.best.score {
            self.found.best = made.clone();
        }
        self.found.rivals.push(made);
    }
}
