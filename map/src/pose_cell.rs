//! Pose cells: square metres of the floor, each with one of four headings.

use crate::{
    check::{self, MAX_COORDINATE_M, OutOfRange},
    pose2::Pose2,
};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

/// Side of a cell, metres.
pub const CELL_M: f64 = 1.0;

/// A square metre of the floor with one of four headings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(into = "[i64; 3]", try_from = "[i64; 3]")]
pub struct PoseCell {
    /// Column: x of the map in whole metres, rounded down.
    pub x: i32,
    /// Row: y of the map in whole metres, rounded down.
    pub y: i32,
    /// Quarter of the circle about 0, 90, 180, 270 degrees: 0 to 3.
    pub heading: u8,
}

impl PoseCell {
    /// The cell that contains a pose.
    pub fn of(pose: &Pose2) -> Self {
        let square = |v: f64| (v / CELL_M).floor() as i32;
        let quarter = (pose.theta_rad / FRAC_PI_2).round().rem_euclid(4.0);
        Self { x: square(pose.x_m), y: square(pose.y_m), heading: quarter as u8 % 4 }
    }

    /// Centre of the cell's square, metres, map frame.
    pub fn middle_m(&self) -> [f64; 2] {
        [(f64::from(self.x) + 0.5) * CELL_M, (f64::from(self.y) + 0.5) * CELL_M]
    }
}

impl From<PoseCell> for [i64; 3] {
    fn from(cell: PoseCell) -> Self {
        [cell.x.into(), cell.y.into(), cell.heading.into()]
    }
}

impl TryFrom<[i64; 3]> for PoseCell {
    type Error = OutOfRange;

    fn try_from([x, y, heading]: [i64; 3]) -> Result<Self, OutOfRange> {
        let most = (MAX_COORDINATE_M / CELL_M) as i64;
        let coordinate = |field, v: i64| {
            let inside = (-most..=most).contains(&v);
            i32::try_from(v).ok().filter(|_| inside).ok_or(OutOfRange { field, value: v as f64 })
        };
        check::within("cell.heading", heading as f64, 0.0, 3.0)?;
        Ok(Self { x: coordinate("cell.x", x)?, y: coordinate("cell.y", y)?, heading: heading as u8 })
    }
}
