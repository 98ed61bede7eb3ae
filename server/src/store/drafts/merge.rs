//! What a publication would change, and what is in its way: a three-way comparison by row. In: rows
//! when the draft began, rows of the map now, rows of the draft now. A row that only the draft has
//! changed is taken from it; one that both have changed, to something else, is a conflict.

use super::{
    Both,
    rows::{Owner, RowDigest, RowKey, Rows, rows},
};
use std::collections::{BTreeMap, BTreeSet};

/// The outcome of a comparison.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Merge {
    /// Rows that the map gets from the draft, or loses because the draft has them no more.
    pub(super) changes: BTreeSet<RowKey>,
    /// In words; nothing is published while there are any.
    pub(super) conflicts: Vec<String>,
}

/// What became of a row since the draft began.
#[derive(Clone, Copy, PartialEq, Eq)]
struct RowState {
    was: bool,
    map: Option<RowDigest>,
    draft: Option<RowDigest>,
    map_changed: bool,
    draft_changed: bool,
}

/// Compares.
pub(super) fn merge(both: &Both) -> Merge {
    let map = rows(&both.map.1, Owner::Of);
    let draft = rows(&both.draft.1, |own| both.owner(own));
    let states = states(both, &map, &draft);
    let mut made = Merge::default();
    let mut in_conflict = BTreeSet::new();
    for (key, state) in &states {
        if !state.draft_changed || (state.map_changed && state.map == state.draft) {
            continue;
        }
        if state.map_changed {
            in_conflict.insert(key.clone());
        } else {
            made.changes.insert(key.clone());
        }
    }
    in_conflict.extend(changed_and_removed(&states));
    let lessons = were_both_taught(&states);
    in_conflict.retain(|key| !lessons || !matches!(key, RowKey::Model(_)));
    let words = in_conflict.iter().map(|key| in_words(both, key));
    made.conflicts = words.collect::<BTreeSet<_>>().into_iter().collect();
    if lessons {
        let text = "models: the map and the draft were both taught since the draft began, and a lesson sets the thresholds \
                    of all landmarks, so neither side's models fit the other's";
        made.conflicts.push(text.to_owned());
    }
    made.conflicts.extend(names_taken(both, &made.changes));
    made
}

fn states(both: &Both, map: &Rows, draft: &Rows) -> BTreeMap<RowKey, RowState> {
    // Rows that were there and are gone on both sides are of no matter.
    let keys: BTreeSet<&RowKey> = map.keys().chain(draft.keys()).collect();
    let state = |key: &RowKey| {
        let was = both.base.get(&key.text());
        let (map, draft) = (map.get(key).copied(), draft.get(key).copied());
        let map_changed = map != was.map(|(in_map, _)| *in_map);
        let draft_changed = draft != was.map(|(_, in_draft)| *in_draft);
        RowState { was: was.is_some(), map, draft, map_changed, draft_changed }
    };
    keys.into_iter().map(|key| (key.clone(), state(key))).collect()
}

/// Landmarks that one side has removed and the other has changed, with their views and models.
fn changed_and_removed(states: &BTreeMap<RowKey, RowState>) -> Vec<RowKey> {
    let (mut gone_from_map, mut gone_from_draft) = (BTreeSet::new(), BTreeSet::new());
    for (key, state) in states {
        if let RowKey::Landmark(of) = key
            && state.was
        {
            gone_from_map.extend(state.map.is_none().then_some(*of));
            gone_from_draft.extend(state.draft.is_none().then_some(*of));
        }
    }
    let is_lost = |(key, state): &(&RowKey, &RowState)| {
        let Some(of) = key.owner() else { return false };
        let is_edited = |changed: bool, now: Option<RowDigest>| changed && now.is_some();
        (gone_from_map.contains(&of) && is_edited(state.draft_changed, state.draft))
            || (gone_from_draft.contains(&of) && is_edited(state.map_changed, state.map))
    };
    let lost = states.iter().filter(is_lost).filter_map(|(key, _)| key.owner());
    lost.map(RowKey::Landmark).collect()
}

/// Whether both sides have learnt something. A model that went with its landmark was not learnt;
/// what is the same on both sides was not learnt on either alone.
fn were_both_taught(states: &BTreeMap<RowKey, RowState>) -> bool {
    let models =
        || states.iter().filter(|(key, state)| matches!(key, RowKey::Model(_)) && state.map != state.draft);
    models().any(|(_, state)| state.map_changed && state.map.is_some())
        && models().any(|(_, state)| state.draft_changed && state.draft.is_some())
}

/// Names that two landmarks would have after the publication.
fn names_taken(both: &Both, changes: &BTreeSet<RowKey>) -> Vec<String> {
    let is_from_draft = |of: &Owner| changes.contains(&RowKey::Landmark(*of));
    let of_draft = both.draft.1.landmarks.iter().map(|l| (both.owner(l.number), &l.name));
    let of_map = both.map.1.landmarks.iter().map(|l| (Owner::Of(l.number), &l.name));
    let after =
        of_draft.filter(|(of, _)| is_from_draft(of)).chain(of_map.filter(|(of, _)| !is_from_draft(of)));
    let mut owners: BTreeMap<&str, usize> = BTreeMap::new();
    for (_, name) in after {
        *owners.entry(name).or_default() += 1;
    }
    let twice = owners.into_iter().filter(|(_, count)| *count > 1);
    twice.map(|(name, _)| format!("landmark `{name}`: both sides have another one of this name")).collect()
}

/// A row for a person.
fn in_words(both: &Both, key: &RowKey) -> String {
    let name = |owner: &Owner| {
        let in_map = both.map.1.landmarks.iter().find(|l| Owner::Of(l.number) == *owner);
        let in_draft = || both.draft.1.landmarks.iter().find(|l| both.owner(l.number) == *owner);
        in_map.or_else(in_draft).map_or("", |l| l.name.as_str())
    };
    match key {
        RowKey::Setting(word) => format!("the setting `{word}`"),
        RowKey::Walls => "the walls".to_owned(),
        RowKey::Underlay => "the floor plan".to_owned(),
        RowKey::Landmark(of) => format!("landmark `{}`", name(of)),
        RowKey::View(of, _) => format!("a view of landmark `{}`", name(of)),
        RowKey::Model(of) => format!("the model of landmark `{}`", name(of)),
        RowKey::Distractor(_) => "what is beside the landmarks in a photograph".to_owned(),
        RowKey::Run(_) => "a reference run".to_owned(),
    }
}
