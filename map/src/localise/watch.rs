//! Whether a camera is what it says it is, from the residuals of the fixes it gives (method 16).
//!
//! In: each fix with what it rests on, and each refusal. Out: how far the focal length seems off, how well corners fit,
//! and a suspicion with its number. It changes nothing: a suspect camera is for people to calibrate again.

use super::{Fix, Sighting, planar::Planar};
use crate::{
    mounting::Mounting,
    pose2::{Pose2, wrap_rad},
};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use vision::model::LandmarkId;

/// Most landmarks that one camera is watched by; later ones are not counted.
pub const MAX_WATCHED: usize = 256;

/// Knobs of the watch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WatchParams {
    /// Tries before anything is said.
    pub min_tries: u32,
    /// Landmarks before anything is said of the focal length: the place of one may be wrong.
    pub min_landmarks: usize,
    /// A focal length off by less than this share is no matter.
    pub focal_tolerance: f64,
    /// Its error must stand out from its uncertainty by this factor.
    pub focal_sigmas: f64,
    /// Looks at one landmark that count for its evidence: more of them share the error of its place.
    pub looks_a_landmark: f64,
    /// Mean chi2 a degree of freedom, from which corners do not fit.
    pub max_reduced_chi2: f64,
    /// Share of the tries that may be refused because no upright robot on the floor sees the corners there.
    pub max_refused: f64,
    /// A look from nearer than this (metres) and
    pub step_m: f64,
    /// less turned than this since the last is the same look.
    pub step_rad: f64,
}

impl Default for WatchParams {
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

/// What one fix says of the focal length: derivative and curvature of half its chi2 by the logarithm of the focal
/// length, the pose refitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FocalEvidence {
    /// Downhill derivative: positive where a longer focal length fits better.
    pub gradient: f64,
    /// Curvature, not negative.
    pub information: f64,
}

