//! Intrinsics monitor: residual statistics of fixes that expose wrong intrinsics (method 16).
//!
//! In: each fix with its observations, and each refusal. Out: the error of the focal length, the
//! fit of the corners, and a suspicion with its value. It changes nothing; a suspect camera must be
//! calibrated again by a person.

use crate::{
    extrinsics::CameraExtrinsics,
    localise::{
        fix::{Fix, LandmarkObservation},
        planar::Planar,
    },
    pose2::{Pose2, wrap_rad},
};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use vision::model::LandmarkId;

/// Most landmarks counted for one camera; later ones are left out.
pub const MAX_WATCHED: usize = 256;

/// Parameters of the intrinsics monitor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IntrinsicsMonitorParams {
    /// Tries before a suspicion is given.
    pub min_tries: u32,
    /// Landmarks before the focal length is suspected: the place of a single one may be wrong.
    pub min_landmarks: usize,
    /// Errors of the focal length below this share are accepted.
    pub focal_tolerance: f64,
    /// The error must exceed its standard deviation by this factor.
    pub focal_sigmas: f64,
    /// Observations of one landmark that count: further ones share the error of its place.
    pub looks_a_landmark: f64,
    /// Mean chi2 per degree of freedom above which corners do not fit.
    pub max_reduced_chi2: f64,
    /// Largest accepted share of tries refused by re-projection error.
    pub max_refused: f64,
    /// A fix counts only if the robot has moved this far since the last one, metres,
    pub step_m: f64,
    /// or has turned this far, radians.
    pub step_rad: f64,
}

impl Default for IntrinsicsMonitorParams {
    fn default() -> Self {
        Self {
            min_tries: 20,
            min_landmarks: 3,
            focal_tolerance: 0.02,
            focal_sigmas: 5.0,
            looks_a_landmark: 5.0,
            max_reduced_chi2: 4.0,
            max_refused: 0.5,
            step_m: 0.05,
            step_rad: 0.02,
        }
    }
}

/// Evidence of one fix on the focal length: derivative and curvature of half its chi2 by the
/// logarithm of the focal length, the pose refitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FocalEvidence {
    /// Negative derivative: positive where a longer focal length fits better.
    pub gradient: f64,
    /// Curvature, 0 or more.
    pub information: f64,
}

/// The evidence of one fix. `None` where the numbers carry no information.
pub fn focal_evidence(
    observations: &[LandmarkObservation<'_>],
    mounting: &CameraExtrinsics,
    pose: &Pose2,
) -> Option<FocalEvidence> {
    // Without the stated uncertainty of the intrinsics: it would absorb the error that is estimated
    // here.
    let problem = Planar::new(observations, mounting).exact_camera();
    let at = problem.linearise(pose)?;
    let weight = problem.weight(&at)?;
    // A longer focal length moves a corner away from the principal point.
    let mut by_focal = DVector::zeros(at.residual.len());
    for (i, observation) in observations.iter().enumerate() {
        let m = &observation.seen.measured;
        for (c, p) in m.corners_px.points().iter().enumerate() {
            let row = 8 * i + 2 * c;
            by_focal[row] = p.x - m.camera.cx_px - at.residual[row];
            by_focal[row + 1] = p.y - m.camera.cy_px - at.residual[row + 1];
        }
    }
    let jw: DMatrix<f64> = at.by_pose.transpose() * &weight;
    let h = (&jw * &at.by_pose).cholesky()?;
    let left = |v: &DVector<f64>| v - &at.by_pose * h.solve(&(&jw * v));
    let weighted = &weight * left(&by_focal);
    let (gradient, information) = (weighted.dot(&left(&at.residual)), weighted.dot(&by_focal));
    let good = gradient.is_finite() && information.is_finite() && information > 0.0;
    good.then_some(FocalEvidence { gradient, information })
}

/// Why a camera is suspect.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "reason", rename_all = "snake_case")]
pub enum Suspicion {
    /// The true focal length differs from the stated one by this share.
    Focal {
        /// True over stated, less 1; negative if shorter.
        error: f64,
        /// Standard deviation of `error`.
        sigma: f64,
    },
    /// The mean chi2 per degree of freedom is too large.
    Misfit {
        /// About 1 for right intrinsics.
        reduced_chi2: f64,
    },
    /// Too many tries gave no pose because of their re-projection error.
    Refused {
        /// Share of the tries, 0 to 1.
        share: f64,
    },
}

/// Residual statistics of a camera's fixes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct IntrinsicsMonitorState {
    /// Fixes and refusals counted.
    pub tries: u32,
    /// Of them, refused by re-projection error.
    pub refused: u32,
    /// Landmarks observed.
    pub landmarks: usize,
    /// Mean chi2 per degree of freedom of the fixes.
    pub reduced_chi2: Option<f64>,
    /// Estimated true over stated focal length, less 1.
    pub focal_error: Option<f64>,
    /// Standard deviation of `focal_error`.
    pub focal_sigma: Option<f64>,
    /// Set when the camera should be calibrated again.
    pub suspicion: Option<Suspicion>,
}

