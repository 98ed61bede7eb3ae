//! Covariances of ROS, 6 x 6 over (x, y, z, rotations about fixed x, y, z), of planar ones, 3 x 3
//! over (x, y, theta). Both are in the parent frame of the pose, so entries are only moved.

use nalgebra::Matrix3;

/// Variance that stands for "not known" in what is sent: of z (m^2), roll and pitch (rad^2).
pub const UNKNOWN_VARIANCE: f64 = 1e6;
/// Largest element that Nav2 since Lyrical takes on `/initialpose`, and the smallest is 0
/// (`ros-navigation/navigation2 nav2_util/include/nav2_util/validate_messages.hpp`).
pub const MAX_INITIAL_VARIANCE: f64 = 1e9;

/// Rows and columns of x, y and the rotation about z.
const PLANAR: [usize; 3] = [0, 1, 5];

/// An element, by its index, is NaN or infinite.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("covariance[{0}] is not finite")]
pub struct CovarianceError(pub usize);

/// The covariance of a planar pose; z, roll and pitch get [`UNKNOWN_VARIANCE`].
pub fn ros_of_planar(covariance: &Matrix3<f64>) -> [f64; 36] {
    let mut full = [0.0; 36];
    for i in 0..6 {
        full[7 * i] = UNKNOWN_VARIANCE;
    }
    for i in 0..3 {
        for j in 0..3 {
            full[6 * PLANAR[i] + PLANAR[j]] = covariance[(i, j)];
        }
    }
    full
}

/// The covariance as Nav2 takes it: every element in 0..=[`MAX_INITIAL_VARIANCE`]. A negative
/// correlation becomes none, which keeps 3 x 3 covariances positive semidefinite; one beyond the
/// clipped variances is clipped as well. The first element that is not finite is refused.
pub fn clip_for_initial_pose(covariance: &[f64; 36]) -> Result<[f64; 36], CovarianceError> {
    if let Some(index) = covariance.iter().position(|v| !v.is_finite()) {
        return Err(CovarianceError(index));
    }
    let mut clipped = covariance.map(|v| v.clamp(0.0, MAX_INITIAL_VARIANCE));
    for i in 0..6 {
        for j in (0..6).filter(|j| *j != i) {
            let bound = (clipped[7 * i] * clipped[7 * j]).sqrt();
            clipped[6 * i + j] = clipped[6 * i + j].min(bound);
        }
    }
    Ok(clipped)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn planar() -> Matrix3<f64> {
        Matrix3::new(0.25, 0.05, -0.01, 0.05, 0.16, 0.02, -0.01, 0.02, 0.04)
    }

    /// Bit for bit: entries are moved, not computed.
    fn equal(a: &[f64], b: &[f64]) -> bool {
        a.iter().map(|v| v.to_bits()).eq(b.iter().map(|v| v.to_bits()))
    }

    #[test]
    fn planar_parts_stand_where_ros_has_them() {
        let full = ros_of_planar(&planar());
        let moved = [full[0], full[1], full[5], full[7], full[11], full[30], full[35]];
        assert!(equal(&moved, &[0.25, 0.05, -0.01, 0.16, 0.02, -0.01, 0.04]));
        assert!(equal(&[full[14], full[21], full[28]], &[UNKNOWN_VARIANCE; 3]));
        assert_eq!(full.iter().filter(|v| v.abs() < f64::MIN_POSITIVE).count(), 36 - 12);
    }

    #[test]
    fn nav2_takes_what_was_clipped() {
        let clipped = clip_for_initial_pose(&ros_of_planar(&planar())).unwrap();
        assert!(clipped.iter().all(|v| (0.0..=MAX_INITIAL_VARIANCE).contains(v)));
        assert!(equal(&[clipped[0], clipped[1], clipped[5], clipped[11]], &[0.25, 0.05, 0.0, 0.02]));
        let mut wide = ros_of_planar(&(planar() * 1e12));
        wide[2] = -0.0;
        let clipped = clip_for_initial_pose(&wide).unwrap();
        assert!(equal(&[clipped[0], clipped[7]], &[MAX_INITIAL_VARIANCE; 2]));
        assert!(clipped[1] <= MAX_INITIAL_VARIANCE);
        wide[33] = f64::INFINITY;
        assert_eq!(clip_for_initial_pose(&wide), Err(CovarianceError(33)));
    }

    #[test]
    fn clipping_keeps_planar_covariances_possible() {
        for (a, b, c) in [(-0.9, 0.2, 0.1), (0.5, -0.4, 0.5), (-0.3, -0.3, 0.6), (-0.4, -0.4, -0.1)] {
            let m = Matrix3::new(1.0, a, b, a, 1.0, c, b, c, 1.0);
            assert!(m.cholesky().is_some(), "{a} {b} {c}");
            let clipped = clip_for_initial_pose(&ros_of_planar(&m)).unwrap();
            let kept = Matrix3::from_fn(|i, j| clipped[6 * PLANAR[i] + PLANAR[j]]);
            assert!(kept.cholesky().is_some(), "{a} {b} {c}");
        }
    }
}
