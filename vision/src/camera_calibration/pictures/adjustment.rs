//! Least squares over the camera and all poses: windows by where other pictures show a pixel of the
//! reference picture, lines by their directions. A window needs no place of its own: its pixel's
//! ray meets the plane of the reference pose.

use crate::{
    camera_calibration::camera_model::{
        ALPHA, CAMERA, K1, K2, PIXEL_ASPECT, POSTER, Point, State, U0, V0, moved, pixel,
    },
    frame::MAX_SIDE_PX,
    pose::reprojection::MIN_DEPTH_M,
};
use nalgebra::{DMatrix, DVector, Isometry3, Matrix2, Point2, SMatrix, Vector2, Vector3, Vector6};

/// Most steps of one descent, accepted or not.
const MAX_STEPS: usize = 40;
/// A descent ends when a step lowers the cost by less than this share.
const LEAST_GAIN: f64 = 1e-8;
const MAX_DAMPING: f64 = 1e10;
/// Steps of the inverse of the lens.
const LENS_STEPS: usize = 12;
/// Steps of numerical derivatives: of focal length and centre by the focal length, and of all
/// others.
const PIXEL_STEP: f64 = 1e-5;
const STEP: f64 = 1e-6;

/// What is seen.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Evidence {
    /// A pixel of the reference picture is at `px` in another; `weight^T weight = covariance^-1`.
    Window { view: usize, reference_px: Point2<f64>, px: Point2<f64>, weight: Matrix2<f64> },
    /// A line through two pixels, each known to `sigma_px` across it, is parallel to the plane's up
    /// axis or its width.
    Line { view: usize, ends_px: [Point2<f64>; 2], sigma_px: f64, is_upright: bool },
    /// The principal point is at `px`, to `sigma_px`.
    Centre { px: Point2<f64>, sigma_px: f64 },
    /// The camera does not roll, to `sigma_rad`.
    Level { view: usize, sigma_rad: f64 },
}

/// Something seen with the share with which it counts, 0 to 1.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Observation {
    pub(crate) what: Evidence,
    pub(crate) trust: f64,
}

/// All observations.
#[derive(Debug, Clone)]
pub(crate) struct Adjustment {
    pub(crate) observations: Vec<Observation>,
    /// Which of the shared parameters are fitted.
    pub(crate) free: [bool; CAMERA],
    /// The view whose position is fixed: the plane's origin and scale are free.
    pub(crate) reference: usize,
}

impl Evidence {
    fn view(&self) -> Option<usize> {
        match self {
            Self::Window { view, .. } | Self::Line { view, .. } | Self::Level { view, .. } => Some(*view),
            Self::Centre { .. } => None,
        }
    }

    /// The residual in standard deviations; `None` where a point is not in front of the camera.
    fn residual(
        &self,
        c: &[f64; CAMERA],
        reference: &Isometry3<f64>,
        own: &Isometry3<f64>,
    ) -> Option<Vector2<f64>> {
        match self {
            Self::Window { reference_px, px, weight, .. } => {
                let normal = reference.rotation * Vector3::x();
                let ray = ray(reference_px, c);
                let depth_m = normal.dot(&reference.translation.vector) / normal.dot(&ray);
                let at = reference.inverse_transform_point(&(ray * depth_m).into());
                let point = Point { plane: Point2::new(at.y, at.z), seen: *px, weight: *weight };
                (depth_m > MIN_DEPTH_M).then_some(weight * (px - pixel(&point, own, c)?))
            }
            Self::Line { ends_px, sigma_px, is_upright, .. } => {
                let axis = if *is_upright { Vector3::z() } else { Vector3::y() };
                let along = own.rotation * axis;
                let [a, b] = ends_px.map(|p| ray(&p, c));
                // Derivatives of the triple product by the ends' pixels, across the line.
                let d = ends_px[1] - ends_px[0];
                let across = Vector2::new(-d.y, d.x / c[PIXEL_ASPECT]) / (d.norm() * c[ALPHA]);
                let by = |v: Vector3<f64>| v.xy().dot(&across);
                let slope = by(b.cross(&along)).hypot(by(along.cross(&a)));
                Some(Vector2::new(a.cross(&b).dot(&along) / (sigma_px * slope), 0.0))
            }
            Self::Centre { px, sigma_px } => Some((Point2::new(c[U0], c[V0]) - px) / *sigma_px),
            Self::Level { sigma_rad, .. } => {
                Some(Vector2::new((own.rotation * Vector3::z()).x / sigma_rad, 0.0))
            }
        }
    }
}

