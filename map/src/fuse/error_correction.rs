//! What runs have shown of a place, laid on a motion and on a fix there: a bias is taken away, and what a modality errs by
//! more than it says is added (method 15: "reported covariance inflated to the learnt one").

use crate::{
    fuse::params::FuseParams,
    localise::{Fix, Nuisance, NuisanceKey},
    modality_stats::{Modality, ModalityAdvice, PoseCell, map_from_aligned},
    pose2::Pose2,
};
use nalgebra::{Matrix3, Matrix3x6, Matrix6, SymmetricEigen, Vector3};
use std::borrow::Cow;

/// Variance beyond which a fix does not know a direction (of position: 1 m^2).
const UNKNOWN: f64 = 1.0;

/// A measured motion and its noise, in the frame where it starts, as odometry is there.
pub(super) fn motion(
    measured: &Pose2,
    noise: &Matrix3<f64>,
    advice: &ModalityAdvice,
    p: &FuseParams,
) -> (Pose2, Matrix3<f64>) {
    let (fault, length_m) = (advice.fault(Modality::Odometry), measured.position().norm());
    let more = fault.excess.component_mul(&p.metre_variances()) * length_m;
    // Learnt of robots that drive forwards.
    let bias = if measured.x_m > 0.0 { fault.bias * length_m } else { Vector3::zeros() };
    (measured.plus(&-bias), noise + Matrix3::from_diagonal(&more))
}

/// A fix as its modality is where the robot is.
pub(super) fn fix<'a>(fix: &'a Fix, at: &Pose2, advice: &ModalityAdvice) -> Cow<'a, Fix> {
    let fault = advice.fault(Modality::from(fix.modality));
    if fault.bias == Vector3::zeros() && fault.excess == Vector3::zeros() {
        return Cow::Borrowed(fix);
    }
    let turn = map_from_aligned(at.theta_rad);
    let claimed = (turn.transpose() * fix.pose.covariance * turn).diagonal();
    // A direction that the fix does not know stays unknown: what lasts must not make it known.
    let known = claimed.map(|v| if v < UNKNOWN { v } else { 0.0 });
    let more = fault.excess.component_mul(&known);
    let more = turn * Matrix3::from_diagonal(&more) * turn.transpose();
    let mut trusted = fix.clone();
    trusted.pose.pose = fix.pose.pose.plus(&-(turn * fault.bias));
    // Whether it is the same every time is not known: counted as both.
    trusted.noise += more;
    let mut lasting = more;
    if fault.bias != Vector3::zeros() {
        // The bias is what walls or places are wrong by as seen from here. What is left of it is this cell's: it tells
        // nothing of the same walls seen from elsewhere.
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
