//! The pose in space of a camera that is held in a hand, from the landmarks of one photograph (method 13.8). In:
//! observations of landmarks of known place. Out: `map_from_camera` with its covariance, or why there is none.
//!
//! Nothing is assumed of the mounting: one landmark alone determines the pose. The landmark that determines it best gives
//! the pose; the others decide between its two solutions, and must agree with it. They are not averaged: their errors
//! share those of the intrinsics.

use crate::{
    check::{self, OutOfRange},
    localise::fix::LandmarkObservation,
    place::LandmarkPlace,
};
use nalgebra::{Isometry3, Matrix6, Translation3, Vector3, Vector6};
use vision::{
    model::LandmarkId,
    pose::{PoseSolution, reprojection::cross},
};

/// Heights above the floor, metres, at which a camera is accepted.
const CAMERA_HEIGHT_M: std::ops::RangeInclusive<f64> = 0.0..=5.0;
/// 99.9 % quantile of chi2 with 6 degrees of freedom: the largest distance of two poses that agree.
const AGREE_CHI2: f64 = 22.458;

/// Pose of a camera in the map.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPose {
    /// Camera coordinates (x right, y down, z forward) to map coordinates, metres.
    pub map_from_camera: Isometry3<f64>,
    /// Covariance of (rotation vector, position), map frame: corners, place and size of the landmark, intrinsics.
    pub covariance: Matrix6<f64>,
    /// The landmark that gives the pose, then those that agree with it.
    pub landmarks: Vec<LandmarkId>,
}

/// Why recognised landmarks gave no pose of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraPoseRefusal {
    /// Two poses fit and nothing decides between them.
    Ambiguous,
    /// Every pose has the camera below the floor or more than 5 m above it: place or size of the landmark is wrong.
    Height,
    /// The landmarks contradict one another.
    Disagree,
}

/// The camera's pose from the landmarks of one photograph. Errors name a number that is out of range.
pub fn camera_pose(
    observations: &[LandmarkObservation<'_>],
) -> Result<Result<CameraPose, CameraPoseRefusal>, OutOfRange> {
    check::within("observations", observations.len() as f64, 1.0, f64::MAX)?;
    for observation in observations {
        observation.place.check()?;
    }
    Ok(decide(observations))
}

/// A pose of the camera by one solution of one landmark.
#[derive(Debug)]
struct Candidate {
    pose: Isometry3<f64>,
    covariance: Matrix6<f64>,
}

fn decide(observations: &[LandmarkObservation<'_>]) -> Result<CameraPose, CameraPoseRefusal> {
    let mut all = Vec::with_capacity(observations.len());
    for observation in observations {
        let candidates = candidates(observation);
        if candidates.is_empty() {
            return Err(CameraPoseRefusal::Height);
        }
        all.push((observation.landmark, candidates));
    }
    // The best known position first; stable, so equal ones stay in order.
    let spread =
        |c: &[Candidate]| c.iter().map(|c| c.covariance.fixed_view::<3, 3>(3, 3).trace()).fold(0.0, f64::max);
    all.sort_by(|(_, a), (_, b)| spread(a).total_cmp(&spread(b)));
    let landmarks = all.iter().map(|(landmark, _)| *landmark).collect();
    let mut all = all.into_iter().map(|(_, candidates)| candidates);
    let first = all.next().unwrap_or_default();
    let others: Vec<Vec<Candidate>> = all.collect();
    let agrees = |c: &Candidate| others.iter().all(|o| o.iter().any(|o| distance2(c, o) <= AGREE_CHI2));
    let mut left: Vec<Candidate> = first.into_iter().filter(agrees).collect();
    match (left.pop(), left.is_empty()) {
        (Some(only), true) => {
            Ok(CameraPose { map_from_camera: only.pose, covariance: only.covariance, landmarks })
        }
        (Some(_), false) => Err(CameraPoseRefusal::Ambiguous),
        (None, _) => Err(CameraPoseRefusal::Disagree),
    }
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
    // (rotation vector, translation) of `camera_from_landmark` to (rotation vector, position) of the camera in the map.
    let map_from_camera = pose.rotation.to_rotation_matrix().into_inner();
    let mut by_seen = Matrix6::zeros();
    by_seen.fixed_view_mut::<3, 3>(0, 0).copy_from(&-map_from_camera);
    by_seen.fixed_view_mut::<3, 3>(3, 0).copy_from(&(-map_from_camera * cross(&seen.translation.vector)));
    by_seen.fixed_view_mut::<3, 3>(3, 3).copy_from(&-map_from_camera);
    let by_place = by_place(place, &pose.translation, &map_from_landmark.translation);
    let covariance = by_seen * solution.covariance * by_seen.transpose()
        + by_place * place.covariance * by_place.transpose();
    Candidate { pose, covariance }
}

/// Derivative of (rotation vector, position) of the camera by (x, y, theta, z, width, height) of the landmark. A landmark
/// that is larger by a share puts the camera farther away by that share; width and height count for half each.
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

/// Squared Mahalanobis distance of two poses; infinite where their covariance is singular.
fn distance2(a: &Candidate, b: &Candidate) -> f64 {
    let rotation = (a.pose.rotation * b.pose.rotation.inverse()).scaled_axis();
    let position = a.pose.translation.vector - b.pose.translation.vector;
    let d = Vector6::from_iterator(rotation.iter().chain(position.iter()).copied());
    (a.covariance + b.covariance).cholesky().map_or(f64::INFINITY, |s| d.dot(&s.solve(&d)))
}
