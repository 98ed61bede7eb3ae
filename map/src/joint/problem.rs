//! The least-squares problem: values of the variables, factors between them, and what is fixed.

use super::{
    factor::{Factor, Kernels},
    variables::{State, Variable},
};
use crate::slam::{graph::MAX_POSES, normal_equations::NotPositiveDefinite};

/// Most factors of a problem.
pub const MAX_FACTORS: usize = 400_000;

/// Why a joint map cannot be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum JointError {
    /// There are too many variables or factors.
    #[error("{0} variables and {1} factors: at most {MAX_POSES} and {MAX_FACTORS}")]
    TooLarge(usize, usize),
    /// A factor names a missing variable, or has a number that is not finite or no spread.
    #[error("factor {0} names a missing variable, or has a number that is out of range")]
    Factor(usize),
    /// A variable that was asked for is missing or fixed.
    #[error("variable {0:?} is missing or fixed")]
    Variable(Variable),
    /// The factors do not determine every variable.
    #[error("the factors do not determine every variable")]
    Loose,
    /// A drive cannot be laid on those before it.
    #[error(
        "drive {drive} has {common} of the objects of those before it, and two are needed: drive past more of what \
         they passed"
    )]
    Apart {
        /// From 1.
        drive: usize,
        /// Objects that both saw.
        common: usize,
    },
    /// A number of a survey is out of range.
    #[error("{field} of {what} {number} is out of range")]
    Survey {
        /// What is wrong with it.
        field: &'static str,
        /// Its kind.
        what: &'static str,
        /// Its number.
        number: usize,
    },
}

impl From<NotPositiveDefinite> for JointError {
    fn from(_: NotPositiveDefinite) -> Self {
        Self::Loose
    }
}

/// A joint map to be solved.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JointProblem {
    /// Start values, then the solution.
    pub state: State,
    /// Terms of the cost.
    pub factors: Vec<Factor>,
    /// Variables that are not changed: the frame, a camera that is held.
    pub fixed: Vec<Variable>,
}

impl JointProblem {
    /// Bounds, variables that exist, numbers that are finite.
    pub(super) fn check(&self) -> Result<(), JointError> {
        let variables = self.state.variables().count();
        if variables > MAX_POSES || self.factors.len() > MAX_FACTORS {
            return Err(JointError::TooLarge(variables, self.factors.len()));
        }
        let good = |f: &Factor| {
            let ends = f.variables();
            f.is_valid()
                && ends.iter().all(|v| self.state.has(*v))
                && ends.get(1).is_none_or(|second| ends[0] != *second)
        };
        self.factors.iter().position(|f| !good(f)).map_or(Ok(()), |i| Err(JointError::Factor(i)))
    }

    /// The weight of each factor, between 0 and 1.
    pub fn weights(&self) -> Vec<f64> {
        let weight = |f: &Factor| {
            let chi2 = f.linearised(&self.state).residual.norm_squared();
            f.doubt_chi2(&Kernels::NARROW).map_or(1.0, |phi| crate::slam::graph::scaled_weight(phi, chi2))
        };
        self.factors.iter().map(weight).collect()
    }
}
