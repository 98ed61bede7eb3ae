//! Builds the next version of a map from rows. What has not changed is taken over from the version
//! before: walls by their version number, models by their digests, visibility areas by place, walls
//! and camera. A damaged or outdated model is named and left out, never matched.

use crate::store::db;
use crate::{
    learning_rules,
    store::{
        StoreError,
        map_rows::{self, LandmarkHead, MapHead, RowState},
        maps::MapPipeline,
        modality_stats,
        models::{self, ModelDigest},
        walls,
    },
};
use db::Conn;
use engine::{
    panics::{Edge, Panics},
    snapshot::{LandmarkInfo, LookAlikeClasses, MapSnapshot, Pending, Snapshots, StoredModel},
};
use map::{
    laser_fix::WallIndex, modality_stats::ModalityMap, segments::LaserSegment, visibility::VisibilityMap,
};
use std::{collections::BTreeMap, sync::Arc};
use vision::{
    learn::LearnRules,
    model::{Components, LandmarkId, LandmarkModel, ModelSet},
    params::Params,
    recognise::DistanceKind,
};

/// The current version of a map as it is in the database, without what is derived from it; `None`
/// if the map is gone.
pub(super) async fn snapshot(
    conn: &mut Conn,
    id: i64,
    snapshots: &Snapshots,
    params: &Arc<Params>,
    panics: &Panics,
) -> Result<Option<MapSnapshot>, StoreError> {
    let Some(head) = map_rows::head(&mut *conn, id).await? else { return Ok(None) };
    let before = snapshots.get(&head.name);
    let before = before.as_deref();
    let landmarks = landmarks(&mut *conn, id, before).await?;
    let (walls, wall_index) = walls_and_index(&mut *conn, id, &head, before, panics).await?;
    let (modalities, reference_runs) = modalities(&mut *conn, id, before).await?;
    #[cfg(test)]
    tests::planted(&head.name);
    let MapPipeline { preset, distance } = head.pipeline;
    let params = preset.map_or_else(|| (**params).clone(), |preset| preset.over(params));
    let params = Arc::new(learning_rules::rules(head.learning.as_deref()).over(&params));
    let (learnt, unusable_models) = models(conn, (id, &landmarks), before, &params, panics).await?;
    for (id, reason) in &unusable_models {
        let landmark = landmarks.get(id).map_or("", |l: &LandmarkInfo| l.name.as_str());
        tracing::warn!(map = head.name, landmark, reason, "model_not_used");
    }
    let is_same =
        |before: &&MapSnapshot| before.params == params && digests(&before.learnt).eq(digests(&learnt));
    let same_models = before.filter(is_same);
    let models = match same_models {
        Some(before) => before.models.clone(),
        None => ModelSet::in_use(learnt.values().map(|l| l.model.clone()), &params).map_err(|e| {
            StoreError::Damaged { what: format!("map `{}`", head.name), reason: e.to_string() }
        })?,
    };
    let (look_alikes, look_alikes_pending) = look_alikes(distance, same_models);
    let (visibility, visibility_pending) = visibility(&landmarks, &head, before);
    Ok(Some(MapSnapshot {
        sizes: landmarks.iter().filter_map(|(id, l)| Some((*id, l.size?))).collect(),
        name: head.name,
        version: head.version,
        is_draft: head.is_draft,
        landmarks,
        models,
        look_alikes,
        learnt,
        unusable_models,
        walls,
        walls_version: head.walls_version,
        wall_index,
        modalities,
        reference_runs,
        visibility_settings: head.visibility_settings,
        visibility,
        pending: Pending { visibility: visibility_pending, look_alikes: look_alikes_pending },
        distance,
        params,
        poses: Arc::default(),
    }))
}

