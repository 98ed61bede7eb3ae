//! A lesson: learns models of some or all landmarks of a map. In: stored training views. Out: models, thresholds and the end
//! of the job in one commit. The work runs on threads of its own, off the runtime; each decodes one stored picture at a time.
//!
//! Negatives are collected once for all landmarks. Landmarks that are not in the lesson keep their models and get the new
//! icons as further negatives.

use super::{
    JobError, ProgressReporter,
    look_alikes::{LookAlike, look_alikes},
    negatives::{Negatives, each, spread, untaught_distractors},
    pictures::{Pictures, point_views},
    points,
    request::Request,
    spread_work::each_of,
};
use crate::{
    config::Config,
    failed_gates::{self, StoredLookAlike},
    publication::Catalogue,
    store::{
        StoreError,
        jobs::{self, Ended, JobRow},
        kind::Kind,
        landmarks::ModelSummary,
        maps::{self, MapRow},
        models::{self, NewModel},
        now_ms,
        views::{self, Digest, QuadCrop, TrainingViewRow},
    },
};
use engine::{panics::Edge, snapshot::MapSnapshot};
use serde_json::json;
use std::{collections::BTreeMap, sync::Arc, time::Instant};
use vision::{
    learn::{TrainingView, add_negatives, learn, synthesis},
    model::{LandmarkId, LandmarkModel, MAX_VIEWS, ModelStatus},
    params::Params,
    points::taught::{TaughtPoint, view_points},
    recognise::{IconFeatures, features},
};

/// Views a landmark is learnt from at least: what photographs do not give is generated from them.
const VIEWS_WANTED: usize = 30;

impl Request {
    /// A lesson of these landmarks, as it is stored.
    pub(crate) fn of(landmarks: &[String]) -> String {
        Self { landmarks: Some(landmarks.to_vec()), ..Self::default() }.to_json()
    }

    pub(crate) fn to_json(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }

    /// Reads a stored request; an unreadable one (a row of another program) means every landmark.
    pub(crate) fn from_json(text: &str) -> Self {
        serde_json::from_str(text).unwrap_or_default()
    }
}

/// Everything that a lesson rests on, read at its start.
struct Material {
    pictures: Pictures,
    params: Arc<Params>,
    workers: usize,
    generated_views: Option<usize>,
    snapshot: Arc<MapSnapshot>,
    targets: Vec<LandmarkId>,
    views: BTreeMap<LandmarkId, Vec<TrainingViewRow>>,
    distractors: Vec<vision::icon::Icon>,
}

/// The result of a lesson.
struct Learnt {
    models: Vec<LandmarkModel>,
    refitted: Vec<LandmarkModel>,
    failed: Vec<(LandmarkId, String)>,
    look_alikes: BTreeMap<LandmarkId, Vec<LookAlike>>,
}

/// Does the job: ends its row in the same transaction as it stores the models.
pub(super) async fn run(
    store: &Catalogue,
    config: &Arc<Config>,
    row: &JobRow,
    reporter: &Arc<ProgressReporter>,
) -> Result<(), JobError> {
    let started = Instant::now();
    let request = Request::from_json(&row.request);
    if request.only_points {
        return points::run(store, config, row, request.landmarks.unwrap_or_default(), reporter).await;
    }
    let map = maps::get(store.reads(), &row.map).await?;
    let material = read_material(store, config, &map, &request).await?;
    let names: BTreeMap<LandmarkId, String> =
        material.snapshot.landmarks.iter().map(|(id, l)| (*id, l.name.clone())).collect();
    let work = {
        let reporter = reporter.clone();
        move || compute(&material, &reporter)
    };
    let panics = store.vitals().panics();
    let learnt = tokio::task::spawn_blocking(work).await;
    let learnt = panics
        .joined(Edge::Job, format_args!("job {}", row.id), "it ends as failed", learnt)
        .map_err(|e| JobError::Failed(format!("the lesson broke off: {e}")))??;
    reporter.report(0.99, "storing");
    match commit(store, map, row.id, learnt, &names, started).await {
        Err(StoreError::Changed) => Err(JobError::Cancelled),
        done => Ok(done?),
    }
}

