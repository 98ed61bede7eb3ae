//! Nearest landmarks in, the same after template alignment out: stronger evidence than a distance
//! at the detected corners. `decision` decides.

use crate::{
    frame::GrayImage,
    geometry::corners::Corners,
    icon::{Icon, rectify},
    model::landmark_model::LandmarkModel,
    params::Params,
    recognise::{
        alignment::{
            aligner::{Aligner, SamplingGrids, Template},
            surroundings::Surroundings,
        },
        decision::result::{MAX_CANDIDATES, MatchRefusal},
        distance_kind::DistanceKind,
        features::{
            correlation::{Buckets, CorrelationParams, correlation},
            descriptor::describe,
            harris::harris,
        },
        params::VerdictParams,
        retrieval::nearest::{NearLandmark, QuadReading, correlation_as_found, least_hausdorff},
        step_listener::{RecogniseStep, StepListener},
        verification::{
            content::{Content, content},
            gradient_similarity::{Smoothed, between},
        },
    },
};

/// A near landmark, with or without alignment.
pub(crate) struct VerifiedLandmark {
    pub(crate) near: NearLandmark,
    /// The aligned corners, if the distances are those after alignment.
    pub(crate) moved: Option<Corners>,
    /// Share of the buckets that contradict after alignment, 0 to 1.
    pub(crate) contradicting: f64,
    /// Content beyond the frame; [`Content::NONE`] unless the likeness is within reach.
    pub(crate) content: Content,
}

impl VerifiedLandmark {
    /// Not aligned.
    pub(crate) fn new(near: NearLandmark) -> Self {
        Self { near, moved: None, contradicting: 0.0, content: Content::NONE }
    }

    /// The first gate that refuses it.
    /// `share` scales tau of the likeness for the size of the map.
    pub(crate) fn refusal(&self, kind: DistanceKind, share: f64, p: &VerdictParams) -> Option<MatchRefusal> {
        // Alignment favours the template, so its limit is stricter, except for `Both`: its tau was
        // learnt after alignment.
        let limit = if self.moved.is_some() { p.verified_share } else { 1.0 };
        // Written so that a NaN refuses.
        let below = |ratio: f64, limit: f64| ratio < limit;
        let correlation = below(self.near.correlation_ratio(), limit);
        let hausdorff = below(self.near.hausdorff_ratio(), limit);
        let doubtful = !below(self.near.ratio(kind), share * p.doubtful_share);
        let contradicted = !below(self.contradicting, p.max_contradicting.next_up());
        let agrees =
            |likeness: f64, shown: f64| self.content.likeness >= likeness && self.content.shown >= shown;
        let sure = agrees(p.sure_content_likeness, p.sure_content);
        let by_points = p.points && self.near.model.points.len() > p.max_icon_points;
        match kind {
            DistanceKind::Both if by_points => Some(MatchRefusal::Points),
            DistanceKind::Correlation => (!correlation).then_some(MatchRefusal::Correlation),
            DistanceKind::Hausdorff => (!hausdorff).then_some(MatchRefusal::Hausdorff),
            DistanceKind::Both if !below(self.near.ratio(kind), share) => Some(MatchRefusal::Similarity),
            DistanceKind::Both if doubtful && contradicted => Some(MatchRefusal::Mismatch),
            DistanceKind::Both if !agrees(p.min_content_likeness, p.min_content) => {
                Some(MatchRefusal::LowContent)
            }
            DistanceKind::Both => (!correlation && !hausdorff && !sure).then_some(MatchRefusal::Correlation),
        }
    }
}