/// Its landmarks; only those are read whose rows have changed.
async fn landmarks(
    conn: &mut Conn,
    id: i64,
    before: Option<&MapSnapshot>,
) -> Result<BTreeMap<LandmarkId, LandmarkInfo>, StoreError> {
    let states = map_rows::row_states(&mut *conn, id).await?;
    let known = |state: &RowState| {
        let info = before?.landmarks.get(&state.id)?;
        (info.stored == state.edited && info.health == state.health).then_some(info)
    };
    let changed: Vec<_> =
        states.iter().filter(|state| known(state).is_none()).map(|state| state.id).collect();
    let mut read = map_rows::landmarks(conn, id, &changed).await?;
    let info = |state: RowState| {
        if let Some(info) = known(&state) {
            return Some((state.id, info.clone()));
        }
        let LandmarkHead { name, geometry, learning } = read.remove(&state.id)?;
        let (size, place) = (geometry.size, geometry.landmark_place());
        let rules = learning_rules::rules(learning.as_deref());
        Some((
            state.id,
            LandmarkInfo { name, size, place, health: state.health, stored: state.edited, rules },
        ))
    };
    Ok(states.into_iter().filter_map(info).collect())
}

type Walls = (Arc<Vec<LaserSegment>>, Arc<WallIndex>);

/// The walls and their index, which is built off the runtime.
async fn walls_and_index(
    conn: &mut Conn,
    id: i64,
    head: &MapHead,
    before: Option<&MapSnapshot>,
    panics: &Panics,
) -> Result<Walls, StoreError> {
    if let Some(before) = before.filter(|before| before.walls_version == head.walls_version) {
        return Ok((before.walls.clone(), before.wall_index.clone()));
    }
    let stored = walls::all_of(conn, id).await?;
    let walls: Arc<Vec<_>> = Arc::new(stored.iter().filter_map(|wall| wall.segment().ok()).collect());
    let indexed = walls.clone();
    let made = tokio::task::spawn_blocking(move || WallIndex::new(indexed.iter())).await;
    let made = panics.joined(Edge::Publication, "the index of the walls", "scans correct nothing here", made);
    Ok((walls, Arc::new(made.unwrap_or_else(|_ended| WallIndex::new([])))))
}

/// The modality statistics, and count and latest number of the reference runs that they rest on.
async fn modalities(
    conn: &mut Conn,
    id: i64,
    before: Option<&MapSnapshot>,
) -> Result<(Arc<ModalityMap>, (i64, i64)), StoreError> {
    let settings = modality_stats::settings(&mut *conn, id).await?;
    let numbers = modality_stats::run_numbers(&mut *conn, id).await?;
    let is_same = |before: &&MapSnapshot| {
        let old = &before.modalities;
        before.reference_runs == numbers
            && old.mode() == settings.mode
            && old.named().map(|(a, ..)| a).eq(&settings.named)
    };
    if let Some(before) = before.filter(is_same) {
        return Ok((before.modalities.clone(), numbers));
    }
    let runs = modality_stats::runs(conn, id).await?;
    let modalities = ModalityMap::new(settings.mode, settings.named, runs.iter().map(|run| &run.cells));
    Ok((Arc::new(modalities), numbers))
}

/// Digest of every learnt model, with the rules that it was read by.
pub(super) fn digests(
    learnt: &BTreeMap<LandmarkId, StoredModel>,
) -> impl Iterator<Item = (LandmarkId, ModelDigest, LearnRules)> + '_ {
    learnt.iter().map(|(id, model)| (*id, model.digest, model.rules))
}

/// The look-alike classes if they are known, and whether they are to be computed.
fn look_alikes(kind: DistanceKind, same_models: Option<&MapSnapshot>) -> (Arc<LookAlikeClasses>, bool) {
    if kind != DistanceKind::Both {
        return (Arc::default(), false);
    }
    match same_models.filter(|before| before.distance == kind) {
        Some(before) => (before.look_alikes.clone(), before.pending.look_alikes),
        None => (Arc::default(), true),
    }
}