async fn read_material(
    store: &Catalogue,
    config: &Arc<Config>,
    map: &MapRow,
    request: &Request,
) -> Result<Material, JobError> {
    let snapshot = store
        .snapshots()
        .get(&map.name)
        .ok_or_else(|| StoreError::NotFound { what: Kind::Map, name: map.name.clone() })?;
    let all = views::of_map(store.reads(), map.id).await?;
    let distractors: Vec<(Digest, QuadCrop)> = views::distractors(store.reads(), map.id).await?;
    let distractors = untaught_distractors(distractors, &all);
    let mut views: BTreeMap<LandmarkId, Vec<TrainingViewRow>> = BTreeMap::new();
    for view in all {
        views.entry(view.landmark).or_default().push(view);
    }
    let targets = targets(&snapshot, &views, request)?;
    Ok(Material {
        pictures: Pictures::new(store, config),
        params: config.params.clone(),
        workers: config.workers,
        generated_views: request.generated_views,
        snapshot,
        targets,
        views,
        distractors,
    })
}

fn targets(
    snapshot: &MapSnapshot,
    views: &BTreeMap<LandmarkId, Vec<TrainingViewRow>>,
    request: &Request,
) -> Result<Vec<LandmarkId>, JobError> {
    let Some(names) = &request.landmarks else {
        let all: Vec<_> = views.keys().copied().collect();
        return if all.is_empty() {
            Err(JobError::Failed("no landmark of this map has views".into()))
        } else {
            Ok(all)
        };
    };
    let id_of = |name: &String| {
        let found = snapshot.landmarks.iter().find(|(_, l)| l.name == *name);
        let (id, _) =
            found.ok_or_else(|| JobError::Failed(format!("there is no landmark `{name}` any more")))?;
        if views.contains_key(id) {
            Ok(*id)
        } else {
            Err(JobError::Failed(format!("landmark `{name}` has no views")))
        }
    };
    let mut ids = names.iter().map(id_of).collect::<Result<Vec<_>, _>>()?;
    ids.sort_unstable();
    ids.dedup();
    Ok(ids)
}

/// Three passes over the landmarks, each over all threads: views with their points, negatives, models.
fn compute(m: &Material, reporter: &ProgressReporter) -> Result<Learnt, JobError> {
    let inputs = each_of(&m.targets, m.workers, reporter, (0.0, 0.3, "views"), |id| learning_input(m, *id))?;
    let (views, points): (Vec<_>, Vec<_>) =
        inputs.into_iter().map(|input| (input.views, input.points)).unzip();
    let of_targets = || m.targets.iter().copied();
    let views: BTreeMap<LandmarkId, Vec<TrainingView>> = of_targets().zip(views).collect();
    let points: BTreeMap<LandmarkId, Vec<Vec<TaughtPoint>>> = of_targets().zip(points).collect();
    let negatives = collect_negatives(m, &views, reporter)?;
    let p = &m.params;
    let learnt = each_of(&m.targets, m.workers, reporter, (0.4, 0.9, "models"), |id| {
        let (before, after) = negatives.others(*id);
        let model = learn(*id, &views[id], before, p).map_err(|e| e.to_string())?;
        let model = model.with_points_if_used(p, || points[id].clone());
        Ok::<_, String>(negatives.with_distractors(&add_negatives(&model, after, p), p))
    })?;
    let others: Vec<LandmarkId> =
        m.snapshot.learnt.keys().filter(|id| !views.contains_key(id)).copied().collect();
    // A landmark that is learnt again is added a second time, and its older icons stay: thresholds only become stricter.
    // Learning the whole map resets them.
    let refitted = each_of(&others, m.workers, reporter, (0.9, 0.99, "thresholds of the others"), |id| {
        m.targets.iter().fold(LandmarkModel::clone(&m.snapshot.learnt[id].model), |model, target| {
            add_negatives(&model, negatives.of(*target), p)
        })
    })?;
    let models: Vec<&LandmarkModel> = learnt.iter().flatten().chain(&refitted).collect();
    let found = each_of(&models, m.workers, reporter, (0.99, 0.99, "look-alikes"), |model| {
        look_alikes(model, &negatives, p)
    })?;
    let look_alikes = models.iter().map(|m| m.id).zip(found).filter(|(_, found)| !found.is_empty()).collect();
    let mut done = Learnt { models: Vec::new(), refitted, failed: Vec::new(), look_alikes };
    for (id, result) in m.targets.iter().zip(learnt) {
        match result {
            Ok(model) => done.models.push(model),
            Err(reason) => done.failed.push((*id, reason)),
        }
    }
    Ok(done)
}

