//! What earlier drives left: a Gaussian over walls, landmarks and camera.

use super::{Terms, camera_prior::rotation_by_perturbation};
use crate::{
    joint::variables::{CameraState, LandmarkState, State, Variable, WallLine},
    pose2::wrap_rad,
};
use nalgebra::{DMatrix, DVector, Vector3};

/// A variable of the summary with its mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::joint) enum Estimate {
    /// Number of the wall, and its line; the variable has the same anchor.
    Wall(usize, WallLine),
    Landmark(usize, LandmarkState),
    Camera(usize, CameraState),
}

impl Estimate {
    fn variable(&self) -> Variable {
        match self {
            Self::Wall(i, _) => Variable::Wall(*i),
            Self::Landmark(i, _) => Variable::Landmark(*i),
            Self::Camera(i, _) => Variable::Camera(*i),
        }
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
        }
    }
}

/// A Gaussian over some variables.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    pub(in crate::joint) estimates: Vec<Estimate>,
    /// Root of the information over all parameters, in the order of the estimates.
    pub(in crate::joint) sqrt_information: DMatrix<f64>,
}

impl Summary {
    pub(in crate::joint) fn is_valid(&self) -> bool {
        let parameters: usize = self.variables().iter().map(|v| v.size()).sum();
        let w = &self.sqrt_information;
        w.shape() == (parameters, parameters) && w.iter().all(|v| v.is_finite())
    }

    pub(in crate::joint) fn variables(&self) -> Vec<Variable> {
        self.estimates.iter().map(Estimate::variable).collect()
    }

    pub(in crate::joint) fn linearised(&self, state: &State) -> Terms {
        let w = &self.sqrt_information;
        let mut residual = DVector::zeros(w.nrows());
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
