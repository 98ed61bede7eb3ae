//! What earlier drives or keyframes left: a Gaussian over some variables.

use super::{Terms, camera_prior::rotation_by_perturbation};
use crate::{
    joint::variables::{CameraState, LandmarkState, OdometryErrors, State, Variable, WallLine},
    pose2::{Pose2, wrap_rad},
};
use nalgebra::{DMatrix, DVector, Vector3};

/// A variable of the summary with its mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::joint) enum Estimate {
    /// Number of the wall, and its line; the variable has the same anchor.
    Wall(usize, WallLine),
    Landmark(usize, LandmarkState),
    Camera(usize, CameraState),
    Keyframe(usize, Pose2),
    Odometry(usize, OdometryErrors),
}

impl Estimate {
    fn variable(&self) -> Variable {
        match self {
            Self::Wall(i, _) => Variable::Wall(*i),
            Self::Landmark(i, _) => Variable::Landmark(*i),
            Self::Camera(i, _) => Variable::Camera(*i),
            Self::Keyframe(i, _) => Variable::Keyframe(*i),
            Self::Odometry(i, _) => Variable::Odometry(*i),
        }
    }

    /// A variable as it is; `None` for the height of a ceiling, which no summary has.
    pub(in crate::joint) fn of(variable: Variable, state: &State) -> Option<Self> {
        Some(match variable {
            Variable::Wall(i) => Self::Wall(i, state.walls[i]),
            Variable::Landmark(i) => Self::Landmark(i, state.landmarks[i]),
            Variable::Camera(i) => Self::Camera(i, state.cameras[i]),
            Variable::Keyframe(i) => Self::Keyframe(i, state.keyframes[i]),
            Variable::Odometry(i) => Self::Odometry(i, state.odometry[i]),
            Variable::Ceiling(_) => return None,
        })
    }

    /// The step from the mean to the state.
    fn difference(&self, state: &State) -> DVector<f64> {
        match self {
            Self::Wall(i, mean) => {
                let wall = &state.walls[*i];
                let turn = wrap_rad(wall.facing_rad - mean.facing_rad);
                DVector::from_column_slice(&[turn, wall.offset_m - mean.offset_m])
            }
            Self::Landmark(i, mean) => DVector::from_column_slice(state.landmarks[*i].minus(mean).as_slice()),
            Self::Camera(i, mean) => DVector::from_column_slice(state.cameras[*i].minus(mean).as_slice()),
            Self::Keyframe(i, mean) => DVector::from_column_slice(state.keyframes[*i].minus(mean).as_slice()),
            Self::Odometry(i, mean) => {
                let errors = &state.odometry[*i];
                let drift = errors.drift_rad_per_m - mean.drift_rad_per_m;
                DVector::from_column_slice(&[errors.scale - mean.scale, drift])
            }
        }
    }
}

/// A Gaussian over some variables.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    pub(in crate::joint) estimates: Vec<Estimate>,
    /// Root of the information over all parameters, in the order of the estimates.
    pub(in crate::joint) sqrt_information: DMatrix<f64>,
    /// The residual at the mean: where the mean was no minimum.
    pub(in crate::joint) offset: DVector<f64>,
}

impl Summary {
    pub(in crate::joint) fn is_valid(&self) -> bool {
        let parameters: usize = self.variables().iter().map(|v| v.size()).sum();
        let w = &self.sqrt_information;
        w.shape() == (parameters, parameters)
            && self.offset.len() == parameters
            && w.iter().chain(self.offset.iter()).all(|v| v.is_finite())
    }

    pub(in crate::joint) fn variables(&self) -> Vec<Variable> {
        self.estimates.iter().map(Estimate::variable).collect()
    }

    pub(in crate::joint) fn linearised(&self, state: &State) -> Terms {
        let w = &self.sqrt_information;
        let mut residual = self.offset.clone();
        let (mut by, mut first) = (Vec::new(), 0);
        for estimate in &self.estimates {
            let d = estimate.difference(state);
            let mut columns = w.columns(first, d.len()).into_owned();
            residual += &columns * &d;
            if let Estimate::Camera(..) = estimate {
                let turned =
                    columns.columns(0, 3) * rotation_by_perturbation(&Vector3::new(d[0], d[1], d[2]));
                columns.columns_mut(0, 3).copy_from(&turned);
            }
            by.push(columns);
            first += d.len();
        }
        (residual, by)
    }
}