/// What a landmark is learnt from.
struct LearningInput {
    /// Its photographs and what is generated from them.
    views: Vec<TrainingView>,
    /// Points of its photographs, of at most [`MAX_POINT_VIEWS`] evenly chosen ones.
    points: Vec<Vec<TaughtPoint>>,
}

fn learning_input(m: &Material, id: LandmarkId) -> LearningInput {
    let stored = m.views.get(&id).map_or(&[][..], Vec::as_slice);
    let stored = &stored[..stored.len().min(MAX_VIEWS)];
    let mut views: Vec<TrainingView> = stored
        .iter()
        .map(|l| TrainingView {
            icon: l.crop.icon.clone(),
            corners_px: l.crop.corners_px,
            image_size_px: l.size_px,
            exact: None,
            generated: false,
        })
        .collect();
    let photographs = views.len();
    let wanted = match m.generated_views {
        Some(each) => each * photographs,
        None => VIEWS_WANTED.saturating_sub(photographs),
    };
    let wanted = wanted.min(MAX_VIEWS - photographs);
    let uses_points = m.params.recognise.verdict.points;
    let with_points: Vec<i64> = point_views(stored).filter(|_| uses_points).map(|l| l.view).collect();
    let mut points = Vec::with_capacity(with_points.len());
    for (index, view) in stored.iter().enumerate() {
        let count = (wanted + photographs - 1 - index) / photographs;
        let gives_points = with_points.contains(&view.view);
        if count == 0 && !gives_points {
            continue;
        }
        let Some(image) = m.pictures.of(view) else { continue };
        if gives_points {
            points.push(view_points(&image, &view.crop.corners_px));
        }
        // The number of the view is the seed: the same lesson gives the same model.
        let seed = view.view as u64;
        views.extend(synthesis::views(&image, &view.crop.corners_px, count, &m.params, seed));
    }
    LearningInput { views, points }
}

fn collect_negatives(
    m: &Material,
    views: &BTreeMap<LandmarkId, Vec<TrainingView>>,
    reporter: &ProgressReporter,
) -> Result<Negatives, JobError> {
    let all: Vec<LandmarkId> = m.views.keys().copied().collect();
    let count = each(all.len());
    let icons =
        each_of(&all, m.workers, reporter, (0.3, 0.4, "icons of the others"), |id| -> Vec<IconFeatures> {
            let prepare = |icon: &vision::icon::Icon| features(icon.clone(), &m.params.recognise);
            if let Some(views) = views.get(id) {
                return spread(views, count).map(|v| prepare(&v.icon)).collect();
            }
            // Not in the lesson: its photographs and, where those are few, the exemplars of its model.
            let photographs = spread(&m.views[id], count).map(|l| prepare(&l.crop.icon));
            let learnt =
                m.snapshot.learnt.get(id).into_iter().flat_map(|l| l.model.features(&m.params.recognise));
            photographs.chain(learnt).take(count).collect()
        })?;
    let mut negatives = Negatives::default();
    for (id, icons) in all.into_iter().zip(icons) {
        negatives.add(id, icons);
    }
    negatives
        .set_distractors(m.distractors.iter().map(|s| features(s.clone(), &m.params.recognise)).collect());
    Ok(negatives)
}

