//! Places met again. In: the key poses and how surely they are known relative to each other. Out: edges between poses
//! that the path has not joined. A loop is taken only if the scans agree, nothing is seen through, no other place in the
//! window fits as well, and, from far off, if several loops in a row say the same.

mod meet;
mod reach;

use super::{
    Key, SlamParams,
    correlative::SearchParams,
    graph::{self, Edge, GraphError},
};
use crate::pose2::{Pose2, Pose2Covariance};
use meet::Belief;
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Most loops waiting for others to confirm them.
const MAX_WAITING: usize = 64;
/// Widest window that is searched; when the robot may be farther off, nothing is closed.
const MAX_REACH_M: f64 = 12.0;
/// The same for the heading.
const MAX_REACH_RAD: f64 = 0.9;

/// Knobs of loop closure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LoopParams {
    /// A place is met again after this way at least.
    pub min_way_m: f64,
    /// Poses nearer than this (and the doubt about it) may see the same.
    pub near_m: f64,
    /// Places tried from one pose.
    pub places: usize,
    /// Way between two tries.
    pub every_m: f64,
    /// Way on each side of the old pose whose scans are matched with.
    pub old_m: f64,
    /// Way back from the new pose whose scans are matched, when the doubt is large.
    pub new_m: f64,
    /// Error of scans laid together along that way: position...
    pub way_m: f64,
    /// ...and heading.
    pub way_rad: f64,
    /// Doubt (standard deviation) up to which one loop is believed alone.
    pub sure_m: f64,
    /// What the graph says of its own doubt is multiplied by this: errors of neighbouring matches are not independent.
    pub doubt: f64,
    /// Search on the grid when in doubt.
    pub search: SearchParams,
    /// Least score on the grid.
    pub min_score: f64,
    /// The second best place in the window must be this much worse.
    pub min_margin: f64,
    /// Least share of the points that find their surface.
    pub min_matched: f64,
    /// Largest root mean square distance of them.
    pub max_rms_m: f64,
    /// Most of the beams that may pass through what the others saw.
    pub max_through: f64,
    /// Gate on the difference to what is believed: 99.9 % of chi2 with 3 degrees of freedom.
    pub gate_chi2: f64,
    /// Loops in agreement that are believed together.
    pub together: usize,
    /// Gate of their agreement: 99 % with 3 degrees of freedom.
    pub agree_chi2: f64,
    /// Beyond this chi2 a loop's weight in the fit falls off.
    pub doubt_chi2: f64,
    /// A loop whose weight falls below it is refused.
    pub min_weight: f64,
}

impl Default for LoopParams {
    fn default() -> Self {
        Self {
            min_way_m: 10.0,
            near_m: 4.0,
            places: 3,
            every_m: 0.8,
            old_m: 12.0,
            new_m: 8.0,
            sure_m: 0.4,
            doubt: 2.0,
            way_m: 0.04,
            way_rad: 0.006,
            search: SearchParams { cell_m: 0.1, sigma_m: 0.12, turn_rad: 0.015 },
            min_score: 0.55,
            min_margin: 0.08,
            min_matched: 0.55,
            max_rms_m: 0.08,
            max_through: 0.12,
            gate_chi2: 16.27,
            together: 3,
            agree_chi2: crate::gate::CHI2_3_99,
            doubt_chi2: 5.0,
            min_weight: 0.2,
        }
    }
}

/// A loop that was closed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closure {
    /// Key pose met again.
    pub old: usize,
    /// Key pose that met it.
    pub new: usize,
    /// Where the new one is seen from the old one, with covariance.
    pub old_from_new: Pose2Covariance,
}

/// All loops so far.
#[derive(Debug, Clone, Default)]
pub(super) struct Closures {
    edges: Vec<Edge>,
    waiting: Vec<Edge>,
    refused: usize,
    /// Way at the last try.
    tried_m: f64,
}

impl Closures {
    pub(super) fn edges(&self) -> &[Edge] {
        &self.edges
    }

    pub(super) fn refused(&self) -> usize {
        self.refused
    }

    pub(super) fn taken(&self) -> Vec<Closure> {
        let closure = |e: &Edge| Closure {
            old: e.from,
            new: e.to,
            old_from_new: Pose2Covariance { pose: e.measured, covariance: spread(&e.information) },
        };
        self.edges.iter().map(closure).collect()
    }

    /// Drops the loops that contradict the fitted poses.
    pub(super) fn judge(&mut self, poses: &[Pose2], p: &LoopParams) -> bool {
        let before = self.edges.len();
        self.edges.retain(|e| graph::weight(e, graph::chi2(e, poses)) >= p.min_weight);
        self.refused += before - self.edges.len();
        before != self.edges.len()
    }

