//! Points for models that were stored without any. At the start, one job for each such map is queued. It takes points from the
//! stored photographs and adds them to the models, which stay as they are otherwise. Until then, and for a landmark that fails,
//! the model without points stays in use.
//!
//! A model gets such a job once: the mark is set in the transaction that queues the job, and stays whatever the job does. A
//! lesson of the landmark gives it points at any time.

use super::{
    JobError, Jobs, ProgressReporter,
    pictures::{Pictures, points_of},
    request::Request,
    spread_work::each_of,
};
use crate::store::kind::Kind;
use crate::{
    config::Config,
    publication::Catalogue,
    store::{
        StoreError,
        jobs::{self, Ended, JobRow},
        maps,
        models::{self, ModelDigest},
        views::{self, TrainingViewRow},
    },
};
use engine::{
    panics::Edge,
    snapshot::MapSnapshot,
    threads::{self, Class},
};
use serde_json::{Value, json};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
    time::Instant,
};
use vision::model::{LandmarkId, LandmarkModel, MAX_VIEWS};

/// A model without points and the photographs to take them from.
struct Target {
    name: String,
    was: ModelDigest,
    model: Arc<LandmarkModel>,
    views: Vec<TrainingViewRow>,
}

/// The same model with points, as bytes.
struct WithPoints {
    landmark: LandmarkId,
    was: ModelDigest,
    bytes: Vec<u8>,
    points: usize,
}

impl Jobs {
    /// Queues a job for each map with models without points that were not asked for yet. What exceeds the limit of open
    /// jobs is left to the next start.
    pub(crate) async fn renew(&self) -> Result<(), StoreError> {
        for map in self.store.snapshots().all() {
            let row = match maps::get(self.store.reads(), &map.name).await {
                Ok(row) => row,
                Err(StoreError::NotFound { .. }) => continue,
                Err(error) => return Err(error),
            };
            let unasked = models::points_not_asked(self.store.reads(), row.id).await?;
            let lacking = lacking(&map, unasked);
            if lacking.is_empty() {
                continue;
            }
            let (count, ids) = (lacking.len(), lacking.keys().copied().collect::<Vec<_>>());
            let landmarks = Some(lacking.into_values().collect());
            let request = Request { landmarks, only_points: true, ..Request::default() }.to_json();
            let (name, limits) = (map.name.clone(), (self.config.limits.jobs, self.config.limits.jobs_kept));
            let write = self.store.write(move |tx| {
                Box::pin(async move {
                    models::ask_points(tx, &ids).await?;
                    jobs::create(tx, "learn", &name, &request, limits).await
                })
            });
            match write.await {
                Ok(job) => {
                    tracing::info!(
                        map = map.name,
                        landmarks = count,
                        job = job.id,
                        follows = "the job takes them from the views; recognition goes on with the models as they are",
                        "models_without_points"
                    );
                }
                Err(StoreError::Limit { what, max }) => {
                    tracing::warn!(
                        map = map.name,
                        landmarks = count,
                        what,
                        max,
                        "points are taken after the next start"
                    );
                    return Ok(());
                }
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

/// Names of the landmarks of `map` among `ids` whose model in use has no points.
fn lacking(map: &MapSnapshot, ids: BTreeSet<LandmarkId>) -> BTreeMap<LandmarkId, String> {
    let lacks = |id: &LandmarkId| map.learnt.get(id).is_some_and(|l| !l.model.knows_points);
    let named = |id: LandmarkId| Some((id, map.landmarks.get(&id)?.name.clone()));
    ids.into_iter().filter(lacks).filter_map(named).collect()
}

/// Does the job: ends its row in the same transaction as it stores the models.
pub(super) async fn run(
    store: &Catalogue,
    config: &Arc<Config>,
    row: &JobRow,
    names: Vec<String>,
    reporter: &Arc<ProgressReporter>,
) -> Result<(), JobError> {
    let started = Instant::now();
    let map = maps::get(store.reads(), &row.map).await?;
    let snapshot = store.snapshots().get(&map.name);
    let snapshot =
        snapshot.ok_or_else(|| StoreError::NotFound { what: Kind::Map, name: map.name.clone() })?;
    let names: BTreeSet<String> = names.into_iter().collect();
    let targets = targets(&snapshot, views::of_map(store.reads(), map.id).await?, &names);
    let (pictures, workers) = (Pictures::new(store, config), config.workers);
    let work = {
        let reporter = reporter.clone();
        move || -> Result<Vec<Result<WithPoints, Value>>, JobError> {
            each_of(&targets, workers, &reporter, (0.0, 0.99, "points"), |t| with_points(t, &pictures))
        }
    };
    let panics = store.vitals().panics();
    let made = threads::run(Class::Background, work).await;
    let made = panics
        .ended(Edge::Job, format_args!("job {}", row.id), "it ends as failed", made)
        .map_err(|e| JobError::Failed(format!("taking points broke off: {e}")))??;
    let (mut models, mut failed) = (Vec::new(), Vec::new());
    for made in made {
        match made {
            Ok(model) => models.push(model),
            Err(reason) => failed.push(reason),
        }
    }
    reporter.report(0.99, "storing");
    let result = json!({
        "learnt": 0,
        "with_points": models.len(),
        "points": models.iter().map(|m| m.points).sum::<usize>(),
        "failed": failed,
        "seconds": started.elapsed().as_secs_f64(),
    });
    let message = format!("{} of {} landmarks have points now", models.len(), models.len() + failed.len());
    let ended = Ended { state: "done", message, result: Some(result.to_string()) };
    let job = row.id;
    let write = store.write(move |tx| {
        Box::pin(async move {
            let map = maps::recheck(tx, map).await?;
            for m in &models {
                models::replace(tx, m.landmark, (m.was, &m.bytes), m.points).await?;
            }
            maps::bump(tx, map.id).await?;
            // A job that was cancelled stores nothing.
            if jobs::end(tx, job, &ended).await? { Ok(()) } else { Err(StoreError::Changed) }
        })
    });
    match write.await {
        Err(StoreError::Changed) => Err(JobError::Cancelled),
        done => Ok(done?),
    }
}

/// Those of `names` that still have a model without points.
fn targets(map: &MapSnapshot, all: Vec<TrainingViewRow>, names: &BTreeSet<String>) -> Vec<Target> {
    let mut of: BTreeMap<LandmarkId, Vec<TrainingViewRow>> = BTreeMap::new();
    for view in all {
        let of = of.entry(view.landmark).or_default();
        if of.len() < MAX_VIEWS {
            of.push(view);
        }
    }
    let target = |(id, info): (&LandmarkId, &engine::snapshot::LandmarkInfo)| {
        let learnt = map.learnt.get(id).filter(|l| !l.model.knows_points && names.contains(&info.name))?;
        let views = of.remove(id).unwrap_or_default();
        Some(Target { name: info.name.clone(), was: learnt.digest, model: learnt.model.clone(), views })
    };
    map.landmarks.iter().filter_map(target).collect()
}

/// The model with points, or the landmark and why it has none.
fn with_points(target: &Target, pictures: &Pictures) -> Result<WithPoints, Value> {
    let points = points_of(&target.views, pictures);
    if points.is_empty() {
        let reason = if target.views.is_empty() { "it has no views" } else { "no picture of it can be read" };
        return Err(json!({ "landmark": target.name, "reason": reason }));
    }
    let model = LandmarkModel::clone(&target.model).with_points(&points);
    let (landmark, points) = (model.id, model.points.len());
    Ok(WithPoints { landmark, was: target.was, bytes: model.to_bytes(), points })
}

#[cfg(test)]
mod tests;
