//! What may be observed: one of several landmarks, each with its relative pose.

use crate::{place::LandmarkPlace, pose2::Pose2, visibility::VisibilityMap};
use nalgebra::Matrix3;

/// Most landmarks that one observation may be.
pub const MAX_MEMBERS: usize = 256;

/// A landmark that an observation may be of.
#[derive(Debug, Clone, Copy)]
pub struct PossibleLandmark<'a> {
    /// Place of the landmark, map frame.
    pub place: &'a LandmarkPlace,
    /// Its visibility area; without it the landmark is visible from everywhere.
    pub visible: Option<&'a VisibilityMap>,
    /// Probability of this landmark by appearance alone. All members and clutter sum to 1.
    pub probability: f64,
}

/// The pose of an observed object in the robot frame: centre, and direction of its normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelativeObservation {
    /// `robot_from_landmark` on the floor.
    pub robot_from_landmark: Pose2,
    /// Covariance over (x, y, theta).
    pub covariance: Matrix3<f64>,
}

/// An observation assigned to one landmark.
#[derive(Debug, Clone, Copy)]
pub struct AssociationHypothesis<'a> {
    /// The relative pose for this landmark's size and height.
    pub glimpse: RelativeObservation,
    /// The landmark.
    pub member: PossibleLandmark<'a>,
}
