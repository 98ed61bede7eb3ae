//! Pose of a landmark in the camera frame from its four corners (method 13.1 to 13.5).
//!
//! In: corners with covariance, the landmark's size, a calibrated camera. Out: the best pose with
//! its covariance, the other minimum of the reprojection error where there is one, and whether the
//! two are ambiguous. The robot's pose is computed by `map::localise`.

use crate::{
    frame::Intrinsics,
    geometry::{corner_covariance::CornerCovariance, corners::Corners},
    pose::{
        linear::{faces_camera, linear_pose, mirrored},
        measurement::{LandmarkSize, PoseError, PoseMeasurement, measured},
        refine::{CHI2_2_95, PoseSolution, Problem},
        spread::second_moment,
    },
};

/// Pose of a recognised landmark: always with covariance, and with the second solution of the
/// planar ambiguity.
#[derive(Debug, Clone, PartialEq)]
pub struct LandmarkPose {
    /// The solution of least error.
    pub best: PoseSolution,
    /// The other local minimum, where there is one.
    pub second: Option<PoseSolution>,
    /// The reprojection errors of both do not decide (ratio below [`AMBIGUOUS_RATIO`]): a prior is
    /// needed.
    pub ambiguous: bool,
    /// The corners used: localisation fits the robot's pose directly to them.
    pub measured: PoseMeasurement,
}

/// Ratio of the reprojection errors below which two solutions are ambiguous (method 13.4).
pub const AMBIGUOUS_RATIO: f64 = 2.0;
/// Difference of chi2 below which two solutions are ambiguous.
///
/// Departs from method 13.4: the ratio alone lets flips through, since a true pose with an unlucky
/// chi2 of 6 next to a false one of 1 has ratio 2.4. For two minima whose predictions lie D sigma
/// apart the false one wins by more than T with probability Q((T + D^2) / 2D) <= Q(sqrt T), at any
/// D: 3e-5 for T = 16.
pub const AMBIGUOUS_CHI2: f64 = 16.0;
/// Two minima nearer than this are the same.
const SAME_POSE_RAD: f64 = 1e-4;

/// Pose of a landmark of known `size` from its `corners` (pixels, distorted as seen, in the
/// landmark's own order) with their covariance, joint or of each. Eq. (2), nearest rotation, then
/// least squares from it and from its mirror image.
pub fn landmark_pose(
    corners: &Corners,
    covariance_px2: impl Into<CornerCovariance>,
    size: LandmarkSize,
    camera: &Intrinsics,
) -> Result<LandmarkPose, PoseError> {
    let measured = measured(corners, &covariance_px2.into(), size, camera)?;
    let problem = Problem::new(&measured).ok_or(PoseError::Degenerate)?;
    let start = linear_pose(&measured).ok_or(PoseError::Degenerate)?;
    let first = problem
        .descend(start)
        .filter(faces_camera)
        .and_then(|pose| problem.solution(pose))
        .ok_or(PoseError::Degenerate)?;
    let other = problem
        .descend(mirrored(&first.camera_from_landmark))
        .filter(faces_camera)
        .filter(|pose| pose.rotation.angle_to(&first.camera_from_landmark.rotation) > SAME_POSE_RAD)
        .and_then(|pose| problem.solution(pose));
    let (mut best, mut second) = match other {
        Some(other) if other.chi2 < first.chi2 => (other, Some(first)),
        other => (first, other),
    };
    let ambiguous = second.as_ref().is_some_and(|second| {
        second.chi2 - best.chi2 < AMBIGUOUS_CHI2
            || second.reprojection_rms_px < AMBIGUOUS_RATIO * best.reprojection_rms_px
    });
    // Departs from method 13.5: where the plane's direction is poorly known, (J^T S^-1 J)^-1 is not
    // its covariance.
    let scale = (best.chi2 / CHI2_2_95).max(1.0);
    let poses = [Some(best.camera_from_landmark), second.as_ref().map(|s| s.camera_from_landmark)];
    for (i, solution) in [Some(&mut best), second.as_mut()].into_iter().enumerate() {
        let Some(solution) = solution else { continue };
        let rival = poses[1 - i].as_ref().filter(|_| ambiguous);
        let at = solution.camera_from_landmark;
        if let Some(wide) = second_moment(&problem, &at, &solution.covariance, rival, scale) {
            solution.covariance = wide;
        }
        if let Some(spread) = problem.spread_by_camera(&at) {
            solution.covariance += spread;
        }
    }
    Ok(LandmarkPose { best, second, ambiguous, measured })
}

#[cfg(test)]
mod tests;
