//! Least squares of the reprojection over the camera and all poses at once (Zhang; method 16.3.3),
//! with priors as further residuals. Every view has six pose parameters, eliminated view by view.

use crate::{
    camera_calibration::{
        camera_model::{
            ALPHA, CAMERA, HEIGHT, K1, K2, PIXEL_ASPECT, POSTER, Point, State, U0, V0, moved, pixel,
            projected, view_chi2,
        },
        normal_equations::{Normal, Shared, SharedVector},
        params::{CalibrateParams, CameraHeight},
        views::PlanarView,
    },
    pose::linear::{faces_camera, mirrored},
};
use nalgebra::{Isometry3, Matrix3, Matrix6, SMatrix, Vector2, Vector3, Vector6};

/// Most steps of one descent, accepted or not.
const MAX_STEPS: usize = 100;
/// Relative step below which a descent ends.
const STEP_TOLERANCE: f64 = 1e-12;
/// Rounds in which every view is tried in its other minimum.
const FLIPS: usize = 3;

/// How one view fits.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewFit {
    /// Maps the plane's coordinates (x out of it, y right, z up) to the camera's.
    pub camera_from_plane: Isometry3<f64>,
    /// Weighted squared residual.
    pub chi2: f64,
    /// Root mean square residual per coordinate, pixels.
    pub rms_px: f64,
}

/// Residuals and covariance of the solution.
pub(crate) struct Summary {
    pub covariance: Option<Matrix6<f64>>,
    pub views: Vec<ViewFit>,
    pub rms_px: f64,
    pub chi2: f64,
    pub dof: usize,
}

/// The whole least-squares problem.
pub(crate) struct Problem {
    views: Vec<Vec<Point>>,
    /// Which of the shared parameters are fitted.
    free: [bool; CAMERA],
    /// Prior of the shared parameters: information and mean.
    prior: SharedVector,
    at: SharedVector,
    roll_weight: f64,
    height_weight: f64,
}

impl Problem {
    /// `None` when a covariance is not positive definite.
    pub(crate) fn new(views: &[PlanarView], size_px: [f64; 2], p: &CalibrateParams) -> Option<Self> {
        let mut made = Vec::with_capacity(views.len());
        for view in views {
            let mut points = Vec::with_capacity(view.plane_m.len());
            for ((plane, seen), s) in view.plane_m.iter().zip(&view.seen_px).zip(&view.covariance_px2) {
                points.push(Point { plane: *plane, seen: *seen, weight: s.cholesky()?.l().try_inverse()? });
            }
            made.push(points);
        }
        let mut free = [false; CAMERA];
        (free[ALPHA], free[U0], free[V0]) = (true, true, true);
        (free[PIXEL_ASPECT], free[POSTER]) = (p.free_pixel_aspect, !p.known_aspect);
        (free[K1], free[K2]) = (p.radial > 0, p.radial > 1);
        let (mut prior, mut at) = (SharedVector::zeros(), SharedVector::zeros());
        if p.centre_sigma > 0.0 {
            let information = (p.centre_sigma * size_px[0]).powi(-2);
            (prior[U0], prior[V0]) = (information, information);
            (at[U0], at[V0]) = (0.5 * (size_px[0] - 1.0), 0.5 * (size_px[1] - 1.0));
        }
        let height_weight = match p.height {
            CameraHeight::Free => 0.0,
            // One height for all views, known to sigma: a free parameter would have two priors.
            CameraHeight::Known { height_m, sigma_m } => {
                at[HEIGHT] = height_m;
                1.0 / sigma_m
            }
            CameraHeight::Constant { sigma_m } => {
                free[HEIGHT] = true;
                1.0 / sigma_m
            }
        };
        let roll_weight = if p.roll_sigma_rad > 0.0 { 1.0 / p.roll_sigma_rad } else { 0.0 };
        Some(Self { views: made, free, prior, at, roll_weight, height_weight })
    }

    /// Weighted squared residual, priors included; infinite where a point is not in front of the
    /// camera.
    pub(crate) fn chi2(&self, state: &State) -> f64 {
        let mut sum = self.prior_chi2(state);
        for (view, pose) in self.views.iter().zip(&state.poses) {
            sum += view_chi2(view, pose, state) + self.known_chi2(pose, state);
        }
        if sum.is_nan() { f64::INFINITY } else { sum }
    }

