//! Which number explains that landmarks fit no floor pose (method 13.7). In: the observations of a
//! refused fix, extrinsics, an optional prior pose. Out: the numbers that make them fit if they are
//! changed, each by itself: the size of a landmark, the height or the tilt of the camera; with the
//! value that fits best and its standard deviation.

use crate::{
    extrinsics::CameraExtrinsics,
    gate::{Z_95, chi2_quantile},
    localise::{
        fix::LandmarkObservation,
        params::LocaliseParams,
        planar::{MAX_STEPS, Planar, PoseLinearisation},
        robot_pose::largest,
        solve::minima,
    },
    place::LandmarkPlace,
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{DMatrix, Matrix3, Matrix4, Translation3, UnitQuaternion, Vector3, Vector4};
use vision::{model::LandmarkId, pose::LandmarkSize};

/// Step of the numerical derivatives: log of the size, metres, radians.
const DERIVATIVE_STEP: f64 = 1e-5;
/// A step below this (metres, radians, log of the size) ends a descent.
const STEP_TOLERANCE: f64 = 1e-9;
/// Largest change of a size: this factor, or its inverse.
const MAX_SIZE_FACTOR: f64 = 10.0;
/// Highest camera above the floor, metres.
const MAX_CAMERA_HEIGHT_M: f64 = 10.0;
/// Largest change of the tilt, radians.
const MAX_TILT_CHANGE_RAD: f64 = 1.2;
/// Standard deviations of mistakes, for the order of the causes: log of the size, metres, radians.
const LIKELY: [f64; 3] = [0.4, 0.3, 0.1];

/// A number that a fix rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FixQuantity {
    /// Width of a landmark, metres; its height is wrong by the same factor.
    Size(LandmarkId),
    /// Height of the camera above the floor, metres.
    CameraHeight,
    /// Angle of the camera's axis above the horizon, radians.
    CameraTilt,
    /// The extrinsics as a whole, or the landmark's place: no other quantity alone explains the
    /// corners. The value is the root mean square of the re-projection error, pixels.
    Mounting,
}

/// A quantity that explains a refusal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefusalCause {
    /// Which quantity.
    pub quantity: FixQuantity,
    /// The value that was stated; of `Mounting`, about the largest that is accepted.
    pub expected: f64,
    /// The value that fits the corners; of `Mounting`, that of the best pose.
    pub measured: f64,
    /// Standard deviation of `measured`; 0 for `Mounting`.
    pub sigma: f64,
}

/// The causes of a refusal by re-projection error, the likeliest first. Causes that cannot be told
/// apart are all there: one landmark of another size at another distance looks the same at another
/// height. A prior pose tells them apart.
pub fn refusal_causes(
    observations: &[LandmarkObservation<'_>],
    mounting: &CameraExtrinsics,
    prior: Option<&Pose2Covariance>,
    p: &LocaliseParams,
) -> Vec<RefusalCause> {
    let used = largest(observations);
    let changes = (0..used.len()).map(Change::Size).chain([Change::Height, Change::Tilt]);
    let search = Search { observations: &used, mounting, prior, p };
    let mut found: Vec<(Change, Explanation)> =
        changes.filter_map(|change| Some((change, search.best(change)?))).collect();
    let lowest = found.iter().map(|(_, e)| e.chi2).fold(f64::INFINITY, f64::min);
    let scale = (lowest / chi2_quantile(search.dof(), Z_95)).max(1.0);
    found.retain(|(_, e)| e.chi2 - lowest < p.ambiguous_chi2 * scale);
    let unlikely = |(change, e): &(Change, Explanation)| e.chi2 / scale + (e.value / change.likely()).powi(2);
    found.sort_by(|a, b| unlikely(a).total_cmp(&unlikely(b)));
    let causes: Vec<RefusalCause> = found.into_iter().map(|(change, e)| search.cause(change, &e)).collect();
    if causes.is_empty() { search.unexplained().into_iter().collect() } else { causes }
}

/// What is changed: the size of an observed landmark by the exponential of the value, the camera's
/// height (m) or tilt (rad) by the value.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Change {
    Size(usize),
    Height,
    Tilt,
}

impl Change {
    fn likely(self) -> f64 {
        let [size, height_m, tilt_rad] = LIKELY;
        match self {
            Self::Size(_) => size,
            Self::Height => height_m,
            Self::Tilt => tilt_rad,
        }
    }

    /// Values from which a fit starts.
    fn starts(self) -> [f64; 3] {
        match self {
            Self::Size(_) => [0.0, -0.5, 0.5],
            Self::Height => [0.0, -0.4, 0.4],
            Self::Tilt => [0.0, -0.2, 0.2],
        }
    }

    fn place(self, index: usize, place: &LandmarkPlace, value: f64) -> LandmarkPlace {
        let factor = if self == Self::Size(index) { value.exp() } else { 1.0 };
        let LandmarkSize { width_m, height_m } = place.size;
        let size = LandmarkSize { width_m: factor * width_m, height_m: factor * height_m };
        LandmarkPlace { size, ..*place }
    }

