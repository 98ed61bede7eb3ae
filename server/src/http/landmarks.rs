//! `/maps/{map}/landmarks`: create, list, read, measure, delete.

use super::{
    App, AppState,
    answers::{Listed, created, page, selected},
    error::{ApiError, out_of_range},
    extract::{Body, PathParams, QueryParams, name, page_limit},
    landmark_aspect,
    revision::{IfMatch, Revised},
};
use crate::{
    failed_gates::{self, Evidence, Refusal, StoredLookAlike},
    jobs::{Learning, thresholds_shown},
    learning_rules,
    store::{
        landmark_learning,
        landmark_merge::{self, Merge},
        landmarks::{self, LandmarkGeometry, LandmarkRow},
        maps,
        revisions::{self, Subject},
    },
};
use axum::{Json, extract::State, http::StatusCode};
use engine::snapshot::MapSnapshot;
use map::{
    landmark_health::LandmarkHealth,
    place::{LandmarkPlace, PlaceSigmas},
};
use nalgebra::Vector3;
use protos::api::{
    FailedGate, Landmark, LandmarkHealthBody, LandmarkMerge, LandmarkModelBody, LandmarkPatch, LandmarkQuery,
    LandmarkStatus, LearningSettings, ListOrder, ListQuery, LookAlikeBody, NewLandmark, Page, Place,
    PlaceSigma, Problem, Size, SizeAndPlace,
};
use serde_json::{Map, Value, json};
use utoipa_axum::{router::OpenApiRouter, routes};
use vision::{
    model::{LandmarkId, LandmarkModel, ModelStatus},
    pose::LandmarkSize,
};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(create, list))
        .routes(routes!(get, patch, delete))
        .routes(routes!(merge))
}

/// Size and place, checked. Either may be missing.
pub(super) fn geometry(size: Option<Size>, place: Option<Place>) -> Result<LandmarkGeometry, ApiError> {
    let size = size.map(|s| LandmarkSize { width_m: s.width_m, height_m: s.height_m });
    // A place is checked with some size, a size at some place: each has its own ranges.
    let stand_in = LandmarkSize { width_m: 1.0, height_m: 1.0 };
    let centre = place.map_or(Vector3::zeros(), |p| Vector3::new(p.x_m, p.y_m, p.z_m));
    let theta_rad = place.map_or(0.0, |p| p.theta_rad);
    let (roll_rad, tilt_rad) = place.map_or((0.0, 0.0), |p| (p.roll_rad, p.tilt_rad));
    let made = LandmarkPlace::by_hand(centre, theta_rad, size.unwrap_or(stand_in), PlaceSigmas::default());
    made.and_then(|made| LandmarkPlace { roll_rad, tilt_rad, ..made }.check()).map_err(|e| {
        let outer = if matches!(e.field, "width_m" | "height_m") { "size" } else { "place" };
        out_of_range(&e, outer)
    })?;
    let place = place.map(|p| landmarks::StoredPlace {
        x_m: p.x_m,
        y_m: p.y_m,
        z_m: p.z_m,
        theta_rad: p.theta_rad,
        roll_rad: p.roll_rad,
        tilt_rad: p.tilt_rad,
        covariance: None,
    });
    Ok(LandmarkGeometry { size, place, ..LandmarkGeometry::default() })
}

/// A size within its ranges. Errors: `out_of_range`, with the side.
pub(super) fn checked_size(size: Size) -> Result<LandmarkSize, ApiError> {
    let sized = LandmarkSize { width_m: size.width_m, height_m: size.height_m };
    match LandmarkPlace::by_hand(Vector3::zeros(), 0.0, sized, PlaceSigmas::default()) {
        Ok(_) => Ok(sized),
        Err(e) => Err(ApiError::invalid("out_of_range", e.field, e.to_string())),
    }
}

fn health(body: LandmarkHealthBody) -> LandmarkHealth {
    match body {
        LandmarkHealthBody::Sound => LandmarkHealth::Sound,
        LandmarkHealthBody::Flagged => LandmarkHealth::Flagged,
        LandmarkHealthBody::Quarantined => LandmarkHealth::Quarantined,
    }
}

fn health_shown(health: LandmarkHealth) -> LandmarkHealthBody {
    match health {
        LandmarkHealth::Sound => LandmarkHealthBody::Sound,
        LandmarkHealth::Flagged => LandmarkHealthBody::Flagged,
        LandmarkHealth::Quarantined => LandmarkHealthBody::Quarantined,
    }
}

