//! The pose in space of a camera that is held in a hand, from the landmarks of one photograph
//! (method 13.8). In: observations of landmarks of known place. Out: `map_from_camera` with its
//! covariance, or why there is none.
//!
//! Nothing is assumed of the mounting: one landmark alone determines the pose, but its direction
//! poorly. Several determine it together: all corners are fitted at once, with the errors of each
//! landmark's place and of the intrinsics, which they share, in the weights. A landmark that
//! contradicts at least two others, and most of them, is left out.

use crate::{
    check::{self, OutOfRange},
    gate::{Z_999, chi2_quantile},
    localise::{
        fix::LandmarkObservation,
        robot_pose::largest,
        spatial::{Spatial, SpatialFit},
    },
    place::LandmarkPlace,
};
use nalgebra::{Isometry3, Matrix6, Translation3, Vector3};
use vision::{
    model::LandmarkId,
    pose::{PoseSolution, reprojection::cross},
};

/// Heights above the floor, metres, at which a camera is accepted.
const CAMERA_HEIGHT_M: std::ops::RangeInclusive<f64> = 0.0..=5.0;
/// Largest standard deviation of the position, metres (root of the trace), that is accepted: beyond
/// it the pose says in which room the camera is, and hardly more. Chosen on photoreal worlds 1
/// to 14.
const MAX_POSITION_SIGMA_M: f64 = 0.15;
/// Two minima whose chi2 differs by less are ambiguous: see [`vision::pose::AMBIGUOUS_CHI2`].
const AMBIGUOUS_CHI2: f64 = 16.0;
/// Two minima nearer than this (metres and radians) are one.
const SAME_POSE: f64 = 1e-4;
/// Fewest landmarks that outvote another one.
const MIN_AGREEING: usize = 2;

/// Pose of a camera in the map.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPose {
    /// Camera coordinates (x right, y down, z forward) to map coordinates, metres.
    pub map_from_camera: Isometry3<f64>,
    /// Covariance of (rotation vector, position), map frame: corners, place and size of the
    /// landmark, intrinsics.
    pub covariance: Matrix6<f64>,
    /// The landmarks that give the pose.
    pub landmarks: Vec<LandmarkId>,
}

/// Why recognised landmarks gave no pose of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraPoseRefusal {
    /// Two poses fit and nothing decides between them.
    Ambiguous,
    /// Every pose has the camera below the floor or more than 5 m above it: place or size of the
    /// landmark is wrong.
    Height,
    /// The landmarks contradict one another.
    Disagree,
    /// The corners determine the position worse than to 15 cm: too far away, too small, or seen
    /// from the front.
    Imprecise,
}

