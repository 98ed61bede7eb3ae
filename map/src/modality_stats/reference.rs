//! Where a robot really was, as somebody else knows: a survey, a camera above, a slower drive. In: poses with times of the
//! robot's clock. Out: the pose at any time between, none across gaps.

use crate::{
    check::{self, OutOfRange},
    pose2::{Pose2, wrap_rad},
};
use nalgebra::Vector3;

/// Most poses of a reference.
pub const MAX_REFERENCE: usize = 200_000;
/// Poses further apart are not interpolated.
const MAX_GAP_NS: i64 = 1_000_000_000;

/// A known path, `map_from_robot` by time.
#[derive(Debug, Clone, PartialEq)]
pub struct ReferenceTrajectory {
    poses: Vec<(i64, Pose2)>,
    /// Standard deviation of its positions, metres.
    pub(super) sigma_m: f64,
    /// Of its headings, radians.
    pub(super) sigma_rad: f64,
}

/// Why poses are no reference.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ReferenceError {
    /// A pose or standard deviation is out of range.
    #[error("pose {index}: {error}")]
    Pose {
        /// Which, from 0.
        index: usize,
        /// What is wrong.
        error: OutOfRange,
    },
    /// A number that is not of one pose.
    #[error(transparent)]
    Range(#[from] OutOfRange),
    /// Times must rise.
    #[error("pose {index} is not later than the one before it")]
    Order {
        /// Which, from 0.
        index: usize,
    },
}

impl ReferenceTrajectory {
    /// From 2 to [`MAX_REFERENCE`] poses in order of time, ns of the robot's clock; standard deviations up to 1 m and 0.5
    /// rad.
    pub fn new(poses: Vec<(i64, Pose2)>, sigma_m: f64, sigma_rad: f64) -> Result<Self, ReferenceError> {
        check::within("poses", poses.len() as f64, 2.0, MAX_REFERENCE as f64)?;
        check::within("sigma_m", sigma_m, 0.0, 1.0)?;
        check::within("sigma_rad", sigma_rad, 0.0, 0.5)?;
        for (index, (_, pose)) in poses.iter().enumerate() {
            pose.check().map_err(|error| ReferenceError::Pose { index, error })?;
        }
        if let Some(before) = poses.windows(2).position(|pair| pair[1].0 <= pair[0].0) {
            return Err(ReferenceError::Order { index: before + 1 });
        }
        Ok(Self { poses, sigma_m, sigma_rad })
    }

    /// The pose at a time; none before, after, and within gaps of more than a second.
    pub fn at(&self, at_ns: i64) -> Option<Pose2> {
        let next = self.poses.partition_point(|(t, _)| *t < at_ns);
        let (to_ns, to) = self.poses.get(next)?;
        if *to_ns == at_ns {
            return Some(*to);
        }
        let (from_ns, from) = self.poses.get(next.checked_sub(1)?)?;
        let gap_ns = to_ns.saturating_sub(*from_ns);
        if gap_ns > MAX_GAP_NS {
            return None;
        }
        let (share, d) = (at_ns.saturating_sub(*from_ns) as f64 / gap_ns as f64, to.minus(from));
        Some(from.plus(&Vector3::new(d.x * share, d.y * share, wrap_rad(d.z) * share)))
    }
}
