//! A camera's intrinsics from several views of one flat object of known shape (method 16).
//!
//! In: views (points of the plane and their pixels, at least four), the image's size. Out: focal
//! length, principal point, perhaps radial distortion, with covariance, and the residual of each
//! view; or why the views do not determine them.

use crate::{
    camera_calibration::{
        camera_model::{ALPHA, CAMERA, HEIGHT, K1, PIXEL_ASPECT, POSTER, State, U0, V0},
        least_squares::{Problem, Summary, ViewFit},
        linear::{Constraints, LinearCamera, solve},
        params::{CalibrateParams, CameraHeight, MAX_RADIAL},
        views::{MAX_POINTS, MAX_VIEWS, MIN_VIEWS, PlanarView},
    },
    frame::{Distortion, FrameError, Intrinsics, MAX_SIDE_PX},
    geometry::homography::Homography,
    pose::measurement::{LandmarkSize, MAX_CORNER_PX, is_corner_covariance},
};
use nalgebra::{Isometry3, Matrix3, Point2, SMatrix, Vector3};

/// Focal lengths that are believed, in longer sides of the picture.
pub const FOCAL_SIDES: [f64; 2] = [0.4, 4.0];
/// Focal lengths tried where the linear solution fails, in image widths.
const STARTS: [f64; 5] = [0.4, 0.7, 1.1, 1.8, 3.0];

/// Why no camera was found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CalibrateError {
    /// A number of the parameters or the image's size is out of range.
    #[error("{field} = {value} is out of range")]
    OutOfRange {
        /// Name of the field.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// Too few or too many views.
    #[error("{given} views given, {least} to {MAX_VIEWS} are needed")]
    Views {
        /// Views given.
        given: usize,
        /// Fewest views.
        least: usize,
    },
    /// A view's lists are of different lengths, too short or too long, or a number in them is
    /// impossible.
    #[error("view {view}: {reason}")]
    View {
        /// Its index.
        view: usize,
        /// What is wrong.
        reason: &'static str,
    },
    /// Too few different orientations of the plane (method 16.4).
    #[error(
        "the views show {orientations} orientations of the plane that differ by more than {step_deg:.0} degrees, {wanted} are needed"
    )]
    Orientations {
        /// Different orientations found.
        orientations: usize,
        /// Different orientations needed.
        wanted: usize,
        /// Smallest angle between two different orientations.
        step_deg: f64,
    },
    /// No camera fits the views, or every camera does: the linear system is degenerate.
    #[error(
        "the views do not determine a camera (sigma3 / sigma4 = {sigma_ratio:.3}, sigma3 / sigma1 = {sigma_share:.1e})"
    )]
    Undetermined {
        /// Second smallest over smallest singular value of the linear system.
        sigma_ratio: f64,
        /// Second smallest over greatest.
        sigma_share: f64,
    },
    /// The residuals are too large: the views are not of one plane of this shape.
    #[error(
        "the views do not fit one plane of this shape: rms {rms_px:.2} px, view {worst} the worst with {worst_px:.2} px"
    )]
    Misfit {
        /// Root mean square residual per coordinate.
        rms_px: f64,
        /// The view that fits worst.
        worst: usize,
        /// Its root mean square residual.
        worst_px: f64,
    },
    /// Pictures show no textured object that they have in common.
    #[error(
        "no_common_object: {shown} of {of} pictures show one textured object; take sharp pictures of the whole of \
         one poster or painting, from at least three sides, or give corners by hand"
    )]
    NoCommonObject {
        /// Pictures that show it.
        shown: usize,
        /// Pictures given.
        of: usize,
    },
    /// The lines along an object's sides are not parallel to two directions at right angles.
    #[error(
        "border_unclear: {agreeing} of {found} lines along the object's sides agree on two directions at right \
         angles; take pictures of a rectangle that stands out from the wall, or give corners by hand"
    )]
    BorderUnclear {
        /// Lines that agree.
        agreeing: usize,
        /// Lines found.
        found: usize,
    },
    /// The focal length is none of a usual camera: the views are not of one rectangle, or the
    /// pictures are cropped.
    #[error(
        "focal_out_of_range: fx {fx_px:.0} px is not within {} to {} times the longer side of the picture, {side_px} \
         px; check that the pictures are not cropped and all show one rectangle", FOCAL_SIDES[0], FOCAL_SIDES[1]
    )]
    FocalOutOfRange {
        /// The focal length found, px.
        fx_px: f64,
        /// The longer side of the picture, px.
        side_px: usize,
    },
    /// The solution is not a possible camera.
    #[error(transparent)]
    Camera(#[from] FrameError),
}

