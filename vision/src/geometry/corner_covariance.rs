//! The joint covariance of four corners: errors of corners that share a side or a picture go
//! together.

use nalgebra::{Matrix2, SMatrix, SVector};

/// Covariance of (u, v) of TL, TR, BR, BL, px^2. Symmetric.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerCovariance(SMatrix<f64, 8, 8>);

impl CornerCovariance {
    /// The symmetric part of `matrix`.
    pub fn new(matrix: SMatrix<f64, 8, 8>) -> Self {
        Self(0.5 * (matrix + matrix.transpose()))
    }

    /// The whole matrix.
    pub fn matrix(&self) -> &SMatrix<f64, 8, 8> {
        &self.0
    }

    /// Covariance of one corner.
    pub fn of(&self, corner: usize) -> Matrix2<f64> {
        self.0.fixed_view::<2, 2>(2 * corner, 2 * corner).into_owned()
    }

    /// Covariance of each corner by itself.
    pub fn blocks(&self) -> [Matrix2<f64>; 4] {
        std::array::from_fn(|i| self.of(i))
    }

    /// The covariance after a map of each corner by itself, with these derivatives.
    #[must_use]
    pub fn mapped(&self, derivatives: &[Matrix2<f64>; 4]) -> Self {
        let mut map = SMatrix::<f64, 8, 8>::zeros();
        for (i, d) in derivatives.iter().enumerate() {
            map.fixed_view_mut::<2, 2>(2 * i, 2 * i).copy_from(d);
        }
        Self::new(map * self.0 * map.transpose())
    }

    /// The inverse of the lower Cholesky factor: it makes residuals independent with variance 1.
    /// `None` unless positive definite.
    pub fn whitening(&self) -> Option<SMatrix<f64, 8, 8>> {
        let mut inverse = SMatrix::<f64, 8, 8>::identity();
        let factor = self.0.cholesky()?.l();
        factor.solve_lower_triangular_mut(&mut inverse).then_some(inverse)
    }

    /// Squared length of `residual` in standard deviations; infinite unless positive definite.
    pub fn square(&self, residual: &SVector<f64, 8>) -> f64 {
        self.whitening().map_or(f64::INFINITY, |w| (w * residual).norm_squared())
    }
}

impl From<&[Matrix2<f64>; 4]> for CornerCovariance {
    /// Independent corners.
    fn from(blocks: &[Matrix2<f64>; 4]) -> Self {
        let mut matrix = SMatrix::<f64, 8, 8>::zeros();
        for (i, block) in blocks.iter().enumerate() {
            matrix.fixed_view_mut::<2, 2>(2 * i, 2 * i).copy_from(block);
        }
        // Kept as given: whoever checks the covariance sees an asymmetry.
        Self(matrix)
    }
}

impl From<&CornerCovariance> for CornerCovariance {
    fn from(covariance: &CornerCovariance) -> Self {
        *covariance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whitening_makes_residuals_independent() {
        let mut root = SMatrix::<f64, 8, 8>::identity() * 0.4;
        root[(5, 1)] = 0.3;
        root[(7, 0)] = -0.2;
        let covariance = CornerCovariance::new(root * root.transpose());
        let w = covariance.whitening().unwrap();
        assert!((w * covariance.matrix() * w.transpose() - SMatrix::<f64, 8, 8>::identity()).norm() < 1e-12);
        let residual = SVector::<f64, 8>::from_fn(|i, _| 0.1 * i as f64);
        let solved = covariance.matrix().try_inverse().unwrap() * residual;
        assert!((covariance.square(&residual) - residual.dot(&solved)).abs() < 1e-9);
        assert_eq!(CornerCovariance::new(SMatrix::zeros()).whitening(), None);
    }

    #[test]
    fn blocks_are_those_of_independent_corners() {
        let blocks: [Matrix2<f64>; 4] = std::array::from_fn(|i| Matrix2::new(1.0 + i as f64, 0.2, 0.2, 2.0));
        assert_eq!(CornerCovariance::from(&blocks).blocks(), blocks);
        let doubled = CornerCovariance::from(&blocks).mapped(&[Matrix2::identity() * 2.0; 4]);
        assert_eq!(doubled.of(2), blocks[2] * 4.0);
    }
}
