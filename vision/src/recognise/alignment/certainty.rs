//! Covariance of aligned corners, from the normal equations of the last step and the scatter of the
//! buckets' gradients.
//!
//! Errors of neighbouring pixels of a smoothed picture are correlated, so residuals of pixels would
//! understate the covariance. Buckets are nearly independent: the spread of their gradients gives
//! the scale, the normal equations give the shape.

use nalgebra::{Const, DimMin, Matrix2, SMatrix, SVector};

/// Share of the mean diagonal element that is added to each: keeps undetermined directions finite.
const LEAST_DAMPING: f64 = 1e-3;
/// Smallest number of degrees of freedom after subtracting the leverage of the buckets.
const LEAST_FREE: f64 = 1.0;
/// Fewest buckets beyond the corners' coordinates.
const MIN_SPARE: usize = 2;

/// The covariances of four corners, in squared icon pixels, from the normal equations and the
/// gradient of each bucket (at the end, where gradients add up to about nothing). `None` with too
/// few buckets, or where sides were moved only.
pub(crate) fn corner_covariances<const D: usize>(
    buckets: &[(SMatrix<f64, D, D>, SVector<f64, D>)],
) -> Option<[Matrix2<f64>; 4]>
where
    Const<D>: DimMin<Const<D>, Output = Const<D>>,
{
    if D != 8 || buckets.len() < D + MIN_SPARE {
        return None;
    }
    let normal: SMatrix<f64, D, D> = buckets.iter().map(|b| b.0).sum();
    let damping = LEAST_DAMPING * normal.trace() / D as f64;
    let inverse = (normal + SMatrix::<f64, D, D>::identity() * damping).try_inverse()?;
    let spread: f64 = buckets.iter().map(|(_, g)| (g.transpose() * inverse * g)[0]).sum();
    // Leverage: each bucket moved the corners and so lowered its own residual.
    let lost: f64 = buckets.iter().map(|(own, _)| (inverse * own * inverse * own).trace()).sum();
    let scale = spread / (D as f64 - lost).max(LEAST_FREE);
    let of = |i: usize| {
        let at = |a: usize, b: usize| scale * inverse[(2 * i + a, 2 * i + b)];
        Matrix2::new(at(0, 0), at(0, 1), at(1, 0), at(1, 1))
    };
    let all: [Matrix2<f64>; 4] = std::array::from_fn(of);
    all.iter().all(|c| c.iter().all(|x| x.is_finite())).then_some(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recognise::fixture::Dice;

    /// Gradients of 25 buckets with the same normal equations each, as if each had been disturbed
    /// by itself.
    fn gradients(each: &SMatrix<f64, 8, 8>, noise: f64, dice: &mut Dice) -> Vec<SVector<f64, 8>> {
        let root = each.cholesky().unwrap().l();
        let mut normal = || 2.0_f64.sqrt() * (0..6).map(|_| dice.roll() - 0.5).sum::<f64>();
        (0..25).map(|_| root * SVector::from_fn(|_, _| noise * normal())).collect()
    }

    /// The squared errors of corners from disturbed equations agree with their covariance.
    #[test]
    fn errors_agree_with_the_covariance() {
        let mut dice = Dice::new(3);
        let each = SMatrix::<f64, 8, 8>::from_fn(|i, j| if i == j { 2.0 + i as f64 } else { 0.3 });
        let normal = each * 25.0;
        let (mut sum, mut count) = (0.0, 0.0);
        for _ in 0..400 {
            let mut own = gradients(&each, 0.7, &mut dice);
            let total: SVector<f64, 8> = own.iter().sum();
            let error = normal.try_inverse().unwrap() * total;
            // At the minimum the gradients sum to zero.
            for g in &mut own {
                *g -= each * error;
            }
            let said: Vec<_> = own.iter().map(|g| (each, *g)).collect();
            let covariances = corner_covariances(&said).unwrap();
            for (i, c) in covariances.iter().enumerate() {
                let e = error.fixed_rows::<2>(2 * i);
                sum += (e.transpose() * c.try_inverse().unwrap() * e)[0];
                count += 2.0;
            }
        }
        assert!((0.9..1.2).contains(&(sum / count)), "{}", sum / count);
    }

    #[test]
    fn too_few_buckets_give_no_covariance() {
        let mut dice = Dice::new(4);
        let each = SMatrix::<f64, 8, 8>::identity();
        let own: Vec<_> = gradients(&each, 1.0, &mut dice).into_iter().map(|g| (each, g)).collect();
        assert!(corner_covariances(&own[..10]).is_some());
        assert_eq!(corner_covariances(&own[..9]), None);
        assert_eq!(corner_covariances(&[(SMatrix::<f64, 4, 4>::identity(), SVector::zeros()); 25]), None);
    }
}
