//! A small network: one hidden layer beside a linear path, one output. Features in, a number out.
//! `choose_sides` and `quad_classifier` use it. Training is in the laboratory (`lab/src/train`).

use super::feature_constants::{CLIP_DEVIATIONS, FeatureDigest};
use serde::{Deserialize, Serialize};

/// The weights. With `n` features and `h` hidden units:
/// `output = bias + linear . x + hidden_out . tanh(hidden_bias + hidden_in x)`, with `x` the
/// features scaled by `mean` and `deviation` and clipped to 4 deviations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Network {
    /// The measurements that the weights were fitted to.
    pub features: FeatureDigest,
    /// Mean of each feature, `n`.
    pub mean: Vec<f64>,
    /// Standard deviation of each feature, `n`.
    pub deviation: Vec<f64>,
    /// Weight of each scaled feature, `n`.
    pub linear: Vec<f64>,
    /// Weights of the hidden units, `h` rows of `n`.
    pub hidden_in: Vec<f64>,
    /// Biases of the hidden units, `h`.
    pub hidden_bias: Vec<f64>,
    /// Weights of the hidden units' outputs, `h`.
    pub hidden_out: Vec<f64>,
    /// Bias of the output.
    pub bias: f64,
}

/// Why weights are not those of a network with some number of features.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NetworkError {
    /// A list of weights has the wrong length.
    #[error("{field} has {actual} numbers, {expected} expected")]
    Length {
        /// Name of the list.
        field: &'static str,
        /// Numbers in it.
        actual: usize,
        /// Numbers expected.
        expected: usize,
    },
    /// More hidden units than [`MAX_HIDDEN`].
    #[error("{0} hidden units, at most {MAX_HIDDEN} are allowed")]
    Hidden(usize),
    /// A weight is not finite, or a deviation is not above 0.
    #[error("{0} has a number that is out of range")]
    Range(&'static str),
    /// The weights were fitted to other measurements than this program makes.
    #[error("features {0}: fitted to other measurements than those of this program ({program}); train it again",
        program = FeatureDigest::OF_THIS_PROGRAM)]
    Features(FeatureDigest),
}

/// Most hidden units.
pub const MAX_HIDDEN: usize = 64;

impl Network {
    /// Checks that this is a network for `n` features.
    pub fn check(&self, n: usize) -> Result<(), NetworkError> {
        if self.features != FeatureDigest::OF_THIS_PROGRAM {
            return Err(NetworkError::Features(self.features));
        }
        let h = self.hidden_bias.len();
        if h > MAX_HIDDEN {
            return Err(NetworkError::Hidden(h));
        }
        let lists = [
            ("mean", &self.mean, n),
            ("deviation", &self.deviation, n),
            ("linear", &self.linear, n),
            ("hidden_in", &self.hidden_in, n * h),
            ("hidden_bias", &self.hidden_bias, h),
            ("hidden_out", &self.hidden_out, h),
        ];
        for (field, list, expected) in lists {
            if list.len() != expected {
                return Err(NetworkError::Length { field, actual: list.len(), expected });
            }
            if list.iter().any(|x| !x.is_finite()) {
                return Err(NetworkError::Range(field));
            }
        }
        if self.deviation.iter().any(|d| *d <= 0.0) {
            return Err(NetworkError::Range("deviation"));
        }
        if self.bias.is_finite() { Ok(()) } else { Err(NetworkError::Range("bias")) }
    }

    /// The output for some features. Only the first `min(features, weights)` are used where the
    /// lengths differ.
    pub fn output(&self, measurements: &[f64]) -> f64 {
        let scaled: Vec<f64> = measurements
            .iter()
            .zip(self.mean.iter().zip(&self.deviation))
            .map(|(x, (mean, deviation))| ((x - mean) / deviation).clamp(-CLIP_DEVIATIONS, CLIP_DEVIATIONS))
            .collect();
        let dot = |weights: &[f64]| dot(&scaled, weights);
        let units = self
            .hidden_in
            .chunks_exact(scaled.len().max(1))
            .zip(self.hidden_bias.iter().zip(&self.hidden_out));
        let hidden: f64 = units.map(|(row, (bias, out))| out * (bias + dot(row)).tanh()).sum();
        self.bias + dot(&self.linear) + hidden
    }
}

/// Dot product, in several partial sums.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let ((a, a_rest), (b, b_rest)) = (a[..n].as_chunks::<4>(), b[..n].as_chunks::<4>());
    let mut sums = [0.0; 4];
    for (a, b) in a.iter().zip(b) {
        for (sum, (x, w)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += x * w;
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, w)| x * w).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    fn network() -> Network {
        Network {
            features: FeatureDigest::OF_THIS_PROGRAM,
            mean: vec![1.0, 0.0],
            deviation: vec![2.0, 1.0],
            linear: vec![0.5, -1.0],
            hidden_in: vec![1.0, 1.0, 0.0, -2.0],
            hidden_bias: vec![0.1, 0.0],
            hidden_out: vec![3.0, 1.0],
            bias: 0.25,
        }
    }

    #[test]
    fn the_output_is_the_formula() {
        let n = network();
        assert_eq!(n.check(2), Ok(()));
        // x = [2, 0.5] after scaling.
        let wanted = 0.25 + 0.5 * 2.0 - 0.5 + 3.0 * (2.6_f64).tanh() + (-1.0_f64).tanh();
        assert!((n.output(&[5.0, 0.5]) - wanted).abs() < 1e-12);
        // Clipped at 4 deviations.
        assert!((n.output(&[1e9, 0.0]) - n.output(&[9.0, 0.0])).abs() < 1e-12);
    }

    #[test]
    fn inconsistent_weights_are_refused() {
        assert!(network().check(3).is_err());
        let other = FeatureDigest(1);
        assert_eq!(Network { features: other, ..network() }.check(2), Err(NetworkError::Features(other)));
        assert_eq!(Network { bias: f64::NAN, ..network() }.check(2), Err(NetworkError::Range("bias")));
        assert!(Network { deviation: vec![1.0, 0.0], ..network() }.check(2).is_err());
        let h = MAX_HIDDEN + 1;
        let many = Network { hidden_bias: vec![0.0; h], ..network() };
        assert_eq!(many.check(2), Err(NetworkError::Hidden(h)));
        let most = Network {
            hidden_in: vec![0.0; 2 * MAX_HIDDEN],
            hidden_bias: vec![0.0; MAX_HIDDEN],
            hidden_out: vec![0.0; MAX_HIDDEN],
            ..network()
        };
        assert_eq!(most.check(2), Ok(()));
    }
}
