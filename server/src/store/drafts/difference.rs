//! What a publication would change of the map, in the shape of the history's differences.

use super::{
    Both, both,
    merge::merge,
    rows::{Owner, RowKey},
};
use crate::store::{
    Store, StoreError,
    contents::LandmarkContents,
    history::{Difference, LandmarkChange, SETTINGS_OF_MAP, walls_difference},
    teaching::computed,
};
use std::collections::{BTreeMap, BTreeSet};

/// A draft compared with its map.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Compared {
    /// The commit of the map that the draft began with.
    pub(crate) from_commit: i64,
    /// Landmarks by their number in the map, new ones by that in the draft.
    pub(crate) difference: Difference,
    /// In words: what both sides have changed.
    pub(crate) conflicts: Vec<String>,
}

/// Compares. Errors: `NotFound`, `Limit`.
pub(crate) async fn compare(store: &Store, map: &str, draft: &str) -> Result<Compared, StoreError> {
    let both = both(store, map, draft).await?;
    let work = move || {
        let merge = merge(&both);
        let difference = difference(&both, &merge.changes);
        Compared { from_commit: both.from_commit, difference, conflicts: merge.conflicts }
    };
    computed(store, "a draft", work).await
}

fn number(owner: Owner) -> i64 {
    let (Owner::Of(id) | Owner::New(id)) = owner;
    id.0 as i64
}

/// What these rows of the draft change of the map.
pub(super) fn difference(both: &Both, changes: &BTreeSet<RowKey>) -> Difference {
    let in_map: BTreeMap<Owner, &LandmarkContents> =
        both.map.1.landmarks.iter().map(|l| (Owner::Of(l.number), l)).collect();
    let in_draft: BTreeMap<Owner, &LandmarkContents> =
        both.draft.1.landmarks.iter().map(|l| (both.owner(l.number), l)).collect();
    let there = super::rows::rows(&both.map.1, Owner::Of);
    let mut made = Difference::default();
    let is_changed = |word: &&'static str| changes.contains(&RowKey::Setting(word));
    made.settings = SETTINGS_OF_MAP.into_iter().filter(is_changed).collect();
    for key in changes {
        if let Some(owner) = key.owner() {
            let change = made.landmarks.entry(number(owner)).or_default();
            let (old, new) = (in_map.get(&owner).copied(), in_draft.get(&owner).copied());
            landmark_change(change, key, (old, new), there.contains_key(key));
        }
        match key {
            RowKey::Walls => made.walls = walls_difference(&both.map.1.walls, &both.draft.1.walls),
            RowKey::Underlay => made.underlay = true,
            RowKey::Run(_) => made.runs[usize::from(there.contains_key(key))] += 1,
            RowKey::Setting(_)
            | RowKey::Landmark(_)
            | RowKey::View(..)
            | RowKey::Model(_)
            | RowKey::Distractor(_) => {}
        }
    }
    made
}

fn landmark_change(
    change: &mut LandmarkChange,
    key: &RowKey,
    (old, new): (Option<&LandmarkContents>, Option<&LandmarkContents>),
    is_there: bool,
) {
    let side = |landmark: Option<&LandmarkContents>| landmark.map(|l| (l.name.clone(), l.geometry));
    let whole = LandmarkChange::of(side(old).as_ref(), side(new).as_ref());
    (change.present, change.geometry) = (whole.present, whole.geometry);
    change.names = [old.map(|l| l.name.clone()), new.or(old).map(|l| l.name.clone())];
    match key {
        RowKey::Landmark(_) => {
            change.fields = whole.fields;
            let differ = old.zip(new).is_some_and(|(old, new)| old.learning != new.learning);
            change.fields.extend(differ.then_some("learning"));
        }
        RowKey::View(..) => change.views[usize::from(is_there)] += 1,
        RowKey::Model(_) => change.model = true,
        _ => {}
    }
}
