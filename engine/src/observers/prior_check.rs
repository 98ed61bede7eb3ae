//! The pose that a picture gives against the pose that was known without it. In: the evaluation of
//! a frame and the robot's own prior. Out: both poses, how far apart they are, and whether that was
//! a reason to refuse: for stored answers.

use crate::frame::landmark_checks::FrameEvaluation;
use map::{
    localise::{FixRefusal, FixResult},
    pose2::Pose2Covariance,
};

/// Whose pose a picture was compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PriorSource {
    /// The robot sent it with its frame: a pose beyond the limit is refused.
    Robot,
    /// The server had it of earlier frames and odometry: it only chooses between two solutions of
    /// the picture, so that a wrong one does not keep out what corrects it.
    Server,
}

/// A prior pose, and the pose by the picture alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PriorCheck {
    /// Whose pose it is.
    pub source: PriorSource,
    /// `map_from_robot` without the picture.
    pub prior: Pose2Covariance,
    /// `map_from_robot` by the landmarks of the picture: of several solutions the nearest to the
    /// prior, also where it is refused.
    pub seen: Option<Pose2Covariance>,
    /// Squared Mahalanobis distance of the two, under the sum of their covariances.
    pub distance2: Option<f64>,
    /// The largest distance that the robot's prior lets pass.
    pub limit: f64,
    /// The pose was refused for it.
    pub is_refused: bool,
}

/// The check of a frame; `None` where no pose was known before it. `limit` is that of the robot's
/// prior.
pub fn prior_check(
    evaluation: &FrameEvaluation,
    of_robot: Option<&Pose2Covariance>,
    limit: f64,
) -> Option<PriorCheck> {
    let (source, prior) = match (of_robot, evaluation.prior) {
        (Some(prior), _) => (PriorSource::Robot, *prior),
        (None, Some(prior)) => (PriorSource::Server, prior),
        (None, None) => return None,
    };
    let nearer = |a: &Pose2Covariance, b: &Pose2Covariance| {
        let distance2 = |pose: &Pose2Covariance| pose.distance2(&prior).unwrap_or(f64::INFINITY);
        distance2(a).total_cmp(&distance2(b))
    };
    let (seen, is_refused) = match &evaluation.independent {
        Some(FixResult::Fixed(fix)) => (Some(fix.pose), false),
        Some(FixResult::Ambiguous(fixes)) => (fixes.iter().map(|fix| fix.pose).min_by(nearer), false),
        Some(FixResult::Refused(FixRefusal::Prior { nearest, .. })) => (Some(*nearest), true),
        Some(FixResult::Refused(_)) | None => (None, false),
    };
    let distance2 = seen.and_then(|pose| pose.distance2(&prior));
    Some(PriorCheck { source, prior, seen, distance2, limit, is_refused })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::fixes::NoFix;
    use map::{
        localise::{AmbiguityResolvedBy, Fix, FixSource},
        pose2::Pose2,
    };
    use nalgebra::Matrix3;

    /// 99 % of chi2 with 3 degrees of freedom.
    const LIMIT: f64 = 11.3;

    fn pose(x_m: f64) -> Pose2Covariance {
        Pose2Covariance::new(Pose2::new(x_m, 0.0, 0.0), Matrix3::identity() * 0.5).unwrap()
    }

    fn fix(x_m: f64) -> Fix {
        Fix {
            modality: FixSource::Landmarks,
            pose: pose(x_m),
            noise: Matrix3::identity(),
            nuisances: Vec::new(),
            landmarks: Vec::new(),
            decided_by: AmbiguityResolvedBy::Single,
            chi2: 1.0,
            dof: 5,
        }
    }

    fn evaluated(prior: Option<f64>, independent: Option<FixResult>) -> FrameEvaluation {
        FrameEvaluation {
            prior: prior.map(pose),
            fix: Err(NoFix::Ambiguous),
            refusal: None,
            independent,
            guided: None,
            checks: None,
            only_expected: false,
        }
    }

    #[test]
    fn the_robots_prior_comes_first_and_the_distance_is_that_of_the_nearest_solution() {
        let several = || Some(FixResult::Ambiguous(vec![fix(9.0), fix(3.0)]));
        let of_server = prior_check(&evaluated(Some(1.0), several()), None, LIMIT).unwrap();
        assert_eq!(
            (of_server.source, of_server.prior, of_server.seen),
            (PriorSource::Server, pose(1.0), Some(pose(3.0)))
        );
        // Both covariances add up to 1.
        assert!((of_server.distance2.unwrap() - 4.0).abs() < 1e-9 && !of_server.is_refused, "{of_server:?}");
        let of_robot = prior_check(&evaluated(Some(1.0), several()), Some(&pose(8.0)), LIMIT).unwrap();
        assert_eq!((of_robot.source, of_robot.seen), (PriorSource::Robot, Some(pose(9.0))));
        assert_eq!(prior_check(&evaluated(None, several()), None, LIMIT), None);
    }

    #[test]
    fn a_refused_pose_is_kept_with_its_distance() {
        let refusal = FixRefusal::Prior { nearest: pose(7.0), distance2: 36.0, limit: 11.3 };
        let check = prior_check(&evaluated(None, Some(FixResult::Refused(refusal))), Some(&pose(1.0)), LIMIT)
            .unwrap();
        assert!(check.is_refused && check.distance2.unwrap() > check.limit, "{check:?}");
        assert_eq!(check.seen, Some(pose(7.0)));
        // Another gate is no matter of the prior.
        let other = FixResult::Refused(FixRefusal::BehindWall);
        let check = prior_check(&evaluated(Some(1.0), Some(other)), None, LIMIT).unwrap();
        assert_eq!((check.seen, check.distance2, check.is_refused), (None, None, false));
    }
}
