//! Relative covariances of all keyframes from the newest one, and which of them may observe the
//! same walls. In: the pose graph. Out: the old keyframes worth a try.

use crate::{
    pose2::{Pose2, Pose2Covariance},
    slam::{
        graph::PoseConstraint,
        information::spread,
        keyframe::Keyframe,
        loop_closure::params::{LoopParams, MAX_REACH_M},
    },
};
use nalgebra::Matrix3;
use std::{cmp::Ordering, collections::BinaryHeap};

/// A pose on its way through the graph (Dijkstra).
struct Reached {
    cost: f64,
    at: usize,
}

impl PartialEq for Reached {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Reached {}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        // The heap gives the largest first.
        other.cost.total_cmp(&self.cost).then(other.at.cmp(&self.at))
    }
}

/// `new_from_pose` of every pose with covariance along the most certain chain of constraints: never
/// more certain than by the whole graph (Olson 2009).
pub(super) fn relative_covariances(
    keys: &[Keyframe],
    path: &[PoseConstraint],
    loops: &[PoseConstraint],
    new: usize,
) -> Vec<Option<Pose2Covariance>> {
    let mut joined: Vec<Vec<(usize, Matrix3<f64>, bool)>> = vec![Vec::new(); keys.len()];
    for e in path.iter().chain(loops) {
        let covariance = spread(&e.information);
        joined[e.from].push((e.to, covariance, true));
        joined[e.to].push((e.from, covariance, false));
    }
    let mut best: Vec<Option<Pose2Covariance>> = vec![None; keys.len()];
    let mut done = vec![false; keys.len()];
    let mut costs = vec![f64::INFINITY; keys.len()];
    best[new] = Some(Pose2Covariance { pose: Pose2::default(), covariance: Matrix3::zeros() });
    costs[new] = 0.0;
    let mut open = BinaryHeap::from([Reached { cost: 0.0, at: new }]);
    while let Some(Reached { at, .. }) = open.pop() {
        if std::mem::replace(&mut done[at], true) {
            continue;
        }
        let Some(here) = best[at] else { continue };
        for (next, covariance, forward) in &joined[at] {
            if done[*next] {
                continue;
            }
            let step = keys[at].pose.between(&keys[*next].pose);
            // The covariance is in the frame of the constraint's first pose.
            let step = if *forward {
                Pose2Covariance { pose: step, covariance: *covariance }
            } else {
                Pose2Covariance { pose: step.inverse(), covariance: *covariance }.inverse()
            };
            let there = here.compose(&step);
            let c = &there.covariance;
            let cost = c[(0, 0)] + c[(1, 1)] + 25.0 * c[(2, 2)];
            if cost < costs[*next] {
                costs[*next] = cost;
                best[*next] = Some(there);
                open.push(Reached { cost, at: *next });
            }
        }
    }
    best
}

/// Old keyframes that may observe what the new one does: the nearest of every passage.
pub(super) fn candidates(
    keys: &[Keyframe],
    reached: &[Option<Pose2Covariance>],
    new: usize,
    p: &LoopParams,
) -> Vec<usize> {
    let mut passes: Vec<(usize, f64)> = Vec::new();
    let mut in_pass = false;
    for (i, pose) in reached.iter().enumerate().take(new) {
        if keys[new].path_m - keys[i].path_m < p.min_way_m {
            break;
        }
        let Some(pose) = pose else { continue };
        let c = &pose.covariance;
        let sigma = (c[(0, 0)] + c[(1, 1)]).max(0.0).sqrt();
        let away = pose.pose.position().norm();
        if away > p.near_m + (2.5 * sigma).min(MAX_REACH_M) || sigma > 2.0 * MAX_REACH_M {
            in_pass = false;
            continue;
        }
        match passes.last_mut() {
            // A long passage is cut, so that a large uncertainty is tried at several places.
            Some(last) if in_pass && keys[i].path_m - keys[last.0].path_m < 2.0 * p.near_m => {
                if away < last.1 {
                    *last = (i, away);
                }
            }
            _ => passes.push((i, away)),
        }
        in_pass = true;
    }
    passes.sort_by(|a, b| a.1.total_cmp(&b.1));
    passes.iter().take(p.places).map(|(i, _)| *i).collect()
}
