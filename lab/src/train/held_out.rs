//! What fitted networks are worth on pictures that they were not trained on: how well they choose and tell, and how well
//! the detector finds with them. Networks and sets in, figures out; trains nothing.

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
use serde::Serialize;
use server::cli::{pictures, screen};
use vision::detect::{DetectParams, border_model::network::Network};

/// A first choice that is off by so much more than the best rival, in pixels of the working image, is right.
const RIGHT_PX: f64 = 1.5;
/// Quads with a shorter side do not count, as those of a set of small signs.
const MIN_SIDE_PX: f64 = 20.0;

/// Networks of sides and of things, which part of the data they have not seen, and all quads as they measure them.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) unseen: Option<usize>,
    pub(super) networks: [Network; 2],
    pub(super) data: Data,
}

/// How well networks choose and tell.
#[derive(Debug, Serialize)]
pub(super) struct Line {
    pub(super) network: &'static str,
    /// Share of the sides whose first choice is as near as the best line, within 1.5 px.
    pub(super) sides_right: f64,
    /// Mean distance of the first choice from the labelled side, px of the working image.
    pub(super) side_off_px: f64,
    /// Share of things that are told to be things, and false ones an image that are.
    pub(super) things_kept: f64,
    pub(super) false_per_image: f64,
}

/// What the detector finds with networks that have not seen the pictures.
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

/// Networks on the sides of one gathering and the things of another.
pub(super) fn line(
    name: &'static str,
    sides: &Data,
    things: &Data,
    networks: &[Network; 2],
    params: &DetectParams,
) -> Line {
    let off: Vec<[f64; 2]> = sides.sides.iter().map(|r| off(&networks[0], r)).collect();
    let told: Vec<(bool, f64)> =
        things.things.iter().map(|e| (e.is_one, networks[1].output(&e.features))).collect();
    summary(name, &off, &told, params.quads.min_probability, sides.images)
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
        let unseen = sides.sides.iter().filter(|r| Some(r.group) == p.unseen);
        offs.extend(unseen.map(|r| off(&p.networks[0], r)));
    }
    let told: Vec<(bool, f64)> =
        unseen(parts).map(|(e, output)| (e.is_one, calibration.of(output))).collect();
    summary(name, &offs, &told, params.quads.min_probability, sides.images)
}

/// From the outputs for things that each part's networks have not seen.
pub(super) fn calibration(parts: &[Part]) -> Result<PlattScaling, TrainError> {
    let (examples, outputs): (Vec<LabelledExample>, Vec<f64>) =
        unseen(parts).map(|(e, o)| (e.clone(), o)).unzip();
    PlattScaling::fit(&outputs, &examples)
}

fn unseen(parts: &[Part]) -> impl Iterator<Item = (&LabelledExample, f64)> {
    parts.iter().flat_map(|p| {
        let unseen = p.data.things.iter().filter(|e| Some(e.group) == p.unseen);
        unseen.map(|e| (e, p.networks[1].output(&e.features)))
    })
}

/// How far the first choice is off, and the best rival; of equal outputs the earlier.
fn off(net: &Network, r: &ChoiceExample) -> [f64; 2] {
    let outputs: Vec<f64> = r.features.iter().map(|f| net.output(f)).collect();
    let first = (0..outputs.len()).reduce(|a, b| if outputs[b] > outputs[a] { b } else { a });
    [first.map_or(f64::INFINITY, |i| r.off[i]), r.off.iter().copied().fold(f64::INFINITY, f64::min)]
}

fn summary(
    network: &'static str,
    sides: &[[f64; 2]],
    things: &[(bool, f64)],
    min_probability: f64,
    images: usize,
) -> Line {
    let n = sides.len().max(1) as f64;
    let told = |is_one: bool| {
        let yes =
            |(one, odds): &&(bool, f64)| *one == is_one && 1.0 / (1.0 + (-odds).exp()) >= min_probability;
        things.iter().filter(yes).count() as f64
    };
    let ones = things.iter().filter(|(one, _)| *one).count().max(1) as f64;
    Line {
        network,
        sides_right: sides.iter().filter(|[first, best]| first - best < RIGHT_PX).count() as f64 / n,
        side_off_px: sides.iter().map(|s| s[0]).sum::<f64>() / n,
        things_kept: told(true) / ones,
        false_per_image: told(false) / images.max(1) as f64,
    }
}

/// The sets of photographs, each image with the networks that have not seen its part.
pub(super) fn photographs(
    sets: &[Set],
    networks: &[[Network; 2]],
    params: &DetectParams,
) -> anyhow::Result<Vec<HeldOutFigures>> {
    let real = sets.iter().filter(|s| s.images().any(|(i, _)| i.quads.iter().any(TruthQuad::counts)));
    real.map(|set| judged(&set.truth.name, set, networks, params)).collect()
}

/// The pictures of a set, those of each part with its networks.
pub(super) fn judged(
    title: &str,
    set: &Set,
    networks: &[[Network; 2]],
    params: &DetectParams,
) -> anyhow::Result<HeldOutFigures> {
    let by = |[side, thing]: &[Network; 2]| {
        let mut params = params.clone();
        params.quads.border_model = Some(side.clone());
        params.quads.quad_classifier = Some(thing.clone());
        params
    };
    let params: Vec<DetectParams> = networks.iter().map(by).collect();
    let reviewed = Reviewed::of(&set.truth.name, None)?;
    let progress = screen::progress(set.images().count(), "detecting");
    let mut scores = Vec::new();
    for (image, part) in set.images() {
        progress.inc(1);
        let Some(params) = params.get(part) else { continue };
        let gray = pictures::read(&image.path).with_context(|| image.path.display().to_string())?;
        scores.push(score(image, &gray, params, MIN_SIDE_PX, reviewed.things(&image.file)));
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
    fn results_by_hand() {
        // Odds of even are a half: kept.
        let things = [(true, 0.0), (true, -1.0), (false, 3.0), (false, -3.0)];
        let l = summary("x", &[[2.0, 1.0], [4.0, 1.0]], &things, 0.5, 4);
        assert!((l.sides_right - 0.5).abs() < 1e-12 && (l.side_off_px - 3.0).abs() < 1e-12);
        assert!((l.things_kept - 0.5).abs() < 1e-12 && (l.false_per_image - 0.25).abs() < 1e-12);
    }
}
