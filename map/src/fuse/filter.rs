//! The filter itself: robot pose and lasting errors in one Gaussian; predict, correct, start, give up.

use crate::{
    fuse::{
        belief::{Belief, MAX_NUISANCES, SystematicOdometryError},
        error_correction,
        outcome::{FixOutcome, FixRole},
        params::FuseParams,
        rules::Rules,
    },
    localise::{Fix, FixSource},
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::Matrix3;
use vision::recognise::LandmarkId;

/// Most sources of fixes (landmarks, the laser) whose last use is remembered; the one unused for longest goes first.
pub const MAX_SOURCES: usize = 32;

/// Fixes that contradict the filter but agree with one another.
#[derive(Debug, Clone)]
struct Doubt {
    /// The latest of them, carried along by odometry.
    pose: Pose2Covariance,
    count: u32,
    landmarks: Vec<LandmarkId>,
}

/// Where the errors of a fix come from, besides what lasts: the corners of a landmark, or a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Source {
    Landmark(LandmarkId),
    Laser,
}

fn sources(fix: &Fix) -> Vec<Source> {
    match fix.modality {
        FixSource::Landmarks => fix.landmarks.iter().copied().map(Source::Landmark).collect(),
        FixSource::Laser => vec![Source::Laser],
    }
}

/// Everything the filter knows at one time.
#[derive(Debug, Clone, Default)]
pub(super) struct Filter {
    belief: Option<Belief>,
    doubt: Option<Doubt>,
    odometry: Option<Pose2>,
    /// Of odometry's errors, what was learnt before the present belief.
    learnt: Option<SystematicOdometryError>,
    /// Each source with the odometry of its last applied fix, the latest last. One list for all would let scans between
    /// two looks at a landmark make the second look new.
    used: Vec<(Source, Pose2)>,
    /// Fixes by landmarks that were applied.
    pub corrections: u64,
    /// Scans that were applied.
    pub laser_corrections: u64,
    /// Scans in a row that contradict the belief.
    laser_doubts: u32,
    fixes: u64,
}

impl Filter {
    pub(super) fn pose(&self) -> Option<Pose2Covariance> {
        let belief = self.belief.as_ref()?;
        let covariance = Matrix3::from_iterator(belief.covariance.view((0, 0), (3, 3)).iter().copied());
        Some(Pose2Covariance { pose: belief.pose, covariance })
    }

    pub(super) fn odometry(&self) -> Option<&Pose2> {
        self.odometry.as_ref()
    }

    /// What is known of odometry's errors.
    pub(super) fn odometry_errors(&self) -> Option<SystematicOdometryError> {
        self.belief.as_ref().map(Belief::odometry_errors).or(self.learnt)
    }

    /// Contradicting fixes in a row.
    pub(super) fn doubts(&self) -> u32 {
        self.doubt.as_ref().map_or(0, |d| d.count).max(self.laser_doubts)
    }

    /// Starts, or starts again, from a pose that is given.
    pub(super) fn start(&mut self, at: &Pose2Covariance, p: &FuseParams) {
        let belief = Belief::new(at, &self.so_far(p), 0);
        self.belief = Some(belief);
        self.afresh();
    }

    /// Nothing speaks for or against the belief yet.
    fn afresh(&mut self) {
        (self.doubt, self.laser_doubts) = (None, 0);
        self.used.clear();
    }

    /// Of odometry's errors, what is known so far.
    fn so_far(&self, p: &FuseParams) -> SystematicOdometryError {
        self.odometry_errors().unwrap_or_else(|| SystematicOdometryError::unknown(p))
    }

    /// Moves on to another odometry pose.
    pub(super) fn predict(&mut self, odom_from_robot: &Pose2, rules: &Rules) {
        if let Some(before) = self.odometry {
            let p = &rules.params;
            let motion = before.between(odom_from_robot);
            let noise = p.motion_noise(&motion);
            if let Some(belief) = &mut self.belief {
                let (motion, noise) =
                    error_correction::motion(&motion, &noise, &rules.areas.advice(&belief.pose), p);
                belief.predict(&motion, &noise, p);
            }
            if let Some(doubt) = &mut self.doubt {
                doubt.pose = doubt.pose.compose(&Pose2Covariance { pose: motion, covariance: noise });
            }
        }
        self.odometry = Some(*odom_from_robot);
    }

    /// The odometry frame is no longer the same: where the robot is now is unknown.
    pub(super) fn lose(&mut self, odom_from_robot: &Pose2) {
        // It is still the same robot.
        self.learnt = self.odometry_errors();
        self.belief = None;
        self.afresh();
        self.odometry = Some(*odom_from_robot);
    }

