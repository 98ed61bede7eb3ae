//! Scan matching from scan to scan: odometry predicts, the recent keyframes correct. In: a scan.
//! Out: its pose relative to the last keyframe, and whether it should become one.

use crate::{
    pose2::{Pose2, Pose2Covariance},
    slam::{
        cloud::Cloud,
        correlative::{LikelihoodField, PoseWindow},
        icp::{PosePrior, align},
        information::inverse,
        keyframe::Keyframe,
        params::SlamParams,
        surface_index::SurfaceIndex,
    },
};
use nalgebra::{Matrix3, Point2};

/// Largest searched distance from the predicted position, metres.
const MAX_REACH_M: f64 = 1.2;
/// Largest searched turn from the predicted heading, radians.
const MAX_REACH_RAD: f64 = 0.7;

/// The pose of a scan.
#[derive(Debug, Clone, Copy)]
pub(super) struct ScanPlacement {
    /// Pose relative to the last keyframe, with covariance in its frame.
    pub key_from_robot: Pose2Covariance,
    /// Whether the scan should become a keyframe.
    pub is_new: bool,
}

/// The recent map, in the frame of the last keyframe.
#[derive(Debug, Clone, Default)]
pub(super) struct ScanMatcher {
    recent: Option<(SurfaceIndex, LikelihoodField)>,
    /// Pose of the last scan in the keyframe's frame.
    last: Pose2,
    /// Covariance of that pose.
    spread: Matrix3<f64>,
    /// Covariance since the keyframe by odometry alone.
    by_odometry: Matrix3<f64>,
    odom: Pose2,
}

impl ScanMatcher {
    /// Rebuilds the recent map around a new keyframe.
    pub(super) fn start(&mut self, keys: &[Keyframe], p: &SlamParams) {
        let Some(key) = keys.last() else { return };
        self.rebuild(keys, p);
        self.last = Pose2::default();
        (self.spread, self.by_odometry) = (Matrix3::zeros(), Matrix3::zeros());
        self.odom = key.odom;
    }

    /// Rebuilds the recent map after the keyframes have moved.
    pub(super) fn rebuild(&mut self, keys: &[Keyframe], p: &SlamParams) {
        let Some(key) = keys.last() else { return };
        let first = keys.len().saturating_sub(p.recent_keys.max(1));
        let near = || {
            let recent = keys[first..].iter().filter(|k| key.path_m - k.path_m <= p.recent_m);
            recent.map(|k| (key.pose.between(&k.pose), &k.cloud))
        };
        let reference = SurfaceIndex::new(near(), p.align.start_radius_m);
        let field =
            LikelihoodField::new(near(), &Point2::origin(), p.cloud.max_range_m, MAX_REACH_M, &p.search);
        self.recent = Some((reference, field));
    }

    /// Matches a scan near the pose predicted by odometry.
    pub(super) fn track(
        &mut self,
        keys: &[Keyframe],
        odom: &Pose2,
        cloud: &Cloud,
        p: &SlamParams,
    ) -> ScanPlacement {
        let (Some(key), Some((reference, field))) = (keys.last(), &self.recent) else {
            let key_from_robot = Pose2Covariance { pose: Pose2::default(), covariance: Matrix3::zeros() };
            return ScanPlacement { key_from_robot, is_new: true };
        };
        let motion = p.motion(&self.odom.between(odom));
        let predicted = Pose2Covariance { pose: self.last, covariance: self.spread }.compose(&motion);
        let since = p.motion(&key.odom.between(odom));
        let alone = Pose2Covariance { pose: self.last, covariance: self.by_odometry }.compose(&motion);
        self.by_odometry = alone.covariance;
        let by_odometry = if since.covariance.trace() > alone.covariance.trace() { since } else { alone };
        let guess = guess(field, cloud, &predicted, p);
        let prior = PosePrior { pose: predicted.pose, information: inverse(&predicted.covariance) };
        let aligned = align(reference, cloud, &guess, Some(&prior), &p.align)
            .filter(|a| a.matched >= p.min_matched && fits(&a.pose, &predicted));
        let (pose, information, matched) = match &aligned {
            Some(a) => (a.pose, a.information, a.matched),
            None => (predicted.pose, Matrix3::zeros(), 0.0),
        };
        let covariance = inverse(&(information + inverse(&by_odometry.covariance)));
        self.spread = inverse(&(information + prior.information));
        (self.last, self.odom) = (pose, *odom);
        let is_new = pose.position().norm() > p.key_m
            || pose.theta_rad.abs() > p.key_rad
            || (matched < p.key_matched && pose.position().norm() > 0.25 * p.key_m);
        ScanPlacement { key_from_robot: Pose2Covariance { pose, covariance }, is_new }
    }
}

/// The best pose around the predicted one on the grid; the predicted one if none scores well.
fn guess(field: &LikelihoodField, cloud: &Cloud, predicted: &Pose2Covariance, p: &SlamParams) -> Pose2 {
    let c = &predicted.covariance;
    let sigma_m = c[(0, 0)].max(c[(1, 1)]).max(0.0).sqrt();
    let window = PoseWindow {
        middle: predicted.pose,
        reach_m: (3.0 * sigma_m + 0.05).min(MAX_REACH_M),
        reach_rad: (3.0 * c[(2, 2)].max(0.0).sqrt() + 0.02).min(MAX_REACH_RAD),
        pull: 0.05,
    };
    let points: Vec<Point2<f64>> = cloud.points.iter().map(|q| q.at).collect();
    field.search(&points, &window, 0.3, None, &p.search).map_or(predicted.pose, |f| f.pose)
}

/// Whether a pose is within the error of odometry from the prediction.
fn fits(pose: &Pose2, predicted: &Pose2Covariance) -> bool {
    let d = pose.minus(&predicted.pose);
    d.dot(&(inverse(&predicted.covariance) * d)) < 50.0
}
