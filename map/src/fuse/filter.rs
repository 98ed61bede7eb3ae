//! The filter itself: robot pose and lasting errors in one Gaussian; predict, correct, start, give up.

use super::{FixOutcome, FixRole, FuseParams, Rules, trust};
use crate::{
    localise::{Fix, Modality, Nuisance, NuisanceKey},
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, Matrix3x2, Vector2, Vector3};
use vision::model::LandmarkId;

/// Most lasting errors carried along of landmarks and mounting, and as many of walls; the one unused for longest goes
/// first.
pub const MAX_NUISANCES: usize = 12;
/// Most sources of fixes (landmarks, the laser) whose last use is remembered; the one unused for longest goes first.
pub const MAX_SOURCES: usize = 32;
/// Size of the pose's block.
const POSE: usize = 3;
/// Size of the robot's block: its pose, then its odometry's errors (scale, turn per metre).
const ROBOT: usize = 5;
/// Size of a lasting error's block.
const BLOCK: usize = 6;

/// A lasting error in the state.
#[derive(Debug, Clone)]
struct Carried {
    key: NuisanceKey,
    /// Count of fixes when it was last used.
    used: u64,
}

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
        Modality::Landmarks => fix.landmarks.iter().copied().map(Source::Landmark).collect(),
        Modality::Laser => vec![Source::Laser],
    }
}

/// What lasts of odometry's errors: of one metre measured, `1 + scale` metres are driven and `turn_rad_per_m` more is
/// turned than measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometryErrors {
    /// Scale, turn in radians a metre.
    pub errors: Vector2<f64>,
    /// Their covariance.
    pub covariance: Matrix2<f64>,
}

impl OdometryErrors {
    /// Before anything is known of this robot.
    fn unknown(p: &FuseParams) -> Self {
        let variances = Vector2::new(p.scale_sigma.powi(2), p.turn_bias_sigma_rad_per_m.powi(2));
        Self { errors: Vector2::zeros(), covariance: Matrix2::from_diagonal(&variances) }
    }
}

/// What is believed: the pose, odometry's errors, then the lasting errors (true minus assumed) in the order of `carried`.
#[derive(Debug, Clone)]
struct Belief {
    pose: Pose2,
    odometry: Vector2<f64>,
    errors: DVector<f64>,
    covariance: DMatrix<f64>,
    carried: Vec<Carried>,
}

