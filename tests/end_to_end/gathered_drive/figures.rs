//! Names on a drive past posters, counted against the truth.

use client::v1::{self, Verdict};
use nalgebra::Point2;
use sim::{
    robot::SensorReadings,
    truth::{LandmarkView, ViewState},
};
use vision::geometry::polygon::iou;

/// Posters with a shorter side are counted apart ...
const LARGE_PX: f64 = 60.0;
/// ... and below this not at all: they have no icon.
const MIN_SIDE_PX: f64 = 38.0;

/// Counts of a drive.
#[derive(Debug, Default)]
pub(super) struct Figures {
    /// Posters wholly in a picture, large and small, and those of them that were recognised.
    pub(super) shown: [usize; 2],
    pub(super) right: [usize; 2],
    pub(super) wrong: usize,
    pub(super) poses: usize,
    pub(super) worst_m: f64,
}

pub(super) fn figures(drive: &[(SensorReadings, v1::Answer)]) -> Figures {
    let mut f = Figures::default();
    for (readings, answer) in drive {
        let truth = &readings.frame.truth;
        let whole = |l: &&LandmarkView| l.name.starts_with("poster") && l.state == ViewState::Full;
        let size = |l: &LandmarkView| usize::from(l.min_side_px() < LARGE_PX);
        let shown = truth.landmarks.iter().filter(whole).filter(|l| l.min_side_px() >= MIN_SIDE_PX);
        for poster in shown.clone() {
            f.shown[size(poster)] += 1;
        }
        for quad in answer.quads.iter().filter(|q| q.verdict() == Verdict::Unique) {
            let corners: Vec<_> = quad.corners.iter().map(|c| Point2::new(c.u_px, c.v_px)).collect();
            let there = truth.landmarks.iter().find(|l| iou(&corners, l.corners_px.points()) > 0.5);
            f.wrong += usize::from(there.is_none_or(|l| l.name != quad.landmark));
            if let Some(poster) = there.filter(|t| t.name == quad.landmark)
                && shown.clone().any(|l| l.name == poster.name)
            {
                f.right[size(poster)] += 1;
            }
        }
        if let Some(pose) = answer.map_from_robot.as_ref().and_then(|p| p.pose.as_ref()) {
            let t = readings.step.map_from_robot;
            f.poses += 1;
            f.worst_m = f.worst_m.max((pose.x_m - t.x_m).hypot(pose.y_m - t.y_m));
        }
    }
    f
}
