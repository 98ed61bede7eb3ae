//! A quad and the landmarks of a map in, the landmarks with point evidence out: votes by the index,
//! homographies for the landmarks with most votes, verification of the best of these.

use crate::{
    detect::quad::Quad,
    frame::GrayImage,
    geometry::{corners::Corners, polygon::iou},
    points::{
        index::PointIndex,
        patch::{Patch, inner_px},
        point::{Point, SeenPatch},
        taught::TaughtPoint,
        verify::{Hypothesis, MAX_PATCH_POINTS, PointEvidence, Target, global_hypothesis, verified},
    },
};

/// Landmarks for which a homography is estimated.
const MAX_HYPOTHESES: usize = 8;
/// Homographies that are verified.
const MAX_VERIFIED: usize = 3;
/// Least weight of votes of a landmark: see [`PointIndex::vote`].
const MIN_VOTES: u32 = 4;
/// Landmarks with less than this share of the most votes are dropped: a look-alike gets about as
/// many.
const MIN_VOTES_SHARE: f64 = 0.2;
/// After a certain landmark, others are verified only if at least this share of their matches
/// agrees on the homography: most matches of a look-alike agree, few of a chance match.
const MIN_RIVAL_SHARE: f64 = 0.25;
/// log10 of the false alarms in one comparison below which a landmark is certain.
const LOG10_SURE: f64 = -12.0;
/// Borders of a quad that get a patch of their own: those that overlap all earlier ones by less
/// than this.
const SAME_BORDER_IOU: f64 = 0.6;
/// Most borders of a quad.
const MAX_BORDERS: usize = 2;

/// A landmark with point evidence.
#[derive(Debug, Clone, PartialEq)]
pub struct LandmarkPoints {
    /// Index of the model.
    pub model: usize,
    /// Which border of the quad: 0 for its corners, i for alternate i - 1.
    pub border: usize,
    /// Its point evidence.
    pub evidence: PointEvidence,
    /// The best evidence for the same landmark under another rotation, where there is any: a
    /// landmark that looks the same upside down has it.
    pub turned: Option<PointEvidence>,
}

/// The landmarks with point evidence in `quad`, by rising number of false alarms; each once.
pub fn search<'a>(
    image: &GrayImage,
    quad: &Quad,
    index: &PointIndex,
    taught: impl Fn(usize) -> &'a [TaughtPoint],
) -> Vec<LandmarkPoints> {
    let mut found: Vec<LandmarkPoints> = Vec::new();
    if index.is_empty() {
        return found;
    }
    for (border, corners) in borders(quad) {
        let Some(patch) = Patch::new(image, &corners, inner_px(&corners)) else { continue };
        let seen = SeenPatch::new(patch, MAX_PATCH_POINTS);
        let mut votes: Vec<(u32, usize, usize)> = Vec::new();
        let turns = if quad.upright_ambiguous { 4 } else { 1 };
        let turned: Vec<Vec<Point>> =
            (0..turns).map(|t| seen.points.iter().map(|p| p.rotated(t)).collect()).collect();
        for (turn, points) in turned.iter().enumerate() {
            let voted = index.vote(points, MAX_HYPOTHESES, MIN_VOTES);
            votes.extend(voted.into_iter().map(|(model, votes)| (votes, model, turn)));
        }
        votes.sort_by(|a, b| b.0.cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        votes.truncate(MAX_HYPOTHESES);
        let least = votes.first().map_or(0.0, |first| MIN_VOTES_SHARE * f64::from(first.0));
        votes.retain(|(votes, ..)| f64::from(*votes) >= least);
        let mut hypotheses: Vec<(usize, Target, Hypothesis)> = votes
            .into_iter()
            .filter_map(|(_, model, turn)| {
                let target = Target::new(taught(model));
                let hypothesis = global_hypothesis(&turned[turn], turn, &target)?;
                Some((model, target, hypothesis))
            })
            .collect();
        hypotheses.sort_by(|a, b| a.2.log10_matches.total_cmp(&b.2.log10_matches).then(a.0.cmp(&b.0)));
        let mut sure = false;
        for (model, target, hypothesis) in hypotheses.iter().take(MAX_VERIFIED) {
            let agreeing = hypothesis.consensus.distinct as f64 / hypothesis.distinct.max(1) as f64;
            if sure && agreeing < MIN_RIVAL_SHARE {
                continue;
            }
            let Some(evidence) = verified(&seen, hypothesis, target) else { continue };
            sure |= evidence.log10_nfa <= LOG10_SURE;
            found.push(LandmarkPoints { model: *model, border, evidence, turned: None });
        }
    }
    found.sort_by(|a, b| a.evidence.log10_nfa.total_cmp(&b.evidence.log10_nfa).then(a.model.cmp(&b.model)));
    let mut once: Vec<LandmarkPoints> = Vec::new();
    for f in found {
        match once.iter_mut().find(|o| o.model == f.model) {
            None => once.push(f),
            Some(best) if best.turned.is_none() && is_other_turn(&best.evidence, &f.evidence) => {
                best.turned = Some(f.evidence);
            }
            Some(_) => {}
        }
    }
    once
}

/// Whether two sightings of one landmark take different corners of it as the top-left one.
fn is_other_turn(a: &PointEvidence, b: &PointEvidence) -> bool {
    let apart_px = |shift| a.corners_px.rotated(shift).furthest_px(&b.corners_px);
    (1..4).any(|shift| apart_px(shift) < apart_px(0))
}

fn borders(quad: &Quad) -> Vec<(usize, Corners)> {
    let mut chosen: Vec<(usize, Corners)> = Vec::new();
    for (border, corners) in std::iter::once(&quad.corners_px).chain(&quad.alternates).enumerate() {
        let is_new = chosen.iter().all(|(_, c)| iou(c.points(), corners.points()) < SAME_BORDER_IOU);
        if chosen.len() < MAX_BORDERS && is_new {
            chosen.push((border, *corners));
        }
    }
    chosen
}
