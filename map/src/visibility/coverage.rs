//! Which landmarks a robot sees along a path, and where it sees none.

use super::VisibilityMap;
use crate::{
    check::{self, OutOfRange},
    pose2::Pose2,
};
use nalgebra::Point2;
use vision::model::LandmarkId;

/// Most places looked at along one path.
pub const MAX_STEPS: usize = 10_000;

/// One place of a path.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    /// Way from the start.
    pub along_m: f64,
    /// Where that is.
    pub position: Point2<f64>,
    /// The landmarks that are seen from there, by number.
    pub landmarks: Vec<LandmarkId>,
}

/// A piece of the path without any landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// Way from the start at which it begins, and ends.
    pub from_m: f64,
    /// Where it ends.
    pub to_m: f64,
}

/// What is seen along a path.
#[derive(Debug, Clone, PartialEq)]
pub struct Coverage {
    /// Length of the path.
    pub length_m: f64,
    /// Place by place.
    pub steps: Vec<Seen>,
    /// Where nothing is seen; to the step.
    pub gaps: Vec<Gap>,
}

impl Coverage {
    /// Share of the path's places from which some landmark is seen.
    pub fn share(&self) -> f64 {
        let seen = self.steps.iter().filter(|s| !s.landmarks.is_empty()).count();
        seen as f64 / self.steps.len().max(1) as f64
    }
}

/// Looks at a path of at least one point every `step_m` (0.01 to 10 m), and at its end.
///
/// The robot looks wherever its camera pans to when it drives forward.
pub fn coverage(
    path: &[Point2<f64>],
    step_m: f64,
    maps: &[(LandmarkId, &VisibilityMap)],
) -> Result<Coverage, OutOfRange> {
    check::within("step_m", step_m, 0.01, 10.0)?;
    check::within("path", path.len() as f64, 1.0, MAX_STEPS as f64)?;
    for point in path {
        Pose2::new(point.x, point.y, 0.0).check()?;
    }
    let length_m: f64 = path.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
    check::within("length_m", length_m, 0.0, step_m * (MAX_STEPS - 2) as f64)?;
    let mut steps = Vec::new();
    let (mut before, mut next) = (0.0, 0.0);
    for leg in path.windows(2) {
        let length = (leg[1] - leg[0]).norm();
        let heading = (leg[1].y - leg[0].y).atan2(leg[1].x - leg[0].x);
        while next <= before + length && length > 0.0 {
            let position = leg[0] + (leg[1] - leg[0]) * ((next - before) / length);
            steps.push(seen(next, position, Some(heading), maps));
            next += step_m;
        }
        before += length;
    }
    let heading = path.windows(2).rev().map(|w| w[1] - w[0]).find(|d| d.norm() > 0.0).map(|d| d.y.atan2(d.x));
    if let Some(end) = path.last() {
        steps.push(seen(length_m, *end, heading, maps));
    }
    let gaps = gaps(&steps);
    Ok(Coverage { length_m, steps, gaps })
}

fn seen(
    along_m: f64,
    position: Point2<f64>,
    heading_rad: Option<f64>,
    maps: &[(LandmarkId, &VisibilityMap)],
) -> Seen {
    let sees = |map: &VisibilityMap| {
        map.contains(&position) && heading_rad.is_none_or(|heading| map.pans(&position, heading))
    };
    let landmarks = maps.iter().filter(|(_, map)| sees(map)).map(|(id, _)| *id).collect();
    Seen { along_m, position, landmarks }
}

/// From the last place that sees something to the next that does.
fn gaps(steps: &[Seen]) -> Vec<Gap> {
    let mut made: Vec<Gap> = Vec::new();
    let mut open: Option<f64> = None;
    for (i, step) in steps.iter().enumerate() {
        match (step.landmarks.is_empty(), open) {
            (true, None) => open = Some(if i == 0 { step.along_m } else { steps[i - 1].along_m }),
            (false, Some(from_m)) => {
                made.push(Gap { from_m, to_m: step.along_m });
                open = None;
            }
            _ => {}
        }
    }
    if let (Some(from_m), Some(last)) = (open, steps.last()) {
        made.push(Gap { from_m, to_m: last.along_m });
    }
    made
}
