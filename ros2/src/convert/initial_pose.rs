//! `/initialpose` for AMCL and its successors: a restart of the robot's own localisation.

use super::{
    covariance::{CovarianceError, clip_for_initial_pose, ros_of_planar},
    planar::PlanarPose,
    pose::pose_of,
};
use crate::messages::{Header, PoseWithCovariance, PoseWithCovarianceStamped, Time};
use nalgebra::Matrix3;

/// Why a pose cannot be sent.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum InitialPoseError {
    /// The pose has a number that is NaN or infinite.
    #[error("a pose that is not finite")]
    Pose,
    /// The covariance.
    #[error(transparent)]
    Covariance(#[from] CovarianceError),
}

/// The message that Nav2 takes: `map_frame` has to be its global frame, and `stamp` one of the
/// robot's newest, for it looks up its odometry at that time. The covariance is over (x, y, theta).
pub fn initial_pose<'a>(
    map_frame: &'a str,
    stamp: Time,
    map_from_base: PlanarPose,
    covariance: &Matrix3<f64>,
) -> Result<PoseWithCovarianceStamped<'a>, InitialPoseError> {
    let PlanarPose { x_m, y_m, theta_rad } = map_from_base;
    if ![x_m, y_m, theta_rad].iter().all(|v| v.is_finite()) {
        return Err(InitialPoseError::Pose);
    }
    let covariance = clip_for_initial_pose(&ros_of_planar(covariance))?;
    let pose = PoseWithCovariance { pose: pose_of(&map_from_base.to_isometry()), covariance };
    Ok(PoseWithCovarianceStamped { header: Header { stamp, frame_id: map_frame }, pose })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::MAX_INITIAL_VARIANCE;

    #[test]
    fn nav2s_checks_hold() {
        let covariance = Matrix3::new(0.2, -0.05, 0.0, -0.05, 0.1, 0.0, 0.0, 0.0, 0.01);
        let pose = PlanarPose { x_m: 1.0, y_m: 2.0, theta_rad: -3.0 };
        let message = initial_pose("map", Time { sec: 5, nanosec: 0 }, pose, &covariance).unwrap();
        assert_eq!(message.header.frame_id, "map");
        let q = message.pose.pose.orientation;
        assert!((q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w - 1.0).abs() < 1e-4);
        assert!(message.pose.covariance.iter().all(|v| (0.0..=MAX_INITIAL_VARIANCE).contains(v)));
        assert_eq!(message.pose.covariance[1].abs().to_bits(), 0, "a negative correlation is none");
    }

    #[test]
    fn what_is_not_finite_is_not_sent() {
        let at = |x_m| PlanarPose { x_m, ..PlanarPose::default() };
        let send = |x_m, m| initial_pose("map", Time::default(), at(x_m), &m);
        assert_eq!(send(f64::NAN, Matrix3::identity()), Err(InitialPoseError::Pose));
        let bad = send(0.0, Matrix3::from_diagonal_element(f64::NAN));
        assert_eq!(bad, Err(InitialPoseError::Covariance(CovarianceError(0))));
    }
}
