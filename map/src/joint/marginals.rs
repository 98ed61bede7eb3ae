//! The joint covariance of chosen variables: blocks of the inverse of the normal equations.

use super::{
    factor::Kernels,
    factors::same_object::SAME_PARAMETERS,
    linearise::{Layout, Linearisation},
    problem::{JointError, JointProblem},
    variables::Variable,
};
use nalgebra::{DMatrix, Matrix6};
use std::collections::BTreeMap;

/// Information of every parameter besides, against a factor that is singular: far below any that a
/// factor gives.
pub(super) const FLOOR: f64 = 1e-6;

/// Joint covariance of chosen variables, relative to what is fixed.
#[derive(Debug, Clone, PartialEq)]
pub struct Marginals {
    first: BTreeMap<Variable, usize>,
    covariance: DMatrix<f64>,
}

impl Marginals {
    /// Covariance and cross-covariances of `chosen`, at the solution.
    pub fn of(problem: &JointProblem, chosen: &[Variable]) -> Result<Self, JointError> {
        problem.check()?;
        let layout = Layout::new(problem);
        let (mut first, mut blocks, mut rows) = (BTreeMap::new(), Vec::new(), 0);
        for &variable in chosen {
            blocks.push(layout.block(variable).ok_or(JointError::Variable(variable))?);
            first.insert(variable, rows);
            rows += variable.size();
        }
        let at = Linearisation::at(problem, &problem.state, &Kernels::NARROW);
        let (mut matrix, _) = layout.equations(&at);
        matrix.change_diagonal(|d| d + FLOOR);
        let inverse = matrix.factor()?.inverse_of(&blocks);
        Ok(Self { first, covariance: 0.5 * (&inverse + inverse.transpose()) })
    }

    /// Cross-covariance of two variables, the covariance of one; `None` where one was not chosen.
    pub fn block(&self, row: Variable, column: Variable) -> Option<DMatrix<f64>> {
        let (&r, &c) = (self.first.get(&row)?, self.first.get(&column)?);
        Some(self.covariance.view((r, c), (row.size(), column.size())).into_owned())
    }

    /// Over all parameters of the chosen variables, in their order.
    pub(super) fn into_covariance(self) -> DMatrix<f64> {
        self.covariance
    }

    /// Of two landmarks, the part of [`SAME_PARAMETERS`].
    pub fn same_block(&self, row: Variable, column: Variable) -> Option<Matrix6<f64>> {
        let block = self.block(row, column).filter(|b| b.shape() == (8, 8))?;
        Some(Matrix6::from_fn(|r, c| block[(SAME_PARAMETERS[r], SAME_PARAMETERS[c])]))
    }
}
