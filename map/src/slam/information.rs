//! Covariance and information matrices that may be singular.

use nalgebra::{Matrix3, Vector3};

/// Information of a covariance that may be singular.
pub(crate) fn inverse(m: &Matrix3<f64>) -> Matrix3<f64> {
    let floor = Matrix3::from_diagonal(&Vector3::new(1e-8, 1e-8, 1e-9));
    (m + floor).cholesky().map_or_else(Matrix3::zeros, |c| c.inverse())
}

/// Covariance of a constraint; about 30 m where its information is zero.
pub(super) fn spread(information: &Matrix3<f64>) -> Matrix3<f64> {
    let floor = Matrix3::from_diagonal(&Vector3::new(1e-3, 1e-3, 1e-1));
    (information + floor).cholesky().map_or_else(|| Matrix3::identity() * 1e3, |c| c.inverse())
}

/// The information that is left when the floor is added to the covariance; works for singular
/// information.
pub(crate) fn with_floor(information: &Matrix3<f64>, [metres, radians]: [f64; 2]) -> Matrix3<f64> {
    let floor = Vector3::new(metres.powi(2), metres.powi(2), radians.powi(2));
    let inverse = Matrix3::from_diagonal(&floor.map(|v| 1.0 / v.max(1e-12)));
    let Some(c) = (information + inverse).cholesky() else { return Matrix3::zeros() };
    let made = information - information * c.inverse() * information;
    0.5 * (made + made.transpose())
}
