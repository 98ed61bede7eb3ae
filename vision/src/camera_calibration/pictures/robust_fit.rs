//! Windows and lines in, the camera that most of them fit out: robust fits from several focal
//! lengths, each narrower than the one before, then one of all observations that agree.

use crate::{
    camera_calibration::{
        calibrate::{CalibrateError, poses},
        camera_model::{ALPHA, CAMERA, PIXEL_ASPECT, State, U0, V0},
        linear::LinearCamera,
        pictures::adjustment::{Adjustment, Evidence, Observation, free},
        robust::LENS_GAIN,
    },
    geometry::{corners::Corners, homography::Homography},
    pose::{measurement::LandmarkSize, reprojection::corner_points},
};
use nalgebra::{Matrix3, Point2, SMatrix};

/// Focal lengths that a fit starts from, in widths of the picture.
const STARTS: [f64; 4] = [0.6, 0.9, 1.4, 2.4];
/// Scales of the robust fits, in standard deviations: of lines, and of windows.
const SCALES: [[f64; 2]; 4] = [[80.0, 20.0], [20.0, 8.0], [6.0, 4.0], [3.0, 3.0]];
const LAST_SCALES: [f64; 2] = SCALES[SCALES.len() - 1];
/// Trust of all lines in the first fit: some may be of something else.
const FIRST_LINE_TRUST: f64 = 0.01;
/// A radial coefficient also lowers the cost by this share of what is left: errors that
/// neighbouring windows share may look like a lens.
const LENS_SHARE: f64 = 0.3;
/// Variances are larger by this: neighbouring windows overlap and are followed on two scales, so
/// that their errors are not independent (chosen on rendered sets).
const CORRELATED: f64 = 4.0;
/// Lines and windows this many standard deviations off are left out of the last fit. Most windows
/// are far better than stated; those that are not are near an edge or on another plane.
const OUTLIER_SIGMAS: [f64; 2] = [3.5, 1.0];
/// The standard deviation of windows is then that of their residuals, at least this share of the
/// stated one.
const MIN_SCATTER: f64 = 0.3;
/// Median of the squared residual of a line and of a window, in variances: of chi2 with 1 and 2
/// degrees of freedom.
const MEDIAN_CHI2: [f64; 2] = [0.455, 1.386];

const UNDETERMINED: CalibrateError = CalibrateError::Undetermined { sigma_ratio: 0.0, sigma_share: 0.0 };

/// Where a fit starts.
pub(crate) struct Start<'a> {
    pub(crate) evidence: Vec<Evidence>,
    /// A border around the object in each view.
    pub(crate) borders_px: &'a [Corners],
    pub(crate) reference: usize,
    pub(crate) size: LandmarkSize,
    pub(crate) image_px: [f64; 2],
}

pub(crate) struct RobustFit {
    pub(crate) problem: Adjustment,
    pub(crate) state: State,
    pub(crate) chi2: f64,
    pub(crate) dof: usize,
    pub(crate) covariance: SMatrix<f64, CAMERA, CAMERA>,
}

/// The camera, with as many of `radial` coefficients as lower the cost by far more than chance.
pub(crate) fn robust_fit(start: &Start<'_>, radial: usize) -> Result<RobustFit, CalibrateError> {
    let (mut problem, mut state) = start.narrowed().ok_or(UNDETERMINED)?;
    // A lens starts from the camera without one; both are judged with the scatter that the lens
    // leaves.
    for coefficients in 1..=radial {
        let mut bent = Adjustment { free: free(coefficients), ..problem.clone() };
        let Some(other) = narrow(&mut bent, state.clone(), &SCALES[1..]) else { continue };
        let mut judge = bent.clone();
        rescale(&mut judge, &other);
        let left = bounded_cost(&judge, &other, LAST_SCALES);
        let gain = bounded_cost(&judge, &state, LAST_SCALES) - left;
        if gain > LENS_GAIN.max(LENS_SHARE * left) {
            (problem, state) = (bent, other);
        }
    }
    last_fit(problem, state).ok_or(UNDETERMINED)
}

impl Start<'_> {
    /// The best of the robust fits from all focal lengths, without a lens.
    fn narrowed(&self) -> Option<(Adjustment, State)> {
        let first = |what: &Evidence| {
            let is_line = matches!(what, Evidence::Line { .. });
            Observation { what: *what, trust: if is_line { FIRST_LINE_TRUST } else { 1.0 } }
        };
        let mut best: Option<(f64, Adjustment, State)> = None;
        for share in STARTS {
            let observations = self.evidence.iter().map(first).collect();
            let mut problem = Adjustment { observations, free: free(0), reference: self.reference };
            let narrowed = self
                .state(share)
                .and_then(|s| problem.descend(s))
                .and_then(|s| narrow(&mut problem, s, &SCALES));
            let Some(state) = narrowed else { continue };
            let cost = bounded_cost(&problem, &state, LAST_SCALES);
            if best.as_ref().is_none_or(|b| cost < b.0) {
                best = Some((cost, problem, state));
            }
        }
        best.map(|(_, problem, state)| (problem, state))
    }

    /// Poses for a focal length, as if the border were the object's.
    fn state(&self, share: f64) -> Option<State> {
        let [w, h] = self.image_px;
        let plane = corner_points(&self.size).map(|c| Point2::new(c.y, c.z));
        let maps: Vec<Matrix3<f64>> = self
            .borders_px
            .iter()
            .map(|b| Homography::from_points(&plane, b.points()).ok().map(|h| *h.matrix()))
            .collect::<Option<_>>()?;
        let start = LinearCamera { alpha: share * w, u0: 0.5 * (w - 1.0), v0: 0.5 * (h - 1.0) };
        let mut camera = [0.0; CAMERA];
        (camera[ALPHA], camera[PIXEL_ASPECT]) = (start.alpha, 1.0);
        (camera[U0], camera[V0]) = (start.u0, start.v0);
        Some(State { camera, poses: poses(&maps, &start)? })
    }
}