    fn mounting(self, mounting: &CameraExtrinsics, value: f64) -> CameraExtrinsics {
        let mut robot_from_camera = mounting.robot_from_camera;
        match self {
            Self::Size(_) => {}
            Self::Height => {
                robot_from_camera.translation =
                    Translation3::from(robot_from_camera.translation.vector + value * Vector3::z());
            }
            // A positive turn about the camera's own x axis raises its view.
            Self::Tilt => {
                robot_from_camera.rotation *= UnitQuaternion::from_axis_angle(&Vector3::x_axis(), value);
            }
        }
        CameraExtrinsics { robot_from_camera, covariance: mounting.covariance }
    }
}

/// A pose and a value that fit.
struct Explanation {
    value: f64,
    sigma: f64,
    /// With the squared distance to the prior pose.
    chi2: f64,
}

/// Where a descent is.
struct State {
    pose: Pose2,
    value: f64,
    linearisation: PoseLinearisation,
    /// With the squared distance to the prior pose.
    chi2: f64,
}

struct Search<'a> {
    observations: &'a [LandmarkObservation<'a>],
    mounting: &'a CameraExtrinsics,
    prior: Option<&'a Pose2Covariance>,
    p: &'a LocaliseParams,
}

impl Search<'_> {
    /// Degrees of freedom with one more parameter than the pose.
    fn dof(&self) -> usize {
        8 * self.observations.len() - 4
    }

    /// Looks at the problem with a changed value.
    fn with<T>(&self, change: Change, value: f64, look: impl FnOnce(&Planar<'_>) -> T) -> T {
        let places: Vec<LandmarkPlace> =
            self.observations.iter().enumerate().map(|(i, o)| change.place(i, o.place, value)).collect();
        let changed: Vec<LandmarkObservation<'_>> = self
            .observations
            .iter()
            .zip(&places)
            .map(|(o, place)| LandmarkObservation { place, ..*o })
            .collect();
        look(&Planar::new(&changed, &change.mounting(self.mounting, value)))
    }

    /// The best fit with this value free, where one passes the gates.
    fn best(&self, change: Change) -> Option<Explanation> {
        let fits = change.starts().into_iter().flat_map(|value| {
            let starts = self.with(change, value, |problem| self.start_poses(problem, change, value));
            starts.into_iter().filter_map(move |pose| self.fit(change, pose, value))
        });
        let best = fits.min_by(|a, b| a.0.chi2.total_cmp(&b.0.chi2));
        let (State { pose, value, chi2, .. }, sigma) = best?;
        let distance2 = self.prior.map_or(0.0, |prior| distance2(&pose, prior));
        let limit = self.p.max_reduced_chi2 * self.dof() as f64;
        let fits = chi2 - distance2 <= limit && distance2 <= self.p.prior_gate;
        let in_front = self.with(change, value, |problem| problem.is_in_front(&pose));
        (fits && in_front && self.is_possible(change, value)).then_some(Explanation { value, sigma, chi2 })
    }

    fn is_possible(&self, change: Change, value: f64) -> bool {
        match change {
            Change::Size(_) => value.abs() <= MAX_SIZE_FACTOR.ln(),
            Change::Height => {
                let height_m = self.mounting.robot_from_camera.translation.z + value;
                (0.0..=MAX_CAMERA_HEIGHT_M).contains(&height_m)
            }
            Change::Tilt => value.abs() <= MAX_TILT_CHANGE_RAD,
        }
    }

    /// Poses that follow from each observation by itself.
    fn start_poses(&self, problem: &Planar<'_>, change: Change, value: f64) -> Vec<Pose2> {
        let mut starts: Vec<Pose2> = Vec::new();
        for (i, observation) in self.observations.iter().enumerate() {
            for solution in
                [Some(&observation.seen.best), observation.seen.second.as_ref()].into_iter().flatten()
            {
                let mut seen = solution.camera_from_landmark;
                if change == Change::Size(i) {
                    seen.translation.vector *= value.exp();
                }
                starts.push(problem.robot_from_observation(i, &seen).0);
            }
        }
        starts.extend(self.prior.map(|prior| prior.pose));
        starts
    }

    /// Levenberg-Marquardt over the pose and the value; the end, and the standard deviation of the
    /// value.
    fn fit(&self, change: Change, pose: Pose2, value: f64) -> Option<(State, f64)> {
        let (mut pose, mut value) = (pose, value);
        // The weight depends a little on the pose: refresh it once.
        for round in 0..2 {
            let weight = self
                .with(change, value, |problem| problem.linearise(&pose).and_then(|at| problem.weight(&at)))?;
            let end = self.descend(change, (pose, value), &weight)?;
            (pose, value) = (end.pose, end.value);
            if round == 1 {
                let variance = self.normal_equations(change, &end, &weight)?.0.cholesky()?.inverse()[(3, 3)];
                let scale = (end.chi2 / chi2_quantile(self.dof(), Z_95)).max(1.0);
                return Some((end, (variance * scale).sqrt()));
            }
        }
        None
    }

    fn at(&self, change: Change, (pose, value): (Pose2, f64), weight: &DMatrix<f64>) -> Option<State> {
        let linearisation = self.with(change, value, |problem| problem.pose_linearisation(&pose))?;
        let chi2 = linearisation.chi2(weight) + self.prior.map_or(0.0, |prior| distance2(&pose, prior));
        chi2.is_finite().then_some(State { pose, value, linearisation, chi2 })
    }

    fn descend(&self, change: Change, start: (Pose2, f64), weight: &DMatrix<f64>) -> Option<State> {
        let (mut here, mut damping) = (self.at(change, start, weight)?, 1e-6);
        for _ in 0..MAX_STEPS {
            let (mut h, g) = self.normal_equations(change, &here, weight)?;
            for k in 0..4 {
                h[(k, k)] *= 1.0 + damping;
            }
            let step = h.cholesky()?.solve(&g);
            let next = (here.pose.plus(&step.fixed_rows::<3>(0).into_owned()), here.value + step[3]);
            match self.at(change, next, weight).filter(|next| next.chi2 <= here.chi2) {
                Some(next) => (here, damping) = (next, (damping * 0.1_f64).max(1e-12)),
                None => damping *= 10.0,
            }
            if step.norm() < STEP_TOLERANCE || damping > 1e9 {
                break;
            }
        }
        Some(here)
    }

    /// Matrix and right-hand side over (x, y, theta, value).
    fn normal_equations(
        &self,
        change: Change,
        at: &State,
        weight: &DMatrix<f64>,
    ) -> Option<(Matrix4<f64>, Vector4<f64>)> {
        let moved = |step: f64| {
            let value = at.value + step;
            self.with(change, value, |problem| problem.pose_linearisation(&at.pose)).map(|l| l.residual)
        };
        let PoseLinearisation { residual, by_pose } = &at.linearisation;
        // The residual is measured minus predicted.
        let by_value = (moved(-DERIVATIVE_STEP)? - moved(DERIVATIVE_STEP)?) / (2.0 * DERIVATIVE_STEP);
        let mut j = by_pose.clone().resize_horizontally(4, 0.0);
        j.set_column(3, &by_value);
        let jw = j.transpose() * weight;
        let mut h = Matrix4::from_iterator((&jw * &j).iter().copied());
        let mut g = Vector4::from_iterator((&jw * residual).iter().copied());
        if let Some(prior) = self.prior {
            let information: Matrix3<f64> = prior.covariance.cholesky()?.inverse();
            let mut block = h.fixed_view_mut::<3, 3>(0, 0);
            block += information;
            let mut rows = g.fixed_rows_mut::<3>(0);
            rows += information * prior.pose.minus(&at.pose);
        }
        Some((h, g))
    }

    fn cause(&self, change: Change, e: &Explanation) -> RefusalCause {
        let camera = &self.mounting.robot_from_camera;
        match change {
            Change::Size(i) => {
                let observation = &self.observations[i];
                let expected = observation.place.size.width_m;
                let measured = expected * e.value.exp();
                let quantity = FixQuantity::Size(observation.landmark);
                RefusalCause { quantity, expected, measured, sigma: measured * e.sigma }
            }
            Change::Height => {
                let expected = camera.translation.z;
                let measured = expected + e.value;
                RefusalCause { quantity: FixQuantity::CameraHeight, expected, measured, sigma: e.sigma }
            }
            Change::Tilt => {
                let expected = (camera.rotation * Vector3::z()).z.clamp(-1.0, 1.0).asin();
                let measured = expected + e.value;
                RefusalCause { quantity: FixQuantity::CameraTilt, expected, measured, sigma: e.sigma }
            }
        }
    }

    /// What is left where no quantity explains the corners by itself.
    fn unexplained(&self) -> Option<RefusalCause> {
        let problem = Planar::new(self.observations, self.mounting);
        let best = minima(&problem, self.observations).into_iter().next()?;
        let residual = problem.pose_linearisation(&best.pose)?.residual;
        let measured = (residual.norm_squared() / residual.len() as f64).sqrt();
        let limit = self.p.max_reduced_chi2 * problem.dof() as f64;
        let expected = measured * (limit / best.chi2).min(1.0).sqrt();
        Some(RefusalCause { quantity: FixQuantity::Mounting, expected, measured, sigma: 0.0 })
    }
}

/// Squared Mahalanobis distance of a pose to the prior; infinite where its covariance is
/// impossible.
fn distance2(pose: &Pose2, prior: &Pose2Covariance) -> f64 {
    let off = prior.pose.minus(pose);
    prior.covariance.cholesky().map_or(f64::INFINITY, |c| off.dot(&c.solve(&off)))
}
