//! The corners of a landmark's border by texture, edges and size, or why they are not known.

use crate::{
    border::{
        hypotheses::{Linear, Reading, flat, readings},
        side_edges::{SideEdge, side_edges},
    },
    detect::quad::BORDER_SIGMA_PX,
    frame::{Intrinsics, PictureRef},
    geometry::{corner_covariance::CornerCovariance, corners::Corners},
    pose::{
        landmark_pose::{AMBIGUOUS_CHI2, LandmarkPose, landmark_pose},
        measurement::{LandmarkSize, PoseError},
        refine::PoseSolution,
        reprojection::{corner_points, perturbed},
    },
    seen_border::SeenBorder,
};
use nalgebra::{Isometry3, Matrix6, Point2, SMatrix, SVector, Vector3, Vector6};

/// Least and largest distance of edges from the texture's sides, pixels; between them a share of
/// the landmark's size.
const REACH_PX: [f64; 2] = [3.0, 10.0];
const REACH_SHARE: f64 = 0.06;
/// The stated variance of aligned corners is multiplied by this: parts of a picture are not
/// independent.
const TEXTURE_SCALE: f64 = 2.0;
/// Standard deviation of each corner by texture beyond that: pixels, and share of the landmark's
/// size...
const TEXTURE_SIGMA_PX: f64 = 0.15;
const TEXTURE_SIGMA_SHARE: f64 = 0.004;
/// ... and of width and height as a whole: blur at the border shrinks an aligned picture.
const SIZE_SIGMA_SHARE: f64 = 0.007;
/// Floor of the standard deviation of a corner, pixels.
const LEAST_SIGMA_PX: f64 = 0.05;
/// 99.9 % quantiles of chi2 with 2, 4, ..., 10 degrees of freedom.
const CHI2_999: [f64; 5] = [13.816, 18.467, 22.458, 26.124, 29.588];
/// 99.7 % quantile of chi2 with 6 degrees of freedom: two readings further apart are different
/// borders.
const DIFFERENT_CHI2: f64 = 19.804;
/// Readings of other borders that are together at least this likely beside the likeliest border
/// leave it unclear.
const UNCLEAR_ODDS: f64 = 0.5;
/// Readings less likely than this beside the likeliest are left out.
const LEAST_ODDS: f64 = 1e-4;
/// Step of numerical derivatives, radians and metres.
const DERIVATIVE_STEP: f64 = 1e-6;

/// Why a recognised landmark has no border that a pose can rest on.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BorderError {
    /// The corners fit no pose of a rectangle of the stated size.
    #[error(
        "the corners fit no pose of a landmark of this size: chi2 is {chi2:.1}, at most {limit:.1} is accepted"
    )]
    Reprojection {
        /// Squared residual in standard deviations.
        chi2: f64,
        /// The largest that is accepted.
        limit: f64,
    },
    /// Two borders more than three standard deviations apart are about equally likely.
    #[error("two borders fit about equally well")]
    Unclear,
    /// The corners by texture give no pose.
    #[error(transparent)]
    Pose(#[from] PoseError),
}

/// The border of a landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BorderEstimate {
    /// Its corners, the landmark's top-left first.
    pub corners_px: Corners,
    /// Their joint covariance.
    pub covariance_px2: CornerCovariance,
    /// The other solution of the planar ambiguity fits about as well.
    pub is_mirrored: bool,
}

impl BorderEstimate {
    /// The landmark's pose by these corners. Where the border fits two poses but the corners have
    /// only one, it is unclear.
    pub fn pose(&self, size: LandmarkSize, camera: &Intrinsics) -> Result<LandmarkPose, BorderError> {
        let mut pose = landmark_pose(&self.corners_px, self.covariance_px2, size, camera)?;
        if self.is_mirrored && pose.second.is_none() {
            return Err(BorderError::Unclear);
        }
        pose.ambiguous |= self.is_mirrored;
        Ok(pose)
    }
}

