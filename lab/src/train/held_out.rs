//! Figures of networks on pictures that they were not trained on: choice of sides, classification
//! of quads, detection with them. Networks and sets in, figures out.

use super::{
    data::{Data, Set},
    network_training::{ChoiceExample, LabelledExample, TrainError},
    platt_scaling::PlattScaling,
};
use crate::evaluate::{
    detection::score::{FOUND, FOUND_WELL, ImageScore, score},
    reviewed::Reviewed,
    truth::{QuadState, TruthQuad},
};
use anyhow::Context as _;
use cli::{pictures, screen};
use serde::Serialize;
use vision::detect::{DetectParams, border_model::network::Network};

/// A first choice is right if its error exceeds that of the best line by at most this, px of the
/// working image.
const RIGHT_PX: f64 = 1.5;
/// Quads with a shorter side do not count.
const MIN_SIDE_PX: f64 = 20.0;

/// Border model and quad classifier, the part of the data held out from them, and all quads as the
/// border model places them.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) held_out: Option<usize>,
    pub(super) networks: [Network; 2],
    pub(super) data: Data,
}

/// Figures of both networks.
#[derive(Debug, Serialize)]
pub(super) struct Line {
    pub(super) network: &'static str,
    /// Share of the sides whose first choice is as near as the best line, within 1.5 px.
    pub(super) sides_right: f64,
    /// Mean distance of the first choice from the labelled side, px of the working image.
    pub(super) side_off_px: f64,
    /// Share of objects above the classifier's threshold, and false quads an image above it.
    pub(super) objects_kept: f64,
    pub(super) false_per_image: f64,
}

/// Detection by networks from which the pictures were held out.
#[derive(Debug, Serialize)]
pub(super) struct HeldOutFigures {
    pub(super) set: String,
    pub(super) quads: usize,
    pub(super) recall_70: f64,
    pub(super) recall_85: f64,
    /// None where no picture's labels are complete.
    pub(super) false_per_image: Option<f64>,
    pub(super) corner_px: f64,
}

/// Networks on the sides of one data set and the quads of another.
pub(super) fn line(
    name: &'static str,
    sides: &Data,
    quads: &Data,
    networks: &[Network; 2],
    params: &DetectParams,
) -> Line {
    let off: Vec<[f64; 2]> = sides.sides.iter().map(|r| off(&networks[0], r)).collect();
    let classified: Vec<(bool, f64)> =
        quads.quads.iter().map(|e| (e.is_one, networks[1].output(&e.features))).collect();
    summary(name, &off, &classified, params.quads.min_probability, sides.images)
}

/// Every part's networks on their part.
pub(super) fn line_of_parts(
    name: &'static str,
    sides: &Data,
    parts: &[Part],
    calibration: &PlattScaling,
    params: &DetectParams,
) -> Line {
    let mut offs = Vec::new();
    for p in parts {
        let held_out = sides.sides.iter().filter(|r| Some(r.group) == p.held_out);
        offs.extend(held_out.map(|r| off(&p.networks[0], r)));
    }
    let classified: Vec<(bool, f64)> =
        held_out(parts).map(|(e, output)| (e.is_one, calibration.of(output))).collect();
    summary(name, &offs, &classified, params.quads.min_probability, sides.images)
}

/// From the outputs for quads that were held out from each part's networks.
pub(super) fn calibration(parts: &[Part]) -> Result<PlattScaling, TrainError> {
    let (examples, outputs): (Vec<LabelledExample>, Vec<f64>) =
        held_out(parts).map(|(e, o)| (e.clone(), o)).unzip();
    PlattScaling::fit(&outputs, &examples)
}

fn held_out(parts: &[Part]) -> impl Iterator<Item = (&LabelledExample, f64)> {
    parts.iter().flat_map(|p| {
        let held_out = p.data.quads.iter().filter(|e| Some(e.group) == p.held_out);
        held_out.map(|e| (e, p.networks[1].output(&e.features)))
    })
}

/// Errors of the first choice and of the best line, px; of equal outputs the earlier.
fn off(net: &Network, r: &ChoiceExample) -> [f64; 2] {
    let outputs: Vec<f64> = r.features.iter().map(|f| net.output(f)).collect();
    let first = (0..outputs.len()).reduce(|a, b| if outputs[b] > outputs[a] { b } else { a });
    [first.map_or(f64::INFINITY, |i| r.off[i]), r.off.iter().copied().fold(f64::INFINITY, f64::min)]
}