async fn commit(
    store: &Catalogue,
    map: MapRow,
    job: i64,
    learnt: Learnt,
    names: &BTreeMap<LandmarkId, String>,
    started: Instant,
) -> Result<(), StoreError> {
    let name = |id: &LandmarkId| names.get(id).cloned().unwrap_or_default();
    let active = learnt.models.iter().filter(|m| m.is_active()).count();
    let inactive: Vec<_> = learnt.models.iter().filter(|m| !m.is_active()).map(|m| name(&m.id)).collect();
    let failed: Vec<_> =
        learnt.failed.iter().map(|(id, reason)| json!({ "landmark": name(id), "reason": reason })).collect();
    let look_alikes: Vec<_> = learnt
        .look_alikes
        .iter()
        .flat_map(|(id, found)| found.iter().map(move |l| (id, l)))
        .map(|(id, l)| json!({ "landmark": name(id), "other": name(&l.other), "gradient_similarity": l.gradient_similarity }))
        .collect();
    let result = json!({
        "look_alikes": look_alikes,
        "learnt": learnt.models.len(),
        "active": active,
        "inactive": inactive,
        "failed": failed,
        "points": learnt.models.iter().map(|m| m.points.len()).sum::<usize>(),
        "refitted": learnt.refitted.len(),
        "generated_views": learnt.models.iter().map(|m| m.generated_views).sum::<usize>(),
        "seconds": started.elapsed().as_secs_f64(),
    });
    let message = format!("{active} of {} landmarks active", learnt.models.len() + learnt.failed.len());
    let ended = Ended { state: "done", message, result: Some(result.to_string()) };
    let of = |model: &LandmarkModel| -> Vec<StoredLookAlike> {
        let found = learnt.look_alikes.get(&model.id).map_or(&[][..], Vec::as_slice);
        let stored = |l: &LookAlike| StoredLookAlike::new(l.other, &name(&l.other), l.gradient_similarity);
        found.iter().map(stored).collect()
    };
    let models = learnt.models.iter().chain(&learnt.refitted);
    let rows: Vec<NewModel> = models.map(|model| row(model, &of(model))).collect();
    let write = store.write(move |tx| {
        Box::pin(async move {
            let map = maps::recheck(tx, map).await?;
            for row in &rows {
                models::put(tx, map.id, row).await?;
            }
            maps::bump(tx, map.id).await?;
            // A job that was cancelled stores nothing.
            if jobs::end(tx, job, &ended).await? { Ok(()) } else { Err(StoreError::Changed) }
        })
    });
    write.await
}

fn row(model: &LandmarkModel, look_alikes: &[StoredLookAlike]) -> NewModel {
    let failures = match &model.status {
        ModelStatus::Active => &[][..],
        ModelStatus::Candidate(failures) => failures,
    };
    let facts = json!({
        "correlation": model.correlation,
        "hausdorff": model.hausdorff,
        "gradient_similarity": model.likeness,
        "look_alikes": look_alikes,
        "saliency": model.saliency,
        "saliency_f": model.saliency_f,
        "stable_points": model.stable_points,
        "v_c": model.v_c,
        "photographed_v_c": model.photographed_v_c,
        "points": model.points.len(),
    });
    NewModel {
        landmark: model.id,
        bytes: model.to_bytes(),
        params_hash: model.params_hash,
        summary: ModelSummary {
            active: model.is_active(),
            reasons: failed_gates::stored(failures),
            facts: facts.to_string(),
            views: (model.views - model.generated_views) as u64,
            generated_views: model.generated_views as u64,
            learnt_ms: now_ms(),
        },
    }
}
