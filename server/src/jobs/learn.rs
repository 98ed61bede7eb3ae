//! A lesson: learns models of some or all landmarks of a map. In: stored training views. Out:
//! models, thresholds and the end of the job in one commit. The work runs on threads of its own,
//! off the runtime; each decodes one stored picture at a time.
//!
//! Negatives are collected once for all landmarks. Landmarks that are not in the lesson keep their
//! models and get the new icons as further negatives. A landmark that looks like one in use is
//! refused (`duplicates`), and changes no other.

use super::{
    JobError, ProgressReporter,
    duplicates::{Suspect, refused},
    lesson_result::{Fitted, Learnt, commit},
    look_alikes::look_alikes,
    negatives::{Negatives, each, spread, untaught_distractors},
    pictures::{Pictures, point_views},
    request::Request,
    spread_work::each_of,
};
use crate::{
    config::Config,
    publication::Catalogue,
    store::{
        StoreError,
        jobs::JobRow,
        kind::Kind,
        maps::{self, MapRow},
        models,
        pictures::Digest,
        refused_views::SkippedView,
        views::{self, QuadCrop, TrainingViewRow},
    },
};
use engine::{
    panics::Edge,
    snapshot::MapSnapshot,
    threads::{self, Class},
};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
    time::Instant,
};
use vision::{
    learn::{TrainingView, add_negatives, learn, refit_thresholds, synthesis},
    model::{LandmarkId, LandmarkModel, MAX_VIEWS},
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

/// Does the job: ends its row in the same transaction as it stores the models.
pub(super) async fn run(
    store: &Catalogue,
    config: &Arc<Config>,
    row: &JobRow,
    reporter: &Arc<ProgressReporter>,
) -> Result<(), JobError> {
    let started = Instant::now();
    let request = Request::from_json(&row.request);
    let map = maps::get(store.reads(), &row.map).await?;
    let material = read_material(store, config, &map, &request).await?;
    let names: BTreeMap<LandmarkId, String> =
        material.snapshot.landmarks.iter().map(|(id, l)| (*id, l.name.clone())).collect();
    let work = {
        let reporter = reporter.clone();
        move || compute(&material, &reporter)
    };
    let panics = store.vitals().panics();
    let learnt = threads::run(Class::Background, work).await;
    let learnt = panics
        .ended(Edge::Job, format_args!("job {}", row.id), "it ends as failed", learnt)
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
    // A refused landmark is a negative of nobody, as long as it is not learnt again.
    let refused = models::refused(store.reads(), map.id).await?;
    views.retain(|id, _| targets.contains(id) || !refused.contains(id));
    Ok(Material {
        pictures: Pictures::new(store, config),
        params: snapshot.params.clone(),
        workers: config.workers,
        generated_views: request.generated_views,
        snapshot,
        targets,
        views,
        distractors,
    })
}

impl Material {
    /// The parameters with a landmark's own weights and gates.
    fn params_of(&self, id: LandmarkId) -> Params {
        self.snapshot.landmarks.get(&id).map(|l| l.rules).unwrap_or_default().over(&self.params)
    }
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

/// Passes over the landmarks, each over all threads: views with their points, negatives, models,
/// thresholds. The thresholds are fitted a second time where landmarks are refused: their icons are
/// negatives of nobody.
fn compute(m: &Material, reporter: &ProgressReporter) -> Result<Learnt, JobError> {
    let inputs = each_of(&m.targets, m.workers, reporter, (0.0, 0.3, "views"), |id| learning_input(m, *id))?;
    let of_targets = || m.targets.iter().copied();
    let left_out = of_targets().zip(&inputs).map(|(id, input)| (id, input.left_out.clone())).collect();
    let (views, points): (Vec<_>, Vec<_>) =
        inputs.into_iter().map(|input| (input.views, input.points)).unzip();
    let views: BTreeMap<LandmarkId, Vec<TrainingView>> = of_targets().zip(views).collect();
    let points: BTreeMap<LandmarkId, Vec<Vec<TaughtPoint>>> = of_targets().zip(points).collect();
    let mut negatives = collect_negatives(m, &views, reporter)?;
    let p = &m.params;
    let made = each_of(&m.targets, m.workers, reporter, (0.4, 0.8, "models"), |id| {
        let model = learn(*id, &views[id], &[], &m.params_of(*id)).map_err(|e| e.to_string())?;
        Ok::<_, String>(model.with_points(&points[id]))
    })?;
    let (mut models, mut failed) = (Vec::new(), Vec::new());
    for (id, result) in m.targets.iter().zip(made) {
        match result {
            Ok(model) => models.push(model),
            Err(reason) => failed.push((*id, reason)),
        }
    }
    let mut fitted = fit(m, &models, &negatives, reporter)?;
    let refused = refused(&suspects(m, &models, &fitted), &negatives, p);
    if !refused.is_empty() {
        negatives.remove(&refused.keys().copied().collect());
        fitted = fit(m, &models, &negatives, reporter)?;
    }
    Ok(Learnt { fitted, failed, refused, left_out })
}

/// Fits the thresholds of the models of the lesson, and those of all others, to the negatives.
fn fit(
    m: &Material,
    models: &[LandmarkModel],
    negatives: &Negatives,
    reporter: &ProgressReporter,
) -> Result<Fitted, JobError> {
    let models = each_of(models, m.workers, reporter, (0.8, 0.9, "thresholds"), |model| {
        let p = &m.params_of(model.id);
        let (before, after) = negatives.others(model.id);
        let model = add_negatives(&add_negatives(model, before, p), after, p);
        negatives.with_distractors(&model, p)
    })?;
    let others: Vec<LandmarkId> =
        m.snapshot.learnt.keys().filter(|id| !m.targets.contains(id)).copied().collect();
    // A landmark that is learnt again is added a second time, and its older icons stay: thresholds
    // only become stricter. Learning the whole map resets them.
    let refitted = each_of(&others, m.workers, reporter, (0.9, 0.99, "thresholds of the others"), |id| {
        let p = &m.params_of(*id);
        m.targets.iter().fold(LandmarkModel::clone(&m.snapshot.learnt[id].model), |model, target| {
            add_negatives(&model, negatives.of(*target), p)
        })
    })?;
    let all: Vec<&LandmarkModel> = models.iter().chain(&refitted).collect();
    let found = each_of(&all, m.workers, reporter, (0.99, 0.99, "look-alikes"), |model| {
        look_alikes(model, negatives, &m.params)
    })?;
    let look_alikes = all.iter().map(|m| m.id).zip(found).filter(|(_, found)| !found.is_empty()).collect();
    Ok(Fitted { models, refitted, look_alikes })
}

/// The landmarks that look-alikes keep out of use, and those look-alikes.
fn suspects(m: &Material, models: &[LandmarkModel], fitted: &Fitted) -> Vec<Suspect> {
    let kept_out = fitted.models.iter().chain(&fitted.refitted).filter(|model| model.overlaps_others());
    let mut ids: BTreeSet<LandmarkId> = BTreeSet::new();
    for model in kept_out {
        if let Some(found) = fitted.look_alikes.get(&model.id) {
            ids.insert(model.id);
            ids.extend(found.iter().map(|l| l.other));
        }
    }
    let suspect = |id: LandmarkId| {
        let stored = m.snapshot.learnt.get(&id).map(|l| &*l.model);
        let taught = models.iter().find(|model| model.id == id);
        let model = taught.cloned().or_else(|| Some(refit_thresholds(stored?, &[], &m.params_of(id))))?;
        Some(Suspect {
            model,
            place: m.snapshot.landmarks.get(&id).and_then(|l| l.place),
            is_taught: taught.is_some(),
            was_in_use: stored.is_some_and(|s| s.is_active() || s.is_kept_out_by_look_alikes()),
        })
    };
    ids.into_iter().filter_map(suspect).collect()
}

/// What a landmark is learnt from.
struct LearningInput {
    /// Its photographs and what is generated from them.
    views: Vec<TrainingView>,
    /// Points of its photographs, of at most [`MAX_POINT_VIEWS`] evenly chosen ones.
    points: Vec<Vec<TaughtPoint>>,
    /// Photographs that are not in it, or only with their icons.
    left_out: Vec<SkippedView>,
}

fn learning_input(m: &Material, id: LandmarkId) -> LearningInput {
    let stored = m.views.get(&id).map_or(&[][..], Vec::as_slice);
    let (stored, beyond) = stored.split_at(stored.len().min(MAX_VIEWS));
    let mut left_out: Vec<SkippedView> =
        beyond.iter().map(|l| SkippedView { view: l.view, reason: "beyond_limit" }).collect();
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
    let with_points: Vec<i64> = point_views(stored).map(|l| l.view).collect();
    let mut points = Vec::with_capacity(with_points.len());
    for (index, view) in stored.iter().enumerate() {
        let count = (wanted + photographs - 1 - index) / photographs;
        let gives_points = with_points.contains(&view.view);
        if count == 0 && !gives_points {
            continue;
        }
        let Some(image) = m.pictures.of(view) else {
            left_out.push(SkippedView { view: view.view, reason: "picture_unreadable" });
            continue;
        };
        if gives_points {
            points.push(view_points(&image, &view.crop.corners_px));
        }
        // The number of the view is the seed: the same lesson gives the same model.
        let seed = view.view as u64;
        views.extend(synthesis::views(&image, &view.crop.corners_px, count, &m.params, seed));
    }
    LearningInput { views, points, left_out }
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
            // Not in the lesson: its photographs and, where those are few, the exemplars of its
            // model.
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

#[cfg(test)]
mod tests;
