//! Checks a landmark's place by a pose that does not rest on it.

use crate::{
    check::OutOfRange,
    extrinsics::CameraExtrinsics,
    landmark_health::params::HealthParams,
    localise::{FixRefusal, FixResult, LandmarkObservation, LocaliseParams, robot_pose},
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeSet;
use vision::model::LandmarkId;

/// Result of a place check.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlaceVerdict {
    /// The landmark is at its place.
    InPlace {
        /// Squared Mahalanobis distance of its own fix to the pose, 3 degrees of freedom.
        distance2: f64,
    },
    /// The landmark is elsewhere, or a look-alike was observed.
    Elsewhere {
        /// The same distance; infinite where no floor pose fits.
        distance2: f64,
        /// Observed centre on the floor and direction of the normal, map frame.
        apparent: Pose2,
        /// Distance from its place, height included, metres.
        by_m: f64,
        /// Number of other landmarks that support the pose.
        supporters: usize,
    },
    /// It agrees with the pose, but from too far to detect a displacement. The pose is certain
    /// enough without it; many such observations would pull the pose along.
    Unsure,
    /// The pose has no other supporting landmark, or the observation gave no fix.
    Undecided,
}

/// The place check of one landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaceCheck {
    /// Number of the landmark.
    pub landmark: LandmarkId,
    /// Result of the check.
    pub verdict: PlaceVerdict,
}

/// Checks an observed landmark by the robot's pose without it. `supporters` are the landmarks that
/// support the pose.
pub fn check_place(
    observation: &LandmarkObservation<'_>,
    mounting: &CameraExtrinsics,
    pose: &Pose2Covariance,
    supporters: &[LandmarkId],
    p: &HealthParams,
) -> Result<PlaceCheck, OutOfRange> {
    let landmark = observation.landmark;
    let others = supporters.iter().collect::<BTreeSet<_>>().into_iter().filter(|id| **id != landmark).count();
    if others == 0 {
        return Ok(PlaceCheck { landmark, verdict: PlaceVerdict::Undecided });
    }
    let alone = robot_pose(std::slice::from_ref(observation), mounting, None, &LocaliseParams::default())?;
    let fixes = match &alone {
        FixResult::Fixed(fix) => std::slice::from_ref(&**fix),
        FixResult::Ambiguous(fixes) => fixes.as_slice(),
        // Another height or size: no floor pose fits the corners.
        FixResult::Refused(FixRefusal::ReprojectionError { .. } | FixRefusal::BehindWall) => &[],
        FixResult::Refused(_) => return Ok(PlaceCheck { landmark, verdict: PlaceVerdict::Undecided }),
    };
    let distances = fixes.iter().map(|f| (distance2(&f.pose, pose), &f.pose));
    let nearest = distances.min_by(|a, b| a.0.total_cmp(&b.0));
    let distance2 = nearest.map_or(f64::INFINITY, |(distance2, _)| distance2);
    let verdict = if distance2 <= p.moved_chi2 {
        // A displacement of this much must be detectable in every direction.
        let detectable_m = p.told_m / p.moved_chi2.sqrt();
        let both = nearest.map_or(0.0, |(_, fix)| spread_m(&(fix.covariance + pose.covariance)));
        if both > detectable_m && spread_m(&pose.covariance) < detectable_m {
            PlaceVerdict::Unsure
        } else {
            PlaceVerdict::InPlace { distance2 }
        }
    } else {
        let (apparent, by_m) = apparent(observation, mounting, pose);
        PlaceVerdict::Elsewhere { distance2, apparent, by_m, supporters: others }
    };
    Ok(PlaceCheck { landmark, verdict })
}

fn distance2(fix: &Pose2Covariance, pose: &Pose2Covariance) -> f64 {
    let error = fix.pose.minus(&pose.pose);
    let both = fix.covariance + pose.covariance;
    both.cholesky().map_or(f64::INFINITY, |c| error.dot(&c.solve(&error)))
}

/// Standard deviation of the position in its worst direction, metres.
fn spread_m(covariance: &Matrix3<f64>) -> f64 {
    let (xx, xy, yy) = (covariance[(0, 0)], covariance[(0, 1)], covariance[(1, 1)]);
    (0.5 * (xx + yy) + (0.25 * (xx - yy).powi(2) + xy * xy).sqrt()).max(0.0).sqrt()
}

/// Observed place of a landmark from a pose: the solution of its plane that is nearer to its place.
fn apparent(
    observation: &LandmarkObservation<'_>,
    mounting: &CameraExtrinsics,
    pose: &Pose2Covariance,
) -> (Pose2, f64) {
    let map_from_camera = pose.pose.to_isometry3() * mounting.robot_from_camera;
    let place = observation.place.map_from_landmark();
    let solutions = std::iter::once(&observation.seen.best).chain(observation.seen.second.as_ref());
    let there = solutions.map(|s| map_from_camera * s.camera_from_landmark);
    let nearest = there.min_by(|a, b| {
        let off = |t: &nalgebra::Isometry3<f64>| t.rotation.angle_to(&place.rotation);
        off(a).total_cmp(&off(b))
    });
    let there = nearest.unwrap_or(place);
    let (t, normal) = (there.translation.vector, there.rotation * Vector3::x());
    (Pose2::new(t.x, t.y, normal.y.atan2(normal.x)), (t - place.translation.vector).norm())
}

/// The observations of one frame that may correct the pose: without unsure ones, and without those
/// observed elsewhere, unless no other is left. Then they stay and the fusion decides, since the
/// pose may be wrong.
pub fn drop_unreliable<'a>(
    observations: &[LandmarkObservation<'a>],
    checks: &[PlaceCheck],
) -> Vec<LandmarkObservation<'a>> {
    let is = |s: &LandmarkObservation<'_>, kind: fn(&PlaceVerdict) -> bool| {
        checks.iter().any(|j| j.landmark == s.landmark && kind(&j.verdict))
    };
    let sure = observations.iter().filter(|s| !is(s, |v| matches!(v, PlaceVerdict::Unsure))).copied();
    let (elsewhere, in_place): (Vec<_>, Vec<_>) =
        sure.partition(|s| is(s, |v| matches!(v, PlaceVerdict::Elsewhere { .. })));
    if in_place.is_empty() { elsewhere } else { in_place }
}
