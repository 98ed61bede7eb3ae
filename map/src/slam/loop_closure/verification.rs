//! Verifies one loop: matches the scans of a new keyframe to those around an old one. In: two
//! keyframes and their expected relative pose. Out: the measured relative pose as a constraint, or
//! nothing.

use crate::{
    pose2::{Pose2, Pose2Covariance},
    slam::{
        cloud::{Cloud, SurfacePoint},
        correlative::{LikelihoodField, PoseWindow},
        graph::PoseConstraint,
        icp::{IcpResult, align},
        information::{spread, with_floor},
        keyframe::Keyframe,
        loop_closure::params::{MAX_REACH_M, MAX_REACH_RAD},
        params::SlamParams,
        surface_index::SurfaceIndex,
    },
};
use nalgebra::{Point2, Vector2};

/// With a smaller uncertainty the expected pose is a sufficient guess, metres.
const SURE_M: f64 = 0.1;
/// Most points of the correlative search.
const MAX_TRIED: usize = 400;
/// A rival pose is at least this far from the best one, metres,
const RIVAL_M: f64 = 1.0;
/// or turned by this much, radians.
const RIVAL_RAD: f64 = 0.3;

/// The expected relative pose.
#[derive(Debug, Clone, Copy)]
pub(super) struct LoopPrior {
    pub old_from_new: Pose2Covariance,
    /// Standard deviation of the position, metres.
    pub sigma_m: f64,
}

/// Matches the scans of the new keyframe to those around the old one.
pub(super) fn verify_loop(
    keys: &[Keyframe],
    old: usize,
    new: usize,
    belief: &LoopPrior,
    p: &SlamParams,
) -> Option<PoseConstraint> {
    let l = &p.loops;
    let sure = belief.sigma_m <= l.sure_m;
    let limit_m = keys[new].path_m - 0.5 * l.min_way_m;
    let old_scans: Vec<(Pose2, &Cloud)> = around(keys, old, l.old_m)
        .filter(|k| k.path_m <= limit_m)
        .map(|k| in_frame_of(keys, old, k))
        .collect();
    let query = if sure {
        keys[new].cloud.clone()
    } else {
        let way = around(keys, new, l.new_m);
        joined(way.map(|k| in_frame_of(keys, new, k)))
    };
    let guess = if belief.sigma_m > SURE_M {
        search(&old_scans, &query, belief, p)?
    } else {
        belief.old_from_new.pose
    };
    let reference = SurfaceIndex::new(old_scans.iter().copied(), p.align.start_radius_m);
    let aligned = align(&reference, &query, &guess, None, &p.align)?;
    let good = aligned.matched >= l.min_matched && aligned.rms_m <= l.max_rms_m;
    let moved = aligned.pose.minus(&guess);
    if !good || moved.xy().norm() > 0.6 || moved.z.abs() > 0.2 {
        return None;
    }
    if through(&reference, &keys[new].cloud, &aligned) > l.max_through {
        return None;
    }
    // Joined scans have the error of the path between them.
    let floor = if sure { [0.0, 0.0] } else { [l.way_m, l.way_rad] };
    let information = with_floor(&aligned.information, floor);
    let measured = Pose2Covariance { pose: aligned.pose, covariance: spread(&information) };
    let d2 = measured.distance2(&belief.old_from_new)?;
    let edge = PoseConstraint {
        from: old,
        to: new,
        measured: aligned.pose,
        information,
        doubt_chi2: Some(l.doubt_chi2),
    };
    (d2 <= l.gate_chi2).then_some(edge)
}

/// The best pose in the window, if it scores well and no other is nearly as good.
fn search(old_scans: &[(Pose2, &Cloud)], query: &Cloud, belief: &LoopPrior, p: &SlamParams) -> Option<Pose2> {
    let l = &p.loops;
    let believed = &belief.old_from_new;
    let heading = believed.covariance[(2, 2)].max(0.0).sqrt();
    let window = PoseWindow {
        middle: believed.pose,
        reach_m: (3.0 * belief.sigma_m + 0.3).min(MAX_REACH_M),
        reach_rad: (3.0 * heading + 0.05).min(MAX_REACH_RAD),
        pull: 0.02,
    };
    let points = thinned(query, MAX_TRIED);
    let middle = Point2::from(believed.pose.position() * 0.5);
    let scans = old_scans.iter().copied();
    let field = LikelihoodField::new(scans, &middle, p.cloud.max_range_m, window.reach_m, &l.search);
    let best = field.search(&points, &window, l.min_score, None, &l.search)?;
    let rival = (&best.pose, RIVAL_M, RIVAL_RAD);
    let nearly = (best.score - l.min_margin).max(0.0);
    let second = field.search(&points, &window, nearly, Some(rival), &l.search);
    second.is_none().then_some(best.pose)
}

/// Keyframes within a distance along the path of one of them, before and after.
fn around(keys: &[Keyframe], i: usize, distance_m: f64) -> impl Iterator<Item = &Keyframe> {
    let here = keys[i].path_m;
    keys.iter().filter(move |k| (k.path_m - here).abs() <= distance_m)
}

fn in_frame_of<'a>(keys: &[Keyframe], i: usize, key: &'a Keyframe) -> (Pose2, &'a Cloud) {
    (keys[i].pose.between(&key.pose), &key.cloud)
}

/// Several scans joined in one frame.
fn joined<'a>(scans: impl Iterator<Item = (Pose2, &'a Cloud)>) -> Cloud {
    let mut all = Cloud::default();
    for (pose, cloud) in scans {
        let (s, c) = pose.theta_rad.sin_cos();
        all.points.extend(cloud.points.iter().map(|q| {
            let normal = q.normal.map(|n| Vector2::new(c * n.x - s * n.y, s * n.x + c * n.y));
            SurfacePoint { at: pose.apply(&q.at), normal, turn_variance: q.turn_variance, joined: q.joined }
        }));
    }
    all
}

/// At most `most` points, at regular intervals.
fn thinned(cloud: &Cloud, most: usize) -> Vec<Point2<f64>> {
    let stride = cloud.points.len().div_ceil(most.max(1)).max(1);
    cloud.points.iter().step_by(stride).map(|q| q.at).collect()
}

/// Share of the scan's beams that pass through surfaces which face them.
fn through(reference: &SurfaceIndex, cloud: &Cloud, aligned: &IcpResult) -> f64 {
    let origin = aligned.pose.apply(&cloud.origin);
    let (mut crossed, mut beams) = (0_u32, 0_u32);
    for point in &cloud.points {
        let end = aligned.pose.apply(&point.at);
        let d = end - origin;
        let length = d.norm();
        if length < 0.6 {
            continue;
        }
        beams += 1;
        let steps = (length / 0.1) as usize;
        let towards = -d / length;
        // From 0.3 m in front of the laser to 0.4 m before the end.
        let hit = (3..steps.saturating_sub(4)).any(|k| {
            let at = origin + d * (k as f64 / steps as f64);
            reference.nearest(&at, &towards, 0.07, 0.5).is_some()
        });
        crossed += u32::from(hit);
    }
    f64::from(crossed) / f64::from(beams).max(1.0)
}
