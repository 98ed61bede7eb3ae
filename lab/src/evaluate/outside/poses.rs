//! Poses against the truth: of the camera in the map, and of each named landmark in the camera
//! frame.

use super::{
    bound::position_bound,
    world::{CameraTruth, LandmarkTruth},
};
use nalgebra::{Isometry3, Matrix3, Matrix3x6, Matrix6, Vector6};
use protos::{convert::geometry::pose3, v1};
use vision::{
    geometry::Corners,
    pose::{
        LandmarkPose, PoseSolution,
        reprojection::{cross, pixel},
    },
};

/// A camera pose against the truth.
#[derive(Debug, Clone)]
pub(super) struct CameraScore {
    pub(super) position_m: f64,
    pub(super) direction_rad: f64,
    /// Of the position, 3 expected: as stated, with the error that a place by hand is taken to
    /// have.
    pub(super) nees: f64,
    /// Of the position by the covariance of the landmark's pose alone: places are exact here.
    pub(super) nees_of_view: Option<f64>,
    /// Standard deviation of the position that this covariance states, root of the trace.
    pub(super) stated_m: Option<f64>,
    /// The same as stated in the answer, the place included.
    pub(super) stated_whole_m: f64,
    /// Landmarks that give the pose; and the nearest one's distance.
    pub(super) names: Vec<String>,
    pub(super) distance_m: f64,
    /// Covariance of the position by the true corners of these, and of all landmarks in full view.
    pub(super) bound: Option<Matrix3<f64>>,
    pub(super) bound_of_all: Option<Matrix3<f64>>,
}

/// What of the world bears on a camera's pose.
pub(super) struct Evidence<'a> {
    /// The landmark that gives the pose, as it was seen and as it hangs.
    pub(super) decisive: Option<(&'a LandmarkPose, &'a LandmarkTruth)>,
    /// All landmarks that give the pose.
    pub(super) used: Vec<&'a LandmarkTruth>,
    /// All landmarks in full view.
    pub(super) in_view: Vec<&'a LandmarkTruth>,
}

/// A landmark's pose in the camera frame against the truth.
#[derive(Debug, Clone, Copy)]
pub(super) struct MeasurementScore {
    /// Of its centre.
    pub(super) position_m: f64,
    pub(super) direction_rad: f64,
    /// Of the centre, 3 expected, and of the whole pose, 6 expected.
    pub(super) nees_3: f64,
    pub(super) nees_6: f64,
    /// Largest distance of a corner of the answer from where the pose puts it.
    pub(super) reprojection_px: f64,
    /// The same over the stated standard deviation of that corner.
    pub(super) reprojection_sigmas: f64,
    /// Two solutions fit, and the better one was taken.
    pub(super) is_ambiguous: bool,
}

/// `None` where the answer's numbers are no pose.
pub(super) fn camera_score(
    pose: &v1::CameraPose,
    truth: &CameraTruth,
    evidence: &Evidence<'_>,
) -> Option<CameraScore> {
    let map_from_camera = pose3(pose.map_from_camera.as_ref()?).ok()?;
    let true_pose = truth.camera_from_world.inverse();
    let error = true_pose.translation.vector - map_from_camera.translation.vector;
    let covariance = Matrix6::from_row_slice(pose.covariance.get(..36)?);
    let of_position: Matrix3<f64> = covariance.fixed_view::<3, 3>(3, 3).into_owned();
    let of_view =
        evidence.decisive.map(|(seen, landmark)| position_covariance(seen, landmark, &map_from_camera));
    let distance =
        |l: &LandmarkTruth| (l.world_from_landmark.translation.vector - true_pose.translation.vector).norm();
    let both = || evidence.used.iter().chain(&evidence.in_view).copied();
    Some(CameraScore {
        position_m: error.norm(),
        direction_rad: map_from_camera.rotation.angle_to(&true_pose.rotation),
        nees: error.dot(&of_position.cholesky()?.solve(&error)),
        nees_of_view: of_view.and_then(|c| Some(error.dot(&c.cholesky()?.solve(&error)))),
        stated_m: of_view.map(|c| c.trace().sqrt()),
        stated_whole_m: of_position.trace().sqrt(),
        names: pose.landmarks.clone(),
        distance_m: evidence.used.iter().map(|l| distance(l)).fold(f64::INFINITY, f64::min),
        bound: position_bound(evidence.used.iter().copied(), truth),
        bound_of_all: position_bound(distinct(both()), truth),
    })
}

