//! Parameters of the grid belief.

use crate::check::{self, OutOfRange};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Parameters of the grid belief.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GridBeliefParams {
    /// Side of a cell, 0.05 to 2 m.
    pub cell_m: f64,
    /// Headings in a full turn, 4 to 360.
    pub headings: usize,
    /// Probability that an observation is of no landmark of the map, 0 to 1.
    pub clutter: f64,
    /// Such objects are uniformly distributed within this distance, metres.
    pub clutter_reach_m: f64,
    /// Share of the belief that is spread uniformly at every motion, for a kidnapped robot, 0 to 1.
    pub carried: f64,
    /// Standard deviation of a motion after 1 m, metres; grows with the square root of the
    /// distance.
    pub along_m: f64,
    /// Standard deviation of the heading after 1 m or 1 rad, radians.
    pub turn_rad: f64,
    /// A hypothesis with a higher probability is the pose.
    pub decided: f64,
    /// Poses within this distance of a peak belong to its hypothesis, metres,
    pub mode_m: f64,
    /// if their headings differ by at most this, radians.
    pub mode_rad: f64,
}

impl Default for GridBeliefParams {
    fn default() -> Self {
        Self {
            cell_m: 0.2,
            headings: 36,
            clutter: 0.1,
            clutter_reach_m: 8.0,
            carried: 0.01,
            along_m: 0.05,
            turn_rad: 0.02,
            decided: 0.95,
            mode_m: 0.8,
            mode_rad: 0.6,
        }
    }
}

impl GridBeliefParams {
    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        check::within("cell_m", self.cell_m, 0.05, 2.0)?;
        check::within("headings", self.headings as f64, 4.0, 360.0)?;
        check::within("clutter_reach_m", self.clutter_reach_m, 0.1, 1000.0)?;
        check::within("mode_m", self.mode_m, 0.0, 100.0)?;
        check::within("mode_rad", self.mode_rad, 0.0, PI)?;
        check::within("along_m", self.along_m, 0.0, 10.0)?;
        check::within("turn_rad", self.turn_rad, 0.0, 10.0)?;
        for (field, value) in
            [("clutter", self.clutter), ("carried", self.carried), ("decided", self.decided)]
        {
            check::within(field, value, 0.0, 1.0)?;
        }
        Ok(())
    }
}