/// The border of a landmark of `size` whose texture is at `texture`.
pub fn estimate_border(
    image: PictureRef<'_>,
    texture: &SeenBorder,
    size: LandmarkSize,
    camera: &Intrinsics,
) -> Result<BorderEstimate, BorderError> {
    let texture_px = &texture.corners_px;
    let texture_covariance_px2 = &texture_covariance(texture);
    let rough = landmark_pose(texture_px, texture_covariance_px2, size, camera)?;
    let reach_px = (REACH_SHARE * texture_px.area_px2().sqrt()).clamp(REACH_PX[0], REACH_PX[1]);
    let points = texture_px.points();
    let edges: [Vec<SideEdge>; 4] =
        std::array::from_fn(|i| side_edges(image, &points[i], &points[(i + 1) % 4], reach_px));
    let fit = |solution: &PoseSolution| {
        let pose = solution.camera_from_landmark;
        let (by_pose, by_recess) = derivatives(&pose, &size, camera);
        let predicted_px = corners_at(&pose, &size, 0.0, camera);
        let problem =
            Linear { texture_px, texture_covariance_px2, predicted_px, by_pose, by_recess, reach_px };
        let readings = readings(&problem, &edges);
        Some(Fit { cost: readings.first()?.cost, predicted_px, by_pose, readings })
    };
    // Each solution of the planar ambiguity is read by itself: corners on the one leave nothing of
    // the other.
    let mut fits: Vec<Fit> = std::iter::once(&rough.best).chain(&rough.second).filter_map(fit).collect();
    fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let Fit { predicted_px, by_pose, readings, cost } = fits.first().ok_or(PoseError::Degenerate)?;
    let is_mirrored = fits.get(1).is_some_and(|other| other.cost - cost < AMBIGUOUS_CHI2);
    let best = readings.first().ok_or(PoseError::Degenerate)?;
    let limit = CHI2_999[best.edges];
    if best.chi2.is_nan() || best.chi2 > limit {
        return Err(BorderError::Reprojection { chi2: best.chi2, limit });
    }
    let (state, covariance) = mean(readings)?;
    let (corners_px, covariance_px2) = if is_mirrored {
        // Corners of either pose would decide for it.
        let free = best.information.cholesky().ok_or(PoseError::Degenerate)?;
        (flat(texture_px) + free.solve(&best.pull), free.inverse())
    } else {
        let beside = beside_pose(by_pose, &best.information).ok_or(PoseError::Degenerate)?;
        (predicted_px + by_pose * state, by_pose * covariance * by_pose.transpose() + beside)
    };
    let corners_px =
        Corners::new(std::array::from_fn(|i| Point2::new(corners_px[2 * i], corners_px[2 * i + 1])))
            .map_err(|_folded| PoseError::Degenerate)?;
    let floor = SMatrix::<f64, 8, 8>::identity() * LEAST_SIGMA_PX.powi(2);
    Ok(BorderEstimate {
        corners_px,
        covariance_px2: CornerCovariance::new(covariance_px2 + floor),
        is_mirrored,
    })
}

/// All readings about one solution of the planar ambiguity.
struct Fit {
    /// Of the likeliest reading.
    cost: f64,
    predicted_px: SVector<f64, 8>,
    by_pose: SMatrix<f64, 8, 6>,
    readings: Vec<Reading>,
}

/// Covariance of the corners in the two directions that no pose moves them in. The other solution
/// of the planar ambiguity differs from the first in these alone: without them it would look
/// impossible.
fn beside_pose(by_pose: &SMatrix<f64, 8, 6>, information: &SMatrix<f64, 8, 8>) -> Option<SMatrix<f64, 8, 8>> {
    let whole = information.cholesky()?.inverse();
    let along = (by_pose.transpose() * information * by_pose).cholesky()?.inverse();
    Some(whole - by_pose * along * by_pose.transpose())
}