/// What is said of a landmark besides its row.
#[derive(Default)]
struct Context<'a> {
    /// Why its stored model is out of use.
    unusable: Option<String>,
    /// A job has it in work.
    learning: bool,
    /// Its model, if that can be read and it is not refused.
    model: Option<&'a LandmarkModel>,
    /// The version of the map that is in use.
    snapshot: Option<&'a MapSnapshot>,
}

/// A stored look-alike under its present name; `None` if it is gone.
fn look_alike_shown(stored: StoredLookAlike, snapshot: Option<&MapSnapshot>) -> Option<LookAlikeBody> {
    stored.shown(|id| snapshot?.landmarks.get(&id).map(|l| l.name.clone()))
}

fn refusal(stored: &str, snapshot: Option<&MapSnapshot>) -> Refusal {
    let other = serde_json::from_str(stored).ok().and_then(|l| look_alike_shown(l, snapshot));
    other.map_or(Refusal::OtherIsGone, Refusal::LooksLike)
}

/// The stored look-alikes of a model under their present names, without those that are gone.
fn look_alikes_shown(stored: &mut Value, snapshot: Option<&MapSnapshot>) -> Vec<LookAlikeBody> {
    let read: Vec<StoredLookAlike> = serde_json::from_value(stored.take()).unwrap_or_default();
    let shown: Vec<_> = read.into_iter().filter_map(|l| look_alike_shown(l, snapshot)).collect();
    *stored = json!(shown);
    shown
}

fn landmark_shown(row: LandmarkRow, context: &Context<'_>) -> Landmark {
    let (mut failed_gates, mut waived_gates, mut is_active) = (Vec::<FailedGate>::new(), Vec::new(), false);
    let model = row.model.map(|m| {
        let mut facts: Map<String, Value> = serde_json::from_str(&m.facts).unwrap_or_default();
        facts.extend(context.model.map(thresholds_shown).unwrap_or_default());
        let look_alikes = facts.get_mut("look_alikes").map(|l| look_alikes_shown(l, context.snapshot));
        // By the rules of today, which may be others than those of the lesson.
        is_active = context.model.map_or(m.active, LandmarkModel::is_active) && context.unusable.is_none();
        failed_gates = if let Some(reason) = &context.unusable {
            vec![failed_gates::stored_model(reason)]
        } else {
            let look_alike = look_alikes.into_iter().flatten().next();
            let refusal = m.looks_like.as_deref().map(|text| refusal(text, context.snapshot));
            let about = Evidence { look_alike, refusal, ..Evidence::default() };
            waived_gates =
                context.model.map(|m| failed_gates::in_words(&m.waived, &about)).unwrap_or_default();
            let failures = match context.model.map(|model| &model.status) {
                Some(ModelStatus::Active) => vec![],
                Some(ModelStatus::Candidate(failures)) => failures.clone(),
                None => failed_gates::from_stored(&m.reasons),
            };
            failed_gates::in_words(&failures, &about)
        };
        let (views, generated_views) = (m.views, m.generated_views);
        LandmarkModelBody { views, generated_views, learnt_ms: m.learnt_ms, facts }
    });
    let status = match &model {
        _ if context.learning => LandmarkStatus::Learning,
        None => LandmarkStatus::NotLearnt,
        Some(_) if is_active => LandmarkStatus::Active,
        Some(_) => LandmarkStatus::Inactive,
    };
    let SizeAndPlace { size, place } = row.geometry.shown();
    let sigma = row.geometry.place.and_then(|p| p.covariance).map(|c| c.diagonal().map(f64::sqrt));
    Landmark {
        health: health_shown(row.health),
        finding: row.finding.and_then(|f| serde_json::from_str(&f).ok()),
        name: row.name,
        revision: row.revision,
        status,
        failed_gates,
        waived_gates,
        learning: learning_rules::shown(row.learning.as_deref()),
        views: row.views,
        size,
        place,
        place_sigma: sigma.map(|s| PlaceSigma {
            x_m: s[0],
            y_m: s[1],
            z_m: s[3],
            theta_rad: s[2],
            width_m: s[4],
            height_m: s[5],
        }),
        model,
    }
}

/// The landmark with what only the running server knows: a model out of use, a job at work.
pub(super) fn shown(app: &App, learning: &Learning, map: &str, row: LandmarkRow) -> Landmark {
    let snapshot = app.store.snapshots().get(map);
    let snapshot = snapshot.as_deref();
    let id = LandmarkId(row.id as u64);
    let unusable = snapshot.and_then(|s| s.unusable_models.get(&id).cloned());
    let learning = learning.has(&row.name) && row.views > 0;
    let model = snapshot.and_then(|s| s.learnt.get(&id)).map(|learnt| &*learnt.model);
    landmark_shown(row, &Context { unusable, learning, model, snapshot })
}

