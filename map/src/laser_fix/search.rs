//! The pose by one scan: several starts, gates and ambiguity.

use crate::{
    check::OutOfRange,
    laser::Scan,
    laser_fix::{
        fit::descend,
        fix::{LaserFix, LaserRefusal},
        index::WallIndex,
        params::LaserFixParams,
    },
    pose2::{Pose2, Pose2Covariance},
    slam::cloud::{Cloud, cloud},
};
use nalgebra::{SymmetricEigen, Vector3};

/// Most points of a scan; more are thinned evenly.
const MAX_POINTS: usize = 360;

/// The pose of the robot when it took `scan`, near `prior`. Errors name an input that is out of
/// range.
pub fn laser_fix(
    walls: &WallIndex,
    scan: &Scan,
    prior: &Pose2Covariance,
    p: &LaserFixParams,
) -> Result<Result<LaserFix, LaserRefusal>, OutOfRange> {
    prior.check()?;
    p.check()?;
    let points_of_scan = flat_points(scan, p);
    if points_of_scan.points.len() < p.min_points || walls.is_empty() {
        return Ok(Err(LaserRefusal::FewPoints { points: points_of_scan.points.len() }));
    }
    let mut found: Vec<LaserFix> =
        starts(prior, p).iter().filter_map(|start| descend(walls, &points_of_scan, start, p)).collect();
    // Most points first, then the smallest residual; stable, so the prior's own start wins ties.
    found.sort_by(|a, b| b.points.cmp(&a.points).then(a.rms_m.total_cmp(&b.rms_m)));
    let Some(best) = found.first() else {
        return Ok(Err(LaserRefusal::FewPoints { points: 0 }));
    };
    if best.points < p.min_points {
        return Ok(Err(LaserRefusal::FewPoints { points: best.points }));
    }
    if best.matched < p.min_matched {
        return Ok(Err(LaserRefusal::PoorMatch { matched: best.matched }));
    }
    let distance2 = best.pose.distance2(prior).unwrap_or(f64::INFINITY);
    if distance2 > p.prior_gate {
        return Ok(Err(LaserRefusal::GatePrior { distance2 }));
    }
    let rival = found.iter().skip(1).any(|other| {
        other.points as f64 >= p.rival_share * best.points as f64
            && other.pose.distance2(&best.pose).is_some_and(|d2| d2 > p.apart_chi2)
            && other.pose.distance2(prior).is_some_and(|d2| d2 <= p.prior_gate)
    });
    Ok(if rival { Err(LaserRefusal::Ambiguous) } else { Ok(best.clone()) })
}

/// The points of flat surfaces, thinned evenly.
pub(super) fn flat_points(scan: &Scan, p: &LaserFixParams) -> Cloud {
    let mut flat = cloud(scan, &p.cloud);
    flat.points.retain(|q| q.normal.is_some());
    let stride = flat.points.len().div_ceil(MAX_POINTS).max(1);
    flat.points = flat.points.into_iter().step_by(stride).collect();
    flat
}

/// The prior's mean and, if the prior is wide, points along its axes.
fn starts(prior: &Pose2Covariance, p: &LaserFixParams) -> Vec<Pose2> {
    let mut starts = vec![prior.pose];
    let c = &prior.covariance;
    if c[(0, 0)].max(c[(1, 1)]).sqrt() <= p.wide_m && c[(2, 2)].sqrt() <= p.wide_rad {
        return starts;
    }
    let eigen = SymmetricEigen::new(*c);
    for k in 0..3 {
        let axis: Vector3<f64> = eigen.eigenvectors.column(k) * (1.5 * eigen.eigenvalues[k].max(0.0).sqrt());
        if axis.xy().norm() > 0.5 * p.wide_m || axis.z.abs() > 0.5 * p.wide_rad {
            starts.extend([prior.pose.plus(&axis), prior.pose.plus(&-axis)]);
        }
    }
    starts
}
