//! Whether a landmark is where the map says, by a pose that does not rest on it.

use super::ChangeParams;
use crate::{
    check::OutOfRange,
    localise::{FixRefusal, LocaliseParams, RobotFix, Sighting, robot_pose},
    mounting::Mounting,
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeSet;
use vision::model::LandmarkId;

/// What a sighting says of its landmark's place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// It hangs there.
    InPlace {
        /// Squared Mahalanobis distance of the fix from it to the pose.
        distance2: f64,
    },
    /// It hangs elsewhere, or it is another one that looks the same.
    Elsewhere {
        /// The same distance; infinite where no upright robot can see it so.
        distance2: f64,
        /// Where it appears: centre on the floor and direction of its normal.
        apparent: Pose2,
        /// How far that is from its place, height included.
        by_m: f64,
        /// On how many other landmarks the pose rests.
        supporters: usize,
    },
    /// It agrees with the pose, but so it might if it had been moved: seen from too far. The pose is known well enough
    /// without it, and many such looks would drag it along.
    Unsure,
    /// The pose rests on no other, or the sighting gave no fix.
    Undecided,
}

/// A judged sighting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Judged {
    /// Of which landmark.
    pub landmark: LandmarkId,
    /// What it says.
    pub verdict: Verdict,
}

/// Judges a sighting by the robot's pose without it. `supporters` are the landmarks that pose rests on.
pub fn judge(
    sighting: &Sighting<'_>,
    mounting: &Mounting,
    pose: &Pose2Covariance,
    supporters: &[LandmarkId],
    p: &ChangeParams,
) -> Result<Judged, OutOfRange> {
    let landmark = sighting.landmark;
    let others = supporters.iter().collect::<BTreeSet<_>>().into_iter().filter(|id| **id != landmark).count();
    if others == 0 {
        return Ok(Judged { landmark, verdict: Verdict::Undecided });
    }
    let alone = robot_pose(std::slice::from_ref(sighting), mounting, None, &LocaliseParams::default())?;
    let fixes = match &alone {
        RobotFix::Fixed(fix) => std::slice::from_ref(&**fix),
        RobotFix::Ambiguous(fixes) => fixes.as_slice(),
        // Another height or size: the corners fit no robot on this floor.
        RobotFix::Refused(FixRefusal::Room { .. } | FixRefusal::Side) => &[],
        RobotFix::Refused(_) => return Ok(Judged { landmark, verdict: Verdict::Undecided }),
    };
    let distances = fixes.iter().map(|f| (distance2(&f.pose, pose), &f.pose));
    let nearest = distances.min_by(|a, b| a.0.total_cmp(&b.0));
    let distance2 = nearest.map_or(f64::INFINITY, |(distance2, _)| distance2);
    let verdict = if distance2 <= p.moved_chi2 {
        // A move of this much must stand out from both uncertainties, in whatever direction.
        let told = p.told_m / p.moved_chi2.sqrt();
        let both = nearest.map_or(0.0, |(_, fix)| spread_m(&(fix.covariance + pose.covariance)));
        if both > told && spread_m(&pose.covariance) < told {
            Verdict::Unsure
        } else {
            Verdict::InPlace { distance2 }
        }
    } else {
        let (apparent, by_m) = apparent(sighting, mounting, pose);
        Verdict::Elsewhere { distance2, apparent, by_m, supporters: others }
    };
    Ok(Judged { landmark, verdict })
}

fn distance2(fix: &Pose2Covariance, pose: &Pose2Covariance) -> f64 {
    let error = fix.pose.minus(&pose.pose);
    let both = fix.covariance + pose.covariance;
    both.cholesky().map_or(f64::INFINITY, |c| error.dot(&c.solve(&error)))
}

/// Standard deviation of the position in its worst direction.
fn spread_m(covariance: &Matrix3<f64>) -> f64 {
    let (xx, xy, yy) = (covariance[(0, 0)], covariance[(0, 1)], covariance[(1, 1)]);
    (0.5 * (xx + yy) + (0.25 * (xx - yy).powi(2) + xy * xy).sqrt()).max(0.0).sqrt()
}

/// Where a landmark appears from a pose: of the two solutions of its plane the one nearer to its place.
fn apparent(sighting: &Sighting<'_>, mounting: &Mounting, pose: &Pose2Covariance) -> (Pose2, f64) {
    let map_from_camera = pose.pose.to_isometry3() * mounting.robot_from_camera;
    let place = sighting.place.map_from_landmark();
    let solutions = std::iter::once(&sighting.seen.best).chain(sighting.seen.second.as_ref());
    let there = solutions.map(|s| map_from_camera * s.camera_from_landmark);
    let nearest = there.min_by(|a, b| {
        let off = |t: &nalgebra::Isometry3<f64>| t.rotation.angle_to(&place.rotation);
        off(a).total_cmp(&off(b))
    });
    let there = nearest.unwrap_or(place);
    let (t, normal) = (there.translation.vector, there.rotation * Vector3::x());
    (Pose2::new(t.x, t.y, normal.y.atan2(normal.x)), (t - place.translation.vector).norm())
}

/// Of the sightings of one frame those that may correct the pose: without the unsure, and without those that are seen
/// elsewhere unless no other would be left. Then they stay, and it is for the fusion to weigh them: it may be the pose
/// that is wrong.
pub fn sift<'a>(sightings: &[Sighting<'a>], judged: &[Judged]) -> Vec<Sighting<'a>> {
    let is = |s: &Sighting<'_>, kind: fn(&Verdict) -> bool| {
        judged.iter().any(|j| j.landmark == s.landmark && kind(&j.verdict))
    };
    let sure = sightings.iter().filter(|s| !is(s, |v| matches!(v, Verdict::Unsure))).copied();
    let (elsewhere, kept): (Vec<_>, Vec<_>) =
        sure.partition(|s| is(s, |v| matches!(v, Verdict::Elsewhere { .. })));
    if kept.is_empty() { elsewhere } else { kept }
}
