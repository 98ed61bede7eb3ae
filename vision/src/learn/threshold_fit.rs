//! Re-fits a model's thresholds when negatives are added; re-evaluates its quality gates.

use crate::{
    icon::Icon,
    learn::threshold::threshold,
    model::{
        exemplar::Exemplar,
        landmark_model::{DistanceSamples, Gate, GateFailure, LandmarkModel, ModelStatus, distances},
        threshold::{LimitedBy, Threshold, ThresholdError},
    },
    params::Params,
    recognise::{
        alignment::{
            aligner::{Aligner, SamplingGrids, Template},
            surroundings::Surroundings,
        },
        features::{
            icon_features::IconFeatures,
            signature::{self, Signature},
        },
        verification::{
            content::shown,
            gradient_similarity::{Smoothed, likeness},
        },
    },
};

/// The same model with tau fitted to its own distances and to `negatives` only. Cheap: the own
/// distances are stored in the model.
#[must_use]
pub fn refit_thresholds(model: &LandmarkModel, negatives: &[IconFeatures], p: &Params) -> LandmarkModel {
    let mut model = model.clone();
    let LandmarkModel { correlation_evidence, hausdorff_evidence, likeness_evidence, .. } = &mut model;
    for evidence in [correlation_evidence, hausdorff_evidence, likeness_evidence] {
        (evidence.nearest_others, evidence.others) = (vec![], 0);
    }
    add_negatives(&model, negatives, p)
}

/// The same model with `negatives` added to those it was fitted to: a new landmark costs one
/// comparison with its icons only.
#[must_use]
pub fn add_negatives(model: &LandmarkModel, negatives: &[IconFeatures], p: &Params) -> LandmarkModel {
    let mut model = model.clone();
    let prepared = prepared(&model.exemplars, p);
    let templates = Templates::new(&prepared, p);
    let exemplars = if negatives.is_empty() { Vec::new() } else { model.features(&p.recognise) };
    for negative in negatives {
        let d = distances(&exemplars, negative, &p.recognise);
        model.correlation_evidence.add(d.correlation);
        model.hausdorff_evidence.add(d.hausdorff);
        model.likeness_evidence.add(templates.unlikeness(negative, MIN_SIGNATURE));
    }
    let correlation = fitted(&model.correlation_evidence, p.learn.correlation_cap, p);
    let hausdorff = fitted(&model.hausdorff_evidence, p.learn.hausdorff_cap, p);
    let likeness = fitted_likeness(&model.likeness_evidence, p);
    model.correlation = correlation.unwrap_or(Threshold::NEVER);
    model.hausdorff = hausdorff.unwrap_or(Threshold::NEVER);
    model.likeness = likeness.unwrap_or(Threshold::NEVER);
    let missing = [
        correlation.err().map(Gate::CorrelationThreshold),
        hausdorff.err().map(Gate::HausdorffThreshold),
        likeness.err().map(Gate::LikenessThreshold),
    ];
    (model.status, model.waived) = status(&model, missing, p);
    model
}

impl DistanceSamples {
    /// Counts a negative distance, and stores it if it is among the nearest.
    pub(crate) fn add(&mut self, distance: f64) {
        self.others += 1;
        let distance = distance as f32;
        let at = self.nearest_others.partition_point(|d| *d <= distance);
        if at < Self::MAX_NEAREST {
            self.nearest_others.insert(at, distance);
            self.nearest_others.truncate(Self::MAX_NEAREST);
        }
    }
}

/// tau from the samples. Distances that were only counted are larger than the farthest one stored,
/// so tau stays below it.
pub(crate) fn fitted(evidence: &DistanceSamples, cap: f64, p: &Params) -> Result<Threshold, ThresholdError> {
    let own: Vec<f64> = evidence.own.iter().map(|d| f64::from(*d)).collect();
    let mut others: Vec<f64> = evidence.nearest_others.iter().map(|d| f64::from(*d)).collect();
    let counted_only = evidence.others > others.len();
    let cap = others.last().filter(|_| counted_only).map_or(cap, |farthest| cap.min(*farthest));
    others.resize(evidence.others, f64::INFINITY);
    threshold(&own, &others, cap, &p.learn.threshold)
}

/// The smallest 1 minus likeness of `icons` to the model's exemplars after alignment, the quantity
/// that limits tau of the likeness. Infinite where no signature is similar. For reports of
/// look-alikes.
pub fn unlikeness_of(model: &LandmarkModel, icons: &[IconFeatures], p: &Params) -> f64 {
    let prepared = prepared(&model.exemplars, p);
    let templates = Templates::new(&prepared, p);
    icons.iter().map(|icon| templates.unlikeness(icon, MIN_SIGNATURE)).fold(f64::INFINITY, f64::min)
}

/// Negatives whose signatures are less similar are not aligned with the exemplars: their distance
/// counts as infinite.
const MIN_SIGNATURE: f32 = 0.45;

/// An exemplar prepared for alignment.
pub(crate) struct PreparedExemplar<'a> {
    signature: &'a Signature,
    icon: Icon,
    coarse: Vec<f32>,
}

/// Prepares exemplars for alignment.
pub(crate) fn prepared<'a>(exemplars: &'a [Exemplar], p: &Params) -> Vec<PreparedExemplar<'a>> {
    let of = |e: &'a Exemplar| {
        let (icon, coarse) = e.template(&p.recognise.verdict.align);
        PreparedExemplar { signature: &e.signature, icon, coarse }
    };
    exemplars.iter().map(of).collect()
}

