//! Limits of the grid belief.

use crate::check::{self, OutOfRange};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Knobs of the belief.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GridBeliefParams {
    /// Side of a cell; 0.05 to 2 m.
    pub cell_m: f64,
    /// Headings in a turn; 4 to 360.
    pub headings: usize,
    /// Probability that a sighting is of something that is not on the map.
    pub clutter: f64,
    /// How far such things are seen: they may be anywhere within this.
    pub clutter_reach_m: f64,
    /// Share of the belief that is spread evenly at every motion: the robot may have been carried away.
    pub carried: f64,
    /// Probability that a landmark in sight is recognised.
    pub detection: f64,
    /// Standard deviation along a motion after 1 m (grows with the square root).
    pub along_m: f64,
    /// The same of the heading.
    pub turn_rad: f64,
    /// A mode with more than this is the pose.
    pub decided: f64,
    /// Poses within this of a peak, and [`Self::mode_rad`], belong to its mode.
    pub mode_m: f64,
    /// See [`Self::mode_m`].
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
            detection: 0.8,
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
        for (field, value) in [
            ("clutter", self.clutter),
            ("carried", self.carried),
            ("detection", self.detection),
            ("decided", self.decided),
        ] {
            check::within(field, value, 0.0, 1.0)?;
        }
        Ok(())
    }
}