#[derive(Debug, Clone, Copy, Default)]
struct LandmarkResidual {
    observations: f64,
    gradient: f64,
    information: f64,
}

/// Monitors one camera with one set of intrinsics; create a new one when they change.
#[derive(Debug, Clone, Default)]
pub struct IntrinsicsMonitor {
    params: IntrinsicsMonitorParams,
    last: Option<Pose2>,
    tries: u32,
    refused: u32,
    chi2: f64,
    dof: f64,
    landmarks: BTreeMap<LandmarkId, LandmarkResidual>,
}

impl IntrinsicsMonitor {
    /// An empty monitor.
    pub fn new(params: IntrinsicsMonitorParams) -> Self {
        Self { params, ..Self::default() }
    }

    /// Adds a fix with its evidence. A fix from the same pose as the last one is not counted.
    pub fn add_fix(&mut self, fix: &Fix, evidence: Option<FocalEvidence>) {
        let pose = fix.pose.pose;
        let same = self.last.is_some_and(|last| {
            let far = (pose.x_m - last.x_m).hypot(pose.y_m - last.y_m) >= self.params.step_m;
            !far && wrap_rad(pose.theta_rad - last.theta_rad).abs() < self.params.step_rad
        });
        if same {
            return;
        }
        self.last = Some(pose);
        self.tries = self.tries.saturating_add(1);
        self.chi2 += fix.chi2;
        self.dof += fix.dof as f64;
        // The evidence of a frame with several landmarks counts for the first: they are observed
        // together.
        let (Some(evidence), Some(landmark)) = (evidence, fix.landmarks.first()) else { return };
        if self.landmarks.len() >= MAX_WATCHED && !self.landmarks.contains_key(landmark) {
            return;
        }
        let sum = self.landmarks.entry(*landmark).or_default();
        sum.observations += 1.0;
        sum.gradient += evidence.gradient;
        sum.information += evidence.information;
    }

    /// Adds a recognised landmark whose re-projection error is above the gate for every floor pose.
    pub fn add_refusal(&mut self) {
        self.tries = self.tries.saturating_add(1);
        self.refused = self.refused.saturating_add(1);
    }

    /// Present state.
    pub fn state(&self) -> IntrinsicsMonitorState {
        let focal = self.focal();
        let reduced_chi2 = (self.dof > 0.0).then(|| self.chi2 / self.dof);
        IntrinsicsMonitorState {
            tries: self.tries,
            refused: self.refused,
            landmarks: self.landmarks.len(),
            reduced_chi2,
            focal_error: focal.map(|f| f.0),
            focal_sigma: focal.map(|f| f.1),
            suspicion: self.suspicion(focal, reduced_chi2),
        }
    }

    /// Error of the focal length and its standard deviation: mean over landmarks, each limited to a
    /// few observations.
    fn focal(&self) -> Option<(f64, f64)> {
        let (mut gradient, mut information) = (0.0, 0.0);
        for sum in self.landmarks.values() {
            let share = (self.params.looks_a_landmark / sum.observations).min(1.0);
            gradient += sum.gradient * share;
            information += sum.information * share;
        }
        (information > 0.0).then(|| (gradient / information, 1.0 / information.sqrt()))
    }

