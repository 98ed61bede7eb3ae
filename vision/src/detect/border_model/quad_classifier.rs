//! The probability that a quad is the border of a flat object, not lines that happen to meet:
//! joints of tiles, a wall between two corners, strokes inside a picture. In: the features of its
//! four sides. Out: a probability. The weights were fitted on labelled photographs and renderings.
//!
//! Departs from method 3.6, whose score (similarity times support) measures edge support, not
//! whether the quad is an object.

use crate::detect::border_model::{
    network::Network,
    side_features::{SIDE_FEATURES, SideMeasurement},
};
use nalgebra::Point2;

/// Number of features: mean, smallest and largest of each feature of a side, and ten of the quad as
/// a whole.
pub const QUAD_FEATURES: usize = 3 * SIDE_FEATURES + WHOLE_FEATURES;
/// Features of the quad as a whole.
const WHOLE_FEATURES: usize = 10;

/// The features of a quad in an image of some width and height: mean, smallest and largest of each
/// feature of a side; its support score; log of its mean side in pixels; how much the sides differ
/// in the tone of the wall, just outside and just inside; how similar their steps are, 0 to 1; sine
/// of the sharpest corner; of opposite sides the log of the length ratio, of the pair that differs
/// less and of the other; how far corners lie outside the image, in mean sides.
pub fn quad_features(
    sides: &[SideMeasurement; 4],
    corners_px: &[Point2<f64>; 4],
    score: f64,
    size_px: (usize, usize),
) -> [f64; QUAD_FEATURES] {
    let mut features = [0.0; QUAD_FEATURES];
    for i in 0..SIDE_FEATURES {
        let values = sides.map(|s| s.features[i]);
        features[i] = values.iter().sum::<f64>() / 4.0;
        features[SIDE_FEATURES + i] = values.iter().copied().fold(f64::INFINITY, f64::min);
        features[2 * SIDE_FEATURES + i] = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    }
    features[3 * SIDE_FEATURES..].copy_from_slice(&of_the_whole(sides, corners_px, score, size_px));
    features
}

fn of_the_whole(
    sides: &[SideMeasurement; 4],
    corners_px: &[Point2<f64>; 4],
    score: f64,
    (width, height): (usize, usize),
) -> [f64; WHOLE_FEATURES] {
    let way = |i: usize| corners_px[(i + 1) % 4] - corners_px[i % 4];
    let length: [f64; 4] = std::array::from_fn(|i| way(i).norm().max(1.0));
    let mean_side = length.iter().sum::<f64>() / 4.0;
    let spread = |tone: fn(&SideMeasurement) -> f64| {
        let tones = sides.iter().map(tone);
        tones.clone().fold(f64::NEG_INFINITY, f64::max) - tones.fold(f64::INFINITY, f64::min)
    };
    let steps = sides.map(|s| s.tones.step);
    let all = steps.iter().map(|s| s.abs()).sum::<f64>();
    let sine = |i: usize| way(i).perp(&way(i + 1)).abs() / (length[i] * length[(i + 1) % 4]);
    let ratios = [0, 1].map(|i| (length[i] / length[i + 2]).ln().abs());
    let beyond = |p: &Point2<f64>| {
        let past = |x: f64, size: usize| (-x).max(x - size as f64 + 1.0).max(0.0);
        past(p.x, width).max(past(p.y, height)) / mean_side
    };
    [
        score,
        mean_side.ln(),
        spread(|s| s.tones.wall),
        spread(|s| s.tones.outside),
        spread(|s| s.tones.inside),
        if all > 0.0 { steps.iter().sum::<f64>().abs() / all } else { 0.0 },
        (0..4).map(sine).fold(1.0, f64::min),
        ratios[0].min(ratios[1]),
        ratios[0].max(ratios[1]),
        corners_px.iter().map(beyond).fold(0.0, f64::max).min(1.0),
    ]
}

