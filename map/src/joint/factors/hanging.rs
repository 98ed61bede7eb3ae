//! How a landmark hangs: on a wall, under a ceiling, level. A landmark that does not (a door that
//! stands open) loses the weight of its wall.

use super::{Terms, positive, terms};
use crate::{joint::variables::State, pose2::wrap_rad};
use nalgebra::{DMatrix, Vector2};
use std::f64::consts::FRAC_PI_2;

/// A landmark lies in the plane of a wall and faces as it does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnWall {
    /// Landmark.
    pub landmark: usize,
    /// Wall.
    pub wall: usize,
    /// Standard deviation of the distance from the wall, metres.
    pub distance_sigma_m: f64,
    /// Standard deviation of the direction, radians.
    pub angle_sigma_rad: f64,
}

impl OnWall {
    pub(in crate::joint) fn is_valid(&self) -> bool {
        positive(self.distance_sigma_m) && positive(self.angle_sigma_rad)
    }

    pub(in crate::joint) fn linearised(&self, state: &State) -> Terms {
        let (m, wall) = (&state.landmarks[self.landmark], &state.walls[self.wall]);
        let (n, d) = (wall.normal(), m.centre.xy() - wall.anchor.coords);
        let (near, turned) = (1.0 / self.distance_sigma_m, 1.0 / self.angle_sigma_rad);
        let residual = Vector2::new(
            (n.dot(&d) - wall.offset_m) * near,
            wrap_rad(m.theta_rad - wall.facing_rad) * turned,
        );
        let (mut by_m, mut by_wall) = (DMatrix::zeros(2, 8), DMatrix::zeros(2, 2));
        (by_m[(0, 0)], by_m[(0, 1)], by_m[(1, 2)]) = (n.x * near, n.y * near, turned);
        (by_wall[(0, 0)], by_wall[(0, 1)], by_wall[(1, 0)]) = (wall.along().dot(&d) * near, -near, -turned);
        terms(&residual, vec![by_m, by_wall])
    }
}

/// A landmark lies under a ceiling and faces down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnderCeiling {
    /// Landmark.
    pub landmark: usize,
    /// Ceiling.
    pub ceiling: usize,
    /// Standard deviation of the distance from the ceiling, metres.
    pub distance_sigma_m: f64,
    /// Standard deviation of the tilt, radians.
    pub angle_sigma_rad: f64,
}

impl UnderCeiling {
    pub(in crate::joint) fn is_valid(&self) -> bool {
        positive(self.distance_sigma_m) && positive(self.angle_sigma_rad)
    }

    pub(in crate::joint) fn linearised(&self, state: &State) -> Terms {
        let (m, height_m) = (&state.landmarks[self.landmark], state.ceilings_m[self.ceiling]);
        let (near, turned) = (1.0 / self.distance_sigma_m, 1.0 / self.angle_sigma_rad);
        let residual = Vector2::new((m.centre.z - height_m) * near, (m.tilt_rad - FRAC_PI_2) * turned);
        let (mut by_m, mut by_ceiling) = (DMatrix::zeros(2, 8), DMatrix::zeros(2, 1));
        (by_m[(0, 3)], by_m[(1, 4)], by_ceiling[(0, 0)]) = (near, turned, -near);
        terms(&residual, vec![by_m, by_ceiling])
    }
}

/// A landmark has level sides: its tilt and roll are zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// Landmark.
    pub landmark: usize,
    /// Standard deviation of tilt and roll, radians.
    pub sigma_rad: f64,
}

impl Level {
    pub(in crate::joint) fn is_valid(&self) -> bool {
        positive(self.sigma_rad)
    }

    pub(in crate::joint) fn linearised(&self, state: &State) -> Terms {
        let m = &state.landmarks[self.landmark];
        let mut by_m = DMatrix::zeros(2, 8);
        (by_m[(0, 4)], by_m[(1, 5)]) = (1.0 / self.sigma_rad, 1.0 / self.sigma_rad);
        terms(&(Vector2::new(m.tilt_rad, m.roll_rad) / self.sigma_rad), vec![by_m])
    }
}
