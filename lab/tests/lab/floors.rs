//! Claim: detection and recognition (E1, E3 to E8) are no worse than they were, by small runs of
//! the commands that measure them. Beside each bound is what was measured with it: the margin,
//! mostly 5 to 20 %, is more than rounding and less than a real loss.

use crate::lab;
use serde_json::Value;

/// The least or the greatest value of a figure.
enum Bound {
    Least(f64),
    Most(f64),
}
use Bound::{Least, Most};

/// The number at a path of an array of all that a command printed; `LIST/*/FIELD`: the mean over a
/// list.
fn figure(printed: &Value, path: &str) -> Option<f64> {
    let Some((list, field)) = path.split_once("/*") else { return printed.pointer(path)?.as_f64() };
    let list = printed.pointer(list)?.as_array()?;
    let sum = list.iter().map(|each| each.pointer(field)?.as_f64()).sum::<Option<f64>>()?;
    Some(sum / list.len() as f64)
}

/// Runs `waymark-lab evaluate COMMAND` and names each figure that is out of its bound.
fn hold(command: &str, bounds: &[(&str, Bound)]) {
    let words = ["evaluate"].into_iter().chain(command.split_whitespace()).chain(["--json"]);
    let printed = Value::Array(lab(words).json_lines());
    let out_of_bound = |(path, bound): &(&str, Bound)| {
        let value = figure(&printed, path);
        let value = value.unwrap_or_else(|| panic!("{command}: no number {path} in {printed}"));
        match bound {
            Least(least) => (value < *least).then(|| format!("{path} is {value}, at least {least}")),
            Most(most) => (value > *most).then(|| format!("{path} is {value}, at most {most}")),
        }
    };
    let worse: Vec<_> = bounds.iter().filter_map(out_of_bound).collect();
    assert!(worse.is_empty(), "{command}:\n{}", worse.join("\n"));
}

#[test]
fn quads_of_a_corridor_are_found_and_few_are_false() {
    let bounds = [
        // Of 76 quads in 60 images.
        ("/0/recall_70", Least(0.93)),        // 0.987
        ("/0/recall_85", Least(0.9)),         // 0.961
        ("/0/false_quads", Most(2.0)),        // 0
        ("/0/corner_error_px", Most(0.53)),   // 0.425
        ("/0/corner_error_90_px", Most(4.7)), // 3.73
        // The paper's detector.
        ("/1/recall_70", Least(0.48)),      // 0.579
        ("/1/recall_85", Least(0.46)),      // 0.566
        ("/1/corner_error_px", Most(0.77)), // 0.615
    ];
    hold("detection corridor --seed 931 --views 60 --compare paper", &bounds);
}

#[test]
fn distances_tell_a_landmark_from_all_else() {
    let bounds = [
        ("/0/landmarks", Least(6.0)),                    // 6, of 8 taught
        ("/0/histograms/0/own_normal/0", Most(0.4)),     // H^r: 0.324
        ("/0/histograms/0/other_normal/0", Least(15.0)), // 18.9
        ("/0/histograms/0/overlap", Most(0.005)),        // 0.0016
        ("/0/histograms/1/own_normal/0", Most(0.066)),   // C^r: 0.0530
        ("/0/histograms/1/other_normal/0", Least(0.73)), // 0.918
        ("/0/histograms/1/overlap", Most(0.01)),         // 0.0050
        ("/0/pairs/0/false_positives", Most(88.0)),      // 72 of 876, look-alikes with them
        ("/0/pairs/1/false_positives", Most(80.0)),      // 66 of 876
        ("/0/pairs/0/false_negatives", Most(1.0)),       // 0 of 24
        ("/0/pairs/1/false_negatives", Most(1.0)),       // 0 of 24
        ("/0/mated/right", Least(23.0)),                 // 24 of 24
    ];
    hold("discrimination --landmarks 8 --distractors 20 --views 2 --own-views 4", &bounds);
}

/// Where the medians of H^r/tau and C^r/tau reach 1, up to where half of the views are recognised,
/// and the share of all views that is.
const H: &str = "/0/curves/0/crossings/0/at";
const C: &str = "/0/curves/0/crossings/1/at";
const HALF: &str = "/0/curves/0/half/at";
const RIGHT: &str = "/0/curves/0/points/*/right";

#[test]
fn small_landmarks_are_recognised() {
    let bounds = [
        (H, Most(56.0)),      // 46.5 px
        (C, Most(56.0)),      // 46.5
        (HALF, Most(34.0)),   // 28, the smallest
        (RIGHT, Least(0.85)), // 1
    ];
    hold("scale --landmarks 8 --views 2", &bounds);
}

#[test]
fn oblique_landmarks_are_recognised() {
    let bounds = [
        (H, Least(75.0)),     // 83.5 degrees
        (C, Least(77.0)),     // 85, the most oblique
        (HALF, Least(77.0)),  // 85
        (RIGHT, Least(0.94)), // 1
    ];
    hold("viewpoint --landmarks 8 --views 2", &bounds);
}

#[test]
fn covered_landmarks_are_recognised() {
    let bounds = [
        (H, Least(44.0)),     // 50.4 %
        (C, Least(41.0)),     // 47.5
        (HALF, Least(34.0)),  // 40
        (RIGHT, Least(0.46)), // 0.549
    ];
    hold("occlusion --landmarks 8 --views 2", &bounds);
}

#[test]
fn landmarks_are_recognised_in_much_and_little_light() {
    // Gain, darker; gain, brighter; grey levels added; light lost to one side, and to a shadow.
    let bounds = [
        (H, Most(0.12)),                              // 0.1, the darkest
        (C, Most(0.12)),                              // 0.1
        (RIGHT, Least(0.94)),                         // 1
        ("/0/curves/1/crossings/0/at", Least(2.6)),   // 3, the brightest
        ("/0/curves/1/crossings/1/at", Least(2.6)),   // 3
        ("/0/curves/1/points/*/right", Least(0.85)),  // 0.958
        ("/0/curves/2/crossings/0/at", Least(120.0)), // 140, the most
        ("/0/curves/2/crossings/1/at", Least(120.0)), // 140
        ("/0/curves/2/points/*/right", Least(0.94)),  // 1
        ("/0/curves/3/points/*/right", Least(0.9)),   // 1
        ("/0/curves/4/points/*/right", Least(0.9)),   // 1
    ];
    hold("illumination --landmarks 8 --views 1", &bounds);
}