/// Fits with the trusts of each scale.
fn narrow(problem: &mut Adjustment, start: State, scales: &[[f64; 2]]) -> Option<State> {
    scales.iter().try_fold(start, |state, scales| {
        trust(problem, &state, *scales, false);
        problem.descend(state)
    })
}

/// Standard deviations as the residuals say, then the fit of all observations that agree.
fn last_fit(mut problem: Adjustment, mut state: State) -> Option<RobustFit> {
    rescale(&mut problem, &state);
    let scatter = scatter(&problem, &state)[1].map_or(1.0, |m| m.sqrt().clamp(MIN_SCATTER, 1.0));
    for _ in 0..2 {
        trust(&mut problem, &state, [OUTLIER_SIGMAS[0], scatter * OUTLIER_SIGMAS[1]], true);
        state = problem.descend(state)?;
    }
    let covariance = problem.covariance(&state)? * CORRELATED;
    let chi2 = problem.cost(&state);
    let numbers = |o: &Observation| match o.what {
        Evidence::Window { .. } | Evidence::Centre { .. } => 2,
        Evidence::Line { .. } | Evidence::Level { .. } => 1,
    };
    let given: usize = problem.observations.iter().filter(|o| o.trust > 0.0).map(numbers).sum();
    // The reference's position is not fitted.
    let fitted = problem.free.iter().filter(|f| **f).count() + 6 * state.poses.len() - 3;
    Some(RobustFit { problem, state, chi2, dof: given.saturating_sub(fitted), covariance })
}

/// The scale of an observation, of those of lines and of windows; what was known before is never an
/// outlier.
fn scale_of(what: &Evidence, [of_lines, of_windows]: [f64; 2]) -> f64 {
    match what {
        Evidence::Line { .. } => of_lines,
        Evidence::Window { .. } => of_windows,
        Evidence::Centre { .. } | Evidence::Level { .. } => f64::INFINITY,
    }
}

/// Trusts of all observations: by the curve of Geman and others, or all or nothing.
fn trust(problem: &mut Adjustment, state: &State, scales: [f64; 2], is_last: bool) {
    let share = |o: &Observation| {
        let e2 = problem.chi2(&o.what, state) / scale_of(&o.what, scales).powi(2);
        if is_last { f64::from(u8::from(e2 < 1.0)) } else { (1.0 + e2).powi(-2) }
    };
    let trusts: Vec<f64> = problem.observations.iter().map(share).collect();
    for (o, trust) in problem.observations.iter_mut().zip(trusts) {
        o.trust = trust;
    }
}

/// The cost of Geman and others.
fn bounded_cost(problem: &Adjustment, state: &State, scales: [f64; 2]) -> f64 {
    let bounded = |o: &Observation| {
        let (e2, s2) = (problem.chi2(&o.what, state), scale_of(&o.what, scales).powi(2));
        if e2.is_finite() { e2 / (1.0 + e2 / s2) } else { s2 }
    };
    problem.observations.iter().map(bounded).sum()
}

/// Standard deviations such that the medians of the residuals agree with them; none becomes
/// smaller.
fn rescale(problem: &mut Adjustment, state: &State) {
    let [lines, windows] = scatter(problem, state).map(|m| m.map_or(1.0, |m| m.max(1.0).sqrt()));
    for o in &mut problem.observations {
        match &mut o.what {
            Evidence::Line { sigma_px, .. } => *sigma_px *= lines,
            Evidence::Window { weight, .. } => *weight /= windows,
            Evidence::Centre { .. } | Evidence::Level { .. } => {}
        }
    }
}

/// The variance of lines and of windows over the stated one, by the median of their residuals.
fn scatter(problem: &Adjustment, state: &State) -> [Option<f64>; 2] {
    [0, 1].map(|kind| {
        let is_own = |o: &&Observation| match o.what {
            Evidence::Line { .. } => kind == 0,
            Evidence::Window { .. } => kind == 1,
            Evidence::Centre { .. } | Evidence::Level { .. } => false,
        };
        let own = problem.observations.iter().filter(|o| o.trust > 0.1).filter(is_own);
        let mut squares: Vec<f64> = own.map(|o| problem.chi2(&o.what, state)).collect();
        squares.sort_by(f64::total_cmp);
        squares.get(squares.len() / 2).map(|m| m / MEDIAN_CHI2[kind])
    })
}
