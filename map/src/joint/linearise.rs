//! Where each variable stands in the normal equations, and the equations at a state.

use super::{
    factor::{Kernels, Linearised},
    problem::JointProblem,
    variables::{State, Variable},
};
use crate::slam::{
    graph::{scaled_cost, scaled_weight},
    normal_equations::{BlockMatrix, BlockPattern},
};
use std::collections::BTreeMap;

/// The pattern of the normal equations, and the block row of each free variable.
pub(super) struct Layout {
    pub(super) pattern: BlockPattern,
    /// Free variables in the order of their block rows.
    pub(super) free: Vec<Variable>,
    block_of: BTreeMap<Variable, usize>,
}

impl Layout {
    pub(super) fn new(problem: &JointProblem) -> Self {
        let mut free: Vec<Variable> = problem.state.variables().collect();
        free.retain(|v| !problem.fixed.contains(v));
        let block_of: BTreeMap<Variable, usize> = free.iter().enumerate().map(|(i, v)| (*v, i)).collect();
        let sizes: Vec<usize> = free.iter().map(|v| v.size()).collect();
        let mut pairs = Vec::new();
        for factor in &problem.factors {
            let blocks: Vec<usize> =
                factor.variables().iter().filter_map(|v| block_of.get(v).copied()).collect();
            for (i, a) in blocks.iter().enumerate() {
                pairs.extend(blocks[..i].iter().map(|b| (*a, *b)));
            }
        }
        Self { pattern: BlockPattern::new(&sizes, pairs.into_iter()), free, block_of }
    }

    /// The block row of a variable; `None` for one that is fixed or missing.
    pub(super) fn block(&self, variable: Variable) -> Option<usize> {
        self.block_of.get(&variable).copied()
    }

    /// The state after a step of all free variables.
    pub(super) fn stepped(&self, state: &State, step: &[f64]) -> State {
        let mut moved = state.clone();
        for (block, variable) in self.free.iter().enumerate() {
            moved.step(*variable, &step[self.pattern.rows(block)]);
        }
        moved
    }

    /// Matrix and gradient of the normal equations.
    pub(super) fn equations(&self, at: &Linearisation) -> (BlockMatrix<'_>, Vec<f64>) {
        let unknowns = self.free.len().checked_sub(1).map_or(0, |last| self.pattern.rows(last).end);
        let (mut matrix, mut gradient) = (self.pattern.zeros(), vec![0.0; unknowns]);
        for (term, weight) in at.terms.iter().zip(&at.weights) {
            for (i, (variable, by)) in term.by.iter().enumerate() {
                let Some(row) = self.block(*variable) else { continue };
                let weighted = by * *weight;
                let down = weighted.tr_mul(&term.residual);
                for (total, g) in gradient[self.pattern.rows(row)].iter_mut().zip(down.iter()) {
                    *total += g;
                }
                for (other, by_other) in &term.by[..=i] {
                    let Some(column) = self.block(*other) else { continue };
                    matrix.add(row, column, &weighted.tr_mul(by_other));
                }
            }
        }
        (matrix, gradient)
    }
}

/// All factors at a state.
pub(super) struct Linearisation {
    terms: Vec<Linearised>,
    weights: Vec<f64>,
    pub(super) cost: f64,
}

impl Linearisation {
    pub(super) fn at(problem: &JointProblem, state: &State, kernels: &Kernels) -> Self {
        let (mut terms, mut weights, mut cost) = (Vec::new(), Vec::new(), 0.0);
        for factor in &problem.factors {
            let term = factor.linearised(state);
            let chi2 = term.residual.norm_squared();
            let doubt = factor.doubt_chi2(kernels);
            weights.push(doubt.map_or(1.0, |phi| scaled_weight(phi, chi2)));
            cost += doubt.map_or(chi2, |phi| scaled_cost(phi, chi2));
            terms.push(term);
        }
        Self { terms, weights, cost }
    }
}