/// Everything the filter knows at one time.
#[derive(Debug, Clone, Default)]
pub(super) struct Filter {
    belief: Option<Belief>,
    doubt: Option<Doubt>,
    odometry: Option<Pose2>,
    /// Of odometry's errors, what was learnt before the present belief.
    learnt: Option<OdometryErrors>,
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
    pub(super) fn odometry_errors(&self) -> Option<OdometryErrors> {
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
    fn so_far(&self, p: &FuseParams) -> OdometryErrors {
        self.odometry_errors().unwrap_or_else(|| OdometryErrors::unknown(p))
    }

    /// Moves on to another odometry pose.
    pub(super) fn predict(&mut self, odom_from_robot: &Pose2, rules: &Rules) {
        if let Some(before) = self.odometry {
            let p = &rules.params;
            let motion = before.between(odom_from_robot);
            let noise = p.motion_noise(&motion);
            if let Some(belief) = &mut self.belief {
                let (motion, noise) = trust::motion(&motion, &noise, &rules.areas.advice(&belief.pose), p);
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
        let only_corrects = fix.modality == Modality::Laser || role == FixRole::Guided;
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
        let fix = &*trust::fix(fix, &at, &advice);
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
                Modality::Laser => self.laser_doubts = 0,
                Modality::Landmarks if role == FixRole::Guided => {}
                Modality::Landmarks => self.doubt = None,
            }
        } else if !matches!(outcome, FixOutcome::GatedOut { .. }) {
            match fix.modality {
                // A scan is laid where the belief says: that it fits there is no word against landmarks that do not.
                Modality::Laser => {
                    self.laser_corrections += 1;
                    self.laser_doubts = 0;
                }
                // Nor is it that a landmark is found where the belief says.
                Modality::Landmarks if role == FixRole::Guided => self.corrections += 1,
                Modality::Landmarks => (self.corrections, self.doubt) = (self.corrections + 1, None),
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
        if fix.modality == Modality::Laser {
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

impl Belief {
    /// A pose, what is known of odometry, and room for `lasting` errors.
    fn new(at: &Pose2Covariance, odometry: &OdometryErrors, lasting: usize) -> Self {
        let n = ROBOT + BLOCK * lasting;
        let mut covariance = DMatrix::zeros(n, n);
        covariance.view_mut((0, 0), (POSE, POSE)).copy_from(&at.covariance);
        covariance.view_mut((POSE, POSE), (2, 2)).copy_from(&odometry.covariance);
        let (odometry, errors) = (odometry.errors, DVector::zeros(n - ROBOT));
        Self { pose: at.pose, odometry, errors, covariance, carried: Vec::new() }
    }

    fn from_fix(fix: &Fix, odometry: &OdometryErrors, now: u64) -> Self {
        let mut belief = Self::new(&fix.pose, odometry, fix.nuisances.len());
        for (k, nuisance) in fix.nuisances.iter().enumerate() {
            let at = ROBOT + BLOCK * k;
            belief.covariance.view_mut((at, at), (BLOCK, BLOCK)).copy_from(&nuisance.covariance);
            // estimate - true = ... + J (true - assumed), and the error of an assumed 0 is -(true - assumed).
            let cross = -nuisance.jacobian * nuisance.covariance;
            belief.covariance.view_mut((0, at), (POSE, BLOCK)).copy_from(&cross);
            belief.covariance.view_mut((at, 0), (BLOCK, POSE)).copy_from(&cross.transpose());
            belief.carried.push(Carried { key: nuisance.key, used: now });
        }
        belief
    }

    fn odometry_errors(&self) -> OdometryErrors {
        let covariance = Matrix2::from_iterator(self.covariance.view((POSE, POSE), (2, 2)).iter().copied());
        OdometryErrors { errors: self.odometry, covariance }
    }

    /// Moves on by a `measured` motion: as odometry's errors have it, with `noise` besides.
    fn predict(&mut self, measured: &Pose2, noise: &Matrix3<f64>, p: &FuseParams) {
        let (length_m, scale) = (measured.position().norm(), 1.0 + self.odometry.x);
        let turn_rad = measured.theta_rad + self.odometry.y * length_m;
        let motion = Pose2::new(scale * measured.x_m, scale * measured.y_m, turn_rad);
        let (by_pose, by_motion) = self.pose.compose_jacobians(&motion);
        let by_errors = by_motion * Matrix3x2::new(measured.x_m, 0.0, measured.y_m, 0.0, 0.0, length_m);
        self.pose = self.pose.compose(&motion);
        let mut f = DMatrix::zeros(POSE, ROBOT);
        f.view_mut((0, 0), (POSE, POSE)).copy_from(&by_pose);
        f.view_mut((0, POSE), (POSE, 2)).copy_from(&by_errors);
        let rows = &f * self.covariance.rows(0, ROBOT);
        self.covariance.rows_mut(0, POSE).copy_from(&rows);
        let columns = self.covariance.columns(0, ROBOT) * f.transpose();
        self.covariance.columns_mut(0, POSE).copy_from(&columns);
        let added = by_motion * noise * by_motion.transpose();
        let mut block = self.covariance.view_mut((0, 0), (POSE, POSE));
        block += added;
        // Floors and loads change: what was learnt of them ages.
        self.covariance[(3, 3)] += p.scale_drift.powi(2) * length_m;
        self.covariance[(4, 4)] += p.turn_bias_drift_rad_per_m.powi(2) * length_m;
    }

    /// Kalman update; the squared Mahalanobis distance of the innovation. `None` when that is singular.
    fn correct(&mut self, fix: &Fix, now: u64) -> Option<f64> {
        let mut at = Vec::with_capacity(fix.nuisances.len());
        for nuisance in &fix.nuisances {
            let known = self.carried.iter().position(|c| c.key == nuisance.key);
            let k = known.unwrap_or_else(|| self.carry(nuisance));
            self.carried[k].used = now;
            at.push(ROBOT + BLOCK * k);
        }
        let n = self.covariance.nrows();
        let mut h = DMatrix::zeros(3, n);
        h.view_mut((0, 0), (3, 3)).fill_with_identity();
        let mut expected = Vector3::zeros();
        for (nuisance, &k) in fix.nuisances.iter().zip(&at) {
            h.view_mut((0, k), (3, BLOCK)).copy_from(&nuisance.jacobian);
            expected += nuisance.jacobian * self.errors.fixed_rows::<6>(k - ROBOT);
        }
        let innovation = fix.pose.pose.minus(&self.pose.plus(&expected));
        let cross = &self.covariance * h.transpose();
        let s = &h * &cross;
        let s = Matrix3::from_iterator(s.iter().copied()) + fix.noise;
        let inverse = s.cholesky()?.inverse();
        let gain = &cross * DMatrix::from_iterator(3, 3, inverse.iter().copied());
        let step = &gain * DVector::from_iterator(3, innovation.iter().copied());
        self.pose = self.pose.plus(&Vector3::new(step[0], step[1], step[2]));
        self.odometry += Vector2::new(step[3], step[4]);
        self.errors += step.rows(ROBOT, n - ROBOT);
        // Joseph's form, multiplied out: stays positive whatever the gain, and costs n^2 instead of n^3.
        let s = DMatrix::from_iterator(3, 3, s.iter().copied());
        let taken = &gain * cross.transpose();
        self.covariance -= &taken + taken.transpose() - &gain * s * gain.transpose();
        // Rounding leaves a little asymmetry that this form, unlike Joseph's, does not shrink with the rest.
        self.covariance = 0.5 * (&self.covariance + self.covariance.transpose());
        self.forget();
        Some(innovation.dot(&(inverse * innovation)))
    }

    /// Adds a lasting error; its index.
    fn carry(&mut self, nuisance: &Nuisance) -> usize {
        let n = self.covariance.nrows();
        let old = std::mem::replace(&mut self.covariance, DMatrix::zeros(0, 0));
        self.covariance = old.resize(n + BLOCK, n + BLOCK, 0.0);
        self.covariance.view_mut((n, n), (BLOCK, BLOCK)).copy_from(&nuisance.covariance);
        let errors = std::mem::replace(&mut self.errors, DVector::zeros(0));
        self.errors = errors.resize_vertically(n - ROBOT + BLOCK, 0.0);
        self.carried.push(Carried { key: nuisance.key, used: 0 });
        self.carried.len() - 1
    }

    /// Keeps at most [`MAX_NUISANCES`] of each kind. To leave one out of a Gaussian is to marginalise it.
    fn forget(&mut self) {
        let is_wall = |c: &Carried| {
            let of_area = matches!(c.key, NuisanceKey::Area(Modality::Laser, _));
            of_area || matches!(c.key, NuisanceKey::Wall(_) | NuisanceKey::Walls(..))
        };
        for walls in [false, true] {
            let all = |carried: &[Carried]| carried.iter().filter(|c| is_wall(c) == walls).count();
            while all(&self.carried) > MAX_NUISANCES {
                let of_kind = (0..self.carried.len()).filter(|&k| is_wall(&self.carried[k]) == walls);
                let Some(k) = of_kind.min_by_key(|&k| self.carried[k].used) else { return };
                self.leave_out(k);
            }
        }
    }

    /// Leaves one lasting error out.
    fn leave_out(&mut self, k: usize) {
        let at = ROBOT + BLOCK * k;
        let old = std::mem::replace(&mut self.covariance, DMatrix::zeros(0, 0));
        self.covariance = old.remove_rows(at, BLOCK).remove_columns(at, BLOCK);
        let errors = std::mem::replace(&mut self.errors, DVector::zeros(0));
        self.errors = errors.remove_rows(at - ROBOT, BLOCK);
        self.carried.remove(k);
    }
}