/// Probability that a quad with these features is the border of an object, 0 to 1.
pub fn probability(model: &Network, features: &[f64; QUAD_FEATURES]) -> f64 {
    1.0 / (1.0 + (-model.output(features)).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::border_model::{feature_constants::FeatureDigest, side_features::LogGreyLevels};

    const SQUARE: [[f64; 2]; 4] = [[10.0, 10.0], [110.0, 10.0], [110.0, 110.0], [10.0, 110.0]];

    fn features(tones: [LogGreyLevels; 4], corners: [[f64; 2]; 4]) -> [f64; QUAD_FEATURES] {
        let values = [1.0, 3.0, -2.0, 6.0];
        let sides = std::array::from_fn(|i| SideMeasurement {
            features: [values[i]; SIDE_FEATURES],
            tones: tones[i],
        });
        quad_features(&sides, &corners.map(Point2::from), 0.7, (200, 150))
    }

    fn whole(tones: [LogGreyLevels; 4], corners: [[f64; 2]; 4]) -> [f64; WHOLE_FEATURES] {
        features(tones, corners)[3 * SIDE_FEATURES..].try_into().unwrap()
    }

    fn close(actual: &[f64], wanted: &[f64]) -> bool {
        actual.len() == wanted.len() && actual.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12)
    }

    #[test]
    fn features_are_mean_minimum_and_maximum_over_the_sides() {
        let features = features([LogGreyLevels::default(); 4], SQUARE);
        for (from, wanted) in [(0, 2.0), (SIDE_FEATURES, -2.0), (2 * SIDE_FEATURES, 6.0)] {
            assert!(close(&features[from..from + SIDE_FEATURES], &[wanted; SIDE_FEATURES]));
        }
        let whole = &features[3 * SIDE_FEATURES..];
        assert!(close(whole, &[0.7, 100.0_f64.ln(), 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), "{whole:?}");
    }

    #[test]
    fn tones_are_compared_between_the_sides() {
        let tones = [[5.0, 4.0, 3.0, 2.0], [5.5, 4.1, 3.0, 1.0], [5.2, 4.0, 3.7, -1.0], [5.0, 4.0, 3.0, 2.0]]
            .map(|[wall, outside, inside, step]| LogGreyLevels { wall, outside, inside, step });
        let spread = &whole(tones, SQUARE)[2..6];
        assert!(close(spread, &[0.5, 4.1 - 4.0, 3.7 - 3.0, 4.0 / 6.0]), "{spread:?}");
    }

    #[test]
    fn shape_features_do_not_depend_on_the_first_corner() {
        // 10 px beyond the right border, 1 px beyond the lower one.
        let corners = [[100.0, 50.0], [209.0, 20.0], [209.0, 150.0], [100.0, 110.0]];
        let mut features_from: Vec<[f64; WHOLE_FEATURES]> = Vec::new();
        for first in 0..4 {
            features_from.push(whole(
                [LogGreyLevels::default(); 4],
                std::array::from_fn(|i| corners[(i + first) % 4]),
            ));
        }
        assert!(features_from.iter().all(|s| close(s, &features_from[0])), "{features_from:?}");
        let [upper, lower] = [30.0_f64, 40.0].map(|rise| rise.hypot(109.0));
        let mean_side = (60.0 + 130.0 + upper + lower) / 4.0;
        let wanted = [109.0 / lower, (lower / upper).ln(), (130.0_f64 / 60.0).ln(), 10.0 / mean_side];
        assert!(close(&features_from[0][6..], &wanted), "{:?} {wanted:?}", &features_from[0][6..]);
    }

    #[test]
    fn log_odds_of_three_give_probability_three_quarters() {
        let model = Network {
            features: FeatureDigest::OF_THIS_PROGRAM,
            mean: vec![0.0; QUAD_FEATURES],
            deviation: vec![1.0; QUAD_FEATURES],
            linear: vec![0.0; QUAD_FEATURES],
            hidden_in: Vec::new(),
            hidden_bias: Vec::new(),
            hidden_out: Vec::new(),
            bias: 3.0_f64.ln(),
        };
        assert!((probability(&model, &[0.5; QUAD_FEATURES]) - 0.75).abs() < 1e-12);
    }

    #[test]
    fn a_network_of_another_input_size_is_refused() {
        let wrong = r#"{"quad_classifier": {"features": "DIGEST", "mean": [0], "deviation": [1], "linear": [0],
            "hidden_in": [],
            "hidden_bias": [], "hidden_out": [], "bias": 0}}"#;
        let of_this_program = wrong.replace("DIGEST", &FeatureDigest::OF_THIS_PROGRAM.to_string());
        let read = |text: &str| serde_json::from_str::<crate::detect::params::QuadParams>(text);
        let error = read(&of_this_program).unwrap_err().to_string();
        assert!(error.contains("mean has 1 numbers, 94 expected"), "{error}");
        let error = read(&wrong.replace("DIGEST", "0123456789abcdef")).unwrap_err().to_string();
        assert!(error.contains("features 0123456789abcdef: fitted to other measurements"), "{error}");
    }
}
