//! The loops closed so far, and the search for new ones at each keyframe.

use crate::{
    pose2::{Pose2, Pose2Covariance},
    slam::{
        graph::{self, GraphError, PoseConstraint},
        information::spread,
        keyframe::Keyframe,
        loop_closure::{
            params::LoopParams,
            reach::{candidates, relative_covariances},
            verification::{LoopPrior, verify_loop},
        },
        params::SlamParams,
    },
};
use nalgebra::Matrix3;

/// Most loops that wait for confirmation.
const MAX_WAITING: usize = 64;

/// A closed loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoopClosure {
    /// Index of the earlier keyframe.
    pub old: usize,
    /// Index of the later keyframe, which revisits it.
    pub new: usize,
    /// Relative pose of the new keyframe, with covariance.
    pub old_from_new: Pose2Covariance,
}

/// Closed and waiting loops.
#[derive(Debug, Clone, Default)]
pub(in crate::slam) struct LoopCloser {
    edges: Vec<PoseConstraint>,
    waiting: Vec<PoseConstraint>,
    refused: usize,
    /// Path length at the last try, metres.
    tried_m: f64,
}

impl LoopCloser {
    pub(in crate::slam) fn edges(&self) -> &[PoseConstraint] {
        &self.edges
    }

    pub(in crate::slam) fn refused(&self) -> usize {
        self.refused
    }

    pub(in crate::slam) fn taken(&self) -> Vec<LoopClosure> {
        let closure = |e: &PoseConstraint| LoopClosure {
            old: e.from,
            new: e.to,
            old_from_new: Pose2Covariance { pose: e.measured, covariance: spread(&e.information) },
        };
        self.edges.iter().map(closure).collect()
    }

    /// Drops the loops that contradict the fitted poses. True if any was dropped.
    pub(in crate::slam) fn prune(&mut self, poses: &[Pose2], p: &LoopParams) -> bool {
        let before = self.edges.len();
        self.edges.retain(|e| graph::weight(e, graph::chi2(e, poses)) >= p.min_weight);
        self.refused += before - self.edges.len();
        before != self.edges.len()
    }

    /// Detects loops of the last keyframe. True if keyframes were moved.
    pub(in crate::slam) fn detect(
        &mut self,
        keys: &mut [Keyframe],
        path: &[PoseConstraint],
        p: &SlamParams,
    ) -> Result<bool, GraphError> {
        let Some(new) = keys.len().checked_sub(1) else { return Ok(false) };
        if keys[new].path_m - self.tried_m < p.loops.every_m {
            return Ok(false);
        }
        self.tried_m = keys[new].path_m;
        let reached = relative_covariances(keys, path, &self.edges, new);
        let before = self.edges.len();
        for old in candidates(keys, &reached, new, &p.loops) {
            let Some(believed) = &reached[old] else { continue };
            // Covariance of the new pose in the frame of the old one.
            let mut believed = believed.inverse();
            believed.covariance *= p.loops.doubt.powi(2);
            let sigma = believed.covariance.view((0, 0), (2, 2)).trace().max(0.0).sqrt();
            let met = verify_loop(keys, old, new, &LoopPrior { old_from_new: believed, sigma_m: sigma }, p);
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
        // New loops may be far from closed: a robust weight would suppress them from the start.
        let trusted = |(i, e): (usize, &PoseConstraint)| {
            if i < before { *e } else { PoseConstraint { doubt_chi2: None, ..*e } }
        };
        let all: Vec<PoseConstraint> =
            path.iter().copied().chain(self.edges.iter().enumerate().map(trusted)).collect();
        graph::optimise(&mut poses, &all)?;
        let all: Vec<PoseConstraint> = path.iter().chain(&self.edges).copied().collect();
        graph::optimise(&mut poses, &all)?;
        if self.prune(&poses, &p.loops) {
            let all: Vec<PoseConstraint> = path.iter().chain(&self.edges).copied().collect();
            graph::optimise(&mut poses, &all)?;
        }
        for (key, pose) in keys.iter_mut().zip(&poses) {
            key.pose = *pose;
        }
        Ok(true)
    }

    /// Accepts the waiting loops that agree with the newest, if there are enough.
    fn confirm(&mut self, keys: &[Keyframe], path: &[PoseConstraint], p: &LoopParams) {
        let Some(newest) = self.waiting.last().copied() else { return };
        let agreeing: Vec<usize> = (0..self.waiting.len())
            .filter(|&i| {
                let other = &self.waiting[i];
                // Two loops of one keyframe are not independent.
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

/// Whether two loops and the path between their ends form a closed circle.
fn agree(
    keys: &[Keyframe],
    path: &[PoseConstraint],
    a: &PoseConstraint,
    b: &PoseConstraint,
    p: &LoopParams,
) -> bool {
    let along = |from: usize, to: usize| {
        let (low, high) = (from.min(to), from.max(to));
        let mut sum = Pose2Covariance { pose: Pose2::default(), covariance: Matrix3::zeros() };
        for e in &path[low..high] {
            sum = sum.compose(&Pose2Covariance { pose: e.measured, covariance: spread(&e.information) });
        }
        if from <= to { sum } else { sum.inverse() }
    };
    // Over a long path the agreement means nothing.
    let far = |x: usize, y: usize| (keys[x].path_m - keys[y].path_m).abs() > 30.0;
    if far(a.to, b.to) || far(a.from, b.from) {
        return false;
    }
    let measured =
        |e: &PoseConstraint| Pose2Covariance { pose: e.measured, covariance: spread(&e.information) };
    let through_b = along(a.from, b.from).compose(&measured(b)).compose(&along(b.to, a.to));
    measured(a).distance2(&through_b).is_some_and(|d2| d2 <= p.agree_chi2 * p.doubt.powi(2))
}
