//! Checks of numbers that come from outside: finite, within a named range, covariances symmetric
//! and positive semidefinite. An error names the field.

use nalgebra::SMatrix;

/// Largest accepted coordinate on the floor, metres from the map's origin.
pub const MAX_COORDINATE_M: f64 = 1e5;
/// Largest accepted variance: beyond it a number carries no information.
pub const MAX_VARIANCE: f64 = 1e12;

/// A number is NaN, infinite or outside its range.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("{field} = {value} is out of range")]
pub struct OutOfRange {
    /// Name of the input, with its unit.
    pub field: &'static str,
    /// The value that was refused.
    pub value: f64,
}

/// `value` is finite and in `low..=high`.
pub(crate) fn within(field: &'static str, value: f64, low: f64, high: f64) -> Result<(), OutOfRange> {
    if value.is_finite() && (low..=high).contains(&value) { Ok(()) } else { Err(OutOfRange { field, value }) }
}

/// `m` is finite, symmetric and positive semidefinite, its variances at most [`MAX_VARIANCE`].
pub(crate) fn covariance<const N: usize>(
    field: &'static str,
    m: &SMatrix<f64, N, N>,
) -> Result<(), OutOfRange> {
    if let Some(value) = m.iter().find(|v| !v.is_finite() || v.abs() > MAX_VARIANCE) {
        return Err(OutOfRange { field, value: *value });
    }
    for i in 0..N {
        if m[(i, i)] < 0.0 {
            return Err(OutOfRange { field, value: m[(i, i)] });
        }
        for j in 0..i {
            let scale = (m[(i, i)] * m[(j, j)]).sqrt();
            if (m[(i, j)] - m[(j, i)]).abs() > 1e-6 * scale {
                return Err(OutOfRange { field, value: m[(i, j)] });
            }
        }
    }
    if is_positive_semidefinite(m) { Ok(()) } else { Err(OutOfRange { field, value: m.trace() }) }
}

/// Elimination on the correlation matrix, so that metres and radians have equal weight.
fn is_positive_semidefinite<const N: usize>(m: &SMatrix<f64, N, N>) -> bool {
    const TOLERANCE: f64 = 1e-9;
    let sd: [f64; N] = std::array::from_fn(|i| m[(i, i)].sqrt());
    let mut a = SMatrix::<f64, N, N>::from_fn(|i, j| {
        let scale = sd[i] * sd[j];
        if scale > 0.0 { 0.5 * (m[(i, j)] + m[(j, i)]) / scale } else { m[(i, j)] }
    });
    for k in 0..N {
        let pivot = a[(k, k)];
        if pivot < -TOLERANCE {
            return false;
        }
        if pivot <= TOLERANCE {
            // A zero variance allows no correlation.
            if (k + 1..N).any(|i| a[(i, k)].abs() > TOLERANCE.sqrt()) {
                return false;
            }
            continue;
        }
        for i in k + 1..N {
            let f = a[(i, k)] / pivot;
            for j in k + 1..N {
                a[(i, j)] -= f * a[(k, j)];
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Matrix3};

    #[test]
    fn range_ends_are_accepted_and_nan_is_not() {
        assert!(within("x_m", 2.0, -2.0, 2.0).is_ok());
        assert!(within("x_m", -2.0, -2.0, 2.0).is_ok());
        assert_eq!(within("x_m", 2.1, -2.0, 2.0), Err(OutOfRange { field: "x_m", value: 2.1 }));
        assert!(within("x_m", f64::NAN, -2.0, 2.0).is_err());
        assert!(within("x_m", f64::INFINITY, -2.0, f64::INFINITY).is_err());
    }

    #[test]
    fn only_covariances_are_accepted() {
        let ok = |m: &Matrix2<f64>| covariance("c", m).is_ok();
        assert!(ok(&Matrix2::new(1.0, 0.5, 0.5, 1.0)));
        assert!(ok(&Matrix2::new(1e-9, 0.0, 0.0, 1e6)));
        assert!(ok(&Matrix2::zeros()));
        assert!(ok(&Matrix2::new(4.0, 2.0, 2.0, 1.0)), "perfect correlation");
        assert!(!ok(&Matrix2::new(1.0, 1.1, 1.1, 1.0)), "correlation above one");
        assert!(!ok(&Matrix2::new(1.0, 0.5, 0.4, 1.0)), "not symmetric");
        assert!(!ok(&Matrix2::new(-1.0, 0.0, 0.0, 1.0)));
        assert!(!ok(&Matrix2::new(0.0, 0.1, 0.1, 1.0)), "zero variance with a correlation");
        assert!(!ok(&Matrix2::new(f64::NAN, 0.0, 0.0, 1.0)));
        assert!(!ok(&Matrix2::new(MAX_VARIANCE * 1.01, 0.0, 0.0, 1.0)));
        assert!(ok(&Matrix2::new(MAX_VARIANCE, 0.0, 0.0, 1.0)));
        // Every pair is possible, the three together are not.
        let m = Matrix3::new(1.0, 0.9, 0.9, 0.9, 1.0, -0.9, 0.9, -0.9, 1.0);
        assert!(covariance("c", &m).is_err());
    }
}
