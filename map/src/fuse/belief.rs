//! Robot pose, systematic odometry errors and nuisance parameters in one Gaussian: prediction and
//! Kalman update.

use crate::{
    fuse::params::FuseParams,
    localise::{Fix, FixSource, Nuisance, NuisanceKey},
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, Matrix3x2, Vector2, Vector3};

/// Most nuisance parameters of landmarks and extrinsics in the state, and as many of walls; the one
/// unused for longest is dropped first.
pub const MAX_NUISANCES: usize = 12;
/// Size of the pose's block.
const POSE: usize = 3;
/// Size of the robot's block: pose and systematic odometry errors (scale, drift).
const ROBOT: usize = 5;
/// Size of a nuisance parameter's block.
const BLOCK: usize = 6;

/// A nuisance parameter in the state.
#[derive(Debug, Clone)]
struct Carried {
    key: NuisanceKey,
    /// Count of fixes when it was last used.
    used: u64,
}

/// Systematic odometry errors: true distance = (1 + scale) x measured; true heading = measured +
/// drift x distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SystematicOdometryError {
    /// Scale (share) and drift (rad/m).
    pub errors: Vector2<f64>,
    /// Covariance of (scale, drift).
    pub covariance: Matrix2<f64>,
}

impl SystematicOdometryError {
    /// The prior for a robot without history.
    pub(super) fn unknown(p: &FuseParams) -> Self {
        let variances = Vector2::new(p.scale_sigma.powi(2), p.turn_bias_sigma_rad_per_m.powi(2));
        Self { errors: Vector2::zeros(), covariance: Matrix2::from_diagonal(&variances) }
    }
}

/// The state: pose, odometry errors, nuisance parameters (true minus assumed) in the order of
/// `carried`.
#[derive(Debug, Clone)]
pub(super) struct Belief {
    pub(super) pose: Pose2,
    odometry: Vector2<f64>,
    errors: DVector<f64>,
    pub(super) covariance: DMatrix<f64>,
    carried: Vec<Carried>,
}

impl Belief {
    /// A pose, the odometry errors, and zeros for `count` nuisance parameters.
    pub(super) fn new(at: &Pose2Covariance, odometry: &SystematicOdometryError, count: usize) -> Self {
        let n = ROBOT + BLOCK * count;
        let mut covariance = DMatrix::zeros(n, n);
        covariance.view_mut((0, 0), (POSE, POSE)).copy_from(&at.covariance);
        covariance.view_mut((POSE, POSE), (2, 2)).copy_from(&odometry.covariance);
        let (odometry, errors) = (odometry.errors, DVector::zeros(n - ROBOT));
        Self { pose: at.pose, odometry, errors, covariance, carried: Vec::new() }
    }

    pub(super) fn from_fix(fix: &Fix, odometry: &SystematicOdometryError, now: u64) -> Self {
        let mut belief = Self::new(&fix.pose, odometry, fix.nuisances.len());
        for (k, nuisance) in fix.nuisances.iter().enumerate() {
            let at = ROBOT + BLOCK * k;
            belief.covariance.view_mut((at, at), (BLOCK, BLOCK)).copy_from(&nuisance.covariance);
            // estimate - true = ... + J (true - assumed), and the error of an assumed 0 is -(true -
            // assumed).
            let cross = -nuisance.jacobian * nuisance.covariance;
            belief.covariance.view_mut((0, at), (POSE, BLOCK)).copy_from(&cross);
            belief.covariance.view_mut((at, 0), (BLOCK, POSE)).copy_from(&cross.transpose());
            belief.carried.push(Carried { key: nuisance.key, used: now });
        }
        belief
    }

    pub(super) fn odometry_errors(&self) -> SystematicOdometryError {
        let covariance = Matrix2::from_iterator(self.covariance.view((POSE, POSE), (2, 2)).iter().copied());
        SystematicOdometryError { errors: self.odometry, covariance }
    }

    /// Prediction by a `measured` motion, corrected by the systematic odometry errors, with
    /// additional `noise`.
    pub(super) fn predict(&mut self, measured: &Pose2, noise: &Matrix3<f64>, p: &FuseParams) {
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
        // Random walk of the systematic errors: floors and loads change.
        self.covariance[(3, 3)] += p.scale_drift.powi(2) * length_m;
        self.covariance[(4, 4)] += p.turn_bias_drift_rad_per_m.powi(2) * length_m;
    }

    /// Kalman update. Gives the squared Mahalanobis distance of the innovation; `None` when its
    /// covariance is singular.
    pub(super) fn correct(&mut self, fix: &Fix, now: u64) -> Option<f64> {
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
        // Joseph's form, multiplied out: stays positive whatever the gain, and costs n^2 instead of
        // n^3.
        let s = DMatrix::from_iterator(3, 3, s.iter().copied());
        let taken = &gain * cross.transpose();
        self.covariance -= &taken + taken.transpose() - &gain * s * gain.transpose();
        // Rounding leaves a little asymmetry that this form, unlike Joseph's, does not shrink with
        // the rest.
        self.covariance = 0.5 * (&self.covariance + self.covariance.transpose());
        self.forget();
        Some(innovation.dot(&(inverse * innovation)))
    }

    /// Adds a nuisance parameter; gives its index.
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

    /// Keeps at most [`MAX_NUISANCES`] of each kind; the others are marginalised.
    fn forget(&mut self) {
        let is_wall = |c: &Carried| {
            let of_area = matches!(c.key, NuisanceKey::Area(FixSource::Laser, _));
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

    /// Marginalises one nuisance parameter.
    fn leave_out(&mut self, k: usize) {
        let at = ROBOT + BLOCK * k;
        let old = std::mem::replace(&mut self.covariance, DMatrix::zeros(0, 0));
        self.covariance = old.remove_rows(at, BLOCK).remove_columns(at, BLOCK);
        let errors = std::mem::replace(&mut self.errors, DVector::zeros(0));
        self.errors = errors.remove_rows(at - ROBOT, BLOCK);
        self.carried.remove(k);
    }
}