/// The ray of a pixel, z = 1.
fn ray(px: &Point2<f64>, c: &[f64; CAMERA]) -> Vector3<f64> {
    let seen = [(px.x - c[U0]) / c[ALPHA], (px.y - c[V0]) / (c[ALPHA] * c[PIXEL_ASPECT])];
    let (mut x, mut y) = (seen[0], seen[1]);
    if c[K1].abs() > 0.0 || c[K2].abs() > 0.0 {
        for _ in 0..LENS_STEPS {
            let r2 = x * x + y * y;
            let g = 1.0 + r2 * (c[K1] + r2 * c[K2]);
            (x, y) = (seen[0] / g, seen[1] / g);
        }
    }
    Vector3::new(x, y, 1.0)
}

impl Adjustment {
    /// Squared residual of an observation in variances; infinite where it is not in front of the
    /// camera.
    pub(crate) fn chi2(&self, what: &Evidence, state: &State) -> f64 {
        let own = what.view().unwrap_or(self.reference);
        let r = what.residual(&state.camera, &state.poses[self.reference], &state.poses[own]);
        r.map(|r| r.norm_squared()).filter(|v| !v.is_nan()).unwrap_or(f64::INFINITY)
    }

    /// Squared residuals, each times its trust.
    pub(crate) fn cost(&self, state: &State) -> f64 {
        let trusted = self.observations.iter().filter(|o| o.trust > 0.0);
        trusted.map(|o| o.trust * self.chi2(&o.what, state)).sum()
    }

    /// Levenberg-Marquardt with the trusts as they are.
    pub(crate) fn descend(&self, start: State) -> Option<State> {
        let (mut state, mut damping) = (start, 1e-4);
        let mut cost = self.cost(&state);
        let mut equations = self.equations(&state).filter(|_| cost.is_finite())?;
        for _ in 0..MAX_STEPS {
            let next = step(&equations, damping).map(|step| after(&state, &step));
            let possible = |s: &State| (1.0..100.0 * MAX_SIDE_PX as f64).contains(&s.camera[ALPHA]);
            let next_cost = next.as_ref().filter(|s| possible(s)).map_or(f64::INFINITY, |s| self.cost(s));
            match next {
                Some(next) if next_cost <= cost => {
                    let gain = cost - next_cost;
                    (state, cost, damping) = (next, next_cost, (damping * 0.2).max(1e-12));
                    if gain <= LEAST_GAIN * cost {
                        break;
                    }
                    equations = self.equations(&state)?;
                }
                _ if damping > MAX_DAMPING => break,
                _ => damping *= 8.0,
            }
        }
        Some(state)
    }