    fn suspicion(&self, focal: Option<(f64, f64)>, reduced_chi2: Option<f64>) -> Option<Suspicion> {
        let p = &self.params;
        if self.tries < p.min_tries {
            return None;
        }
        let share = f64::from(self.refused) / f64::from(self.tries);
        if share > p.max_refused {
            return Some(Suspicion::Refused { share });
        }
        if let Some((error, sigma)) = focal
            && self.landmarks.len() >= p.min_landmarks
            && error.abs() > p.focal_tolerance.max(p.focal_sigmas * sigma)
        {
            return Some(Suspicion::Focal { error, sigma });
        }
        reduced_chi2
            .filter(|chi2| *chi2 > p.max_reduced_chi2)
            .map(|reduced_chi2| Suspicion::Misfit { reduced_chi2 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        extrinsics::pan_tilt,
        localise::{FixRefusal, FixResult, LocaliseParams, robot_pose},
        place::{LandmarkPlace, PlaceSigmas},
    };
    use nalgebra::{Matrix2, Vector2, Vector3, Vector6};
    use vision::{
        frame::{Distortion, Intrinsics, IntrinsicsSigmas},
        geometry::Corners,
        pose::{
            LandmarkSize, landmark_pose,
            reprojection::{corner_points, perturbed, pixel},
        },
        random::Random,
    };

    const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.84 };

    /// State after a robot has observed six posters from many viewpoints by a camera of focal
    /// length `true_px`, stated as 600. Places and extrinsics have errors by their covariances.
    fn monitored(true_px: f64, frames: usize, seed: u64) -> IntrinsicsMonitorState {
        let mut random = Random::new(seed);
        let said = Intrinsics::new(600.0, 600.0, 320.0, 240.0, Distortion::None).unwrap();
        // A stated uncertainty does not switch the monitor off.
        let said = said.with_sigmas(IntrinsicsSigmas { focal_px: 30.0, center_px: 2.0 }).unwrap();
        let real = Intrinsics { fx_px: true_px, fy_px: true_px, ..said };
        let believed = CameraExtrinsics::new(pan_tilt(0.0, 0.0, Vector3::new(0.1, 0.0, 1.2))).unwrap();
        let e = believed.covariance.map_diagonal(f64::sqrt).map(|s| s * random.normal());
        let (turn, shift) = (e.fixed_rows::<3>(0).into(), e.fixed_rows::<3>(3).into());
        let mounted = perturbed(&believed.robot_from_camera, &turn, &shift);
        let mut monitor = IntrinsicsMonitor::default();
        let places: Vec<(LandmarkPlace, LandmarkPlace)> = (0..6)
            .map(|i| {
                let centre = Vector3::new(4.0 * f64::from(i), 0.0, 1.5);
                let place = LandmarkPlace::by_hand(centre, 1.6, SIZE, PlaceSigmas::default()).unwrap();
                let e: Vector6<f64> = place.covariance.map_diagonal(f64::sqrt).map(|s| s * random.normal());
                let size = LandmarkSize { width_m: 0.6 + e[4], height_m: 0.84 + e[5] };
                let (x_m, y_m, z_m) = (place.x_m + e[0], place.y_m + e[1], place.z_m + e[3]);
                let true_place = LandmarkPlace { x_m, y_m, z_m, theta_rad: 1.6 + e[2], size, ..place };
                (place, true_place)
            })
            .collect();
        for frame in 0..frames {
            let (place, true_place) = &places[frame % 6];
            let (d, psi) = (random.range(1.5, 4.0), random.range(-60.0, 60.0).to_radians());
            let a = place.theta_rad + psi;
            let truth =
                Pose2::new(place.x_m + d * a.cos(), place.y_m + d * a.sin(), a + std::f64::consts::PI);
            let view = mounted.inverse() * truth.to_isometry3().inverse() * true_place.map_from_landmark();
            let points = corner_points(&true_place.size).map(|p| {
                pixel(&view, &p, &real).unwrap() + Vector2::new(random.normal(), random.normal()) * 0.5
            });
            let claimed = [Matrix2::identity() * 0.25; 4];
            let seen = landmark_pose(&Corners::new(points).unwrap(), &claimed, SIZE, &said).unwrap();
            let observations =
                [LandmarkObservation { landmark: LandmarkId(frame as u64 % 6), seen: &seen, place }];
            match robot_pose(&observations, &believed, None, &LocaliseParams::default()).unwrap() {
                FixResult::Fixed(fix) => {
                    monitor.add_fix(&fix, focal_evidence(&observations, &believed, &fix.pose.pose));
                }
                FixResult::Refused(FixRefusal::ReprojectionError { .. }) => monitor.add_refusal(),
                FixResult::Ambiguous(_) | FixResult::Refused(_) => {}
            }
        }
        monitor.state()
    }

    #[test]
    fn only_wrong_intrinsics_are_suspected() {
        for seed in 0..20 {
            let right = monitored(600.0, 120, seed);
            assert_eq!(right.suspicion, None, "{seed}: {right:?}");
            assert!(right.focal_error.unwrap().abs() < 4.0 * right.focal_sigma.unwrap(), "{right:?}");
            for share in [0.92, 1.08] {
                let state = monitored(600.0 * share, 120, seed);
                assert!(state.suspicion.is_some(), "{seed} {share}: {state:?}");
                if let Some(Suspicion::Focal { error, sigma }) = state.suspicion {
                    assert!((error - (share - 1.0)).abs() < 6.0 * sigma + 0.02, "{state:?}");
                }
            }
        }
        // A camera of half the focal length gives no pose at all.
        let state = monitored(300.0, 60, 1);
        assert!(state.suspicion.is_some(), "{state:?}");
    }

    #[test]
    fn nothing_is_suspected_before_enough_observations() {
        assert_eq!(monitored(660.0, 10, 3).suspicion, None);
        let mut monitor = IntrinsicsMonitor::default();
        for _ in 0..19 {
            monitor.add_refusal();
        }
        assert_eq!(monitor.state().suspicion, None);
        monitor.add_refusal();
        assert_eq!(monitor.state().suspicion, Some(Suspicion::Refused { share: 1.0 }));
    }
}
