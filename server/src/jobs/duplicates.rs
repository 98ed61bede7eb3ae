//! Landmarks that look like one in use. In: models whose icons the thresholds do not separate, with
//! their places. Out: the landmarks of the lesson that are refused, each with the one that it looks
//! like.
//!
//! Two landmarks at different places are two objects: a known pose tells them apart, and both stay.
//! Otherwise nothing ever would, so the newer one is refused and the one in use stays as it is.

use super::{look_alikes::LookAlike, negatives::Negatives};
use map::place::LandmarkPlace;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use vision::{
    learn::{add_negatives, unlikeness_of},
    model::{LandmarkId, LandmarkModel},
    params::Params,
};

/// A landmark that may look like another one.
pub(super) struct Suspect {
    /// Its model, with thresholds as if it had no look-alikes.
    pub(super) model: LandmarkModel,
    /// Where it is (map frame).
    pub(super) place: Option<LandmarkPlace>,
    /// It is taught by this lesson.
    pub(super) is_taught: bool,
    /// It was in use before the lesson, by its picture or by a known pose.
    pub(super) was_in_use: bool,
}

/// Of the taught landmarks those that look like one that stays. Landmarks outside of the lesson
/// stay, then those that were in use, then the one with the lowest number.
pub(super) fn refused(
    suspects: &[Suspect],
    negatives: &Negatives,
    p: &Params,
) -> BTreeMap<LandmarkId, LookAlike> {
    let mut ordered: Vec<&Suspect> = suspects.iter().collect();
    ordered.sort_by_key(|s| (s.is_taught, !s.was_in_use, s.model.id));
    let (mut kept, mut refused): (Vec<&Suspect>, _) = (Vec::new(), BTreeMap::new());
    for suspect in ordered {
        if !suspect.is_taught {
            kept.extend(suspect.was_in_use.then_some(suspect));
            continue;
        }
        let alike = |other: &&&Suspect| {
            !are_apart(suspect, other)
                && (takes(suspect, other, negatives, p) || takes(other, suspect, negatives, p))
        };
        let similarity = |other: &&Suspect| LookAlike {
            other: other.model.id,
            gradient_similarity: 1.0 - unlikeness_of(&suspect.model, negatives.of(other.model.id), p),
        };
        let found = kept.iter().filter(alike).map(similarity);
        match found.max_by(|a, b| a.gradient_similarity.total_cmp(&b.gradient_similarity)) {
            Some(other) => drop(refused.insert(suspect.model.id, other)),
            None => kept.extend(suspect.model.is_active().then_some(suspect)),
        }
    }
    refused
}

/// Whether the icons of `other` leave a landmark without a threshold.
fn takes(landmark: &Suspect, other: &Suspect, negatives: &Negatives, p: &Params) -> bool {
    add_negatives(&landmark.model, negatives.of(other.model.id), p).overlaps_others()
}

/// Whether both have places, at which they cannot be one object: farther apart than half the longer
/// side, or facing away from one another.
fn are_apart(a: &Suspect, b: &Suspect) -> bool {
    let Some((a, b)) = a.place.zip(b.place) else { return false };
    let reach_m = |l: &LandmarkPlace| 0.5 * l.size.width_m.max(l.size.height_m);
    let (from_a, from_b) = (a.map_from_landmark(), b.map_from_landmark());
    let normals = [from_a, from_b].map(|pose| pose.rotation * Vector3::x());
    (from_a.translation.vector - from_b.translation.vector).norm() > reach_m(&a).max(reach_m(&b))
        || normals[0].dot(&normals[1]) < 0.0
}

#[cfg(test)]
mod tests;
