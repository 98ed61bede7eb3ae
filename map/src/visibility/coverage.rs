//! Coverage of a path: which landmarks are visible along it, and where none is.

use super::VisibilityMap;
use crate::{
    check::{self, OutOfRange},
    pose2::Pose2,
};
use nalgebra::Point2;
use vision::model::LandmarkId;

/// Most samples of one path.
pub const MAX_STEPS: usize = 10_000;

/// Visible landmarks along a path.
#[derive(Debug, Clone, PartialEq)]
pub struct CoverageSample {
    /// Distance from the start, metres.
    pub along_m: f64,
    /// Position, metres, map frame.
    pub position: Point2<f64>,
    /// Landmarks visible from there, by number.
    pub landmarks: Vec<LandmarkId>,
}

/// A part of the path without any visible landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoverageGap {
    /// Distance from the start at which it begins, metres.
    pub from_m: f64,
    /// Distance from the start at which it ends, metres.
    pub to_m: f64,
}

/// Visible landmarks and gaps along a path.
#[derive(Debug, Clone, PartialEq)]
pub struct Coverage {
    /// Length of the path, metres.
    pub length_m: f64,
    /// Samples in the order of the path.
    pub steps: Vec<CoverageSample>,
    /// Parts without visible landmarks, at the resolution of the samples.
    pub gaps: Vec<CoverageGap>,
}

impl Coverage {
    /// Share of the samples with a visible landmark, 0 to 1.
    pub fn share(&self) -> f64 {
        let covered = self.steps.iter().filter(|s| !s.landmarks.is_empty()).count();
        covered as f64 / self.steps.len().max(1) as f64
    }
}

/// Samples a path of at least one point every `step_m` (0.01 to 10 m), and its end.
///
/// The robot drives forward; its camera pans within its range.
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
            steps.push(sample(next, position, Some(heading), maps));
            next += step_m;
        }
        before += length;
    }
    let heading = path.windows(2).rev().map(|w| w[1] - w[0]).find(|d| d.norm() > 0.0).map(|d| d.y.atan2(d.x));
    if let Some(end) = path.last() {
        steps.push(sample(length_m, *end, heading, maps));
    }
    let gaps = gaps(&steps);
    Ok(Coverage { length_m, steps, gaps })
}

fn sample(
    along_m: f64,
    position: Point2<f64>,
    heading_rad: Option<f64>,
    maps: &[(LandmarkId, &VisibilityMap)],
) -> CoverageSample {
    let sees = |map: &VisibilityMap| {
        map.contains(&position) && heading_rad.is_none_or(|heading| map.pans(&position, heading))
    };
    let landmarks = maps.iter().filter(|(_, map)| sees(map)).map(|(id, _)| *id).collect();
    CoverageSample { along_m, position, landmarks }
}

/// Gaps from the last sample with a landmark to the next one.
fn gaps(steps: &[CoverageSample]) -> Vec<CoverageGap> {
    let mut made: Vec<CoverageGap> = Vec::new();
    let mut open: Option<f64> = None;
    for (i, step) in steps.iter().enumerate() {
        match (step.landmarks.is_empty(), open) {
            (true, None) => open = Some(if i == 0 { step.along_m } else { steps[i - 1].along_m }),
            (false, Some(from_m)) => {
                made.push(CoverageGap { from_m, to_m: step.along_m });
                open = None;
            }
            _ => {}
        }
    }
    if let (Some(from_m), Some(last)) = (open, steps.last()) {
        made.push(CoverageGap { from_m, to_m: last.along_m });
    }
    made
}