fn summary(
    network: &'static str,
    sides: &[[f64; 2]],
    quads: &[(bool, f64)],
    min_probability: f64,
    images: usize,
) -> Line {
    let n = sides.len().max(1) as f64;
    let share_of = |is_one: bool| {
        let yes =
            |(one, odds): &&(bool, f64)| *one == is_one && 1.0 / (1.0 + (-odds).exp()) >= min_probability;
        quads.iter().filter(yes).count() as f64
    };
    let ones = quads.iter().filter(|(one, _)| *one).count().max(1) as f64;
    Line {
        network,
        sides_right: sides.iter().filter(|[first, best]| first - best < RIGHT_PX).count() as f64 / n,
        side_off_px: sides.iter().map(|s| s[0]).sum::<f64>() / n,
        objects_kept: share_of(true) / ones,
        false_per_image: share_of(false) / images.max(1) as f64,
    }
}

/// The sets of photographs, each image with the networks from which its part was held out.
pub(super) fn photographs(
    sets: &[Set],
    networks: &[[Network; 2]],
    params: &DetectParams,
) -> anyhow::Result<Vec<HeldOutFigures>> {
    let real = sets.iter().filter(|s| s.images().any(|(i, _)| i.quads.iter().any(TruthQuad::counts)));
    real.map(|set| evaluated(&set.truth.name, set, networks, params)).collect()
}

/// The pictures of a set, those of each part with its networks.
pub(super) fn evaluated(
    title: &str,
    set: &Set,
    networks: &[[Network; 2]],
    params: &DetectParams,
) -> anyhow::Result<HeldOutFigures> {
    let by = |[border_model, classifier]: &[Network; 2]| {
        let mut params = params.clone();
        params.quads.border_model = Some(border_model.clone());
        params.quads.quad_classifier = Some(classifier.clone());
        params
    };
    let params: Vec<DetectParams> = networks.iter().map(by).collect();
    let reviewed = Reviewed::of(&set.truth.name, None)?;
    let progress = screen::progress(set.images().count(), "detecting");
    let mut scores = Vec::new();
    for (image, part) in set.images() {
        progress.inc(1);
        let Some(params) = params.get(part) else { continue };
        let picture =
            pictures::read_picture(&image.path).with_context(|| image.path.display().to_string())?;
        scores.push(score(image, &picture, params, MIN_SIDE_PX, reviewed.quads(&image.file)));
    }
    progress.finish_and_clear();
    Ok(sums(title, &scores))
}

fn sums(title: &str, scores: &[ImageScore]) -> HeldOutFigures {
    let labels = || scores.iter().flat_map(|s| &s.labels).filter(|l| l.state == QuadState::Full);
    let quads = labels().count();
    let share = |least: f64| labels().filter(|l| l.iou >= least).count() as f64 / quads.max(1) as f64;
    let complete = scores.iter().filter(|s| s.false_quads.is_some()).count();
    let wrong: usize = scores.iter().map(ImageScore::false_left).sum();
    let mut errors: Vec<f64> = labels().filter_map(|l| l.corner_error_px).collect();
    errors.sort_by(f64::total_cmp);
    HeldOutFigures {
        set: title.to_owned(),
        quads,
        recall_70: share(FOUND),
        recall_85: share(FOUND_WELL),
        false_per_image: (complete > 0).then(|| wrong as f64 / complete as f64),
        corner_px: errors.get(errors.len() / 2).copied().unwrap_or(f64::NAN),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_by_hand() {
        // An output of 0 is a probability of a half, which passes.
        let quads = [(true, 0.0), (true, -1.0), (false, 3.0), (false, -3.0)];
        let l = summary("x", &[[2.0, 1.0], [4.0, 1.0]], &quads, 0.5, 4);
        assert!((l.sides_right - 0.5).abs() < 1e-12 && (l.side_off_px - 3.0).abs() < 1e-12);
        assert!((l.objects_kept - 0.5).abs() < 1e-12 && (l.false_per_image - 0.25).abs() < 1e-12);
    }
}
