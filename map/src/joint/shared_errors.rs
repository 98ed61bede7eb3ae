//! Errors that the landmarks of a map have in common, as a stretch or a bend of the whole. In: the
//! solution and its landmarks. Out: for each landmark the derivative of its place by six
//! independent errors of variance 1.
//!
//! The covariance C of all places is dense. Nystroem's approximation by the six strongest
//! directions Q of the correlation of their centres, `C Q (Q' C Q)^-1 Q' C`, leaves a remainder
//! that is a Schur complement: however well Q was found, what is left to each place is a
//! covariance.

use super::{
    datum::DriveFrame,
    factor::Kernels,
    linearise::{Layout, Linearisation},
    marginals::FLOOR,
    problem::{JointError, JointProblem},
    variables::Variable,
};
use crate::slam::normal_equations::Factor;
use nalgebra::{DMatrix, DVector, Matrix6};
use vision::random::Random;

/// Errors in common.
const SHARED_ERRORS: usize = 6;
/// Fewest landmarks that have errors in common.
const MIN_LANDMARKS: usize = 2;
/// Iterations that turn the first directions towards the strongest ones.
const ITERATIONS: usize = 8;
/// A centre is not taken to be known better, metres.
const LEAST_SIGMA_M: f64 = 1e-3;
/// What is left to a place is at least `1 - KEPT^2` of its covariance, also where a few landmarks
/// have all in common: rounding would leave less than nothing.
const KEPT: f64 = 0.999;
/// Parameters of a landmark.
const SIZE: usize = 8;

/// A landmark and the standard deviation of its centre on the floor, metres.
pub(super) type Placed = (usize, f64);

/// Of each landmark, over `of_place` of its parameters. `None` where there are too few to have any
/// in common.
pub(super) fn shared_errors(
    problem: &JointProblem,
    frame: Option<&DriveFrame>,
    landmarks: &[Placed],
    of_place: &[usize; 6],
) -> Result<Option<Vec<Matrix6<f64>>>, JointError> {
    if landmarks.len() < MIN_LANDMARKS {
        return Ok(None);
    }
    let variables: Vec<Variable> = landmarks.iter().map(|(number, _)| Variable::Landmark(*number)).collect();
    let layout = Layout::new(problem);
    let at = Linearisation::at(problem, &problem.state, &Kernels::NARROW);
    let (mut matrix, _) = layout.equations(&at);
    matrix.change_diagonal(|d| d + FLOOR);
    let factor = matrix.factor()?;
    let times = |vectors: &DMatrix<f64>| {
        let product = covariance_times(&layout, &factor, &variables, vectors);
        match frame {
            Some(frame) => frame.relative_product(&problem.state, &variables, vectors, &product),
            None => product,
        }
    };
    // Centres on the floor by their own deviation: what one landmark has alone is not taken for
    // common because it is large.
    let weight =
        |row: usize| if row % SIZE < 2 { 1.0 / landmarks[row / SIZE].1.max(LEAST_SIGMA_M) } else { 0.0 };
    let weights = DVector::from_fn(SIZE * landmarks.len(), |row, _| weight(row));
    let weighted = |m: DMatrix<f64>| DMatrix::from_diagonal(&weights) * m;
    let mut random = Random::new(1);
    let columns = SHARED_ERRORS.min(2 * landmarks.len());
    let mut directions = weighted(DMatrix::from_fn(weights.len(), columns, |_, _| random.normal()));
    for _ in 0..ITERATIONS {
        directions = weighted(times(&weighted(directions.qr().q())));
    }
    let directions = weighted(directions.qr().q());
    let product = times(&directions);
    let Some(strength) = directions.tr_mul(&product).cholesky() else { return Ok(None) };
    // `product / L'`, so that its square is the approximation.
    let Some(by) = strength.l().solve_lower_triangular(&product.transpose()) else { return Ok(None) };
    let of = |landmark: usize| {
        let error = |row: usize, error: usize| KEPT * by[(error, SIZE * landmark + of_place[row])];
        Matrix6::from_fn(|row, column| if column < columns { error(row, column) } else { 0.0 })
    };
    Ok(Some((0..landmarks.len()).map(of).collect()))
}

/// The covariance of landmarks relative to the first pose, times some vectors.
fn covariance_times(
    layout: &Layout,
    factor: &Factor<'_>,
    variables: &[Variable],
    vectors: &DMatrix<f64>,
) -> DMatrix<f64> {
    let unknowns = layout.free.iter().map(|variable| variable.size()).sum();
    let rows = |variable: &Variable| layout.block(*variable).map(|block| layout.pattern.rows(block));
    let mut product = DMatrix::zeros(vectors.nrows(), vectors.ncols());
    for (k, vector) in vectors.column_iter().enumerate() {
        let mut right = vec![0.0; unknowns];
        for (rows, part) in variables.iter().map(rows).zip(vector.as_slice().chunks(SIZE)) {
            if let Some(rows) = rows {
                right[rows].copy_from_slice(part);
            }
        }
        let solution = factor.solve(&right);
        for (i, rows) in variables.iter().map(rows).enumerate() {
            if let Some(rows) = rows {
                product.view_mut((SIZE * i, k), (SIZE, 1)).copy_from_slice(&solution[rows]);
            }
        }
    }
    product
}