/// Creates a landmark without views.
#[utoipa::path(post, path = "/maps/{map}/landmarks", operation_id = "createLandmark",
    tag = "landmarks", params(("map" = String, Path)),
    request_body = NewLandmark, responses((status = 201, body = Landmark), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "exists, too_many"),
    (status = 422, body = Problem, description = "bad_name, invalid_value, out_of_range")))]
async fn create(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    Body(new): Body<NewLandmark>,
) -> Result<(StatusCode, Json<Landmark>), ApiError> {
    let (name, geometry) = (name("name", new.name)?, geometry(new.size, new.place)?);
    let max = app.config.limits.landmarks;
    let write = app.store.write(move |tx| {
        Box::pin(async move { landmarks::create(tx, &map, name.as_str(), geometry, max).await })
    });
    let shown = |row: &LandmarkRow| (StatusCode::CREATED, landmark_shown(row.clone(), &Context::default()));
    created(shown, write).await
}

impl Listed for LandmarkRow {
    fn name(&self) -> &str {
        &self.name
    }

    fn changed_ms(&self) -> Option<i64> {
        Some(self.changed_ms)
    }
}

/// Lists the landmarks of a map.
#[utoipa::path(get, path = "/maps/{map}/landmarks", operation_id = "listLandmarks",
    tag = "landmarks", params(("map" = String, Path), LandmarkQuery),
    responses((status = 200, body = Page<Landmark>), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range, invalid_value")))]
async fn list(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    QueryParams(query): QueryParams<LandmarkQuery>,
) -> Result<Json<Page<Landmark>>, ApiError> {
    let limits = &app.config.limits;
    let map = maps::get(app.store.reads(), &map).await?;
    let learning = app.jobs.learning(&map.name).await?;
    let shown = |row| shown(&app, &learning, &map.name, row);
    let LandmarkQuery { limit, cursor, name, sort, status, health, has_place } = query;
    let is_whole = status.is_none() && health.is_none() && has_place.is_none();
    if is_whole && name.is_none() && sort.unwrap_or_default() == ListOrder::Name {
        let limit = page_limit(limit, limits.page)?;
        let after = cursor.unwrap_or_default();
        let rows = landmarks::page(app.store.reads(), map.id, &after, limit + 1).await?;
        return Ok(Json(page(rows, limit, map.landmarks, |r| r.name.clone(), shown)));
    }
    let mut rows = landmarks::page(app.store.reads(), map.id, "", limits.landmarks).await?;
    rows.retain(|row| {
        has_place.is_none_or(|wanted| row.geometry.place.is_some() == wanted)
            && health.is_none_or(|wanted| health_shown(row.health) == wanted)
            && status.is_none_or(|wanted| shown(row.clone()).status == wanted)
    });
    let Page { items, next, total } = selected(rows, &ListQuery { limit, cursor, name, sort }, limits.page)?;
    Ok(Json(Page { items: items.into_iter().map(shown).collect(), next, total }))
}

/// One landmark.
#[utoipa::path(get, path = "/maps/{map}/landmarks/{landmark}", operation_id = "getLandmark", tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path)),
    responses((status = 200, body = Landmark), (status = 404, body = Problem)))]
async fn get(
    State(app): State<AppState>,
    PathParams((map, landmark)): PathParams<(String, String)>,
) -> Result<Revised<Landmark>, ApiError> {
    maps::get(app.store.reads(), &map).await?;
    let row = landmarks::get(app.store.reads(), &map, &landmark).await?;
    let by_views = landmark_aspect::shown_by_views(&app, Some(row.id), None).await?;
    let (revision, learning) = (row.revision.clone(), app.jobs.learning(&map).await?);
    let mut landmark = shown(&app, &learning, &map, row);
    landmark_aspect::add_fact(&mut landmark, by_views);
    Ok(Revised(revision, landmark))
}

/// Renames it; sets or forgets size, place, and weights and gates of its own; sets how far it is
/// trusted. Everything that belongs to it follows the name. A size whose ratio of sides its
/// photographs contradict is refused.
#[utoipa::path(patch, path = "/maps/{map}/landmarks/{landmark}", operation_id = "updateLandmark", tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path)), request_body = LandmarkPatch,
    responses((status = 200, body = Landmark), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "exists; aspect_differs, with `stated`, `measured_aspect`, \
     `aspect_sigma` and `swapped`"),
    (status = 422, body = Problem, description = "bad_name, out_of_range, invalid_value")))]
