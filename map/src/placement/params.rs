//! Parameters of placement, and why a quad has no place.

use crate::check::OutOfRange;
use serde::{Deserialize, Serialize};
use vision::pose::PoseError;

/// Parameters of placement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlacementParams {
    /// A ray may meet a wall this far beyond the end of its segment, metres.
    pub margin_m: f64,
    /// Largest root mean square distance of the intersections from an upright rectangle, metres.
    pub max_rms_m: f64,
    /// Largest roll of the rectangle, radians.
    pub max_roll_rad: f64,
    /// Prior standard deviation of the roll: how level objects are hung, radians.
    pub roll_sigma_rad: f64,
    /// Gate on a further view: 99 % of chi2 with 4 degrees of freedom.
    pub gate_chi2: f64,
    /// Factor on the covariance of several views, for errors they share (method 11.5).
    pub inflation: f64,
}

impl Default for PlacementParams {
    fn default() -> Self {
        Self {
            margin_m: 0.3,
            max_rms_m: 0.05,
            max_roll_rad: 5.0_f64.to_radians(),
            roll_sigma_rad: 0.5_f64.to_radians(),
            gate_chi2: 13.277,
            inflation: 2.0,
        }
    }
}

/// Why a quad has no place.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlacementError {
    /// A pose, extrinsics or wall is out of range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// Corners, covariance or intrinsics are unusable.
    #[error(transparent)]
    Corners(#[from] PoseError),
    /// No wall is met by all four rays.
    #[error("no wall is met by all four corners")]
    NoWall,
    /// A nearer wall is met by some rays only.
    #[error("the quad reaches over the end of a wall")]
    Straddles,
    /// The intersections are not an upright rectangle of possible size: an open door, a board on an
    /// easel, another wall.
    #[error("not on this wall: no upright rectangle (rms {rms_m:.3} m, roll {roll_rad:.3} rad)")]
    NotOnWall {
        /// Root mean square distance of the intersections from the rectangle, metres.
        rms_m: f64,
        /// Roll of the rectangle, radians.
        roll_rad: f64,
    },
    /// The intersections are not a rectangle of possible size under this ceiling.
    #[error("not under this ceiling: no rectangle (rms {rms_m:.3} m)")]
    NotOnCeiling {
        /// Root mean square distance of the intersections from the rectangle, metres.
        rms_m: f64,
    },
    /// No view was given, or the views lie on different walls.
    #[error("the views do not share a wall")]
    NoView,
}
