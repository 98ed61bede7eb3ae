//! Odometry and scan messages of robots: bytes in, checked messages or refusals out, each counted.

use crate::{limits::MAX_SCAN_BYTES, snapshot::Snapshots};
use protos::{
    Code, Name, Rejection,
    convert::{CheckedOdometry, CheckedScan},
    prost::{Message, bytes::Bytes},
    v1,
};
use std::collections::BTreeMap;

/// Largest odometry message, in bytes: it has nine numbers.
pub const MAX_ODOMETRY_BYTES: usize = 1024;

/// Counts of one kind of message.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct MessageCounts {
    /// Accepted messages.
    pub accepted: u64,
    /// Refused messages, by code.
    pub rejected: BTreeMap<Code, u64>,
}

impl MessageCounts {
    /// Counts a message as accepted or refused.
    pub(super) fn count<T>(&mut self, taken: Result<T, Rejection>) -> Option<T> {
        match taken {
            Ok(message) => {
                self.accepted += 1;
                Some(message)
            }
            Err(rejection) => {
                *self.rejected.entry(rejection.code).or_default() += 1;
                None
            }
        }
    }
}

/// Odometry of a robot, and the map it is on.
pub(super) fn odometry(
    snapshots: &Snapshots,
    robot: &Name,
    message: Bytes,
) -> Result<(String, CheckedOdometry), Rejection> {
    let (map, message) = sized(snapshots, robot, message, MAX_ODOMETRY_BYTES)?;
    let wire = v1::Odometry::decode(message).map_err(|e| undecodable("Odometry", &e))?;
    Ok((map, CheckedOdometry::try_from(wire)?))
}

/// A scan of a robot, and the map it is on.
pub(super) fn scan(
    snapshots: &Snapshots,
    robot: &Name,
    message: Bytes,
) -> Result<(String, CheckedScan), Rejection> {
    let (map, message) = sized(snapshots, robot, message, MAX_SCAN_BYTES)?;
    let wire = v1::Scan::decode(message).map_err(|e| undecodable("Scan", &e))?;
    if !wire.map.is_empty() && wire.map != map {
        let detail = format!("the robot is registered on {map}: its scans are matched with the walls there");
        return Err(Rejection::new(Code::UnknownMap, "map", detail));
    }
    Ok((map, CheckedScan::try_from(wire)?))
}

/// The robot's map and its message, if it may send one of this size.
fn sized(
    snapshots: &Snapshots,
    robot: &Name,
    message: Bytes,
    limit: usize,
) -> Result<(String, Bytes), Rejection> {
    let map = snapshots.robot_map(robot.as_str());
    let map = map.ok_or_else(|| Rejection::new(Code::UnknownRobot, "robot", "not registered"))?;
    if message.len() > limit {
        let detail = format!("{} bytes are more than {limit}", message.len());
        return Err(Rejection::new(Code::TooLarge, "message", detail));
    }
    Ok((map, message))
}

fn undecodable(kind: &str, error: &protos::prost::DecodeError) -> Rejection {
    Rejection::new(Code::BadMessage, "message", format!("no {kind} message: {error}"))
}