    /// Looks for places that the last key pose meets again. True if key poses were moved.
    pub(super) fn look(
        &mut self,
        keys: &mut [Key],
        path: &[Edge],
        p: &SlamParams,
    ) -> Result<bool, GraphError> {
        let Some(new) = keys.len().checked_sub(1) else { return Ok(false) };
        if keys[new].path_m - self.tried_m < p.loops.every_m {
            return Ok(false);
        }
        self.tried_m = keys[new].path_m;
        let reached = reach::reach(keys, path, &self.edges, new);
        let before = self.edges.len();
        for old in reach::candidates(keys, &reached, new, &p.loops) {
            let Some(believed) = &reached[old] else { continue };
            // Doubt is told of the new pose in the frame of the old one.
            let mut believed = believed.inverse();
            believed.covariance *= p.loops.doubt.powi(2);
            let sigma = believed.covariance.view((0, 0), (2, 2)).trace().max(0.0).sqrt();
            let met = meet::meet(keys, old, new, &Belief { old_from_new: believed, sigma_m: sigma }, p);
            let Some(edge) = met else { continue };
            if sigma <= p.loops.sure_m {
                self.edges.push(edge);
            } else {
                self.waiting.push(edge);
                self.confirm(keys, path, &p.loops);
            }
        }
        while self.waiting.len() > MAX_WAITING {
            self.waiting.remove(0);
            self.refused += 1;
        }
        if self.edges.len() == before {
            return Ok(false);
        }
        let mut poses: Vec<Pose2> = keys.iter().map(|k| k.pose).collect();
        // New loops may be far from closed: doubted from the start they would never pull.
        let trusted = |(i, e): (usize, &Edge)| if i < before { *e } else { Edge { doubt_chi2: None, ..*e } };
        let all: Vec<Edge> = path.iter().copied().chain(self.edges.iter().enumerate().map(trusted)).collect();
        graph::optimise(&mut poses, &all)?;
        let all: Vec<Edge> = path.iter().chain(&self.edges).copied().collect();
        graph::optimise(&mut poses, &all)?;
        if self.judge(&poses, &p.loops) {
            let all: Vec<Edge> = path.iter().chain(&self.edges).copied().collect();
            graph::optimise(&mut poses, &all)?;
        }
        for (key, pose) in keys.iter_mut().zip(&poses) {
            key.pose = *pose;
        }
        Ok(true)
    }

    /// Takes the waiting loops that agree with the newest, if they are enough.
    fn confirm(&mut self, keys: &[Key], path: &[Edge], p: &LoopParams) {
        let Some(newest) = self.waiting.last().copied() else { return };
        let agreeing: Vec<usize> = (0..self.waiting.len())
            .filter(|&i| {
                let other = &self.waiting[i];
                // Two from one place are one opinion.
                *other == newest || (other.to != newest.to && agree(keys, path, other, &newest, p))
            })
            .collect();
        let mut places: Vec<usize> = agreeing.iter().map(|&i| self.waiting[i].to).collect();
        places.dedup();
        if places.len() >= p.together {
            for &i in agreeing.iter().rev() {
                let edge = self.waiting.remove(i);
                self.edges.push(edge);
            }
        }
    }
}

/// Two loops and the path between their ends make a circle that closes.
fn agree(keys: &[Key], path: &[Edge], a: &Edge, b: &Edge, p: &LoopParams) -> bool {
    let along = |from: usize, to: usize| {
        let (low, high) = (from.min(to), from.max(to));
        let mut sum = Pose2Covariance { pose: Pose2::default(), covariance: Matrix3::zeros() };
        for e in &path[low..high] {
            sum = sum.compose(&Pose2Covariance { pose: e.measured, covariance: spread(&e.information) });
        }
        if from <= to { sum } else { sum.inverse() }
    };
    // Paths that are long say nothing of each other.
    let far = |x: usize, y: usize| (keys[x].path_m - keys[y].path_m).abs() > 30.0;
    if far(a.to, b.to) || far(a.from, b.from) {
        return false;
    }
    let measured = |e: &Edge| Pose2Covariance { pose: e.measured, covariance: spread(&e.information) };
    let through_b = along(a.from, b.from).compose(&measured(b)).compose(&along(b.to, a.to));
    measured(a).distance2(&through_b).is_some_and(|d2| d2 <= p.agree_chi2 * p.doubt.powi(2))
}

/// Covariance of an edge; where it knows nothing, 30 m.
fn spread(information: &Matrix3<f64>) -> Matrix3<f64> {
    let floor = Matrix3::from_diagonal(&Vector3::new(1e-3, 1e-3, 1e-1));
    (information + floor).cholesky().map_or_else(|| Matrix3::identity() * 1e3, |c| c.inverse())
}
