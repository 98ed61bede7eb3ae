//! Look-alikes among the models of a map, by pairs. In: a model and the icons of the other
//! landmarks. Out: the landmarks whose icons limit its threshold, so that a person can check them.

use super::negatives::Negatives;
use vision::{
    learn::unlikeness_of,
    model::{LandmarkId, LandmarkModel},
    params::Params,
};

/// Look-alikes of one landmark that are named: the most similar.
const MAX_LOOK_ALIKES: usize = 5;

/// A landmark whose icons are nearer to a model than the threshold that the model would have
/// without look-alikes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LookAlike {
    pub(super) other: LandmarkId,
    pub(super) gradient_similarity: f64,
}

/// The landmarks that look like `model`, most similar first; none if no negative limits its
/// threshold.
pub(super) fn look_alikes(model: &LandmarkModel, negatives: &Negatives, p: &Params) -> Vec<LookAlike> {
    let nearest = model.likeness_evidence.nearest_others.first().map_or(f64::INFINITY, |d| f64::from(*d));
    let reach = p.learn.likeness_cap / p.learn.threshold.nearest_share;
    if nearest >= reach {
        return vec![];
    }
    let mut found: Vec<LookAlike> = negatives
        .by_owner()
        .filter(|(other, _)| *other != model.id)
        .map(|(other, icons)| LookAlike { other, gradient_similarity: 1.0 - unlikeness_of(model, icons, p) })
        .filter(|l| 1.0 - l.gradient_similarity < reach)
        .collect();
    found.sort_by(|a, b| b.gradient_similarity.total_cmp(&a.gradient_similarity).then(a.other.cmp(&b.other)));
    found.truncate(MAX_LOOK_ALIKES);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use vision::{
        frame::GrayImage,
        geometry::Corners,
        learn::{TrainingView, learn, refit_thresholds, synthesis},
    };

    /// Blocks of grey; another number, other blocks; `stain` paints a corner over.
    fn picture(number: usize, stain: bool) -> GrayImage {
        GrayImage::from_fn(240, 240, |u, v| {
            if stain && u > 200 && v > 200 {
                return 128;
            }
            let block = |size: usize| (u / size * 31 + v / size * 57 + size + number * 7919) as u64;
            let hash = |x: u64| (x.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 48) % 128;
            (hash(block(24)) + hash(block(60))) as u8
        })
    }

    #[test]
    fn pairs_are_named_and_others_are_not() {
        let p = Params::default();
        let whole = Corners::try_from([[-0.5, -0.5], [239.5, -0.5], [239.5, 239.5], [-0.5, 239.5]]).unwrap();
        let learnt = |id: u64, image: &GrayImage| {
            let mut views = vec![TrainingView::photographed(image, &whole, &p).unwrap()];
            views.extend(synthesis::views(image, &whole, 20, &p, id));
            learn(LandmarkId(id), &views, &[], &p).unwrap()
        };
        let models =
            [learnt(1, &picture(1, false)), learnt(2, &picture(1, true)), learnt(3, &picture(5, false))];
        let mut negatives = Negatives::default();
        for model in &models {
            negatives.add(model.id, model.features(&p.recognise));
        }
        for (i, expected) in [Some(2), Some(1), None].into_iter().enumerate() {
            let (before, after) = negatives.others(models[i].id);
            let others = [before, after].concat();
            let found = look_alikes(&refit_thresholds(&models[i], &others, &p), &negatives, &p);
            let named: Vec<LandmarkId> = found.iter().map(|l| l.other).collect();
            assert_eq!(named, expected.map(LandmarkId).into_iter().collect::<Vec<_>>(), "{found:?}");
            assert!(found.iter().all(|l| l.gradient_similarity > 0.5 && l.gradient_similarity < 1.0));
        }
    }
}
