//! Two point sets in, partial Hausdorff distance H^r out (method 6.2): the k-th smallest distance
//! of a point to its nearest match, position distance times descriptor distance.

use crate::recognise::features::descriptor::PointSet;
use serde::{Deserialize, Serialize};

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HausdorffParams {
    /// Share r of the smaller set that must have a match in the other.
    pub inlier_fraction: f64,
    /// With fewer points in either set the distance is infinite: a tiny k makes false matches.
    pub min_points: usize,
}

impl Default for HausdorffParams {
    fn default() -> Self {
        Self { inlier_fraction: 0.4, min_points: 8 }
    }
}

/// H^r: the greater of both directed distances, in icon pixels times Mahalanobis distance; infinite
/// when either set has fewer than `min_points`.
pub fn hausdorff(a: &PointSet, b: &PointSet, p: &HausdorffParams) -> f64 {
    let smaller = a.len().min(b.len());
    if smaller < p.min_points.max(1) {
        return f64::INFINITY;
    }
    let (mut nearest_of_a, mut nearest_of_b) = (vec![f32::INFINITY; a.len()], vec![f32::INFINITY; b.len()]);
    for (i, near) in nearest_of_a.iter_mut().enumerate() {
        for (j, back) in nearest_of_b.iter_mut().enumerate() {
            let d = product_squared(a, i, b, j);
            *near = near.min(d);
            *back = back.min(d);
        }
    }
    let k = rank(smaller, p.inlier_fraction);
    let squared = kth_smallest(&mut nearest_of_a, k).max(kth_smallest(&mut nearest_of_b, k));
    f64::from(squared).sqrt()
}

/// A point's nearest counterpart in another set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Counterpart {
    /// Its index in the other set.
    pub index: usize,
    /// Product of their distance in the icon and of their descriptors.
    pub distance: f64,
}

/// The nearest counterpart in `b` of each point of `a`: of these distances, [`hausdorff`] takes the
/// k-th smallest. Empty where `b` has no point.
pub fn counterparts(a: &PointSet, b: &PointSet) -> Vec<Counterpart> {
    let nearest = |i: usize| {
        let squares = (0..b.len()).map(|j| (j, product_squared(a, i, b, j)));
        let (index, squared) = squares.min_by(|x, y| x.1.total_cmp(&y.1))?;
        Some(Counterpart { index, distance: f64::from(squared).sqrt() })
    };
    (0..a.len()).filter_map(nearest).collect()
}

/// k = ceil(r n), at least 1 and at most n.
pub fn rank(n: usize, inlier_fraction: f64) -> usize {
    // 0.4 * 10 is 4.000000000000001 in doubles: take rounding off before rounding up.
    ((inlier_fraction * n as f64 - 1e-9).ceil() as usize).clamp(1, n)
}

/// The k-th smallest value, k counted from 1.
fn kth_smallest(values: &mut [f32], k: usize) -> f32 {
    *values.select_nth_unstable_by(k - 1, f32::total_cmp).1
}

