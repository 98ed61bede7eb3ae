//! What is known beforehand of walls and sizes: by a floor plan, by a tape measure.

use super::{Terms, dynamic, positive, terms};
use crate::{
    joint::variables::{State, WallLine},
    pose2::wrap_rad,
};
use nalgebra::{DMatrix, Matrix2, Vector2};

/// A wall by a floor plan in the frame of the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallPrior {
    /// Wall.
    pub wall: usize,
    /// The line of the plan.
    pub line: WallLine,
    /// Standard deviation of the direction, radians.
    pub angle_sigma_rad: f64,
    /// Standard deviation of the offset at the anchor of the plan's line, metres.
    pub offset_sigma_m: f64,
}

impl WallPrior {
    pub(in crate::joint) fn is_valid(&self) -> bool {
        let line = &self.line;
        let numbers = [line.facing_rad, line.offset_m, line.anchor.x, line.anchor.y];
        positive(self.angle_sigma_rad)
            && positive(self.offset_sigma_m)
            && numbers.iter().all(|v| v.is_finite())
    }

    pub(in crate::joint) fn linearised(&self, state: &State) -> Terms {
        let (wall, plan) = (&state.walls[self.wall], &self.line);
        // The wall's distance from the point of the plan's line, along the wall's own normal.
        let point = plan.anchor.coords + plan.normal() * plan.offset_m;
        let d = point - wall.anchor.coords;
        let offset = wall.offset_m - wall.normal().dot(&d);
        let weights = Vector2::new(1.0 / self.angle_sigma_rad, 1.0 / self.offset_sigma_m);
        let residual =
            weights.component_mul(&Vector2::new(wrap_rad(wall.facing_rad - plan.facing_rad), offset));
        let by_wall = Matrix2::new(1.0, 0.0, -wall.along().dot(&d), 1.0);
        terms(&residual, vec![dynamic(&(Matrix2::from_diagonal(&weights) * by_wall))])
    }
}

/// A known size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SizePrior {
    /// Landmark.
    pub landmark: usize,
    /// Natural logarithms of width and height in metres.
    pub log_size: Vector2<f64>,
    /// Standard deviation of the logarithms.
    pub sigma: f64,
}

impl SizePrior {
    pub(in crate::joint) fn is_valid(&self) -> bool {
        positive(self.sigma) && self.log_size.iter().all(|v| v.is_finite())
    }

    pub(in crate::joint) fn linearised(&self, state: &State) -> Terms {
        let residual = (state.landmarks[self.landmark].log_size - self.log_size) / self.sigma;
        let mut by_m = DMatrix::zeros(2, 8);
        (by_m[(0, 6)], by_m[(1, 7)]) = (1.0 / self.sigma, 1.0 / self.sigma);
        terms(&residual, vec![by_m])
    }
}