    fn prior_chi2(&self, state: &State) -> f64 {
        (0..CAMERA).map(|k| self.prior[k] * (state.camera[k] - self.at[k]).powi(2)).sum()
    }

    /// Squared residual of the priors on roll and height of one view.
    fn known_chi2(&self, pose: &Isometry3<f64>, state: &State) -> f64 {
        let up = pose.rotation * Vector3::z();
        let height = -up.dot(&pose.translation.vector);
        (self.roll_weight * up.x).powi(2) + (self.height_weight * (self.height(state) - height)).powi(2)
    }

    fn height(&self, state: &State) -> f64 {
        if self.free[HEIGHT] { state.camera[HEIGHT] } else { self.at[HEIGHT] }
    }

    /// Start value of the plane's height over width, from the homographies, where it is not known.
    pub(crate) fn fit_poster(&self, state: &mut State, homographies: &[Matrix3<f64>]) {
        if !self.free[POSTER] {
            return;
        }
        let c = &state.camera;
        let (f, a) = (c[ALPHA], c[PIXEL_ASPECT]);
        let k = Matrix3::new(f, 0.0, c[U0], 0.0, f, c[V0] / a, 0.0, 0.0, 1.0);
        let Some(inverse) = k.try_inverse() else { return };
        let mut ratios: Vec<f64> = homographies
            .iter()
            .map(|h| {
                let b = inverse * h;
                (b.column(1).norm() / b.column(0).norm()).ln()
            })
            .filter(|r| r.is_finite())
            .collect();
        ratios.sort_by(f64::total_cmp);
        state.camera[POSTER] = ratios.get(ratios.len() / 2).copied().unwrap_or(0.0);
        for pose in &mut state.poses {
            // One column of Eq. (2) had the wrong scale: the distance follows from the other alone.
            pose.translation.vector *= (0.5 * state.camera[POSTER]).exp();
        }
    }

    /// Sets the height to the mean over the views, where it is constant and not known.
    pub(crate) fn fit_height(&self, state: &mut State) {
        let height = |pose: &Isometry3<f64>| -(pose.rotation * Vector3::z()).dot(&pose.translation.vector);
        let n = state.poses.len().max(1) as f64;
        state.camera[HEIGHT] =
            if self.free[HEIGHT] { state.poses.iter().map(height).sum::<f64>() / n } else { self.at[HEIGHT] };
    }

    /// Each pose at its own least squares for the camera as it is, in the better of the two minima
    /// (method 13.4).
    pub(crate) fn posed(&self, mut state: State) -> Option<State> {
        for i in 0..state.poses.len() {
            let linear = state.poses[i];
            let ways = [linear, mirrored(&linear)].map(|start| self.descend_view(i, start, &state));
            let better = ways.into_iter().flatten().filter(|(pose, _)| faces_camera(pose));
            state.poses[i] = better.min_by(|a, b| a.1.total_cmp(&b.1))?.0;
        }
        Some(state)
    }

    /// Optimises one pose with the camera fixed.
    fn descend_view(&self, i: usize, start: Isometry3<f64>, state: &State) -> Option<(Isometry3<f64>, f64)> {
        let cost_of = |pose: &Isometry3<f64>| view_chi2(&self.views[i], pose, state);
        let (mut pose, mut damping) = (start, 1e-4);
        let mut cost = cost_of(&pose);
        if !cost.is_finite() {
            return None;
        }
        for _ in 0..MAX_STEPS {
            let (mut h, mut g) = (Matrix6::zeros(), Vector6::zeros());
            for point in &self.views[i] {
                let seen = projected(point, &pose, &state.camera)?;
                let j = point.weight * seen.by_pose;
                h += j.transpose() * j;
                g += j.transpose() * (point.weight * (point.seen - seen.px));
            }
            for k in 0..6 {
                h[(k, k)] *= 1.0 + damping;
            }
            let step = h.cholesky()?.solve(&g);
            let next = moved(&pose, &step);
            let next_cost = cost_of(&next);
            let small = step.norm() < 1e-9 * (1.0 + pose.translation.vector.norm());
            if next_cost <= cost {
                (pose, cost, damping) = (next, next_cost, (damping * 0.2).max(1e-15));
            } else {
                damping *= 8.0;
            }
            if small || damping > 1e12 {
                break;
            }
        }
        Some((pose, cost))
    }