/// Square of `d_p = d_nu * distance` in the icon.
fn product_squared(a: &PointSet, i: usize, b: &PointSet, j: usize) -> f32 {
    let ([ax, ay], [bx, by]) = (a.xy_px()[i], b.xy_px()[j]);
    let place = (ax - bx) * (ax - bx) + (ay - by) * (ay - by);
    let texture: f32 =
        a.descriptors()[i].iter().zip(&b.descriptors()[j]).map(|(x, y)| (x - y) * (x - y)).sum();
    place * texture
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recognise::features::descriptor::Descriptor;
    use proptest::prelude::*;

    /// Points whose descriptors are 1 apart between sets, so that `d_p` is the Euclidean distance.
    fn set(points: &[[f32; 2]], mark: f32) -> PointSet {
        let mut descriptor: Descriptor = [0.0; 7];
        descriptor[3] = mark;
        PointSet::new(points.to_vec(), vec![descriptor; points.len()], vec![1.0; points.len()]).unwrap()
    }

    #[test]
    fn golden_example() {
        let a = set(&[[0.0, 0.0], [10.0, 0.0], [0.0, 10.0], [10.0, 10.0]], 0.0);
        let b = set(&[[1.0, 0.0], [10.0, 2.0], [0.0, 13.0], [40.0, 40.0], [11.0, 10.0]], 1.0);
        for (inlier_fraction, expected) in [(0.25, 1.0), (0.5, 1.0), (0.75, 2.0), (1.0, 3.0)] {
            let p = HausdorffParams { inlier_fraction, min_points: 1 };
            assert!((hausdorff(&a, &b, &p) - expected).abs() < 1e-6, "{inlier_fraction}");
            assert!((hausdorff(&b, &a, &p) - expected).abs() < 1e-6, "{inlier_fraction}");
        }
    }

    #[test]
    fn too_few_points_are_infinitely_far() {
        let p = HausdorffParams::default();
        let points: Vec<[f32; 2]> = (0..8).map(|i| [i as f32, 0.0]).collect();
        assert!(hausdorff(&set(&points, 0.0), &set(&points, 1.0), &p).is_finite());
        assert!(hausdorff(&set(&points[..7], 0.0), &set(&points, 1.0), &p).is_infinite());
        assert!(hausdorff(&set(&points, 0.0), &set(&points[..7], 1.0), &p).is_infinite());
        assert!(
            hausdorff(&set(&[], 0.0), &set(&[], 1.0), &HausdorffParams { min_points: 0, ..p }).is_infinite()
        );
    }

    fn points() -> impl Strategy<Value = PointSet> {
        proptest::collection::vec(
            (proptest::array::uniform2(0.0..75.0_f32), proptest::array::uniform7(-5.0..5.0_f32)),
            1..30,
        )
        .prop_map(|v| {
            let n = v.len();
            let (xy, d) = v.into_iter().unzip();
            PointSet::new(xy, d, vec![1.0; n]).unwrap()
        })
    }

    /// Oracle: both directed distances by full sorting, in doubles.
    fn naive(a: &PointSet, b: &PointSet, r: f64) -> f64 {
        let d = |i: usize, j: usize| {
            let place = (0..2).map(|c| f64::from(a.xy_px()[i][c] - b.xy_px()[j][c]).powi(2)).sum::<f64>();
            let texture =
                (0..7).map(|c| f64::from(a.descriptors()[i][c] - b.descriptors()[j][c]).powi(2)).sum::<f64>();
            place.sqrt() * texture.sqrt()
        };
        let k = ((r * a.len().min(b.len()) as f64).ceil() as usize).max(1);
        let min = |values: Vec<f64>| values.into_iter().fold(f64::INFINITY, f64::min);
        let mut from_a: Vec<f64> =
            (0..a.len()).map(|i| min((0..b.len()).map(|j| d(i, j)).collect())).collect();
        let mut from_b: Vec<f64> =
            (0..b.len()).map(|j| min((0..a.len()).map(|i| d(i, j)).collect())).collect();
        from_a.sort_by(f64::total_cmp);
        from_b.sort_by(f64::total_cmp);
        from_a[k - 1].max(from_b[k - 1])
    }

    proptest! {
        #[test]
        fn equals_the_naive_sort(a in points(), b in points(), quarters in 0_u32..5) {
            let r = f64::from(quarters) / 4.0;
            let p = HausdorffParams { inlier_fraction: r, min_points: 1 };
            let (ab, ba) = (hausdorff(&a, &b, &p), hausdorff(&b, &a, &p));
            prop_assert!((ab - naive(&a, &b, r)).abs() < 1e-3 * (1.0 + ab));
            prop_assert!((ab - ba).abs() < 1e-9);
            prop_assert!(hausdorff(&a, &a, &p) < 1e-9);
            let more = HausdorffParams { inlier_fraction: r + 0.2, min_points: 1 };
            prop_assert!(hausdorff(&a, &b, &more) >= ab);
        }

        #[test]
        fn turning_both_changes_nothing(a in points(), b in points(), shift in 0_usize..4) {
            let p = HausdorffParams { min_points: 1, ..HausdorffParams::default() };
            let (plain, turned) =
                (hausdorff(&a, &b, &p), hausdorff(&a.rotated(shift, 75), &b.rotated(shift, 75), &p));
            prop_assert!((plain - turned).abs() < 1e-2 * (1.0 + plain));
        }

        #[test]
        fn never_panics(a in points(), r in any::<f64>(), min_points in 0_usize..40) {
            let p = HausdorffParams { inlier_fraction: r, min_points };
            prop_assert!(!hausdorff(&a, &a, &p).is_nan());
        }
    }
}
