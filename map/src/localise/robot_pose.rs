//! The robot's pose from the landmarks of one frame.

use crate::{
    check::{self, OutOfRange},
    extrinsics::CameraExtrinsics,
    localise::{
        fix::{FixResult, LandmarkObservation},
        params::LocaliseParams,
        solve::solve,
    },
    pose2::Pose2Covariance,
};

/// Most observations used in one fix; of more, those with the largest image.
pub const MAX_OBSERVATIONS: usize = 8;

/// The robot's pose from the landmarks of one frame. Errors name an input that is out of range.
pub fn robot_pose(
    observations: &[LandmarkObservation<'_>],
    mounting: &CameraExtrinsics,
    prior: Option<&Pose2Covariance>,
    p: &LocaliseParams,
) -> Result<FixResult, OutOfRange> {
    check::within("observations", observations.len() as f64, 1.0, f64::MAX)?;
    mounting.check()?;
    for observation in observations {
        observation.place.check()?;
    }
    if let Some(prior) = prior {
        prior.check()?;
    }
    Ok(solve(&largest(observations), mounting, prior, p))
}

/// The observations that a fix uses.
pub(super) fn largest<'a>(observations: &[LandmarkObservation<'a>]) -> Vec<LandmarkObservation<'a>> {
    let mut used = observations.to_vec();
    // Largest first; stable, so equal ones stay in order.
    used.sort_by(|a, b| {
        let area = |s: &LandmarkObservation<'_>| s.seen.measured.corners_px.area_px2();
        area(b).total_cmp(&area(a))
    });
    used.truncate(MAX_OBSERVATIONS);
    used
}
