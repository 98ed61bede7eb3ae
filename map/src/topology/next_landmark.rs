//! The landmark to look for on a leg of a route.

use crate::{
    check::OutOfRange,
    gaze::{GazeCandidate, GazeParams, GazeTarget, PanTiltUnit, rank},
    pose2::{Pose2, Pose2Covariance},
    visibility::PanTiltCamera,
};
use nalgebra::{Matrix3, Point2};

/// Poses along a leg from which landmarks are ranked are this far apart, metres.
pub const LOOK_STEP_M: f64 = 0.5;

/// A landmark to look for, and from where.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NextLandmark {
    /// The pose of the robot, which heads along the leg.
    pub map_from_robot: Pose2,
    /// How far along the leg this pose is, metres.
    pub along_m: f64,
    /// The landmark, and how the camera turns to it.
    pub target: GazeTarget,
}

/// The landmark of the largest utility by the paper's product, at the first pose along a path from
/// which any has one; where all are 0 (models without visibility confidence), at the first pose
/// that sees any. `None` if none is seen on the whole path. Errors: camera or unit out of range.
pub fn next_landmark(
    path: &[Point2<f64>],
    candidates: &[GazeCandidate<'_>],
    viewer: &PanTiltCamera,
    head: &PanTiltUnit,
) -> Result<Option<NextLandmark>, OutOfRange> {
    let (mut walked_m, mut seen) = (0.0, None);
    let single = path.first().map(|point| [*point, *point]).filter(|_| path.len() == 1);
    for [a, b] in single.into_iter().chain(path.array_windows::<2>().copied()) {
        let (along, length_m) = (b - a, (b - a).norm());
        let steps = (length_m / LOOK_STEP_M).ceil().max(1.0);
        for i in 0..steps as usize {
            let share = i as f64 / steps;
            let (point, heading_rad) = (a + along * share, along.y.atan2(along.x));
            let pose = Pose2::new(point.x, point.y, heading_rad);
            let target = best(&pose, candidates, viewer, head)?;
            let found =
                |target| NextLandmark { map_from_robot: pose, along_m: walked_m + share * length_m, target };
            match target.map(found) {
                Some(found) if found.target.utility > 0.0 => return Ok(Some(found)),
                other => seen = seen.or(other),
            }
        }
        walked_m += length_m;
    }
    Ok(seen)
}

fn best(
    pose: &Pose2,
    candidates: &[GazeCandidate<'_>],
    viewer: &PanTiltCamera,
    head: &PanTiltUnit,
) -> Result<Option<GazeTarget>, OutOfRange> {
    let [x, y, _] = head.camera_m;
    let camera = pose.apply(&Point2::new(x, y));
    let near: Vec<GazeCandidate<'_>> =
        candidates.iter().filter(|c| c.visible.contains(&camera)).copied().collect();
    let pose = Pose2Covariance { pose: *pose, covariance: Matrix3::zeros() };
    Ok(rank(&pose, &near, viewer, head, &GazeParams::default())?.into_iter().next())
}
