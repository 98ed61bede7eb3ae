//! Reference trajectory: where a robot really was, by an independent measurement. In: poses with
//! times of the robot's clock. Out: the pose at any time between them, none across gaps.

use crate::{
    check::{self, OutOfRange},
    pose2::{Pose2, wrap_rad},
};
use nalgebra::Vector3;

/// Most poses of a reference trajectory.
pub const MAX_REFERENCE: usize = 200_000;
/// Poses further apart than this are not interpolated, ns.
const MAX_GAP_NS: i64 = 1_000_000_000;

/// True `map_from_robot` by robot time, ns.
#[derive(Debug, Clone, PartialEq)]
pub struct ReferenceTrajectory {
    poses: Vec<(i64, Pose2)>,
    /// Standard deviation of its positions, metres.
    pub(super) sigma_m: f64,
    /// Standard deviation of its headings, radians.
    pub(super) sigma_rad: f64,
}

/// Why poses are not a reference trajectory.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ReferenceError {
    /// A pose is out of range.
    #[error("pose {index}: {error}")]
    Pose {
        /// Index of the pose, from 0.
        index: usize,
        /// The value that is out of range.
        error: OutOfRange,
    },
    /// The number of poses or a standard deviation is out of range.
    #[error(transparent)]
    Range(#[from] OutOfRange),
    /// A time does not rise.
    #[error("pose {index} is not later than the one before it")]
    Order {
        /// Index of the pose, from 0.
        index: usize,
    },
}

impl ReferenceTrajectory {
    /// From 2 to [`MAX_REFERENCE`] poses in order of time, ns of the robot's clock; standard
    /// deviations up to 1 m and 0.5 rad.
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

    /// The pose at a time; `None` before, after, and within gaps of more than a second.
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
