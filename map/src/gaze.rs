//! Gaze control: the landmark that is the most useful target from an uncertain pose, with the pan
//! and tilt that centre it (method 14).
//!
//! In: the robot's pose, candidates with their visibility areas, the pan-tilt unit. Out: the
//! targets within the unit's range with their utility, best first, or the action to point ahead or
//! sweep. [`GazeController`] keeps its target until another one is clearly better or observations
//! fail.

mod information;

use crate::{
    check::{self, OutOfRange},
    extrinsics::CameraExtrinsics,
    place::LandmarkPlace,
    pose2::{Pose2Covariance, wrap_rad},
    visibility::{PanTiltCamera, PoseDraws, VisibilityMap},
};
use nalgebra::{Point2, Point3, Vector3};
use serde::{Deserialize, Serialize};
use vision::model::LandmarkId;

/// Most landmarks whose failures are remembered.
pub const MAX_DAMPED: usize = 64;

/// Criterion of the choice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// The paper's product: probability, saliency, margin, visibility confidence.
    #[default]
    Product,
    /// Expected information gain on the pose over the time that the observation takes.
    Information,
}

/// Parameters of gaze control.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GazeParams {
    /// Criterion of the choice.
    pub criterion: Criterion,
    /// Candidates with a lower visibility probability are left out, 0 to 1.
    pub min_probability: f64,
    /// Distance to the boundary of the visibility area beyond which the utility no longer rises,
    /// metres.
    pub full_margin_m: f64,
    /// Another target must exceed the present one's utility by this factor.
    pub switch_ratio: f64,
    /// Consecutive failures that damp a landmark's utility.
    pub failures: u32,
    /// Factor on the utility of a damped landmark, 0 to 1.
    pub damping: f64,
    /// Duration of the damping, seconds.
    pub damped_s: f64,
    /// Expected standard deviation of a measured corner, px.
    pub corner_sigma_px: f64,
    /// Time to settle, expose and recognise, seconds.
    pub look_s: f64,
    /// With a larger position uncertainty and no target, the action is to sweep, metres.
    pub lost_m: f64,
}

impl Default for GazeParams {
    fn default() -> Self {
        Self {
            criterion: Criterion::Product,
            min_probability: 0.5,
            full_margin_m: 1.0,
            switch_ratio: 1.2,
            failures: 3,
            damping: 0.5,
            damped_s: 10.0,
            corner_sigma_px: 0.5,
            look_s: 0.3,
            lost_m: 1.0,
        }
    }
}

/// A possible gaze target.
#[derive(Debug, Clone, Copy)]
pub struct GazeCandidate<'a> {
    /// Number of the landmark.
    pub landmark: LandmarkId,
    /// Place of the landmark, map frame.
    pub place: &'a LandmarkPlace,
    /// Its visibility area.
    pub visible: &'a VisibilityMap,
    /// Saliency of its model, 0 to 1 (method 9).
    pub saliency: f64,
    /// Visibility confidence `v_c` of its model, from 0 (method 9).
    pub v_c: f64,
}

/// The pan-tilt unit and its present direction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PanTiltUnit {
    /// Position of the camera in the robot frame, metres.
    pub camera_m: [f64; 3],
    /// Present pan, radians, left positive.
    pub pan_rad: f64,
    /// Present tilt, radians, up positive.
    pub tilt_rad: f64,
    /// Speed of pan and tilt, rad/s.
    pub rate_radps: f64,
}

impl Default for PanTiltUnit {
    fn default() -> Self {
        Self { camera_m: [0.0, 0.0, 1.2], pan_rad: 0.0, tilt_rad: 0.0, rate_radps: 1.0 }
    }
}

impl PanTiltUnit {
    /// Refuses numbers that are not finite or out of range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        for value in self.camera_m {
            check::within("head.camera_m", value, -10.0, 10.0)?;
        }
        check::within("head.pan_rad", self.pan_rad, -10.0, 10.0)?;
        check::within("head.tilt_rad", self.tilt_rad, -1.6, 1.6)?;
        check::within("head.rate_radps", self.rate_radps, 0.01, 100.0)
    }
}

/// A possible target within the unit's range, with pan and tilt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GazeTarget {
    /// Number of the landmark.
    pub landmark: LandmarkId,
    /// Pan that centres it, radians, left positive.
    pub pan_rad: f64,
    /// Tilt that centres it, radians, up positive.
    pub tilt_rad: f64,
    /// Utility by the requested criterion.
    pub utility: f64,
    /// Probability that it is visible, 0 to 1.
    pub probability: f64,
    /// Distance of the camera to the boundary of its visibility area, inside, metres.
    pub margin_m: f64,
    /// Expected information gain, nats; infinite where the pose is unknown.
    pub gain_nats: f64,
    /// Distance on the floor, metres.
    pub range_m: f64,
    /// Angle of view against its normal, radians.
    pub incidence_rad: f64,
}

/// What to do with the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GazeAction {
    /// Point at this landmark.
    Landmark(GazeTarget),
    /// No landmark is visible: point along the path.
    Ahead,
    /// No landmark is visible and the pose is uncertain: sweep.
    Sweep,
}