/// The camera's pose from the landmarks of one photograph. Errors name a number that is out of
/// range.
pub fn camera_pose(
    observations: &[LandmarkObservation<'_>],
) -> Result<Result<CameraPose, CameraPoseRefusal>, OutOfRange> {
    check::within("observations", observations.len() as f64, 1.0, f64::MAX)?;
    for observation in observations {
        observation.place.check()?;
    }
    Ok(decide(observations).and_then(precise))
}

/// The pose, if its position is known well enough.
fn precise(pose: CameraPose) -> Result<CameraPose, CameraPoseRefusal> {
    let position_m2 = pose.covariance.fixed_view::<3, 3>(3, 3).trace();
    if position_m2 <= MAX_POSITION_SIGMA_M.powi(2) { Ok(pose) } else { Err(CameraPoseRefusal::Imprecise) }
}

/// A pose of the camera by one solution of one landmark.
#[derive(Debug)]
struct Candidate {
    pose: Isometry3<f64>,
    covariance: Matrix6<f64>,
}

fn decide(observations: &[LandmarkObservation<'_>]) -> Result<CameraPose, CameraPoseRefusal> {
    let mut used = largest(observations);
    let most = used.len();
    loop {
        let worst = match used.as_slice() {
            [only] => return by_one(only),
            _ => match by_several(&used) {
                Ok(pose) => return Ok(pose),
                Err((refusal, worst)) => {
                    worst.filter(|_| used.len() > MIN_AGREEING.max(most / 2 + 1)).ok_or(refusal)?
                }
            },
        };
        // One landmark hangs elsewhere by now: most of the others must still agree.
        used.remove(worst);
    }
}

/// The pose by one landmark.
fn by_one(observation: &LandmarkObservation<'_>) -> Result<CameraPose, CameraPoseRefusal> {
    let mut left = candidates(observation);
    match (left.pop(), left.is_empty()) {
        (Some(Candidate { pose, covariance }), true) => {
            Ok(CameraPose { map_from_camera: pose, covariance, landmarks: vec![observation.landmark] })
        }
        (Some(_), false) => Err(CameraPoseRefusal::Ambiguous),
        (None, _) => Err(CameraPoseRefusal::Height),
    }
}

/// The pose that fits all landmarks; or why there is none, with the one that fits worst where they
/// disagree.
fn by_several(
    observations: &[LandmarkObservation<'_>],
) -> Result<CameraPose, (CameraPoseRefusal, Option<usize>)> {
    let problem = Spatial::new(observations);
    let starts: Vec<Isometry3<f64>> =
        observations.iter().flat_map(candidates).map(|c| c.pose.inverse()).collect();
    if starts.is_empty() {
        return Err((CameraPoseRefusal::Height, None));
    }
    let mut found: Vec<SpatialFit> = Vec::new();
    for fit in starts.into_iter().filter_map(|start| problem.descend(start)) {
        let is_new = |f: &SpatialFit| !is_same(&f.camera_from_map, &fit.camera_from_map);
        if found.iter().all(is_new) {
            found.push(fit);
        }
    }
    found.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    let Some(best) = found.first() else { return Err((CameraPoseRefusal::Disagree, None)) };
    let limit = chi2_quantile(problem.dof(), Z_999);
    if best.chi2 > limit {
        let worst = (0..best.each.len()).max_by(|a, b| best.each[*a].total_cmp(&best.each[*b]));
        return Err((CameraPoseRefusal::Disagree, worst));
    }
    if found.get(1).is_some_and(|second| second.chi2 - best.chi2 < AMBIGUOUS_CHI2) {
        return Err((CameraPoseRefusal::Ambiguous, None));
    }
    let map_from_camera = best.camera_from_map.inverse();
    if !CAMERA_HEIGHT_M.contains(&map_from_camera.translation.z) {
        return Err((CameraPoseRefusal::Height, None));
    }
    let by_seen = by_camera_from(&best.camera_from_map, &map_from_camera);
    Ok(CameraPose {
        map_from_camera,
        covariance: by_seen * best.covariance * by_seen.transpose(),
        landmarks: observations.iter().map(|o| o.landmark).collect(),
    })
}

/// Whether two descents ended in one minimum.
fn is_same(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    a.rotation.angle_to(&b.rotation) < SAME_POSE
        && (a.inverse().translation.vector - b.inverse().translation.vector).norm() < SAME_POSE
}

/// The solutions that the image does not tell apart, as poses of the camera at a possible height.
fn candidates(observation: &LandmarkObservation<'_>) -> Vec<Candidate> {
    let seen = observation.seen;
    let second = seen.second.as_ref().filter(|_| seen.ambiguous);
    let all = std::iter::once(&seen.best).chain(second);
    let possible = |c: &Candidate| CAMERA_HEIGHT_M.contains(&c.pose.translation.z);
    all.map(|solution| candidate(solution, observation.place)).filter(possible).collect()
}

fn candidate(solution: &PoseSolution, place: &LandmarkPlace) -> Candidate {
    let (seen, map_from_landmark) = (&solution.camera_from_landmark, place.map_from_landmark());
    let pose = map_from_landmark * seen.inverse();
    let by_seen = by_camera_from(seen, &pose);
    let by_place = by_place(place, &pose.translation, &map_from_landmark.translation);
    let covariance = by_seen * solution.covariance * by_seen.transpose()
        + by_place * place.covariance * by_place.transpose();
    Candidate { pose, covariance }
}

/// Derivative of (rotation vector, position) of the camera in the map by the left perturbation of
/// `camera_from_other`, the inverse of its pose up to a fixed transform of the other frame.
fn by_camera_from(camera_from_other: &Isometry3<f64>, map_from_camera: &Isometry3<f64>) -> Matrix6<f64> {
    let turn = map_from_camera.rotation.to_rotation_matrix().into_inner();
    let mut by_seen = Matrix6::zeros();
    by_seen.fixed_view_mut::<3, 3>(0, 0).copy_from(&-turn);
    by_seen.fixed_view_mut::<3, 3>(3, 0).copy_from(&(-turn * cross(&camera_from_other.translation.vector)));
    by_seen.fixed_view_mut::<3, 3>(3, 3).copy_from(&-turn);
    by_seen
}

/// Derivative of (rotation vector, position) of the camera by (x, y, theta, z, width, height) of
/// the landmark. A landmark that is larger by a share puts the camera farther away by that share;
/// width and height count for half each.
fn by_place(place: &LandmarkPlace, camera: &Translation3<f64>, centre: &Translation3<f64>) -> Matrix6<f64> {
    let arm = camera.vector - centre.vector;
    let mut by_place = Matrix6::zeros();
    by_place[(3, 0)] = 1.0;
    by_place[(4, 1)] = 1.0;
    by_place[(5, 3)] = 1.0;
    by_place[(2, 2)] = 1.0;
    by_place.fixed_view_mut::<3, 1>(3, 2).copy_from(&Vector3::z().cross(&arm));
    by_place.fixed_view_mut::<3, 1>(3, 4).copy_from(&(arm * (0.5 / place.size.width_m)));
    by_place.fixed_view_mut::<3, 1>(3, 5).copy_from(&(arm * (0.5 / place.size.height_m)));
    by_place
}
