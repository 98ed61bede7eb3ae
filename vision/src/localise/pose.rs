//! Pose of a landmark in the camera frame from its four corners (method 13.1 to 13.5).
//!
//! In: corners with covariance, the landmark's size, a calibrated camera. Out: the best pose with its covariance, the
//! other minimum of the reprojection error where there is one, and whether the two can be told apart.
//! Decides nothing about the robot: that takes the map (`map::localise`).

use super::{
    refine::{CHI2_2_95, Problem},
    reproject::corner_points,
    spread::second_moment,
};
use crate::{
    detect::quads::Corners,
    frame::{Distortion, FrameError, Intrinsics},
    geometry::homography::Homography,
};
use nalgebra::{Isometry3, Matrix2, Matrix2x3, Matrix3, Matrix6, Point2, Rotation3, UnitQuaternion};

/// Width and height of a landmark, in metres.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LandmarkSize {
    /// Along the landmark's y.
    pub width_m: f64,
    /// Along the landmark's z.
    pub height_m: f64,
}

impl LandmarkSize {
    /// Smallest accepted side.
    pub const MIN_M: f64 = 0.01;
    /// Largest accepted side.
    pub const MAX_M: f64 = 100.0;
}

/// What a pose was computed from, free of lens distortion.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Corners as a pinhole with the same K would see them, in the landmark's order.
    pub corners_px: Corners,
    /// Covariance of each of them.
    pub covariance_px2: [Matrix2<f64>; 4],
    /// The pinhole.
    pub camera: Intrinsics,
    /// How each corner would move if the camera's (share of the focal length, cx, cy) were more.
    pub by_camera: [Matrix2x3<f64>; 4],
    /// The size that was assumed.
    pub size: LandmarkSize,
}

/// One minimum of the reprojection error.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseSolution {
    /// Maps landmark coordinates to camera coordinates.
    pub camera_from_landmark: Isometry3<f64>,
    /// Covariance of the left perturbation (rotation vector rad, translation m), in that order, camera frame: corners,
    /// and the camera's own errors where they are stated.
    pub covariance: Matrix6<f64>,
    /// Root mean square reprojection error per coordinate, in pixels.
    pub reprojection_rms_px: f64,
    /// Weighted squared residual (2 degrees of freedom).
    pub chi2: f64,
}

/// Pose of a recognised landmark: always with covariance, and with the second solution of the planar ambiguity.
#[derive(Debug, Clone, PartialEq)]
pub struct LandmarkPose {
    /// The solution of least error.
    pub best: PoseSolution,
    /// The other local minimum, where there is one.
    pub second: Option<PoseSolution>,
    /// The second cannot be told from the first by its error (ratio below 2): only a prior can decide.
    pub ambiguous: bool,
    /// The corners behind it: localisation fits the robot's pose directly to them.
    pub measured: Measured,
}

/// Largest accepted corner coordinate, in pixels: four times the largest image.
pub const MAX_CORNER_PX: f64 = 32_768.0;
/// Smallest accepted standard deviation of a corner: finer than any detector.
pub const MIN_CORNER_SIGMA_PX: f64 = 1e-4;
/// Largest accepted standard deviation of a corner.
pub const MAX_CORNER_SIGMA_PX: f64 = 1e4;
/// Ratio of the reprojection errors below which two solutions are ambiguous (method 13.4).
pub const AMBIGUOUS_RATIO: f64 = 2.0;
/// Difference of chi2 below which two solutions are ambiguous.
///
/// Departs from method 13.4: the ratio alone lets flips through, since a true pose with an unlucky chi2 of 6 next to
/// a false one of 1 has ratio 2.4. For two minima whose predictions lie D sigma apart the false one wins by more than
/// T with probability Q((T + D^2) / 2D) <= Q(sqrt T), at any D: 3e-5 for T = 16.
pub const AMBIGUOUS_CHI2: f64 = 16.0;
/// Two minima nearer than this are one.
const SAME_POSE_RAD: f64 = 1e-4;

