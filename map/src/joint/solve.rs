//! Levenberg-Marquardt over all free variables.

use super::{
    factor::Kernels,
    linearise::{Layout, Linearisation},
    problem::{JointError, JointProblem},
};

/// Damping: start, least, and the most at which a step is still tried; relative to the diagonal.
const DAMPING: [f64; 3] = [1e-6, 1e-9, 1e6];
/// Damping of every parameter besides: a variable whose factors have lost their weight stays.
const FLOOR: f64 = 1e-2;

/// When a descent ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Descent {
    /// Most steps.
    pub steps: usize,
    /// Least gain of a step, relative to the cost.
    pub gain: f64,
    /// Widths of the robust kernels.
    pub kernels: Kernels,
}

impl Default for Descent {
    fn default() -> Self {
        Self { steps: 60, gain: 1e-5, kernels: Kernels::NARROW }
    }
}

/// What a descent came to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solved {
    /// Robust cost.
    pub cost: f64,
    /// Steps tried.
    pub steps: usize,
}

impl JointProblem {
    /// Moves all free variables to the least cost that is found downhill.
    pub fn solve(&mut self, descent: &Descent) -> Result<Solved, JointError> {
        self.check()?;
        let mut at = Linearisation::at(self, &self.state, &descent.kernels);
        let layout = Layout::new(self);
        if layout.free.is_empty() {
            return Ok(Solved { cost: at.cost, steps: 0 });
        }
        let [mut damping, least, most] = DAMPING;
        let mut steps = 0;
        while steps < descent.steps {
            steps += 1;
            let (mut matrix, gradient) = layout.equations(&at);
            matrix.change_diagonal(|d| d * (1.0 + damping) + FLOOR);
            let downhill: Vec<f64> = gradient.iter().map(|g| -g).collect();
            let step = matrix.factor()?.solve(&downhill);
            if step.iter().any(|v| !v.is_finite()) {
                return Err(JointError::Loose);
            }
            let moved = layout.stepped(&self.state, &step);
            let tried = Linearisation::at(self, &moved, &descent.kernels);
            let gain = at.cost - tried.cost;
            // Also where the cost is not a number.
            if gain.is_nan() || gain <= 0.0 {
                damping *= 10.0;
                if damping > most {
                    break;
                }
                continue;
            }
            (self.state, at) = (moved, tried);
            damping = (damping / 10.0).max(least);
            if gain < descent.gain * (1.0 + at.cost) {
                break;
            }
        }
        Ok(Solved { cost: at.cost, steps })
    }
}
