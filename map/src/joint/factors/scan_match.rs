//! A scan match: the relative pose of two keyframes, by points that lie on no wall variable.

use super::{Terms, dynamic, terms};
use crate::{
    joint::variables::State,
    slam::graph::{PoseConstraint, error, jacobians},
};
use nalgebra::Matrix3;

pub(in crate::joint) fn is_valid(f: &PoseConstraint) -> bool {
    f.measured.check().is_ok() && f.information.iter().all(|v| v.is_finite())
}

/// The information may be singular: its root by eigenvectors.
pub(in crate::joint) fn linearised(f: &PoseConstraint, state: &State) -> Terms {
    let (a, b) = (&state.keyframes[f.from], &state.keyframes[f.to]);
    let eigen = f.information.symmetric_eigen();
    let scale = Matrix3::from_diagonal(&eigen.eigenvalues.map(|v| v.max(0.0).sqrt()));
    let w = scale * eigen.eigenvectors.transpose();
    let (by_a, by_b) = jacobians(a, b);
    terms(&(w * error(f, a, b)), vec![dynamic(&(w * by_a)), dynamic(&(w * by_b))])
}