    /// Optimises all parameters, then tries each view in its other minimum, until chi2 no longer
    /// falls.
    pub(crate) fn descend(&self, state: State) -> Option<State> {
        let mut state = self.descend_all(state)?;
        for _ in 0..FLIPS {
            let before: Vec<f64> =
                (0..state.poses.len()).map(|i| view_chi2(&self.views[i], &state.poses[i], &state)).collect();
            let mut tried = state.clone();
            let mut better = false;
            for (i, before) in before.iter().enumerate() {
                let other = self.descend_view(i, mirrored(&state.poses[i]), &state);
                if let Some((pose, cost)) = other.filter(|(pose, _)| faces_camera(pose)) {
                    let known = self.known_chi2(&state.poses[i], &state) - self.known_chi2(&pose, &state);
                    if cost - known < before - 1e-9 {
                        tried.poses[i] = pose;
                        better = true;
                    }
                }
            }
            if !better {
                break;
            }
            let next = self.descend_all(tried)?;
            if self.chi2(&next) >= self.chi2(&state) {
                break;
            }
            state = next;
        }
        Some(state)
    }

    /// Levenberg-Marquardt over the shared parameters and all poses.
    fn descend_all(&self, start: State) -> Option<State> {
        let (mut state, mut damping) = (start, 1e-4);
        let mut cost = self.chi2(&state);
        if !cost.is_finite() {
            return None;
        }
        for _ in 0..MAX_STEPS {
            let normal = self.normal(&state)?;
            let Some((step, steps)) = normal.step(self.free, damping) else {
                damping *= 8.0;
                if damping > 1e12 {
                    break;
                }
                continue;
            };
            let mut next = state.clone();
            for k in 0..CAMERA {
                next.camera[k] += step[k];
            }
            for (pose, step) in next.poses.iter_mut().zip(&steps) {
                *pose = moved(pose, step);
            }
            let next_cost = if next.camera[ALPHA] > 1.0 { self.chi2(&next) } else { f64::INFINITY };
            let relative = (step[ALPHA] / state.camera[ALPHA]).abs()
                + steps.iter().map(nalgebra::Matrix::norm).fold(0.0, f64::max);
            if next_cost <= cost {
                (state, cost, damping) = (next, next_cost, (damping * 0.2).max(1e-15));
            } else {
                damping *= 8.0;
            }
            if relative < STEP_TOLERANCE || damping > 1e12 {
                break;
            }
        }
        Some(state)
    }

    fn normal(&self, state: &State) -> Option<Normal> {
        let mut made = Normal { shared: Shared::zeros(), shared_g: SharedVector::zeros(), views: vec![] };
        for k in 0..CAMERA {
            made.shared[(k, k)] += self.prior[k];
            made.shared_g[k] += self.prior[k] * (self.at[k] - state.camera[k]);
        }
        for (view, pose) in self.views.iter().zip(&state.poses) {
            let mut own = (Matrix6::zeros(), SMatrix::<f64, CAMERA, 6>::zeros(), Vector6::zeros());
            for point in view {
                let seen = projected(point, pose, &state.camera)?;
                let (jp, js) = (point.weight * seen.by_pose, point.weight * seen.by_shared);
                let r: Vector2<f64> = point.weight * (point.seen - seen.px);
                own.0 += jp.transpose() * jp;
                own.1 += js.transpose() * jp;
                own.2 += jp.transpose() * r;
                made.shared += js.transpose() * js;
                made.shared_g += js.transpose() * r;
            }
            self.add_known(pose, state, &mut own, &mut made);
            made.views.push(own);
        }
        Some(made)
    }

    /// Adds the priors on roll and height of one view.
    fn add_known(
        &self,
        pose: &Isometry3<f64>,
        state: &State,
        own: &mut (Matrix6<f64>, SMatrix<f64, CAMERA, 6>, Vector6<f64>),
        made: &mut Normal,
    ) {
        let up = pose.rotation * Vector3::z();
        let t = pose.translation.vector;
        // d(up) = phi x up; its x: phi_y up_z - phi_z up_y.
        let by_roll = Vector6::new(0.0, up.z, -up.y, 0.0, 0.0, 0.0) * self.roll_weight;
        own.0 += by_roll * by_roll.transpose();
        own.2 -= by_roll * (self.roll_weight * up.x);
        // height = -up . T; d = -phi . (up x T) - up . dT.
        let turn = up.cross(&t);
        let by_height = -Vector6::new(turn.x, turn.y, turn.z, up.x, up.y, up.z) * self.height_weight;
        let r = self.height_weight * (self.height(state) + up.dot(&t));
        own.0 += by_height * by_height.transpose();
        own.2 += by_height * r;
        let mut by_shared = SharedVector::zeros();
        by_shared[HEIGHT] = -self.height_weight;
        own.1 += by_shared * by_height.transpose();
        made.shared += by_shared * by_shared.transpose();
        made.shared_g += by_shared * r;
    }

