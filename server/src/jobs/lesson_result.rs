//! What a lesson comes to: models, thresholds, refusals. It is stored in one commit with the end of
//! the job.

use super::look_alikes::LookAlike;
use crate::{
    failed_gates::{self, StoredLookAlike},
    publication::Catalogue,
    store::{
        StoreError,
        jobs::{self, Ended},
        landmarks::ModelSummary,
        maps::{self, MapRow},
        models::{self, NewModel},
        now_ms,
        refused_views::{self, SkippedView},
    },
};
use serde_json::{Map, Value, json};
use std::{collections::BTreeMap, time::Instant};
use vision::model::{LandmarkId, LandmarkModel, ModelStatus, components};

/// Models with fitted thresholds.
pub(super) struct Fitted {
    /// Those of the lesson.
    pub(super) models: Vec<LandmarkModel>,
    /// All others of the map.
    pub(super) refitted: Vec<LandmarkModel>,
    /// Which landmarks limit the threshold of which.
    pub(super) look_alikes: BTreeMap<LandmarkId, Vec<LookAlike>>,
}

/// The result of a lesson.
pub(super) struct Learnt {
    pub(super) fitted: Fitted,
    pub(super) failed: Vec<(LandmarkId, String)>,
    /// Landmarks of the lesson that are refused, and the one in use that each looks like.
    pub(super) refused: BTreeMap<LandmarkId, LookAlike>,
    /// For each landmark of the lesson, the photographs that it left out.
    pub(super) left_out: BTreeMap<LandmarkId, Vec<SkippedView>>,
}

/// Stores models, thresholds and the end of the job. Errors: `Changed` where the job was cancelled
/// meanwhile.
pub(super) async fn commit(
    store: &Catalogue,
    map: MapRow,
    job: i64,
    learnt: Learnt,
    names: &BTreeMap<LandmarkId, String>,
    started: Instant,
) -> Result<(), StoreError> {
    let name = |id: &LandmarkId| names.get(id).cloned().unwrap_or_default();
    let Learnt { fitted, failed, refused, left_out } = learnt;
    let in_use = |m: &LandmarkModel| m.is_active() && !refused.contains_key(&m.id);
    let active = fitted.models.iter().filter(|m| in_use(m)).count();
    let inactive: Vec<_> = fitted.models.iter().filter(|m| !in_use(m)).map(|m| name(&m.id)).collect();
    let failed: Vec<_> =
        failed.iter().map(|(id, reason)| json!({ "landmark": name(id), "reason": reason })).collect();
    let pair = |(id, l): (&LandmarkId, &LookAlike)| json!({ "landmark": name(id), "other": name(&l.other), "gradient_similarity": l.gradient_similarity });
    let look_alikes: Vec<_> = fitted
        .look_alikes
        .iter()
        .flat_map(|(id, found)| found.iter().map(move |l| (id, l)))
        .map(pair)
        .collect();
    let refused_pairs: Vec<_> = refused.iter().map(pair).collect();
    let result = json!({
        "look_alikes": look_alikes,
        "refused": refused_pairs,
        "learnt": fitted.models.len(),
        "active": active,
        "inactive": inactive,
        "failed": failed,
        "points": fitted.models.iter().map(|m| m.points.len()).sum::<usize>(),
        "refitted": fitted.refitted.len(),
        "left_out": left_out.values().map(Vec::len).sum::<usize>(),
        "generated_views": fitted.models.iter().map(|m| m.generated_views).sum::<usize>(),
        "seconds": started.elapsed().as_secs_f64(),
    });
    let message = format!("{active} of {} landmarks active", fitted.models.len() + failed.len());
    let ended = Ended { state: "done", message, result: Some(result.to_string()) };
    let stored = |l: &LookAlike| StoredLookAlike::new(l.other, &name(&l.other), l.gradient_similarity);
    let of = |model: &LandmarkModel| -> Vec<StoredLookAlike> {
        fitted.look_alikes.get(&model.id).into_iter().flatten().map(stored).collect()
    };
    let rows_of = |models: &[LandmarkModel]| -> Vec<NewModel> {
        models.iter().map(|model| row(model, &of(model), refused.get(&model.id).map(stored))).collect()
    };
    let refitted = with_components(store, fitted.refitted.clone()).await?;
    let rows: Vec<NewModel> = [rows_of(&fitted.models), rows_of(&refitted)].concat();
    let write = store.write(move |tx| {
        Box::pin(async move {
            let map = maps::recheck(tx, map).await?;
            for row in &rows {
                models::put(tx, map.id, row).await?;
            }
            for (landmark, views) in &left_out {
                refused_views::replace_of_lesson(tx, landmark.0 as i64, views).await?;
            }
            maps::bump(tx, map.id).await?;
            // A job that was cancelled stores nothing.
            if jobs::end(tx, job, &ended).await? { Ok(()) } else { Err(StoreError::Changed) }
        })
    });
    write.await
}

/// Stored models with their mean and modes, which are not in memory.
async fn with_components(
    store: &Catalogue,
    mut all: Vec<LandmarkModel>,
) -> Result<Vec<LandmarkModel>, StoreError> {
    for model in &mut all {
        let bytes = match models::get(store.reads(), model.id).await {
            // It was deleted meanwhile: nothing is stored of it.
            Err(StoreError::NotFound { .. }) => continue,
            bytes => bytes?,
        };
        model.components = components(&bytes).map_err(|e| StoreError::Damaged {
            what: format!("the model of landmark number {}", model.id.0),
            reason: e.to_string(),
        })?;
    }
    Ok(all)
}

/// The thresholds of a model, as they are among its facts.
pub(crate) fn thresholds_shown(model: &LandmarkModel) -> Map<String, Value> {
    let thresholds = [
        ("correlation", model.correlation),
        ("hausdorff", model.hausdorff),
        ("gradient_similarity", model.likeness),
    ];
    thresholds.map(|(name, threshold)| (name.to_owned(), json!(threshold))).into_iter().collect()
}

fn row(
    model: &LandmarkModel,
    look_alikes: &[StoredLookAlike],
    looks_like: Option<StoredLookAlike>,
) -> NewModel {
    let failures = match &model.status {
        ModelStatus::Active => &[][..],
        ModelStatus::Candidate(failures) => failures,
    };
    let mut facts = json!({
        "look_alikes": look_alikes,
        "saliency": model.saliency,
        "saliency_f": model.saliency_f,
        "stable_points": model.stable_points,
        "v_c": model.v_c,
        "photographed_v_c": model.photographed_v_c,
        "points": model.points.len(),
    });
    facts.as_object_mut().into_iter().for_each(|facts| facts.extend(thresholds_shown(model)));
    NewModel {
        landmark: model.id,
        bytes: model.to_bytes(),
        params_hash: model.params_hash,
        summary: ModelSummary {
            active: model.is_active() && looks_like.is_none(),
            reasons: failed_gates::stored(failures),
            facts: facts.to_string(),
            looks_like: looks_like.and_then(|l| serde_json::to_string(&l).ok()),
            views: (model.views - model.generated_views) as u64,
            generated_views: model.generated_views as u64,
            learnt_ms: now_ms(),
        },
    }
}