/// Exemplars with the aligner.
pub(crate) struct Templates<'a> {
    each: Vec<(&'a PreparedExemplar<'a>, Template<'a>)>,
    lattices: SamplingGrids,
    p: &'a Params,
}

impl<'a> Templates<'a> {
    pub(crate) fn new(exemplars: &'a [PreparedExemplar<'a>], p: &'a Params) -> Self {
        let each = exemplars.iter().map(|e| (e, Template::new(&e.icon, &e.coarse))).collect();
        Self { each, lattices: SamplingGrids::new(p.icon.size, &p.recognise.correlation), p }
    }

    /// The smallest 1 minus likeness of `icon` to the exemplars after alignment, of those whose
    /// signatures are similar enough.
    pub(crate) fn unlikeness(&self, icon: &IconFeatures, min_signature: f32) -> f64 {
        let (c, a) = (&self.p.recognise.correlation, &self.p.recognise.verdict.align);
        let aligner = Aligner::new(&self.lattices, a);
        let mut around = None;
        let mut least = f64::INFINITY;
        for (exemplar, template) in &self.each {
            if signature::likeness(exemplar.signature.values(), icon.signature.values()) < min_signature {
                continue;
            }
            let around = around.get_or_insert_with(|| Surroundings::of_icon(&icon.icon, a));
            let aligned = around.as_ref().and_then(|s| aligner.align(s, template));
            let aligned = aligned.as_ref().map_or(&icon.icon, |l| &l.icon);
            least = least.min(1.0 - likeness(aligned, &exemplar.icon, c));
        }
        least
    }
}

/// tau of the likeness: the cap, or a share of the nearest negative. An error where most of the
/// landmark's own views would be refused.
// Departs from method 8: own distances influence tau in no other way. Those of generated views, or
// of one robot's drive, are far smaller than those of another day (reflections, dust, another
// camera); the safe limit follows from the negatives alone.
fn fitted_likeness(evidence: &DistanceSamples, p: &Params) -> Result<Threshold, ThresholdError> {
    let mut own: Vec<f64> = evidence.own.iter().map(|d| f64::from(*d)).collect();
    own.sort_by(f64::total_cmp);
    let median = own.get(own.len() / 2).copied().ok_or(ThresholdError::NoPositive)?;
    let nearest = evidence.nearest_others.first().map_or(f64::INFINITY, |d| f64::from(*d));
    let share = p.learn.threshold.nearest_share * nearest;
    let (tau, limited_by) = if share < p.learn.likeness_cap {
        (share, LimitedBy::NearestNegative)
    } else {
        (p.learn.likeness_cap, LimitedBy::AbsoluteCap)
    };
    if median >= tau {
        return Err(ThresholdError::Overlap);
    }
    let missed = own.iter().filter(|d| **d >= tau).count();
    Ok(Threshold {
        tau,
        // tau is below the nearest of them.
        false_positive_rate: 0.0,
        false_negative_rate: missed as f64 / own.len() as f64,
        positives: own.len(),
        negatives: evidence.others,
        limited_by,
    })
}

/// The quality gates of method 9.
// Departs from method 9 unless the parameters say otherwise: a landmark seen from one side is used;
// stable points, and a threshold for each of the paper's distances, are required only where neither
// distance has one; content beyond the frame is required in addition. The likeness decides, and one
// of the two must agree; for a picture of few points the other distance suffices. Where a map's
// kind is one of the paper's, landmarks with too few stable points are excluded
// (recognise/retrieval/nearest.rs).
fn status(model: &LandmarkModel, missing: [Option<Gate>; 3], p: &Params) -> (ModelStatus, Vec<GateFailure>) {
    let g = &p.learn.gates;
    let photographed = model.views - model.generated_views;
    let observed = if photographed > 1 { photographed as f64 / model.views as f64 } else { 0.0 };
    let generated_f = g.min_saliency_f_generated;
    let min_saliency_f = generated_f + observed * (g.min_saliency_f - generated_f);
    let shown = |e: &Exemplar| shown(&Smoothed::new(&e.icon()), &p.recognise.correlation);
    let content = model.exemplars.iter().map(shown).fold(0.0, f64::max);
    let [correlation, hausdorff, likeness] = missing;
    let mut thresholds: Vec<Gate> = likeness.into_iter().collect();
    let papers = correlation.zip(hausdorff);
    thresholds.extend(papers.into_iter().flat_map(|(correlation, hausdorff)| [correlation, hausdorff]));
    let stable_points = model.stable_points as f64;
    let sides = Gate::VisibilityConfidence(model.seen_from);
    // Gate, value, limit, and whether failing it refuses the landmark.
    let measured = [
        (Gate::Views, model.views as f64, g.min_views as f64, true),
        (Gate::Saliency, model.saliency_f, min_saliency_f, true),
        (Gate::Content, content, p.recognise.verdict.min_content, true),
        (sides, model.photographed_v_c, g.min_v_c, g.refuse_one_side),
        (
            Gate::StablePoints,
            stable_points,
            g.min_stable_points as f64,
            g.refuse_few_points || papers.is_some(),
        ),
    ];
    let failed = |refusing: bool| {
        let failed = measured.iter().filter(move |(_, value, limit, refuses)| {
            value < limit && (*refuses && !g.refuse_nothing) == refusing
        });
        failed.map(|&(gate, value, limit, _)| GateFailure { gate, value, limit })
    };
    let mut failures: Vec<GateFailure> = failed(true).collect();
    failures.extend(thresholds.into_iter().map(|gate| GateFailure { gate, value: 0.0, limit: 0.0 }));
    let status = if failures.is_empty() { ModelStatus::Active } else { ModelStatus::Candidate(failures) };
    (status, failed(false).collect())
}
