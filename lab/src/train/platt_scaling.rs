//! Calibrates a network's probability on examples that it was not trained on (Platt scaling).
//! Outputs with labels in, a linear function of the output out. The order of examples does not
//! change.

use super::network_training::{LabelledExample, TrainError};
use vision::detect::border_model::network::Network;

/// Newton's steps; a few are enough, as the loss is convex.
const STEPS: usize = 60;
/// Added to the curvature: equal outputs have no slope.
const RIDGE: f64 = 1e-6;
/// Longest step of either number.
const LONGEST: f64 = 1.0;

/// The calibrated output is `factor * output + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlattScaling {
    /// Above 0; below 1 for an overconfident network.
    pub(crate) factor: f64,
    /// Log odds at an output of 0.
    pub(crate) offset: f64,
}

impl PlattScaling {
    /// Maximum-likelihood fit to held-out examples, each counted by its weight. `outputs` and
    /// `examples` correspond.
    pub(crate) fn fit(outputs: &[f64], examples: &[LabelledExample]) -> Result<Self, TrainError> {
        let pairs = || outputs.iter().zip(examples);
        if let Some(i) = pairs().position(|(o, e)| !o.is_finite() || !e.weight.is_finite() || e.weight <= 0.0)
        {
            return Err(TrainError::Malformed(i));
        }
        let count = |is_one: bool| pairs().filter(|p| p.1.is_one == is_one).map(|p| p.1.weight).sum::<f64>();
        let (ones, others) = (count(true), count(false));
        if ones <= 0.0 || others <= 0.0 {
            return Err(TrainError::NothingToLearn);
        }
        // Platt's targets: as with one more example of either kind.
        let wanted = [1.0 / (others + 2.0), (ones + 1.0) / (ones + 2.0)];
        let mut line = Self { factor: 1.0, offset: 0.0 };
        for _ in 0..STEPS {
            let (mut slope, mut curve) = ([0.0; 2], [RIDGE, 0.0, RIDGE]);
            for (output, e) in pairs() {
                let chance = 1.0 / (1.0 + (-line.of(*output)).exp());
                let error = e.weight * (chance - wanted[usize::from(e.is_one)]);
                let weight = e.weight * chance * (1.0 - chance);
                slope = [slope[0] + error * output, slope[1] + error];
                curve = [curve[0] + weight * output * output, curve[1] + weight * output, curve[2] + weight];
            }
            let det = curve[0] * curve[2] - curve[1] * curve[1];
            let step = [
                (curve[2] * slope[0] - curve[1] * slope[1]) / det,
                (curve[0] * slope[1] - curve[1] * slope[0]) / det,
            ];
            line.factor -= step[0].clamp(-LONGEST, LONGEST);
            line.offset -= step[1].clamp(-LONGEST, LONGEST);
        }
        let sound = line.factor > 0.0 && line.factor.is_finite() && line.offset.is_finite();
        if sound { Ok(line) } else { Err(TrainError::NothingToLearn) }
    }

    /// The calibrated output.
    pub(crate) fn of(&self, output: f64) -> f64 {
        self.factor * output + self.offset
    }

    /// A network with this output: the same hidden units with scaled output weights.
    #[must_use]
    pub(crate) fn applied(&self, mut network: Network) -> Network {
        let weights = network.linear.iter_mut().chain(&mut network.hidden_out);
        weights.for_each(|w| *w *= self.factor);
        network.bias = self.of(network.bias);
        network
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vision::detect::border_model::feature_constants::FeatureDigest;
    use vision::random::Random;

    fn example(is_one: bool) -> LabelledExample {
        LabelledExample { group: 0, weight: 1.0, features: vec![], is_one }
    }

    /// Outputs with four times the true log odds, and shifted.
    fn overconfident(n: usize) -> (Vec<f64>, Vec<LabelledExample>) {
        let mut random = Random::new(7);
        let draw = |_| {
            let odds = 2.0 * random.normal();
            let is_one = 0.5 * (1.0 + (0.5 * odds).tanh()) > random.unit();
            (4.0 * odds + 3.0, example(is_one))
        };
        (0..n).map(draw).unzip()
    }

    #[test]
    fn overconfident_outputs_are_calibrated() {
        let (outputs, examples) = overconfident(20_000);
        let line = PlattScaling::fit(&outputs, &examples).unwrap();
        assert!((line.factor - 0.25).abs() < 0.01 && (line.offset + 0.75).abs() < 0.06, "{line:?}");
        // About half of the examples with probability one half.
        let near = |o: &f64| (1.0 / (1.0 + (-line.of(*o)).exp()) - 0.5).abs() < 0.05;
        let near_half: Vec<bool> =
            outputs.iter().zip(&examples).filter(|p| near(p.0)).map(|p| p.1.is_one).collect();
        let share = near_half.iter().filter(|is_one| **is_one).count() as f64 / near_half.len() as f64;
        assert!((share - 0.5).abs() < 0.06, "{share} of {}", near_half.len());
    }

    #[test]
    fn the_network_has_the_calibrated_output() {
        let network = Network {
            features: FeatureDigest::OF_THIS_PROGRAM,
            mean: vec![0.5],
            deviation: vec![2.0],
            linear: vec![1.5],
            hidden_in: vec![0.7],
            hidden_bias: vec![0.1],
            hidden_out: vec![-2.0],
            bias: 0.3,
        };
        let line = PlattScaling { factor: 0.4, offset: -0.2 };
        let wanted = line.of(network.output(&[1.7]));
        assert!((line.applied(network).output(&[1.7]) - wanted).abs() < 1e-12);
    }

    #[test]
    fn uninformative_outputs_are_refused_or_give_the_share() {
        let both = [example(true), example(false)];
        assert_eq!(PlattScaling::fit(&[1.0], &[example(true)]), Err(TrainError::NothingToLearn));
        assert_eq!(PlattScaling::fit(&[], &[]), Err(TrainError::NothingToLearn));
        assert_eq!(PlattScaling::fit(&[0.0, f64::NAN], &both), Err(TrainError::Malformed(1)));
        // Outputs of the wrong sign: no positive factor.
        let many: Vec<LabelledExample> = (0..100).map(|i| example(i % 2 == 0)).collect();
        let outputs: Vec<f64> =
            (0..100).map(|i| if i % 2 == 0 { -2.0 } else { 2.0 } + f64::from(i % 7)).collect();
        assert_eq!(PlattScaling::fit(&outputs, &many), Err(TrainError::NothingToLearn));
        // Equal outputs: finite, and the probability is the share.
        let scaling = PlattScaling::fit(&[1.0; 100], &many).unwrap();
        assert!(scaling.of(1.0).abs() < 0.05, "{scaling:?}");
    }
}
