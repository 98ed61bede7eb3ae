//! Two tracks are one object: the loop closure by a landmark.

use super::{Terms, positive, terms};
use crate::joint::variables::{LandmarkState, State};
use nalgebra::{DMatrix, Vector6};

/// The parameters that two tracks of one object share: x, y, theta, z, log width, log height.
pub const SAME_PARAMETERS: [usize; 6] = [0, 1, 2, 3, 6, 7];

/// Two tracks are one object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SameObject {
    /// Landmark of the first track.
    pub a: usize,
    /// Landmark of the second track.
    pub b: usize,
    /// Standard deviations of the differences of [`SAME_PARAMETERS`].
    pub sigmas: Vector6<f64>,
}

/// Differences of [`SAME_PARAMETERS`].
pub(in crate::joint) fn difference(a: &LandmarkState, b: &LandmarkState) -> Vector6<f64> {
    let d = a.minus(b);
    Vector6::from(SAME_PARAMETERS.map(|k| d[k]))
}

impl SameObject {
    pub(in crate::joint) fn is_valid(&self) -> bool {
        self.a != self.b && self.sigmas.iter().all(|s| positive(*s))
    }

    pub(in crate::joint) fn linearised(&self, state: &State) -> Terms {
        let d = difference(&state.landmarks[self.a], &state.landmarks[self.b]);
        let mut by_a = DMatrix::zeros(6, 8);
        for (row, column) in SAME_PARAMETERS.into_iter().enumerate() {
            by_a[(row, column)] = 1.0 / self.sigmas[row];
        }
        let by_b = -&by_a;
        terms(&d.component_div(&self.sigmas), vec![by_a, by_b])
    }
}
