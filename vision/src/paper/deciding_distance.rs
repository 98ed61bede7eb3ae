//! A quad and the landmarks of a map in, the landmarks nearest by C^r or H^r out, where that
//! distance decides (method 6.1, 6.2, 7.5). `recognise::decision` applies thresholds and margin.

use crate::{
    frame::GrayImage,
    model::{landmark_model::LandmarkModel, model_set::ModelSet},
    params::Params,
    recognise::{
        alignment::aligner::Aligner,
        decision::result::MAX_CANDIDATES,
        distance_kind::DistanceKind,
        features::correlation::correlation_within,
        retrieval::nearest::{NearLandmark, QuadReading, least_hausdorff},
        step_listener::{RecogniseStep, StepListener},
        verification::short_list::{VerifiedLandmark, aligned_with, distances},
    },
};
use std::sync::Arc;

/// The landmarks nearest by `kind`, nearest first, those within reach after alignment.
pub(crate) fn verified_nearest(
    image: &GrayImage,
    readings: &[QuadReading],
    models: &ModelSet,
    kind: DistanceKind,
    p: &Params,
    watch: &mut impl StepListener,
) -> Vec<VerifiedLandmark> {
    let near = nearest(readings, models, kind, MAX_CANDIDATES, p);
    watch.finished(RecogniseStep::ShortList);
    let mut found: Vec<VerifiedLandmark> = near.into_iter().map(VerifiedLandmark::new).collect();
    verify(image, readings, &mut found, (kind, models), p);
    watch.finished(RecogniseStep::Alignment);
    found
}

/// The `count` landmarks of least ratio by one of the paper's distances, and every one with a ratio
/// below 1, rising; of equal ones the lower id. Where C^r decides and nothing comes within
/// `verify_reach`, H^r is left infinite.
fn nearest(
    readings: &[QuadReading],
    models: &ModelSet,
    kind: DistanceKind,
    count: usize,
    p: &Params,
) -> Vec<NearLandmark> {
    let mut found: Vec<NearLandmark> = Vec::new();
    let mut ratios: Vec<f64> = Vec::new();
    // A landmark farther than the worst of the best `count` so far is skipped.
    let mut reach = f64::INFINITY;
    // The paper's gate for its own distances: stable points.
    let stable = p.learn.gates.min_stable_points;
    for model in models.iter().filter(|m| m.stable_points >= stable) {
        let near = match kind {
            DistanceKind::Hausdorff => nearest_by_points(readings, model, p),
            DistanceKind::Correlation | DistanceKind::Both => {
                nearest_by_correlation(readings, model, reach, p)
            }
        };
        let Some(near) = near.filter(|n| n.ratio(kind) <= reach) else { continue };
        ratios.push(near.ratio(kind));
        found.push(near);
        if count > 0 && ratios.len() >= count {
            let (_, worst, _) = ratios.select_nth_unstable_by(count - 1, f64::total_cmp);
            reach = worst.max(1.0);
        }
    }
    found.sort_by(|a, b| a.ratio(kind).total_cmp(&b.ratio(kind)));
    let accepted = found.iter().take_while(|n| n.ratio(kind) < 1.0).count();
    found.truncate(accepted.max(count));
    let reach = p.recognise.verdict.verify_reach.max(1.0);
    if kind != DistanceKind::Hausdorff && found.first().is_some_and(|n| n.ratio(kind) < reach) {
        for near in &mut found {
            near.hausdorff = least_hausdorff(readings[near.reading].points(p), &near.model, p).0;
        }
    }
    found
}

/// Least C^r over readings and exemplars, unless its ratio is above `reach`.
fn nearest_by_correlation(
    readings: &[QuadReading],
    model: &Arc<LandmarkModel>,
    reach: f64,
    p: &Params,
) -> Option<NearLandmark> {
    let tau = model.correlation.tau;
    if tau <= 0.0 {
        return None;
    }
    let rank = p.recognise.correlation.rank();
    let mut limit = reach * tau;
    let mut best = None;
    for (reading, s) in readings.iter().enumerate() {
        for (exemplar, e) in model.exemplars.iter().enumerate() {
            if let Some(d) = correlation_within(s.buckets(p), e.buckets(&p.recognise), rank, limit) {
                limit = d;
                best = Some((reading, exemplar, d));
            }
        }
    }
    best.map(|(reading, exemplar, correlation)| NearLandmark {
        model: Arc::clone(model),
        reading,
        exemplar,
        correlation,
        hausdorff: f64::INFINITY,
        likeness: None,
        signature: 0.0,
    })
}

/// Least H^r over readings and exemplars.
fn nearest_by_points(
    readings: &[QuadReading],
    model: &Arc<LandmarkModel>,
    p: &Params,
) -> Option<NearLandmark> {
    let mut best: Option<(usize, usize, f64)> = None;
    for (reading, s) in readings.iter().enumerate() {
        let (d, exemplar) = least_hausdorff(s.points(p), model, p);
        if d.is_finite() && best.is_none_or(|b| d < b.2) {
            best = Some((reading, exemplar, d));
        }
    }
    let (reading, exemplar, hausdorff) = best.filter(|_| model.hausdorff.tau > 0.0)?;
    let buckets = readings[reading].buckets(p);
    let rank = p.recognise.correlation.rank();
    let correlation = model
        .exemplars
        .iter()
        .filter_map(|e| correlation_within(buckets, e.buckets(&p.recognise), rank, f64::INFINITY))
        .fold(2.0, f64::min);
    Some(NearLandmark {
        model: Arc::clone(model),
        reading,
        exemplar,
        correlation,
        hausdorff,
        likeness: None,
        signature: 0.0,
    })
}

/// Aligns the quad's picture with each candidate within reach, nearest first, and keeps the better
/// of both results.
fn verify(
    image: &GrayImage,
    readings: &[QuadReading],
    found: &mut [VerifiedLandmark],
    (kind, models): (DistanceKind, &ModelSet),
    p: &Params,
) {
    let v = &p.recognise.verdict;
    let aligner = Aligner::new(models.lattices(), &v.align);
    for candidate in found.iter_mut().filter(|j| j.near.ratio(kind) < v.verify_reach).take(v.max_verified) {
        let reading = &readings[candidate.near.reading];
        let Some((icon, corners_px)) = aligned_with(image, reading, &candidate.near, &aligner, p) else {
            continue;
        };
        let (correlation, hausdorff) = distances(&icon, &candidate.near.model, p);
        let near = NearLandmark { correlation, hausdorff, ..candidate.near.clone() };
        let moved = VerifiedLandmark { moved: Some(corners_px), ..VerifiedLandmark::new(near) };
        // A landmark accepted at the detected corners is not lost by a worse alignment.
        let lost = candidate.refusal(kind, 1.0, v).is_none() && moved.refusal(kind, 1.0, v).is_some();
        if moved.near.ratio(kind) < candidate.near.ratio(kind) && !lost {
            *candidate = moved;
        }
    }
    found.sort_by(|a, b| a.near.ratio(kind).total_cmp(&b.near.ratio(kind)));
}

#[cfg(test)]
mod tests;
