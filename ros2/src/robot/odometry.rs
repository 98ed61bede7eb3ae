//! The last odometry of a robot, and its pose at any time between.

use super::problem::{Input, MissingInput, MissingReason};
use nalgebra::Isometry3;
use std::collections::VecDeque;

/// Most poses that are kept: ten seconds at 50 a second.
pub const MAX_ODOMETRY: usize = 512;
/// A pose that is older than the newest by more than this means that the robot's clock was set
/// back.
pub const MAX_STEP_BACK_NS: i64 = 1_000_000_000;
/// A message that is newer than the newest odometry by up to this waits for odometry; by more,
/// odometry has stopped.
pub const MAX_WAIT_NS: i64 = 500_000_000;

/// Poses by time, oldest first.
#[derive(Debug, Clone, Default)]
pub(super) struct OdometryHistory {
    poses: VecDeque<(i64, Isometry3<f64>)>,
}

/// The odometry of one time.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum OdometryAt {
    Known(Isometry3<f64>),
    /// It is likely to come soon.
    Soon,
    /// It is not there and will not come.
    Absent,
}

impl OdometryHistory {
    /// Adds a pose. Returns whether it is the newest; one that comes late is left out.
    pub(super) fn push(&mut self, at_ns: i64, odom_from_base: Isometry3<f64>) -> bool {
        if let Some(newest) = self.newest_ns() {
            if at_ns < newest.saturating_sub(MAX_STEP_BACK_NS) {
                self.poses.clear();
            } else if at_ns <= newest {
                return false;
            }
        }
        if self.poses.len() >= MAX_ODOMETRY {
            self.poses.pop_front();
        }
        self.poses.push_back((at_ns, odom_from_base));
        true
    }

    pub(super) fn newest_ns(&self) -> Option<i64> {
        self.poses.back().map(|(at_ns, _)| *at_ns)
    }

    /// `odom_from_base`, between two poses in proportion to the time.
    pub(super) fn at(&self, at_ns: i64) -> OdometryAt {
        let after = self.poses.partition_point(|(ns, _)| *ns < at_ns);
        match (after.checked_sub(1).and_then(|i| self.poses.get(i)), self.poses.get(after)) {
            (_, Some((ns, pose))) if *ns == at_ns => OdometryAt::Known(*pose),
            (Some((from_ns, from)), Some((to_ns, to))) => {
                let share = at_ns.abs_diff(*from_ns) as f64 / to_ns.abs_diff(*from_ns) as f64;
                let turn = from.rotation.try_slerp(&to.rotation, share, 1e-9).unwrap_or(to.rotation);
                let at = from.translation.vector.lerp(&to.translation.vector, share);
                OdometryAt::Known(Isometry3::from_parts(at.into(), turn))
            }
            (Some((newest, _)), None) if at_ns.saturating_sub(*newest) <= MAX_WAIT_NS => OdometryAt::Soon,
            _ => OdometryAt::Absent,
        }
    }

    /// Why there is no odometry for a message.
    pub(super) fn lack(&self, topic: &str, at_ns: i64) -> MissingInput {
        let age_ns = self.newest_ns().map(|newest| at_ns.saturating_sub(newest));
        let reason = if age_ns.is_some() { MissingReason::NotAtThatTime } else { MissingReason::NotReceived };
        MissingInput { input: Input::Odometry, topic: topic.to_owned(), age_ns, reason }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::PlanarPose;

    fn at(x_m: f64, theta_rad: f64) -> Isometry3<f64> {
        PlanarPose { x_m, y_m: 0.0, theta_rad }.to_isometry()
    }

    #[test]
    fn poses_between_are_in_proportion() {
        let mut history = OdometryHistory::default();
        history.push(1000, at(1.0, 3.0));
        history.push(2000, at(2.0, -3.0));
        let OdometryAt::Known(between) = history.at(1250) else { panic!("between two poses") };
        let between = PlanarPose::of(&between);
        // The short way round, over pi.
        let turned = 3.0 + 0.25 * (2.0 * std::f64::consts::PI - 6.0);
        assert!((between.x_m - 1.25).abs() < 1e-12 && (between.theta_rad - turned).abs() < 1e-12);
        assert_eq!(history.at(2000), OdometryAt::Known(at(2.0, -3.0)));
        assert_eq!(history.at(999), OdometryAt::Absent);
        assert_eq!(history.at(2000 + MAX_WAIT_NS), OdometryAt::Soon);
        assert_eq!(history.at(2001 + MAX_WAIT_NS), OdometryAt::Absent);
        assert_eq!(OdometryHistory::default().at(1), OdometryAt::Absent);
    }

    #[test]
    fn late_poses_are_left_out_and_a_clock_set_back_begins_anew() {
        let mut history = OdometryHistory::default();
        assert!(history.push(5_000_000_000, at(1.0, 0.0)));
        assert!(!history.push(4_999_999_999, at(9.0, 0.0)) && !history.push(5_000_000_000, at(9.0, 0.0)));
        assert!(history.push(1, at(2.0, 0.0)));
        assert_eq!((history.newest_ns(), history.poses.len()), (Some(1), 1));
    }

    #[test]
    fn the_list_is_bounded() {
        let mut history = OdometryHistory::default();
        for ns in 0..MAX_ODOMETRY as i64 + 3 {
            assert!(history.push(ns, at(0.0, 0.0)));
        }
        assert_eq!((history.poses.len(), history.poses[0].0), (MAX_ODOMETRY, 3));
    }
}
