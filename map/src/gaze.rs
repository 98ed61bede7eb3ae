//! Where to look: the landmark that is worth most from an uncertain pose, and the pan and tilt that centre it (method 14).
//!
//! In: the robot's pose, what is known of each landmark, the pan-tilt unit. Out: every landmark that can be looked at with
//! its worth, best first, or the advice to look ahead or about. [`Gaze`] keeps to one landmark until another is clearly
//! better or looking fails.

mod information;

use crate::{
    check::{self, OutOfRange},
    mounting::Mounting,
    place::LandmarkPlace,
    pose2::{Pose2Covariance, wrap_rad},
    visibility::{PoseDraws, Viewer, VisibilityMap},
};
use nalgebra::{Point2, Point3, Vector3};
use serde::{Deserialize, Serialize};
use vision::model::LandmarkId;

/// Most landmarks whose failures are remembered.
pub const MAX_DAMPED: usize = 64;

/// By what a landmark is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// The paper's product: probability, saliency, margin, visibility confidence.
    #[default]
    Product,
    /// Expected gain of information on the pose, by the time it takes to look.
    Information,
}

/// Knobs of the choice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GazeParams {
    /// By what.
    pub criterion: Criterion,
    /// Landmarks that are seen less probably are left out.
    pub min_probability: f64,
    /// Distance to the boundary of the visibility area from which on being further inside is worth no more.
    pub full_margin_m: f64,
    /// Another landmark must be worth this many times the present one.
    pub switch_ratio: f64,
    /// So many failures in a row make a landmark worth less...
    pub failures: u32,
    /// ...by this factor...
    pub damping: f64,
    /// ...for so long.
    pub damped_s: f64,
    /// Expected error of a corner, pixels.
    pub corner_sigma_px: f64,
    /// Time to settle, expose and recognise.
    pub look_s: f64,
    /// With the position known worse than this and nothing to look at, the advice is to look about.
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

/// A landmark that might be looked at.
#[derive(Debug, Clone, Copy)]
pub struct Target<'a> {
    /// Which.
    pub landmark: LandmarkId,
    /// Where it hangs.
    pub place: &'a LandmarkPlace,
    /// From where it is seen.
    pub visible: &'a VisibilityMap,
    /// Saliency of its model, 0 to 1 (method 9).
    pub saliency: f64,
    /// Visibility confidence `v_c` of its model, from 0 (method 9).
    pub v_c: f64,
}

/// The pan-tilt unit and where it looks now.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Head {
    /// Camera in the robot frame, metres.
    pub camera_m: [f64; 3],
    /// Present pan, left positive.
    pub pan_rad: f64,
    /// Present tilt, up positive.
    pub tilt_rad: f64,
    /// How fast it turns.
    pub rate_radps: f64,
}

impl Default for Head {
    fn default() -> Self {
        Self { camera_m: [0.0, 0.0, 1.2], pan_rad: 0.0, tilt_rad: 0.0, rate_radps: 1.0 }
    }
}

impl Head {
    /// Every number finite and in range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        for value in self.camera_m {
            check::within("head.camera_m", value, -10.0, 10.0)?;
        }
        check::within("head.pan_rad", self.pan_rad, -10.0, 10.0)?;
        check::within("head.tilt_rad", self.tilt_rad, -1.6, 1.6)?;
        check::within("head.rate_radps", self.rate_radps, 0.01, 100.0)
    }
}

/// A landmark that can be looked at, and how.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// Which.
    pub landmark: LandmarkId,
    /// Pan that centres it, left positive.
    pub pan_rad: f64,
    /// Tilt that centres it, up positive.
    pub tilt_rad: f64,
    /// What looking at it is worth by the criterion asked for.
    pub utility: f64,
    /// Probability that it is seen.
    pub probability: f64,
    /// Distance of the camera to the boundary of its visibility area, inside.
    pub margin_m: f64,
    /// Expected gain of information, nats; infinite where the pose is entirely unknown.
    pub gain_nats: f64,
    /// Distance on the floor.
    pub range_m: f64,
    /// Angle of view against its normal.
    pub incidence_rad: f64,
}

/// What to do with the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Look {
    /// Look at this landmark.
    Landmark(Choice),
    /// No landmark is in sight: look along the path.
    Ahead,
    /// None is in sight, and the pose is so uncertain that this says little: look about.
    Sweep,
}

/// Every landmark that is seen probably enough and within reach of the unit, most useful first; equal ones by number.
pub fn rank(
    pose: &Pose2Covariance,
    targets: &[Target<'_>],
    viewer: &Viewer,
    head: &Head,
    p: &GazeParams,
) -> Result<Vec<Choice>, OutOfRange> {
    pose.check()?;
    viewer.check()?;
    head.check()?;
    let camera = Vector3::from(head.camera_m);
    let draws = PoseDraws::new(pose, camera.xy());
    let mut ranked: Vec<Choice> =
        targets.iter().filter_map(|t| choice(pose, &draws, t, viewer, head, p)).collect();
    ranked.sort_by(|a, b| b.utility.total_cmp(&a.utility).then(a.landmark.cmp(&b.landmark)));
    Ok(ranked)
}

fn choice(
    pose: &Pose2Covariance,
    draws: &PoseDraws,
    target: &Target<'_>,
    viewer: &Viewer,
    head: &Head,
    p: &GazeParams,
) -> Option<Choice> {
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
    let mounting = Mounting::new(crate::mounting::pan_tilt(pan_rad, tilt_rad, head.camera_m.into())).ok()?;
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
    Some(Choice {
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

/// Pan, tilt and distance on the floor that centre a landmark for a camera at a place.
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

/// Keeps a robot's gaze steady: which landmark it is told to look at, and which have failed.
#[derive(Debug, Clone, Default)]
pub struct Gaze {
    current: Option<LandmarkId>,
    failures: u32,
    /// Landmarks that are worth less, until when.
    damped: Vec<(LandmarkId, i64)>,
}

impl Gaze {
    /// Where to look, of what [`rank`] found. `at_ns` is the robot's own time.
    pub fn choose(&mut self, at_ns: i64, ranked: &[Choice], pose: &Pose2Covariance, p: &GazeParams) -> Look {
        self.damped.retain(|(_, until)| *until > at_ns);
        let worth = |c: &Choice| {
            let damped = self.damped.iter().any(|(id, _)| *id == c.landmark);
            c.utility * if damped { p.damping } else { 1.0 }
        };
        // Ranked: of equal ones the first.
        let best = ranked.iter().rev().max_by(|a, b| worth(a).total_cmp(&worth(b)));
        let Some(best) = best.filter(|b| worth(b) > 0.0) else {
            self.current = None;
            let (x, y) = (pose.covariance[(0, 0)], pose.covariance[(1, 1)]);
            return if (x + y).sqrt() > p.lost_m { Look::Sweep } else { Look::Ahead };
        };
        let kept = ranked.iter().find(|c| Some(c.landmark) == self.current);
        let chosen = match kept {
            Some(kept) if worth(best) <= p.switch_ratio * worth(kept) => kept,
            _ => best,
        };
        if self.current != Some(chosen.landmark) {
            (self.current, self.failures) = (Some(chosen.landmark), 0);
        }
        Look::Landmark(*chosen)
    }

    /// Tells whether the landmark that was looked at was recognised.
    pub fn looked(&mut self, at_ns: i64, landmark: LandmarkId, recognised: bool, p: &GazeParams) {
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
