//! Whether a quad is the border of a flat thing at all, or lines that happen to meet: joints of tiles, a wall between two
//! corners, strokes inside a picture. The measurements of its four sides in, a probability out. The weights were fitted
//! on labelled photographs and renderings.
//!
//! Departs from method 3.6, whose score (similarity times support) tells how well a quad is seen, not what it is.

use super::{network::Network, side_model::SIDE_FEATURES};

/// Number of measurements: mean, smallest and largest of each measurement of a side, the quad's support score and the
/// log of its mean side in pixels.
pub const THING_FEATURES: usize = 3 * SIDE_FEATURES + 2;

/// The measurements of a quad.
pub fn thing_features(
    sides: &[[f64; SIDE_FEATURES]; 4],
    score: f64,
    mean_side_px: f64,
) -> [f64; THING_FEATURES] {
    let mut features = [0.0; THING_FEATURES];
    for i in 0..SIDE_FEATURES {
        let values = sides.map(|s| s[i]);
        features[i] = values.iter().sum::<f64>() / 4.0;
        features[SIDE_FEATURES + i] = values.iter().copied().fold(f64::INFINITY, f64::min);
        features[2 * SIDE_FEATURES + i] = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    }
    features[THING_FEATURES - 2] = score;
    features[THING_FEATURES - 1] = mean_side_px.max(1.0).ln();
    features
}

/// Probability that a quad of such measurements is the border of a thing, 0 to 1.
pub fn probability(model: &Network, features: &[f64; THING_FEATURES]) -> f64 {
    1.0 / (1.0 + (-model.output(features)).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_measurements_are_mean_least_and_most_of_the_sides() {
        let sides: [[f64; SIDE_FEATURES]; 4] = [1.0, 3.0, -2.0, 6.0].map(|x| [x; SIDE_FEATURES]);
        let features = thing_features(&sides, 0.7, 100.0);
        for (from, wanted) in [(0, 2.0), (SIDE_FEATURES, -2.0), (2 * SIDE_FEATURES, 6.0)] {
            assert!(features[from..from + SIDE_FEATURES].iter().all(|f| (f - wanted).abs() < 1e-12));
        }
        assert!((features[THING_FEATURES - 2] - 0.7).abs() < 1e-12);
        assert!((features[THING_FEATURES - 1] - 100.0_f64.ln()).abs() < 1e-12);
    }

    #[test]
    fn odds_of_three_to_one_are_three_quarters() {
        let model = Network {
            mean: vec![0.0; THING_FEATURES],
            deviation: vec![1.0; THING_FEATURES],
            linear: vec![0.0; THING_FEATURES],
            hidden_in: Vec::new(),
            hidden_bias: Vec::new(),
            hidden_out: Vec::new(),
            bias: 3.0_f64.ln(),
        };
        assert!((probability(&model, &[0.5; THING_FEATURES]) - 0.75).abs() < 1e-12);
    }

    #[test]
    fn a_network_for_other_measurements_is_refused_by_name() {
        let wrong = r#"{"thing_model": {"mean": [0], "deviation": [1], "linear": [0], "hidden_in": [],
            "hidden_bias": [], "hidden_out": [], "bias": 0}}"#;
        let error = serde_json::from_str::<super::super::quads::QuadParams>(wrong).unwrap_err().to_string();
        assert!(error.contains("mean has 1 numbers, 86 expected"), "{error}");
    }
}
