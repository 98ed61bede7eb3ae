//! Expected information gain of an observation: half the logarithm of the ratio of the pose
//! covariance's determinants before and after it, by the predicted covariance of the corners
//! (method 13.5, 14).

use crate::{
    extrinsics::CameraExtrinsics,
    localise::predict::{self, Predicted},
    place::LandmarkPlace,
    pose2::Pose2Covariance,
};
use nalgebra::{Matrix3, SMatrix};
use vision::frame::{Distortion, Intrinsics};

/// Expected gain, nats. `None` if the landmark is not in front of the camera.
pub(super) fn gain_nats(
    pose: &Pose2Covariance,
    place: &LandmarkPlace,
    mounting: &CameraExtrinsics,
    focal_px: f64,
    corner_sigma_px: f64,
) -> Option<f64> {
    // The principal point does not matter for an ideal camera.
    let camera = Intrinsics {
        fx_px: focal_px,
        fy_px: focal_px,
        cx_px: 0.0,
        cy_px: 0.0,
        distortion: Distortion::None,
        sigmas: None,
    };
    let Predicted { pose: by_pose, place: by_place, mounting: by_mounting } =
        predict::corners(&pose.pose, place, mounting, &camera)?;
    let noise = SMatrix::<f64, 8, 8>::identity() * corner_sigma_px.max(1e-3).powi(2);
    let covariance = noise
        + by_place * place.covariance * by_place.transpose()
        + by_mounting * mounting.covariance * by_mounting.transpose();
    let information = by_pose.transpose() * covariance.cholesky()?.solve(&by_pose);
    // det(P) / det(P+) = det(1 + P J' S^-1 J), which needs no inverse of P.
    let ratio = (Matrix3::identity() + pose.covariance * information).determinant();
    Some(0.5 * ratio.max(1.0).ln())
}