/// The evidence of one fix. `None` where its numbers say nothing.
pub fn focal_evidence(
    sightings: &[Sighting<'_>],
    mounting: &Mounting,
    pose: &Pose2,
) -> Option<FocalEvidence> {
    // What is looked for must not be explained away by what is said to be uncertain.
    let problem = Planar::new(sightings, mounting).exact_camera();
    let at = problem.linearise(pose)?;
    let weight = problem.weight(&at)?;
    // A longer focal length moves a corner away from the principal point.
    let mut by_focal = DVector::zeros(at.residual.len());
    for (i, sighting) in sightings.iter().enumerate() {
        let m = &sighting.seen.measured;
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
    /// The true focal length seems longer than stated by this share (shorter: negative), with standard deviation.
    Focal {
        /// True over stated, less 1.
        error: f64,
        /// Of it.
        sigma: f64,
    },
    /// Corners do not fit by this mean chi2 a degree of freedom.
    Misfit {
        /// About 1 where all is well.
        reduced_chi2: f64,
    },
    /// So many of the tries gave no pose because the corners cannot be seen from a robot on the floor.
    Refused {
        /// Share of the tries.
        share: f64,
    },
}

/// What is known of a camera's intrinsics from its use.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WatchState {
    /// Looks counted.
    pub tries: u32,
    /// Of them, refused because no robot on the floor sees the corners there.
    pub refused: u32,
    /// Landmarks looked at.
    pub landmarks: usize,
    /// Mean chi2 a degree of freedom of the fixes.
    pub reduced_chi2: Option<f64>,
    /// True over stated focal length, less 1, by the residuals.
    pub focal_error: Option<f64>,
    /// Its standard deviation.
    pub focal_sigma: Option<f64>,
    /// Set when the intrinsics should be looked at.
    pub suspicion: Option<Suspicion>,
}

#[derive(Debug, Clone, Copy, Default)]
struct OfLandmark {
    looks: f64,
    gradient: f64,
    information: f64,
}

/// The watch over one camera with one set of intrinsics: a new one when they change.
#[derive(Debug, Clone, Default)]
pub struct CameraWatch {
    params: WatchParams,
    last: Option<Pose2>,
    tries: u32,
    refused: u32,
    chi2: f64,
    dof: f64,
    landmarks: BTreeMap<LandmarkId, OfLandmark>,
}

impl CameraWatch {
    /// Nothing seen yet.
    pub fn new(params: WatchParams) -> Self {
        Self { params, ..Self::default() }
    }

    /// A fix with its evidence. Looks from where the last one was are not counted.
    pub fn fixed(&mut self, fix: &Fix, evidence: Option<FocalEvidence>) {
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
        // Evidence of several landmarks in one frame is booked under the first: they are looked at together.
        let (Some(evidence), Some(landmark)) = (evidence, fix.landmarks.first()) else { return };
        if self.landmarks.len() >= MAX_WATCHED && !self.landmarks.contains_key(landmark) {
            return;
        }
        let sum = self.landmarks.entry(*landmark).or_default();
        sum.looks += 1.0;
        sum.gradient += evidence.gradient;
        sum.information += evidence.information;
    }

    /// A landmark was recognised, but no robot on the floor sees it like this.
    pub fn refused(&mut self) {
        self.tries = self.tries.saturating_add(1);
        self.refused = self.refused.saturating_add(1);
    }

    /// What is known so far.
    pub fn state(&self) -> WatchState {
        let focal = self.focal();
        let reduced_chi2 = (self.dof > 0.0).then(|| self.chi2 / self.dof);
        WatchState {
            tries: self.tries,
            refused: self.refused,
            landmarks: self.landmarks.len(),
            reduced_chi2,
            focal_error: focal.map(|f| f.0),
            focal_sigma: focal.map(|f| f.1),
            suspicion: self.suspicion(focal, reduced_chi2),
        }
    }

    /// Error of the focal length and its standard deviation: means of the landmarks, each worth a few looks at most.
    fn focal(&self) -> Option<(f64, f64)> {
        let (mut gradient, mut information) = (0.0, 0.0);
        for sum in self.landmarks.values() {
            let share = (self.params.looks_a_landmark / sum.looks).min(1.0);
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
        localise::{FixRefusal, LocaliseParams, RobotFix, robot_pose},
        mounting::pan_tilt,
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

    /// A robot that looks at six posters from many places, through a camera whose focal length is `true_px` but said to
    /// be 600: the watch at the end. Places and mounting are wrong by as much as they claim.
    fn watched(true_px: f64, looks: usize, seed: u64) -> WatchState {
        let mut random = Random::new(seed);
        let said = Intrinsics::new(600.0, 600.0, 320.0, 240.0, Distortion::None).unwrap();
        // Whoever says that it may be wrong is watched all the same.
        let said = said.with_sigmas(IntrinsicsSigmas { focal_px: 30.0, center_px: 2.0 }).unwrap();
        let real = Intrinsics { fx_px: true_px, fy_px: true_px, ..said };
        let believed = Mounting::new(pan_tilt(0.0, 0.0, Vector3::new(0.1, 0.0, 1.2))).unwrap();
        let e = believed.covariance.map_diagonal(f64::sqrt).map(|s| s * random.normal());
        let (turn, shift) = (e.fixed_rows::<3>(0).into(), e.fixed_rows::<3>(3).into());
        let mounted = perturbed(&believed.robot_from_camera, &turn, &shift);
        let mut watch = CameraWatch::default();
        let places: Vec<(LandmarkPlace, LandmarkPlace)> = (0..6)
            .map(|i| {
                let centre = Vector3::new(4.0 * f64::from(i), 0.0, 1.5);
                let place = LandmarkPlace::by_hand(centre, 1.6, SIZE, PlaceSigmas::default()).unwrap();
                let e: Vector6<f64> = place.covariance.map_diagonal(f64::sqrt).map(|s| s * random.normal());
                let size = LandmarkSize { width_m: 0.6 + e[4], height_m: 0.84 + e[5] };
                let (x_m, y_m, z_m) = (place.x_m + e[0], place.y_m + e[1], place.z_m + e[3]);
                let hung = LandmarkPlace { x_m, y_m, z_m, theta_rad: 1.6 + e[2], size, ..place };
                (place, hung)
            })
            .collect();
        for look in 0..looks {
            let (place, hung) = &places[look % 6];
            let (d, psi) = (random.range(1.5, 4.0), random.range(-60.0, 60.0).to_radians());
            let a = place.theta_rad + psi;
            let truth =
                Pose2::new(place.x_m + d * a.cos(), place.y_m + d * a.sin(), a + std::f64::consts::PI);
            let view = mounted.inverse() * truth.to_isometry3().inverse() * hung.map_from_landmark();
            let points = corner_points(&hung.size).map(|p| {
                pixel(&view, &p, &real).unwrap() + Vector2::new(random.normal(), random.normal()) * 0.5
            });
            let claimed = [Matrix2::identity() * 0.25; 4];
            let seen = landmark_pose(&Corners::new(points).unwrap(), &claimed, SIZE, &said).unwrap();
            let sightings = [Sighting { landmark: LandmarkId(look as u64 % 6), seen: &seen, place }];
            match robot_pose(&sightings, &believed, None, &LocaliseParams::default()).unwrap() {
                RobotFix::Fixed(fix) => {
                    watch.fixed(&fix, focal_evidence(&sightings, &believed, &fix.pose.pose));
                }
                RobotFix::Refused(FixRefusal::Room { .. }) => watch.refused(),
                RobotFix::Ambiguous(_) | RobotFix::Refused(_) => {}
            }
        }
        watch.state()
    }

    #[test]
    fn a_right_camera_is_left_in_peace_and_a_wrong_one_is_flagged() {
        for seed in 0..20 {
            let right = watched(600.0, 120, seed);
            assert_eq!(right.suspicion, None, "{seed}: {right:?}");
            assert!(right.focal_error.unwrap().abs() < 4.0 * right.focal_sigma.unwrap(), "{right:?}");
            for share in [0.92, 1.08] {
                let state = watched(600.0 * share, 120, seed);
                assert!(state.suspicion.is_some(), "{seed} {share}: {state:?}");
                if let Some(Suspicion::Focal { error, sigma }) = state.suspicion {
                    assert!((error - (share - 1.0)).abs() < 6.0 * sigma + 0.02, "{state:?}");
                }
            }
        }
        // A camera of half the focal length gives no pose at all.
        let state = watched(300.0, 60, 1);
        assert!(state.suspicion.is_some(), "{state:?}");
    }

    #[test]
    fn nothing_is_said_before_enough_was_seen() {
        assert_eq!(watched(660.0, 10, 3).suspicion, None);
        let mut watch = CameraWatch::default();
        for _ in 0..19 {
            watch.refused();
        }
        assert_eq!(watch.state().suspicion, None);
        watch.refused();
        assert_eq!(watch.state().suspicion, Some(Suspicion::Refused { share: 1.0 }));
    }
}
