//! Derives data from a version of a map, off the runtime and outside of the writer: visibility
//! areas, then look-alike classes. Each is published as soon as it is computed, as the same version
//! of the map with more data. If a newer version replaces it meanwhile, that version takes over
//! what still holds. Areas are stored when they are published, so that a start computes none again.

use super::{build::digests, visibility_areas as areas};
use crate::store::{
    Store, StoreError,
    visibility_areas::{self, StoredArea},
};
use engine::{
    panics::Edge,
    snapshot::{LookAlikeClasses, MapSnapshot, Snapshots, look_alike_classes},
    threads::{self, Class},
    vitals::Vitals,
};
use std::{collections::BTreeMap, sync::Arc};
use tokio::sync::{Notify, watch};

/// Name of the task among the parts of the server.
const PART: &str = "the task that derives data of maps";

/// The last derived version of each map: most of its data holds for the next version.
type Last = BTreeMap<String, Arc<MapSnapshot>>;

/// Derives whenever it is woken, until told to stop.
pub(super) async fn run(
    (snapshots, store): (Arc<Snapshots>, Store),
    vitals: Arc<Vitals>,
    wake: Arc<Notify>,
    mut stopping: watch::Receiver<bool>,
) {
    let pulse = vitals.begin(PART);
    let mut last = Last::new();
    // Versions whose classes could not be derived: they stay pending, and the next version tries
    // again.
    let mut failed: BTreeMap<String, u64> = BTreeMap::new();
    loop {
        tokio::select! {
            _ = stopping.wait_for(|stop| *stop) => break,
            () = wake.notified() => {}
        }
        let is_open = |map: &MapSnapshot, failed: &BTreeMap<String, u64>| {
            map.pending.any() && failed.get(&map.name) != Some(&map.version)
        };
        while let Some(map) = snapshots.all().into_iter().find(|map| is_open(map, &failed)) {
            if *stopping.borrow() {
                break;
            }
            let before = last.remove(&map.name);
            let (done, computed) = derived(map.clone(), before, &store, &vitals).await;
            let done = Arc::new(done);
            if done.pending == map.pending {
                failed.insert(map.name.clone(), map.version);
            }
            snapshots.publish_derived(&map, &done);
            last.insert(done.name.clone(), done);
            keep(&store, computed).await;
        }
        last.retain(|name, _| snapshots.get(name).is_some());
        failed.retain(|name, _| snapshots.get(name).is_some());
    }
    pulse.end();
}

/// Stores areas. Without it they are computed again at the next start.
async fn keep(store: &Store, computed: Vec<StoredArea>) {
    match visibility_areas::put(store, computed).await {
        Ok(()) | Err(StoreError::Closed) => {}
        Err(error) => {
            let error = &error as &dyn std::error::Error;
            tracing::warn!(
                error,
                follows = "the next start computes them again",
                "visibility_areas_not_stored"
            );
        }
    }
}

/// `map` with its visibility areas, and those of them that were computed and not read.
async fn with_areas(
    map: Arc<MapSnapshot>,
    before: Option<Arc<MapSnapshot>>,
    store: &Store,
    vitals: &Vitals,
) -> Option<(areas::Areas, Vec<StoredArea>)> {
    let panics = vitals.panics();
    let (what, follows) = ("visibility areas", "those of this version are absent");
    let first = map.clone();
    let work = move || {
        #[cfg(test)]
        planting::planted(&first.name, "visibility areas");
        areas::known(&first, before.as_deref())
    };
    let made = threads::run(Class::Background, work).await;
    let (mut known, missing) = panics.ended(Edge::Publication, what, follows, made).ok()?;
    if missing.is_empty() {
        return Some((known, Vec::new()));
    }
    let wanted: Vec<_> = missing.iter().map(areas::Missing::wanted).collect();
    let stored = visibility_areas::get(store.reads(), &wanted).await;
    let work = move || {
        let computed = areas::complete(&mut known, missing, stored, &map.visibility_settings);
        #[cfg(test)]
        planting::computed(&map.name, computed.len());
        (known, computed)
    };
    let made = threads::run(Class::Background, work).await;
    panics.ended(Edge::Publication, what, follows, made).ok()
}

/// `map` with one more kind of derived data, and areas that are to be stored. The next version
/// tries again what fails. Until then, areas that fail are left out, since whoever waits for areas
/// would wait for ever. Look-alike classes that fail stay pending: without them a known pose names
/// nothing.
async fn derived(
    map: Arc<MapSnapshot>,
    before: Option<Arc<MapSnapshot>>,
    store: &Store,
    vitals: &Vitals,
) -> (MapSnapshot, Vec<StoredArea>) {
    let mut next = MapSnapshot::clone(&map);
    if map.pending.visibility {
        let made = with_areas(map, before, store, vitals).await;
        next.pending.visibility = false;
        let Some((areas, computed)) = made else { return (next, Vec::new()) };
        next.visibility = areas;
        return (next, computed);
    }
    let panics = vitals.panics();
    let work = move || {
        #[cfg(test)]
        planting::planted(&map.name, "look-alike classes");
        look_alikes(&map, before.as_deref())
    };
    let made = threads::run(Class::Background, work).await;
    let follows = "robots relocalise by unique landmarks only, and a pose names none";
    let made = panics.ended(Edge::Publication, "look-alike classes", follows, made);
    if let Ok(classes) = made {
        next.look_alikes = classes;
        next.pending.look_alikes = false;
    }
    (next, Vec::new())
}

fn look_alikes(map: &MapSnapshot, before: Option<&MapSnapshot>) -> Arc<LookAlikeClasses> {
    let is_same = |b: &&MapSnapshot| {
        !b.pending.look_alikes && b.distance == map.distance && digests(&b.learnt).eq(digests(&map.learnt))
    };
    match before.filter(is_same) {
        Some(before) => before.look_alikes.clone(),
        None => Arc::new(look_alike_classes(&map.learnt, map.distance, &map.params)),
    }
}

#[cfg(test)]
pub(super) mod planting {
    use std::sync::{Mutex, PoisonError};

    /// Derivations that panic: name of the map, and what is derived. Tests that plant use maps of
    /// their own names.
    static PLANTED: Mutex<Vec<(&str, &str)>> = Mutex::new(Vec::new());

    /// Plants a panic.
    pub(super) fn plant(map: &'static str, what: &'static str) {
        PLANTED.lock().unwrap_or_else(PoisonError::into_inner).push((map, what));
    }

    /// Takes all panics of a map away.
    pub(super) fn clear(map: &str) {
        PLANTED.lock().unwrap_or_else(PoisonError::into_inner).retain(|(planted, _)| *planted != map);
    }

    /// Areas that were computed, by map.
    static COMPUTED: Mutex<Vec<(String, usize)>> = Mutex::new(Vec::new());

    pub(super) fn computed(map: &str, count: usize) {
        COMPUTED.lock().unwrap_or_else(PoisonError::into_inner).push((map.to_owned(), count));
    }

    /// How many areas of a map were computed since the last call.
    pub(super) fn computed_of(map: &str) -> usize {
        let mut all = COMPUTED.lock().unwrap_or_else(PoisonError::into_inner);
        all.extract_if(.., |(of, _)| of == map).map(|(_, count)| count).sum()
    }

    pub(super) fn planted(map: &str, what: &str) {
        let is_planted = PLANTED.lock().unwrap_or_else(PoisonError::into_inner).contains(&(map, what));
        assert!(!is_planted, "planted: {what}");
    }
}

#[cfg(test)]
mod tests;