    /// Normal equations: the information of all parameters, and the residuals' pull on them.
    fn equations(&self, state: &State) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let n = CAMERA + 6 * state.poses.len();
        let (mut all, mut pull) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let held: Vec<usize> = (0..CAMERA).filter(|k| !self.free[*k]).collect();
        let position = CAMERA + 6 * self.reference + 3;
        for Observation { what, trust } in self.observations.iter().filter(|o| o.trust > 0.0) {
            let view = what.view().unwrap_or(self.reference);
            let places: Vec<usize> = (0..CAMERA)
                .filter(|k| self.free[*k])
                .chain(position - 3..position)
                .chain((CAMERA + 6 * view..).take(if view == self.reference { 0 } else { 6 }))
                .collect();
            let mut slopes: Vec<Vector2<f64>> = Vec::with_capacity(places.len());
            for k in &places {
                slopes.push(self.slope(what, view, *k, state)?);
            }
            let r = what.residual(&state.camera, &state.poses[self.reference], &state.poses[view])?;
            for (k, a) in places.iter().zip(&slopes) {
                pull[*k] -= trust * a.dot(&r);
                for (l, b) in places.iter().zip(&slopes) {
                    all[(*k, *l)] += trust * a.dot(b);
                }
            }
        }
        for k in held.into_iter().chain(position..position + 3) {
            all[(k, k)] = 1.0;
        }
        Some((all, pull))
    }

    /// Derivative of a residual by parameter `k`.
    fn slope(&self, what: &Evidence, view: usize, k: usize, state: &State) -> Option<Vector2<f64>> {
        let h = if k == ALPHA || k == U0 || k == V0 { PIXEL_STEP * state.camera[ALPHA] } else { STEP };
        let at = |d: f64| {
            let (mut c, mut reference) = (state.camera, state.poses[self.reference]);
            let mut own = state.poses[view];
            if k < CAMERA {
                c[k] += d;
            } else {
                let mut step = Vector6::zeros();
                step[(k - CAMERA) % 6] = d;
                let is_reference = (k - CAMERA) / 6 == self.reference;
                if is_reference {
                    reference = moved(&reference, &step);
                }
                if !is_reference || view == self.reference {
                    own = moved(&own, &step);
                }
            }
            what.residual(&c, &reference, &own)
        };
        Some((at(h)? - at(-h)?) / (2.0 * h))
    }

    /// Covariance of the shared parameters; zero for those that are not fitted.
    pub(crate) fn covariance(&self, state: &State) -> Option<SMatrix<f64, CAMERA, CAMERA>> {
        let (all, _) = self.equations(state)?;
        let scale = all.diagonal().map(|v| 1.0 / v.max(f64::MIN_POSITIVE).sqrt());
        let scaled = DMatrix::from_fn(all.nrows(), all.nrows(), |i, j| all[(i, j)] * scale[i] * scale[j]);
        let inverse = scaled.cholesky()?.inverse();
        let of = |i: usize, j: usize| inverse[(i, j)] * scale[i] * scale[j];
        Some(SMatrix::from_fn(|i, j| if self.free[i] && self.free[j] { of(i, j) } else { 0.0 }))
    }
}

fn step((all, pull): &(DMatrix<f64>, DVector<f64>), damping: f64) -> Option<DVector<f64>> {
    let scale = all.diagonal().map(|v| 1.0 / v.max(f64::MIN_POSITIVE).sqrt());
    let scaled = DMatrix::from_fn(all.nrows(), all.nrows(), |i, j| {
        let v = all[(i, j)] * scale[i] * scale[j];
        if i == j { v * (1.0 + damping) } else { v }
    });
    let step = scaled.cholesky()?.solve(&pull.component_mul(&scale)).component_mul(&scale);
    step.iter().all(|v| v.is_finite()).then_some(step)
}

fn after(state: &State, step: &DVector<f64>) -> State {
    let mut next = state.clone();
    for k in 0..CAMERA {
        next.camera[k] += step[k];
    }
    for (i, pose) in next.poses.iter_mut().enumerate() {
        *pose = moved(pose, &step.fixed_rows::<6>(CAMERA + 6 * i).into());
    }
    next
}

/// The free parameters of a camera with `radial` coefficients.
pub(crate) fn free(radial: usize) -> [bool; CAMERA] {
    let mut free = [false; CAMERA];
    (free[ALPHA], free[U0], free[V0]) = (true, true, true);
    (free[K1], free[K2], free[POSTER]) = (radial > 0, radial > 1, false);
    free
}

#[cfg(test)]
mod tests;