    /// Takes a fix at the time of the last odometry.
    pub(super) fn correct(&mut self, fix: &Fix, role: FixRole, rules: &Rules) -> FixOutcome {
        let p = &rules.params;
        let only_corrects = fix.modality == FixSource::Laser || role == FixRole::Guided;
        if self.belief.is_none() && only_corrects {
            return FixOutcome::NoPose;
        }
        let sources = sources(fix);
        if role != FixRole::Replacing && self.is_repeated(&sources, p) {
            return FixOutcome::Repeated;
        }
        self.fixes += 1;
        let so_far = self.so_far(p);
        let at = self.belief.as_ref().map_or(fix.pose.pose, |belief| belief.pose);
        let advice = rules.areas.advice(&at);
        let fix = &*error_correction::fix(fix, &at, &advice);
        let outcome = match &mut self.belief {
            None => {
                self.belief = Some(Belief::from_fix(fix, &so_far, self.fixes));
                FixOutcome::Started
            }
            Some(belief) if role == FixRole::Replacing => {
                *belief = Belief::from_fix(fix, &so_far, self.fixes);
                self.afresh();
                FixOutcome::Reset
            }
            Some(belief) => {
                let mut next = belief.clone();
                match next.correct(fix, self.fixes) {
                    Some(distance2) if distance2 <= p.gate_chi2 => {
                        if advice.uses(fix.modality) {
                            *belief = next;
                            FixOutcome::Applied { distance2 }
                        } else {
                            FixOutcome::NotUsed { distance2 }
                        }
                    }
                    distance2 if role == FixRole::Guided => FixOutcome::GatedOut {
                        distance2: distance2.unwrap_or(f64::INFINITY),
                        in_a_row: self.doubts(),
                    },
                    distance2 => self.contradict(fix, distance2.unwrap_or(f64::INFINITY), p),
                }
            }
        };
        if let FixOutcome::NotUsed { .. } = outcome {
            match fix.modality {
                FixSource::Laser => self.laser_doubts = 0,
                FixSource::Landmarks if role == FixRole::Guided => {}
                FixSource::Landmarks => self.doubt = None,
            }
        } else if !matches!(outcome, FixOutcome::GatedOut { .. }) {
            match fix.modality {
                // A scan is laid where the belief says: that it fits there is no word against landmarks that do not.
                FixSource::Laser => {
                    self.laser_corrections += 1;
                    self.laser_doubts = 0;
                }
                // Nor is it that a landmark is found where the belief says.
                FixSource::Landmarks if role == FixRole::Guided => self.corrections += 1,
                FixSource::Landmarks => (self.corrections, self.doubt) = (self.corrections + 1, None),
            }
            self.use_up(sources);
        }
        outcome
    }

    /// Remembers where sources were used.
    fn use_up(&mut self, sources: Vec<Source>) {
        let Some(now) = self.odometry else { return };
        self.used.retain(|(source, _)| !sources.contains(source));
        self.used.extend(sources.into_iter().map(|source| (source, now)));
        let gone = self.used.len().saturating_sub(MAX_SOURCES);
        self.used.drain(..gone);
    }

    /// Nothing but what was used from the same place: the errors of corners and ranges are largely those of that time.
    fn is_repeated(&self, sources: &[Source], p: &FuseParams) -> bool {
        let Some(now) = &self.odometry else { return false };
        let still = |before: &Pose2| {
            let motion = before.between(now);
            motion.position().norm() < p.min_move_m && motion.theta_rad.abs() < p.min_turn_rad
        };
        let used = |source| self.used.iter().any(|(other, before)| other == source && still(before));
        !sources.is_empty() && sources.iter().all(used)
    }

    /// Counts contradictions; enough of them that agree, and rest on landmarks, replace the belief.
    fn contradict(&mut self, fix: &Fix, distance2: f64, p: &FuseParams) -> FixOutcome {
        if fix.modality == FixSource::Laser {
            self.laser_doubts = self.laser_doubts.saturating_add(1);
            return FixOutcome::GatedOut { distance2, in_a_row: self.laser_doubts };
        }
        let agrees = |d: &Doubt| d.pose.distance2(&fix.pose).is_some_and(|d2| d2 <= p.gate_chi2);
        let mut doubt = match self.doubt.take() {
            Some(doubt) if agrees(&doubt) => doubt,
            _ => Doubt { pose: fix.pose, count: 0, landmarks: Vec::new() },
        };
        doubt.pose = fix.pose;
        doubt.count = doubt.count.saturating_add(1);
        for landmark in &fix.landmarks {
            if doubt.landmarks.len() < MAX_NUISANCES && !doubt.landmarks.contains(landmark) {
                doubt.landmarks.push(*landmark);
            }
        }
        if doubt.count >= p.reset_count && doubt.landmarks.len() >= p.reset_landmarks {
            self.belief = Some(Belief::from_fix(fix, &self.so_far(p), self.fixes));
            self.afresh();
            return FixOutcome::Reset;
        }
        let in_a_row = doubt.count;
        self.doubt = Some(doubt);
        FixOutcome::GatedOut { distance2, in_a_row }
    }
}
