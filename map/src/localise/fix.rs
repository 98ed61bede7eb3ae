//! Input and result of a fix: observations, nuisance parameters, the fix, refusals.

use crate::{
    place::{LandmarkPlace, SurveyId},
    pose_cell::PoseCell,
    pose2::Pose2Covariance,
};
use nalgebra::{Matrix3, Matrix3x6, Matrix6};
use vision::{model::LandmarkId, pose::LandmarkPose};

/// A recognised landmark with its measured pose and its place in the map.
#[derive(Debug, Clone, Copy)]
pub struct LandmarkObservation<'a> {
    /// Number of the landmark.
    pub landmark: LandmarkId,
    /// Pose of the landmark in the camera frame, with covariance.
    pub seen: &'a LandmarkPose,
    /// Place of the landmark, map frame.
    pub place: &'a LandmarkPlace,
}

/// A nuisance parameter: an error that several fixes share. A filter that takes it as independent
/// becomes overconfident.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum NuisanceKey {
    /// Place and size of a landmark: (x, y, theta, z, width, height), without what it shares.
    Landmark(LandmarkId),
    /// What all places of a survey share: six unit errors.
    Survey(SurveyId),
    /// Extrinsics of the camera: left perturbation (rotation, translation), robot frame.
    Extrinsics,
    /// Intrinsics of the camera: the first three of six are the errors of the focal length (as a
    /// share) and of the principal point (px).
    Camera,
    /// One wall, by the hash of its ends: the first two of six are the errors of its direction and
    /// offset.
    Wall(u64),
    /// All other walls of a square of the floor: the first three of six are unit errors of (x, y,
    /// theta).
    Walls(i32, i32),
    /// Error of a fix source in a pose cell beyond its claimed covariance, by reference runs: the
    /// first three of six are unit errors of (x, y, theta).
    Area(FixSource, PoseCell),
}

/// Effect of a nuisance parameter on a fix:
/// `estimated - true pose = jacobian * (true - assumed value)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Nuisance {
    /// The nuisance parameter.
    pub key: NuisanceKey,
    /// Derivative of (x, y, theta) by it.
    pub jacobian: Matrix3x6<f64>,
    /// Covariance of the nuisance parameter.
    pub covariance: Matrix6<f64>,
}

/// What resolved the planar ambiguity of a fix.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AmbiguityResolvedBy {
    /// There was one solution only.
    Single,
    /// The corners and the known extrinsics (camera height, tilt, no roll): the other solution does
    /// not fit them.
    Image,
    /// The prior pose.
    Prior,
}

/// The sensor that a fix was made from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FixSource {
    /// Recognised landmarks.
    Landmarks,
    /// A scan, matched to the map's walls near a known pose: it corrects a pose and never starts
    /// one.
    Laser,
}

/// The robot's pose by one frame or one scan.
#[derive(Debug, Clone, PartialEq)]
pub struct Fix {
    /// The sensor it was made from.
    pub modality: FixSource,
    /// `map_from_robot` with the covariance of all errors: corners, places, extrinsics, intrinsics.
    pub pose: Pose2Covariance,
    /// The part of the covariance that is independent from frame to frame (corners).
    pub noise: Matrix3<f64>,
    /// The parts that several fixes share.
    pub nuisances: Vec<Nuisance>,
    /// The landmarks it rests on.
    pub landmarks: Vec<LandmarkId>,
    /// What resolved the planar ambiguity.
    pub decided_by: AmbiguityResolvedBy,
    /// Weighted squared re-projection error.
    pub chi2: f64,
    /// Degrees of freedom of `chi2`: 8 for each landmark, less 3.
    pub dof: usize,
}

/// Why recognised landmarks gave no pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FixRefusal {
    // Departs from method 13.6, which gates |z|, |roll| and |pitch| of the pose in space. These are
    // the same residuals, weighted by the information of the corners, which is small from afar and
    // large from near.
    /// Re-projection error above the gate for every floor pose: camera height, tilt or the
    /// landmark's place is wrong.
    ReprojectionError {
        /// Weighted squared residual of the best solution.
        chi2: f64,
        /// Largest accepted value.
        limit: f64,
    },
    /// Every solution is outside the gate of the prior.
    Prior {
        /// The nearest solution.
        nearest: Pose2Covariance,
        /// Its squared Mahalanobis distance.
        distance2: f64,
        /// Largest accepted value.
        limit: f64,
    },
    /// The camera would be behind the landmark's wall.
    BehindWall,
    /// The landmarks contradict one another.
    Disagree {
        /// Weighted squared residual of the best solution.
        chi2: f64,
        /// Largest accepted value.
        limit: f64,
    },
    /// The corners do not determine the pose.
    Degenerate,
}

/// Result of localisation by one frame. A pose is given only when exactly one solution is left.
#[derive(Debug, Clone, PartialEq)]
pub enum FixResult {
    /// One solution.
    Fixed(Box<Fix>),
    /// Several solutions, best first. None may be used without further knowledge.
    Ambiguous(Vec<Fix>),
    /// No solution.
    Refused(FixRefusal),
}
