//! `/maps/{map}/drafts`: maps that are taught and edited beside one in use, and published to it as
//! one commit.

use super::{
    AppState,
    answers::created,
    error::ApiError,
    extract::{Body, PathParams, QueryParams, after_number, name, page_limit},
    history::{newest, page_of},
    revision::IfMatch,
};
use crate::store::{
    StoreError,
    drafts::{self, DraftRow},
    history, maps,
};
use axum::{Json, extract::State, http::StatusCode};
use protos::api::{Draft, DraftDifference, NewDraft, Page, PageQuery, Problem, RollbackOutcome};
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(begin, list))
        .routes(routes!(discard))
        .routes(routes!(difference))
        .routes(routes!(publish))
}

fn shown(row: DraftRow) -> Draft {
    Draft {
        name: row.name,
        from_commit: row.from_commit as u64,
        created_ms: row.created_ms,
        revision: row.revision,
        landmarks: row.landmarks,
    }
}

/// Begins a draft of a map: a map of its own that no robot sees, with all that the map has.
#[utoipa::path(post, path = "/maps/{map}/drafts", operation_id = "createDraft",
    tag = "history", params(("map" = String, Path)), request_body = NewDraft,
    responses((status = 201, body = Draft), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "exists: the name; too_many: drafts of a map, or bytes of one map; \
     in_use: it is a draft itself"), (status = 422, body = Problem, description = "bad_name")))]
async fn begin(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    Body(new): Body<NewDraft>,
) -> Result<(StatusCode, Json<Draft>), ApiError> {
    let new_name = name("name", new.name)?;
    let made = |row: &DraftRow| (StatusCode::CREATED, shown(row.clone()));
    created(made, drafts::begin(&app.store, &map, new_name.as_str(), &app.config.limits)).await
}

/// Lists the drafts of a map, by name: all on one page.
#[utoipa::path(get, path = "/maps/{map}/drafts", operation_id = "listDrafts",
    tag = "history", params(("map" = String, Path)),
    responses((status = 200, body = Page<Draft>), (status = 404, body = Problem)))]
async fn list(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
) -> Result<Json<Page<Draft>>, ApiError> {
    let map = maps::get(app.store.reads(), &map).await?.id;
    let items: Vec<Draft> = drafts::list(app.store.reads(), map).await?.into_iter().map(shown).collect();
    Ok(Json(Page { total: items.len() as u64, items, next: None }))
}

/// Deletes a draft with all that is in it. The map stays as it is.
#[utoipa::path(delete, path = "/maps/{map}/drafts/{draft}", operation_id = "deleteDraft", tag = "history",
    params(("map" = String, Path), ("draft" = String, Path)), responses((status = 204),
    (status = 404, body = Problem, description = "unknown_draft"),
    (status = 409, body = Problem, description = "in_use: a job works on it")))]
async fn discard(
    State(app): State<AppState>,
    PathParams((map, draft)): PathParams<(String, String)>,
) -> Result<StatusCode, ApiError> {
    let write = app.store.write(move |tx| Box::pin(async move { drafts::discard(tx, &map, &draft).await }));
    write.await?;
    Ok(StatusCode::NO_CONTENT)
}

/// What publishing a draft would change of its map, and what is in the way.
#[utoipa::path(get, path = "/maps/{map}/drafts/{draft}/difference", operation_id = "getDraftDifference",
    tag = "history",
    params(("map" = String, Path), ("draft" = String, Path), PageQuery), responses((status = 200, body = DraftDifference),
    (status = 404, body = Problem, description = "unknown_draft"),
    (status = 409, body = Problem, description = "too_many: bytes of one map"),
    (status = 422, body = Problem, description = "out_of_range, invalid_value")))]
async fn difference(
    State(app): State<AppState>,
    PathParams((map, draft)): PathParams<(String, String)>,
    QueryParams(query): QueryParams<PageQuery>,
) -> Result<Json<DraftDifference>, ApiError> {
    let limit = page_limit(query.limit, app.config.limits.page)?;
    let after = after_number(&query)?;
    let found = drafts::compare(&app.store, &map, &draft).await?;
    let of = found.difference;
    let mut conn = app.store.reads().acquire().await.map_err(StoreError::during("compare"))?;
    let summary = history::summary(&mut conn, &of, i64::MAX).await?;
    let total = of.landmarks.len() as u64;
    let rows = of.landmarks.into_iter().filter(|(id, _)| *id > after).take(limit + 1).collect();
    Ok(Json(DraftDifference {
        from_commit: found.from_commit as u64,
        conflicts: found.conflicts,
        summary,
        walls: of.walls,
        landmarks: page_of(rows, limit, total),
    }))
}

/// Publishes a draft: what it has changed of the map, by one commit; then the draft is gone. A roll
/// back of that commit makes the map what it was.
#[utoipa::path(post, path = "/maps/{map}/drafts/{draft}/publish", operation_id = "publishDraft", tag = "history",
    params(("map" = String, Path), ("draft" = String, Path)), responses((status = 200, body = RollbackOutcome),
    (status = 404, body = Problem, description = "unknown_draft"),
    (status = 409, body = Problem, description = "conflict: map and draft have both changed what `conflicts` lists; in_use: a \
     job works on the map or on the draft; too_many; cycle, too_deep")))]
async fn publish(
    State(app): State<AppState>,
    PathParams((map, draft)): PathParams<(String, String)>,
    IfMatch(is): IfMatch,
) -> Result<Json<RollbackOutcome>, ApiError> {
    let id = maps::get(app.store.reads(), &map).await?.id;
    let changed = drafts::publish(&app.store, (&map, &draft), &is, &app.config.limits).await?;
    newest(&app, id, changed).await
}
