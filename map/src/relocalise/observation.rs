//! What may be observed: one of several landmarks, each with its relative pose.

use crate::{place::LandmarkPlace, pose2::Pose2, visibility::VisibilityMap};
use nalgebra::Matrix3;

/// Most landmarks that one sighting may be.
pub const MAX_MEMBERS: usize = 256;

/// A landmark that a sighting may be of.
#[derive(Debug, Clone, Copy)]
pub struct PossibleLandmark<'a> {
    /// Where it hangs.
    pub place: &'a LandmarkPlace,
    /// From where it is seen; without it from everywhere.
    pub visible: Option<&'a VisibilityMap>,
    /// Probability that the sighting is of this one, by its looks alone. All members and clutter come to 1.
    pub probability: f64,
}

/// Something that was seen: the landmark's centre and the direction of its normal in the robot frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelativeObservation {
    /// `robot_from_landmark` on the floor.
    pub robot_from_landmark: Pose2,
    /// Of (x, y, theta).
    pub covariance: Matrix3<f64>,
}

/// A landmark that something may be, and how it was seen if it is.
#[derive(Debug, Clone, Copy)]
pub struct AssociationHypothesis<'a> {
    /// Seen so.
    pub glimpse: RelativeObservation,
    /// What it would be.
    pub member: PossibleLandmark<'a>,
}
