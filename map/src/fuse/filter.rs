//! The filter itself: robot pose and lasting errors in one Gaussian; predict, correct, start, give up.

use super::{FixOutcome, FuseParams};
use crate::{
    localise::{Fix, Nuisance, NuisanceKey},
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, Matrix3x2, Vector2, Vector3};
use vision::recognise::LandmarkId;

/// Most lasting errors (landmarks, mounting) carried along; the one unused for longest goes first.
pub const MAX_NUISANCES: usize = 12;
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
    /// Odometry and landmarks at the last applied fix.
    last: Option<(Pose2, Vec<LandmarkId>)>,
    pub corrections: u64,
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
        self.doubt.as_ref().map_or(0, |d| d.count)
    }

    /// Starts, or starts again, from a pose that is given.
    pub(super) fn start(&mut self, at: &Pose2Covariance, p: &FuseParams) {
        let belief = Belief::new(at, &self.so_far(p), 0);
        (self.belief, self.doubt, self.last) = (Some(belief), None, None);
    }

    /// Of odometry's errors, what is known so far.
    fn so_far(&self, p: &FuseParams) -> OdometryErrors {
        self.odometry_errors().unwrap_or_else(|| OdometryErrors::unknown(p))
    }

    /// Moves on to another odometry pose.
    pub(super) fn predict(&mut self, odom_from_robot: &Pose2, p: &FuseParams) {
        if let Some(before) = self.odometry {
            let motion = before.between(odom_from_robot);
            let noise = p.motion_noise(&motion);
            if let Some(belief) = &mut self.belief {
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
        (self.belief, self.doubt, self.last) = (None, None, None);
        self.odometry = Some(*odom_from_robot);
    }

    /// Takes a fix at the time of the last odometry.
    pub(super) fn correct(&mut self, fix: &Fix, p: &FuseParams) -> FixOutcome {
        if self.is_repeated(fix, p) {
            return FixOutcome::Repeated;
        }
        self.fixes += 1;
        let so_far = self.so_far(p);
        let outcome = match &mut self.belief {
            None => {
                self.belief = Some(Belief::from_fix(fix, &so_far, self.fixes));
                FixOutcome::Started
            }
            Some(belief) => {
                let mut next = belief.clone();
                match next.correct(fix, self.fixes) {
                    Some(distance2) if distance2 <= p.gate_chi2 => {
                        *belief = next;
                        FixOutcome::Applied { distance2 }
                    }
                    distance2 => self.contradict(fix, distance2.unwrap_or(f64::INFINITY), p),
                }
            }
        };
        if !matches!(outcome, FixOutcome::GatedOut { .. }) {
            self.doubt = None;
            self.corrections += 1;
            self.last = self.odometry.map(|o| (o, fix.landmarks.clone()));
        }
        outcome
    }

    /// The same landmarks from the same place: its corner errors are largely those of the last time.
    fn is_repeated(&self, fix: &Fix, p: &FuseParams) -> bool {
        let (Some((before, landmarks)), Some(now)) = (&self.last, &self.odometry) else { return false };
        let motion = before.between(now);
        let still = motion.position().norm() < p.min_move_m && motion.theta_rad.abs() < p.min_turn_rad;
        still && *landmarks == fix.landmarks
    }

    /// Counts contradictions; enough of them that agree replace the belief.
    fn contradict(&mut self, fix: &Fix, distance2: f64, p: &FuseParams) -> FixOutcome {
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
        let gain = cross * DMatrix::from_iterator(3, 3, inverse.iter().copied());
        let step = &gain * DVector::from_iterator(3, innovation.iter().copied());
        self.pose = self.pose.plus(&Vector3::new(step[0], step[1], step[2]));
        self.odometry += Vector2::new(step[3], step[4]);
        self.errors += step.rows(ROBOT, n - ROBOT);
        // Joseph's form: stays symmetric and positive.
        let keep = DMatrix::identity(n, n) - &gain * h;
        let noise = DMatrix::from_iterator(3, 3, fix.noise.iter().copied());
        self.covariance = &keep * &self.covariance * keep.transpose() + &gain * noise * gain.transpose();
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

    /// Keeps at most [`MAX_NUISANCES`]. To leave one out of a Gaussian is to marginalise it.
    fn forget(&mut self) {
        while self.carried.len() > MAX_NUISANCES {
            let Some(k) = (0..self.carried.len()).min_by_key(|&k| self.carried[k].used) else { return };
            let at = ROBOT + BLOCK * k;
            let old = std::mem::replace(&mut self.covariance, DMatrix::zeros(0, 0));
            self.covariance = old.remove_rows(at, BLOCK).remove_columns(at, BLOCK);
            let errors = std::mem::replace(&mut self.errors, DVector::zeros(0));
            self.errors = errors.remove_rows(at - ROBOT, BLOCK);
            self.carried.remove(k);
        }
    }
}
