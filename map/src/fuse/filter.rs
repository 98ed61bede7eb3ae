//! The filter itself: robot pose and lasting errors in one Gaussian; predict, correct, start, give up.

use super::{FixOutcome, FuseParams};
use crate::{
    localise::{Fix, Nuisance, NuisanceKey},
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use vision::recognise::LandmarkId;

/// Most lasting errors (landmarks, mounting) carried along; the one unused for longest goes first.
pub const MAX_NUISANCES: usize = 12;
/// Size of the robot's block.
const ROBOT: usize = 3;
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

/// What is believed: the pose, then the lasting errors (true minus assumed) in the order of `carried`.
#[derive(Debug, Clone)]
struct Belief {
    pose: Pose2,
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

    /// Contradicting fixes in a row.
    pub(super) fn doubts(&self) -> u32 {
        self.doubt.as_ref().map_or(0, |d| d.count)
    }

    /// Starts, or starts again, from a pose that is given.
    pub(super) fn start(&mut self, at: &Pose2Covariance) {
        let covariance = DMatrix::from_iterator(3, 3, at.covariance.iter().copied());
        let belief = Belief { pose: at.pose, errors: DVector::zeros(0), covariance, carried: Vec::new() };
        (self.belief, self.doubt, self.last) = (Some(belief), None, None);
    }

    /// Moves on to another odometry pose.
    pub(super) fn predict(&mut self, odom_from_robot: &Pose2, p: &FuseParams) {
        if let Some(before) = self.odometry {
            let motion = before.between(odom_from_robot);
            let noise = p.motion_noise(&motion);
            if let Some(belief) = &mut self.belief {
                belief.predict(&motion, &noise);
            }
            if let Some(doubt) = &mut self.doubt {
                doubt.pose = doubt.pose.compose(&Pose2Covariance { pose: motion, covariance: noise });
            }
        }
        self.odometry = Some(*odom_from_robot);
    }

    /// The odometry frame is no longer the same: where the robot is now is unknown.
    pub(super) fn lose(&mut self, odom_from_robot: &Pose2) {
        (self.belief, self.doubt, self.last) = (None, None, None);
        self.odometry = Some(*odom_from_robot);
    }

    /// Takes a fix at the time of the last odometry.
    pub(super) fn correct(&mut self, fix: &Fix, p: &FuseParams) -> FixOutcome {
        if self.is_repeated(fix, p) {
            return FixOutcome::Repeated;
        }
        self.fixes += 1;
        let outcome = match &mut self.belief {
            None => {
                self.belief = Some(Belief::from_fix(fix, self.fixes));
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
            self.belief = Some(Belief::from_fix(fix, self.fixes));
            return FixOutcome::Reset;
        }
        let in_a_row = doubt.count;
        self.doubt = Some(doubt);
        FixOutcome::GatedOut { distance2, in_a_row }
    }
}

impl Belief {
    fn from_fix(fix: &Fix, now: u64) -> Self {
        let n = ROBOT + BLOCK * fix.nuisances.len();
        let mut covariance = DMatrix::zeros(n, n);
        covariance.view_mut((0, 0), (3, 3)).copy_from(&fix.pose.covariance);
        let mut carried = Vec::new();
        for (k, nuisance) in fix.nuisances.iter().enumerate() {
            let at = ROBOT + BLOCK * k;
            covariance.view_mut((at, at), (BLOCK, BLOCK)).copy_from(&nuisance.covariance);
            // estimate - true = ... + J (true - assumed), and the error of an assumed 0 is -(true - assumed).
            let cross = -nuisance.jacobian * nuisance.covariance;
            covariance.view_mut((0, at), (ROBOT, BLOCK)).copy_from(&cross);
            covariance.view_mut((at, 0), (BLOCK, ROBOT)).copy_from(&cross.transpose());
            carried.push(Carried { key: nuisance.key, used: now });
        }
        Self { pose: fix.pose.pose, errors: DVector::zeros(n - ROBOT), covariance, carried }
    }

    fn predict(&mut self, motion: &Pose2, noise: &Matrix3<f64>) {
        let (by_pose, by_motion) = self.pose.compose_jacobians(motion);
        self.pose = self.pose.compose(motion);
        let f = DMatrix::from_iterator(3, 3, by_pose.iter().copied());
        let rows = &f * self.covariance.rows(0, ROBOT);
        self.covariance.rows_mut(0, ROBOT).copy_from(&rows);
        let columns = self.covariance.columns(0, ROBOT) * f.transpose();
        self.covariance.columns_mut(0, ROBOT).copy_from(&columns);
        let added = by_motion * noise * by_motion.transpose();
        let mut block = self.covariance.view_mut((0, 0), (3, 3));
        block += added;
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
