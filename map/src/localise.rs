//! From landmarks of known place, seen by a camera of known mounting, to the robot's pose on the floor (method 13.6).
//!
//! In: sightings, the mounting, perhaps a prior. Out: one pose with its covariance, or that several are left, or why
//! there is none. The robot stands upright on the floor, so three numbers are fitted to all corners of all landmarks at
//! once (method 13.6, variant b). It never picks a solution that image, wall and prior leave undecided.

mod planar;
mod posterior;
pub(crate) mod predict;
mod solve;
pub mod watch;

use crate::{
    areas::Cell,
    check::{self, OutOfRange},
    mounting::Mounting,
    place::LandmarkPlace,
    pose2::Pose2Covariance,
};
use nalgebra::{Matrix3, Matrix3x6, Matrix6};
use serde::{Deserialize, Serialize};
use vision::{model::LandmarkId, pose::LandmarkPose};

/// Most sightings used in one fix; of more, those with the largest image.
pub const MAX_SIGHTINGS: usize = 8;

/// Knobs of localisation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LocaliseParams {
    /// Two solutions whose chi2 (image, and prior where there is one) differ by less are ambiguous. 16 leaves a wrong choice 3e-5 at worst (see
    /// `vision::pose::AMBIGUOUS_CHI2`).
    pub ambiguous_chi2: f64,
    /// Gate on chi2 per degree of freedom: no upright robot on the floor sees the corners there. 10 allows corner
    /// errors three times as large as claimed; the covariance is scaled accordingly.
    pub max_reduced_chi2: f64,
    /// Gate on the squared Mahalanobis distance to the prior: 99 % of chi2 with 3 degrees of freedom.
    pub prior_gate: f64,
    /// Two minima with a lower barrier between them are one wide one.
    pub merge_chi2: f64,
}

impl Default for LocaliseParams {
    fn default() -> Self {
        Self {
            ambiguous_chi2: 16.0,
            max_reduced_chi2: 10.0,
            prior_gate: crate::gate::CHI2_3_99,
            merge_chi2: 4.0,
        }
    }
}

/// A recognised landmark and where the map says it hangs.
#[derive(Debug, Clone, Copy)]
pub struct Sighting<'a> {
    /// Which one.
    pub landmark: LandmarkId,
    /// How it was seen.
    pub seen: &'a LandmarkPose,
    /// Where it hangs.
    pub place: &'a LandmarkPlace,
}

/// A source of error that stays the same from fix to fix: fusing fixes as if it did not makes a filter overconfident.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum NuisanceKey {
    /// The place and size of a landmark: (x, y, theta, z, width, height).
    Landmark(LandmarkId),
    /// The mounting of the camera: left perturbation (rotation, translation), robot frame.
    Mounting,
    /// The camera's intrinsics: the first three of six are the errors of its focal length (as a share) and of its
    /// principal point (px).
    Camera,
    /// A wall, by a number of its own: the first two of six are the errors of its direction and offset.
    Wall(u64),
    /// All other walls about a place, by its square of the floor: the first three of six are unit errors of (x, y,
    /// theta).
    Walls(i32, i32),
    /// What a modality gets wrong in a place beyond what it says, as runs have shown: the first three of six are unit errors
    /// of (x, y, theta).
    Area(Modality, Cell),
}

/// How a lasting error moves a fix: `estimated - true pose = jacobian * (true - assumed value)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Nuisance {
    /// Whose error.
    pub key: NuisanceKey,
    /// Derivative of (x, y, theta) by it.
    pub jacobian: Matrix3x6<f64>,
    /// Its covariance.
    pub covariance: Matrix6<f64>,
}

/// What told the two solutions of the planar ambiguity apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DecidedBy {
    /// There was one solution only.
    Single,
    /// The corners and the known mounting (camera height, tilt, no roll): the other does not fit them.
    Image,
    /// The prior.
    Prior,
}

/// What a fix was made from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Modality {
    /// Recognised landmarks.
    Landmarks,
    /// A scan, laid on the map's walls near a pose that was known before: it corrects, and can never start one.
    Laser,
}

/// The robot's pose from one frame, or one scan.
#[derive(Debug, Clone, PartialEq)]
pub struct Fix {
    /// What it was made from.
    pub modality: Modality,
    /// `map_from_robot` with everything that is uncertain: corners, places of landmarks, mounting, intrinsics.
    pub pose: Pose2Covariance,
    /// The part of the covariance that is new in every frame (corners).
    pub noise: Matrix3<f64>,
    /// The parts that last.
    pub nuisances: Vec<Nuisance>,
    /// The landmarks it rests on.
    pub landmarks: Vec<LandmarkId>,
    /// How the planar ambiguity was resolved.
    pub decided_by: DecidedBy,
    /// Weighted squared residual of the corners.
    pub chi2: f64,
    /// Its degrees of freedom: 8 a landmark less 3.
    pub dof: usize,
}

/// Why recognised landmarks gave no pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FixRefusal {
    /// No upright robot on the floor sees the corners there: camera height, tilt or the landmark's place is wrong.
    // Departs from method 13.6, which gates |z|, |roll| and |pitch| of the pose in space: the same residuals, but weighed
    // by what the corners know of them, which is little from afar and very much from near.
    Room {
        /// Weighted squared residual of the best try.
        chi2: f64,
        /// The gate.
        limit: f64,
    },
    /// The prior rules every solution out.
    Prior {
        /// Squared Mahalanobis distance of the nearest solution.
        distance2: f64,
        /// The gate.
        limit: f64,
    },
    /// The robot would stand behind the wall.
    Side,
    /// The landmarks contradict one another.
    Disagree {
        /// Weighted squared residual of the best try.
        chi2: f64,
        /// The gate.
        limit: f64,
    },
    /// The corners do not fix the pose.
    Degenerate,
}

/// What a frame says of the robot's pose. There is a pose only when exactly one solution is left.
#[derive(Debug, Clone, PartialEq)]
pub enum RobotFix {
    /// The pose.
    Fixed(Box<Fix>),
    /// Several solutions are left; best first. None of them may be used without more knowledge.
    Ambiguous(Vec<Fix>),
    /// No solution is left.
    Refused(FixRefusal),
}

/// The robot's pose from the landmarks of one frame. Errors name an input that is out of range.
pub fn robot_pose(
    sightings: &[Sighting<'_>],
    mounting: &Mounting,
    prior: Option<&Pose2Covariance>,
    p: &LocaliseParams,
) -> Result<RobotFix, OutOfRange> {
    check::within("sightings", sightings.len() as f64, 1.0, f64::MAX)?;
    mounting.check()?;
    for sighting in sightings {
        sighting.place.check()?;
    }
    if let Some(prior) = prior {
        prior.check()?;
    }
    let mut used = sightings.to_vec();
    // Largest first; stable, so equal ones stay in order.
    used.sort_by(|a, b| {
        let area = |s: &Sighting<'_>| s.seen.measured.corners_px.area_px2();
        area(b).total_cmp(&area(a))
    });
    used.truncate(MAX_SIGHTINGS);
    Ok(solve::solve(&used, mounting, prior, p))
}

#[cfg(test)]
mod tests;