    /// Residuals and covariance of the solution.
    pub(crate) fn summary(&self, state: &State, refined: bool) -> Option<Summary> {
        let (mut views, mut squares, mut count) = (vec![], 0.0, 0);
        for (view, pose) in self.views.iter().zip(&state.poses) {
            let mut sum = 0.0;
            for point in view {
                sum += (point.seen - pixel(point, pose, &state.camera)?).norm_squared();
            }
            let n = 2 * view.len();
            let chi2 = view_chi2(view, pose, state);
            views.push(ViewFit { camera_from_plane: *pose, chi2, rms_px: (sum / n as f64).sqrt() });
            (squares, count) = (squares + sum, count + n);
        }
        let known = [self.roll_weight, self.height_weight].iter().filter(|w| **w > 0.0).count();
        let priors = self.prior.iter().filter(|v| **v > 0.0).count();
        let sought = 6 * views.len() + self.free.iter().filter(|f| **f).count();
        let dof = (count + known * views.len() + priors).saturating_sub(sought);
        let chi2 = self.chi2(state);
        let mut covariance = None;
        if refined {
            let scale = if dof > 0 { (chi2 / dof as f64).max(1.0) } else { 1.0 };
            let all = self.normal(state)?.covariance(self.free)? * scale;
            let order = [ALPHA, U0, V0, K1, K2, PIXEL_ASPECT];
            covariance = Some(Matrix6::from_fn(|i, j| all[(order[i], order[j])]));
        }
        let rms_px = (squares / count.max(1) as f64).sqrt();
        let finite = chi2.is_finite() && covariance.is_none_or(|c| c.iter().all(|v| v.is_finite()));
        finite.then_some(Summary { covariance, views, rms_px, chi2, dof })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera_calibration::calibrate::tests::scene;

    /// Oracle: central differences of the residuals by every parameter.
    #[test]
    fn gradients_are_the_finite_differences() {
        let p = CalibrateParams {
            free_pixel_aspect: true,
            known_aspect: false,
            roll_sigma_rad: 0.02,
            height: CameraHeight::Constant { sigma_m: 0.05 },
            radial: 2,
            centre_sigma: 0.1,
            ..CalibrateParams::default()
        };
        let (views, poses) = scene(5, 3, 0.7);
        let problem = Problem::new(&views, [1280.0, 960.0], &p).unwrap();
        let camera = [850.0, 1.01, 600.0, 470.0, -0.1, 0.03, 0.02, 0.2];
        let state = State { camera, poses };
        let normal = problem.normal(&state).unwrap();
        let half = |s: &State| 0.5 * problem.chi2(s);
        for (k, step) in [1e-4, 1e-6, 1e-4, 1e-4, 1e-7, 1e-7, 1e-6, 1e-6].iter().enumerate() {
            let at = |d: f64| {
                let mut s = state.clone();
                s.camera[k] += d;
                half(&s)
            };
            let numeric = -(at(*step) - at(-step)) / (2.0 * step);
            let got = normal.shared_g[k];
            assert!((numeric - got).abs() < 1e-5 * (1.0 + got.abs()), "shared {k}: {got} for {numeric}");
        }
        for i in 0..views.len() {
            for k in 0..6 {
                let at = |d: f64| {
                    let (mut s, mut step) = (state.clone(), Vector6::zeros());
                    step[k] = d;
                    s.poses[i] = moved(&s.poses[i], &step);
                    half(&s)
                };
                let numeric = -(at(1e-6) - at(-1e-6)) / 2e-6;
                let got = normal.views[i].2[k];
                assert!(
                    (numeric - got).abs() < 1e-4 * (1.0 + got.abs()),
                    "view {i}, {k}: {got} for {numeric}"
                );
            }
        }
    }
}
