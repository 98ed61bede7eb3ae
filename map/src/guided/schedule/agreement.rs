//! The agreement of a global fix with the prior pose, and the uncertainty of a prior pose.

use crate::{
    guided::schedule::params::ScheduleParams,
    localise::{AmbiguityResolvedBy, Fix, FixResult},
    pose2::Pose2Covariance,
};

/// Agreement of a global fix with the pose.
pub(super) enum PoseAgreement<'a> {
    Agrees(&'a Fix),
    /// All of its solutions.
    Contradicts(&'a [Fix]),
    Silent,
}

pub(super) fn agreement<'a>(
    global: &'a FixResult,
    prior: &Pose2Covariance,
    p: &ScheduleParams,
) -> PoseAgreement<'a> {
    let distance2 = |fix: &Fix| prior.distance2(&fix.pose).unwrap_or(f64::INFINITY);
    let fixes = match global {
        FixResult::Fixed(fix) => std::slice::from_ref(&**fix),
        FixResult::Ambiguous(fixes) => fixes.as_slice(),
        FixResult::Refused(_) => &[],
    };
    let nearest = fixes.iter().map(distance2).fold(f64::INFINITY, f64::min);
    match fixes {
        [] => PoseAgreement::Silent,
        // A fix that the prior disambiguated is not independent of the pose.
        [fix] if nearest <= p.support_chi2 && fix.decided_by != AmbiguityResolvedBy::Prior => {
            PoseAgreement::Agrees(fix)
        }
        _ if nearest > p.contradict_chi2 => PoseAgreement::Contradicts(fixes),
        _ => PoseAgreement::Silent,
    }
}

pub(super) fn is_uncertain(prior: &Pose2Covariance, p: &ScheduleParams) -> bool {
    let c = &prior.covariance;
    let (xx, xy, yy, variance_rad2) = (c[(0, 0)], c[(0, 1)], c[(1, 1)], c[(2, 2)]);
    // Largest eigenvalue of the position's block.
    let variance_m2 = 0.5 * (xx + yy) + (0.5 * (xx - yy)).hypot(xy);
    // NaN is uncertain.
    !(variance_m2 <= p.max_sigma_m.powi(2) && variance_rad2 <= p.max_sigma_rad.powi(2))
}
