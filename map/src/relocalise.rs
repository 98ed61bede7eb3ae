//! Where the robot might be while only ambiguous landmarks are seen: Markov localisation over a grid of poses (method
//! 19.1).
//!
//! In: motions, sightings of things that may be any of several landmarks, landmarks that should have been seen. Out: the
//! modes of the belief, and one pose once a single mode holds enough of it. Never says one while several are left.

mod grid;

pub use grid::MAX_CELLS;

use crate::{
    check::{self, OutOfRange},
    place::LandmarkPlace,
    pose2::{Pose2, Pose2Covariance, wrap_rad},
    visibility::VisibilityMap,
};
use grid::Grid;
use nalgebra::{Matrix3, Point2, Vector3};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Most modes that are told apart.
pub const MAX_MODES: usize = 8;
/// Most landmarks that one sighting may be.
pub const MAX_MEMBERS: usize = 256;
/// A sighting reaches this many standard deviations.
const REACH_SIGMAS: f64 = 4.5;
/// Belief below this share of a cell's even share is no mode.
const MIN_MASS: f64 = 1e-3;

/// Knobs of the belief.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HypothesesParams {
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

impl Default for HypothesesParams {
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

impl HypothesesParams {
    fn check(&self) -> Result<(), OutOfRange> {
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

/// A landmark that a sighting may be of.
#[derive(Debug, Clone, Copy)]
pub struct Member<'a> {
    /// Where it hangs.
    pub place: &'a LandmarkPlace,
    /// From where it is seen; without it from everywhere.
    pub visible: Option<&'a VisibilityMap>,
    /// Probability that the sighting is of this one, by its looks alone. All members and clutter come to 1.
    pub probability: f64,
}

/// Something that was seen: the landmark's centre and the direction of its normal in the robot frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glimpse {
    /// `robot_from_landmark` on the floor.
    pub robot_from_landmark: Pose2,
    /// Of (x, y, theta).
    pub covariance: Matrix3<f64>,
}

/// A landmark that something may be, and how it was seen if it is.
#[derive(Debug, Clone, Copy)]
pub struct Reading<'a> {
    /// Seen so.
    pub glimpse: Glimpse,
    /// What it would be.
    pub member: Member<'a>,
}

/// A place where the robot may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mode {
    /// Share of the belief.
    pub mass: f64,
    /// Mean and covariance of it.
    pub pose: Pose2Covariance,
}

/// The belief on where the robot is.
#[derive(Debug, Clone)]
pub struct Hypotheses {
    p: HypothesesParams,
    grid: Grid,
}

impl Hypotheses {
    /// Over the rectangle between two corners. `prior` weighs each pose; 0 where the robot cannot be.
    pub fn new(
        corners: [Point2<f64>; 2],
        prior: impl Fn(&Pose2) -> f64,
        p: &HypothesesParams,
    ) -> Result<Self, OutOfRange> {
        p.check()?;
        for corner in corners {
            Pose2::new(corner.x, corner.y, 0.0).check()?;
        }
        let grid = Grid::new(corners, p.cell_m, p.headings, prior)?;
        Ok(Self { p: p.clone(), grid })
    }

    /// The robot moved, in its own frame.
    pub fn moved(&mut self, motion: &Pose2) -> Result<(), OutOfRange> {
        motion.check()?;
        let metres = motion.position().norm();
        self.grid.shift(motion);
        let radians2 = self.p.turn_rad.powi(2) * (metres + motion.theta_rad.abs());
        self.grid.spread(self.p.along_m.powi(2) * metres, radians2);
        self.grid.mix(self.p.carried);
        Ok(())
    }