async fn patch(
    State(app): State<AppState>,
    PathParams((map, landmark)): PathParams<(String, String)>,
    IfMatch(is): IfMatch,
    Body(changes): Body<LandmarkPatch>,
) -> Result<Revised<Landmark>, ApiError> {
    let checked = geometry(changes.size.flatten(), changes.place.flatten())?;
    if let Some(stated) = checked.size {
        let row = landmarks::get(app.store.reads(), &map, &landmark).await?;
        let by_views = landmark_aspect::shown_by_views(&app, Some(row.id), None).await?;
        landmark_aspect::check(by_views, &landmark, stated)?;
    }
    let new_name = changes.name.map(|new| name("name", new)).transpose()?;
    let (size, place) = (changes.size.is_some(), changes.place.is_some());
    let (map_name, health) = (map.clone(), changes.health.map(health));
    let learning = changes.learning.map(|own| own.map(learning_text).transpose()).transpose()?;
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            revisions::check(tx, &map, &Subject::Landmark(landmark.clone()), &is).await?;
            let landmark = match new_name {
                Some(new) => landmarks::rename(tx, &map, &landmark, new.as_str()).await?,
                None => landmark,
            };
            let changed =
                landmarks::update(tx, &map, &landmark, |old| old.edited(&checked, (size, place))).await?;
            let changed = match learning {
                Some(own) => {
                    let (text, reason) = own.unzip();
                    landmark_learning::set(tx, (&map, &landmark), text.as_deref(), reason).await?
                }
                None => changed,
            };
            match health {
                Some(health) => landmarks::set_health(tx, &map, &landmark, health, None).await,
                None => Ok(changed),
            }
        })
    });
    let changed = write.await?;
    let by_views = landmark_aspect::shown_by_views(&app, Some(changed.id), None).await?;
    let (revision, learning) = (changed.revision.clone(), app.jobs.learning(&map_name).await?);
    let mut landmark = shown(&app, &learning, &map_name, changed);
    landmark_aspect::add_fact(&mut landmark, by_views);
    Ok(Revised(revision, landmark))
}

/// Weights and gates as they are stored, and their reason. Errors: `out_of_range`, `invalid_value`.
pub(super) fn learning_text(own: LearningSettings) -> Result<(String, String), ApiError> {
    let text = learning_rules::text(&own).map_err(|(field, why)| {
        let code = if field == "reason" { "invalid_value" } else { "out_of_range" };
        ApiError::invalid(code, format!("learning.{field}"), why)
    })?;
    Ok((text, own.reason))
}

/// Makes two landmarks one: this one gets the views of `from`, and the size and place that it
/// lacks; `from` is deleted. Its model stays until it is learnt again; the history brings both
/// back.
#[utoipa::path(post, path = "/maps/{map}/landmarks/{landmark}/merge", operation_id = "mergeLandmarks",
    tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path)), request_body = LandmarkMerge,
    responses((status = 200, body = Landmark), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "too_many"),
    (status = 422, body = Problem, description = "invalid_value")))]
async fn merge(
    State(app): State<AppState>,
    PathParams((map, landmark)): PathParams<(String, String)>,
    IfMatch(is): IfMatch,
    Body(LandmarkMerge { from }): Body<LandmarkMerge>,
) -> Result<Revised<Landmark>, ApiError> {
    if from == landmark {
        return Err(ApiError::invalid("invalid_value", "from", "a landmark is not merged with itself"));
    }
    let merge = Merge { map: map.clone(), into: landmark, from, is, max: app.config.limits.views };
    let row = landmark_merge::merge(&app.store, merge).await?;
    let learning = app.jobs.learning(&map).await?;
    Ok(Revised(row.revision.clone(), shown(&app, &learning, &map, row)))
}

/// Deletes a landmark with its views and its model.
#[utoipa::path(delete, path = "/maps/{map}/landmarks/{landmark}", operation_id = "deleteLandmark", tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path)),
    responses((status = 204), (status = 404, body = Problem)))]
async fn delete(
    State(app): State<AppState>,
    PathParams((map, landmark)): PathParams<(String, String)>,
    IfMatch(is): IfMatch,
) -> Result<StatusCode, ApiError> {
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            revisions::check(tx, &map, &Subject::Landmark(landmark.clone()), &is).await?;
            landmarks::delete(tx, &map, &landmark).await
        })
    });
    write.await?;
    Ok(StatusCode::NO_CONTENT)
}
