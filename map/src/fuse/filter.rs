//! The filter: a belief with its counts of contradictions and the sources used lately. Predicts,
//! corrects, starts, loses the pose.

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
use vision::model::LandmarkId;

/// Most sources (landmarks, the laser) whose last use is remembered; the one unused for longest is
/// dropped first.
pub const MAX_SOURCES: usize = 32;

/// Fixes that contradict the belief and agree with one another.
#[derive(Debug, Clone)]
struct ContradictionCounter {
    /// The latest of them, moved along by odometry.
    pose: Pose2Covariance,
    count: u32,
    landmarks: Vec<LandmarkId>,
}

/// Where the independent errors of a fix come from: the corners of a landmark, or a scan.
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

/// The state of the filter at one time.
#[derive(Debug, Clone, Default)]
pub(super) struct Filter {
    belief: Option<Belief>,
    doubt: Option<ContradictionCounter>,
    odometry: Option<Pose2>,
    /// Systematic odometry errors known before the present belief.
    learnt: Option<SystematicOdometryError>,
    /// Each source with the odometry of its last applied fix, the latest last. One entry for each
    /// source: scans between two observations of a landmark do not make the second one new.
    used: Vec<(Source, Pose2)>,
    /// Fixes by landmarks applied.
    pub corrections: u64,
    /// Scans applied.
    pub laser_corrections: u64,
    /// Consecutive scans that contradict the belief.
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

    /// Estimate of the systematic odometry errors.
    pub(super) fn odometry_errors(&self) -> Option<SystematicOdometryError> {
        self.belief.as_ref().map(Belief::odometry_errors).or(self.learnt)
    }

    /// Number of consecutive contradicting fixes.
    pub(super) fn doubts(&self) -> u32 {
        self.doubt.as_ref().map_or(0, |d| d.count).max(self.laser_doubts)
    }

    /// Starts, or starts again, from a given pose.
    pub(super) fn start(&mut self, at: &Pose2Covariance, p: &FuseParams) {
        let belief = Belief::new(at, &self.so_far(p), 0);
        self.belief = Some(belief);
        self.afresh();
    }

    /// Clears contradictions and used sources.
    fn afresh(&mut self) {
        (self.doubt, self.laser_doubts) = (None, 0);
        self.used.clear();
    }

    /// Present estimate of the systematic odometry errors, or the prior.
    fn so_far(&self, p: &FuseParams) -> SystematicOdometryError {
        self.odometry_errors().unwrap_or_else(|| SystematicOdometryError::unknown(p))
    }

    /// Prediction to the next odometry pose.
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

    /// Starts a new odometry frame: the pose is unknown, the systematic errors stay.
    pub(super) fn lose(&mut self, odom_from_robot: &Pose2) {
        self.learnt = self.odometry_errors();
        self.belief = None;
        self.afresh();
        self.odometry = Some(*odom_from_robot);
    }

    /// Applies a fix at the time of the last odometry.
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
                            FixOutcome::ExcludedByMode { distance2 }
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
        if let FixOutcome::ExcludedByMode { .. } = outcome {
            match fix.modality {
                FixSource::Laser => self.laser_doubts = 0,
                FixSource::Landmarks if role == FixRole::Guided => {}
                FixSource::Landmarks => self.doubt = None,
            }
        } else if !matches!(outcome, FixOutcome::GatedOut { .. }) {
            match fix.modality {
                // A scan is matched around the belief, so its fit says nothing against
                // contradicting landmarks.
                FixSource::Laser => {
                    self.laser_corrections += 1;
                    self.laser_doubts = 0;
                }
                // Neither does a guided observation.
                FixSource::Landmarks if role == FixRole::Guided => self.corrections += 1,
                FixSource::Landmarks => (self.corrections, self.doubt) = (self.corrections + 1, None),
            }
            self.use_up(sources);
        }
        outcome
    }

    /// Records where sources were used.
    fn use_up(&mut self, sources: Vec<Source>) {
        let Some(now) = self.odometry else { return };
        self.used.retain(|(source, _)| !sources.contains(source));
        self.used.extend(sources.into_iter().map(|source| (source, now)));
        let gone = self.used.len().saturating_sub(MAX_SOURCES);
        self.used.drain(..gone);
    }

    /// Whether all sources were used from the same pose: the errors of corners and ranges are
    /// largely the same there.
    fn is_repeated(&self, sources: &[Source], p: &FuseParams) -> bool {
        let Some(now) = &self.odometry else { return false };
        let still = |before: &Pose2| {
            let motion = before.between(now);
            motion.position().norm() < p.min_move_m && motion.theta_rad.abs() < p.min_turn_rad
        };
        let used = |source| self.used.iter().any(|(other, before)| other == source && still(before));
        !sources.is_empty() && sources.iter().all(used)
    }

    /// Counts a contradiction. Enough of them that agree and rest on several landmarks replace the
    /// belief.
    fn contradict(&mut self, fix: &Fix, distance2: f64, p: &FuseParams) -> FixOutcome {
        if fix.modality == FixSource::Laser {
            self.laser_doubts = self.laser_doubts.saturating_add(1);
            return FixOutcome::GatedOut { distance2, in_a_row: self.laser_doubts };
        }
        let agrees =
            |d: &ContradictionCounter| d.pose.distance2(&fix.pose).is_some_and(|d2| d2 <= p.gate_chi2);
        let mut doubt = match self.doubt.take() {
            Some(doubt) if agrees(&doubt) => doubt,
            _ => ContradictionCounter { pose: fix.pose, count: 0, landmarks: Vec::new() },
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
