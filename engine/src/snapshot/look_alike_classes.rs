//! Look-alike classes. Thresholds fitted with negatives refuse a quad that fits several landmarks.
//! Here thresholds are fitted again without negatives, so that a quad may match every landmark of
//! its class. In: all learnt models. Out: models with lifted thresholds and the class of each. For
//! relocalisation and for guided recognition; matching by these models is never a recognition.

use super::stored_model::StoredModel;
use std::{collections::BTreeMap, sync::Arc};
use vision::{
    learn::{refit_thresholds, unlikeness_of},
    model::{LandmarkId, LandmarkModel, LimitedBy, ModelSet},
    params::Params,
    recognise::{DistanceKind, IconFeatures},
};

/// Landmarks with look-alikes; further ones are left out.
pub const MAX_LOOK_ALIKES: usize = 512;
/// Pairs of them that are compared; from then on all count as look-alikes.
pub const MAX_COMPARED: usize = 20_000;

/// The landmarks that have look-alikes.
#[derive(Debug, Default)]
pub struct LookAlikeClasses {
    /// Their models, with lifted thresholds.
    pub models: ModelSet,
    /// The landmarks that look like each, itself included.
    pub classes: BTreeMap<LandmarkId, Arc<Vec<LandmarkId>>>,
    /// The parameters without points: icons decide where points say nothing.
    pub by_icons: Params,
}

/// Whether a landmark has look-alikes: negatives limit its threshold, or leave none.
fn has_look_alikes(model: &LandmarkModel) -> bool {
    let is_limited = model.is_active() && model.likeness.limited_by == LimitedBy::NearestNegative;
    is_limited || model.is_kept_out_by_look_alikes()
}

/// The look-alike classes of a map: empty where one distance alone decides.
pub fn look_alike_classes(
    learnt: &BTreeMap<LandmarkId, StoredModel>,
    kind: DistanceKind,
    p: &Params,
) -> LookAlikeClasses {
    if kind != DistanceKind::Both {
        return LookAlikeClasses::default();
    }
    let limited = learnt.values().filter(|l| has_look_alikes(&l.model)).take(MAX_LOOK_ALIKES);
    let lifted: Vec<_> = limited
        .map(|l| Arc::new(refit_thresholds(&l.model, &[], &l.rules.over(p))))
        .filter(|m| m.is_active())
        .collect();
    let classes = connected(&lifted, p);
    let mut by_icons = p.clone();
    by_icons.recognise.verdict.points = false;
    LookAlikeClasses { models: ModelSet::new(lifted, p).unwrap_or_default(), classes, by_icons }
}

/// The connected components of "one accepts the other": nothing that looks like a member is left
/// out, though the ends of a long chain may differ.
fn connected(models: &[Arc<LandmarkModel>], p: &Params) -> BTreeMap<LandmarkId, Arc<Vec<LandmarkId>>> {
    let icons: Vec<Vec<IconFeatures>> = models.iter().map(|m| m.features(&p.recognise)).collect();
    let accepts = |a: usize, b: usize| unlikeness_of(&models[a], &icons[b], p) < models[a].likeness.tau;
    let (mut class, mut compared): (Vec<usize>, usize) = ((0..models.len()).collect(), 0);
    for i in 0..models.len() {
        for j in 0..i {
            if class[i] == class[j] {
                continue;
            }
            compared += 1;
            if compared > MAX_COMPARED || accepts(i, j) || accepts(j, i) {
                let (from, to) = (class[i], class[j]);
                class.iter_mut().filter(|c| **c == from).for_each(|c| *c = to);
            }
        }
    }
    let mut classes: BTreeMap<usize, Vec<LandmarkId>> = BTreeMap::new();
    for (model, class) in models.iter().zip(class) {
        classes.entry(class).or_default().push(model.id);
    }
    let mut by_landmark = BTreeMap::new();
    for members in classes.into_values().map(Arc::new) {
        by_landmark.extend(members.iter().map(|id| (*id, members.clone())));
    }
    by_landmark
}

#[cfg(test)]
mod tests {
    use super::*;
    use vision::{
        frame::GrayImage,
        geometry::Corners,
        learn::{TrainingView, learn, synthesis},
    };

    /// Blocks of grey with a little of its own in a corner; another number, other blocks.
    fn picture(number: usize, own: usize) -> GrayImage {
        GrayImage::from_fn(240, 240, |u, v| {
            if u > 216 && v > 216 {
                return (40 + 12 * own) as u8;
            }
            let block = |size: usize| (u / size * 31 + v / size * 57 + size + number * 7919) as u64;
            let hash = |x: u64| (x.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 48) % 128;
            (hash(block(24)) + hash(block(60))) as u8
        })
    }

    #[test]
    fn twelve_like_doors_are_one_class_and_others_are_their_own() {
        let p = Params::default();
        let whole = Corners::try_from([[-0.5, -0.5], [239.5, -0.5], [239.5, 239.5], [-0.5, 239.5]]).unwrap();
        let learnt = |id: u64, image: &GrayImage| {
            let mut views = vec![TrainingView::photographed(image, &whole, &p).unwrap()];
            views.extend(synthesis::views(image, &whole, 8, &p, id));
            Arc::new(refit_thresholds(&learn(LandmarkId(id), &views, &[], &p).unwrap(), &[], &p))
        };
        let mut models: Vec<_> = (0..12).map(|i| learnt(i, &picture(1, i as usize))).collect();
        models.extend([learnt(20, &picture(5, 0)), learnt(21, &picture(5, 3))]);
        let classes = connected(&models, &p);
        let of = |id: u64| classes[&LandmarkId(id)].iter().map(|l| l.0).collect::<Vec<_>>();
        assert_eq!(of(0), (0..12).collect::<Vec<_>>());
        assert!(Arc::ptr_eq(&classes[&LandmarkId(3)], &classes[&LandmarkId(11)]));
        assert_eq!(of(20), [20, 21]);
    }
}