/// Why there is no pose.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PoseError {
    /// A side of the landmark is not finite or not in [`LandmarkSize::MIN_M`] to [`LandmarkSize::MAX_M`].
    #[error("{field} = {value} is out of range")]
    Size {
        /// `width_m` or `height_m`.
        field: &'static str,
        /// What it was.
        value: f64,
    },
    /// The intrinsics are impossible.
    #[error(transparent)]
    Camera(#[from] FrameError),
    /// A corner lies beyond [`MAX_CORNER_PX`].
    #[error("corner {corner} lies beyond {MAX_CORNER_PX} px")]
    Corner {
        /// Its index, TL TR BR BL.
        corner: usize,
    },
    /// A covariance is not symmetric, or a standard deviation is not in [`MIN_CORNER_SIGMA_PX`] to
    /// [`MAX_CORNER_SIGMA_PX`].
    #[error("covariance of corner {corner} is impossible")]
    Covariance {
        /// Its index, TL TR BR BL.
        corner: usize,
    },
    /// The distortion cannot be undone at a corner, or undoing it folds the quad.
    #[error("lens distortion cannot be undone at the corners")]
    Distortion,
    /// The corners do not determine a pose in front of the camera.
    #[error("the corners do not determine a pose")]
    Degenerate,
}

/// Pose of a landmark of known `size` from its `corners` (pixels, distorted as seen, in the landmark's own order) with
/// their covariances. Eq. (2), nearest rotation, then least squares from it and from its mirror image.
pub fn landmark_pose(
    corners: &Corners,
    covariance_px2: &[Matrix2<f64>; 4],
    size: LandmarkSize,
    camera: &Intrinsics,
) -> Result<LandmarkPose, PoseError> {
    let measured = measured(corners, covariance_px2, size, camera)?;
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
    // Departs from method 13.5: where the plane's direction is poorly known, (J^T S^-1 J)^-1 is not its covariance.
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

/// Checks everything and takes the lens distortion out.
fn measured(
    corners: &Corners,
    covariance_px2: &[Matrix2<f64>; 4],
    size: LandmarkSize,
    camera: &Intrinsics,
) -> Result<Measured, PoseError> {
    for (field, value) in [("width_m", size.width_m), ("height_m", size.height_m)] {
        if !(LandmarkSize::MIN_M..=LandmarkSize::MAX_M).contains(&value) {
            return Err(PoseError::Size { field, value });
        }
    }
    let Straightened { corners_px, covariance_px2, camera, by_camera } =
        straightened(corners, covariance_px2, camera)?;
    Ok(Measured { corners_px, covariance_px2, camera, by_camera, size })
}

/// Corners free of lens distortion.
#[derive(Debug, Clone, PartialEq)]
pub struct Straightened {
    /// As a pinhole with the same K would see them.
    pub corners_px: Corners,
    /// Covariance of each of them.
    pub covariance_px2: [Matrix2<f64>; 4],
    /// The pinhole.
    pub camera: Intrinsics,
    /// See [`Intrinsics::straight_by_errors`].
    pub by_camera: [Matrix2x3<f64>; 4],
}

/// Corners and covariances as the pinhole of the same K would have them, and that pinhole. Checks camera, corners and
/// covariances.
pub fn straightened(
    corners: &Corners,
    covariance_px2: &[Matrix2<f64>; 4],
    camera: &Intrinsics,
) -> Result<Straightened, PoseError> {
    let c = Intrinsics::new(camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px, camera.distortion)?;
    let c = camera.sigmas.map_or(Ok(c), |sigmas| c.with_sigmas(sigmas))?;
    let mut by_camera = [Matrix2x3::zeros(); 4];
    let (mut straight, mut covariances) = (*corners.points(), *covariance_px2);
    for (corner, (p, s)) in straight.iter_mut().zip(&mut covariances).enumerate() {
        if p.x.abs() > MAX_CORNER_PX || p.y.abs() > MAX_CORNER_PX {
            return Err(PoseError::Corner { corner });
        }
        if !is_corner_covariance(s) {
            return Err(PoseError::Covariance { corner });
        }
        if c.distortion != Distortion::None {
            (*p, *s) = undistorted(&c, p, s).ok_or(PoseError::Distortion)?;
        }
        by_camera[corner] = c.straight_by_errors(p).ok_or(PoseError::Distortion)?;
    }
    let corners_px = Corners::new(straight).map_err(|_folded| PoseError::Distortion)?;
    let camera = Intrinsics { distortion: Distortion::None, ..c };
    Ok(Straightened { corners_px, covariance_px2: covariances, camera, by_camera })
}

/// Symmetric, with both standard deviations in range.
pub(super) fn is_corner_covariance(s: &Matrix2<f64>) -> bool {
    let symmetric = (s.m12 - s.m21).abs() <= 1e-6 * (s.m11 + s.m22);
    let (mean, spread) = (0.5 * (s.m11 + s.m22), (0.5 * (s.m11 - s.m22)).hypot(s.m12));
    // NaN fails every comparison.
    symmetric && mean - spread >= MIN_CORNER_SIGMA_PX.powi(2) && mean + spread <= MAX_CORNER_SIGMA_PX.powi(2)
}

/// The undistorted point and its covariance.
fn undistorted(
    camera: &Intrinsics,
    p: &Point2<f64>,
    s: &Matrix2<f64>,
) -> Option<(Point2<f64>, Matrix2<f64>)> {
    let (straight, j) = camera.undistort_with(p)?;
    let covariance = j * s * j.transpose();
    is_corner_covariance(&covariance).then_some((straight, covariance))
}

/// Eq. (2): `[r2 r3 T] = lambda K^-1 H`, then the nearest rotation (method 13.1, 13.2).
pub fn linear_pose(measured: &Measured) -> Option<Isometry3<f64>> {
    let c = &measured.camera;
    let ray = |p: &Point2<f64>| Point2::new((p.x - c.cx_px) / c.fx_px, (p.y - c.cy_px) / c.fy_px);
    let plane = corner_points(&measured.size).map(|p| Point2::new(p.y, p.z));
    let rays = measured.corners_px.points().each_ref().map(ray);
    pose_of_columns(Homography::from_points(&plane, &rays).ok()?.matrix())
}

/// The pose behind `B = K^-1 H`, H from the plane's (y, z, 1), positive over its points.
pub(super) fn pose_of_columns(b: &Matrix3<f64>) -> Option<Isometry3<f64>> {
    let (b1, b2, b3) = (b.column(0), b.column(1), b.column(2));
    let scale = (b1.norm() * b2.norm()).sqrt();
    let lambda = if b3.z < 0.0 { -1.0 } else { 1.0 } / scale;
    let (r2, r3, t) = (b1 * lambda, b2 * lambda, b3 * lambda);
    let raw = Matrix3::from_columns(&[r2.cross(&r3), r2, r3]);
    if !raw.iter().chain(t.iter()).all(|v| v.is_finite()) {
        return None;
    }
    let rotation = nearest_rotation(&raw)?;
    Some(Isometry3::from_parts(t.into(), UnitQuaternion::from_rotation_matrix(&rotation)))
}

/// `U diag(1, 1, det(U V^T)) V^T`: nearest in the Frobenius norm.
fn nearest_rotation(raw: &Matrix3<f64>) -> Option<Rotation3<f64>> {
    let svd = raw.try_svd(true, true, f64::EPSILON, 100)?;
    let (u, v_t) = (svd.u?, svd.v_t?);
    let mut signs = Matrix3::identity();
    signs[(2, 2)] = (u * v_t).determinant().signum();
    Some(Rotation3::from_matrix_unchecked(u * signs * v_t))
}

/// The viewer is on the front side: `r1 . T < 0`.
pub(super) fn faces_camera(pose: &Isometry3<f64>) -> bool {
    (pose.rotation * nalgebra::Vector3::x()).dot(&pose.translation.vector) < 0.0
}

/// The pose with its normal mirrored about the line of sight (method 13.4).
pub(super) fn mirrored(pose: &Isometry3<f64>) -> Isometry3<f64> {
    let v = pose.translation.vector.normalize();
    let mirror = Matrix3::identity() - 2.0 * v * v.transpose();
    let flip = Matrix3::from_diagonal(&nalgebra::Vector3::new(-1.0, 1.0, 1.0));
    let rotation =
        Rotation3::from_matrix_unchecked(mirror * pose.rotation.to_rotation_matrix().matrix() * flip);
    Isometry3::from_parts(pose.translation, UnitQuaternion::from_rotation_matrix(&rotation))
}

#[cfg(test)]
mod tests;