    /// The robot saw something that may be any of `members`, or nothing of the map.
    pub fn saw(&mut self, glimpse: &Glimpse, members: &[Member<'_>]) -> Result<(), OutOfRange> {
        let readings: Vec<Reading<'_>> =
            members.iter().map(|member| Reading { glimpse: *glimpse, member: *member }).collect();
        self.saw_any(&readings)
    }

    /// The same where how it was seen depends on what it is: of another size or height it is elsewhere.
    pub fn saw_any(&mut self, readings: &[Reading<'_>]) -> Result<(), OutOfRange> {
        check::within("members", readings.len() as f64, 0.0, MAX_MEMBERS as f64)?;
        let reach_m = self.p.clutter_reach_m;
        let evenly = self.p.clutter / (PI * reach_m * reach_m * TAU);
        let mut likelihood = self.grid.like(evenly);
        for Reading { glimpse, member } in readings {
            glimpse.robot_from_landmark.check()?;
            check::covariance("covariance", &glimpse.covariance)?;
            member.place.check()?;
            check::within("probability", member.probability, 0.0, 1.0)?;
            self.read(glimpse, member, &mut likelihood);
        }
        self.grid.weigh(|i, _| likelihood[i]);
        Ok(())
    }

    /// Adds the likelihood that a glimpse is of a member.
    fn read(&self, glimpse: &Glimpse, member: &Member<'_>, likelihood: &mut [f64]) {
        // Poses stand for their cells: what is seen from a cell is uncertain by its size.
        let (cell, bin) = (self.p.cell_m, TAU / self.p.headings as f64);
        let within_cell = Vector3::new(cell * cell, cell * cell, bin * bin) / 12.0;
        let covariance = glimpse.covariance + Matrix3::from_diagonal(&within_cell);
        let Some(inverse) = covariance.try_inverse() else { return };
        let scale = 1.0 / (TAU.powi(3) * covariance.determinant()).sqrt();
        let z = glimpse.robot_from_landmark;
        let reach = REACH_SIGMAS * (covariance[(0, 0)] + covariance[(1, 1)]).sqrt();
        let at = Pose2::new(member.place.x_m, member.place.y_m, member.place.theta_rad);
        self.grid.each_heading(
            |heading| {
                let off = wrap_rad(at.theta_rad - heading - z.theta_rad);
                if off * off > REACH_SIGMAS.powi(2) * covariance[(2, 2)] {
                    return None;
                }
                // Where a robot of this heading stands to see it so.
                let from = Pose2::new(0.0, 0.0, heading).compose(&z);
                Some((Point2::new(at.x_m - from.x_m, at.y_m - from.y_m), reach))
            },
            |i, pose| {
                if member.visible.is_some_and(|v| !v.contains(&Point2::from(pose.position()))) {
                    return;
                }
                let e = z.minus(&pose.between(&at));
                likelihood[i] += member.probability * scale * (-0.5 * e.dot(&(inverse * e))).exp();
            },
        );
    }

    /// A landmark was not seen, though the camera looked at all bearings between two (left positive).
    pub fn missed(&mut self, place: &LandmarkPlace, visible: &VisibilityMap, bearings_rad: [f64; 2]) {
        let detection = self.p.detection;
        self.grid.weigh(|_, pose| {
            let (dx, dy) = (place.x_m - pose.x_m, place.y_m - pose.y_m);
            let bearing = wrap_rad(dy.atan2(dx) - pose.theta_rad);
            let looked = (bearings_rad[0]..=bearings_rad[1]).contains(&bearing);
            if looked && visible.contains(&Point2::new(pose.x_m, pose.y_m)) { 1.0 - detection } else { 1.0 }
        });
    }

    /// The places where the robot may be, most probable first.
    pub fn modes(&self) -> Vec<Mode> {
        self.grid.modes(self.p.mode_m, self.p.mode_rad)
    }

    /// The pose, once one mode holds more than the rest by far.
    pub fn decided(&self) -> Option<Mode> {
        self.modes().into_iter().next().filter(|m| m.mass > self.p.decided)
    }

    /// Entropy of the belief, nats: 0 when one cell has it all.
    pub fn entropy_nats(&self) -> f64 {
        self.grid.entropy_nats()
    }

    /// Belief of the cell that holds a pose.
    pub fn belief(&self, pose: &Pose2) -> f64 {
        self.grid.at(pose)
    }
}

#[cfg(test)]
mod tests;