/// Aligns the quad's picture with the exemplar of each landmark of the short list; the distances
/// are those after alignment. Landmarks rejected at the coarse level are not aligned further.
pub(crate) fn verify_short_list(
    image: &GrayImage,
    readings: &[QuadReading],
    found: &mut [VerifiedLandmark],
    on: &SamplingGrids,
    p: &Params,
    watch: &mut impl StepListener,
) {
    let (c, v) = (&p.recognise.correlation, &p.recognise.verdict);
    let aligner = Aligner::new(on, &v.align);
    let mut surroundings: Vec<Option<Option<Surroundings<'_>>>> = readings.iter().map(|_| None).collect();
    let least = found.first().map_or(0.0, |f| f.near.signature - v.signature_gap).max(v.min_signature);
    for VerifiedLandmark { near, moved, contradicting, content: beyond } in found.iter_mut() {
        near.likeness = Some(0.0);
        let reading = &readings[near.reading];
        let Some(exemplar) = near.model.exemplars.get(near.exemplar).filter(|_| near.signature >= least)
        else {
            continue;
        };
        let around = surroundings[near.reading]
            .get_or_insert_with(|| Surroundings::new(image, &reading.corners_px, &reading.icon, &v.align));
        let (learnt, coarse) = exemplar.template(&v.align);
        let template = Template::new(&learnt, &coarse);
        let Some(alignment) = around.as_ref().and_then(|s| aligner.align(s, &template)) else { continue };
        let (picture, learnt) = (Smoothed::new(&alignment.icon), Smoothed::new(&learnt));
        let similarity = between(&picture, &learnt, c);
        (near.likeness, *contradicting) = (Some(similarity.likeness), similarity.contradicting);
        *moved = Some(alignment.corners_px);
        if near.ratio(DistanceKind::Both) < 1.0 {
            *beyond = content(&picture, &learnt, c);
            watch.finished(RecogniseStep::Alignment);
            (near.correlation, near.hausdorff) = distances(&alignment.icon, &near.model, p);
            watch.finished(RecogniseStep::Distances);
        }
    }
    if found.iter().any(|j| j.near.ratio(DistanceKind::Both) < 1.0) {
        compare_as_found(readings, found, c);
    }
    found.sort_by(|a, b| a.near.ratio(DistanceKind::Both).total_cmp(&b.near.ratio(DistanceKind::Both)));
    watch.finished(RecogniseStep::Alignment);
    for candidate in found.iter_mut().take(MAX_CANDIDATES).filter(|j| j.near.ratio(DistanceKind::Both) >= 1.0)
    {
        candidate.near.correlation = correlation_as_found(&candidate.near, readings, p);
    }
    watch.finished(RecogniseStep::Distances);
}

/// Sets the likeness at the detected corners for landmarks that were not aligned: the margin of an
/// accepted landmark includes them.
fn compare_as_found(readings: &[QuadReading], found: &mut [VerifiedLandmark], c: &CorrelationParams) {
    let mut smoothed: Vec<Option<Smoothed>> = vec![None; readings.len()];
    for VerifiedLandmark { near, .. } in found.iter_mut().filter(|j| j.moved.is_none()) {
        let Some(exemplar) = near.model.exemplars.get(near.exemplar) else { continue };
        let own = smoothed[near.reading].get_or_insert_with(|| Smoothed::new(&readings[near.reading].icon));
        near.likeness = Some(between(own, &Smoothed::new(&exemplar.icon()), c).likeness);
    }
}

/// C^r and H^r of an icon to the nearest of a model's exemplars. For a landmark that only points
/// identify, H^r is not computed and stays infinite.
pub(crate) fn distances(icon: &Icon, model: &LandmarkModel, p: &Params) -> (f64, f64) {
    let c = &p.recognise.correlation;
    let own = Buckets::new(icon, c);
    let each = model.exemplars.iter().map(|e| correlation(&own, &Buckets::new(&e.icon(), c), c));
    let correlation = each.fold(2.0, f64::min);
    if model.is_named_by_points(p) {
        return (correlation, f64::INFINITY);
    }
    let points = describe(icon, &harris(icon, &p.recognise.harris), &p.recognise.descriptor);
    (correlation, least_hausdorff(&points, model, p).0)
}

/// The quad's picture after its corners were moved to fit the nearest exemplar, and those corners.
pub(crate) fn aligned_with(
    image: &GrayImage,
    reading: &QuadReading,
    near: &NearLandmark,
    aligner: &Aligner<'_>,
    p: &Params,
) -> Option<(Icon, Corners)> {
    let r = &p.recognise;
    let exemplar = near.model.exemplars.get(near.exemplar)?;
    let around = Surroundings::new(image, &reading.corners_px, &reading.icon, &r.verdict.align)?;
    let (learnt, coarse) = exemplar.template(&r.verdict.align);
    let corners = aligner.align(&around, &Template::new(&learnt, &coarse))?.corners_px;
    Some((rectify(image, &corners, &p.icon).ok()?, corners))
}
