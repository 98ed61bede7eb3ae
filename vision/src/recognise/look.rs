//! Near landmarks in, the same after the quad's picture was laid on their learnt icons out: sharper evidence than any
//! distance where the quad was found. Thresholds are only read; deciding is the verdict's work.

use super::{
    DistanceKind, IconFeatures, Refusal,
    align::{Aligner, Surroundings, Template},
    compare::{Near, Sighting, least_hausdorff},
    correlation::correlation,
    features,
    likeness::likeness,
    verdict::VerdictParams,
    watch::{Step, Watch},
};
use crate::{detect::quads::Corners, frame::GrayImage, icon::rectify, params::Params};

/// A near landmark, with or without alignment.
pub(crate) struct Judged {
    pub(crate) near: Near,
    /// Where alignment moved the corners, if the distances are those after it.
    pub(crate) moved: Option<Corners>,
}

impl Judged {
    /// The first gate that refuses it.
    pub(crate) fn refusal(&self, kind: DistanceKind, p: &VerdictParams) -> Option<Refusal> {
        // The corners were moved to please the landmark, but for Both, whose tau was learnt after such moves.
        let limit = if self.moved.is_some() { p.verified_share } else { 1.0 };
        // Written so that a NaN refuses.
        let below = |ratio: f64, limit: f64| ratio < limit;
        let correlation = below(self.near.correlation_ratio(), limit);
        let hausdorff = below(self.near.hausdorff_ratio(), limit);
        match kind {
            DistanceKind::Correlation => (!correlation).then_some(Refusal::Correlation),
            DistanceKind::Hausdorff => (!hausdorff).then_some(Refusal::Hausdorff),
            DistanceKind::Both if !below(self.near.ratio(kind), 1.0) => Some(Refusal::Likeness),
            DistanceKind::Both => (!correlation && !hausdorff).then_some(Refusal::Correlation),
        }
    }
}

/// Lays the quad's picture on the exemplar of each landmark of the short list, and compares it there; the distances are
/// those of the picture where it came to lie.
pub(crate) fn look(
    image: &GrayImage,
    sightings: &[Sighting],
    found: &mut [Judged],
    p: &Params,
    watch: &mut impl Watch,
) {
    let (c, v) = (&p.recognise.correlation, &p.recognise.verdict);
    let aligner = Aligner::new(p.icon.size, c, &v.align);
    let mut surroundings: Vec<Option<Option<Surroundings<'_>>>> = sightings.iter().map(|_| None).collect();
    for Judged { near, moved } in found.iter_mut() {
        let sighting = &sightings[near.sighting];
        let Some(exemplar) = near.model.exemplars.get(near.exemplar) else { continue };
        let around = surroundings[near.sighting]
            .get_or_insert_with(|| Surroundings::new(image, &sighting.corners_px, &sighting.icon, &v.align));
        let template = Template::new(&exemplar.icon, &exemplar.coarse);
        let laid = around.as_ref().and_then(|s| aligner.align(s, &template));
        let Some(laid) = laid else {
            near.likeness = Some(likeness(&sighting.icon, &exemplar.icon, c));
            continue;
        };
        near.likeness = Some(likeness(&laid.icon, &exemplar.icon, c));
        *moved = Some(laid.corners_px);
        if near.ratio(DistanceKind::Both) < 1.0 {
            watch.finished(Step::Alignment);
            let icon = features(laid.icon, &p.recognise);
            let each = near.model.exemplars.iter().map(|e| correlation(&icon, e, c));
            (near.correlation, near.hausdorff) =
                (each.fold(2.0, f64::min), least_hausdorff(&icon.points, &near.model, p).0);
            watch.finished(Step::Distances);
        }
    }
    watch.finished(Step::Alignment);
    found.sort_by(|a, b| a.near.ratio(DistanceKind::Both).total_cmp(&b.near.ratio(DistanceKind::Both)));
}

/// Lays the quad's picture on each candidate within reach, nearest first, and keeps what the better fit says.
pub(crate) fn verify(
    image: &GrayImage,
    sightings: &[Sighting],
    found: &mut [Judged],
    kind: DistanceKind,
    p: &Params,
) {
    let v = &p.recognise.verdict;
    let aligner = Aligner::new(p.icon.size, &p.recognise.correlation, &v.align);
    for judged in found.iter_mut().filter(|j| j.near.ratio(kind) < v.verify_reach).take(v.max_verified) {
        let sighting = &sightings[judged.near.sighting];
        let Some((icon, corners_px)) = laid_on(image, sighting, &judged.near, &aligner, p) else { continue };
        let model = &judged.near.model;
        let each = model.exemplars.iter().map(|e| correlation(&icon, e, &p.recognise.correlation));
        let (correlation, hausdorff) = (each.fold(2.0, f64::min), least_hausdorff(&icon.points, model, p).0);
        let near = Near { correlation, hausdorff, ..judged.near.clone() };
        let moved = Judged { near, moved: Some(corners_px) };
        // What was accepted where it stood is not lost by a move that fits worse.
        let lost = judged.refusal(kind, v).is_none() && moved.refusal(kind, v).is_some();
        if moved.near.ratio(kind) < judged.near.ratio(kind) && !lost {
            *judged = moved;
        }
    }
    found.sort_by(|a, b| a.near.ratio(kind).total_cmp(&b.near.ratio(kind)));
}

/// The quad's picture after its corners were moved to fit the nearest exemplar, and those corners.
fn laid_on(
    image: &GrayImage,
    sighting: &Sighting,
    near: &Near,
    aligner: &Aligner<'_>,
    p: &Params,
) -> Option<(IconFeatures, Corners)> {
    let r = &p.recognise;
    let exemplar = near.model.exemplars.get(near.exemplar)?;
    let around = Surroundings::new(image, &sighting.corners_px, &sighting.icon, &r.verdict.align)?;
    let corners = aligner.align(&around, &Template::new(&exemplar.icon, &exemplar.coarse))?.corners_px;
    let icon = rectify(image, &corners, &p.icon).ok()?;
    Some((features(icon, r), corners))
}