type Visibility = BTreeMap<LandmarkId, Arc<VisibilityMap>>;

/// The visibility areas that are still those of their landmarks, and whether others are to be
/// computed.
fn visibility(
    landmarks: &BTreeMap<LandmarkId, LandmarkInfo>,
    head: &MapHead,
    before: Option<&MapSnapshot>,
) -> (Visibility, bool) {
    let before = before.filter(|b| {
        b.walls_version == head.walls_version && b.visibility_settings == head.visibility_settings
    });
    let (mut known, mut is_pending) = (Visibility::new(), false);
    for (id, info) in landmarks.iter().filter(|(_, info)| info.place.is_some()) {
        let same = before.filter(|b| b.landmarks.get(id).is_some_and(|was| was.place == info.place));
        match same.and_then(|b| b.visibility.get(id)) {
            Some(area) => {
                known.insert(*id, area.clone());
            }
            // Not computed yet, or the computation failed: this version tries again.
            None => is_pending = true,
        }
    }
    (known, is_pending)
}

type Models = (BTreeMap<LandmarkId, StoredModel>, BTreeMap<LandmarkId, String>);

/// Models of a map, read only where the previous snapshot has not the same by the same rules; and
/// those that must not be used.
async fn models(
    conn: &mut Conn,
    (map_id, landmarks): (i64, &BTreeMap<LandmarkId, LandmarkInfo>),
    before: Option<&MapSnapshot>,
    params: &Params,
    panics: &Panics,
) -> Result<Models, StoreError> {
    let (mut learnt, mut unusable) = Models::default();
    let before = before.filter(|map| *map.params == *params);
    for (id, digest) in models::digests(&mut *conn, map_id).await? {
        let rules = landmarks.get(&id).map(|l| l.rules).unwrap_or_default();
        let same = before.and_then(|map| map.learnt.get(&id));
        let same = same.filter(|l| l.digest == digest && l.rules == rules);
        if let Some(same) = same {
            learnt.insert(id, same.clone());
            continue;
        }
        let bytes = models::get(&mut *conn, id).await?;
        let what = format!("the model of landmark number {}", id.0);
        let read = panics.catch(Edge::Publication, &what, "it is not used", || {
            #[cfg(test)]
            tests::planted(&what);
            read_model(&bytes, digest, id, &rules.over(params))
        });
        match read.unwrap_or_else(|| Err("the server failed on the stored model; see its log".to_owned())) {
            Ok(model) => {
                learnt.insert(id, StoredModel { digest, rules, model: Arc::new(model) });
            }
            Err(reason) => {
                unusable.insert(id, reason);
            }
        }
    }
    Ok((learnt, unusable))
}

fn read_model(
    bytes: &[u8],
    digest: ModelDigest,
    id: LandmarkId,
    p: &Params,
) -> Result<LandmarkModel, String> {
    if models::digest(bytes) != digest {
        return Err("the stored model is damaged: its digest does not fit".to_owned());
    }
    let mut model = LandmarkModel::from_bytes(bytes, p).map_err(|e| e.to_string())?;
    // Only people look at them: the icons of a landmark would take twice the memory.
    model.components = Components::default();
    if model.id == id {
        Ok(model)
    } else {
        Err(format!("the stored model is that of landmark {}", model.id.0))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::cell::RefCell;

    thread_local! {
        /// Where building a snapshot panics on this thread: the name of a map, or what is read of
        /// it.
        static PLANTED: RefCell<Option<String>> = const { RefCell::new(None) };
    }

    /// Plants a panic, or takes it away.
    pub(in crate::publication) fn plant(what: Option<&str>) {
        PLANTED.set(what.map(str::to_owned));
    }

    pub(super) fn planted(what: &str) {
        let hit = PLANTED.with_borrow(|planted| planted.as_deref() == Some(what));
        assert!(!hit, "planted: {what}");
    }
}