/// A calibrated camera.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraCalibration {
    /// The camera.
    pub camera: Intrinsics,
    /// Covariance over (fx, cx, cy, k1, k2, fy / fx), px and 1; rows of numbers that were not
    /// fitted are zero. `None` without refinement.
    pub covariance: Option<SMatrix<f64, 6, 6>>,
    /// Focal length of the linear solution (method 16.2), where there was one, pixels.
    pub linear_fx_px: Option<f64>,
    /// Height over width of the plane, divided by the ratio that the views state: 1 where the
    /// aspect is known.
    pub aspect_ratio: f64,
    /// Height of the camera over the plane's origin, metres, where it was constant or known.
    pub height_m: Option<f64>,
    /// The fit of each view.
    pub views: Vec<ViewFit>,
    /// Root mean square residual per coordinate, pixels.
    pub rms_px: f64,
    /// Weighted squared residual and its degrees of freedom.
    pub chi2: f64,
    /// Degrees of freedom of `chi2`.
    pub dof: usize,
    /// Number of different orientations of the plane.
    pub orientations: usize,
    /// Second smallest over smallest singular value of the linear system.
    pub sigma_ratio: f64,
}

impl CameraCalibration {
    /// Standard deviation of the focal length, pixels.
    pub fn fx_sigma_px(&self) -> Option<f64> {
        self.covariance.map(|c| c[(0, 0)].sqrt())
    }
}

/// The camera behind `views` of one flat object, in an image of `image_size_px` (width, height).
pub fn calibrate(
    views: &[PlanarView],
    image_size_px: [usize; 2],
    p: &CalibrateParams,
) -> Result<CameraCalibration, CalibrateError> {
    check(views, image_size_px, p)?;
    let size = image_size_px.map(|s| s as f64);
    let mut homographies = Vec::with_capacity(views.len());
    for (view, v) in views.iter().enumerate() {
        // Known pixel aspect: v is divided by it, and the camera has square pixels.
        let seen_px_square: Vec<_> =
            v.seen_px.iter().map(|q| Point2::new(q.x, q.y / p.pixel_aspect)).collect();
        let h = Homography::fit(&v.plane_m, &seen_px_square);
        let h = h.map_err(|_horizon| CalibrateError::View { view, reason: "its points are degenerate" })?;
        // z up becomes v down: from the front the orientation changes.
        if h.matrix().determinant() >= 0.0 {
            return Err(CalibrateError::View {
                view,
                reason: "its points run counter-clockwise: the plane is seen from behind",
            });
        }
        homographies.push(*h.matrix());
    }
    let square = [size[0], size[1] / p.pixel_aspect];
    let (linear, sigmas) = start(&homographies, square, p);
    let guess = |f: f64| LinearCamera {
        alpha: f * square[0],
        u0: 0.5 * (square[0] - 1.0),
        v0: 0.5 * (square[1] - 1.0),
    };
    let [sigma_ratio, sigma_share] = sigmas;
    let starts: Vec<LinearCamera> = match linear {
        Some(camera) => vec![camera],
        None if p.refine => STARTS.map(guess).to_vec(),
        None => vec![],
    };
    let problem = Problem::new(views, size, p)
        .ok_or(CalibrateError::View { view: 0, reason: "a covariance is impossible" })?;
    let mut best: Option<State> = None;
    for camera in &starts {
        let Some(state) = settled(&problem, camera, &homographies, p) else { continue };
        if best.as_ref().is_none_or(|b| problem.chi2(&state) < problem.chi2(b)) {
            best = Some(state);
        }
    }
    let linear_poses =
        best.as_ref().map_or_else(|| poses(&homographies, &guess(1.0)), |state| Some(state.poses.clone()));
    let orientations = linear_poses.map_or(0, |poses| orientations(&poses, p.orientation_step_rad));
    if orientations < p.min_orientations {
        let step_deg = p.orientation_step_rad.to_degrees();
        return Err(CalibrateError::Orientations { orientations, wanted: p.min_orientations, step_deg });
    }
    let undetermined = CalibrateError::Undetermined { sigma_ratio, sigma_share };
    let state = best.ok_or(undetermined.clone())?;
    let made = problem.summary(&state, p.refine).ok_or(undetermined)?;
    let found = finished(&state, made, linear.map(|l| l.alpha), (orientations, sigma_ratio), p)?;
    believable(&found.camera, image_size_px)?;
    Ok(found)
}

