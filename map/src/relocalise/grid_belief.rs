//! The belief: predicted by motions, updated by observations, read as pose hypotheses.

use crate::{
    check::{self, OutOfRange},
    pose2::{Pose2, wrap_rad},
    relocalise::{
        grid::{PoseGrid, PoseHypothesis},
        observation::{AssociationHypothesis, MAX_MEMBERS, PossibleLandmark, RelativeObservation},
        params::GridBeliefParams,
    },
};
use nalgebra::{Matrix3, Point2, Vector3};
use std::f64::consts::{PI, TAU};

/// An observation affects poses within this many standard deviations.
const REACH_SIGMAS: f64 = 4.5;

/// The belief over the robot's pose.
#[derive(Debug, Clone)]
pub struct GridBelief {
    pub(super) p: GridBeliefParams,
    pub(super) grid: PoseGrid,
}

impl GridBelief {
    /// A belief over the rectangle between two corners. `prior` weights each pose; 0 where the
    /// robot cannot be.
    pub fn new(
        corners: [Point2<f64>; 2],
        prior: impl Fn(&Pose2) -> f64,
        p: &GridBeliefParams,
    ) -> Result<Self, OutOfRange> {
        p.check()?;
        for corner in corners {
            Pose2::new(corner.x, corner.y, 0.0).check()?;
        }
        let grid = PoseGrid::new(corners, p.cell_m, p.headings, prior)?;
        Ok(Self { p: p.clone(), grid })
    }

    /// Prediction by a motion in the robot frame.
    pub fn predict(&mut self, motion: &Pose2) -> Result<(), OutOfRange> {
        motion.check()?;
        let metres = motion.position().norm();
        self.grid.shift(motion);
        let radians2 = self.p.turn_rad.powi(2) * (metres + motion.theta_rad.abs());
        self.grid.spread(self.p.along_m.powi(2) * metres, radians2);
        self.grid.mix(self.p.carried);
        Ok(())
    }

    /// Update by an observation that may be any of `members`, or clutter.
    pub fn update(
        &mut self,
        glimpse: &RelativeObservation,
        members: &[PossibleLandmark<'_>],
    ) -> Result<(), OutOfRange> {
        let hypotheses: Vec<AssociationHypothesis<'_>> = members
            .iter()
            .map(|member| AssociationHypothesis { glimpse: *glimpse, member: *member })
            .collect();
        self.update_associations(&hypotheses)
    }

    /// Update where the relative pose depends on the landmark: another size or height gives another
    /// distance.
    pub fn update_associations(
        &mut self,
        hypotheses: &[AssociationHypothesis<'_>],
    ) -> Result<(), OutOfRange> {
        check::within("members", hypotheses.len() as f64, 0.0, MAX_MEMBERS as f64)?;
        let reach_m = self.p.clutter_reach_m;
        let evenly = self.p.clutter / (PI * reach_m * reach_m * TAU);
        let mut likelihood = self.grid.like(evenly);
        for AssociationHypothesis { glimpse, member } in hypotheses {
            glimpse.robot_from_landmark.check()?;
            check::covariance("covariance", &glimpse.covariance)?;
            member.place.check()?;
            check::within("probability", member.probability, 0.0, 1.0)?;
            self.read(glimpse, member, &mut likelihood);
        }
        self.grid.weigh(|i, _| likelihood[i]);
        Ok(())
    }

    /// Adds the likelihood that an observation is of a landmark.
    fn read(&self, glimpse: &RelativeObservation, member: &PossibleLandmark<'_>, likelihood: &mut [f64]) {
        // A pose represents its cell: the observation gets the variance of a uniform cell.
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
                // Position of a robot with this heading for this observation.
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

    /// Pose hypotheses, most probable first.
    pub fn modes(&self) -> Vec<PoseHypothesis> {
        self.grid.modes(self.p.mode_m, self.p.mode_rad)
    }

    /// The pose, once one hypothesis is probable enough.
    pub fn resolved(&self) -> Option<PoseHypothesis> {
        self.modes().into_iter().next().filter(|m| m.mass > self.p.decided)
    }

    /// Entropy of the belief, nats; 0 when one cell holds all of it.
    pub fn entropy_nats(&self) -> f64 {
        self.grid.entropy_nats()
    }

    /// Probability of the cell that contains a pose.
    pub fn belief(&self, pose: &Pose2) -> f64 {
        self.grid.at(pose)
    }
}
