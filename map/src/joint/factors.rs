//! The factors of the joint map, one file each: residuals over their standard deviations, with the
//! derivatives by their variables (method 29.2).

pub(super) mod camera_prior;
pub(super) mod hanging;
pub(super) mod line;
pub(super) mod odometry;
pub(super) mod reprojection;
pub(super) mod same_object;
pub(super) mod scan_match;
pub(super) mod summary;
pub(super) mod wall_prior;

use nalgebra::{DMatrix, DVector, SMatrix};

/// Whitened residual, and its derivatives by the factor's variables.
pub(super) type Terms = (DVector<f64>, Vec<DMatrix<f64>>);

/// A matrix W with `W^T W` the inverse of a covariance; `None` when that is not positive definite.
pub(super) fn sqrt_information<const N: usize>(covariance: &SMatrix<f64, N, N>) -> Option<SMatrix<f64, N, N>>
where
    nalgebra::Const<N>: nalgebra::DimMin<nalgebra::Const<N>, Output = nalgebra::Const<N>>,
{
    let lower = covariance.cholesky()?.l();
    lower.solve_lower_triangular(&SMatrix::<f64, N, N>::identity())
}

/// Residual and derivatives with another number of rows, dynamic.
pub(super) fn terms<const R: usize>(residual: &SMatrix<f64, R, 1>, by: Vec<DMatrix<f64>>) -> Terms {
    (DVector::from_column_slice(residual.as_slice()), by)
}

/// A matrix of fixed size as a dynamic one.
pub(super) fn dynamic<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>) -> DMatrix<f64> {
    DMatrix::from_column_slice(R, C, m.as_slice())
}

/// Finite and above zero.
pub(super) fn positive(sigma: f64) -> bool {
    sigma.is_finite() && sigma > 0.0
}

#[cfg(test)]
mod tests;