/// Refuses a focal length outside [`FOCAL_SIDES`].
pub(crate) fn believable(camera: &Intrinsics, image_size_px: [usize; 2]) -> Result<(), CalibrateError> {
    let side_px = image_size_px[0].max(image_size_px[1]);
    let [low, high] = FOCAL_SIDES.map(|sides| sides * side_px as f64);
    if (low..=high).contains(&camera.fx_px) {
        Ok(())
    } else {
        Err(CalibrateError::FocalOutOfRange { fx_px: camera.fx_px, side_px })
    }
}

/// The linear solution.
fn start(
    homographies: &[Matrix3<f64>],
    square: [f64; 2],
    p: &CalibrateParams,
) -> (Option<LinearCamera>, [f64; 2]) {
    let with = |height_m| {
        let zero_roll = p.roll_sigma_rad > 0.0;
        solve(homographies, square, &Constraints { known_aspect: p.known_aspect, zero_roll, height_m })
    };
    match p.height {
        CameraHeight::Known { height_m, .. } => with(Some(height_m)),
        // Departs from method 16.2 (a 1-D search): without C3 the start is good enough, and the
        // refinement finds the height with all the rest.
        CameraHeight::Free | CameraHeight::Constant { .. } => with(None),
    }
}

/// The poses for a camera, then the least squares if requested, every view in the better of its two
/// minima.
fn settled(
    problem: &Problem,
    camera: &LinearCamera,
    homographies: &[Matrix3<f64>],
    p: &CalibrateParams,
) -> Option<State> {
    let poses = poses(homographies, camera)?;
    let mut numbers = [0.0; CAMERA];
    (numbers[ALPHA], numbers[PIXEL_ASPECT]) = (camera.alpha, p.pixel_aspect);
    (numbers[U0], numbers[V0]) = (camera.u0, camera.v0 * p.pixel_aspect);
    let mut state = State { camera: numbers, poses };
    problem.fit_poster(&mut state, homographies);
    state = problem.posed(state)?;
    problem.fit_height(&mut state);
    if p.refine { problem.descend(state) } else { Some(state) }
}

/// Eq. (2) for every view; homographies and camera have square pixels.
pub(crate) fn poses(homographies: &[Matrix3<f64>], camera: &LinearCamera) -> Option<Vec<Isometry3<f64>>> {
    let k = Matrix3::new(camera.alpha, 0.0, camera.u0, 0.0, camera.alpha, camera.v0, 0.0, 0.0, 1.0);
    let inverse = k.try_inverse()?;
    homographies.iter().map(|h| crate::pose::linear::pose_of_columns(&(inverse * h))).collect()
}

/// Number of plane normals that differ by more than `step_rad` from all counted before, in order.
pub(crate) fn orientations(poses: &[Isometry3<f64>], step_rad: f64) -> usize {
    let mut counted: Vec<Vector3<f64>> = Vec::new();
    for pose in poses {
        let normal = pose.rotation * Vector3::x();
        if counted.iter().all(|k| k.angle(&normal) > step_rad) {
            counted.push(normal);
        }
    }
    counted.len()
}

