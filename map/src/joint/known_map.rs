//! A map without the keyframes of its drives, and a later drive on it.

use super::{
    build::SurveyProblem,
    closures::common_frame,
    factor::Factor,
    factors::summary::{Estimate, Summary},
    marginals::Marginals,
    params::JointParams,
    problem::JointError,
    survey::{CameraStated, Survey},
    survey_map::{Candidates, SurveyMap, opened},
    variables::{CameraState, LandmarkState, Variable, WallLine},
};
use crate::pose2::Pose2;
use nalgebra::{DMatrix, DVector};

/// Walls, landmarks and camera of a finished map with their joint covariance, in its frame.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownMap {
    /// Lines by wall number.
    walls: Vec<(usize, WallLine)>,
    landmarks: Vec<LandmarkState>,
    camera: CameraState,
    sqrt_information: DMatrix<f64>,
}

impl KnownMap {
    /// All walls of a map, some of its landmarks by their variable, and the camera, which must not
    /// be held.
    pub fn of(map: &SurveyMap, landmarks: &[usize]) -> Result<Self, JointError> {
        let state = &map.problem.state;
        let walls = map.wall_of.iter().map(|(number, wall)| (*number, state.walls[*wall]));
        let mut chosen: Vec<Variable> = map.wall_of.values().map(|wall| Variable::Wall(*wall)).collect();
        chosen.extend(landmarks.iter().map(|landmark| Variable::Landmark(*landmark)));
        chosen.push(Variable::Camera(0));
        let lower = Marginals::of(&map.problem, &chosen)?.into_covariance().cholesky();
        let lower = lower.ok_or(JointError::Loose)?.l();
        let unit = DMatrix::identity(lower.nrows(), lower.nrows());
        Ok(Self {
            walls: walls.collect(),
            landmarks: landmarks.iter().map(|landmark| state.landmarks[*landmark]).collect(),
            camera: state.cameras[0],
            sqrt_information: lower.solve_lower_triangular(&unit).ok_or(JointError::Loose)?,
        })
    }

    /// Adds the known variables to a problem whose first keyframe and camera become free; the
    /// landmarks follow those of the tracks.
    fn join(&self, joint: &mut SurveyProblem) {
        let state = &mut joint.problem.state;
        let mut estimates = Vec::new();
        for (number, line) in &self.walls {
            let wall = *joint.wall_of.entry(*number).or_insert(state.walls.len());
            state.walls.resize(state.walls.len().max(wall + 1), *line);
            state.walls[wall] = *line;
            estimates.push(Estimate::Wall(wall, *line));
        }
        for landmark in &self.landmarks {
            let number = state.landmarks.len();
            joint.landmark_of.push(Some(number));
            state.landmarks.push(*landmark);
            estimates.push(Estimate::Landmark(number, *landmark));
        }
        estimates.push(Estimate::Camera(0, self.camera));
        let offset = DVector::zeros(self.sqrt_information.nrows());
        let summary = Summary { estimates, sqrt_information: self.sqrt_information.clone(), offset };
        joint.problem.fixed.clear();
        joint.problem.factors.push(Factor::Summary(Box::new(summary)));
        joint.without_closures = joint.problem.factors.len();
    }
}

/// Solves a survey of one drive on a known map, in the frame of that map. Wall numbers are those of
/// the map; `same` are pairs of a track and a known landmark. In the result the known landmarks
/// follow the tracks.
pub fn refined(
    survey: &Survey,
    known: &KnownMap,
    same: &[[usize; 2]],
    params: &JointParams,
) -> Result<SurveyMap, JointError> {
    survey.check()?;
    let camera = CameraStated { camera: known.camera, sigmas: None };
    let survey = Survey { start: Pose2::default(), camera, candidates: Vec::new(), ..survey.clone() };
    let open = opened(&survey, 0, params)?;
    let tracks = open.landmark_of.len();
    let wrong = |i| JointError::Survey { field: "track", what: "candidate", number: i };
    let mut pairs = Vec::new();
    for (i, [track, landmark]) in same.iter().enumerate() {
        let there = known.landmarks.get(*landmark).ok_or(wrong(i))?;
        let here = open.landmark_of.get(*track).ok_or(wrong(i))?;
        let Some(here) = here.map(|l| open.problem.state.landmarks[l]) else { continue };
        pairs.push(([*track, tracks + landmark], (*there, here)));
    }
    let both: Vec<_> = pairs.iter().map(|(_, both)| *both).collect();
    let (frame, distances) = common_frame(&both);
    let keyframes = open.problem.state.keyframes.iter().map(|pose| frame.compose(pose)).collect();
    let mut joint = SurveyProblem::new(&survey, params, Some(keyframes))?;
    known.join(&mut joint);
    let pairs = pairs.into_iter().map(|(pair, _)| pair).collect();
    let closures = Candidates::by_distance(pairs, &distances).settled(&survey, &mut joint, params)?;
    Ok(SurveyMap::of(joint, closures))
}