/// Covariance of the corners by texture: what its alignment states, and what it does not know.
fn texture_covariance(texture: &SeenBorder) -> CornerCovariance {
    let corners = texture.corners_px.points();
    let size_px = texture.corners_px.area_px2().sqrt();
    let own = TEXTURE_SIGMA_PX.powi(2) + (TEXTURE_SIGMA_SHARE * size_px).powi(2);
    let own = SMatrix::<f64, 8, 8>::identity() * own;
    // The detector's border noise is part of every stated covariance; here the edges are judged one
    // by one.
    let border = SMatrix::<f64, 8, 8>::identity() * BORDER_SIGMA_PX.powi(2);
    let stated = CornerCovariance::from(&texture.covariance_px2);
    let mut sum = (stated.matrix() - border) * TEXTURE_SCALE + own;
    let across = (corners[1] - corners[0] + (corners[2] - corners[3])) * 0.5;
    let down = (corners[3] - corners[0] + (corners[2] - corners[1])) * 0.5;
    for (side, signs) in [(across, [-0.5, 0.5, 0.5, -0.5]), (down, [-0.5, -0.5, 0.5, 0.5])] {
        let moved = SVector::<f64, 8>::from_fn(|i, _| signs[i / 2] * side[i % 2]);
        sum += moved * moved.transpose() * SIZE_SIGMA_SHARE.powi(2);
    }
    CornerCovariance::new(sum)
}

/// The corners of a rectangle `recess_m` behind the border, as the camera sees them.
fn corners_at(
    camera_from_landmark: &Isometry3<f64>,
    size: &LandmarkSize,
    recess_m: f64,
    camera: &Intrinsics,
) -> SVector<f64, 8> {
    let points = corner_points(size).map(|p| p - Vector3::x() * recess_m);
    let seen = points.map(|p| {
        camera.project(&(camera_from_landmark.rotation * p + camera_from_landmark.translation.vector))
    });
    SVector::from_fn(|i, _| seen[i / 2][i % 2])
}

/// Derivatives of the corners by the left perturbation of the pose, and of the picture's corners by
/// its depth.
fn derivatives(
    pose: &Isometry3<f64>,
    size: &LandmarkSize,
    camera: &Intrinsics,
) -> (SMatrix<f64, 8, 6>, SVector<f64, 8>) {
    let by_pose = SMatrix::<f64, 8, 6>::from_columns(&std::array::from_fn::<_, 6, _>(|k| {
        let at = |step: f64| {
            let mut d = Vector6::zeros();
            d[k] = step;
            let moved = perturbed(pose, &d.fixed_rows::<3>(0).into(), &d.fixed_rows::<3>(3).into());
            corners_at(&moved, size, 0.0, camera)
        };
        (at(DERIVATIVE_STEP) - at(-DERIVATIVE_STEP)) / (2.0 * DERIVATIVE_STEP)
    }));
    let behind = |step: f64| corners_at(pose, size, step, camera);
    (by_pose, (behind(DERIVATIVE_STEP) - behind(-DERIVATIVE_STEP)) / (2.0 * DERIVATIVE_STEP))
}

/// Mean and covariance of the pose over all readings; unclear where others than the likeliest are
/// as likely.
fn mean(readings: &[Reading]) -> Result<(Vector6<f64>, Matrix6<f64>), BorderError> {
    let best = &readings[0];
    let pose = |r: &Reading| -> Vector6<f64> { r.state.fixed_rows::<6>(0).into_owned() };
    let spread = |r: &Reading| -> Matrix6<f64> { r.covariance.fixed_view::<6, 6>(0, 0).into_owned() };
    let (mut total, mut elsewhere, mut mean) = (0.0, 0.0, Vector6::zeros());
    let odds = |r: &Reading| (0.5 * (best.cost - r.cost)).exp();
    let kept: Vec<&Reading> = readings.iter().take_while(|r| odds(r) >= LEAST_ODDS).collect();
    for reading in &kept {
        let off = pose(reading) - pose(best);
        let sum = spread(reading) + spread(best);
        let apart = sum.cholesky().map_or(0.0, |sum| off.dot(&sum.solve(&off)));
        elsewhere += if apart > DIFFERENT_CHI2 { odds(reading) } else { 0.0 };
        total += odds(reading);
        mean += pose(reading) * odds(reading);
    }
    if elsewhere >= UNCLEAR_ODDS * (total - elsewhere) {
        return Err(BorderError::Unclear);
    }
    mean /= total;
    let mut covariance = Matrix6::zeros();
    for reading in kept {
        let off = pose(reading) - mean;
        covariance += (spread(reading) + off * off.transpose()) * (odds(reading) / total);
    }
    Ok((mean, covariance))
}

#[cfg(test)]
mod tests;
