//! The line of a wall in a scan: facing angle and offset in the robot frame.

use super::{Terms, dynamic, terms};
use crate::{joint::variables::State, pose2::wrap_rad};
use nalgebra::{Matrix2, Matrix2x3, Vector2};

/// A line fitted to a scan, and the wall that it belongs to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineFit {
    /// Keyframe of the scan.
    pub keyframe: usize,
    /// Wall.
    pub wall: usize,
    /// Direction of the facing normal in the robot frame, radians.
    pub facing_rad: f64,
    /// Offset from the robot along the normal, metres: negative, since the robot is on the free
    /// side.
    pub offset_m: f64,
    /// Root of the information over (facing angle, offset).
    pub sqrt_information: Matrix2<f64>,
    /// For a line that may be of another wall: beyond this chi2 its weight falls off.
    pub doubt_chi2: Option<f64>,
}

impl LineFit {
    pub(in crate::joint) fn is_valid(&self) -> bool {
        let numbers = [self.facing_rad, self.offset_m];
        numbers.iter().chain(self.sqrt_information.iter()).all(|v| v.is_finite())
    }

    pub(in crate::joint) fn linearised(&self, state: &State) -> Terms {
        let (x, wall) = (&state.keyframes[self.keyframe], &state.walls[self.wall]);
        let (n, along) = (wall.normal(), wall.along());
        let d = x.position() - wall.anchor.coords;
        let residual = Vector2::new(
            wrap_rad(wall.facing_rad - x.theta_rad - self.facing_rad),
            wall.offset_m - n.dot(&d) - self.offset_m,
        );
        let by_x = Matrix2x3::new(0.0, 0.0, -1.0, -n.x, -n.y, 0.0);
        let by_wall = Matrix2::new(1.0, 0.0, -along.dot(&d), 1.0);
        let w = &self.sqrt_information;
        terms(&(w * residual), vec![dynamic(&(w * by_x)), dynamic(&(w * by_wall))])
    }
}
