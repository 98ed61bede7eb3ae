//! Applies error models to motions and fixes: subtracts the bias and inflates the covariance
//! (method 15: "reported covariance inflated to the learnt one").

use crate::{
    fuse::params::FuseParams,
    localise::{Fix, Nuisance, NuisanceKey},
    modality_stats::{Modality, ModalityAdvice, PoseCell, map_from_aligned},
    pose2::Pose2,
};
use nalgebra::{Matrix3, Matrix3x6, Matrix6, SymmetricEigen, Vector3};
use std::borrow::Cow;

/// Variance beyond which a fix does not determine a direction (of position: 1 m^2).
const UNKNOWN: f64 = 1.0;

/// A measured motion and its noise, in the frame where it starts, corrected by the error model of
/// odometry.
pub(super) fn motion(
    measured: &Pose2,
    noise: &Matrix3<f64>,
    advice: &ModalityAdvice,
    p: &FuseParams,
) -> (Pose2, Matrix3<f64>) {
    let (fault, length_m) = (advice.fault(Modality::Odometry), measured.position().norm());
    let more = fault.excess.component_mul(&p.metre_variances()) * length_m;
    // The bias was learnt from forward motion only.
    let bias = if measured.x_m > 0.0 { fault.bias * length_m } else { Vector3::zeros() };
    (measured.plus(&-bias), noise + Matrix3::from_diagonal(&more))
}

/// A fix corrected by the error model of its source.
pub(super) fn fix<'a>(fix: &'a Fix, at: &Pose2, advice: &ModalityAdvice) -> Cow<'a, Fix> {
    let fault = advice.fault(Modality::from(fix.modality));
    if fault.bias == Vector3::zeros() && fault.excess == Vector3::zeros() {
        return Cow::Borrowed(fix);
    }
    let turn = map_from_aligned(at.theta_rad);
    let claimed = (turn.transpose() * fix.pose.covariance * turn).diagonal();
    // A direction that the fix does not determine stays undetermined.
    let known = claimed.map(|v| if v < UNKNOWN { v } else { 0.0 });
    let more = fault.excess.component_mul(&known);
    let more = turn * Matrix3::from_diagonal(&more) * turn.transpose();
    let mut trusted = fix.clone();
    trusted.pose.pose = fix.pose.pose.plus(&-(turn * fault.bias));
    // Whether the excess is shared by fixes is unknown: it counts as independent and as shared.
    trusted.noise += more;
    let mut lasting = more;
    if fault.bias != Vector3::zeros() {
        // The bias contains the errors of walls or places as observed from this cell. The rest
        // belongs to the cell and says nothing about the same walls observed from elsewhere.
        lasting += fix
            .nuisances
            .iter()
            .map(|n| n.jacobian * n.covariance * n.jacobian.transpose())
            .sum::<Matrix3<f64>>();
        trusted.nuisances.clear();
    }
    let eigen = SymmetricEigen::new(0.5 * (lasting + lasting.transpose()));
    let root = Matrix3::from_diagonal(&eigen.eigenvalues.map(|v| v.max(0.0).sqrt()));
    let mut jacobian = Matrix3x6::zeros();
    jacobian
        .fixed_columns_mut::<3>(0)
        .copy_from(&(eigen.eigenvectors * root * eigen.eigenvectors.transpose()));
    let mut covariance = Matrix6::zeros();
    covariance.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
    trusted.pose.covariance += 2.0 * more;
    trusted.nuisances.push(Nuisance {
        key: NuisanceKey::Area(fix.modality, PoseCell::of(at)),
        jacobian,
        covariance,
    });
    Cow::Owned(trusted)
}
