//! Which objects of a drive are those of drives before it. In: drives whose objects were followed.
//! Out: pairs of objects that may be one, by what they show; the joint estimate says which are.

use super::{
    follow::{Followed, Stated},
    look_alikes::{FrameLook, model, recognised},
    parallel::Effort,
    solution::building,
    surveyed::SurveyedBuilding,
};
use std::{collections::BTreeMap, sync::Arc};
use vision::{
    model::{LandmarkId, ModelSet},
    params::Params,
    recognise::Verdict,
};

/// Frames in which an object must be named as one of a drive before.
const MIN_NAMED: usize = 2;

/// Pairs of objects, numbered through over all drives: an earlier one, and that of a later drive
/// that is named as it.
pub(super) fn pairs(
    drives: &[Followed<'_>],
    stated: &Stated,
    (params, effort): (&Params, Effort<'_>),
) -> Vec<[usize; 2]> {
    let mut made = Vec::new();
    let (mut models, mut first) = (Vec::new(), 0);
    for (number, of) in drives.iter().enumerate() {
        let alone = building(of.found.clone(), &of.map, stated);
        let mut known = BTreeMap::new();
        if number > 0
            && let Ok(set) = ModelSet::in_use(models.iter().cloned(), params)
        {
            known = named(of, &alone, &set, (params, effort));
            made.extend(known.iter().map(|(object, earlier)| [*earlier, first + object]));
        }
        // What is new of this drive is looked for in the next.
        let fresh: Vec<usize> = (0..alone.objects.len())
            .filter(|object| alone.objects[*object].refused.is_none() && !known.contains_key(object))
            .collect();
        let learnt = effort.of_each(&fresh, "learning", |_, object| {
            let id = LandmarkId((first + object) as u64);
            model(of.drive, &alone.objects[*object], id, params).map(Arc::new)
        });
        models.extend(learnt.into_iter().flatten());
        first += of.found.len();
    }
    made
}

/// The objects of a drive that are named as an earlier one, each with that: those that are named so
/// most often, each earlier one once.
fn named(
    of: &Followed<'_>,
    alone: &SurveyedBuilding,
    models: &ModelSet,
    (params, effort): (&Params, Effort<'_>),
) -> BTreeMap<usize, usize> {
    let votes = effort.of_each(&of.drive.frames, "finding again", |number, frame| {
        let look = FrameLook::new(alone, number, frame)?;
        let seen = recognised(frame, models, params);
        let at = seen.into_iter().filter_map(|(result, corners)| {
            let Verdict::Unique(id) = result.verdict else { return None };
            Some((id.0 as usize, look.at(&corners, &alone.objects)?))
        });
        Some(at.collect::<Vec<_>>())
    });
    let mut counted: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    votes.into_iter().flatten().flatten().for_each(|pair| *counted.entry(pair).or_default() += 1);
    let mut all: Vec<((usize, usize), usize)> =
        counted.into_iter().filter(|(_, times)| *times >= MIN_NAMED).collect();
    // Stable: of equal counts the first pair goes before.
    all.sort_by_key(|(_, times)| std::cmp::Reverse(*times));
    let mut made: BTreeMap<usize, usize> = BTreeMap::new();
    for ((earlier, object), _) in all {
        if !made.contains_key(&object) && !made.values().any(|taken| *taken == earlier) {
            made.insert(object, earlier);
        }
    }
    made
}