/// Candidates that are probably visible and within the range of the unit, by falling utility, then
/// by number.
pub fn rank(
    pose: &Pose2Covariance,
    targets: &[GazeCandidate<'_>],
    viewer: &PanTiltCamera,
    head: &PanTiltUnit,
    p: &GazeParams,
) -> Result<Vec<GazeTarget>, OutOfRange> {
    pose.check()?;
    viewer.check()?;
    head.check()?;
    let camera = Vector3::from(head.camera_m);
    let draws = PoseDraws::new(pose, camera.xy());
    let mut ranked: Vec<GazeTarget> =
        targets.iter().filter_map(|t| choice(pose, &draws, t, viewer, head, p)).collect();
    ranked.sort_by(|a, b| b.utility.total_cmp(&a.utility).then(a.landmark.cmp(&b.landmark)));
    Ok(ranked)
}

fn choice(
    pose: &Pose2Covariance,
    draws: &PoseDraws,
    target: &GazeCandidate<'_>,
    viewer: &PanTiltCamera,
    head: &PanTiltUnit,
    p: &GazeParams,
) -> Option<GazeTarget> {
    let probability = target.visible.probability(draws);
    if probability <= p.min_probability {
        return None;
    }
    let camera = draws.mean();
    let (pan_rad, tilt_rad, range_m) = aim(pose, &camera, head.camera_m[2], target.place);
    let reachable = |angle: f64, [low, high]: [f64; 2]| (low..=high).contains(&angle);
    if !reachable(pan_rad, viewer.pan_rad) || !reachable(tilt_rad, viewer.tilt_rad) {
        return None;
    }
    let incidence_rad = target.place.incidence_rad(&Point3::new(camera.x, camera.y, head.camera_m[2]));
    let margin_m = target.visible.margin_m(&camera).max(0.0);
    let mounting =
        CameraExtrinsics::new(crate::extrinsics::pan_tilt(pan_rad, tilt_rad, head.camera_m.into())).ok()?;
    let gain_nats =
        information::gain_nats(pose, target.place, &mounting, viewer.focal_px, p.corner_sigma_px)?;
    let turn = (pan_rad - head.pan_rad).abs().max((tilt_rad - head.tilt_rad).abs());
    let utility = match p.criterion {
        Criterion::Product => {
            let margin = (margin_m / p.full_margin_m.max(f64::MIN_POSITIVE)).min(1.0);
            probability * target.saliency * margin * (target.v_c / (1.0 + target.v_c))
        }
        Criterion::Information => probability * gain_nats / (turn / head.rate_radps + p.look_s.max(1e-3)),
    };
    Some(GazeTarget {
        landmark: target.landmark,
        pan_rad,
        tilt_rad,
        utility,
        probability,
        margin_m,
        gain_nats,
        range_m,
        incidence_rad,
    })
}

/// Pan, tilt and distance on the floor that centre a landmark from a camera position.
fn aim(
    pose: &Pose2Covariance,
    camera: &Point2<f64>,
    camera_height_m: f64,
    place: &LandmarkPlace,
) -> (f64, f64, f64) {
    let to = Point2::new(place.x_m, place.y_m) - camera;
    let range = to.norm();
    let pan = wrap_rad(to.y.atan2(to.x) - pose.pose.theta_rad);
    (pan, (place.z_m - camera_height_m).atan2(range), range)
}

/// Keeps the target of one robot's gaze and the failures of its landmarks.
#[derive(Debug, Clone, Default)]
pub struct GazeController {
    current: Option<LandmarkId>,
    failures: u32,
    /// Damped landmarks, and until when (ns).
    damped: Vec<(LandmarkId, i64)>,
}

impl GazeController {
    /// Chooses the action among the targets of [`rank`]. `at_ns` is the robot's clock.
    pub fn choose(
        &mut self,
        at_ns: i64,
        ranked: &[GazeTarget],
        pose: &Pose2Covariance,
        p: &GazeParams,
    ) -> GazeAction {
        self.damped.retain(|(_, until)| *until > at_ns);
        let worth = |c: &GazeTarget| {
            let damped = self.damped.iter().any(|(id, _)| *id == c.landmark);
            c.utility * if damped { p.damping } else { 1.0 }
        };
        // Ties: the first in rank.
        let best = ranked.iter().rev().max_by(|a, b| worth(a).total_cmp(&worth(b)));
        let Some(best) = best.filter(|b| worth(b) > 0.0) else {
            self.current = None;
            let (x, y) = (pose.covariance[(0, 0)], pose.covariance[(1, 1)]);
            return if (x + y).sqrt() > p.lost_m { GazeAction::Sweep } else { GazeAction::Ahead };
        };
        let present = ranked.iter().find(|c| Some(c.landmark) == self.current);
        let chosen = match present {
            Some(present) if worth(best) <= p.switch_ratio * worth(present) => present,
            _ => best,
        };
        if self.current != Some(chosen.landmark) {
            (self.current, self.failures) = (Some(chosen.landmark), 0);
        }
        GazeAction::Landmark(*chosen)
    }

    /// Reports whether the target was recognised.
    pub fn report_outcome(&mut self, at_ns: i64, landmark: LandmarkId, recognised: bool, p: &GazeParams) {
        if recognised {
            self.damped.retain(|(id, _)| *id != landmark);
        }
        if self.current != Some(landmark) {
            return;
        }
        self.failures = if recognised { 0 } else { self.failures + 1 };
        if self.failures >= p.failures.max(1) {
            self.failures = 0;
            self.current = None;
            self.damped.retain(|(id, _)| *id != landmark);
            if self.damped.len() >= MAX_DAMPED {
                self.damped.remove(0);
            }
            self.damped.push((landmark, at_ns.saturating_add((p.damped_s * 1e9) as i64)));
        }
    }
}

#[cfg(test)]
mod tests;
