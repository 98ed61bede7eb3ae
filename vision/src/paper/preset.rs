//! The parameters of the paper's own pipeline, where they differ from the defaults.

use crate::{detect::params::Grouping, params::Params};

/// Smallest score of a pair under equal weights, chosen on 150 rendered pictures (corridor, seed
/// 7): 0.6 and 0.7 find no more quads within the noise and more false ones; 0.8 finds fewer.
const MIN_SCORE: f64 = 0.75;

/// Relaxation over all six cues with G as printed, sets of three sides, floor tiling removed, icons
/// compared by the distances alone, at the detected corners, by the tau of least cost; every gate
/// refuses. What the pages of the method list as departures without a parameter is as in the
/// defaults.
pub(crate) fn params() -> Params {
    let mut p = Params::default();
    p.detect.quads.grouping = Grouping::Relaxation;
    p.detect.similarity.weights = [1.0 / 6.0; 6];
    p.detect.similarity.min_score = MIN_SCORE;
    p.detect.relaxation.linear_weight = 0.0;
    p.detect.tiling.remove = true;
    p.learn.threshold.limited = false;
    p.recognise.verdict.points = false;
    p.recognise.verdict.verify_reach = 0.0;
    p.learn.gates.refuse_one_side = true;
    p.learn.gates.refuse_few_points = true;
    p
}

/// Takes from `preset` what presets differ in; the rest of `p` stays.
pub(crate) fn choose(p: &mut Params, preset: Params) {
    let Params { detect, recognise, learn, .. } = preset;
    p.detect.quads.grouping = detect.quads.grouping;
    p.detect.similarity.weights = detect.similarity.weights;
    p.detect.similarity.min_score = detect.similarity.min_score;
    p.detect.relaxation.linear_weight = detect.relaxation.linear_weight;
    p.detect.tiling.remove = detect.tiling.remove;
    p.learn.threshold.limited = learn.threshold.limited;
    p.learn.gates.refuse_one_side = learn.gates.refuse_one_side;
    p.learn.gates.refuse_few_points = learn.gates.refuse_few_points;
    p.recognise.verdict.points = recognise.verdict.points;
    p.recognise.verdict.verify_reach = recognise.verdict.verify_reach;
}