/// Each landmark once.
fn distinct<'a>(all: impl Iterator<Item = &'a LandmarkTruth>) -> impl Iterator<Item = &'a LandmarkTruth> {
    let mut seen: Vec<&LandmarkTruth> = Vec::new();
    all.filter(move |l| {
        let is_new = !seen.iter().any(|s| std::ptr::eq(*s, *l));
        seen.push(l);
        is_new
    })
}

/// Covariance of the camera's position (map frame) by the landmark's pose in the camera frame, of
/// the solution that gives this pose of the camera.
fn position_covariance(
    seen: &LandmarkPose,
    landmark: &LandmarkTruth,
    map_from_camera: &Isometry3<f64>,
) -> Matrix3<f64> {
    let distance = |s: &PoseSolution| {
        let camera = landmark.world_from_landmark * s.camera_from_landmark.inverse();
        (camera.translation.vector - map_from_camera.translation.vector).norm()
    };
    let solution = match &seen.second {
        Some(second) if distance(second) < distance(&seen.best) => second,
        _ => &seen.best,
    };
    // The position is -R^T t in the landmark frame: by the rotation vector R^T [t]x, by the
    // translation -R^T.
    let turn = map_from_camera.rotation.to_rotation_matrix().into_inner();
    let by_rotation = turn * cross(&solution.camera_from_landmark.translation.vector);
    let mut by_seen = Matrix3x6::zeros();
    by_seen.fixed_columns_mut::<3>(0).copy_from(&by_rotation);
    by_seen.fixed_columns_mut::<3>(3).copy_from(&-turn);
    by_seen * solution.covariance * by_seen.transpose()
}

/// The landmark's best pose; `corners` are those of the answer, the landmark's top-left first.
pub(super) fn measurement_score(
    pose: &LandmarkPose,
    corners: &Corners,
    landmark: &LandmarkTruth,
    camera: &CameraTruth,
) -> Option<MeasurementScore> {
    let (best, measured) = (&pose.best, &pose.measured);
    let found = &best.camera_from_landmark;
    let true_pose = camera.camera_from_world * landmark.world_from_landmark;
    let shift = true_pose.translation.vector - found.translation.vector;
    let turn = (true_pose.rotation * found.rotation.inverse()).scaled_axis();
    let error = Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z);
    let of_position: Matrix3<f64> = best.covariance.fixed_view::<3, 3>(3, 3).into_owned();
    let (half_width, half_height) = (0.5 * measured.size.width_m, 0.5 * measured.size.height_m);
    let (mut reprojection_px, mut reprojection_sigmas) = (0.0_f64, 0.0_f64);
    for (i, (right, up)) in [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)].into_iter().enumerate() {
        let at = nalgebra::Vector3::new(0.0, right * half_width, up * half_height);
        let expected = pixel(found, &at, &measured.camera)?;
        let seen = measured.camera.undistort(&corners.points()[i])?;
        let residual = seen - expected;
        reprojection_px = reprojection_px.max(residual.norm());
        let squared = residual.dot(&measured.covariance_px2.of(i).cholesky()?.solve(&residual));
        reprojection_sigmas = reprojection_sigmas.max(squared.sqrt());
    }
    Some(MeasurementScore {
        position_m: shift.norm(),
        direction_rad: turn.norm(),
        nees_3: shift.dot(&of_position.cholesky()?.solve(&shift)),
        nees_6: error.dot(&best.covariance.cholesky()?.solve(&error)),
        reprojection_px,
        reprojection_sigmas,
        is_ambiguous: pose.ambiguous,
    })
}