/// Checks that every number is finite and in range.
fn check(views: &[PlanarView], image_size_px: [usize; 2], p: &CalibrateParams) -> Result<(), CalibrateError> {
    let within = |field, value: f64, low: f64, high: f64| {
        let good = (low..=high).contains(&value);
        if good { Ok(()) } else { Err(CalibrateError::OutOfRange { field, value }) }
    };
    for (field, side) in [("width_px", image_size_px[0]), ("height_px", image_size_px[1])] {
        within(field, side as f64, 1.0, MAX_SIDE_PX as f64)?;
    }
    within("pixel_aspect", p.pixel_aspect, 0.1, 10.0)?;
    within("roll_sigma_rad", p.roll_sigma_rad, 0.0, 1.0)?;
    within("centre_sigma", p.centre_sigma, 0.0, 10.0)?;
    within("radial", p.radial as f64, 0.0, MAX_RADIAL as f64)?;
    within("orientation_step_rad", p.orientation_step_rad, 0.0, 1.5)?;
    within("max_rms_px", p.max_rms_px, 0.0, 1e4)?;
    match p.height {
        CameraHeight::Free => {}
        CameraHeight::Known { height_m, sigma_m } => {
            within("height_m", height_m, -100.0, 100.0)?;
            within("sigma_m", sigma_m, 1e-6, 100.0)?;
        }
        CameraHeight::Constant { sigma_m } => within("sigma_m", sigma_m, 1e-6, 100.0)?,
    }
    // Two numbers of the camera a view with known aspect, one without.
    let least = if p.known_aspect { MIN_VIEWS } else { 2 * MIN_VIEWS };
    if !(least..=MAX_VIEWS).contains(&views.len()) {
        return Err(CalibrateError::Views { given: views.len(), least });
    }
    for (view, v) in views.iter().enumerate() {
        let refuse = |reason| Err(CalibrateError::View { view, reason });
        let n = v.plane_m.len();
        if n != v.seen_px.len() || n != v.covariance_px2.len() || !(4..=MAX_POINTS).contains(&n) {
            return refuse("its lists differ in length, or the length is not 4 to 4096");
        }
        let far = |q: &Point2<f64>, limit: f64| !(q.x.abs() <= limit && q.y.abs() <= limit);
        if v.plane_m.iter().any(|q| far(q, LandmarkSize::MAX_M)) {
            return refuse("a point of the plane is out of range");
        }
        if v.seen_px.iter().any(|q| far(q, MAX_CORNER_PX)) {
            return refuse("a pixel is out of range");
        }
        if !v.covariance_px2.iter().all(is_corner_covariance) {
            return refuse("a covariance is impossible");
        }
    }
    Ok(())
}

/// The result, or [`CalibrateError::Misfit`].
fn finished(
    state: &State,
    made: Summary,
    linear_fx_px: Option<f64>,
    (orientations, sigma_ratio): (usize, f64),
    p: &CalibrateParams,
) -> Result<CameraCalibration, CalibrateError> {
    if made.rms_px > p.max_rms_px {
        let worst = (0..made.views.len())
            .max_by(|&a, &b| made.views[a].rms_px.total_cmp(&made.views[b].rms_px))
            .unwrap_or(0);
        let worst_px = made.views.get(worst).map_or(0.0, |v| v.rms_px);
        return Err(CalibrateError::Misfit { rms_px: made.rms_px, worst, worst_px });
    }
    let c = &state.camera;
    let distortion = match p.radial {
        0 => Distortion::None,
        _ => Distortion::PlumbBob([c[K1], c[K1 + 1], 0.0, 0.0, 0.0]),
    };
    let camera = Intrinsics::new(c[ALPHA], c[ALPHA] * c[PIXEL_ASPECT], c[U0], c[V0], distortion)?;
    Ok(CameraCalibration {
        camera,
        covariance: made.covariance,
        linear_fx_px,
        aspect_ratio: c[POSTER].exp(),
        height_m: (p.height != CameraHeight::Free).then_some(c[HEIGHT]),
        views: made.views,
        rms_px: made.rms_px,
        chi2: made.chi2,
        dof: made.dof,
        orientations,
        sigma_ratio,
    })
}

#[cfg(test)]
pub(crate) mod tests;
