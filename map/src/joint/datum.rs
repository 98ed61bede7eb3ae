//! What the covariances of a map are relative to.
//!
//! The solution is relative to the first pose: its error of heading alone moves the far end of a
//! building. Where nobody knows the first pose in another frame, the frame is a definition, and the
//! drive as a whole defines it: the rigid motion that lays the keyframes best on the true ones is
//! no error of the map (a free network's datum, in the words of surveyors; method 29.4).

use super::{
    factor::Kernels,
    linearise::{Layout, Linearisation},
    marginals::FLOOR,
    problem::{JointError, JointProblem},
    variables::{State, Variable},
};
use crate::pose2::Pose2;
use nalgebra::{DMatrix, Matrix3, Point2, RowVector3, Vector2, Vector3};

/// What defines the frame of a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Datum {
    /// The first pose: it is known in a frame that others use, too.
    FirstPose,
    /// The drive as a whole.
    WholeDrive,
}

/// A turn counts as the way that it gives at this distance, metres: it decides where a drive stays
/// at its place.
const LEVER_M: f64 = 1.0;

/// How every parameter goes with the shift and turn of the keyframes.
pub(super) struct DriveFrame {
    centre: Point2<f64>,
    /// Covariance of shift (metres) and turn (radians).
    covariance: Matrix3<f64>,
    /// Cross-covariance of every free parameter with them, in the order of the layout.
    with: Vec<Vector3<f64>>,
    layout: Layout,
}

impl DriveFrame {
    /// At the solution of a problem.
    pub(super) fn of(problem: &JointProblem) -> Result<Self, JointError> {
        problem.check()?;
        let keyframes = &problem.state.keyframes;
        let count = keyframes.len().max(1) as f64;
        let middle: Vector2<f64> = keyframes.iter().map(Pose2::position).sum();
        let centre = Point2::from(middle / count);
        let squares: f64 = keyframes.iter().map(|k| (k.position() - centre.coords).norm_squared()).sum();
        let (turn, lever) = (squares + count * LEVER_M * LEVER_M, LEVER_M * LEVER_M);
        // The derivatives of shift and turn by a keyframe's x, y and heading.
        let by = |keyframe: usize| {
            let from = keyframes[keyframe].position() - centre.coords;
            Matrix3::new(
                1.0 / count,
                0.0,
                0.0,
                0.0,
                1.0 / count,
                0.0,
                -from.y / turn,
                from.x / turn,
                lever / turn,
            )
        };
        let layout = Layout::new(problem);
        let at = Linearisation::at(problem, &problem.state, &Kernels::NARROW);
        let (mut matrix, gradient) = layout.equations(&at);
        matrix.change_diagonal(|d| d + FLOOR);
        let factor = matrix.factor()?;
        let mut with = vec![Vector3::zeros(); gradient.len()];
        let mut covariance = Matrix3::zeros();
        for k in 0..3 {
            let mut right = vec![0.0; gradient.len()];
            for (rows, by) in rows_of_keyframes(&layout, keyframes.len()).map(|(i, rows)| (rows, by(i))) {
                right[rows].copy_from_slice(by.row(k).transpose().as_slice());
            }
            for (all, one) in with.iter_mut().zip(factor.solve(&right)) {
                all[k] = one;
            }
        }
        for (keyframe, rows) in rows_of_keyframes(&layout, keyframes.len()) {
            for (j, row) in rows.enumerate() {
                covariance += by(keyframe).column(j) * with[row].transpose();
            }
        }
        drop(factor);
        Ok(Self { centre, covariance: 0.5 * (covariance + covariance.transpose()), with, layout })
    }

    /// The covariance of a variable relative to the drive as a whole, from that relative to the
    /// first pose.
    pub(super) fn relative(
        &self,
        state: &State,
        variable: Variable,
        covariance: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let one = DMatrix::identity(variable.size(), variable.size());
        self.relative_product(state, &[variable], &one, covariance)
    }

    /// The joint covariance of variables relative to the drive as a whole, times some vectors, from
    /// that relative to the first pose, times the same.
    pub(super) fn relative_product(
        &self,
        state: &State,
        variables: &[Variable],
        vectors: &DMatrix<f64>,
        product: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let mut moves = DMatrix::zeros(vectors.nrows(), 3);
        let mut with = moves.clone();
        let mut at = 0;
        for &variable in variables {
            moves.rows_mut(at, variable.size()).copy_from(&self.moves(state, variable));
            if let Some(block) = self.layout.block(variable) {
                for (k, row) in self.layout.pattern.rows(block).enumerate() {
                    with.set_row(at + k, &self.with[row].transpose());
                }
            }
            at += variable.size();
        }
        let (moved, along) = (moves.tr_mul(vectors), with.tr_mul(vectors));
        product - &with * &moved - &moves * along + &moves * (self.covariance * moved)
    }

    /// How a shift and turn of all moves the parameters of a variable.
    fn moves(&self, state: &State, variable: Variable) -> DMatrix<f64> {
        let mut moves = DMatrix::zeros(variable.size(), 3);
        let mut point = |at: Vector2<f64>| {
            let from = at - self.centre.coords;
            moves.set_row(0, &RowVector3::new(1.0, 0.0, -from.y));
            moves.set_row(1, &RowVector3::new(0.0, 1.0, from.x));
            moves.set_row(2, &RowVector3::new(0.0, 0.0, 1.0));
        };
        match variable {
            Variable::Keyframe(i) => point(state.keyframes[i].position()),
            Variable::Landmark(i) => point(state.landmarks[i].centre.xy()),
            Variable::Wall(i) => {
                let wall = &state.walls[i];
                let n = wall.normal();
                moves.set_row(0, &RowVector3::new(0.0, 0.0, 1.0));
                moves.set_row(1, &RowVector3::new(n.x, n.y, wall.along().dot(&(self.centre - wall.anchor))));
            }
            Variable::Camera(_) | Variable::Odometry(_) | Variable::Ceiling(_) => {}
        }
        moves
    }
}

/// Rows of each keyframe that is free.
fn rows_of_keyframes(
    layout: &Layout,
    keyframes: usize,
) -> impl Iterator<Item = (usize, std::ops::Range<usize>)> {
    let rows = |i| Some((i, layout.pattern.rows(layout.block(Variable::Keyframe(i))?)));
    (0..keyframes).filter_map(rows)
}
