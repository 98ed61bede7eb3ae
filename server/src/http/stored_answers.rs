//! `/answers`: what robots were told, opened again.

use super::{
    API, AppState,
    answers::page,
    error::ApiError,
    extract::{PathParams, QueryParams, number_cursor, page_limit},
    pictures::{FOREVER, IfNoneMatch, grey_answer},
};
use crate::{
    identity::Principal,
    store::stored_answers::{self, AnswerFilter, AnswerRow, OpenedAnswer},
};
use axum::{Extension, Json, extract::State, response::Response};
use engine::snapshot::MapSnapshot;
use protos::{
    api::{
        AnswerStatus, LandmarkIcon, Page, Problem, StoredAnswer, StoredAnswerQuery, StoredAnswerSummary,
        StoredQuad,
    },
    v1,
};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use utoipa_axum::{router::OpenApiRouter, routes};
use vision::model::LandmarkId;

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(list)).routes(routes!(get)).routes(routes!(icon))
}

fn summary(row: AnswerRow) -> StoredAnswerSummary {
    let AnswerRow { id, map, robot, camera, stored_ms, status, has_pose, refusal, landmarks, candidates } =
        row;
    let status = serde_json::from_value(Value::String(status)).unwrap_or(AnswerStatus::Unspecified);
    StoredAnswerSummary {
        id,
        map,
        robot,
        camera,
        stored_ms,
        status,
        has_pose,
        refusal,
        landmarks,
        candidates,
    }
}

/// Lists stored answers to frames, newest first. Of each camera the first answer of every kind is
/// stored, and one in ten seconds; at most one a second. The newest `limits.stored_answers` stay.
#[utoipa::path(get, path = "/answers", operation_id = "listAnswers", tag = "recognition", params(StoredAnswerQuery),
    responses((status = 200, body = Page<StoredAnswerSummary>),
    (status = 422, body = Problem, description = "out_of_range, invalid_value")))]
async fn list(
    State(app): State<AppState>,
    QueryParams(query): QueryParams<StoredAnswerQuery>,
    Extension(principal): Extension<Principal>,
) -> Result<Json<Page<StoredAnswerSummary>>, ApiError> {
    let limit = page_limit(query.limit, app.config.limits.page)?;
    // Every number is less than that of the first page.
    let before = number_cursor(query.cursor.as_deref())?.unwrap_or(i64::MAX);
    let StoredAnswerQuery { map, robot, camera, status, refusal, landmark, since_ms, until_ms, .. } = query;
    let filter = AnswerFilter {
        maps: principal.visible_maps(map).map(|names| json!(names).to_string()),
        robot,
        camera,
        status: status.and_then(|status| Some(json!(status).as_str()?.to_owned())),
        refusal,
        landmark,
        since_ms,
        until_ms,
    };
    let rows = stored_answers::page(app.store.reads(), &filter, before, limit + 1).await?;
    let total = stored_answers::count(app.store.reads(), &filter).await?;
    Ok(Json(page(rows, limit, total, |row| row.id.to_string(), summary)))
}

/// One stored answer: quads, the candidates with their distances and thresholds, the gates that
/// refused, the poses, that before the frame, too, and for each quad the paths of its icon and of
/// those of the candidates, and matched points.
#[utoipa::path(get, path = "/answers/{answer}", operation_id = "getAnswer",
    tag = "recognition", params(("answer" = i64, Path)),
    responses((status = 200, body = StoredAnswer), (status = 404, body = Problem)))]
async fn get(
    State(app): State<AppState>,
    PathParams(id): PathParams<i64>,
) -> Result<Json<StoredAnswer>, ApiError> {
    let OpenedAnswer { row, answer, mut icons, prior_check } =
        stored_answers::get(app.store.reads(), id).await?;
    let snapshot = app.store.snapshots().get(&row.map);
    let learnt = snapshot.as_deref().map(learnt_names).unwrap_or_default();
    let of_quad = |(index, quad): (usize, &v1::QuadAnswer)| StoredQuad {
        icon: icons.contains_key(&index).then(|| format!("{API}/answers/{id}/quads/{index}/icon")),
        matched: icons.remove(&index).flatten(),
        landmarks: compared(quad).into_iter().map(|name| landmark_icon(&row.map, name, &learnt)).collect(),
    };
    let quads = answer.quads.iter().enumerate().map(of_quad).collect();
    Ok(Json(StoredAnswer { summary: summary(row), answer, quads, prior_check }))
}

/// Names of the landmarks whose icons can be shown.
fn learnt_names(map: &MapSnapshot) -> BTreeMap<&str, LandmarkId> {
    let named = map.landmarks.iter().map(|(id, landmark)| (landmark.name.as_str(), *id));
    named.filter(|(_, id)| map.learnt.contains_key(id)).collect()
}

/// Whom a quad was compared with, the named one included, each once.
fn compared(quad: &v1::QuadAnswer) -> Vec<&str> {
    let candidates = quad.candidates.iter().map(|candidate| candidate.landmark.as_str());
    let named = [&quad.landmark, &quad.guided_landmark, &quad.doubtful_landmark].map(String::as_str);
    let mut once = BTreeSet::from([""]);
    candidates.chain(named).filter(|name| once.insert(name)).collect()
}

fn landmark_icon(map: &str, name: &str, learnt: &BTreeMap<&str, LandmarkId>) -> LandmarkIcon {
    let icon = learnt.contains_key(name).then(|| format!("{API}/maps/{map}/landmarks/{name}/icon"));
    LandmarkIcon { landmark: name.to_owned(), icon }
}

/// The icon of a quad of a stored answer, as PNG. `ETag` is its digest.
#[utoipa::path(get, path = "/answers/{answer}/quads/{quad}/icon", operation_id = "getQuadIcon", tag = "recognition",
    params(("answer" = i64, Path), ("quad" = i64, Path, description = "Index in `answer.quads`.")),
    responses((status = 200, content_type = "image/png"), (status = 304, description = "`If-None-Match` has it"), (status = 404, body = Problem)))]
async fn icon(
    State(app): State<AppState>,
    PathParams((id, quad)): PathParams<(i64, i64)>,
    known: IfNoneMatch,
) -> Result<Response, ApiError> {
    let (side, grey) = stored_answers::icon(app.store.reads(), id, quad).await?;
    // A stored answer never changes; its number never comes to mean another.
    grey_answer(&known, FOREVER, (side, &grey)).await
}
